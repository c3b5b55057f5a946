"""The key of an evaluation: a hash of everything that determines it, and of nothing else.

That is the code of physics, engine, control and metrics, and the numbers that they are handed; no names or messages.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

import numpy as np

from snakebench.controllers import WaveformGait
from snakebench.engines import load_engine
from snakebench.evaluation import METRICS
from snakebench.fluid import Medium
from snakebench.physics.joints import Drives
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController, ClosedLoop
from snakebench.sources import code_digest, plugin_digest
from snakebench.value import digest

_MEASURES = code_digest("accuracy", "evaluation", "metrics", "reward", "simulation", "trajectory")
_POLICIES = code_digest("observation", "policy")


def evaluation_key(controller: AnyController, scenario: Scenario) -> str:
    """The key of a controller's evaluation in a scenario; the code of a plug-in has to be in a file."""
    rate = scenario.physics_rate
    further = [f"{name} {plugin_digest(metric)}" for name, metric in METRICS.items()]
    return digest(
        [
            [load_engine(scenario.engine).VERSION, _MEASURES, *further],
            inputs_digest(scenario.engine, scenario.robot, scenario.fluid, controller.drives, rate),
            [rate, scenario.control_rate, scenario.n_steps],
            _commands(controller, scenario.robot.n_joints),
        ]
    )


@lru_cache(maxsize=1024)
def inputs_digest(engine: str, robot: Robot, medium: Medium, drives: Drives, physics_rate: int) -> str:
    """The hash of the numbers that an engine makes of a robot in a medium."""
    return hashlib.sha256(load_engine(engine).inputs(robot, medium, drives, physics_rate)).hexdigest()


def _commands(controller: AnyController, n_joints: int) -> list[Any]:
    """What stands for a controller: its waveform's numbers if it has one, whatever it is called."""
    if isinstance(controller, ClosedLoop):
        return ["closed loop", controller.digest(), _POLICIES]
    if isinstance(controller, WaveformGait) and type(controller).commands is WaveformGait.commands:
        kind, rate, table, bound = controller.waveform(n_joints)
        content = hashlib.sha256(table.astype(np.float64).tobytes()).hexdigest()
        return ["waveform", controller.drives, kind, repr(float(rate)), repr(float(bound)), table.shape, content]
    return ["commands", controller.drives, controller.digest()]
