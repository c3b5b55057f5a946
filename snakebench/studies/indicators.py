"""From swims to fronts, and from fronts to figures that compare them (hypervolume, attainment, equal power).

Searches seek speed against command power P, the paper's currency, so fronts, hypervolume, knee, growth and attainment
are of P. The positive power P+ of their points stands beside it; it need not be the least for their speed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from snakebench.errors import InvalidValue
from snakebench.metrics import GRAVITY
from snakebench.report.equal_power import fastest_within
from snakebench.store import SIMPLE_SUM
from snakebench.studies.dominance import attainment, front, hypervolume, knee, simple_sum
from snakebench.studies.protocol import Row
from snakebench.value import FloatArray

OBJECTIVES = ["speed", "power"]
SHAPE = ["swim_frequency", "tail_amplitude", "joint_amplitude"]
_SEARCHED = [f"{name}_searched" for name in OBJECTIVES]


def means_by_gait(swims: pd.DataFrame, parameters: list[str], fluids: Sequence[str]) -> pd.DataFrame:
    """Mean speed and power over the fluids of each gait, by its parameters, in the order of trying.

    NaN where a gait may enter no front: when in one of the fluids it diverged, was invalid, did not advance or took no
    power.
    """
    valid = swims[OBJECTIVES].astype(float).where(eligible(swims))
    rows = pd.concat([swims[[*parameters, "fluid"]], valid], axis=1).drop_duplicates([*parameters, "fluid"])
    by_gait = rows[rows["fluid"].isin(fluids)].groupby(parameters, sort=False)[OBJECTIVES]
    return by_gait.mean().where(by_gait.count() == len(fluids))


def eligible(swims: pd.DataFrame) -> pd.Series:
    """Which swims may be on a front: those that are valid, advance and take power."""
    return (swims["status"] == "ok") & (swims[OBJECTIVES].astype(float) > 0).all(axis=1)


def none_valid(name: str, swims: pd.DataFrame) -> InvalidValue:
    """The error of a study without a valid swim."""
    counts = ", ".join(f"{count} {status}" for status, count in swims["status"].value_counts().items())
    return InvalidValue(
        f"{name}: no gait swam validly and forwards: {counts} of {len(swims)} swims;"
        " other bounds of the gait's parameters, other fluids or a longer duration are needed"
    )


def front_of(
    swims: pd.DataFrame, gait: Sequence[str], fluids: Sequence[str], shape: Sequence[str] = ()
) -> pd.DataFrame:
    """The front of the gaits that swam validly in all of some fluids, by their means over them.

    Args:
        swims: one row a gait and fluid, with what was searched in the columns `speed_searched` and `power_searched`.
        gait: columns that identify a gait.
        fluids: over which speed, powers and shape are means.
        shape: further columns of means.
    """
    columns = [*OBJECTIVES, "positive_power", *_SEARCHED, *shape]
    valid = swims[swims["fluid"].isin(fluids) & eligible(swims)].astype(dict.fromkeys(columns, float))
    by_gait = valid.groupby(list(gait), sort=False, dropna=False)
    means = by_gait[columns].mean().assign(steady=by_gait["steady"].all())
    in_all = means[by_gait.size() == len(fluids)].reset_index()
    return in_all.iloc[front(in_all[OBJECTIVES].to_numpy())]


def beside_searched(swims: pd.DataFrame, variant: str) -> pd.DataFrame:
    """The swims at the finer step, beside speed and power of the same in the variant that was searched."""
    fine, searched = (swims[swims["variant"] == name].reset_index(drop=True) for name in ("finer step", variant))
    return fine.assign(**{f"{name}_searched": searched[name] for name in OBJECTIVES})


def assembled(space: str, fronts: Mapping[str, pd.DataFrame], fluids: Sequence[str], mass: float) -> pd.DataFrame:
    """Fronts by name as one table with the simple-sum of the fluids' own; one row a point, from least power to most.

    `point` counts the points of a front. A simple-sum point has no gait of its own: FLUID_point says which point of
    each fluid's front it combines. Costs of transport are those of the mean speed and powers of a robot of a mass [kg].

    Raises:
        InvalidValue: when there is no point on any front.
    """
    parts = {name: part for name, part in fronts.items() if len(part)}
    if not parts:
        raise InvalidValue(
            f"{space}: no gait swam validly and forwards when verified: another search engine or verify_rate is needed,"
            " or other bounds of the gait's parameters, other fluids or a longer duration"
        )
    if len(fluids) > 1 and parts.keys() >= set(fluids):
        parts[SIMPLE_SUM] = _simple_sum({fluid: parts[fluid] for fluid in fluids})
    first = ["space", "front", "point", *OBJECTIVES, "positive_power", "cost_of_transport"]
    first += ["positive_cost_of_transport", *_SEARCHED, "steady"]
    tables = []
    for name, part in parts.items():
        needed = mass * GRAVITY * part["speed"]  # [W] at a cost of transport of 1
        costs = {f"{kind}cost_of_transport": part[f"{kind}power"] / needed for kind in ("", "positive_")}
        table = part.assign(space=space, front=name, point=range(len(part)), **costs)
        tables.append(table[first + [column for column in table if column not in first]])
    return pd.concat(tables, ignore_index=True)


def front_tables(
    assembled_fronts: pd.DataFrame, fluids: Sequence[str], reference: tuple[float, float], powers: Sequence[float]
) -> dict[str, pd.DataFrame]:
    """What is published of assembled fronts, as three tables.

    - `fronts`: those that consist of gaits;
    - `switching`: the simple-sum ones, thousands of points; `fronts` has the other columns of those that each combines;
    - `indicators`: what each front is worth.
    """
    summed = assembled_fronts["front"] == SIMPLE_SUM
    members = [f"{fluid}_point" for fluid in fluids]
    tables = {
        "fronts": assembled_fronts[~summed].drop(columns=members, errors="ignore"),
        "indicators": indicators(assembled_fronts, reference, powers),
    }
    if summed.any():
        switching = assembled_fronts.loc[summed, ["space", "point", *OBJECTIVES, "positive_power", *members]]
        tables["switching"] = switching.astype(dict.fromkeys(members, int))
    return tables


def indicators(published: pd.DataFrame, reference: tuple[float, float], powers: Sequence[float]) -> pd.DataFrame:
    """What each front is worth; one row a front.

    Columns: number of points, `hypervolume` [m/s W] as verified and as searched, `beyond` how many points need more
    power or are slower than the reference and add nothing to it, speed [m/s] and both powers [W] of the fastest point,
    of the knee (of what lies within the reference) and of the lowest cost of transport, and the speed at each of
    `powers` P [W] with the P+ of the points that have it.
    """
    rows = []
    for (space, name), part in published.groupby(["space", "front"], sort=False):
        points = part[OBJECTIVES].to_numpy()
        inside = (points[:, 0] > reference[0]) & (points[:, 1] < reference[1])
        chosen = {"fastest": len(points) - 1, "thriftiest": int(np.argmin(points[:, 1] / points[:, 0]))}
        if inside.any():
            chosen["knee"] = int(np.flatnonzero(inside)[knee(points[inside])])
        worth = {
            "points": len(points),
            "hypervolume": hypervolume(points, reference),
            "hypervolume_searched": hypervolume(part[_SEARCHED].to_numpy(), reference),
            "beyond": int((~inside).sum()),
        }
        columns = part[[*OBJECTIVES, "positive_power"]]
        at = {f"{key}_{column}": columns[column].iloc[k] for key, k in chosen.items() for column in columns}
        best = {f"{power:g}_W": fastest_within(part, power) for power in powers}
        equal = {f"speed_at_{key}": max(one["speed"], default=0.0) for key, one in best.items()}  # who stands still
        paid = {f"positive_power_at_{key}": max(one["positive_power"], default=np.nan) for key, one in best.items()}
        rows.append({"space": space, "front": name, **worth, **at, **equal, **paid})
    return pd.DataFrame(rows)


def attainment_rows(fronts: Sequence[FloatArray], **labels: object) -> Iterator[Row]:
    """The attainment surfaces of the fronts of several seeds, one row a point; none where all fronts are empty."""
    for surface, points in attainment(fronts).items() if any(map(len, fronts)) else ():
        for speed, power in points:
            yield {**labels, "surface": surface, "speed": speed, "power": power}


def _simple_sum(by_fluid: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The front of all combinations of one point from each fluid's front, averaged."""
    sums, members = simple_sum([part[OBJECTIVES].to_numpy() for part in by_fluid.values()])
    chosen = [part.iloc[members[:, i]] for i, part in enumerate(by_fluid.values())]
    table = pd.DataFrame(sums, columns=OBJECTIVES)
    for name in ("positive_power", *_SEARCHED):
        table[name] = np.mean([part[name].to_numpy() for part in chosen], axis=0)
    table["steady"] = np.all([part["steady"].to_numpy() for part in chosen], axis=0)
    return table.assign(**{f"{fluid}_point": members[:, i] for i, fluid in enumerate(by_fluid)})
