"""Fronts of a policy compared with fronts of fixed gaits: at equal power, at equal speed, by hypervolume.

All by command power P, which searches and policies seek to keep low, as in the paper; P+ and CoT+ of the compared
points stand beside.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import table
from snakebench.report.equal_power import speeds_within
from snakebench.report.table import Cell, Column, Table, mean, share, summary
from snakebench.studies.published_fronts import OVERALL, powers_compared

_FRONT = ["method", "front", "seed"]
_SPEEDS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # [m/s] at which costs of transport are compared


def compared(
    points: pd.DataFrame, worth: pd.DataFrame, fixed: list[str], chosen: str, teacher: str | None, weight: float
) -> dict[str, Any]:
    """How the fronts of a policy compare with those of fixed gaits.

    Args:
        points: of every front: columns method, front, seed, speed, power, positive_power.
        worth: the columns of `indicators` of every front, with method, front and seed, in the order to be shown.
        fixed: methods of fixed gaits.
        chosen: the policy.
        teacher: the policy that it was distilled from, if any.
        weight: of the robot [N], for the cost of transport.

    Returns:
        Tables by name, without rows where there is nothing to show; under "findings" the frames `gains` over
        fixed gaits [1], by front, front against and method, and `kept`, the share of the teacher's hypervolume [1].
    """
    powers, names = powers_compared(worth), list(worth["front"].unique())
    costs = {f"{speed:g} m/s": f"cost_at_{speed:g}" for speed in _SPEEDS}
    moving = worth.replace({column: {0.0: np.nan} for column in powers.values()})  # where a point needs so little power
    fronts = moving.merge(_cheapest(points, weight), how="left", on=_FRONT)
    known = fronts if points["positive_power"].notna().any() else fronts[:0]
    pairs = _pairs(fronts, fixed, chosen)

    def shown(rows: pd.DataFrame, columns: dict[str, str]) -> Table:
        by = {"front": names, "method": list(worth["method"].unique())}
        return summary(rows, by, [(head, mean(column)) for head, column in columns.items()])

    def against_fixed(columns: list[Column]) -> Table:
        by = {"front": names, "against": names, "method": fixed}
        return summary(pairs, by, columns, head="front, against", label=_label)

    losses = against_fixed(_losses(powers))
    return {
        "findings": {"gains": pairs, "kept": _kept(fronts, chosen, teacher)},
        "n_seeds": fronts.loc[fronts["method"] == chosen, "seed"].nunique(),
        "gains": against_fixed(_gains(points, chosen, powers)),
        "losses": losses._replace(rows=[row for row in losses.rows if any(row[1:])]),
        "equal_power": shown(fronts, {f"{power:g} W": column for power, column in powers.items()}),
        "equal_speed": shown(fronts, costs),
        "worth": _hypervolumes(fronts, names),
        "positive_power": shown(known, {f"{power:g} W": f"positive_power_at_{power:g}_W" for power in powers}),
        "positive_cost": shown(known, {head: f"positive_{name}" for head, name in costs.items()}),
    }


def _cheapest(points: pd.DataFrame, weight: float) -> pd.DataFrame:
    """By front: the lowest cost of transport of a point at least as fast as each speed, and CoT+ of that point."""
    cost, positive_cost = (points[name] / (weight * points["speed"]) for name in table.POWERS)
    ranked = points.assign(cost_at=cost, positive_cost_at=positive_cost).sort_values("cost_at", kind="stable")
    best = {speed: ranked[ranked["speed"] >= speed].drop_duplicates(_FRONT).set_index(_FRONT) for speed in _SPEEDS}
    costs = [part[["cost_at", "positive_cost_at"]].add_suffix(f"_{speed:g}") for speed, part in best.items()]
    return pd.concat(costs, axis=1)


def _pairs(fronts: pd.DataFrame, fixed: list[str], chosen: str) -> pd.DataFrame:
    """Every front of the policy beside those of fixed gaits (columns with _fixed), and what it gains (with _gain) [1].

    A front is compared with that of the same name, `against`; the integrated one with ideal switching as well.
    """
    names = fronts["front"].unique()
    compared_with = [(name, name) for name in names] + [OVERALL] * (set(names) >= set(OVERALL))
    own = fronts[fronts["method"] == chosen].drop(columns="method")
    own = own.merge(pd.DataFrame(compared_with, columns=["front", "against"]), on="front")
    others = fronts[fronts["method"].isin(fixed)].drop(columns="seed").rename(columns={"front": "against"})
    pairs = own.merge(others, on="against", suffixes=("", "_fixed"))
    gained = ["hypervolume", *powers_compared(fronts).values()]
    return pairs.assign(**{f"{name}_gain": pairs[name] / pairs[f"{name}_fixed"] - 1 for name in gained})


def _kept(fronts: pd.DataFrame, chosen: str, teacher: str | None) -> pd.DataFrame:
    """Columns front, seed and the `share` of its teacher's hypervolume that the policy has; no rows without teacher."""
    volumes = fronts.pivot(index=["front", "seed"], columns="method", values="hypervolume")
    shares = volumes[chosen] / volumes.get(teacher, np.nan)
    return shares.dropna().rename("share").reset_index()


