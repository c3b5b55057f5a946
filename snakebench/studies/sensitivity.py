"""Sensitivity study: the headline figures at finer steps, with a slimmer robot, with fewer and more joints (ours).

The paper gives no diameter, and names the number of joints as future work.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, get_args

import pandas as pd
from pydantic import Field

from snakebench.engines import load_engine
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.physics.joints import Drives
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.studies import pareto
from snakebench.studies.found import ComparisonConfig, Contender, Pilots, contenders
from snakebench.studies.planning import Load
from snakebench.studies.search_settings import ParetoConfig, Space, Steps
from snakebench.trajectory import Trajectory
from snakebench.value import Count, Name, Positive, Value


class Body(Value):
    """A robot of another shape; the paper's by default.

    Raises:
        InvalidValue: for a value out of range.
    """

    joints: Count = Field(7, description="of a body of the same length and mass")
    diameter: Positive = Field(0.10, description="of its links [m]")

    def robot(self) -> Robot:
        """The robot."""
        return Robot.with_joints(self.joints, self.diameter)


class SensitivityConfig(ComparisonConfig):
    """Settings of the sensitivity study.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    method: Literal["sensitivity"] = "sensitivity"
    pilots: Pilots = ("student", "teacher")
    robots: dict[Name, Body] = Field(min_length=1, description="whose fronts are searched for anew, by name")
    rates: tuple[Count, ...] = Field((480, 960, 1920), min_length=1, description="of PyBullet [Hz]")
    planar_rate: Count = Field(960, description="of the second engine [Hz]")
    search_rate: Count = Field(180, description="of the search for fronts, in planar [Hz]")
    spaces: dict[Name, Space] = Field(default={"paper": {}}, min_length=1, description="as of the study pareto")
    grid: tuple[Steps, Steps, Steps] = Field((10, 8, 8), description="values of amplitude, frequency and phase")

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return "pybullet", "planar"

    def fronts_of(self, robot: Robot) -> ParetoConfig:
        """The search for the fronts of a robot."""
        same = ("name", "profile", "question", "fluids", "duration", "reference", "verify_rate", "spaces", "grid")
        return ParetoConfig(
            **{name: getattr(self, name) for name in same},
            robot=robot,
            seeds=(0,),
            engine="planar",
            physics_rate=self.search_rate,
        )


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
        (one, fluid, name, scenario.but(fluid=named_fluid(fluid)))
        for one in compared
        for name, scenario in _scenarios(config, one.controller.drives)
        for fluid in config.fluids
    ]
    most = sum(count * len(list(_scenarios(config, drives))) for drives, count in config.expected().items())
    evaluate.expect(len(asked) - most * len(config.fluids))
    evaluations = evaluate([Case(one.controller, scenario) for one, _, _, scenario in asked])
    for (one, fluid, name, scenario), evaluation in zip(asked, evaluations, strict=True):
        numerics = {"engine": scenario.engine, "physics_rate": scenario.physics_rate}
        yield one.about() | {"robot": name, "fluid": fluid} | numerics | evaluation.model_dump()
