"""What a study's `plan` and `run` are made of: labelled swims, how many there will be, and what is published."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import pandas as pd

from snakebench.controllers import Gait, SeaSnake, SinusoidalTorque
from snakebench.execution import Case, Evaluator
from snakebench.names import COARSE, FINE
from snakebench.physics.joints import Drives
from snakebench.policy import Policy
from snakebench.scenario import Scenario

Row = dict[str, object]
Swim = tuple[Mapping[str, object], Case]  # labels, and what is evaluated
STAND_INS: dict[Drives, Gait] = {  # for other gaits: what a gait asks for hardly changes how long a swim takes
    "angle": SeaSnake(amplitude=0.5, frequency=0.5, phase=0.7),
    "torque": SinusoidalTorque(amplitude=2.0, frequency=0.5, phase=0.7),
}


class Load(NamedTuple):
    """Evaluations of one kind, and what else they take: in one process, and of all workers together [s]."""

    drives: Drives
    scenario: Scenario
    times: int
    choosing: float = 0.0
    solving: float = 0.0


class Outcome(NamedTuple):
    """The results of a study."""

    tables: Mapping[str, pd.DataFrame]  # by name, as the study declares them
    swims: Mapping[str, Case] = {}  # that its page shows, by name
    policies: Mapping[str, Policy] = {}  # that it trained, by name
    frames: int = 30  # a second of these swims that are kept


def swim_rows(evaluate: Evaluator, swims: Iterable[Swim]) -> Iterator[Row]:
    """Evaluate swims, each with its labels, and give the row of each: its labels and its evaluation."""
    swims = list(swims)
    for (labels, _), evaluation in zip(swims, evaluate([case for _, case in swims]), strict=True):
        yield {**labels, **evaluation.row()}


def loads_of(cases: Iterable[Case]) -> list[Load]:
    """The loads of cases, of which only what the controller drives and the scenario matter."""
    times = Counter((case.controller.drives, case.scenario) for case in cases)
    return [Load(drives, scenario, count) for (drives, scenario), count in times.items()]


def variants(fine: Scenario, planar: int) -> dict[str, Scenario]:
    """How a swim is computed: as published, at half its rate, and in planar at another [Hz]."""
    in_planar = fine.but(engine="planar", physics_rate=planar)
    return {FINE: fine, COARSE: fine.but(physics_rate=fine.physics_rate // 2), "planar": in_planar}


def numerics(scenario: Scenario) -> Row:
    """How a swim was computed: engine and physics rate [Hz]."""
    return {"engine": scenario.engine, "physics_rate": scenario.physics_rate}
