"""The page of the learned-front study: fronts of preference-conditioned policies beside those of fixed gaits.

Fronts are compared at equal power, at equal speed and by hypervolume, in each currency of power. Policies seek to keep
command power P low, as in the paper.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.collocation.front import of_held_targets, under_first_bounds
from snakebench.metrics import GRAVITY
from snakebench.report import table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.equal_power import powers_needed, speeds_within, top_power
from snakebench.report.front_figure import fronts as draw_fronts
from snakebench.report.table import CURRENCY_LABELS, POWERS, Cell, Column, Table, gain, mean, summary
from snakebench.robot import Robot
from snakebench.store import CURRENCIES
from snakebench.studies.learned_front import figures
from snakebench.studies.limit.rivals import shares_at
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import (
    OVERALL,
    powers_compared,
    same_settings,
    single_points,
    standings,
    with_limit,
)
from snakebench.studies.teacher_student import figures as learning_figures

_FRONT = ["method", "front", "seed"]
_SPEEDS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # [m/s] at which costs of transport are compared
_SWIM = ["policy", "seed", "fluid", "price"]
_STILL = 0.01  # [m/s]
_WEAK = 1.0  # [W] below which relative differences are not compared


def page(study: Published) -> dict[str, Any]:
    """What the page shows; the fronts of fixed gaits are those beside the results."""
    config, fluids = study.config, study.config["fluids"]
    curves, dial, attainment = (study.tables[name] for name in ("curves", "dial", "attainment"))
    policies = list(study.tables["steps"]["policy"].unique())
    settings = {name: config["policies"][name] for name in policies}
    teachers = {name: own.get("teacher") for name, own in settings.items()}
    imitators = {
        name: CURRENCY_LABELS[own.get("currency", "net")] for name, own in settings.items() if "demonstrations" in own
    }
    students = [name for name in policies if teachers[name] or name in imitators]
    trained = [name for name in policies if name not in students]
    chosen = {currency: _learned_for(currency, students or policies, config) for currency in CURRENCIES}
    fine, surfaces = dial[dial["variant"] == "finer step"], attainment[attainment["policy"] == chosen["net"]]
    prices = fine[fine["policy"].isin(config["shown"])]["price"]
    positions = np.geomspace(prices.min(), prices.max(), config["swims"])  # of the player's slider
    points, worth, fixed = standings(study)
    singles, own = single_points(study), points[points["method"] == chosen["net"]]
    swims = product(config["shown"], fluids, range(config["swims"]))
    overall = [name for name in OVERALL if name in set(own["front"])]
    weight = Robot(**config["robot"]).total_mass * GRAVITY
    made = compared(points, worth, fixed, chosen, teachers, weight)
    reached, of_held = (_of_limit(study, points, policies, held=held) for held in (False, True))
    return made | {
        "findings": made["findings"] | {"of_limit": reached, "of_held": of_held},
        "imitators": imitators,
        "of_limit": _limit_tables(reached, of_held),
        "swimmers": study.swimmers({f"{name}-{fluid}-{k}": f"{name} in {fluid}" for name, fluid, k in swims}),
        "prices": {"label": "price of power λ", "positions": [f"{price:.3g} 1/W" for price in positions]},
        "by_fluid": draw_fronts(with_limit(points, study), singles, fluids, "Learned and fixed fronts of each fluid"),
        "overall": overall and draw_fronts(points, singles, overall, "Learned and fixed fronts over all fluids"),
        "attainment": figures.attainment(surfaces) if len(surfaces) and trained else None,
        "turned": figures.turned(fine[fine["policy"] == chosen["net"]], fluids),
        "monotony": _monotony(fine, policies, fluids),
        "engines": _engines(study, policies),
        "learning": learning_figures.learning(curves, trained) if trained else None,
        "distillation": learning_figures.distillation(curves, students) if students else None,
        **table.validity(fine),
    }


def _learned_for(currency: str, policies: Sequence[str], config: Mapping[str, Any]) -> str:
    """The first of the policies whose price is of this currency; the first of all if there is none."""
    own = (name for name in policies if config["policies"][name].get("currency", "net") == currency)
    return next(own, policies[0])


def _of_limit(study: Published, points: pd.DataFrame, policies: Sequence[str], *, held: bool) -> pd.DataFrame:
    """The shares of the limit beside the study that the policies' fronts reach at equal power, by seed [1].

    The limit is that of targets that move, or that are `held` as the policies' are.
    """
    limit = study.beside("limit")
    if limit is None or not same_settings(study, limit):
        return pd.DataFrame()
    rows = (of_held_targets if held else under_first_bounds)(limit.tables["limit"], limit.config)
    own = points[points["method"].isin(policies)].drop(columns="currency").drop_duplicates()
    own = own.rename(columns={"front": "fluid"}).assign(is_front=True)
    return shares_at(rows, own)


def _limit_tables(reached: pd.DataFrame, of_held: pd.DataFrame) -> dict[str, dict[str, Table]]:
    """Of each currency the mean shares of the limit, those of every seed, and the mean ones of held targets."""
    tables = dict[str, dict[str, Table]]()
    for name, cell, shares in (
        ("mean", table.share, reached),
        ("seeds", _each_share, reached),
        ("held", table.share, of_held),
    ):
        for currency, part in shares.groupby("currency", sort=False) if len(shares) else ():
            by_power = part.pivot(index=["method", "fluid", "seed"], columns="allowed", values="share")
            by_power = by_power.rename(columns="{:g} W".format)
            rows, powers = by_power.sort_index(level="seed").reset_index(), map(str, by_power)
            order = {"method": part["method"].unique(), "fluid": part["fluid"].unique()}
            columns = [(power, cell(power)) for power in powers]
            tables.setdefault(str(currency), {})[name] = summary(rows, order, columns)
    return tables


def _each_share(power: str) -> Cell:
    return lambda part: ", ".join("–" if pd.isna(share) else f"{100 * share:.0f}" for share in part[power])


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


def _monotony(fine: pd.DataFrame, policies: Sequence[str], fluids: Sequence[str]) -> Table:
    by_price = fine.sort_values("price")
    rises = by_price.groupby(["policy", "seed", "fluid"])[["speed", "power"]].diff()
    shares = 100 * rises / by_price.groupby(["policy", "fluid"])[["speed", "power"]].transform("max").abs()
    by_price["still"] = by_price["swim_frequency"].isna() | ~(by_price["speed"] >= _STILL)

    def falls(column: str) -> Cell:
        return lambda part: f"{(part[column] <= 0).sum()} of {part[column].count()}"

    def at_both_ends(column: str) -> Cell:
        return lambda part: " to ".join(map(table.number, part.groupby("price")[column].mean().iloc[[0, -1]]))

    columns: list[Column] = [(f"{name} falls", falls(f"{name}_rise")) for name in ("speed", "power")]
    columns += [(f"largest rise of {name} [%]", table.largest(f"{name}_rise", ".1f")) for name in ("speed", "power")]
    columns += [("stands still", lambda part: f"{part['still'].sum()} of {len(part)}")]
    columns += table.under_labels(at_both_ends, POWERS)
    return summary(by_price.join(shares.add_suffix("_rise")), {"policy": policies, "fluid": fluids}, columns)


def _engines(study: Published, policies: Sequence[str]) -> Table | None:
    """How much the figures of swims that take 1 W or more depend on the physics step and the engine."""
    swims = study.tables["dial"].set_index(_SWIM)
    strong = swims.index[(swims["variant"] == "finer step") & (swims["power"] >= _WEAK)]
    if not len(strong):
        return None
    labels = {"speed": "v", "power": "P", "positive_power": "P+"}
    changes = step_changes(swims[swims.index.isin(strong)].reset_index(), _SWIM, labels, study.manifest)
    return step_table(changes, {"policy": policies, "fluid": study.config["fluids"]})
