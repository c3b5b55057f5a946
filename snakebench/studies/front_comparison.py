"""Fronts of policies against those of fixed gaits: at equal power, at equal speed and by hypervolume."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from snakebench.names import CURRENCIES
from snakebench.report import table
from snakebench.report.equal_power import powers_needed, speeds_within, top_power
from snakebench.report.table import Cell, Column, Table, gain, mean, summary
from snakebench.studies.published_fronts import OVERALL, powers_compared

_FRONT = ["method", "front", "seed"]
_SPEEDS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # [m/s] at which costs of transport are compared


def compared(
    points: pd.DataFrame,
    worth: pd.DataFrame,
    fixed: list[str],
    chosen: Mapping[str, str],
    teachers: Mapping[str, str | None],
    weight: float,
) -> dict[str, Any]:
    """How the fronts of policies compare with their teachers' and those of fixed gaits (`standings`); weight in [N].

    `chosen` is the policy of each currency of power; `currencies` has the tables of those that it has fronts in.
    """
    tables: dict[str, dict[str, Any]] = {}
    pairs, shares = [], []
    for currency, policy in chosen.items():
        if currency not in set(worth.loc[worth["method"] == policy, "currency"]):
            continue
        own = points[points["currency"] == currency]
        fronts = worth[worth["currency"] == currency].merge(_costs(own, currency, weight), how="left", on=_FRONT)
        of_currency = _pairs(fronts, own, fixed, policy, currency)
        tables[currency] = _tables(fronts) | _against_fixed(of_currency, _leads(own, policy, currency))
        tables[currency]["chosen"] = policy
        volumes = fronts.pivot(index=["front", "seed"], columns="method", values="hypervolume")
        kept = (volumes[policy] / volumes.get(teachers[policy], np.nan)).dropna().rename("share").reset_index()
        pairs.append(of_currency)
        shares.append(kept.assign(currency=currency))
    gains, kept_shares = (pd.concat(parts or [pd.DataFrame()], ignore_index=True) for parts in (pairs, shares))
    return {
        "findings": {"gains": gains, "kept": kept_shares},
        "n_seeds": worth.loc[worth["method"].isin(chosen.values()), "seed"].nunique(),
        "currencies": tables,
    }


def _tables(fronts: pd.DataFrame) -> dict[str, Table]:
    """Speeds of fronts at equal power, costs at equal speed, and hypervolumes."""
    powers = powers_compared(fronts)
    moving = fronts.replace({column: {0.0: np.nan} for column in powers.values()})  # where there is a point

    def shown(columns: dict[str, str]) -> Table:
        return summary(moving, ["front", "method"], [(head, mean(column)) for head, column in columns.items()])

    difference = (fronts["hypervolume"] - fronts["hypervolume_searched"]).abs()
    columns: list[Column] = [("n", table.size), ("hypervolume", mean("hypervolume", 2))]
    columns += [("Δ engine", table.largest("difference"))]
    columns += [("each seed", lambda part: table.every("hypervolume")(part) if len(part) > 1 else "")]
    return {
        "equal_power": shown({f"{power:g} W": column for power, column in powers.items()}),
        "equal_speed": shown({f"{speed:g} m/s": f"cost_at_{speed:g}" for speed in _SPEEDS}),
        "worth": summary(fronts.assign(difference=difference), ["front", "method"], columns),
    }


def _costs(points: pd.DataFrame, currency: str, weight: float) -> pd.DataFrame:
    """The cost of transport of each front at each speed [1]."""
    speeds, names = np.array(_SPEEDS), [f"cost_at_{speed:g}" for speed in _SPEEDS]
    fronts = {key: powers_needed(part, speeds, currency) for key, part in points.groupby(_FRONT, sort=False)}
    costs = pd.DataFrame.from_dict(fronts, "index", columns=names).div(weight * speeds)
    return costs.set_axis(pd.MultiIndex.from_tuples(costs.index, names=_FRONT)).reset_index()


def _pairs(fronts: pd.DataFrame, points: pd.DataFrame, fixed: list[str], chosen: str, currency: str) -> pd.DataFrame:
    """Every seed's front of the policy beside every seed's of fixed gaits (with _fixed), and its gain (with _gain) [1].

    A front is compared with that of the same name, `against`; the integrated one with ideal switching as well. Gains
    are known at powers that both fronts span, and at their highest shared power.
    """
    names = fronts["front"].unique()
    compared_with = [(name, name) for name in names] + [OVERALL] * (set(names) >= set(OVERALL))
    own = fronts[fronts["method"] == chosen].drop(columns="method")
    own = own.merge(pd.DataFrame(compared_with, columns=["front", "against"]), on="front")
    others = fronts[fronts["method"].isin(fixed)].rename(columns={"front": "against"})
    others = others.drop(columns="currency")
    pairs = own.merge(others, on="against", suffixes=("", "_fixed"))
    pairs = pairs.assign(**_at_shared_power(pairs, points, chosen, currency))
    gained = ["hypervolume", *powers_compared(fronts).values(), "shared_speed"]
    ratios = {name: pairs[name].replace(0.0, np.nan) / pairs[f"{name}_fixed"].replace(0.0, np.nan) for name in gained}
    return pairs.assign(**{f"{name}_gain": ratio - 1 for name, ratio in ratios.items()})


def _at_shared_power(
    pairs: pd.DataFrame, points: pd.DataFrame, chosen: str, currency: str
) -> dict[str, list[float] | pd.Series]:
    """The highest power that both fronts of each pair span [W], and the speeds of both there [m/s]."""
    top = f"fastest_{CURRENCIES[currency]}"
    powers = pairs[[top, f"{top}_fixed"]].min(axis=1)
    fronts = dict(iter(points.groupby(["method", "front", "seed"])))

    def speeds(keys: Iterable[tuple[str, str, int]]) -> list[float]:
        at = zip(keys, powers, strict=True)
        return [float(speeds_within(fronts[key], np.array([power]), currency)[0]) for key, power in at]

    own = speeds((chosen, front, seed) for front, seed in zip(pairs["front"], pairs["seed"], strict=True))
    fixed = speeds(zip(pairs["method"], pairs["against"], pairs["seed_fixed"], strict=True))
    return {"shared_power": powers, "shared_speed": own, "shared_speed_fixed": fixed}


def _leads(points: pd.DataFrame, chosen: str, currency: str) -> Cell:
    """The power from which on the policy's mean speed is above that of fixed gaits, as far as all fronts reach [W]."""
    fronts, power = dict(iter(points.groupby(["method", "front"]))), CURRENCIES[currency]

    def cell(part: pd.DataFrame) -> str:
        front, against, method = part[["front", "against", "method"]].iloc[0]
        sides = [fronts[chosen, front], fronts[method, against]]
        seeds = [[seed for _, seed in side.groupby("seed")] for side in sides]
        highest = min(top_power(one, currency) for side in seeds for one in side)
        powers = np.unique(np.concatenate([side[power] for side in sides]))
        powers = powers[powers <= highest]
        speeds = [[np.nan_to_num(speeds_within(one, powers, currency)) for one in side] for side in seeds]
        behind = np.flatnonzero(np.mean(speeds[0], axis=0) <= np.mean(speeds[1], axis=0))
        first = behind[-1] + 1 if len(behind) else 0
        return f"{powers[first]:.2g} W" if first < len(powers) else f"not up to {highest:.2g} W"

    return cell


