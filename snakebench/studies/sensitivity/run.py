"""Sensitivity study: the headline figures at finer steps, with a slimmer robot, with fewer and more joints (ours).

The paper gives no diameter, and names the number of joints as future work.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import get_args

import pandas as pd

from snakebench.engines import load_engine
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.physics.joints import Drives
from snakebench.scenario import Scenario
from snakebench.studies.contenders import Contender, contenders
from snakebench.studies.pareto import run as pareto
from snakebench.studies.planning import Load
from snakebench.studies.sensitivity.settings import SensitivityConfig
from snakebench.studies.swim_rows import numerics, swim_rows
from snakebench.trajectory import Trajectory


def plan(config: SensitivityConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    count, n = config.expected(), len(config.fluids)
    loads = [
        Load(drives, scenario, count[drives] * n)
        for drives in get_args(Drives)
        for _, scenario in _scenarios(config, drives)
    ]
    for body in config.robots.values():
        loads += pareto.plan(config.fronts_of(body.robot()))
    return [load for load in loads if load.times]


def run(config: SensitivityConfig, evaluate: Evaluator) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Swim what was found again, and search for the fronts of each robot.

    Returns:
        Tables, no trajectories:

        - `swims`: every contender, as it was found, in every fluid at every rate and in planar, on each robot that has
          as many joints as the one that it was found for;
        - `fronts`, `indicators`: the fronts of each robot, as of the Pareto study, with a column `robot`;
        - `contenders`: what was compared, and where it comes from.

    Raises:
        InvalidValue: when what is to be compared was not found yet.
    """
    compared = contenders(config, evaluate.results)
    tables = {"swims": pd.DataFrame(_swims(config, evaluate, compared))}
    parts: dict[str, list[pd.DataFrame]] = {"fronts": [], "indicators": []}
    for name, body in config.robots.items():
        found, _ = pareto.run(config.fronts_of(body.robot()), evaluate)
        for table, rows in parts.items():
            rows.append(found[table].assign(robot=name))
    tables |= {name: pd.concat(rows, ignore_index=True) for name, rows in parts.items()}
    return tables | {"contenders": pd.DataFrame(one.origin() for one in compared)}, {}


def _scenarios(config: SensitivityConfig, drives: Drives) -> Iterator[tuple[str, Scenario]]:
    """Where contenders of a kind swim as they were found: the robot's name and the scenario in the first fluid."""
    for name, body in config.robots.items():
        robot = body.robot()
        if robot.n_joints == config.robot.n_joints:
            here = config.scenario(config.fluids[0], robot=robot)
            least = load_engine("pybullet").stable_rate(robot, drives)
            yield from ((name, here.but(physics_rate=rate)) for rate in config.rates if rate >= least)
            yield name, here.but(engine="planar", physics_rate=config.planar_rate)


def _swims(
    config: SensitivityConfig, evaluate: Evaluator, compared: Sequence[Contender]
) -> Iterator[dict[str, object]]:
    """Every contender wherever its robot has as many joints."""
    asked = [
        (
            {**one.about(), "robot": name, "fluid": fluid, **numerics(scenario)},
            Case(one.controller, scenario.but(fluid=named_fluid(fluid))),
        )
        for one in compared
        for name, scenario in _scenarios(config, one.controller.drives)
        for fluid in config.fluids
    ]
    most = sum(count * len(list(_scenarios(config, drives))) for drives, count in config.expected().items())
    evaluate.expect(len(asked) - most * len(config.fluids))
    yield from swim_rows(evaluate, asked)
