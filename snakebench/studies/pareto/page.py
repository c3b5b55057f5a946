"""What the Pareto page shows: fronts and their indicators to sentences, tables and figures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.controllers import GAITS
from snakebench.report import paper
from snakebench.report.assumptions import assumptions_of
from snakebench.report.front_figure import fronts as draw_fronts
from snakebench.report.standings import OVERALL, counted_alike, fastest_within, fixed_fronts, single_points
from snakebench.report.summary import Cell, first, over_seeds, size, summary
from snakebench.report.tables import TAKEN, Table, downloads, in_both_currencies, number, with_difference
from snakebench.robot import Robot
from snakebench.store import INTEGRATED, SIMPLE_SUM
from snakebench.studies.pareto import figures
from snakebench.tables import read_table, table_file

_UNIT = re.compile(r"\[.*\]$")  # at the end of a field's description
_NAMED = {"fastest": "fastest", "knee": "knee", "thriftiest": "lowest CoT"}
_AT = "speed_at_"  # columns of the speed at equal power
_PAID_AT = "positive_power_at_"  # columns of what that takes
IN_BRACKETS = "in brackets the P+ [W] of the point that has it, where it is known."
_GOAL = 0.99  # share of the grid's hypervolume that a search should reach


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the Pareto page shows; other baselines' results beside the study's directory are drawn as well."""
    config = manifest["config"]
    fronts, indicators, verified, growth = (
        read_table(directory / f"{name}.csv") for name in ("fronts", "indicators", "verified", "growth")
    )
    fronts = in_both_currencies(fronts)
    attainment = read_table(directory / "attainment.csv") if table_file(directory / "attainment.csv").exists() else None
    points = fixed_fronts([directory, *counted_alike(directory, ["fourier"], config)])
    marks = single_points(directory, config)
    overall = [name for name in OVERALL if name in set(points["front"])]
    beside = pd.concat([indicators, *_fourier_indicators(directory, config)], ignore_index=True)
    robot, parameters = Robot(**config["robot"]), _parameters(manifest)
    return {
        "manifest": manifest,
        "config": config,
        "answers": _answers(indicators, growth),
        "warnings": beyond_reference(indicators, config["reference"]),
        "worth": front_table(beside),
        "equal_power": _equal_power(beside, robot),
        "gaits": _named_gaits(fronts, indicators, parameters),
        "paper": _beside_paper(fronts, robot) if config["gait"] == "sinusoidal-torque" else None,
        "searches": _searches(growth),
        "marked": len(marks) > 0,
        "by_fluid": draw_fronts(points, marks, config["fluids"], "Front of speed against power of each fluid"),
        "overall": draw_fronts(points, marks, overall, "Integrated and simple-sum front") if overall else None,
        "growth": figures.growth(growth, _grids(growth)),
        "attainment": None if attainment is None else figures.attainment(attainment, fronts),
        "parameters": figures.parameters(fronts, config["fluids"], parameters),
        "differences": figures.differences(verified),
        "unsteady": int((~fronts["steady"]).sum()),
        "n_gaits": len(fronts),
        "downloads": downloads(directory, "fronts", "indicators", "growth"),
        "assumptions": assumptions_of(config),
    }


def front_table(indicators: pd.DataFrame) -> Table:
    """What each front is worth, one row a front."""
    rows = [
        [
            f"{row['space']}, {row['front']}",
            f"{row['points']}",
            f"{row['hypervolume']:.2f} (Δ engine {abs(row['hypervolume'] - row['hypervolume_searched']):.2f})",
            *(
                f"{row[f'{key}_speed']:.3f} at {_powers(row, key)}" if pd.notna(row[f"{key}_speed"]) else "–"
                for key in _NAMED
            ),
        ]
        for row in indicators.to_dict("records")
    ]
    return Table(
        "The fronts as verified: points, hypervolume [m/s W] and its difference Δ to the searching engine's, and speed"
        " [m/s] at P / P+ [W] of three points by name. Searches seek a low P, the paper's power, so fronts, hypervolume"
        " and knee are of P. The knee is farthest from the line through the ends of what lies within the reference."
        " Fixed gaits have their lowest cost of transport where they hardly move.",
        ["space, front", "points", "hypervolume", *_NAMED.values()],
        rows,
    )


def _powers(row: Mapping[Any, Any], key: str) -> str:
    """Both powers of a point by name; P+ is not in tables of version 1.0."""
    return " / ".join(number(row.get(f"{key}_{name}")) for name in ("power", "positive_power"))


def speeds_at_powers(indicators: pd.DataFrame) -> list[tuple[str, Cell]]:
    """Columns of the highest speed of a front within each power, and in brackets the P+ of its point, if known."""
    columns = [str(name) for name in indicators if str(name).startswith(_AT)]
    return [(name.removeprefix(_AT).replace("_", " "), partial(_speed_at, name)) for name in columns]


