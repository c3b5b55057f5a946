"""The page of the adaptation study: gaits over viscosity, and through fluids that change."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import paper
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.method_names import name_of
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.table import COSTS, POWERS, Table, every, failures, largest, mean, of_valid, share, size, summary
from snakebench.store import PAPER
from snakebench.studies.adaptation import figures
from snakebench.studies.published import Published

_ENDS = ("water", "oil2")  # of the paper's trend
_SPENT = ["distance", "speed", *POWERS]


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, tables = study.config, study.tables
    courses, steady = of_valid(tables["courses"]), of_valid(tables["steady"])
    switching, order = tables["switching"], list(courses["method"].unique())
    fine = _against_ideal(courses[courses["variant"] == "finer step"], switching)
    policies = [name for name in config["pilots"] if name in order]
    trend = _trend(steady, policies)
    compared = {"distance": "distance", "power": "P", "positive_power": "P+"}
    by = {"method": order, "course": config["courses"]}
    names = [name for name in config["courses"] if (fine["course"] == name).any()]
    return {
        "findings": {"trend": trend, "fine": fine},
        "swimmers": study.swimmers(
            {f"{on}-{name}": f"{on}: {name_of(name)}" for on, name in product(by["course"], order)}
        ),
        "over_viscosity": _over_viscosity(steady, policies),
        "trend": _trend_table(trend),
        "courses": {name: _course(study, name, fine[fine["course"] == name], policies) for name in names},
        "switching": summary(switching, {"course": config["courses"], "method": switching["method"].unique()}, _SPENT),
        "recoveries": _recoveries(tables["recoveries"], order),
        "engines": step_table(step_changes(courses, [*by, "seed"], compared, study.manifest), by),
        "failed": failures(fine),
        "n_swims": len(fine),
    }


def _against_ideal(fine: pd.DataFrame, switching: pd.DataFrame) -> pd.DataFrame:
    """Distances as shares: `of_own_ideal`, and `of_METHOD` of ideal switching between the gaits of a method."""
    fine = fine.assign(of_own_ideal=fine["distance"] / fine["ideal_distance"], stray=np.degrees(fine["stray"]))
    for method, part in switching.groupby("method", sort=False):
        fine[f"of_{method}"] = fine["distance"] / fine["course"].map(part.groupby("course")["distance"].mean())
    return fine


def _over_viscosity(steady: pd.DataFrame, policies: list[str]) -> str:
    over = steady[steady["fluid"].isna()].sort_values("viscosity", kind="stable")
    ends = steady.groupby("fluid")["viscosity"].first().reindex(_ENDS)
    trend = {column: (tuple(ends), values) for column, values in paper.TREND.items()} if ends.notna().all() else None
    return over_viscosity(over, policies, over[over["method"] == PAPER], trend)


def _trend(steady: pd.DataFrame, policies: list[str]) -> pd.DataFrame:
    """What changes between the ends of the paper's trend: columns method, figure, seed, water, oil2 and change."""
    swims = steady[steady["method"].isin(policies) & steady["fluid"].isin(_ENDS)]
    long = swims.melt(["method", "seed", "fluid"], list(paper.TREND), "figure")
    wide = long.pivot(index=["method", "figure", "seed"], columns="fluid", values="value").reindex(columns=list(_ENDS))
    return wide.assign(change=wide["oil2"] / wide["water"] - 1).reset_index()


def _trend_table(trend: pd.DataFrame) -> Table:
    papers = pd.DataFrame.from_dict(paper.TREND, "index", columns=list(_ENDS)).rename_axis("figure").reset_index()
    papers = papers.assign(method="paper's policy", change=papers["oil2"] / papers["water"] - 1)
    columns: list[Any] = [("n", size), *_ENDS, ("change [%]", share("change"))]
    return summary(pd.concat([trend, papers]), ["method", "figure"], columns)


def _course(study: Published, name: str, fine: pd.DataFrame, policies: list[str]) -> dict[str, Any]:
    settings, traces = study.config["courses"][name], study.tables["traces"]
    part = traces[traces["course"] == name]
    gaits = {method: name_of(method) for method in fine["method"].unique() if method not in policies}
    switched = study.tables["switching"]["method"].unique()
    shares = [("of own ideal [%]", share("of_own_ideal"))]
    shares += [(f"of ideal switching, {name_of(method)}s [%]", share(f"of_{method}")) for method in switched]
    columns: list[Any] = [("n", size), *_SPENT, *COSTS, *shares, ("largest deviation [°]", largest("stray", ".0f"))]
    return {
        "settings": settings,
        "figure": figures.course(name, settings["along"], part, policies, gaits) if len(part) else None,
        "table": summary(fine, ["method"], columns),
    }


def _recoveries(recoveries: pd.DataFrame, order: list[str]) -> Table:
    sudden = [f"{row['from']} to {row['to']} at {row['time']:g} s" for row in recoveries.to_dict("records")]
    table = recoveries.assign(change=np.array(sudden, object))
    by = {"course": list(table["course"].unique()), "change": list(table["change"].unique()), "method": order}
    columns = [
        ("n", size),
        ("steady v [m/s]", mean("steady_speed")),
        ("seconds", mean("seconds", 2)),
        ("each", every("seconds")),
        ("never", lambda part: str(part["seconds"].isna().sum())),
        ("within 5 % [% of periods]", share("held", 0)),
    ]
    return summary(table, by, columns)
