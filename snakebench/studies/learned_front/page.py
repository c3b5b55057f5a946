"""What the learned-front page shows: fronts of policies with a dial beside those of fixed gaits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.metrics import GRAVITY
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of_preference
from snakebench.report.front_comparison import Contest, compared
from snakebench.report.front_figure import fronts
from snakebench.report.standings import OVERALL, single_points, standings
from snakebench.report.summary import step_and_engine, summary
from snakebench.report.tables import Table, downloads, failures, in_both_currencies, number
from snakebench.robot import Robot
from snakebench.studies.learned_front import figures
from snakebench.studies.teacher_student import figures as learning_figures
from snakebench.tables import read_table
from snakebench.trajectory import Trajectory

_STILL = 0.01  # [m/s]


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the learned-front page shows; the fronts of fixed gaits are those beside the study's directory."""
    config = manifest["config"]
    curves, steps, dial, attainment = (
        read_table(directory / f"{name}.csv") for name in ("curves", "steps", "dial", "attainment")
    )
    dial = in_both_currencies(dial)
    policies = list(dict.fromkeys(steps["policy"]))
    students = [name for name in policies if "teacher" in config["policies"][name]]
    chosen = (students or policies)[0]
    fine, surfaces = dial[dial["variant"] == "finer step"], attainment[attainment["policy"] == chosen]
    points, worth, fixed = standings(directory, config)
    marks = single_points(directory, config)
    overall = [name for name in OVERALL if name in set(points[points["method"] == chosen]["front"])]
    names = [*config["fluids"], *overall]
    found = set(points["method"])
    contest = Contest(
        chosen,
        config["policies"][chosen].get("teacher"),
        fixed,
        [name for name in policies if name in found],
    )
    return {
        "manifest": manifest,
        "config": config,
        "swimmers": list(_swimmers(directory, config)),
        "dial": _dial(dial, config),
        "by_fluid": fronts(points, marks, config["fluids"], "Learned and fixed fronts of each fluid"),
        "overall": fronts(points, marks, overall, "Learned and fixed fronts over all fluids") if overall else None,
        "attainment": figures.attainment(surfaces, [name for name in names if name in set(surfaces["front"])]),
        "turned": figures.turned(fine[fine["policy"] == chosen], config["fluids"]),
        "monotony": _monotony(fine, policies, config["fluids"]),
        "engines": _engines(dial, policies, manifest),
        "learning": learning_figures.learning(curves, [name for name in policies if name not in students]),
        "distillation": learning_figures.distillation(curves, students) if students else None,
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": failures(fine),
        "downloads": downloads(directory, "fronts", "indicators"),
        "assumptions": assumptions_of_preference(config),
        **compared(points, worth, contest, names, Robot(**config["robot"]).total_mass * GRAVITY),
    }


def _monotony(fine: pd.DataFrame, policies: Sequence[str], fluids: Sequence[str]) -> Table:
    """Whether speed and power fall as the price rises."""
    return summary(
        "Along the dial, from the lowest price of power to the highest: how many steps do not raise speed or power, the"
        f" largest rise as a share of the highest value; swims slower than {_STILL} m/s or without a rhythm; and mean"
        " powers at both ends [W]; all seeds.",
        fine,
        {"policy": policies, "fluid": fluids},
        [
            ("speed falls", partial(_falls, "speed")),
            ("power falls", partial(_falls, "power")),
            ("stands still", _stands),
            ("P", partial(_ends, "power")),
            ("P+", partial(_ends, "positive_power")),
        ],
    )


def _falls(column: str, part: pd.DataFrame) -> str:
    """How many steps along the dial do not raise a figure, and its largest rise."""
    rises = part.sort_values("price").groupby("seed")[column].diff().dropna()
    steps = len(part) - part["seed"].nunique()
    share = 100 * max(rises.max(), 0.0) / part[column].max() if len(rises) else 0.0
    return f"{(rises <= 0).sum()} of {steps}, largest rise {share:.1f} %"


def _stands(part: pd.DataFrame) -> str:
    return f"{(part['swim_frequency'].isna() | ~(part['speed'] >= _STILL)).sum()} of {len(part)}"


def _ends(column: str, part: pd.DataFrame) -> str:
    means = part.groupby("price")[column].mean()
    return f"{number(means.iloc[0])} to {number(means.iloc[-1])}"


def _engines(dial: pd.DataFrame, policies: Sequence[str], manifest: dict[str, Any]) -> Table:
    swims = dial.set_index(["policy", "seed", "fluid", "price"])
    strong = swims.index[(swims["variant"] == "finer step") & (swims["power"] >= 1)]
    by = {"policy": policies, "fluid": manifest["config"]["fluids"]}
    figures = {"speed": "v", "power": "P", "positive_power": "P+"}
    swims = swims[swims.index.isin(strong)].reset_index()
    return step_and_engine(swims, by, ["seed", "price"], figures, manifest, ", of all swims that take 1 W or more")


def _swimmers(directory: Path, config: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for name in config["shown"]:
        for fluid in config["fluids"]:
            for k in range(config["swims"]):
                run = Trajectory.load(directory / "trajectories" / f"{name}-{fluid}-{k}.npz")
                yield swimmer(f"{name} in {fluid}", run)


def _dial(dial: pd.DataFrame, config: dict[str, Any]) -> dict[str, Any]:
    """What the player's dial shows."""
    turned = dial[dial["policy"].isin(config["shown"])]["price"]
    prices = np.geomspace(turned.min(), turned.max(), config["swims"])
    return {"label": "price of power λ", "positions": [f"{price:.3g} 1/W" for price in prices]}
