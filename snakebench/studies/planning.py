"""What a study is going to evaluate: checked, counted and its time estimated before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import NamedTuple

from snakebench.controllers import Gait, SeaSnake, SinusoidalTorque
from snakebench.evaluation import evaluate
from snakebench.memory import check_memory
from snakebench.physics.joints import Drives
from snakebench.progress import timed
from snakebench.scenario import Scenario
from snakebench.simulation import check_scenario

_BYTES = 4000  # of memory that an evaluation takes at most until its study ends: it is a row of several tables
_PIECE = 2.0  # of swimming to take an engine's time [s]
_ROUNDS = 3  # of it, of which the best counts
PAGE_SECONDS = 4.0  # that a page takes, about: those of the published results, on two cores [s]
STAND_INS: dict[Drives, Gait] = {  # for other gaits: what a gait asks for hardly changes how long a swim takes
    "angle": SeaSnake(amplitude=0.5, frequency=0.5, phase=0.7),
    "torque": SinusoidalTorque(amplitude=2.0, frequency=0.5, phase=0.7),
}


class Load(NamedTuple):
    """Evaluations of one kind, and the seconds that choosing all of them takes in one process [s]."""

    drives: Drives
    scenario: Scenario
    times: int
    choosing: float = 0.0


def check_loads(name: str, loads: Sequence[Load]) -> None:
    """Make sure that every scenario of a study can be simulated, and that the results fit into memory.

    Raises:
        InvalidValue: when they do not fit.
        UnstableRate: when an engine needs a higher rate, with that rate.
    """
    evaluations = sum(load.times for load in loads)
    check_memory(f"{name}, {evaluations:.6g} evaluations", evaluations * _BYTES)
    for load in loads:
        check_scenario(load.scenario, load.drives)


def expected_seconds(loads: Sequence[Load], workers: int) -> dict[str, float]:
    """How long all `units` take workers like this process, and `choosing` them, from a short swim of each kind [s]."""
    units = sum(load.times * swim_seconds(load.drives, load.scenario) for load in loads) / workers
    return {"units": units, "choosing": sum(load.choosing for load in loads)}


def swim_seconds(drives: Drives, scenario: Scenario) -> float:
    """How long a swim takes in this process, from a short one of its kind [s]."""
    piece = scenario.but(fluid="water", duration=min(_PIECE, scenario.duration))
    return scenario.duration * _cost(drives, piece)


@cache
def _cost(drives: Drives, piece: Scenario) -> float:
    """Seconds that a second of swimming takes here, measured once [s/s]."""
    return min(timed(partial(evaluate, STAND_INS[drives], piece)) for _ in range(_ROUNDS)) / piece.duration
