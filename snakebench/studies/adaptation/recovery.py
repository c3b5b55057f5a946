"""Swims through changing fluids: what is measured of them, and the ideal swim without delay."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from snakebench import accuracy, metrics
from snakebench.evaluation import ENERGY_BOUND
from snakebench.fluid import Fluid, FluidField
from snakebench.physics.body import viscosity_at
from snakebench.scenario import Scenario
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

_TOLERANCE = 0.05  # of the steady speed, within which a swimmer is back
_STEADILY = 5.0  # how long it must stay there [s]
_STEP = 0.02  # of the ideal swim [s]
_TRACED = 4  # rows a second of a trace
_TRACE_WINDOW = 1.0  # over which a trace's speed and power are means [s]

# The fluids before and after, start and end of the new one [s], the gait's period [s] and steady speed in it [m/s].
Change = tuple[str, str, float, float, float, float]


def course_swim(swim: Trajectory, scenario: Scenario, traced: bool, changes: Sequence[Change]) -> dict[str, Any]:
    """What the study measures of a swim through a course, for `Evaluator.measured`.

    `changes` are the sudden ones of the fluid. The answer has `totals` from rest, a row of `courses`; where the swim
    begins, `start` [m]; and, if it is to be `traced`, rows of `recoveries` and `traces`.
    """
    x, duration, mass = swim.center[:, 0], scenario.duration, scenario.robot.total_mass
    distance = float(x[-1] - x[0])
    speed, power, positive = (total / duration for total in (distance, _spent(swim), float(swim.positive_work[-1])))
    totals = {
        "status": _status(swim),
        "distance": distance,
        "speed": speed,
        "power": power,
        "positive_power": positive,
        "cost_of_transport": metrics.cost_of_transport(power, speed, mass),
        "positive_cost_of_transport": metrics.cost_of_transport(positive, speed, mass),
        "stray": metrics.stray(swim),
    }
    traced = traced and not swim.diverged
    recoveries = []
    for before, after, start, end, period, steady in changes if traced else ():
        change = {"time": start, "from": before, "to": after, "steady_speed": steady}
        recoveries.append(change | recovery(x, swim.rate, start, end, period, steady))
    traces = list(_trace(swim, scenario)) if traced else []
    return {"totals": totals, "start": float(x[0]), "recoveries": recoveries, "traces": traces}


def _spent(swim: Trajectory) -> float:
    """The work of the whole swim, less what springs and links have stored more at its end than at its start [J]."""
    work = float(swim.command_work[-1])
    if swim.diverged:
        return work
    first, last = (float(metrics.stored_energy(swim, row)[0]) for row in (slice(1), slice(-1, None)))
    return work - (last - first)


def _status(swim: Trajectory) -> str:
    """As that of an evaluation: of the work and the energy balance of the whole swim."""
    if swim.diverged:
        return "diverged"
    gap = accuracy.energy_gap(swim)
    closes = gap is None or abs(gap) <= ENERGY_BOUND
    return "ok" if closes and swim.command_work[-1] >= 0 else "invalid"


def _trace(swim: Trajectory, scenario: Scenario) -> Iterator[dict[str, float]]:
    half, x = _TRACE_WINDOW / 2, swim.center[:, 0]
    sums = {"speed": x, "power": swim.command_work, "positive_power": swim.positive_work}
    means = {name: period_speed(values, swim.rate, _TRACE_WINDOW) for name, values in sums.items()}
    for time in np.arange(half, scenario.duration - half, 1 / _TRACED).tolist():
        row, here = round((time - half) * swim.rate), float(x[round(time * swim.rate)])
        place = {"time": time, "x": here, "viscosity": viscosity_at(scenario.fluid, time, here)}
        yield place | {name: float(values[row]) for name, values in means.items()}


def recovery(
    position: FloatArray, rate: float, start: float, end: float, period: float, steady: float
) -> dict[str, float]:
    """How a swimmer gets back to its steady speed after a change.

    Args:
        position: along x, shape (n_times,) [m].
        rate: rows of it per second [Hz].
        start: of the new fluid [s].
        end: of it [s].
        period: of the gait in it, over which speed is a mean [s].
        steady: speed in it [m/s].

    Returns:
        `seconds` from the change to the end of the first gait period of those that stay within 5 % of the steady speed
        for 5 s, or to the end of the fluid if that is sooner; NaN if there is none. It is at least a period: no swimmer
        is known to be back before. `held` is the share of the periods after the change that are within 5 %. `loss` is
        the distance lost against its steady speed from the change on, over as many whole periods as the fluid lasts
        [m]; it is negative where the swimmer glides. All are NaN if the fluid does not last for a period.
    """
    speed = period_speed(position, rate, period)[round(start * rate) : round((end - period) * rate) + 1]
    within = np.abs(speed - steady) <= _TOLERANCE * abs(steady)
    if not len(within):
        return dict.fromkeys(("seconds", "held", "loss"), np.nan)
    needed = min(round(_STEADILY * rate), len(within))
    run = np.convolve(within, np.ones(needed, int))[needed - 1 : len(within)]  # periods within tolerance, of `needed`
    back = np.flatnonzero(run == needed)
    seconds = float(back[0] / rate) + period if len(back) else np.nan
    whole = int((end - start) / period) * period
    swum = float(position[round((start + whole) * rate)] - position[round(start * rate)])
    return {"seconds": seconds, "held": float(within.mean()), "loss": steady * whole - swum}


def period_speed(position: FloatArray, rate: float, period: float) -> FloatArray:
    """Mean speed over the gait period that begins at each row [m/s]; the last rows have none."""
    rows = max(round(period * rate), 1)
    return (position[rows:] - position[:-rows]) * rate / rows


def ideal_swim(
    medium: Fluid | FluidField, duration: float, start: float, swimmers: Sequence[pd.DataFrame]
) -> FloatArray:
    """The way from x = `start` [m], work and positive work [J] if the fastest swimmer is always at its steady state.

    Each has steady speed and powers at some viscosities, linear in their logarithm between them; one that diverged
    somewhere is not taken there.
    """
    tables = [rows.sort_values("viscosity").drop_duplicates("viscosity") for rows in swimmers]
    known = [
        (np.log10(rows["viscosity"].to_numpy()), rows[["speed", "power", "positive_power"]].to_numpy(float).T)
        for rows in tables
    ]
    origin = np.array([start, 0.0, 0.0])
    totals = origin.copy()
    for time in np.arange(round(duration / _STEP)) * _STEP:
        viscosity = np.log10(viscosity_at(medium, float(time), float(totals[0])))
        steady = [[float(np.interp(viscosity, at, column)) for column in columns] for at, columns in known]
        totals += np.multiply(max(steady, key=lambda values: np.nan_to_num(values[0], nan=-np.inf)), _STEP)
    return totals - origin
