"""What controllers are tuned for: many swim at once in the planar engine, each for its share of the limit (ours)."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakebench.engines.planar import Batch
from snakebench.fluid import Fluid
from snakebench.observation import STUDENT, Senses, columns
from snakebench.reward import PUBLISHED_PRICE
from snakebench.robot import Robot
from snakebench.scoring.tasks import VERSION, load_tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.value import FloatArray, digest

Act = Callable[[NDArray[np.float32]], NDArray[np.float32]]
_CONTROL_RATE, _PHYSICS_RATE = 30, 90  # as in trainings [Hz]
_LOST = -1.0  # share of a robot that diverges: worse than standing still, so that a search avoids it


class Trial(NamedTuple):
    """Swims of robots, each part of shape (members,)."""

    speed: FloatArray  # mean along x [m/s]
    positive_power: FloatArray  # mean, P+ [W]
    share: FloatArray  # of the limit's speed at this power; negative backwards, at most 1


def trial(
    act: Act,
    viscosities: FloatArray,
    seconds: float = 20.0,
    start: float = 10.0,
    feels: Sequence[str] = STUDENT,
    threads: int = 1,
) -> Trial:
    """Let robots swim from rest, each in its own fluid, and compare them with the limit in version 1 of the tasks.

    The share is the score of a swim, without its cut at 0. Tune to viscosities that are drawn anew, as by
    `drawn_viscosities`: those of a score depend on the scored file.

    Args:
        act: target angles [rad], shape (members, n_joints), for what all robots observe, shape (members, width). It is
            called at every control step, from the first on.
        viscosities: kinematic, of each robot's fluid [m^2/s], shape (members,).
        seconds: length of a swim.
        start: from which speed and power are measured [s].
        feels: names of observed groups or quantities.
        threads: how many threads share the robots.
    """
    robot, members = Robot(), len(viscosities)
    batch = Batch([robot] * members, _fluids(viscosities), "angle", _PHYSICS_RATE, threads)
    senses, seen, price = Senses(robot, members), columns(feels, robot.n_joints), np.full(members, PUBLISHED_PRICE)
    before = now = batch.now
    for step in range(round(seconds * _CONTROL_RATE)):
        if step == round(start * _CONTROL_RATE):
            before = now
        targets = np.clip(act(senses.observation(now, viscosities, price)[:, seen]).astype(np.float64), -1.0, 1.0)
        now = batch.advance(targets, _PHYSICS_RATE // _CONTROL_RATE)
        senses.act(targets, now)
    moved, work = now.center - before.center, now.energy[:, 1] - before.energy[:, 1]
    speed, power = moved[:, 0] / (seconds - start), work / (seconds - start)
    return Trial(speed, power, _share(speed, moved, power, viscosities, batch.alive))


def drawn_viscosities(rng: np.random.Generator, count: int) -> FloatArray:
    """Viscosities as `unknown` has them [m^2/s], shape (count,): one in each of equal parts of the range, in log10."""
    low, high = load_tasks(VERSION).viscosities
    return np.asarray(low * (high / low) ** ((np.arange(count) + rng.uniform(size=count)) / count))


def checkpoint_path(folder: Path, name: str, settings: Mapping[str, Any], free: Sequence[str] = ()) -> Path:
    """Where a tuning keeps its checkpoint, such as "checkpoint-1f3a5b7c.npz": with other settings it begins anew.

    Args:
        folder: of the entry.
        name: of the file.
        settings: the script's options and their values.
        free: names of settings that may change when it continues; the folder, `out`, always may.
    """
    fixed = {key: value for key, value in settings.items() if key not in {*free, "out"}}
    return (folder / name).with_stem(f"{Path(name).stem}-{digest(fixed)[:8]}")


def _share(
    speed: FloatArray, moved: FloatArray, power: FloatArray, viscosities: FloatArray, alive: NDArray[np.bool_]
) -> FloatArray:
    share = np.minimum(speed / _yardstick().speeds(viscosities, np.maximum(power, 1e-9)), 1.0)
    widest = np.tan(np.radians(load_tasks(VERSION).deviation))
    off_course = (moved[:, 0] > 0) & (np.abs(moved[:, 1]) > moved[:, 0] * widest)
    return np.where(alive, np.where(off_course, 0.0, share), _LOST)


def _fluids(viscosities: FloatArray) -> list[Fluid]:
    return [Fluid(kinematic_viscosity=float(viscosity)) for viscosity in viscosities]


@cache
def _yardstick() -> Yardstick:
    return Yardstick(load_tasks(VERSION), "positive")
