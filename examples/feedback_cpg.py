"""Tune a central pattern generator with sensory feedback by CMA-ES, over all fluids: python examples/feedback_cpg.py.

Each joint has a phase oscillator, coupled to its neighbours. As in Yasui et al. (PNAS 2025, e2422248122), stretch and
load of a segment push the phase of its own oscillator; stretch is the joint's angle, and load the joint's torque, since
the robot has no sense of pressure (ours). What pushes the phases also changes the frequency that all share, as in
adaptive frequency oscillators (Righetti, Buchli and Ijspeert, Physica D 2006), and the frequency changes amplitude and
phase lag (ours). CMA-ES (Hansen) maximises the mean share of the limit's speed at the same power, in fluids that are
drawn anew for each generation. The result is an entry of the leaderboard. If interrupted, the same command continues.
"""

import argparse
import pickle
import time
from pathlib import Path

import numpy as np
import torch
from cmaes import CMA
from torch import nn

from snakebench.files import write_file
from snakebench.learning.network import onnx_entry, played
from snakebench.policy import Card
from snakebench.scoring.leaderboard import write_entry
from snakebench.scoring.trial import checkpoint_path, drawn_viscosities, trial

JOINTS, STEP = 7, 1 / 30  # control step [s]
BOUNDS = {
    "frequency": (0.2, 2.0),  # of the oscillators without feedback [Hz]
    "amplitude": (0.2, 1.5),  # of the last joint's target, before it is clipped to 1 [rad]
    "taper": (0.3, 3.0),  # the first joint's amplitude over the last one's
    "lag": (0.1, 1.2),  # of phase, from joint to joint [rad]
    "coupling": (1.0, 8.0),  # of neighbours [1/s]
    "stretch": (-8.0, 8.0),  # what an angle adds to the phase's rate [1/(s rad)]
    "load": (-3.0, 3.0),  # what a torque adds to it [1/(s N m)]
    "shift": (-1.6, 1.6),  # of the phase at which both push most [rad]
    "adaptation": (0.0, 2.0),  # of the logarithm of frequency, by what pushes the phases [1/rad]
    "relaxation": (0.05, 2.0),  # of the frequency to its own [1/s]
    "widening": (-3.0, 3.0),  # logarithm of the amplitude over that of the frequency
    "stiffening": (-3.0, 3.0),  # logarithm of the lag over that of the frequency
}
MEMORY = {"phase": JOINTS, "change": 1, "growth": 1}  # change: of the frequency, its logarithm


class FeedbackCpg(nn.Module):
    """The pattern generator with parameters of shape (…, 12), one set or one for each candidate."""

    def __init__(self, parameters):
        super().__init__()
        numbers = torch.as_tensor(np.asarray(parameters), dtype=torch.float32)
        for k, name in enumerate(BOUNDS):
            self.register_buffer(name, numbers[..., k : k + 1])
        self.register_buffer("place", torch.linspace(0.0, 1.0, JOINTS))

    def forward(self, observation, phase, change, growth):
        """Target angles [rad], and the memory after a control step."""
        angle, torque = observation[..., :JOINTS], observation[..., 2 * JOINTS : 3 * JOINTS] / 0.2
        lag, wide = self.lag * torch.exp(self.stiffening * change), torch.exp(self.widening * change)
        pull = torch.sin(phase[..., 1:] - phase[..., :-1] + lag)
        none = torch.zeros_like(pull[..., :1])
        pull = torch.cat([pull, none], -1) - torch.cat([none, pull], -1)
        push = (self.stretch * angle + self.load * torque) * torch.cos(phase + self.shift)
        rate = 2 * np.pi * self.frequency * torch.exp(change) + self.coupling * pull + push
        toward = self.adaptation * push.mean(-1, keepdim=True) - self.relaxation * change
        phase, growth = phase + STEP * rate, growth + STEP * self.coupling * (1 - growth)
        change = (change + STEP * toward).clamp(-1.5, 1.5)
        envelope = self.amplitude * (self.taper + (1 - self.taper) * self.place)
        return (growth * wide * envelope * torch.sin(phase)).clamp(-1.0, 1.0), phase, change, growth


def parameters_of(unit):
    """Parameters within their bounds for numbers in [0, 1], shape (…, 12)."""
    low, high = np.array(list(BOUNDS.values())).T
    return low + (high - low) * np.asarray(unit)


def shares(candidates, viscosities, asked):
    """The mean share of each candidate over the fluids, shape (candidates,)."""
    shape = len(candidates), len(viscosities)
    act = played(FeedbackCpg(parameters_of(candidates)[:, None]), MEMORY, *shape)
    swims = trial(act, np.tile(viscosities, shape[0]), asked.seconds, asked.seconds / 2, threads=asked.threads)
    return swims.share.reshape(shape).mean(axis=1)


def tune(asked):
    """The parameters found, and the control steps and hours that they took."""
    checkpoint = checkpoint_path(asked.out, "checkpoint.pickle", vars(asked), ("generations", "threads"))
    count = len(BOUNDS)
    search, spent = CMA(np.full(count, 0.5), 0.25, np.tile([0.0, 1.0], (count, 1)), seed=asked.seed,
                        population_size=asked.population), 0.0  # fmt: skip
    if checkpoint.exists():
        search, spent = pickle.loads(checkpoint.read_bytes())  # executes code: only a file that was written here
    while search.generation < asked.generations:
        begun = time.monotonic()
        fluids = drawn_viscosities(np.random.default_rng([asked.seed, search.generation]), asked.fluids)
        candidates = [search.ask() for _ in range(asked.population)]
        found = shares(candidates, fluids, asked)
        search.tell([(one, -share) for one, share in zip(candidates, found.tolist(), strict=True)])
        spent += time.monotonic() - begun
        print(f"generation {search.generation}: mean share {found.mean():.4f}, best {found.max():.4f}", flush=True)
        write_file(checkpoint, pickle.dumps((search, spent)))
    steps = search.generation * asked.population * asked.fluids * round(asked.seconds / STEP)
    return parameters_of(np.clip(search.mean, 0, 1)), steps, spent / 3600


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generations", type=int, default=200)
    parser.add_argument("--population", type=int, default=16, help="candidates of a generation")
    parser.add_argument("--fluids", type=int, default=16, help="in which each candidate swims")
    parser.add_argument("--seconds", type=float, default=20.0, help="of a swim, whose second half counts")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("feedback_cpg"), help="folder of the entry")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    parameters, steps, hours = tune(asked)
    for name, value in zip(BOUNDS, parameters, strict=True):
        print(f"{name:12} {value:8.4f}")
    about = {"name": f"CPG with feedback, seed {asked.seed}", "training_steps": steps, "hours": round(hours, 3)}
    entry = onnx_entry(FeedbackCpg(parameters), MEMORY, Card(lstm=()))
    path = write_entry(asked.out, entry, authors=["snakebench"], information="sensors", **about)
    print(f"{steps} control steps in {hours:.3f} h. Score it: snakebench score {path} --seed dev --quick")
