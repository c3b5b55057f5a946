"""The page of the learned-front study: fronts of preference-conditioned policies beside those of fixed gaits.

Fronts are compared at equal power, at equal speed and by hypervolume, all by command power P, which searches and
policies seek to keep low, as in the paper; P+ and CoT+ of the compared points stand beside.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.metrics import GRAVITY
from snakebench.report import table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.animation import swimmer
from snakebench.report.equal_power import speeds_within
from snakebench.report.front_figure import fronts as draw_fronts
from snakebench.report.table import LABELS, POWERS, Cell, Column, Table, gain, mean, summary
from snakebench.robot import Robot
from snakebench.studies.learned_front import figures
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import OVERALL, powers_compared, single_points, standings
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
    students = [name for name in policies if "teacher" in config["policies"][name]]
    chosen = (students or policies)[0]
    fine, surfaces = dial[dial["variant"] == "finer step"], attainment[attainment["policy"] == chosen]
    prices = fine[fine["policy"].isin(config["shown"])]["price"]
    positions = np.geomspace(prices.min(), prices.max(), config["swims"])  # of the player's slider
    points, worth, fixed = standings(study)
    singles, own = single_points(study), points[points["method"] == chosen]
    overall = [name for name in OVERALL if name in set(own["front"])]
    weight = Robot(**config["robot"]).total_mass * GRAVITY
    return compared(points, worth, fixed, chosen, config["policies"][chosen].get("teacher"), weight) | {
        "chosen": chosen,
        "swimmers": [
            swimmer(f"{name} in {fluid}", swim)
            for name, fluid, k in product(config["shown"], fluids, range(config["swims"]))
            if (swim := study.swim(f"{name}-{fluid}-{k}"))
        ],
        "prices": {"label": "price of power λ", "positions": [f"{price:.3g} 1/W" for price in positions]},
        "by_fluid": draw_fronts(points, singles, fluids, "Learned and fixed fronts of each fluid"),
        "overall": overall and draw_fronts(points, singles, overall, "Learned and fixed fronts over all fluids"),
        "attainment": figures.attainment(surfaces),
        "turned": figures.turned(fine[fine["policy"] == chosen], fluids),
        "monotony": _monotony(fine, policies, fluids),
        "engines": _engines(study, policies),
        "learning": learning_figures.learning(curves, [name for name in policies if name not in students]),
        "distillation": learning_figures.distillation(curves, students) if students else None,
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": table.failures(fine),
    }


def compared(
    points: pd.DataFrame, worth: pd.DataFrame, fixed: list[str], chosen: str, teacher: str | None, weight: float
) -> dict[str, Any]:
    """How the fronts of a policy compare with its teacher's and those of fixed gaits (`standings`); weight in [N]."""
    powers = powers_compared(worth)
    costs = {f"{speed:g} m/s": f"cost_at_{speed:g}" for speed in _SPEEDS}
    moving = worth.replace({column: {0.0: np.nan} for column in powers.values()})  # where a point needs so little power
    fronts = moving.merge(_cheapest(points, weight), how="left", on=_FRONT)
    known = fronts if points["positive_power"].notna().any() else fronts[:0]
    pairs = _pairs(fronts, fixed, chosen)
    volumes = fronts.pivot(index=["front", "seed"], columns="method", values="hypervolume")
    shares = volumes[chosen] / volumes.get(teacher, np.nan)

    def shown(rows: pd.DataFrame, columns: dict[str, str]) -> Table:
        return summary(rows, ["front", "method"], [(head, mean(column)) for head, column in columns.items()])

    return _against_fixed(pairs, _leads(points, chosen, max(powers, default=np.inf))) | {
        "findings": {"gains": pairs, "kept": shares.dropna().rename("share").reset_index()},
        "n_seeds": fronts.loc[fronts["method"] == chosen, "seed"].nunique(),
        "equal_power": shown(fronts, {f"{power:g} W": column for power, column in powers.items()}),
        "equal_speed": shown(fronts, costs),
        "worth": _hypervolumes(fronts),
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
    """Every seed's front of the policy beside every seed's of fixed gaits (with _fixed), and its gain (with _gain) [1].

    A front is compared with that of the same name, `against`; the integrated one with ideal switching as well.
    """
    names = fronts["front"].unique()
    compared_with = [(name, name) for name in names] + [OVERALL] * (set(names) >= set(OVERALL))
    own = fronts[fronts["method"] == chosen].drop(columns="method")
    own = own.merge(pd.DataFrame(compared_with, columns=["front", "against"]), on="front")
    others = fronts[fronts["method"].isin(fixed)].rename(columns={"front": "against"})
    pairs = own.merge(others, on="against", suffixes=("", "_fixed"))
    gained = ["hypervolume", *powers_compared(fronts).values()]
    return pairs.assign(**{f"{name}_gain": pairs[name] / pairs[f"{name}_fixed"] - 1 for name in gained})


def _leads(points: pd.DataFrame, chosen: str, highest: float) -> Cell:
    """The power from which on the policy's mean speed is above that of fixed gaits, up to the highest power [W]."""
    fronts = dict(iter(points.groupby(["method", "front"])))

    def cell(part: pd.DataFrame) -> str:
        front, against, method = part[["front", "against", "method"]].iloc[0]
        own, fixed = fronts[chosen, front], fronts[method, against]
        powers = np.unique([*own["power"], *fixed["power"]])  # in between, no speed changes
        powers = powers[powers <= highest]
        means = [
            np.mean([np.nan_to_num(speeds_within(seed, powers)) for _, seed in side.groupby("seed")], axis=0)
            for side in (own, fixed)
        ]
        behind = np.flatnonzero(means[0] <= means[1])
        first = behind[-1] + 1 if len(behind) else 0
        return f"{powers[first]:.2g} W" if first < len(powers) else f"not at {highest:g} W"

    return cell


def _against_fixed(pairs: pd.DataFrame, leads: Cell) -> dict[str, Table]:
    """What the policy gains over fixed gaits, and where these are better by their means."""
    powers = powers_compared(pairs)

    def where_better(columns: dict[str, str], sign: int) -> Cell:
        def cell(part: pd.DataFrame) -> str:
            means = sign * part.fillna(dict.fromkeys(powers.values(), 0.0)).mean(numeric_only=True)
            return ", ".join(label for label, name in columns.items() if means[f"{name}_fixed"] > means[name])

        return cell

    def table_of(columns: list[Column]) -> Table:
        return summary(pairs, ["front", "against", "method"], columns, head="front, against", label=_label)

    gains: list[Column] = [(f"{power:g} W", gain(f"{column}_gain")) for power, column in powers.items()]
    gains += [("leads from", leads), ("hypervolume", gain("hypervolume_gain"))]
    cheaper = where_better({f"{speed:g}": f"cost_at_{speed:g}" for speed in _SPEEDS}, -1)
    better: list[Column] = [("faster within [W]", where_better({f"{p:g}": name for p, name in powers.items()}, 1))]
    better += [("lower CoT from [m/s]", cheaper), ("larger hypervolume", where_better({"yes": "hypervolume"}, 1))]
    losses = table_of(better)
    return {"gains": table_of(gains), "losses": Table(losses.head, [row for row in losses.rows if any(row[1:])])}


def _label(front: str, against: str, method: str) -> str:
    return f"{front}, {method}" + ("" if front == against else f": {against}")


def _hypervolumes(fronts: pd.DataFrame) -> Table:
    difference = (fronts["hypervolume"] - fronts["hypervolume_searched"]).abs()
    columns: list[Column] = [("n", table.size), ("hypervolume", mean("hypervolume", 2))]
    columns += [("Δ engine", table.largest("difference"))]
    columns += [("each seed", lambda part: table.every("hypervolume")(part) if len(part) > 1 else "")]
    return summary(fronts.assign(difference=difference), ["front", "method"], columns)


def _monotony(fine: pd.DataFrame, policies: Sequence[str], fluids: Sequence[str]) -> Table:
    by_price = fine.sort_values("price")
    rises = by_price.groupby(["policy", "seed", "fluid"])[["speed", "power"]].diff()
    shares = 100 * rises / by_price.groupby(["policy", "fluid"])[["speed", "power"]].transform("max")
    by_price["still"] = by_price["swim_frequency"].isna() | ~(by_price["speed"] >= _STILL)

    def falls(column: str) -> Cell:
        return lambda part: f"{(part[column] <= 0).sum()} of {part[column].count()}"

    def at_both_ends(column: str) -> Cell:
        return lambda part: " to ".join(map(table.number, part.groupby("price")[column].mean().iloc[[0, -1]]))

    columns: list[Column] = [(f"{name} falls", falls(f"{name}_rise")) for name in ("speed", "power")]
    columns += [(f"largest rise of {name} [%]", table.largest(f"{name}_rise", ".1f")) for name in ("speed", "power")]
    columns += [("stands still", lambda part: f"{part['still'].sum()} of {len(part)}")]
    columns += [(LABELS[name], at_both_ends(name)) for name in POWERS]
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
