"""Train a policy that has only its sensors by an off-policy learner: python examples/off_policy.py.

TQC (Kuznetsov et al., ICML 2020), SAC (Haarnoja et al., ICML 2018) and CrossQ (Bhatt et al., ICLR 2024), as in
Stable-Baselines3 and sb3-contrib, learn for a pilot of equal control steps; the one with the highest mean share of the
limit's speed goes on, and its best actor in all trials is kept. The networks see the last eight control steps, for
they have no memory (ours). Fluids are random, and the reward is the published one, times ten. Exploration depends on
the state (gSDE, Raffin et al., CoRL 2021) and changes twice a second, whenever the learners have updated their networks
for half a second of all robots: noise that changes at every control step hardly moves the robot, and learners of small
rewards learned to stand still. The result is an entry of the leaderboard. If
interrupted, the same command continues from its last checkpoint, with an empty replay buffer.
"""

import argparse
import copy
import io
import time
from pathlib import Path

import numpy as np
import torch
from sb3_contrib import TQC, CrossQ
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper, VecExtractDictObs, VecFrameStack
from torch import nn

from snakebench.files import write_file
from snakebench.learning.network import onnx_entry, played
from snakebench.learning.vector import SwimVecEnv
from snakebench.policy import Card
from snakebench.scoring.leaderboard import write_entry
from snakebench.scoring.trial import checkpoint_path, drawn_viscosities, trial

LEARNERS = {"tqc": TQC, "sac": SAC, "crossq": CrossQ}
SENSORS, FRAMES, JOINTS = 31, 8, 7
EVERY = 15  # control steps between updates, in which the noise stays
MEMORY = {"history": (FRAMES - 1) * SENSORS}
FLUIDS = drawn_viscosities(np.random.default_rng(0), 16)  # in which a policy is tried


class Rewarded(VecEnvWrapper):
    """Rewards times ten."""

    def reset(self):
        """The first observations."""
        return self.venv.reset()

    def step_wait(self):
        """A control step."""
        observation, reward, done, infos = self.venv.step_wait()
        return observation, 10 * reward, done, infos


class Stacked(nn.Module):
    """The mean action of a learner's actor, with its own memory of the frames that it sees."""

    def __init__(self, actor):
        super().__init__()
        self.actor = nn.Sequential(actor.latent_pi, actor.mu, nn.Tanh())

    def forward(self, observation, history):
        """Target angles [rad], and the memory after a control step."""
        seen = torch.cat([history, observation], -1)
        action = self.actor(seen.reshape(-1, FRAMES * SENSORS))
        return action.reshape(*observation.shape[:-1], JOINTS), seen[..., SENSORS:]


def learner(name, asked):
    """A learner before its first step; all have the same networks, buffer and number of updates."""
    environment = Rewarded(VecFrameStack(VecExtractDictObs(SwimVecEnv(asked.members), "sensors"), FRAMES))
    net_arch = {"pi": [256, 256], "qf": [256, 256]}
    updates = max(1, round(asked.updates * asked.members * EVERY))
    return LEARNERS[name]("MlpPolicy", environment, buffer_size=asked.buffer, learning_starts=50 * asked.members,
                          train_freq=EVERY, gradient_steps=updates, policy_kwargs={"net_arch": net_arch},
                          seed=asked.seed, use_sde=True, ent_coef="auto_0.1", device="cpu")  # fmt: skip


def share(model, seconds):
    """The mean share of the limit's speed in all fluids."""
    model.policy.set_training_mode(False)
    act = played(Stacked(model.actor), MEMORY, len(FLUIDS))
    return trial(act, FLUIDS, seconds, seconds / 2).share.mean()


class Report(BaseCallback):
    """Prints how fast the policy swims and writes a checkpoint with the time spent and the best actor."""

    def __init__(self, path, steps, seconds):
        super().__init__()
        self.path, self.every, self.seconds, self.due = path, max(1, steps // 20), seconds, 0

    def _on_training_start(self):
        self.due, self.begun = self.num_timesteps + self.every, time.monotonic() - self.model.spent

    def _on_step(self):
        if self.num_timesteps >= self.due:
            self.due += self.every
            found = share(self.model, self.seconds)
            if found > self.model.best:
                self.model.best, self.model.best_actor = found, copy.deepcopy(self.model.actor.state_dict())
            self._on_training_end()
            print(f"{self.path.stem.partition('-')[0]}: {self.num_timesteps} steps, mean share {found:.4f}", flush=True)
        return True

    def _on_training_end(self):
        self.model.spent = time.monotonic() - self.begun
        self.model.save(content := io.BytesIO())
        write_file(self.path, content.getvalue())


def trained(name, steps, asked, model=None):
    """A learner after a number of control steps; if none is given, from its checkpoint on, if there is one."""
    path = checkpoint_path(asked.out, f"{name}.zip", vars(asked), ("steps", "learners"))
    if model is None:
        model = learner(name, asked)
        model.spent, model.best, model.best_actor = 0.0, -1.0, None  # seconds of training, share, and weights
        if path.exists():
            model = LEARNERS[name].load(path, env=model.get_env(), device="cpu")
            model.learning_starts = model.num_timesteps + 50 * asked.members  # the buffer fills again
    if model.num_timesteps < steps:
        model.learn(steps - model.num_timesteps, Report(path, steps, asked.seconds), reset_num_timesteps=False)
    return model


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=200_000, help="control steps of the whole training")
    parser.add_argument("--pilot", type=int, default=40_000, help="control steps of each learner before one is chosen")
    parser.add_argument("--learners", nargs="+", choices=LEARNERS, default=list(LEARNERS), help="to choose from")
    parser.add_argument("--members", type=int, default=16, help="robots side by side")
    parser.add_argument("--updates", type=float, default=0.25, help="of the networks, for each control step of a robot")
    parser.add_argument("--buffer", type=int, default=200_000, help="control steps that are remembered")
    parser.add_argument("--seconds", type=float, default=20.0, help="of a trial swim, whose second half counts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("off_policy"), help="folder of the entry")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    pilot = min(asked.pilot, asked.steps) if len(asked.learners) > 1 else asked.steps
    models = {name: trained(name, pilot, asked) for name in asked.learners}
    print("best mean shares:", ", ".join(f"{name} {one.best:.4f}" for name, one in models.items()), flush=True)
    chosen = max(models, key=lambda name: models[name].best)
    models[chosen] = model = trained(chosen, asked.steps, asked, models[chosen])
    steps = sum(model.num_timesteps for model in models.values())
    hours = sum(model.spent for model in models.values()) / 3600
    model.actor.load_state_dict(model.best_actor)
    model.policy.set_training_mode(False)
    print(f"{chosen}: mean share {model.best:.4f}")
    about = {
        "name": f"{LEARNERS[chosen].__name__}, seed {asked.seed}",
        "training_steps": steps,
        "hours": round(hours, 3),
    }
    entry = onnx_entry(Stacked(model.actor), MEMORY, Card(lstm=()))
    path = write_entry(asked.out, entry, authors=["snakebench"], information="sensors", **about)
    print(f"{steps} control steps in {hours:.3f} h. Score it: snakebench score {path} --seed dev --quick")
