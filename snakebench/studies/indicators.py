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
from snakebench.studies import fronts
from snakebench.studies.pareto.settings import ParetoConfig
from snakebench.studies.search_settings import Space
from snakebench.value import FloatArray

OBJECTIVES = ["speed", "power"]
SHAPE = ["swim_frequency", "tail_amplitude", "joint_amplitude"]
_AS_SEARCHED = [f"{name}_searched" for name in OBJECTIVES]
_CHECKPOINTS = 40  # of the growth of a search


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
    """The error of a study all of whose swims came to nothing."""
    counts = ", ".join(f"{count} {status}" for status, count in swims["status"].value_counts().items())
    return InvalidValue(
        f"{name}: no gait swam validly and forwards: {counts} of {len(swims)} swims;"
        " other bounds of the gait's parameters, other fluids or a longer duration are needed"
    )


def within(swims: pd.DataFrame, space: Space) -> pd.DataFrame:
    """The swims of gaits whose parameters lie within the bounds of a space."""
    inside = [swims[name].between(*bounds) for name, bounds in space.items()]
    return swims[np.logical_and.reduce(inside)]


def published_fronts(config: ParetoConfig, verified: pd.DataFrame) -> pd.DataFrame:
    """The fronts of each space by all that was verified within it, as `assembled`."""
    parts = []
    for space, bounds in config.spaces.items():
        swims = within(verified, bounds)
        found = {
            objective: _front(swims, config.parameters, fluids) for objective, fluids in config.objectives().items()
        }
        parts.append(assembled(space, found, config.fluids, config.robot.total_mass))
    return pd.concat(parts, ignore_index=True)


def assembled(space: str, found: Mapping[str, pd.DataFrame], fluids: Sequence[str], mass: float) -> pd.DataFrame:
    """Fronts by name as one table with the simple-sum of the fluids' own; one row a point, from least power to most.

    `point` counts the points of a front. A simple-sum point has no gait of its own: FLUID_point says which point of
    each fluid's front it combines. Costs of transport are those of the mean speed and powers of a robot of a mass [kg].

    Raises:
        InvalidValue: when there is no point on any front.
    """
    parts = {name: part for name, part in found.items() if len(part)}
    if not parts:
        raise InvalidValue(
            f"{space}: no gait swam validly and forwards when verified: another search engine or verify_rate is needed,"
            " or other bounds of the gait's parameters, other fluids or a longer duration"
        )
    if len(fluids) > 1 and parts.keys() >= set(fluids):
        parts[SIMPLE_SUM] = _simple_sum({fluid: parts[fluid] for fluid in fluids})
    taken = ["positive_power", "cost_of_transport", "positive_cost_of_transport"]
    first = ["space", "front", "point", *OBJECTIVES, *taken, *_AS_SEARCHED, "steady"]
    tables = []
    for name, part in parts.items():
        cost, positive_cost = (part[power] / (mass * GRAVITY * part["speed"]) for power in ("power", "positive_power"))
        table = part.assign(space=space, front=name, point=range(len(part)), cost_of_transport=cost)
        table = table.assign(positive_cost_of_transport=positive_cost)
        tables.append(table[first + [column for column in table if column not in first]])
    return pd.concat(tables, ignore_index=True)


