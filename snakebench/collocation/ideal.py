"""Ideal switching of the limit of the body: how far it gets through a course at a mean power.

The fluid is known at every moment and the gait changes at once. The power is distributed over the course so that the
distance is largest. As far as the limit is known, no swimmer with the same bounds gets farther at the same mean power;
below the lowest power of a viscosity, where it is not known, the speed is a line from rest.

Envelopes of value against power are concave: a swimmer that may alternate between two of its points reaches every point
of the line between them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from snakebench.collocation.front import interpolated, risen
from snakebench.fluid import Fluid, FluidField
from snakebench.names import CURRENCIES
from snakebench.physics.body import viscosity_at
from snakebench.value import FloatArray

_TIME = 0.05  # of a step of a course along time [s]
_SPACE = 0.02  # of one along x [m]
_POWERS = 100  # between the lowest and the highest, at which the limit is interpolated
_RATIOS = np.geomspace(1e-3, 1e4, 400)  # of what a second is worth to what a joule is worth, along x [W]


class LimitFront(NamedTuple):
    """The speed of the limit over viscosity and power; at 0 W it stands still."""

    viscosity: FloatArray  # kinematic, increasing, shape (n,) [m^2/s]
    power: FloatArray  # shape (m,) [W]
    speed: FloatArray  # shape (n, m) [m/s]

    def at(self, viscosity: FloatArray) -> FloatArray:
        """Speeds at viscosities, constant outside the range, shape (n_viscosities, m) [m/s]."""
        return interpolated(np.log10(self.viscosity), self.speed, np.log10(viscosity))


def limit_front(limit: pd.DataFrame, currency: str, bound: float) -> LimitFront | None:
    """The front of the limit in a currency, with a bound on target angles [rad]; None without such rows.

    It is interpolated as `snakebench.limit` is. Below the lowest power of a viscosity the speed is linear, from rest;
    beyond the largest it stays.
    """
    column = CURRENCIES[currency]
    rows = limit[(limit["currency"] == currency) & np.isclose(limit["bound"], bound) & limit["speed_limit"].isna()]
    rows = rows.dropna(subset=["speed", column])
    if rows.empty:
        return None
    rows = rows[rows["bounds"] == rows["bounds"].iloc[0]]  # others of the same angles have targets that are held
    power = np.geomspace(rows[column].min(), rows[column].max(), _POWERS)
    fronts = {viscosity: risen(part, currency) for viscosity, part in rows.groupby("viscosity")}
    speed = [_speeds(part[column].to_numpy(), part["speed"].to_numpy(), power) for part in fronts.values()]
    return LimitFront(np.array(list(fronts), float), np.insert(power, 0, 0.0), np.insert(speed, 0, 0.0, axis=1))


def _speeds(known: FloatArray, speed: FloatArray, power: FloatArray) -> FloatArray:
    return interpolated(np.log10(known), speed, np.log10(power)) * np.minimum(power / known[0], 1.0)


def ideal_curve(front: LimitFront, medium: Fluid | FluidField, duration: float, start: float) -> FloatArray:
    """Mean power [W] and the distance [m] of ideal switching from x = `start` [m], rows from rest, shape (n, 2)."""
    if isinstance(medium, FluidField) and medium.along == "x":
        return _along_x(front, medium, duration, start)
    times = (np.arange(max(round(duration / _TIME), 1)) + 0.5) * _TIME
    viscosity, counts = np.unique([viscosity_at(medium, float(time), start) for time in times], return_counts=True)
    envelopes = [envelope(front.power, speed) for speed in front.at(viscosity)]
    return distributed(envelopes, counts / counts.sum()) * (1.0, duration)


def _along_x(front: LimitFront, medium: FluidField, duration: float, start: float) -> FloatArray:
    """The same where the fluid changes along x: what comes later depends on the speed before.

    A calculus of variations gives the power at each place: it minimises (r + P) / v, the cost of a metre, where r is
    the value of a second over that of a joule, constant along the course. Each r gives one mean power.
    """
    places = start + (np.arange(int(front.speed.max() * duration / _SPACE) + 1) + 0.5) * _SPACE
    speeds = front.at(np.array([viscosity_at(medium, 0.0, float(x)) for x in places]))
    rows, curve = np.arange(len(places)), [(0.0, 0.0)]
    with np.errstate(divide="ignore"):
        slowness = 1 / speeds
    for ratio in _RATIOS:
        best = np.argmin((ratio + front.power) * slowness, axis=1)
        seconds = _SPACE * slowness[rows, best]
        time, energy = (np.insert(np.cumsum(part), 0, 0.0) for part in (seconds, seconds * front.power[best]))
        distance = np.interp(duration, time, np.arange(len(time)) * _SPACE)
        curve.append((float(np.interp(duration, time, energy)) / duration, float(distance)))
    return np.unique(np.array(curve), axis=0)


def upper_hull(power: FloatArray, value: FloatArray) -> NDArray[np.intp]:
    """Which points are corners of the concave envelope, from the least power to the highest value; NaN are left out.

    Between corners, the envelope is linear: it is at least as high as any line between two points of a front.
    """
    known = np.flatnonzero(~np.isnan(power + value))
    corners = list[int]()
    for k in known[np.lexsort((-value[known], power[known]))].tolist():
        if corners and value[k] <= value[corners[-1]]:
            continue
        while len(corners) > 1 and _slope(power, value, corners[-2], corners[-1]) <= _slope(
            power, value, corners[-1], k
        ):
            corners.pop()
        corners.append(k)
    return np.array(corners, np.intp)


def envelope(power: FloatArray, value: FloatArray) -> FloatArray:
    """The corners of the concave envelope as rows of power and value, shape (n, 2)."""
    corners = upper_hull(power, value)
    return np.column_stack([power[corners], value[corners]])


def distributed(envelopes: Sequence[FloatArray], shares: FloatArray) -> FloatArray:
    """The highest mean value at each mean power, if power is distributed over places: rows of both, shape (n, 2).

    Each place has its concave envelope, shape (m, 2), and its share of the time. Power is added where the next watt is
    worth most, so that the marginal value is equal in all places. This is exact for piecewise linear envelopes.
    """
    start = np.sum([share * corners[0] for corners, share in zip(envelopes, shares, strict=True)], axis=0)
    pieces = [share * np.diff(corners, axis=0) for corners, share in zip(envelopes, shares, strict=True)]
    steps = np.vstack(pieces)
    steps = steps[np.argsort(-steps[:, 1] / steps[:, 0], kind="stable")]
    return np.vstack([start, start + np.cumsum(steps, axis=0)])


def at_power(curve: FloatArray, power: FloatArray | float) -> FloatArray:
    """A curve's value at powers: NaN below its least power, and its highest value beyond its largest power."""
    if not len(curve):
        return np.full(np.shape(power), np.nan)
    return np.asarray(np.interp(power, curve[:, 0], curve[:, 1], left=np.nan))


def _slope(power: FloatArray, value: FloatArray, first: int, second: int) -> float:
    return float((value[second] - value[first]) / (power[second] - power[first]))
