"""Rapid motor adaptation: a policy that is told the fluid, and a module that infers it: python examples/rma.py.

As in Kumar et al. (RSS 2021), a base policy learns by PPO, with an encoder of what is privileged: here the viscosity
and the head's velocity. Then an adaptation module learns to estimate the encoder's output from the last 50 control
steps, while the policy acts on these estimates. Sizes are as in the paper but for the base policy's, PPO's learning
rate adapts, and the reward is the published one (ours). Fluids are random. The result has only sensors, and is an entry
of the leaderboard. If interrupted, the same command continues from its last checkpoint.
"""

import argparse
import io
import time
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from snakebench.files import write_file
from snakebench.learning.network import onnx_entry, played
from snakebench.learning.ppo import MemorylessPPO
from snakebench.learning.vector import SwimVecEnv
from snakebench.policy import Card
from snakebench.scoring.leaderboard import write_entry
from snakebench.scoring.trial import checkpoint_path, drawn_viscosities, trial

SENSORS, PRIVILEGED, FRAMES, LATENT, JOINTS = 31, 4, 50, 8, 7
MEMORY = {"history": (FRAMES - 1) * SENSORS}
FLUIDS = drawn_viscosities(np.random.default_rng(0), 16)  # in which a policy is tried


class Told(BaseFeaturesExtractor):
    """The sensors, and the encoder's output for what is privileged."""

    def __init__(self, space):
        super().__init__(space, SENSORS + LATENT)
        self.encoder = nn.Sequential(nn.Linear(PRIVILEGED, 256), nn.ELU(), nn.Linear(256, 128), nn.ELU(),
                                     nn.Linear(128, LATENT))  # fmt: skip

    def forward(self, observation):
        """Features, shape (members, 39)."""
        return torch.cat([observation["sensors"], self.encoder(observation["privileged"])], 1)


class Base(nn.Module):
    """The base policy, which is told the fluid, without memory."""

    def __init__(self, policy):
        super().__init__()
        self.encoder = policy.features_extractor.encoder
        self.layers = nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)

    def act(self, sensors, latent):
        """Target angles [rad] for sensors and the encoder's output, or an estimate of it."""
        return self.layers(torch.cat([sensors, latent], -1)).clamp(-1.0, 1.0)

    def forward(self, observation):
        """Target angles [rad], as a tuple."""
        return (self.act(observation[..., :SENSORS], self.encoder(observation[..., SENSORS:])),)


class Adapted(nn.Module):
    """The base policy with the adaptation module in place of the encoder."""

    def __init__(self, base):
        super().__init__()
        self.base, self.embed = base, nn.Sequential(nn.Linear(SENSORS, 32), nn.ELU())
        self.filters = nn.Sequential(nn.Conv1d(32, 32, 8, 4), nn.ELU(), nn.Conv1d(32, 32, 5), nn.ELU(),
                                     nn.Conv1d(32, 32, 5), nn.ELU(), nn.Flatten(), nn.Linear(96, LATENT))  # fmt: skip

    def estimate(self, seen):
        """What the encoder would say, for the frames seen, shape (…, 50 frames of 31 numbers)."""
        frames = self.embed(seen.reshape(-1, FRAMES, SENSORS)).transpose(1, 2)
        return self.filters(frames).reshape(*seen.shape[:-1], LATENT)

    def forward(self, observation, history):
        """Target angles [rad], and the memory after a control step."""
        seen = torch.cat([history, observation], -1)
        return self.base.act(observation, self.estimate(seen)), seen[..., SENSORS:]


def share(network, memory, feels, seconds):
    """The mean share of the limit's speed in all fluids."""
    return trial(played(network, memory, len(FLUIDS)), FLUIDS, seconds, seconds / 2, feels).share.mean()


class Report(BaseCallback):
    """Prints how fast the base policy swims and writes a checkpoint, twenty times in a training."""

    def __init__(self, path, asked):
        super().__init__()
        self.path, self.asked, self.due = path, asked, 0

    def _on_training_start(self):
        self.begun = time.monotonic() - self.model.spent

    def _on_step(self):
        return True

    def _on_rollout_end(self):
        if self.num_timesteps >= self.due:
            self.due = self.num_timesteps + self.asked.steps // 20
            self._on_training_end()
            found = share(Base(self.model.policy), {}, ("sensors", "privileged"), self.asked.seconds)
            print(f"base: {self.num_timesteps} steps, mean share {found:.4f}", flush=True)

    def _on_training_end(self):
        self.model.spent = time.monotonic() - self.begun
        self.model.save(content := io.BytesIO())
        write_file(self.path, content.getvalue())


