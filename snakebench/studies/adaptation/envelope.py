"""Concave envelopes of value against power, and the best distribution of power over places at equal marginal value.

A swimmer that may alternate between two of its points reaches every point of the line between them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from snakebench.value import FloatArray


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
