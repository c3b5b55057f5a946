"""Training of a gain schedule's estimator: gaits swim in all viscosities, which are regressed on the sensors."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from snakebench.engines.planar import Batch
from snakebench.fluid import Fluid
from snakebench.gain_schedule import WINDOW, Estimator, ScheduledGait, features
from snakebench.learning.settings import VISCOSITIES, Swimming
from snakebench.observation import Senses, columns
from snakebench.value import FloatArray

_FLUIDS = 48  # viscosities in which each gait swims, drawn log-uniformly
_SECONDS = 12.0  # of a swim: the first half with another gait
_EVERY = 10  # control steps between two windows
_LEAST = 1e-4  # standard deviation of a feature, relative to its largest size, below which it is constant
_UNITS, _BATCH, _RATE = 128, 512, 1e-3  # of the network and of Adam, whose rate falls to 0


def train_estimator(gaits: Sequence[ScheduledGait], swimming: Swimming, seed: int, steps: int = 40_000) -> Estimator:
    """The estimator of viscosity for a robot that swims with these gaits.

    Each gait swims in random viscosities. Before it, another one does, so that the estimate is also right after a
    change of the gait. `steps` are those of the regression.
    """
    rng = np.random.default_rng(seed)
    x, y = swims(gaits, swimming, rng)
    torch.manual_seed(seed)
    layers = [nn.Linear(x.shape[1], _UNITS), nn.Linear(_UNITS, _UNITS), nn.Linear(_UNITS, 1)]
    network = nn.Sequential(layers[0], nn.ELU(), layers[1], nn.ELU(), layers[2])
    optimizer = torch.optim.Adam(network.parameters(), _RATE)
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.0, steps)
    mean, spread = x.mean(axis=0), x.std(axis=0)
    constant = spread < _LEAST * np.abs(x).max(initial=1.0)
    spread[constant] = 1.0
    inputs, labels = (torch.tensor(part, dtype=torch.float32) for part in ((x - mean) / spread, y[:, None]))
    for _ in range(steps):
        rows = torch.from_numpy(rng.integers(0, len(inputs), _BATCH))
        error = nn.functional.smooth_l1_loss(network(inputs[rows]), labels[rows], beta=0.3)
        optimizer.zero_grad()
        error.backward()
        optimizer.step()
        schedule.step()
    weights = [layer.weight.detach().double().numpy() for layer in layers]
    biases = [layer.bias.detach().double().numpy() for layer in layers]
    weights[0][:, constant] = 0.0
    biases[0] = biases[0] - weights[0] @ (mean / spread)  # features need no scale of their own
    weights[0] = weights[0] / spread
    return Estimator(weights=map(_short, weights), biases=map(_short, biases))


def _short(array: FloatArray) -> Any:
    """An array as lists, with six significant digits."""
    return np.vectorize(lambda number: float(f"{number:.6g}"))(array).tolist()


def swims(
    gaits: Sequence[ScheduledGait], swimming: Swimming, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Features of windows, shape (windows, n), and log10 of the viscosity [m^2/s], shape (windows,)."""
    members = len(gaits) * _FLUIDS
    low, high = np.log10(VISCOSITIES)
    logs = rng.uniform(float(low), float(high), members)
    chosen = np.repeat(np.arange(len(gaits)), _FLUIDS)
    before = rng.integers(0, len(gaits), members)
    scenario = swimming.scenario()
    every, steps = scenario.physics_rate // scenario.control_rate, round(_SECONDS * scenario.control_rate)
    fluids = [Fluid(kinematic_viscosity=float(10**log)) for log in logs]
    batch = Batch([swimming.robot] * members, fluids, "angle", scenario.physics_rate)
    senses, sensors = Senses(swimming.robot, members), columns(["sensors"], swimming.robot.n_joints)
    targets = [np.array(gait.targets) for gait in gaits]
    seen = list[NDArray[np.float32]]()
    for step in range(steps):
        now = before if step < steps // 2 else chosen
        held = np.array([targets[k][step % len(targets[k])] for k in now])
        seen.append(senses.observation(batch.now, 10**logs, np.ones(members))[:, sensors])
        batch.advance(held, every)
        senses.act(held, batch.now)
    whole, x, y = np.stack(seen), [], []
    for end in range(WINDOW, steps + 1, _EVERY):
        now = before if end <= steps // 2 else chosen
        x += [features(whole[end - WINDOW : end, b], gaits[k], (end - 1) / len(targets[k])) for b, k in enumerate(now)]
        y.append(logs)
    return np.array(x), np.concatenate(y)
