"""The page of the learned-front study: fronts of preference-conditioned policies beside those of fixed gaits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.metrics import GRAVITY
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.animation import swimmer
from snakebench.report.front_figure import fronts
from snakebench.report.table import LABELS, POWERS, Cell, Column, Table, failures, largest, number, summary
from snakebench.robot import Robot
from snakebench.studies.learned_front import figures
from snakebench.studies.learned_front.front_comparison import compared
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import OVERALL, single_points, standings
from snakebench.studies.teacher_student import figures as learning_figures

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
    points, worth, fixed = standings(study)
    singles, overall = single_points(study), [name for name in OVERALL if name in set(points["front"])]
    weight = Robot(**config["robot"]).total_mass * GRAVITY
    return compared(points, worth, fixed, chosen, config["policies"][chosen].get("teacher"), weight) | {
        "chosen": chosen,
        "swimmers": [
            swimmer(f"{name} in {fluid}", swim)
            for name, fluid, k in product(config["shown"], fluids, range(config["swims"]))
            if (swim := study.swim(f"{name}-{fluid}-{k}"))
        ],
        "prices": _prices(fine, config),
        "by_fluid": fronts(points, singles, fluids, "Learned and fixed fronts of each fluid"),
        "overall": fronts(points, singles, overall, "Learned and fixed fronts over all fluids") if overall else None,
        "attainment": figures.attainment(surfaces),
        "turned": figures.turned(fine[fine["policy"] == chosen], fluids),
        "monotony": _monotony(fine, policies, fluids),
        "engines": _engines(study, policies),
        "learning": learning_figures.learning(curves, [name for name in policies if name not in students]),
        "distillation": learning_figures.distillation(curves, students) if students else None,
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": failures(fine),
    }


def _monotony(fine: pd.DataFrame, policies: Sequence[str], fluids: Sequence[str]) -> Table:
    by_price = fine.sort_values("price")
    rises = by_price.groupby(["policy", "seed", "fluid"])[["speed", "power"]].diff()
    shares = 100 * rises / by_price.groupby(["policy", "fluid"])[["speed", "power"]].transform("max")
    by_price["still"] = by_price["swim_frequency"].isna() | ~(by_price["speed"] >= _STILL)
    columns: list[Column] = [(f"{name} falls", _falls(f"{name}_rise")) for name in ("speed", "power")]
    columns += [(f"largest rise of {name} [%]", largest(f"{name}_rise", ".1f")) for name in ("speed", "power")]
    columns += [("stands still", lambda part: f"{part['still'].sum()} of {len(part)}")]
    columns += [(LABELS[name], _at_both_ends(name)) for name in POWERS]
    return summary(by_price.join(shares.add_suffix("_rise")), {"policy": policies, "fluid": fluids}, columns)


def _falls(column: str) -> Cell:
    return lambda part: f"{(part[column] <= 0).sum()} of {part[column].count()}"


def _at_both_ends(column: str) -> Cell:
    """The means at the lowest and the highest price."""

    def cell(part: pd.DataFrame) -> str:
        means = part.groupby("price")[column].mean()
        return f"{number(means.iloc[0])} to {number(means.iloc[-1])}"

    return cell


def _engines(study: Published, policies: Sequence[str]) -> Table | None:
    """How much the figures of swims that take 1 W or more depend on the physics step and the engine."""
    swims = study.tables["dial"].set_index(_SWIM)
    strong = swims.index[(swims["variant"] == "finer step") & (swims["power"] >= _WEAK)]
    if not len(strong):
        return None
    labels = {"speed": "v", "power": "P", "positive_power": "P+"}
    changes = step_changes(swims[swims.index.isin(strong)].reset_index(), _SWIM, labels, study.manifest)
    return step_table(changes, {"policy": policies, "fluid": study.config["fluids"]})


def _prices(fine: pd.DataFrame, config: dict[str, Any]) -> dict[str, Any]:
    """The positions of the player's slider: the prices of the swims shown."""
    prices = fine[fine["policy"].isin(config["shown"])]["price"]
    positions = np.geomspace(prices.min(), prices.max(), config["swims"])
    return {"label": "price of power λ", "positions": [f"{price:.3g} 1/W" for price in positions]}
