"""Sensitivity study: the main results at other steps, with a slimmer robot, with fewer and more joints (ours)."""

from collections.abc import Iterator, Sequence
from itertools import product

import pandas as pd

from snakebench.engines import load_engine
from snakebench.execution import Case, Evaluator
from snakebench.studies.contenders import Contender, contenders
from snakebench.studies.pareto import run as pareto
from snakebench.studies.protocol import Load, Outcome, Swim, loads_of, numerics, swim_rows
from snakebench.studies.sensitivity.settings import SensitivityConfig


def plan(config: SensitivityConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    searches = [load for body in config.robots.values() for load in pareto.plan(config.fronts_of(body.robot()))]
    return [*loads_of(case for _, case in _swims(config, config.expected())), *searches]


def run(config: SensitivityConfig, evaluate: Evaluator) -> Outcome:
    """Evaluate contenders on other robots and at other rates, and search for the fronts of each robot."""
    compared = contenders(config, evaluate.results)
    swims = list(_swims(config, compared))
    evaluate.work.expect(len(swims) - len(list(_swims(config, config.expected()))))
    tables = {"swims": pd.DataFrame(swim_rows(evaluate, swims))}
    found = {name: pareto.run(config.fronts_of(body.robot()), evaluate).tables for name, body in config.robots.items()}
    for table in ("fronts", "indicators"):
        parts = (of_robot[table].assign(robot=name) for name, of_robot in found.items())
        tables[table] = pd.concat(parts, ignore_index=True)
    return Outcome(tables | {"contenders": pd.DataFrame(one.origin() for one in compared)})


def _swims(config: SensitivityConfig, compared: Sequence[Contender]) -> Iterator[Swim]:
    """Every contender on each robot that has as many joints as its own, at every stable rate and in planar."""
    bodies = {name: body.robot() for name, body in config.robots.items()}
    for one, (name, robot) in product(compared, bodies.items()):
        if robot.n_joints == config.robot.n_joints:
            here = config.scenario(config.fluids[0], robot=robot)
            least = load_engine("pybullet").stable_rate(robot, one.controller.drives)
            scenarios = [here.but(physics_rate=rate) for rate in config.rates if rate >= least]
            scenarios.append(here.but(engine="planar", physics_rate=config.planar_rate))
            for scenario, fluid in product(scenarios, config.fluids):
                labels = {**one.labels(), "robot": name, "fluid": fluid, **numerics(scenario)}
                yield labels, Case(one.controller, scenario.but(fluid=fluid))
