"""What fronts of speed against power are worth: hypervolume, named points, and speed at powers.

Fronts are lines as in `report.equal_power`; points are speed [m/s] and power [W], shape (n, 2).
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from snakebench.names import CURRENCIES
from snakebench.report.equal_power import WIDEST, front_line
from snakebench.report.table import POWERS
from snakebench.value import FloatArray

MEASURED = ["speed", *POWERS]


def hypervolume(points: FloatArray, reference: tuple[float, float], widest: float = WIDEST) -> float:
    """The area below the front of points, from a reference of speed and up to one of power [m/s W].

    Beyond its fastest point the front goes on at this speed. With `widest` = 1 it is a staircase: the area that the
    points dominate.
    """
    least, most = reference
    line = front_line(pd.DataFrame(points, columns=["speed", "power"]), widest=widest)
    power, speed = line.index.to_numpy(), line["speed"].to_numpy()
    if not len(line) or power[0] >= most or np.interp(most, power, speed) <= least:
        return 0.0
    inside = (power <= most) & (speed >= least)
    start = max(power[0], float(np.interp(least, speed, power)))
    across = np.array([start, *power[inside], most])
    above = np.array([max(least, speed[0]), *speed[inside], np.interp(most, power, speed)]) - least
    return float(np.trapezoid(above, across))


def knee(points: FloatArray) -> int:
    """The point of a front that is farthest from the line through its ends, both axes scaled to its extent (ours)."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    scaled = (points - low) / np.where(extent > 0, extent, 1.0)
    return int(np.argmax(scaled[:, 0] - scaled[:, 1]))


def indicators(fronts: pd.DataFrame, reference: tuple[float, float], powers: Sequence[float]) -> pd.DataFrame:
    """What each front is worth, one row a front: hypervolume from a reference [m/s W], named points, speed at powers.

    All is by the power of the front's currency. `beyond` counts points that need more power or are slower than the
    reference; the knee is of what lies within it. Speed at a power is 0 below the front's least power,
    where a gait stands still, and not defined beyond its fastest point, which is not compared at more power than its
    own.
    """
    return pd.DataFrame(
        {"space": space, "front": name, "currency": currency} | _worth(part, str(currency), reference, powers)
        for (space, name, currency), part in fronts.groupby(["space", "front", "currency"], sort=False)
    )


def _worth(
    part: pd.DataFrame, currency: str, reference: tuple[float, float], powers: Sequence[float]
) -> dict[str, float]:
    power = CURRENCIES[currency]
    points, searched = part[["speed", power]].to_numpy(), part[["speed_searched", f"{power}_searched"]].to_numpy(float)
    inside = (points[:, 0] > reference[0]) & (points[:, 1] < reference[1])
    worth: dict[str, float] = {"points": len(points), "beyond": int((~inside).sum())}
    worth |= {"hypervolume": hypervolume(points, reference)}
    worth |= {"hypervolume_searched": hypervolume(searched, reference)}
    line = front_line(part[MEASURED], currency)
    for at in powers:
        worth |= _at(line, at)
    named = {"fastest": len(points) - 1, "thriftiest": int(np.argmin(points[:, 1] / points[:, 0]))}
    if inside.any():
        named["knee"] = int(np.flatnonzero(inside)[knee(points[inside])])
    for key, k in named.items():
        worth |= {f"{key}_{name}": part[name].iloc[k] for name in MEASURED}
    return worth


def _at(line: pd.DataFrame, power: float) -> dict[str, float]:
    """Speed and both powers at a power [W] of a front that is a line."""
    at: dict[str, float] = dict.fromkeys(MEASURED, np.nan)
    if power < line.index.min():
        at["speed"] = 0.0
    elif power <= line.index.max():
        at = {name: float(np.interp(power, line.index, line[name])) for name in MEASURED}
    return {f"{name}_at_{power:g}_W": value for name, value in at.items()}
