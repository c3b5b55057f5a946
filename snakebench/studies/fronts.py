"""Fronts of speed against power: Pareto dominance, and the fronts of gaits that swam, in both currencies of power.

Points are rows of speed [m/s], to be large, and power [W], to be small; shape (n, 2). Those with a NaN are on no front.
The power is P in the currency "net", the paper's, and P+ in the currency "positive"; the other one stands beside and
need not be the least for its speed.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import moocore
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from snakebench.errors import InvalidValue
from snakebench.metrics import GRAVITY
from snakebench.names import CURRENCIES, FINE, SIMPLE_SUM
from snakebench.report.table import COSTS, POWERS
from snakebench.studies.indicators import MEASURED, indicators
from snakebench.studies.search_settings import FrontSettings
from snakebench.value import FloatArray

Indices = NDArray[np.intp]
SHAPE = ["swim_frequency", "tail_amplitude", "joint_amplitude"]
_APART = 1.001  # ratio of powers from point to point of a published simple-sum front, at least
_BETTER = [True, False]  # speed is maximised, power is not
_SEARCHED = [f"{name}_searched" for name in MEASURED]
_MEANT = [*MEASURED, *_SEARCHED]  # columns that are averaged over fluids
_POINT = ["space", "front", "currency", "point", *MEASURED, *COSTS, *_SEARCHED, "steady"]


def objectives(currency: str = "net") -> list[str]:
    """The columns of speed and of the power that a front counts."""
    return ["speed", CURRENCIES[currency]]


def front(points: FloatArray) -> Indices:
    """Which points no other dominates, from least power to most, shape (n_front,); of equal points the first."""
    known = np.flatnonzero(~np.isnan(points).any(axis=1))
    if len(known) == 0:
        return known
    best = known[moocore.is_nondominated(points[known], maximise=_BETTER)]
    return best[np.argsort(points[best, 1], kind="stable")]


def simple_sum(fronts: Sequence[FloatArray]) -> tuple[FloatArray, Indices]:
    """The best that switching could do: a point of each front, averaged, and the best of these combinations.

    Only published points are combined, none between them and no sharing of time: there are many combinations. Sums are
    filtered front by front: what is dominated in a partial sum is dominated in every whole one.

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


def attainment(fronts: Sequence[FloatArray]) -> pd.DataFrame:
    """What at least one of several fronts, half of them, and all attain: columns surface, speed and power.

    Points are counted as they are, as staircases.
    """
    if not any(map(len, fronts)):
        return pd.DataFrame()
    costs = np.vstack([points * (-1, 1) for points in fronts])
    sets = np.repeat(np.arange(len(fronts)), [len(points) for points in fronts])
    levels = {"best": 100 / len(fronts), "median": 50.0, "worst": 100.0}
    surfaces = moocore.eaf(costs, sets=sets, percentiles=sorted(set(levels.values())))
    parts = {name: surfaces[np.isclose(surfaces[:, 2], level), :2] * (-1, 1) for name, level in levels.items()}
    return labelled({name: pd.DataFrame(part, columns=["speed", "power"]) for name, part in parts.items()}, ["surface"])


def labelled(parts: Mapping[Any, pd.DataFrame], names: list[str]) -> pd.DataFrame:
    """Several tables as one, whose first columns, of these names, are the keys of the parts."""
    return pd.concat(parts, names=names).reset_index(names).reset_index(drop=True) if parts else pd.DataFrame()


def eligible(swims: pd.DataFrame) -> pd.Series:
    """Which swims may be on a front: those that are valid, advance and take net power, as settled ones do."""
    return (swims["status"] == "ok") & (swims[objectives()].astype(float) > 0).all(axis=1)


def means_by_gait(swims: pd.DataFrame, gait: list[str], fluids: Sequence[str], currency: str = "net") -> pd.DataFrame:
    """Mean speed and power of each gait over the fluids, in the order of trying; NaN unless all swims are eligible."""
    columns = objectives(currency)
    valid = swims[columns].astype(float).where(eligible(swims))
    rows = pd.concat([swims[[*gait, "fluid"]], valid], axis=1).drop_duplicates([*gait, "fluid"])
    by_gait = rows[rows["fluid"].isin(fluids)].groupby(gait, sort=False)[columns]
    return by_gait.mean().where(by_gait.count() == len(fluids))


def none_valid(name: str, swims: pd.DataFrame) -> InvalidValue:
    """The error of a study without a valid swim."""
    counts = ", ".join(f"{count} {status}" for status, count in swims["status"].value_counts().items())
    return InvalidValue(
        f"{name}: no gait swam validly and forwards: {counts} of {len(swims)} swims;"
        " other bounds of the gait's parameters, other fluids or a longer duration are needed"
    )