def _gains(points: pd.DataFrame, chosen: str, powers: dict[float, str]) -> list[Column]:
    at_power: list[Column] = [(f"{power:g} W", share(f"{column}_gain", 0)) for power, column in powers.items()]
    leads = _leads(points, chosen, max(powers, default=np.inf))
    return [*at_power, ("leads from", leads), ("hypervolume", share("hypervolume_gain", 0))]


def _label(front: str, against: str, method: str) -> str:
    return f"{front}, {method}" + ("" if front == against else f": {against}")


def _leads(points: pd.DataFrame, chosen: str, highest: float) -> Cell:
    """The power from which on the policy's mean speed is above that of fixed gaits, up to the highest power [W]."""
    fronts = dict(iter(points.groupby(["method", "front"])))

    def cell(part: pd.DataFrame) -> str:
        front, against, method = part[["front", "against", "method"]].iloc[0]
        own, fixed = fronts[chosen, front], fronts[method, against]
        powers = np.unique([*own["power"], *fixed["power"]])  # in between, no speed changes
        powers = powers[powers <= highest]
        of_seeds = [np.nan_to_num(speeds_within(seed, powers)) for _, seed in own.groupby("seed")]
        behind = np.flatnonzero(np.mean(of_seeds, axis=0) <= np.nan_to_num(speeds_within(fixed, powers)))
        first = behind[-1] + 1 if len(behind) else 0
        return f"{powers[first]:.2g} W" if first < len(powers) else f"not at {highest:g} W"

    return cell


def _losses(powers: dict[float, str]) -> list[Column]:
    """Where fixed gaits are better than the policy, by their means."""

    def faster(part: pd.DataFrame) -> str:
        means = part.fillna(dict.fromkeys(powers.values(), 0.0)).mean(numeric_only=True)
        return ", ".join(f"{power:g}" for power, name in powers.items() if means[f"{name}_fixed"] > means[name])

    def cheaper(part: pd.DataFrame) -> str:
        means = part.mean(numeric_only=True)
        return ", ".join(f"{v:g}" for v in _SPEEDS if means[f"cost_at_{v:g}_fixed"] < means[f"cost_at_{v:g}"])

    def larger(part: pd.DataFrame) -> str:
        fixed, own = part["hypervolume_fixed"].mean(), part["hypervolume"].mean()
        return f"{fixed:.2f} against {own:.2f}" if fixed > own else ""

    return [("faster within [W]", faster), ("lower CoT from [m/s]", cheaper), ("larger hypervolume [m/s W]", larger)]


def _hypervolumes(fronts: pd.DataFrame, names: list[str]) -> Table:
    difference = (fronts["hypervolume"] - fronts["hypervolume_searched"]).abs()
    columns: list[Column] = [("n", table.size), ("hypervolume", mean("hypervolume", 2))]
    columns += [("Δ engine", table.largest("difference"))]
    columns += [("each seed", lambda part: table.every("hypervolume")(part) if len(part) > 1 else "")]
    by = {"front": names, "method": list(fronts["method"].unique())}
    return summary(fronts.assign(difference=difference), by, columns)
