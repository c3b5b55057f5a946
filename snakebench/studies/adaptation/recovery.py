"""Recovery after a change of the fluid: speed over gait periods, and the ideal swim without delay."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

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

Steady = Callable[[float], Sequence[float]]  # v [m/s], P and P+ [W] at a viscosity [m^2/s]
Change = tuple[str, str, float, float, float, float]


def course_swim(swim: Trajectory, scenario: Scenario, traced: bool, changes: Sequence[Change]) -> dict[str, Any]:
    """What the study measures of a swim through a course, for `Evaluator.measured`.

    Args:
        swim: through the course.
        scenario: of it.
        traced: whether it has recoveries and traces.
        changes: for each sudden one the fluids before and after it, start and end of the new fluid [s], and in this
            one the period of the gait [s] and the steady speed [m/s].

    Returns:
        Whether it `diverged`; where it begins, `start`, and the `distance` from there along x [m]; `work` of the
        command torques and the `positive_work` of the joints that drive [J]; `stray`, the largest angle between x and
        the direction of travel over 5 s [rad]; and the rows of `recoveries` and `traces`, if they are to be `traced`.
    """
    x, recoveries = swim.center[:, 0], []
    traced = traced and not swim.diverged
    for before, after, start, end, period, speed in changes if traced else ():
        seconds, held = recovery(x, swim.rate, start, end, period, speed)
        change = {"time": start, "from": before, "to": after}
        recoveries.append(change | {"steady_speed": speed, "seconds": seconds, "held": held})
    return {
        "diverged": bool(swim.diverged),
        "start": float(x[0]),
        "distance": float(x[-1] - x[0]),
        "work": float(swim.command_work[-1]),
        "positive_work": float(swim.positive_work[-1]),
        "stray": metrics.stray(swim),
        "recoveries": recoveries,
        "traces": list(_trace(swim, scenario)) if traced else [],
    }


def _trace(swim: Trajectory, scenario: Scenario) -> Iterator[dict[str, float]]:
    """Speed and both powers over a swim, a few rows a second."""
    half, x = _TRACE_WINDOW / 2, swim.center[:, 0]
    sums = {"speed": x, "power": swim.command_work, "positive_power": swim.positive_work}
    means = {name: period_speed(values, swim.rate, _TRACE_WINDOW) for name, values in sums.items()}
    for time in np.arange(half, scenario.duration - half, 1 / _TRACED).tolist():
        row, here = round((time - half) * swim.rate), float(x[round(time * swim.rate)])
        place = {"time": time, "x": here, "viscosity": viscosity_at(scenario.fluid, time, here)}
        yield place | {name: float(values[row]) for name, values in means.items()}


def recovery(
    position: FloatArray, rate: float, start: float, end: float, period: float, steady: float
) -> tuple[float, float]:
    """When a swimmer is back within 5 % of its steady speed after a change, and stays there for 5 s.

    In a new fluid that lasts less than 5 s it must stay to the end; in one shorter than a gait period nothing is known.

    Args:
        position: along x, shape (n_times,) [m].
        rate: rows of it per second [Hz].
        start: of the new fluid [s].
        end: of it [s].
        period: of the gait in it, over which speed is a mean; each counts from its beginning [s].
        steady: speed in it [m/s].

    Returns:
        The time from the change to the first gait period of those that stay within tolerance [s], NaN if there is none;
        and the share of the periods that begin after the change and are within tolerance.
    """
    speed = period_speed(position, rate, period)[round(start * rate) : round((end - period) * rate) + 1]
    within = np.abs(speed - steady) <= TOLERANCE * abs(steady)
    if not len(within):
        return np.nan, np.nan
    needed = min(round(_STEADILY * rate), len(within))
    run = np.convolve(within, np.ones(needed, int))[needed - 1 : len(within)]  # periods within tolerance, of `needed`
    back = np.flatnonzero(run == needed)
    return float(back[0] / rate) if len(back) else np.nan, float(within.mean())


def period_speed(position: FloatArray, rate: float, period: float) -> FloatArray:
    """Mean speed over the gait period that begins at each row [m/s]; the last rows have none."""
    rows = max(round(period * rate), 1)
    return (position[rows:] - position[:-rows]) * rate / rows


def ideal_swim(medium: Fluid | FluidField, duration: float, steady: Steady, start: float) -> FloatArray:
    """How far a swimmer gets that is at every moment at its steady state [m], its work and its positive work [J].

    Args:
        medium: what it swims in.
        duration: of the swim [s].
        steady: of the swimmer.
        start: where it begins [m].
    """
    origin = np.array([start, 0.0, 0.0])
    totals = origin.copy()
    for time in np.arange(round(duration / _STEP)) * _STEP:
        totals += np.multiply(steady(viscosity_at(medium, float(time), float(totals[0]))), _STEP)
    return totals - origin


def between_viscosities(table: pd.DataFrame) -> Steady:
    """What is steady at a viscosity, linear in its logarithm between rows: columns viscosity, speed and powers."""
    rows = table.sort_values("viscosity").drop_duplicates("viscosity")
    logarithms, columns = np.log10(rows["viscosity"]), rows[["speed", "power", "positive_power"]].to_numpy().T
    return lambda viscosity: [float(np.interp(np.log10(viscosity), logarithms, values)) for values in columns]


def ideal_switching(gaits: Iterable[Steady]) -> Steady:
    """Speed and powers of the fastest of several gaits at a viscosity.

    A gait whose speed is not known there, since it diverged, is not switched to.
    """
    return lambda viscosity: max(
        (steady(viscosity) for steady in gaits), key=lambda values: np.nan_to_num(values[0], nan=-np.inf)
    )