def front_tables(
    assembled_fronts: pd.DataFrame, fluids: Sequence[str], reference: tuple[float, float], powers: Sequence[float]
) -> dict[str, pd.DataFrame]:
    """What is published of assembled fronts, as three tables.

    - `fronts`: those that consist of gaits;
    - `switching`: the simple-sum ones, which have thousands of points: the points that each combines tell the rest;
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
        named: dict[str, int] = {"fastest": len(points) - 1, "thriftiest": int(np.argmin(points[:, 1] / points[:, 0]))}
        if inside.any():
            named["knee"] = int(np.flatnonzero(inside)[fronts.knee(points[inside])])
        worth = {
            "points": len(points),
            "hypervolume": fronts.hypervolume(points, reference),
            "hypervolume_searched": fronts.hypervolume(part[_AS_SEARCHED].to_numpy(), reference),
            "beyond": int((~inside).sum()),
        }
        told = part[[*OBJECTIVES, "positive_power"]]
        at = {f"{key}_{column}": told[column].iloc[k] for key, k in named.items() for column in told}
        best = {f"{power:g}_W": fastest_within(part, power) for power in powers}
        equal = {f"speed_at_{key}": max(one["speed"], default=0.0) for key, one in best.items()}  # who stands still
        paid = {f"positive_power_at_{key}": max(one["positive_power"], default=np.nan) for key, one in best.items()}
        rows.append({"space": space, "front": name, **worth, **at, **equal, **paid})
    return pd.DataFrame(rows)


def growth(config: ParetoConfig, swims: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Hypervolume of each search, as searched, after so many simulations; a grid's gaits are tried in random order."""
    for space in config.spaces:
        for objective, fluids in config.objectives().items():
            for method, seed, points in _by_search(config, swims[swims["space"] == space], objective, fluids):
                for count in np.unique(np.linspace(1, len(points), _CHECKPOINTS + 1).astype(int)):
                    worth = fronts.hypervolume(points[:count], config.reference)
                    about = {"space": space, "objective": objective, "method": method, "seed": seed}
                    yield about | {"simulations": count * len(fluids), "hypervolume": worth}


def attained(config: ParetoConfig, swims: pd.DataFrame) -> Iterator[dict[str, object]]:
    """The attainment surfaces of the seeds of NSGA-II, as searched."""
    for space in config.spaces:
        for objective, fluids in config.objectives().items():
            found = [
                points[fronts.front(points)]
                for method, _, points in _by_search(config, swims[swims["space"] == space], objective, fluids)
                if method == "nsga2"
            ]
            for name, surface in fronts.attainment(found).items() if any(map(len, found)) else ():
                for speed, power in surface:
                    yield {"space": space, "objective": objective, "surface": name, "speed": speed, "power": power}


def _by_search(
    config: ParetoConfig, swims: pd.DataFrame, objective: str, fluids: Sequence[str]
) -> Iterator[tuple[str, int, FloatArray]]:
    """Method, seed and points in the order of trying of each search for an objective."""
    for method, tried in swims.groupby("method"):
        if method == "grid":
            points = means_by_gait(tried, config.parameters, fluids).to_numpy()
            for seed in config.seeds:
                yield "grid", seed, np.random.default_rng(seed).permutation(points)
        else:
            for seed in config.seeds:
                of_seed = tried[(tried["objective"] == objective) & (tried["seed"] == seed)]
                yield "nsga2", seed, means_by_gait(of_seed, config.parameters, fluids).to_numpy()


def _front(swims: pd.DataFrame, parameters: list[str], fluids: Sequence[str]) -> pd.DataFrame:
    """The front of the gaits that swam in all of some fluids, by their means over them."""
    means = means_by_gait(swims, parameters, fluids)
    means = means.iloc[fronts.front(means.to_numpy())]
    by_gait = swims[swims["fluid"].isin(fluids)].groupby(parameters, sort=False)
    beside = by_gait[["positive_power", *_AS_SEARCHED]].mean().assign(steady=by_gait["steady"].all())
    shape = by_gait[SHAPE].first() if len(fluids) == 1 else beside[[]]
    return means.join([beside, shape]).reset_index()


def _simple_sum(by_fluid: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The front of all combinations of one point from each fluid's front, averaged."""
    sums, members = fronts.simple_sum([part[OBJECTIVES].to_numpy() for part in by_fluid.values()])
    chosen = [part.iloc[members[:, i]] for i, part in enumerate(by_fluid.values())]
    table = pd.DataFrame(sums, columns=OBJECTIVES)
    for name in ("positive_power", *_AS_SEARCHED):
        table[name] = np.mean([part[name].to_numpy() for part in chosen], axis=0)
    table["steady"] = np.all([part["steady"].to_numpy() for part in chosen], axis=0)
    return table.assign(**{f"{fluid}_point": members[:, i] for i, fluid in enumerate(by_fluid)})
