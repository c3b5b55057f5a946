"""The torque of a swim, repeated open loop in another fluid, and what is lost beside the fluid's own (paper)."""

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.controllers import ReplayedTorque
from snakebench.report.table import COSTS
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController, simulate
from snakebench.trajectory import Trajectory

COMPARED = ("speed", *COSTS)  # of replays
_SWIM = ["method", "seed", "fluid"]
_CYCLES = 2  # of the gait in a recorded waveform (paper)


def replay(trajectory: Trajectory, frequency: float) -> ReplayedTorque:
    """The command torque of the last two periods of a gait of a frequency [Hz], resampled at its own rate."""
    period = _CYCLES / frequency
    n = max(round(period * trajectory.rate), 2)
    last = trajectory.time[-1] - 1 / trajectory.rate  # the torque of the last row was never held
    times = last - period + np.arange(n) * period / n
    torque = [np.interp(times, trajectory.time, joint) for joint in trajectory.command_torque.T]
    return ReplayedTorque(period=period, torque=tuple(map(tuple, np.transpose(torque).tolist())))


def recorded(controller: AnyController, scenario: Scenario) -> ReplayedTorque | None:
    """The torque of a swim as `replay` repeats it; None when the swim has no rhythm or diverged."""
    swim = simulate(controller, scenario)
    frequency = metrics.swim_frequency(swim)
    if swim.diverged or frequency is None or frequency * scenario.duration < _CYCLES:
        return None
    return replay(swim, frequency)


def replays(fine: pd.DataFrame) -> pd.DataFrame:
    """Every replay beside that of the fluid's own gait: `home` marks that one.

    For each figure, FIGURE_change is the relative change against it, and FIGURE_best whether no gait of the method and
    seed is better in that fluid, NaN unless there are several.
    """
    swims = fine[fine["loop"] == "open"]
    swims = swims.assign(home=swims["gait_of"] == swims["fluid"])
    own = swims[swims["home"]].set_index(_SWIM)[list(COMPARED)].add_suffix("_own")
    swims = swims.join(own, on=_SWIM)
    for name in COMPARED:
        group = swims.groupby(_SWIM)[name]
        best = swims[name] == group.transform("max" if name == "speed" else "min")
        swims[f"{name}_change"] = swims[name] / swims[f"{name}_own"] - 1
        swims[f"{name}_best"] = best.astype(float).where(group.transform("count") > 1)
    return swims
