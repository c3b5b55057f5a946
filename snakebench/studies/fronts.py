"""Fronts of speed against power: Pareto dominance, the fronts of gaits that swam, and what they are worth.

Points are rows of speed [m/s], to be large, and command power P [W], the paper's, to be small; shape (n, 2). Those with
a NaN are on no front. The positive power P+ of a point stands beside; it need not be the least for its speed.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import moocore
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from snakebench.errors import InvalidValue
from snakebench.metrics import GRAVITY
from snakebench.report.equal_power import fastest_within
from snakebench.report.table import COSTS, POWERS
from snakebench.store import SIMPLE_SUM
from snakebench.studies.search_settings import FrontSettings
from snakebench.value import FloatArray

Indices = NDArray[np.intp]
OBJECTIVES = ["speed", "power"]
SHAPE = ["swim_frequency", "tail_amplitude", "joint_amplitude"]
_BETTER = [True, False]  # speed is maximised, power is not
_SEARCHED = [f"{name}_searched" for name in OBJECTIVES]
_MEANT = [*OBJECTIVES, "positive_power", *_SEARCHED]  # columns that are averaged over fluids
_POINT = ["space", "front", "point", *OBJECTIVES, "positive_power", *COSTS, *_SEARCHED, "steady"]


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


def attainment(fronts: Sequence[FloatArray]) -> pd.DataFrame:
    """What at least one of several fronts, half of them, and all attain: columns surface, speed and power."""
    if not any(map(len, fronts)):
        return pd.DataFrame()
    costs = np.vstack([points * (-1, 1) for points in fronts])
    sets = np.repeat(np.arange(len(fronts)), [len(points) for points in fronts])
    levels = {"best": 100 / len(fronts), "median": 50.0, "worst": 100.0}
    surfaces = moocore.eaf(costs, sets=sets, percentiles=sorted(set(levels.values())))
    of_levels = {name: surfaces[np.isclose(surfaces[:, 2], level), :2] * (-1, 1) for name, level in levels.items()}
    return labelled({name: pd.DataFrame(points, columns=OBJECTIVES) for name, points in of_levels.items()}, ["surface"])


def labelled(parts: Mapping[Any, pd.DataFrame], names: list[str]) -> pd.DataFrame:
    """Several tables as one, whose first columns, of these names, are the keys of the parts."""
    return pd.concat(parts, names=names).reset_index(names).reset_index(drop=True) if parts else pd.DataFrame()


def eligible(swims: pd.DataFrame) -> pd.Series:
    """Which swims may be on a front: those that are valid, advance and take power."""
    return (swims["status"] == "ok") & (swims[OBJECTIVES].astype(float) > 0).all(axis=1)


def means_by_gait(swims: pd.DataFrame, parameters: list[str], fluids: Sequence[str]) -> pd.DataFrame:
    """Mean speed and power of each gait over the fluids, in the order of trying; NaN unless all swims are eligible."""
    valid = swims[OBJECTIVES].astype(float).where(eligible(swims))
    rows = pd.concat([swims[[*parameters, "fluid"]], valid], axis=1).drop_duplicates([*parameters, "fluid"])
    by_gait = rows[rows["fluid"].isin(fluids)].groupby(parameters, sort=False)[OBJECTIVES]
    return by_gait.mean().where(by_gait.count() == len(fluids))


def none_valid(name: str, swims: pd.DataFrame) -> InvalidValue:
    """The error of a study without a valid swim."""
    counts = ", ".join(f"{count} {status}" for status, count in swims["status"].value_counts().items())
    return InvalidValue(
        f"{name}: no gait swam validly and forwards: {counts} of {len(swims)} swims;"
        " other bounds of the gait's parameters, other fluids or a longer duration are needed"
    )


def beside_searched(swims: pd.DataFrame, variant: str) -> pd.DataFrame:
    """The swims at the finer step, beside speed and power of the same in the variant that was searched."""
    fine, searched = (swims[swims["variant"] == name].reset_index(drop=True) for name in ("finer step", variant))
    return fine.join(searched[OBJECTIVES].add_suffix("_searched"))


def front_of(swims: pd.DataFrame, gait: list[str], fluids: Sequence[str], shape: Sequence[str] = ()) -> pd.DataFrame:
    """The front of the gaits that swam validly in all of some fluids, by the means of their swims there.

    Its columns identify the `gait`, and have the means, those of a further `shape`, and whether all swims are steady.
    """
    columns = [*_MEANT, *shape]
    valid = swims[swims["fluid"].isin(fluids) & eligible(swims)].astype(dict.fromkeys(columns, float))
    by_gait = valid.groupby(gait, sort=False, dropna=False)
    means = by_gait[columns].mean().assign(steady=by_gait["steady"].all())
    in_all = means[by_gait.size() == len(fluids)].reset_index()
    return in_all.iloc[front(in_all[OBJECTIVES].to_numpy())]


def fronts_of(
    config: FrontSettings, swims: Mapping[str, pd.DataFrame], gait: list[str], shape: Sequence[str] = SHAPE
) -> pd.DataFrame:
    """The fronts of each fluid, integrated and simple-sum, of several spaces of gaits, from the swims in each.

    A simple-sum point has no gait of its own: FLUID_point says which `point` of each fluid's front it combines.
    """
    weight, parts = config.robot.total_mass * GRAVITY, []
    for space, of_space in swims.items():
        for name, part in _by_name(config, of_space, gait, shape).items():
            needed = weight * part["speed"]  # [W] at a cost of transport of 1
            costs = {cost: part[power] / needed for cost, power in zip(COSTS, POWERS, strict=True)}
            parts.append(part.assign(space=space, front=name, point=range(len(part)), **costs))
    if not parts:
        raise InvalidValue(
            f"{config.name}: no gait swam validly and forwards when verified: another search engine or verify_rate,"
            " other bounds of the gait's parameters, other fluids or a longer duration are needed"
        )
    table = pd.concat(parts, ignore_index=True)
    return table[[*_POINT, *table.columns.difference(_POINT, sort=False)]]


def _by_name(
    config: FrontSettings, swims: pd.DataFrame, gait: list[str], shape: Sequence[str]
) -> dict[str, pd.DataFrame]:
    fronts = {name: front_of(swims, gait, fluids, shape) for name, fluids in config.objectives().items()}
    fronts = {name: points for name, points in fronts.items() if len(points)}
    if len(config.fluids) > 1 and fronts.keys() >= set(config.fluids):
        _, members = simple_sum([fronts[fluid][OBJECTIVES].to_numpy() for fluid in config.fluids])
        chosen = [fronts[fluid].iloc[points] for fluid, points in zip(config.fluids, members.T, strict=True)]
        means = pd.DataFrame(np.mean([part[_MEANT] for part in chosen], axis=0), columns=_MEANT)
        steady = np.all([part["steady"] for part in chosen], axis=0)
        combined = dict(zip([f"{fluid}_point" for fluid in config.fluids], members.T, strict=True))
        fronts[SIMPLE_SUM] = means.assign(steady=steady, **combined)
    return fronts


def front_tables(config: FrontSettings, fronts: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """What is published of `fronts_of` a study: those that consist of gaits, simple-sum, and what each is worth."""
    summed, members = fronts["front"] == SIMPLE_SUM, [f"{fluid}_point" for fluid in config.fluids]
    tables = {
        "fronts": fronts[~summed].drop(columns=members, errors="ignore"),
        "indicators": indicators(fronts, config.reference, config.powers),
    }
    if summed.any():
        switching = fronts.loc[summed, ["space", "point", *OBJECTIVES, "positive_power", *members]]
        tables["switching"] = switching.astype(dict.fromkeys(members, int))
    return tables


def indicators(fronts: pd.DataFrame, reference: tuple[float, float], powers: Sequence[float]) -> pd.DataFrame:
    """What each front is worth, one row a front: hypervolume from a reference [m/s W], named points, speed at powers.

    `beyond` counts points that need more power or are slower than the reference and add nothing; the knee is of what
    lies within it.
    """
    return pd.DataFrame(
        {"space": space, "front": name} | _worth(part, reference, powers)
        for (space, name), part in fronts.groupby(["space", "front"], sort=False)
    )


def _worth(part: pd.DataFrame, reference: tuple[float, float], powers: Sequence[float]) -> dict[str, float]:
    points = part[OBJECTIVES].to_numpy()
    inside = (points[:, 0] > reference[0]) & (points[:, 1] < reference[1])
    worth: dict[str, float] = {
        "points": len(points),
        "hypervolume": hypervolume(points, reference),
        "hypervolume_searched": hypervolume(part[_SEARCHED].to_numpy(), reference),
        "beyond": int((~inside).sum()),
    }
    named = {"fastest": len(points) - 1, "thriftiest": int(np.argmin(points[:, 1] / points[:, 0]))}
    if inside.any():
        named["knee"] = int(np.flatnonzero(inside)[knee(points[inside])])
    for key, k in named.items():
        worth |= {f"{key}_{name}": part[name].iloc[k] for name in ("speed", *POWERS)}
    best = {f"at_{power:g}_W": fastest_within(part, power) for power in powers}
    worth |= {f"speed_{at}": max(points["speed"], default=0.0) for at, points in best.items()}  # who stands still
    return worth | {
        f"positive_power_{at}": max(points["positive_power"], default=np.nan) for at, points in best.items()
    }