class BasePPO(MemorylessPPO):
    """PPO as Stable-Baselines3 can load it, which gives no settings to what it makes."""

    def __init__(self, *args, kl=0.01, **settings):
        super().__init__(*args, kl=kl, **settings)


def base_model(asked):
    """PPO's model after its training, or from its checkpoint on."""
    path = checkpoint_path(asked.out, "base.zip", vars(asked), ("steps", "iterations", "rollout"))
    environment = SwimVecEnv(asked.members)
    network = {"features_extractor_class": Told, "net_arch": [128, 128], "activation_fn": nn.ELU,
               "log_std_init": float(np.log(0.5))}  # fmt: skip
    settings = {"learning_rate": 1e-3, "n_steps": 24, "batch_size": asked.members * 6, "n_epochs": 5}
    model = BasePPO("MultiInputPolicy", environment, policy_kwargs=network, seed=asked.seed, device="cpu", **settings)
    model.spent = 0.0  # seconds of training
    if path.exists():
        model = BasePPO.load(path, env=environment, device="cpu")
    if model.num_timesteps < asked.steps:
        model.learn(asked.steps - model.num_timesteps, Report(path, asked), reset_num_timesteps=False)
    return model


def experience(network, environment, seen, rollout):
    """Frames seen while the estimates drive, what the encoder says of them, and the frames seen last."""
    frames, latents = [], []
    for step in range(rollout):
        groups = {name: torch.from_numpy(group) for name, group in environment.observe().items()}
        seen = seen * torch.from_numpy(~environment.starts)[:, None]
        with torch.no_grad():
            seen = torch.cat([seen[:, SENSORS:], groups["sensors"]], 1)
            action = network.base.act(groups["sensors"], network.estimate(seen))
            if step % 5 == 4:  # neighbouring windows are alike
                frames.append(seen)
                latents.append(network.base.encoder(groups["privileged"]))
        environment.step(action.numpy())
    return torch.cat(frames), torch.cat(latents), seen


def adapted(base, asked):
    """The policy with its adaptation module trained, and the seconds that it took."""
    torch.manual_seed(asked.seed)
    network, spent, done = Adapted(base.requires_grad_(False)), 0.0, 0
    path = checkpoint_path(asked.out, "adaptation.pt", vars(asked), ("iterations",))
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    if path.exists():
        state = torch.load(path)
        network.load_state_dict(state["network"])
        optimizer.load_state_dict(state["optimizer"])
        spent, done = state["spent"], state["done"]
    environment, seen = SwimVecEnv(asked.members), torch.zeros(asked.members, FRAMES * SENSORS)
    environment.seed(asked.seed + done)
    environment.reset()
    for k in range(done, asked.iterations):
        begun = time.monotonic()
        frames, latents, seen = experience(network, environment, seen, asked.rollout)
        for chosen in torch.randperm(len(frames)).split(256):
            loss = (network.estimate(frames[chosen]) - latents[chosen]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        spent += time.monotonic() - begun
        if (k + 1) % 20 == 0 or k + 1 == asked.iterations:
            state = {"network": network.state_dict(), "optimizer": optimizer.state_dict()}
            torch.save(state | {"spent": spent, "done": k + 1}, content := io.BytesIO())
            write_file(path, content.getvalue())
            found = share(network, MEMORY, ("sensors",), asked.seconds)
            print(f"adaptation: iteration {k + 1}, error {loss:.4f}, mean share {found:.4f}", flush=True)
    return network, spent


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=3_000_000, help="control steps of the base policy's training")
    parser.add_argument("--iterations", type=int, default=300, help="of the adaptation module's training")
    parser.add_argument("--rollout", type=int, default=100, help="control steps of each robot in an iteration")
    parser.add_argument("--members", type=int, default=128, help="robots side by side")
    parser.add_argument("--seconds", type=float, default=20.0, help="of a trial swim, whose second half counts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("rma"), help="folder of the entry")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    model = base_model(asked)
    network, seconds = adapted(Base(model.policy), asked)
    steps = model.num_timesteps + asked.iterations * asked.rollout * asked.members
    hours = (model.spent + seconds) / 3600
    about = {"name": f"RMA, seed {asked.seed}", "training_steps": steps, "hours": round(hours, 3)}
    entry = onnx_entry(network, MEMORY, Card(lstm=()))
    path = write_entry(asked.out, entry, authors=["snakebench"], information="sensors", **about)
    print(f"{steps} control steps in {hours:.3f} h. Score it: snakebench score {path} --seed dev --quick")
