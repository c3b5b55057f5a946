"""The page of the adaptation study: gaits over viscosity, and through fluids that change."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.manifest import command_of
from snakebench.names import ADAPTIVE, CURRENCIES, PAPER
from snakebench.report import paper, table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.table import COSTS, CURRENCY_LABELS, POWERS, Table, mean, name_of, of_valid, share, size, summary
from snakebench.studies.adaptation import figures
from snakebench.studies.adaptation.controls import CONTENDER, compared, controls
from snakebench.studies.published import Published

_SPENT = ["distance", "speed", *POWERS]


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, tables = study.config, study.tables | {"courses": of_valid(study.tables["courses"])}
    courses, steady, switching = tables["courses"], of_valid(tables["steady"]), tables["switching"]
    swims = compared(tables)
    swims = swims.assign(of_own_ideal=swims["distance"] / swims["ideal_distance"], stray=np.degrees(swims["stray"]))
    policies = [name for name in config["pilots"] if (courses["method"] == name).any()]
    fine, single = swims[swims["tuned_to"] == ADAPTIVE], controls(swims, policies[0]) if policies else swims[:0]
    preferred = fine[~fine["method"].isin(policies)]
    shown, swim = pd.concat([fine, single]), ["course", *CONTENDER]
    methods = shown["method"].map(name_of)
    shown = shown.assign(swimmer=methods.where(shown["tuned_to"] == ADAPTIVE, "single " + methods))
    back = tables["recoveries"].merge(shown[[*swim, "swimmer"]].drop_duplicates(), on=swim)
    trend = _trend(steady, policies)
    found = {"distance": "distance", "power": "P", "positive_power": "P+"}
    by = {"method": list(courses["method"].unique()), "course": config["courses"]}
    names = [name for name in config["courses"] if (shown["course"] == name).any()]
    return {
        "findings": {"trend": trend, "fine": fine, "preferred": preferred, "recoveries": back},
        "swimmers": study.swimmers(
            {f"{on}-{name}": f"{on}: {name_of(name)}" for on, name in product(by["course"], by["method"])}
        ),
        "over_viscosity": _over_viscosity(steady, policies),
        "trend": _trend_table(trend),
        "courses": {name: _course(study, name, shown[shown["course"] == name], policies) for name in names},
        "equal_power": figures.at_equal_power(swims, tables["ideal"], policies) if len(swims) else None,
        "gains": _gains(shown, config["courses"]),
        "limit_missing": None if tables["ideal"].size else command_of(config.get("limit") or "limit"),
        "switching": summary(switching, {"course": config["courses"], "method": switching["method"].unique()}, _SPENT),
        "recoveries": _recoveries(back, list(shown["swimmer"].unique())),
        "worth": {currency: _worth(tables["worth"], currency) for currency in CURRENCIES},
        "engines": step_table(step_changes(courses, [*by, "seed", "gait"], found), by),
        **table.validity(steady),
        "failed_courses": table.failures(swims),
        "n_courses": len(swims),
    }


def _over_viscosity(steady: pd.DataFrame, policies: list[str]) -> str:
    over = steady[steady["fluid"].isna()].sort_values("viscosity", kind="stable")
    ends = steady.groupby("fluid")["viscosity"].first().reindex(paper.ENDS)
    trend = {column: (tuple(ends), values) for column, values in paper.TREND.items()} if ends.notna().all() else None
    return over_viscosity(over, policies, over[over["method"] == PAPER], trend)


def _trend(steady: pd.DataFrame, policies: list[str]) -> pd.DataFrame:
    """What changes between the ends of the paper's trend: columns method, figure, seed, water, oil2 and change."""
    swims = steady[steady["method"].isin(policies) & steady["fluid"].isin(paper.ENDS)]
    long = swims.melt(["method", "seed", "fluid"], list(paper.TREND), "figure")
    wide = long.pivot(index=["method", "figure", "seed"], columns="fluid", values="value").reindex(
        columns=list(paper.ENDS)
    )
    return wide.assign(change=wide["oil2"] / wide["water"] - 1).reset_index()


def _trend_table(trend: pd.DataFrame) -> Table:
    papers = pd.DataFrame.from_dict(paper.TREND, "index", columns=list(paper.ENDS)).rename_axis("figure").reset_index()
    papers = papers.assign(method=paper.NAME, change=papers["oil2"] / papers["water"] - 1)
    columns: list[Any] = [("n", size), *paper.ENDS, ("change [%]", share("change"))]
    return summary(pd.concat([trend, papers]), ["method", "figure"], columns)


def _course(study: Published, name: str, shown: pd.DataFrame, policies: list[str]) -> dict[str, Any]:
    settings, traces = study.config["courses"][name], study.tables["traces"]
    part = traces[traces["course"] == name]
    gaits = {method: name_of(method) for method in part["method"].unique() if method not in policies}
    own, stray = ("of own ideal [%]", share("of_own_ideal")), ("largest deviation [°]", table.largest("stray", ".0f"))
    columns: list[Any] = [("n", size), *_SPENT, *COSTS, own, stray]
    return {
        "settings": settings,
        "figure": figures.course(name, settings["along"], part, policies, gaits) if len(part) else None,
        "table": summary(shown, ["swimmer"], columns, head="swimmer"),
    }


def _gains(shown: pd.DataFrame, courses: Mapping[str, Any]) -> dict[str, Table]:
    """Per currency, policies and single gaits beside the best single gaits at the same mean power."""
    by = {"course": courses, "swimmer": shown["swimmer"].unique()}
    tables, methods = {}, shown.loc[shown["tuned_to"] != ADAPTIVE, "method"].unique()
    for currency, label in CURRENCY_LABELS.items():
        columns: list[Any] = [("n", size), "distance", (f"{label} [W]", mean(CURRENCIES[currency], 1))]
        columns += [
            ("gain over the best single gait [%]", share(f"gain_{currency}")),
            ("compared at [W]", mean(f"at_{currency}", 1)),
            ("of the limit [%]", share(f"of_limit_{currency}")),
        ]
        columns += [(f"single {name_of(one)} [m]", mean(f"single_{one}_{currency}", 1)) for one in methods]
        tables[label] = summary(shown, by, columns, head="course, swimmer")
    return tables


def _recoveries(recoveries: pd.DataFrame, order: list[str]) -> Table:
    sudden = [f"{row['from']} to {row['to']} at {row['time']:g} s" for row in recoveries.to_dict("records")]
    named = recoveries.assign(change=np.array(sudden, object))
    by: dict[str, Any] = {"course": named["course"].unique(), "change": named["change"].unique(), "swimmer": order}
    columns = [
        ("n", size),
        ("steady v [m/s]", mean("steady_speed")),
        ("seconds", mean("seconds", 2)),
        ("each", table.every("seconds")),
        ("never", lambda part: str(part["seconds"].isna().sum())),
        ("within 5 % [% of periods]", share("held", 0)),
        ("loss [m]", mean("loss", 2)),
    ]
    return summary(named, by, columns)


def _worth(worth: pd.DataFrame, currency: str) -> Table:
    """Gains of tuning to each fluid, a column for each power; a dash where one gait for all cannot use it."""
    rows = worth[worth["currency"] == currency]
    columns: list[Any] = [("gaits", table.first("gaits"))]
    columns += [(f"at {power:g} W [%]", table.at(share("gain"), power=power)) for power in rows["power"].unique()]
    return summary(rows, ["fluids", "diameter"], columns, head="fluids, diameter [m]")
