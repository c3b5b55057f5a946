"""Sensitivity study: the headline figures at finer steps, with a slimmer robot, with fewer and more joints (ours).

The paper gives no diameter, and names the number of joints as future work.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import pandas as pd

from snakebench.engines import load_engine
from snakebench.execution import Case, Evaluator
from snakebench.physics.joints import Drives
from snakebench.scenario import Scenario
from snakebench.studies.contenders import Contender, contenders
from snakebench.studies.outcome import Outcome
from snakebench.studies.pareto import run as pareto
from snakebench.studies.planning import Load
from snakebench.studies.sensitivity.settings import SensitivityConfig
from snakebench.studies.swim_rows import Swim, loads_of, numerics, swim_rows


def plan(config: SensitivityConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    searches = [load for body in config.robots.values() for load in pareto.plan(config.fronts_of(body.robot()))]
    return [*loads_of(case for _, case in _swims(config, config.expected())), *searches]


def run(config: SensitivityConfig, evaluate: Evaluator) -> Outcome:
    """Let contenders swim on other robots and at other rates, and search for the fronts of each robot.

    Returns:
        Tables:

        - `swims`: every contender, as it was found, in every fluid at every rate and in planar, on each robot that has
          as many joints as the one that it was found for;
        - `fronts`, `indicators`: the fronts of each robot, as of the Pareto study, with a column `robot`;
        - `contenders`: what was compared, and where it comes from.

    Raises:
        InvalidValue: when the results of a study to be compared are missing.
    """
    compared = contenders(config, evaluate.results)
    swims = list(_swims(config, compared))
    evaluate.work.expect(len(swims) - len(list(_swims(config, config.expected()))))
    tables = {"swims": pd.DataFrame(swim_rows(evaluate, swims))}
    searched = {
        name: pareto.run(config.fronts_of(body.robot()), evaluate).tables for name, body in config.robots.items()
    }
    for table in ("fronts", "indicators"):
        parts = [of_robot[table].assign(robot=name) for name, of_robot in searched.items()]
        tables[table] = pd.concat(parts, ignore_index=True)
    return Outcome(tables | {"contenders": pd.DataFrame(one.origin() for one in compared)})


def _scenarios(config: SensitivityConfig, drives: Drives) -> Iterator[tuple[str, Scenario]]:
    """Where contenders of a kind swim as they were found: the robot's name and the scenario in the first fluid."""
    for name, body in config.robots.items():
        robot = body.robot()
        if robot.n_joints == config.robot.n_joints:
            here = config.scenario(config.fluids[0], robot=robot)
            least = load_engine("pybullet").stable_rate(robot, drives)
            yield from ((name, here.but(physics_rate=rate)) for rate in config.rates if rate >= least)
            yield name, here.but(engine="planar", physics_rate=config.planar_rate)


def _swims(config: SensitivityConfig, compared: Sequence[Contender]) -> Iterator[Swim]:
    """Every contender wherever its robot has as many joints."""
    for one in compared:
        for (name, scenario), fluid in product(_scenarios(config, one.controller.drives), config.fluids):
            labels = {**one.labels(), "robot": name, "fluid": fluid, **numerics(scenario)}
            yield labels, Case(one.controller, scenario.but(fluid=fluid))