def _against_fixed(pairs: pd.DataFrame, leads: Cell) -> dict[str, Table]:
    """What the policy gains over fixed gaits, and where these are better by their means."""
    powers = powers_compared(pairs)

    def where_better(columns: dict[str, str], sign: int) -> Cell:
        def cell(part: pd.DataFrame) -> str:
            numbers = part.select_dtypes("number")
            means = sign * numbers.where(numbers != 0).mean(skipna=False)  # 0 is no point, below the least power
            return ", ".join(label for label, name in columns.items() if means[f"{name}_fixed"] > means[name])

        return cell

    def shared(part: pd.DataFrame) -> str:
        return f"{gain('shared_speed_gain')(part)} at {table.number(part['shared_power'].mean())} W"

    def label(front: str, against: str, method: str) -> str:
        return f"{front}, {method}" + ("" if front == against else f": {against}")

    def table_of(columns: list[Column]) -> Table:
        return summary(pairs, ["front", "against", "method"], columns, head="front, against", label=label)

    gains: list[Column] = [(f"{power:g} W", gain(f"{column}_gain")) for power, column in powers.items()]
    gains += [("highest shared power", shared), ("leads from", leads), ("hypervolume", gain("hypervolume_gain"))]
    cheaper = where_better({f"{speed:g}": f"cost_at_{speed:g}" for speed in _SPEEDS}, -1)
    better: list[Column] = [("faster at [W]", where_better({f"{p:g}": name for p, name in powers.items()}, 1))]
    better += [("lower CoT at [m/s]", cheaper), ("larger hypervolume", where_better({"yes": "hypervolume"}, 1))]
    losses = table_of(better)
    return {
        "gains": _known(table_of(gains)),
        "losses": Table(losses.head, [row for row in losses.rows if any(row[1:])]),
    }


def _known(whole: Table) -> Table:
    """A table without columns that hold dashes only."""
    kept = [k for k in range(len(whole.head)) if any(row[k] != "–" for row in whole.rows)]
    return Table([whole.head[k] for k in kept], [[row[k] for k in kept] for row in whole.rows])
