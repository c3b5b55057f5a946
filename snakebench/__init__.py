"""snakebench: how far does a learned, adaptive policy get beyond the best fixed gaits of a swimming snake robot?

The public names load on first use, so that `import snakebench` is quick.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

from snakebench.version import __version__

if TYPE_CHECKING:
    from snakebench.controllers import (
        GAITS,
        Fourier,
        Gait,
        HeldTargets,
        ReplayedTorque,
        SeaSnake,
        SinusoidalTorque,
        WaveformGait,
    )
    from snakebench.engines.planar import Batch
    from snakebench.errors import SnakebenchError
    from snakebench.evaluation import METRICS, Evaluation, evaluate, measure
    from snakebench.execution import evaluate_many
    from snakebench.fluid import FLUIDS, Fluid, FluidField, named_fluid
    from snakebench.learning.environment import MOSwimEnv, SwimEnv
    from snakebench.policy import Policy
    from snakebench.predictor import Predictor
    from snakebench.robot import ROBOTS, Robot
    from snakebench.scenario import Scenario
    from snakebench.simulation import simulate
    from snakebench.studies.samplers import SAMPLERS
    from snakebench.trajectory import Trajectory

if sys.version_info < (3, 11):  # noqa: UP036  # such a Python may find the source all the same
    _here = ".".join(map(str, sys.version_info[:3]))
    raise ImportError("snakebench needs Python 3.11 or later, and this is " + _here, name="snakebench")

_HOMES = {
    "controllers": (
        "GAITS",
        "Fourier",
        "Gait",
        "HeldTargets",
        "ReplayedTorque",
        "SeaSnake",
        "SinusoidalTorque",
        "WaveformGait",
    ),
    "engines.planar": ("Batch",),
    "errors": ("SnakebenchError",),
    "evaluation": ("METRICS", "Evaluation", "evaluate", "measure"),
    "execution": ("evaluate_many",),
    "learning.environment": ("MOSwimEnv", "SwimEnv"),
    "policy": ("Policy",),
    "predictor": ("Predictor",),
    "fluid": ("FLUIDS", "Fluid", "FluidField", "named_fluid"),
    "robot": ("ROBOTS", "Robot"),
    "scenario": ("Scenario",),
    "simulation": ("simulate",),
    "studies.samplers": ("SAMPLERS",),
    "trajectory": ("Trajectory",),
}
_HOME_OF = {name: f"snakebench.{home}" for home, names in _HOMES.items() for name in names}

__all__ = [
    "FLUIDS",
    "GAITS",
    "METRICS",
    "ROBOTS",
    "SAMPLERS",
    "Batch",
    "Evaluation",
    "Fluid",
    "FluidField",
    "Fourier",
    "Gait",
    "HeldTargets",
    "MOSwimEnv",
    "Policy",
    "Predictor",
    "ReplayedTorque",
    "Robot",
    "Scenario",
    "SeaSnake",
    "SinusoidalTorque",
    "SnakebenchError",
    "SwimEnv",
    "Trajectory",
    "WaveformGait",
    "__version__",
    "evaluate",
    "evaluate_many",
    "measure",
    "named_fluid",
    "simulate",
]


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'snakebench' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
