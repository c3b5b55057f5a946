"""What the learned-front page shows: fronts of policies with a dial beside those of fixed gaits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
from snakebench.report.tables import Table, downloads, failures, in_both_currencies, number
from snakebench.robot import Robot
from snakebench.store import read_table
from snakebench.studies.learned_front import figures
from snakebench.studies.teacher_student import figures as learning_figures
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
        "engines": _engines(dial, policies, config["fluids"]),
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
    rows = []
    for policy in policies:
        for fluid in fluids:
            part = fine[(fine["policy"] == policy) & (fine["fluid"] == fluid)]
            cells = []
            for column in ("speed", "power"):
                by_seed = [seed[column].to_numpy() for _, seed in part.sort_values("price").groupby("seed")]
                rises = np.concatenate([np.diff(values) for values in by_seed])
                known = rises[~np.isnan(rises)]
                share = 100 * max(float(known.max(initial=0.0)), 0.0) / float(part[column].max())
                cells.append(f"{(known <= 0).sum()} of {len(rises)}, largest rise {share:.1f} %")
            still = (part["swim_frequency"].isna() | ~(part["speed"] >= _STILL)).sum()
            means = [part.groupby("price")[name].mean() for name in ("power", "positive_power")]
            ends = [f"{number(mean.iloc[0])} to {number(mean.iloc[-1])}" for mean in means]
            rows.append([f"{policy}, {fluid}", *cells, f"{still} of {len(part)}", *ends])
    return Table(
        "Along the dial, from the lowest price of power to the highest: how many steps do not raise speed or power, the"
        f" largest rise as a share of the highest value; swims slower than {_STILL} m/s or without a rhythm; and mean"
        " powers at both ends [W]; all seeds.",
        ["policy, fluid", "speed falls", "power falls", "stands still", "P", "P+"],
        rows,
    )


def _engines(dial: pd.DataFrame, policies: Sequence[str], fluids: Sequence[str]) -> Table:
    """How much the figures depend on the step and the engine."""
    compared = ["speed", "power", "positive_power"]
    place = ["policy", "seed", "fluid", "price"]
    by_variant = {name: part.set_index(place)[compared] for name, part in dial.groupby("variant")}
    fine = by_variant["finer step"]
    strong = fine[fine["power"] >= 1]
    gaps = [
        (by_variant[name] / strong - 1).abs().dropna(subset=["speed", "power"]).reset_index()
        for name in ("coarser step", "planar")
    ]
    rows = []
    for policy in policies:
        for fluid in fluids:
            here = [gap[(gap["policy"] == policy) & (gap["fluid"] == fluid)] for gap in gaps]
            columns = [100 * part[name] for part in here for name in compared]
            rows.append([f"{policy}, {fluid}", *(f"{number(gap.median())} / {number(gap.max())}" for gap in columns)])
    return Table(
        "Relative difference of speed and powers to half the physics rate and to the planar engine, median / largest"
        " [%], of all swims that take 1 W or more.",
        ["policy, fluid", "half rate: v", "P", "P+", "planar: v", "P", "P+"],
        rows,
    )


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
