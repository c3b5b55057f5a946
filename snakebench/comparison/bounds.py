"""Bounds on the errors of speeds and powers, and what a comparison would be if they were as large.

Errors of an engine's step are alike for all seeds, and the best of several searches has no seeds, so that no mean over
seeds makes these errors smaller: they widen an interval by what the comparison changes if one side is better by its
bounds and the other worse.

A front of sinusoids is published as the best of a grid, which has no seeds, and of every seed of NSGA-II, so that a
policy is compared with the best sinusoids known. With one seed only, it could have been as low as the grid and what all
seeds attain; as much may be missing from it. Of free waveforms and sea snakes there is one gait or front for each seed.
"""

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
import pandas as pd

from snakebench.names import COARSE, CURRENCIES
from snakebench.report.equal_power import speeds_within
from snakebench.report.table import COSTS, MEASURED
from snakebench.studies.fronts import eligible, means_by_gait, objectives

T = TypeVar("T")
BOUNDS = {"speed": "speed_bound", "power": "power_bound"}
_NUMERICS = {"variant", "engine", "physics_rate", "value"}  # which differ between two computations of a swim
_LABELS = {"space", "fluid", "status", "steady", *MEASURED}  # columns of a grid that are no parameters of a gait
_FRONT = ["space", "front", "currency", "point"]


def bounded(tables: Mapping[str, pd.DataFrame], name: str) -> pd.DataFrame:
    """A table of a study, with bounds on the relative errors of v and P in columns of `BOUNDS` [1].

    Of a swim, those of its evaluation, or where the table has none its difference to the coarser step. Of a point of a
    front, the difference between the engines, and for v the gap of the search; of ideal switching, those of the points
    combined. Zero if unknown.
    """
    table = tables[name]
    if name == "fronts":
        errors = {bound: (table[of] / table[f"{of}_searched"] - 1).abs() for of, bound in BOUNDS.items()}
        errors["speed_bound"] = errors["speed_bound"] + search_gap(tables).fillna(0.0)
    elif name == "switching" and "space" in table:
        errors = _of_members(table, bounded(tables, "fronts"))
    elif "speed_error" in table:
        errors = {bound: table[f"{of}_error"] for of, bound in BOUNDS.items()}
    else:
        errors = _to_coarser(table)
    known = {bound: error.astype(float).fillna(0.0).clip(upper=1.0) for bound, error in errors.items()}
    return table.assign(**known)


def _of_members(switching: pd.DataFrame, fronts: pd.DataFrame) -> dict[str, pd.Series]:
    """Of means over fluids: the errors of the points combined, each in proportion to its speed or power."""
    points, members = fronts.set_index(_FRONT), []
    for column in (name for name in map(str, switching) if name.endswith("_point")):
        place = switching.assign(front=column.removesuffix("_point"), point=switching[column])[_FRONT]
        members.append(points.reindex(pd.MultiIndex.from_frame(place)).set_axis(switching.index))
    errors = {of: pd.concat([part[of] * part[bound] for part in members], axis=1) for of, bound in BOUNDS.items()}
    sums = {of: pd.concat([part[of] for part in members], axis=1).sum(axis=1) for of in BOUNDS}
    return {bound: errors[of].sum(axis=1) / sums[of] for of, bound in BOUNDS.items()}


def _to_coarser(table: pd.DataFrame) -> dict[str, pd.Series]:
    """Relative differences to the same swims at the coarser step, if the study has them."""
    if "variant" not in table or "status" not in table:
        return {bound: pd.Series(np.nan, table.index) for bound in BOUNDS.values()}
    columns = [str(column) for column in table]
    labels = [name for name in columns[: columns.index("status")] if name not in _NUMERICS]
    coarser = table[table["variant"] == COARSE].drop_duplicates(labels)[[*labels, *BOUNDS]]
    other = table[labels].merge(coarser, how="left", on=labels).set_axis(table.index)
    return {bound: (other[of] / table[of] - 1).abs() for of, bound in BOUNDS.items()}


def shifted(rows: pd.DataFrame, sign: int) -> pd.DataFrame:
    """Bounded rows as they are (0), or if they were better (1) or worse (-1) by their bounds.

    Better is faster, at less power P; P+ changes by as much as P, and costs of transport follow.
    """
    faster, cheaper = 1 + sign * rows["speed_bound"], 1 - sign * rows["power_bound"]
    changed = {"speed": rows["speed"] * faster, "power": rows["power"] * cheaper}
    saved = rows["power"] - changed["power"]
    scales = {"cost_of_transport": cheaper / faster}
    changed["positive_power"] = rows["positive_power"] - saved
    scales[COSTS[1]] = (1 - saved / rows["positive_power"]) / faster
    changed |= {cost: rows[cost] * scale for cost, scale in scales.items() if cost in rows}
    return rows.assign(**changed)


def by_sign(values: Callable[[int], T]) -> dict[int, T]:
    """What comes out as measured (0), and if errors made it better (1) or worse (-1)."""
    return {sign: values(sign) for sign in (0, 1, -1)}


def search_gap(tables: Mapping[str, pd.DataFrame]) -> pd.Series:
    """How much slower the worst seed and the grid are than each point of a study's fronts, as searched [1].

    NaN where it is not known, as of fronts that no seeds have searched.
    """
    points, attainment = tables["fronts"], tables.get("attainment", pd.DataFrame())
    gaps = pd.Series(np.nan, points.index)
    if "objective" not in attainment:
        return gaps
    worst = dict(iter(attainment[attainment["surface"] == "worst"].groupby(["space", "objective", "currency"])))
    for key, part in points.groupby(["space", "front", "currency"]):
        space, front, currency = map(str, key)
        if (space, front, currency) in worst:
            power = CURRENCIES[currency]
            of_seeds = worst[space, front, currency].rename(columns={"power": power})[["speed", power]]
            of_grid = _of_grid(tables["grid"].query("space == @space"), front, currency)
            attained = pd.concat([of_seeds, of_grid], ignore_index=True)
            speeds = speeds_within(attained, part[f"{power}_searched"].to_numpy(), currency)
            gaps[part.index] = np.maximum(1 - speeds / part["speed_searched"], 0.0)
    return gaps


def _of_grid(grid: pd.DataFrame, front: str, currency: str) -> pd.DataFrame:
    """Speed and power of the gaits of a grid in a fluid, or their means over all fluids."""
    columns, fluids = objectives(currency), list(grid["fluid"].unique())
    here = grid[grid["fluid"] == front]
    if len(here):
        return here.loc[eligible(here), columns].astype(float)
    parameters = [str(column) for column in grid if column not in _LABELS]
    return means_by_gait(grid, parameters, fluids, currency).dropna() if len(grid) else grid[columns]
