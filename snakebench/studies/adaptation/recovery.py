"""How a swimmer answers a change of the fluid: speed over gait periods, recovery, and the ideal without delay."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.fluid import Fluid, FluidField
from snakebench.physics.body import viscosity_at
from snakebench.scenario import Scenario
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

TOLERANCE = 0.05  # of the steady speed, within which a swimmer is back
_STEADILY = 5.0  # how long it must stay there [s]
_STEP = 0.02  # of the ideal swim [s]
_TRACED = 4  # rows a second of a trace
_TRACE_WINDOW = 1.0  # over which a trace's speed and power are means [s]

Steady = Callable[[float], tuple[float, float, float]]  # v [m/s], P and P+ [W] at a viscosity [m^2/s]
_STEADY = ["speed", "power", "positive_power"]  # columns of them


class Recovery(NamedTuple):
    """When a swimmer is back at its steady speed after a change."""

    seconds: float  # from the change to the first gait period of those that stay within tolerance; NaN if there is none
    held: float  # share of the periods that begin after the change and are within tolerance


class Change(NamedTuple):
    """A sudden change of the fluid, and how a swimmer swims after it in the long run."""

    before: str  # the fluid
    after: str  # the fluid
    start: float  # of the new fluid [s]
    end: float  # of it [s]
    period: float  # of the gait in it [s]
    speed: float  # in it [m/s]


def course_swim(swim: Trajectory, scenario: Scenario, traced: bool, changes: Sequence[Change]) -> dict[str, Any]:
    """What the study keeps of a swim through a course, for `Evaluator.measured`.

    Returns:
        Whether it `diverged`; where it begins, `start`, and the `distance` from there along x [m]; `work` of the
        command torques and the `positive_work` of the joints that drive [J]; `stray`, the largest angle between x and
        the direction of travel over 5 s [rad]; and the rows of `recoveries` and `traces`, if they are to be `traced`.
    """
    x, told = swim.center[:, 0], traced and not swim.diverged
    return {
        "diverged": bool(swim.diverged),
        "start": float(x[0]),
        "distance": float(x[-1] - x[0]),
        "work": float(swim.command_work[-1]),
        "positive_work": float(swim.positive_work[-1]),
        "stray": metrics.stray(swim),
        "recoveries": [_recovered(swim, Change(*change)) for change in changes] if told else [],
        "traces": list(_trace(swim, scenario)) if told else [],
    }


def _recovered(swim: Trajectory, change: Change) -> dict[str, Any]:
    """How a swimmer answers a sudden change."""
    before, after, start, end, period, speed = change
    found = recovery(swim.center[:, 0], swim.rate, start, end, period, speed)
    return {"time": start, "from": before, "to": after, "steady_speed": speed} | found._asdict()


def _trace(swim: Trajectory, scenario: Scenario) -> Iterator[dict[str, float]]:
    """Speed and both powers over a swim, a few rows a second."""
    half, x = _TRACE_WINDOW / 2, swim.center[:, 0]
    sums = {"speed": x, "power": swim.command_work, "positive_power": swim.positive_work}
    means = {name: period_speed(values, swim.rate, _TRACE_WINDOW) for name, values in sums.items()}
    for time in np.arange(half, scenario.duration - half, 1 / _TRACED).tolist():
        row, here = round((time - half) * swim.rate), float(x[round(time * swim.rate)])
        place = {"time": time, "x": here, "viscosity": viscosity_at(scenario.fluid, time, here)}
        yield place | {name: float(values[row]) for name, values in means.items()}


def recovery(position: FloatArray, rate: float, start: float, end: float, period: float, steady: float) -> Recovery:
    """When a swimmer is back within 5 % of its steady speed after a change, and stays there for 5 s.

    In a new fluid that lasts less than 5 s it must stay to the end; in one shorter than a gait period nothing is known.

    Args:
        position: along x, shape (n_times,) [m].
        rate: rows of it per second [Hz].
        start: of the new fluid [s].
        end: of it [s].
        period: of the gait in it, over which speed is a mean; each counts from its beginning [s].
        steady: speed in it [m/s].
    """
    speed = period_speed(position, rate, period)[round(start * rate) : round((end - period) * rate) + 1]
    within = np.abs(speed - steady) <= TOLERANCE * abs(steady)
    if not len(within):
        return Recovery(np.nan, np.nan)
    needed = min(round(_STEADILY * rate), len(within))
    run = np.convolve(within, np.ones(needed, int))[needed - 1 : len(within)]  # periods within tolerance, of `needed`
    back = np.flatnonzero(run == needed)
    return Recovery(float(back[0] / rate) if len(back) else np.nan, float(within.mean()))


def period_speed(position: FloatArray, rate: float, period: float) -> FloatArray:
    """Mean speed over the gait period that begins at each row [m/s]; the last rows have none."""
    rows = max(round(period * rate), 1)
    return (position[rows:] - position[:-rows]) * rate / rows


def ideal_swim(medium: Fluid | FluidField, duration: float, steady: Steady, start: float) -> tuple[float, float, float]:
    """How far a swimmer gets that is at every moment at its steady state [m], its work and its positive work [J].

    Args:
        medium: what it swims in.
        duration: of the swim [s].
        steady: of the swimmer.
        start: where it begins [m].
    """
    x, work, positive_work = start, 0.0, 0.0
    for time in np.arange(round(duration / _STEP)) * _STEP:
        speed, power, positive_power = steady(viscosity_at(medium, float(time), x))
        x += speed * _STEP
        work += power * _STEP
        positive_work += positive_power * _STEP
    return x - start, work, positive_work


def between_viscosities(table: pd.DataFrame) -> Steady:
    """What is steady at a viscosity, linear in its logarithm between the rows: columns viscosity and `_STEADY`."""
    rows = table.sort_values("viscosity").drop_duplicates("viscosity")
    at = np.log10(rows["viscosity"].to_numpy())
    figures = [rows[name].to_numpy() for name in _STEADY]

    def steady(viscosity: float) -> tuple[float, float, float]:
        speed, power, positive_power = (float(np.interp(np.log10(viscosity), at, figure)) for figure in figures)
        return speed, power, positive_power

    return steady


def fastest(of_gaits: Mapping[str, Steady]) -> Steady:
    """Speed and powers of the fastest of several gaits at a viscosity: ideal switching among them.

    A gait that is not known there, since it diverged, is not switched to.
    """
    return lambda viscosity: max(
        (steady(viscosity) for steady in of_gaits.values()), key=lambda at: np.nan_to_num(at[0], nan=-np.inf)
    )
