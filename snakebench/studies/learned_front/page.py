"""The page of the learned-front study: fronts of preference-conditioned policies beside those of fixed gaits."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.collocation.front import of_held_targets, under_first_bounds
from snakebench.names import CURRENCIES, FINE
from snakebench.report import learning_figure, table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.front_figure import fronts as draw_fronts
from snakebench.report.table import CURRENCY_LABELS, POWERS, Cell, Column, Table, name_of, summary
from snakebench.studies.front_comparison import compared
from snakebench.studies.learned_front import figures
from snakebench.studies.limit_shares import shares_at
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import OVERALL, limit_beside, single_points, standings, with_limit

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
    from_limit = {
        name: CURRENCY_LABELS[own.get("currency", "net")] for name, own in settings.items() if "demonstrations" in own
    }
    schedules = [name for name in from_limit if "estimator" in settings[name]]
    students = [name for name in policies if teachers[name] or name in from_limit]
    distilled = [name for name in students if name not in schedules]
    trained = [name for name in policies if name not in students]
    chosen = {currency: _learned_for(currency, students or policies, config) for currency in CURRENCIES}
    fine = table.of_valid(dial[dial["variant"] == FINE])
    surfaces = attainment[attainment["policy"] == chosen["net"]]
    prices = fine[fine["policy"].isin(config["shown"])]["price"]
    positions = np.geomspace(prices.min(), prices.max(), config["swims"])  # of the player's slider
    points, worth, fixed = standings(study)
    singles, own = single_points(study), points[points["method"] == chosen["net"]]
    swims = product(config["shown"], fluids, range(config["swims"]))
    overall = [name for name in OVERALL if name in set(own["front"])]
    made = compared(points, worth, fixed, chosen, teachers, study.weight)
    reached, of_held = (_of_limit(study, points, policies, held=held) for held in (False, True))
    return made | {
        "findings": made["findings"] | {"of_limit": reached, "of_held": of_held},
        "imitators": {name: label for name, label in from_limit.items() if name in distilled},
        "schedules": {name: from_limit[name] for name in schedules},
        "estimates": summary(curves, {"policy": schedules}, [("rms error [decades]", table.every("error", ".3f"))]),
        "of_limit": _limit_tables(reached, of_held),
        "swimmers": study.swimmers({f"{name}-{fluid}-{k}": f"{name} in {fluid}" for name, fluid, k in swims}),
        "prices": {"label": "price of power λ", "positions": [f"{price:.3g} 1/W" for price in positions]},
        "by_fluid": draw_fronts(with_limit(points, study), singles, fluids, "Learned and fixed fronts of each fluid"),
        "overall": overall and draw_fronts(points, singles, overall, "Learned and fixed fronts over all fluids"),
        "chosen_of_p": name_of(chosen["net"]),
        "attainment": figures.attainment(surfaces) if len(surfaces) and trained else None,
        "turned": figures.turned(fine[fine["policy"] == chosen["net"]], fluids),
        "monotony": _monotony(fine, policies, fluids),
        "engines": _engines(study, policies),
        "learning": learning_figure.learning(curves, trained) if trained else None,
        "distillation": learning_figure.distillation(curves, distilled) if distilled else None,
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
    if not (limit := limit_beside(study)):
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
    strong = swims.index[(swims["variant"] == FINE) & (swims["power"] >= _WEAK)]
    if not len(strong):
        return None
    labels = {"speed": "v", "power": "P", "positive_power": "P+"}
    changes = step_changes(swims[swims.index.isin(strong)].reset_index(), _SWIM, labels)
    return step_table(changes, {"policy": policies, "fluid": study.config["fluids"]})
