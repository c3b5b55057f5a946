"""Bounds on the numerical errors of speeds and powers, and what a comparison would be if they were as large.

Errors of a step are alike for all seeds, so that no mean over seeds makes them smaller: they widen an interval by what
the comparison changes if one side is better by its bounds and the other worse.
"""

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
import pandas as pd

from snakebench.report.table import COSTS

T = TypeVar("T")
BOUNDS = {"speed": "speed_bound", "power": "power_bound"}
_NUMERICS = {"variant", "engine", "physics_rate", "value"}  # which differ between two computations of a swim
_FRONT = ["space", "front", "point"]


def bounded(rows: pd.DataFrame, tables: Mapping[str, pd.DataFrame], name: str) -> pd.DataFrame:
    """Rows of the table `name` of a study, with bounds on the relative errors of v and P in columns of `BOUNDS` [1].

    Of a swim, those of its evaluation, or its difference to the coarser step, which version 1.0 wrote. Of a point of a
    front, the difference between the engines; of ideal switching, those of the points combined. Zero if unknown.
    """
    if "speed_searched" in rows:
        errors = {bound: (rows[of] / rows[f"{of}_searched"] - 1).abs() for of, bound in BOUNDS.items()}
    elif (members := [str(column) for column in rows if str(column).endswith("_point")]) and "space" in rows:
        errors = _of_members(rows, bounded(tables["fronts"], tables, "fronts"), members)
    elif "speed_error" in rows and rows["speed_error"].notna().any():
        errors = {bound: rows[f"{of}_error"] for of, bound in BOUNDS.items()}
    else:
        errors = _to_coarser(rows, tables[name])
    known = {bound: error.astype(float).fillna(0.0).clip(upper=1.0) for bound, error in errors.items()}
    return rows.assign(**known)


def _of_members(rows: pd.DataFrame, fronts: pd.DataFrame, members: list[str]) -> dict[str, pd.Series]:
    """Of means over fluids: the errors of the points combined, each in proportion to its speed or power."""
    points, places = fronts.set_index(_FRONT), []
    for column in members:
        place = rows.assign(front=column.removesuffix("_point"), point=rows[column])[_FRONT]
        places.append(points.reindex(pd.MultiIndex.from_frame(place)).set_axis(rows.index))
    sums = sum((part[[*BOUNDS]] for part in places[1:]), places[0][[*BOUNDS]])
    errors = {of: pd.concat([part[of] * part[bound] for part in places], axis=1) for of, bound in BOUNDS.items()}
    return {bound: errors[of].sum(axis=1) / sums[of] for of, bound in BOUNDS.items()}


def _to_coarser(rows: pd.DataFrame, table: pd.DataFrame) -> dict[str, pd.Series]:
    """Relative differences to the same swims at the coarser step, if the study has them."""
    if "variant" not in table or "status" not in table:
        return {bound: pd.Series(np.nan, rows.index) for bound in BOUNDS.values()}
    columns = [str(column) for column in table]
    labels = [name for name in columns[: columns.index("status")] if name not in _NUMERICS]
    coarser = table[table["variant"] == "coarser step"].drop_duplicates(labels)[[*labels, *BOUNDS]]
    other = rows[labels].merge(coarser, how="left", on=labels).set_axis(rows.index)
    return {bound: (other[of] / rows[of] - 1).abs() for of, bound in BOUNDS.items()}


def shifted(rows: pd.DataFrame, sign: int) -> pd.DataFrame:
    """Bounded rows as they are (0), or if they were better (1) or worse (-1) by their bounds.

    Better is faster, at less power P; P+ changes by as much as P, and costs of transport follow.
    """
    faster, cheaper = 1 + sign * rows["speed_bound"], 1 - sign * rows["power_bound"]
    changed = {"speed": rows["speed"] * faster, "power": rows["power"] * cheaper}
    saved = rows["power"] - changed["power"]
    scales = {"cost_of_transport": cheaper / faster}
    if "positive_power" in rows:
        changed["positive_power"] = rows["positive_power"] - saved
        scales[COSTS[1]] = (1 - saved / rows["positive_power"]) / faster
    changed |= {cost: rows[cost] * scale for cost, scale in scales.items() if cost in rows}
    return rows.assign(**changed)


def by_sign(values: Callable[[int], T]) -> dict[int, T]:
    """What comes out as measured (0), and if errors made it better (1) or worse (-1)."""
    return {sign: values(sign) for sign in (0, 1, -1)}