def _speed_at(column: str, part: pd.DataFrame) -> str:
    row = part.iloc[0]
    positive_power = row.get(column.replace(_AT, _PAID_AT))
    return f"{row[column]:.3f}" + ("" if pd.isna(positive_power) else f" ({number(positive_power)})")


def beyond_reference(indicators: pd.DataFrame, reference: list[float]) -> list[str]:
    """Which points the reference of the hypervolume loses, a sentence a front."""
    return [
        f"{row['space']}, {row['front']}: {row['beyond']} of {row['points']} points lie beyond the reference"
        f" ({reference[0]:g} m/s, {reference[1]:g} W) and add nothing to the hypervolume; the fastest is"
        f" {row['fastest_speed']:.3f} m/s at {row['fastest_power']:.1f} W"
        for row in indicators.to_dict("records")
        if row["beyond"]
    ]


def _answers(indicators: pd.DataFrame, growth: pd.DataFrame) -> list[str]:
    """The findings, a sentence each."""
    shown = [f"{_AT}{power}_W" for power in (5, 20)]
    sentences = []
    for name, part in indicators.groupby("front", sort=False):
        speeds = "; ".join(
            f"{row['space']} space {' and '.join(f'{row[column]:.2f}' for column in shown)} m/s"
            for row in part.to_dict("records")
        )
        where = {INTEGRATED: "One gait for all fluids", SIMPLE_SUM: "Switching between each fluid's best gaits"}
        sentences.append(f"{where.get(str(name), f'In {name}')}, at 5 and 20 W: {speeds}.")
    sentences += [
        f"In the {space} space one gait for all reaches {100 * part[INTEGRATED] / part[SIMPLE_SUM]:.0f} % of the"
        " hypervolume of switching."
        for space, part in _hypervolumes(indicators).items()
        if SIMPLE_SUM in part
    ]
    shares = _at_a_tenth(growth)
    if len(shares):
        means = shares.groupby(["space", "objective"])["share"].mean().reset_index()
        least = means.sort_values("share").iloc[0]
        sentences.append(
            f"With a tenth of the grid's simulations NSGA-II reaches {100 * shares['share'].median():.1f} % of its"
            f" hypervolume in the median of all searches; least in {least['objective']}, {least['space']} space:"
            f" {100 * least['share']:.1f} % (mean of {shares['seed'].nunique()} seeds)."
        )
    return sentences


def _hypervolumes(indicators: pd.DataFrame) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    for row in indicators.to_dict("records"):
        found.setdefault(row["space"], {})[row["front"]] = row["hypervolume"]
    return found


def powers_compared(indicators: pd.DataFrame, robot: Robot) -> str:
    """At which powers fronts are compared, and why, in a sentence."""
    columns = [str(column) for column in indicators if str(column).startswith(_AT)]
    powers = ", ".join(column.removeprefix(_AT).removesuffix("_W") for column in columns)
    mass, usual = robot.total_mass, Robot().total_mass
    of_another = f"; this one weighs {mass:.3g} kg, the paper's {usual:.3g} kg" if robot != Robot() else ""
    return (
        f"Speeds are compared at {powers} W for every robot, what the fronts of the paper's robot span up to the usual"
        f" reference, not scaled to another{of_another}."
    )


def _equal_power(indicators: pd.DataFrame, robot: Robot) -> Table:
    caption = f"Highest speed [m/s] on each front for at most a power P, {IN_BRACKETS}"
    caption += f" {powers_compared(indicators, robot)}"
    by = {name: indicators[name].unique() for name in ("space", "front")}
    return summary(caption, indicators, by, speeds_at_powers(indicators), label="{}, {}".format)


def _parameters(manifest: Mapping[str, Any]) -> dict[str, str]:
    """What the study searched for, each with its unit, which older manifests do not tell of gaits of plug-ins."""
    config = manifest["config"]
    names, gait = next(iter(config["spaces"].values())), GAITS.get(config["gait"])
    known = {name: gait.model_fields[name].description if gait else None for name in names}
    about = {name: text or "" for name, text in (known | manifest.get("parameters", {})).items()}
    return {name: " ".join([name, *_UNIT.findall(text)]) for name, text in about.items()}