def beside_searched(swims: pd.DataFrame, variant: str) -> pd.DataFrame:
    """The swims at the finer step, beside speed and powers of the same in the variant that was searched."""
    fine, searched = (swims[swims["variant"] == name].reset_index(drop=True) for name in (FINE, variant))
    return fine.join(searched[MEASURED].add_suffix("_searched"))


def front_of(
    swims: pd.DataFrame, gait: list[str], fluids: Sequence[str], shape: Sequence[str] = (), currency: str = "net"
) -> pd.DataFrame:
    """The front of the gaits that swam validly in all of some fluids, by the means of their swims there.

    Its columns identify the `gait`, and have the means, those of a further `shape`, and whether all swims are steady.
    """
    columns = [*_MEANT, *shape]
    valid = swims[swims["fluid"].isin(fluids) & eligible(swims)].astype(dict.fromkeys(columns, float))
    by_gait = valid.groupby(gait, sort=False, dropna=False)
    means = by_gait[columns].mean().assign(steady=by_gait["steady"].all())
    in_all = means[by_gait.size() == len(fluids)].reset_index()
    return in_all.iloc[front(in_all[objectives(currency)].to_numpy())]


def fronts_of(
    config: FrontSettings, swims: Mapping[str, pd.DataFrame], gait: list[str], shape: Sequence[str] = SHAPE
) -> pd.DataFrame:
    """The fronts of each fluid, integrated and simple-sum, of several spaces of gaits, from the swims in each.

    Each is in every currency. A simple-sum point has no gait of its own: FLUID_point says which `point` of each fluid's
    front it combines. Of thousands of combinations those are left out whose power is within 0.1 % of another's.
    """
    parts = [
        part.assign(space=space, currency=currency)
        for space, of_space in swims.items()
        for currency in config.currencies
        for part in _by_name(config, of_space, gait, shape, currency)
    ]
    if not parts:
        raise InvalidValue(
            f"{config.name}: no gait swam validly and forwards when verified: another search engine or verify_rate,"
            " other bounds of the gait's parameters, other fluids or a longer duration are needed"
        )
    table = pd.concat(parts, ignore_index=True)
    needed = config.robot.total_mass * GRAVITY * table["speed"]  # [W] at a cost of transport of 1
    table = table.assign(**{cost: table[power] / needed for cost, power in zip(COSTS, POWERS, strict=True)})
    return table[[*_POINT, *table.columns.difference(_POINT, sort=False)]]


def _by_name(
    config: FrontSettings, swims: pd.DataFrame, gait: list[str], shape: Sequence[str], currency: str
) -> Iterator[pd.DataFrame]:
    """Each front of a space, with its name and its numbered points."""
    fronts = {name: front_of(swims, gait, fluids, shape, currency) for name, fluids in config.objectives().items()}
    fronts = {name: points for name, points in fronts.items() if len(points)}
    if len(config.fluids) > 1 and fronts.keys() >= set(config.fluids):
        sums, members = simple_sum([fronts[fluid][objectives(currency)].to_numpy() for fluid in config.fluids])
        members = members[_apart(sums[:, 1])]
        chosen = [fronts[fluid].iloc[points] for fluid, points in zip(config.fluids, members.T, strict=True)]
        means = pd.DataFrame(np.mean([part[_MEANT] for part in chosen], axis=0), columns=_MEANT)
        steady = np.all([part["steady"] for part in chosen], axis=0)
        combined = dict(zip([f"{fluid}_point" for fluid in config.fluids], members.T, strict=True))
        fronts[SIMPLE_SUM] = means.assign(steady=steady, **combined)
    for name, points in fronts.items():
        yield points.assign(front=name, point=range(len(points)))


def _apart(powers: FloatArray) -> list[int]:
    """Points of a front, from least power to most, that can be told apart; both ends are among them."""
    kept = [0]
    for k, power in enumerate(powers):
        if power >= _APART * powers[kept[-1]]:
            kept.append(k)
    return sorted({*kept, len(powers) - 1})


def front_tables(config: FrontSettings, fronts: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """What is published of `fronts_of` a study: those that consist of gaits, simple-sum, and what each is worth."""
    summed, members = fronts["front"] == SIMPLE_SUM, [f"{fluid}_point" for fluid in config.fluids]
    tables = {
        "fronts": fronts[~summed].drop(columns=members, errors="ignore"),
        "indicators": indicators(fronts, config.reference, config.powers),
    }
    if summed.any():
        switching = fronts.loc[summed, ["space", "currency", "point", *MEASURED, *members]]
        tables["switching"] = switching.astype(dict.fromkeys(members, int))
    return tables
