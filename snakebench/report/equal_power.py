"""Points of fronts at equal power."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from snakebench.value import FloatArray


def fastest_within(points: pd.DataFrame, power: float, by: Sequence[str] = ()) -> pd.DataFrame:
    """The rows of the highest speed that need no more than a power, one of each group; none where there is none."""
    ranked = points[points["power"] <= power].sort_values("speed", ascending=False, kind="stable")
    return ranked.drop_duplicates(by) if by else ranked.head(1)


def speeds_within(points: pd.DataFrame, powers: FloatArray) -> FloatArray:
    """The highest speed of points that need no more than each power [m/s]; NaN where there is none."""
    ordered = points.sort_values("power")
    place = np.searchsorted(ordered["power"], powers, side="right")
    return np.concatenate([[np.nan], np.maximum.accumulate(ordered["speed"])])[place]