def _named_gaits(fronts: pd.DataFrame, indicators: pd.DataFrame, parameters: Mapping[str, str]) -> Table:
    """The gaits at the named points of each front that consists of gaits."""
    rows = []
    for row in indicators.to_dict("records"):
        part = fronts[(fronts["space"] == row["space"]) & (fronts["front"] == row["front"])]
        for key, name in _NAMED.items():
            found = part[part["speed"] == row[f"{key}_speed"]].head(1)
            rows += [
                [f"{row['space']}, {row['front']}", name, *(f"{gait[one]:.2f}" for one in parameters), *_verified(gait)]
                for gait in found.to_dict("records")
            ]
    return Table(
        "The gaits at the named points; Δ is the difference between verifying and searching engine. † had not"
        " settled, or its velocity has no three clear peaks: measured over whole gait periods.",
        ["front", "point", *parameters.values(), "v [m/s]", *TAKEN.values()],
        rows,
    )


def _verified(row: dict[Any, Any]) -> list[str]:
    figures = [with_difference(row[name], row[f"{name}_searched"], "engine") for name in ("speed", "power")]
    settled, others = "" if row["steady"] else " †", [number(row[name]) for name in list(TAKEN)[1:]]
    return [figures[0] + settled, figures[1], *others]


def _beside_paper(fronts: pd.DataFrame, robot: Robot) -> Table | None:
    """The paper's policy, and our fronts at its power."""
    rows, spaces = [], fronts["space"].unique()
    for fluid, claim in paper.POLICY.items():
        power = claim.power(robot.total_mass)
        best = fastest_within(fronts[fronts["front"] == fluid], power, ["space"]).set_index("space")["speed"]
        ours = [f"{best[space]:.3f}" if space in best else "–" for space in spaces]
        if len(best):
            rows.append([fluid, f"{claim.speed:.2f} at {power:.1f}", f"{claim.cost_of_transport:.2f}", *ours])
    if not rows:
        return None
    return Table(
        "The paper says that its policy beats every front of fixed sinusoidal gaits, and prints no front. Its policy's"
        " speed [m/s] at power [W], from its cost of transport in its own simulator (diameter unknown: trends compare,"
        " digits do not), beside the highest speed of our fronts for that power.",
        ["fluid", "paper's policy", "its CoT", *(f"our front at that power, {space} space" for space in spaces)],
        rows,
    )


def _grids(growth: pd.DataFrame) -> dict[tuple[str, str], tuple[float, float]]:
    """Simulations of the whole grid and the hypervolume that it reached, by space and objective."""
    grid = growth[growth["method"] == "grid"]
    last = grid.drop_duplicates(["space", "objective"], keep="last")
    return {
        (row["space"], row["objective"]): (row["simulations"], row["hypervolume"]) for row in last.to_dict("records")
    }


def _at_a_tenth(growth: pd.DataFrame) -> pd.DataFrame:
    """Share of the grid's hypervolume that each NSGA-II search reached with a tenth of its simulations, and when 99 %.

    Columns: space, objective, seed, share, `simulations` until 99 % (NaN if never), and the grid's figures.
    """
    rows = []
    for (space, objective), (n, worth) in _grids(growth).items():
        searches = growth[(growth["space"] == space) & (growth["objective"] == objective)]
        for seed, part in searches[searches["method"] == "nsga2"].groupby("seed"):
            early = part[part["simulations"] <= n / 10]["hypervolume"].max()
            reached = part[part["hypervolume"] >= _GOAL * worth]["simulations"].min()
            about = {"space": space, "objective": objective, "seed": seed, "grid": f"{worth:.2f} in {n:.0f}"}
            rows.append(about | {"share": early / worth, "simulations": reached})
    return pd.DataFrame(rows)


def _searches(growth: pd.DataFrame) -> Table | None:
    shares = _at_a_tenth(growth)
    if not len(shares):
        return None
    return summary(
        "NSGA-II with a tenth of the grid's simulations: its share of the grid's hypervolume [%], every seed, mean,"
        " 95 % Student-t interval of the mean; and how many simulations it takes to 99 %, median of the seeds that get"
        " there.",
        shares.assign(share=100 * shares["share"]),
        {name: shares[name].unique() for name in ("space", "objective")},
        [
            ("grid: hypervolume, simulations", first("grid")),
            *over_seeds("share", "seeds", ".1f"),
            *(("n", size), ("99 % after", _reached)),
        ],
        head="space, front",
        label="{}, {}".format,
    )


def _reached(part: pd.DataFrame) -> str:
    """Simulations after which searches reached their goal, in the median of those that did."""
    known = part["simulations"].dropna()
    when = f"{known.median():.0f}" if len(known) else "never"
    return f"{when} ({len(known)} of {len(part)} seeds)"


def _fourier_indicators(directory: Path, config: dict[str, Any]) -> Iterator[pd.DataFrame]:
    """What the fronts of free waveforms are worth, if they are there and counted alike."""
    for other in counted_alike(directory, ["fourier"], config):
        table = read_table(other / "indicators.csv")
        yield table[table["front"].isin([*config["fluids"], *OVERALL])]
