"""Train a policy that has only its sensors by an evolution strategy: python examples/evolution_strategy.py.

The strategy is that of Salimans et al. (arXiv 1703.03864, 2017): pairs of opposite changes of all weights, ranked by
their results, and Adam with weight decay. The policy is a small recurrent network, and its result is the mean share of
the limit's speed at the same power, in fluids that are drawn anew for each generation (ours). All candidates swim at
once in the planar engine. The result is an entry of the leaderboard. If interrupted, the same command continues.
"""

import argparse
import io
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

from snakebench.files import write_file
from snakebench.learning.network import onnx_entry, played
from snakebench.policy import Card
from snakebench.scoring.leaderboard import write_entry
from snakebench.scoring.trial import checkpoint_path, drawn_viscosities, trial

SENSORS, UNITS, JOINTS, STEP = 31, 32, 7, 1 / 30  # control step [s]
SHAPES = (UNITS, SENSORS), (UNITS, UNITS), (UNITS, 1), (JOINTS, UNITS), (JOINTS, 1)
MEMORY = {"hidden": UNITS}
DECAY, MOMENTS = 0.005, (0.9, 0.999)  # of Adam


class Recurrent(nn.Module):
    """Units that see the sensors and each other, with weights of shape (…, 2311): one network or many candidates."""

    def __init__(self, weights):
        super().__init__()
        parts = torch.as_tensor(weights, dtype=torch.float32).split([a * b for a, b in SHAPES], dim=-1)
        for name, part, shape in zip(("see", "recall", "bias", "move", "pose"), parts, SHAPES, strict=True):
            self.register_buffer(name, part.reshape(*part.shape[:-1], *shape).transpose(-1, -2).contiguous())
        if self.bias.ndim == 2:  # one network: no axis for candidates
            self.bias, self.pose = self.bias[0], self.pose[0]

    def forward(self, observation, hidden):
        """Target angles [rad], and the memory after a control step."""
        hidden = torch.tanh(observation @ self.see + hidden @ self.recall + self.bias)
        return torch.tanh(hidden @ self.move + self.pose), hidden


def first_weights(rng):
    """Random weights with which units keep oscillating, as in an echo state network; first motions are small."""
    gains = (0.5, 1.2, 0.0, 0.5, 0.0)
    return np.concatenate([rng.normal(0, gain / np.sqrt(n), m * n) for gain, (m, n) in zip(gains, SHAPES, strict=True)])


def shares(candidates, viscosities, asked):
    """The mean share of each candidate over the fluids, shape (candidates,)."""
    shape = len(candidates), len(viscosities)
    swims = trial(played(Recurrent(candidates), MEMORY, *shape), np.tile(viscosities, shape[0]), asked.seconds,
                  asked.seconds / 2, threads=asked.threads)  # fmt: skip
    return swims.share.reshape(shape).mean(axis=1)


def gradient(weights, generation, asked):
    """The direction in which the mean share grows, from pairs of opposite changes, and their mean share."""
    rng = np.random.default_rng([asked.seed, generation])
    changes = rng.normal(size=(asked.pairs, len(weights)))
    found = shares(np.concatenate([weights + asked.noise * changes, weights - asked.noise * changes]),
                   drawn_viscosities(rng, asked.fluids), asked)  # fmt: skip
    ranks = found.argsort().argsort() / (len(found) - 1) - 0.5
    return (ranks[: asked.pairs] - ranks[asked.pairs :]) @ changes / (asked.pairs * asked.noise), found.mean()


def train(asked):
    """The weights, and the control steps and hours that they took."""
    checkpoint = checkpoint_path(asked.out, "checkpoint.npz", vars(asked), ("generations", "every", "threads"))
    state = {"weights": first_weights(np.random.default_rng(asked.seed)), "generation": 0, "seconds": 0.0}
    state |= {"first": np.zeros_like(state["weights"]), "second": np.zeros_like(state["weights"])}
    if checkpoint.exists():
        state = dict(np.load(checkpoint))
    while state["generation"] < asked.generations:
        begun, n = time.monotonic(), state["generation"] + 1
        slope, mean = gradient(state["weights"], int(n), asked)
        slope = slope - DECAY * state["weights"]
        moments = {"first": slope, "second": slope**2}
        for (name, new), kept in zip(moments.items(), MOMENTS, strict=True):
            state[name] = kept * state[name] + (1 - kept) * new
        first, second = (state[name] / (1 - kept**n) for name, kept in zip(moments, MOMENTS, strict=True))
        state["weights"] = state["weights"] + asked.rate * first / (np.sqrt(second) + 1e-8)
        state |= {"generation": n, "seconds": state["seconds"] + time.monotonic() - begun}
        if n % asked.every == 0 or n == asked.generations:
            np.savez(content := io.BytesIO(), **state)
            write_file(checkpoint, content.getvalue())
            print(f"generation {n}: mean share of the candidates {mean:.4f}", flush=True)
    steps = int(state["generation"]) * 2 * asked.pairs * asked.fluids * round(asked.seconds / STEP)
    return state["weights"], steps, float(state["seconds"]) / 3600


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generations", type=int, default=200)
    parser.add_argument("--pairs", type=int, default=48, help="of candidates in a generation")
    parser.add_argument("--fluids", type=int, default=8, help="in which each candidate swims")
    parser.add_argument("--seconds", type=float, default=12.0, help="of a swim, whose second half counts")
    parser.add_argument("--noise", type=float, default=0.05, help="standard deviation of the changes of weights")
    parser.add_argument("--rate", type=float, default=0.02, help="of learning")
    parser.add_argument("--every", type=int, default=10, help="generations between lines and checkpoints")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("evolution_strategy"), help="folder of the entry")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    weights, steps, hours = train(asked)
    about = {"name": f"evolution strategy, seed {asked.seed}", "training_steps": steps, "hours": round(hours, 3)}
    entry = onnx_entry(Recurrent(weights), MEMORY, Card(lstm=()))
    path = write_entry(asked.out, entry, authors=["snakebench"], information="sensors", **about)
    print(f"{steps} control steps in {hours:.3f} h. Score it: snakebench score {path} --seed dev --quick")
