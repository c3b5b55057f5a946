"""Pareto dominance of speed against power: fronts, their hypervolume, knee, attainment and best combinations.

Points are rows of speed [m/s], to be large, and power [W], to be small; shape (n, 2). Those with a NaN are on no front.
"""

from __future__ import annotations

from collections.abc import Sequence

import moocore
import numpy as np
from numpy.typing import NDArray

from snakebench.value import FloatArray

Indices = NDArray[np.intp]
_BETTER = [True, False]  # speed is maximised, power is not


def front(points: FloatArray) -> Indices:
    """Which points no other dominates, from least power to most, shape (n_front,); of equal points the first."""
    known = np.flatnonzero(~np.isnan(points).any(axis=1))
    if len(known) == 0:
        return known
    best = known[moocore.is_nondominated(points[known], maximise=_BETTER)]
    return best[np.argsort(points[best, 1], kind="stable")]


def hypervolume(points: FloatArray, reference: tuple[float, float]) -> float:
    """What the points dominate, up to a reference of speed and power [m/s W]; those beyond it add nothing."""
    members = points[front(points)]
    return float(moocore.hypervolume(members, ref=reference, maximise=_BETTER)) if len(members) else 0.0


def simple_sum(fronts: Sequence[FloatArray]) -> tuple[FloatArray, Indices]:
    """The best that switching could do: a point of each front, averaged, and the best of these combinations.

    Sums are filtered front by front: what is dominated in a partial sum is dominated in every whole one.

    Returns:
        The mean speed and power of the combinations on the front, shape (n, 2), and which point of each front they
        combine, shape (n, n_fronts).
    """
    sums, members = np.zeros((1, 2)), np.zeros((1, 0), np.intp)
    for points in fronts:
        every = (sums[:, None] + points).reshape(-1, 2)
        best = front(every)
        sums, members = every[best], np.column_stack([members[best // len(points)], best % len(points)])
    return sums / len(fronts), members


def knee(points: FloatArray) -> int:
    """The point of a front that is farthest from the line through its ends, both axes scaled to its extent (ours)."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    scaled = (points - low) / np.where(extent > 0, extent, 1.0)
    return int(np.argmax(scaled[:, 0] - scaled[:, 1]))


def attainment(fronts: Sequence[FloatArray]) -> dict[str, FloatArray]:
    """What the best, the middle and the worst of several searches attain at each power: surfaces by name.

    The surface "best" is attained by one of the fronts at least, "median" by half of them, "worst" by all.
    """
    costs = np.vstack([points * (-1, 1) for points in fronts])
    sets = np.repeat(np.arange(len(fronts)), [len(points) for points in fronts])
    levels = {"best": 100 / len(fronts), "median": 50.0, "worst": 100.0}
    surfaces = moocore.eaf(costs, sets=sets, percentiles=sorted(set(levels.values())))
    return {name: surfaces[np.isclose(surfaces[:, 2], level), :2] * (-1, 1) for name, level in levels.items()}
