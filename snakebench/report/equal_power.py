"""Fronts of speed against power as lines, by one rule, and what they are at equal power.

The front of a set of points consists of those that no other dominates. Neighbours on it are joined by a straight line
where the power of the second is at most twice that of the first; across a wider gap the front is a step. So what is
sampled densely is a continuous line (preference-conditioned policies, waveforms at twenty prices or more, grids of
gaits), and what is really discrete is a staircase (single tuned gaits, few prices). Nothing is joined across a
gap between two branches of gaits, which no gait between them need fill.

A front is never extrapolated: below its least power there is no speed, and beyond its fastest point there is this point
at its own power. Power is P ("net") or P+ ("positive"), as `CURRENCIES` has them.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from snakebench.names import CURRENCIES
from snakebench.value import FloatArray

WIDEST = 2.0  # ratio of the powers of neighbours that are joined: joining v ~ P^(1/2) is at most 1.5 % too low


def front_line(points: pd.DataFrame, currency: str = "net", widest: float = WIDEST) -> pd.DataFrame:
    """The front of points as a line, indexed by its power [W]: its members, and one repeated at the end of each step.

    Speed [m/s] rises along it. Points without speed or power are on no front.
    """
    rows, power, _ = _line(points, currency, widest)
    return points.iloc[rows].set_axis(power)


def _line(
    points: pd.DataFrame, currency: str = "net", widest: float = WIDEST
) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """The line of a front: the row in `points`, the power [W] and the speed [m/s] of each of its points."""
    speed, power = points["speed"].to_numpy(float), points[CURRENCIES[currency]].to_numpy(float)
    ranked = np.lexsort((-speed, power))
    ranked = ranked[np.isfinite(speed[ranked] + power[ranked])]
    faster = speed[ranked] > np.maximum.accumulate(np.append(-np.inf, speed[ranked]))[:-1]
    front = ranked[faster]
    at = power[front]
    place = np.sort([*range(len(at)), *np.flatnonzero(at[1:] > widest * at[:-1])]).astype(int)
    repeated = np.flatnonzero(np.diff(place, prepend=-1) == 0)
    ends = at[place]
    ends[repeated] = at[place[repeated] + 1]
    return front[place], ends, speed[front[place]]


def fastest_within(points: pd.DataFrame, power: float, by: Sequence[str] = ()) -> pd.DataFrame:
    """The front of each group of points at a power [W]: a row each; none where every point needs more.

    Columns of floats are interpolated; others are those of the point before. The row's own power says where it is:
    below the power asked for on a step, and beyond the fastest point.
    """
    groups = [part for _, part in points.groupby(list(by), sort=False)] if by else [points]
    rows = [row for part in groups if len(row := _row(front_line(part), power))]
    return pd.concat(rows, ignore_index=True) if rows else points.iloc[:0]


def _row(line: pd.DataFrame, power: float) -> pd.DataFrame:
    """A line at a power [W]; no row below its least power."""
    before = line[line.index <= power].tail(1)
    if before.empty:
        return before
    numbers = line.select_dtypes("float")
    return before.assign(**{str(name): np.interp(power, line.index, numbers[name]) for name in numbers})


def speeds_within(
    points: pd.DataFrame, powers: FloatArray, currency: str = "net", widest: float = WIDEST
) -> FloatArray:
    """The speed of the front of points at each power [m/s]; that of its fastest point beyond it; NaN below its least.

    `top_power` says from which power on it is that of the fastest point.
    """
    _, power, speed = _line(points, currency, widest)
    return np.interp(powers, power, speed, left=np.nan) if len(power) else np.full(np.shape(powers), np.nan)


def powers_needed(points: pd.DataFrame, speeds: FloatArray, currency: str = "net") -> FloatArray:
    """The least power of the front of points at each speed [W]; NaN below its slowest point and beyond its fastest."""
    _, power, speed = _line(points, currency)
    needed = np.full(np.shape(speeds), np.nan)
    for k, wanted in enumerate(speeds):
        if len(speed) and speed[0] <= wanted <= speed[-1]:
            after = int(np.searchsorted(speed, wanted))  # the first point that is as fast
            ends = slice(max(after - 1, 0), after + 1)
            needed[k] = np.interp(wanted, speed[ends], power[ends])
    return needed


def top_power(points: pd.DataFrame, currency: str = "net") -> float:
    """The power of the fastest point [W], beyond which a front is not compared; NaN without points."""
    _, power, _ = _line(points, currency)
    return float(power[-1]) if len(power) else np.nan
