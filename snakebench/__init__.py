"""snakebench: how far does a learned, adaptive policy get beyond the best fixed gaits of a swimming snake robot?

The public names load on first use, so that `import snakebench` is quick.
"""

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from snakebench.version import __version__

if TYPE_CHECKING:
    from snakebench.channel import perturbed as perturbed
    from snakebench.collocation.front import Limit as Limit
    from snakebench.collocation.front import limit as limit
    from snakebench.controllers import GAITS as GAITS
    from snakebench.controllers import Fourier as Fourier
    from snakebench.controllers import Gait as Gait
    from snakebench.controllers import HeldTargets as HeldTargets
    from snakebench.controllers import PeriodicTargets as PeriodicTargets
    from snakebench.controllers import ReplayedTorque as ReplayedTorque
    from snakebench.controllers import SeaSnake as SeaSnake
    from snakebench.controllers import SinusoidalTorque as SinusoidalTorque
    from snakebench.controllers import WaveformGait as WaveformGait
    from snakebench.engines.planar import Batch as Batch
    from snakebench.errors import SnakebenchError as SnakebenchError
    from snakebench.evaluation import METRICS as METRICS
    from snakebench.evaluation import Evaluation as Evaluation
    from snakebench.evaluation import evaluate as evaluate
    from snakebench.evaluation import measure as measure
    from snakebench.execution import evaluate_many as evaluate_many
    from snakebench.fluid import FLUIDS as FLUIDS
    from snakebench.fluid import Fluid as Fluid
    from snakebench.fluid import FluidField as FluidField
    from snakebench.fluid import named_fluid as named_fluid
    from snakebench.learning.environment import MOSwimEnv as MOSwimEnv
    from snakebench.learning.environment import SwimEnv as SwimEnv
    from snakebench.perturbation import Perturbations as Perturbations
    from snakebench.policy import Policy as Policy
    from snakebench.predictor import Predictor as Predictor
    from snakebench.robot import ROBOTS as ROBOTS
    from snakebench.robot import Robot as Robot
    from snakebench.scenario import Scenario as Scenario
    from snakebench.scoring.result import Score as Score
    from snakebench.scoring.score import score as score
    from snakebench.simulation import simulate as simulate
    from snakebench.studies.samplers import SAMPLERS as SAMPLERS
    from snakebench.trajectory import Trajectory as Trajectory

if sys.version_info < (3, 11):  # noqa: UP036  # such a Python may find the source all the same
    _here = ".".join(map(str, sys.version_info[:3]))
    raise ImportError("snakebench needs Python 3.11 or later, and this is " + _here, name="snakebench")

# The imports above, which only type checkers make.
_IMPORT = re.compile(r"from (snakebench\S+) import (\w+) as")
_HOME_OF = {name: home for home, name in _IMPORT.findall(Path(__file__).read_text(encoding="utf-8"))}

__all__ = ["__version__", *_HOME_OF]


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'snakebench' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
