"""The page of studies of the fronts of fixed gaits: tables and figures of the fronts and of their searches."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from snakebench.names import FASTER, STRONGER
from snakebench.report import paper, table
from snakebench.report.equal_power import fastest_within
from snakebench.report.front_figure import fronts as draw_fronts
from snakebench.report.table import Cell, Column, Table, first, joined, name_of, summary
from snakebench.robot import Robot
from snakebench.studies.front_tables import FRONT, NAMED_POINTS, equal_power_table, front_label, front_table
from snakebench.studies.pareto import figures
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import (
    OVERALL,
    comparable,
    points_of,
    powers_compared,
    single_points,
    with_limit,
)

_UNIT = re.compile(r"\[.*\]$")  # at the end of a field's description
_GOALS = ["space", "objective", "currency"]
_SEARCH = [*_GOALS, "seed"]
_GOAL = 0.99  # share of the grid's hypervolume that a search should reach


def page(study: Published) -> dict[str, Any]:
    """What the page shows; fronts of free waveforms beside the results are shown as well."""
    config, robot = study.config, study.robot
    fronts, growth, attainment = (study.tables[name] for name in ("fronts", "growth", "attainment"))
    with_waveforms = [study, *comparable(study, ["fourier"])]
    points, singles = points_of(with_waveforms), single_points(study)
    overall = [name for name in OVERALL if name in set(points["front"])]
    worth = pd.concat([other.tables["indicators"] for other in with_waveforms], ignore_index=True)
    worth = worth[worth["front"].isin([*config["fluids"], *OVERALL])]
    by_grid = growth[growth["method"] == "grid"].groupby(_GOALS, sort=False)
    grids, labels = by_grid[["simulations", "hypervolume"]].last(), _labels(study.manifest)
    searches, of_power = _searches(growth, grids), fronts[fronts["currency"] == "net"]
    gaits = fronts.drop_duplicates(["space", "front", *labels])
    surfaces = _shown(attainment[attainment["currency"] == "net"])
    return {
        "findings": {"searches": searches},
        "ranges": {name_of(name): _range(space, labels) for name, space in config["spaces"].items()},
        "front_table": front_table(worth),
        "equal_power": equal_power_table(worth),
        "powers": [f"{power:g}" for power in powers_compared(worth)],
        "masses": [robot.total_mass, Robot().total_mass],
        "gaits": _named_gaits(of_power, study.tables["indicators"], labels),
        "paper": _beside_paper(of_power, robot) if config["gait"] == "sinusoidal-torque" else None,
        "searches": _search_table(searches),
        "singles": len(singles) > 0,
        "by_fluid": draw_fronts(
            with_limit(points, study), singles, config["fluids"], "Front of speed against power of each fluid"
        ),
        "overall": overall and draw_fronts(points, singles, overall, "Integrated and simple-sum front"),
        "growth": figures.growth(_shown(growth), grids) if len(_shown(growth)) else None,
        "attainment": figures.attainment(surfaces, fronts) if len(surfaces) else None,
        "parameters": figures.parameters(_shown(of_power), config["fluids"], labels) if len(_shown(of_power)) else None,
        "differences": figures.differences(study.tables["verified"]),
        "unsteady": int((~gaits["steady"]).sum()),
        "n_gaits": len(gaits),
    }


def _shown(table: pd.DataFrame) -> pd.DataFrame:
    """Without the spaces that are there only to tell apart what the wider range adds."""
    return table[~table["space"].isin([FASTER, STRONGER])]


def _range(space: Mapping[str, Sequence[float]], labels: Mapping[str, str]) -> str:
    """The bounds of a search space in words."""
    return ", ".join(f"{labels[name]} {low:.3g} to {high:.3g}" for name, (low, high) in space.items())


def _labels(manifest: Mapping[str, Any]) -> dict[str, str]:
    """The parameters searched, each with its unit."""
    return {name: " ".join([name, *_UNIT.findall(text or "")]) for name, text in manifest["parameters"].items()}


def _named_gaits(fronts: pd.DataFrame, indicators: pd.DataFrame, labels: Mapping[str, str]) -> Table:
    """The gaits at the named points of each of the fronts."""

    def by_engine(column: str) -> Cell:
        return lambda part: table.with_difference(part[column].iloc[0], part[f"{column}_searched"].iloc[0], "engine")

    named = [
        indicators[FRONT].assign(name=name, speed=indicators[f"{key}_speed"]) for key, name in NAMED_POINTS.items()
    ]
    gaits = pd.concat(named).merge(fronts, on=[*FRONT, "speed"])
    by = {name: gaits[name].unique() for name in FRONT} | {"name": NAMED_POINTS.values()}
    columns: list[Column] = [(label, first(name, ".2f")) for name, label in labels.items()]
    columns += table.under_labels(by_engine, ("speed", "power"))
    columns += table.under_labels(table.digits3, ("positive_power", *table.COSTS))
    columns += [("steady", table.yes_or_no("steady"))]

    def label(space: str, front: str, currency: str, name: str) -> str:
        return f"{front_label(space, front, currency)}: {name}"

    return summary(gaits, by, columns, head="front, point", label=label)


def _beside_paper(fronts: pd.DataFrame, robot: Robot) -> Table:
    rows = []
    for fluid, policy in paper.POLICY.items():
        power = policy.power(robot.total_mass)
        best = fastest_within(fronts[fronts["front"] == fluid], power, ["space"])
        rows.append(best.assign(policy=policy.speed, limit=power, policy_cost=policy.cost_of_transport))
    columns: list[Column] = [("policy: v [m/s]", first("policy", ".2f")), ("P [W]", first("limit", ".1f"))]
    columns += [("CoT", first("policy_cost", ".2f"))]
    columns += [("front: v [m/s]", first("speed", ".3f")), ("P [W]", first("power", ".1f"))]
    by = {name: fronts[name].unique() for name in ("space", "front")}
    return summary(pd.concat(rows), by, columns, label=joined)


def _searches(growth: pd.DataFrame, grids: pd.DataFrame) -> pd.DataFrame:
    """Each NSGA-II search beside the grid.

    `share` of the grid's hypervolume is reached with a tenth of its simulations [%], 99 % of it after `simulations`.
    """
    nsga2 = growth[growth["method"] == "nsga2"].merge(grids.add_prefix("grid_").reset_index())
    early = nsga2[nsga2["simulations"] <= nsga2["grid_simulations"] / 10].groupby(_SEARCH)["hypervolume"].max()
    reached = nsga2[nsga2["hypervolume"] >= _GOAL * nsga2["grid_hypervolume"]].groupby(_SEARCH)["simulations"].min()
    grid = nsga2.groupby(_SEARCH, sort=False)[["grid_simulations", "grid_hypervolume"]].first()
    return grid.assign(share=100 * early / grid["grid_hypervolume"], simulations=reached).reset_index()


def _search_table(searches: pd.DataFrame) -> Table:
    columns = [
        ("grid: hypervolume", first("grid_hypervolume", ".2f")),
        ("simulations", first("grid_simulations")),
        *table.over_seeds("share", "share of each seed [%]", ".1f"),
        ("simulations to 99 %", table.every("simulations", ".0f")),
    ]
    return summary(searches, _GOALS, columns, head="space, front", label=front_label)
