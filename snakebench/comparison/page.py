"""The index page: the answer, the claims, and every comparison, each number with where it comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.comparison import figures
from snakebench.comparison.assumption_effects import assumptions_with_effects
from snakebench.comparison.claims import claims, markdown, texts
from snakebench.comparison.gain_ledger import EQUAL, VIEWS, ledger, ledger_rows, ledger_tables
from snakebench.comparison.results import Missing, Results
from snakebench.metrics import GRAVITY
from snakebench.report.animation import lane
from snakebench.report.downloads import data_link
from snakebench.report.equal_power import speeds_within
from snakebench.report.front_figure import fronts
from snakebench.report.method_names import name_of
from snakebench.report.table import Column, Table, size, summary
from snakebench.robot import Robot
from snakebench.store import PAPER, STUDIES, command_of, read_manifest
from snakebench.studies.adaptation.figures import course as course_figure
from snakebench.studies.cross.page import matrices
from snakebench.studies.learned_front.page import compared
from snakebench.studies.published_fronts import OVERALL, single_points, standings

_RACE = 20.0  # length of the race [s]


class Sections(NamedTuple):
    """What the index page compares."""

    content: dict[str, Any]  # by section; None where results are missing
    missing: list[str]  # results, a line each
    numbers: pd.DataFrame  # that were measured
    origins: list[dict[str, Any]]  # of the studies that are compared: command and manifest, or what is wrong


def index_sections(root: Path, problems: Mapping[str, str] | None = None) -> Sections:
    """The comparisons of all results in a directory; `problems` are of those that are not there, by study."""
    results = Results(root, problems)
    judged, missing = claims(results)
    content: dict[str, Any] = {"claims": judged, "claim_pages": {id: text["page"] for id, text in texts().items()}}
    for name, section in _SECTIONS.items():
        try:
            content[name] = section(results)
        except Missing as error:
            content[name] = None
            missing.append(str(error))
    numbers = pd.DataFrame([one.row() for one in results.measurements]).drop_duplicates(ignore_index=True)
    return Sections(content, list(dict.fromkeys(missing)), numbers, [_origin_of(results, name) for name in STUDIES])


def index_page(
    root: Path, pages: Mapping[str, str], problems: Mapping[str, str] | None = None, sections: Sections | None = None
) -> dict[str, Any]:
    """Everything the index page shows.

    Args:
        root: the directory of all results.
        pages: the pages made from them, by the name of the results' directory.
        problems: what is wrong with results that are not there, likewise.
        sections: the comparisons, if they were made before.
    """
    content, missing, numbers, origins = sections or index_sections(root, problems)
    benchmark = not pages or any(name.partition("-")[0] in STUDIES for name in (*pages, *(problems or {})))
    rows = origins if benchmark else []
    listed = {row["study"] for row in rows} | {"bench"}  # which is of this machine, and no study
    rows = rows + [_origin(root / name) for name in sorted(pages) if name not in listed]
    studies = [row | {"page": pages.get(row["study"])} for row in rows]
    verdicts = [claim.verdict for claim in content["claims"].values()]
    gains, changing, nothing = content["gains"], content["changing"], pd.DataFrame()
    tables = {"numbers": numbers, "ledger": gains["rows"] if gains else nothing}
    return content | {
        "findings": {
            **tables,
            "recoveries": changing["recoveries"] if changing else nothing,
            "claims": pd.DataFrame({"verdict": verdicts}),
        },
        "benchmark": benchmark,  # whether these are results of the studies that the comparison is made of
        "verdicts": Counter(verdicts),
        "missing": missing,
        "pages": pages,
        "studies": studies,
        "simulations": sum(study["manifest"]["evaluations"] for study in studies if study["manifest"]),
        "downloads": [data_link(f"{name}.csv", table) for name, table in tables.items() if len(table)],
        "n_numbers": len(numbers),
        "made_by": "snakebench report",
    }


def index_files(content: Mapping[str, Any]) -> dict[str, str]:
    """What is written beside the index page, for a README to show: the claims and two figures, where they are there."""
    files = {"claims.md": markdown([*content["claims"].values()])} if content["claims"] else {}
    for name, section, figure in (("fronts.svg", "fronts", "by_fluid"), ("ledger.svg", "gains", "waterfall")):
        if content[section]:
            files[name] = str(content[section][figure]).partition("</svg>")[0] + "</svg>\n"
    return files


def _gains(results: Results) -> dict[str, Any]:
    accounts = ledger(results)
    return {
        "rows": ledger_rows(accounts),
        "equal_power": EQUAL,
        "seeds": {step.id: step.speed.n for account in accounts for step in account.steps},
        "waterfall": figures.waterfall(accounts),
        "tables": {label: ledger_tables(accounts, view) for view, label in VIEWS.items()},
    }


def _fronts(results: Results) -> dict[str, Any]:
    """The two Pareto figures with everything in them, and how the fronts compare."""
    study = results.study("learned_front")
    points, worth, fixed = standings(study)
    marks, fluids = single_points(study), study.config["fluids"]
    overall = [name for name in OVERALL if name in set(points["front"])]
    weight = Robot(**study.config["robot"]).total_mass * GRAVITY
    return compared(points, worth, fixed, "student", "teacher", weight) | {
        "by_fluid": fronts(points, marks, fluids, "Speed against power in each fluid, everything"),
        "overall": fronts(points, marks, overall, "Speed against power over all fluids, everything"),
        "dominated": _dominated(points, fixed, [*fluids, *overall]),
        "reference": study.config["reference"],
    }


def _dominated(points: pd.DataFrame, methods: Sequence[str], names: Sequence[str]) -> Table:
    """Which part of each front of fixed gaits the student's fronts dominate: faster for no more power."""
    students, parts = dict(list(points[points["method"] == "student"].groupby("front"))), []
    for front, fixed in points[points["method"].isin(methods)].sort_values("power").groupby("front"):
        power, seeds = fixed["power"].to_numpy(), [seed for _, seed in students[front].groupby("seed")]
        share = np.mean([speeds_within(seed, power) > fixed["speed"] for seed in seeds], axis=0)  # of the seeds
        parts.append(fixed.assign(share=share, by_every_seed=fixed["power"].where(share == 1)))

    def span(part: pd.DataFrame) -> str:
        ends = part["by_every_seed"].agg(["min", "max"]).dropna()
        return " to ".join(dict.fromkeys(f"{power:.3g}" for power in ends)) or "–"

    columns: list[Column] = [
        ("points", size),
        ("dominated [%]", lambda part: f"{100 * part['share'].mean():.0f}"),
        ("by every seed, from and to P [W]", span),
    ]
    return summary(pd.concat(parts), {"front": names, "method": methods}, columns)


def _changing(results: Results) -> dict[str, Any]:
    """The first course through a changing fluid: every seed of the policy, and gaits that are one for all fluids."""
    config = results.study("adaptation").config
    name, course = next(iter(config["courses"].items()))
    traces = results.rows("adaptation", "traces", course=name).frame
    gaits = {method: name_of(method) for method in traces["method"].unique() if method not in config["pilots"]}
    return {
        "figure": course_figure(name, course["along"], traces, config["pilots"][:1], gaits),
        "recoveries": results.rows("adaptation", "recoveries", method="student").frame,
    }


def _race(results: Results) -> list[dict[str, Any]]:
    """The student and the best sinusoid of each fluid side by side, from rest."""
    study, lanes = results.study("cross"), []
    for fluid in study.config["fluids"]:
        for method, label in (("student", "student"), (PAPER, "best sinusoid")):
            if not (swim := study.swim(f"{method}-{fluid}")):
                raise Missing(f"cross: no swim {method}-{fluid}; {command_of('cross')} makes it")
            lanes.append(lane(label, fluid, swim, _RACE))
    return lanes


def _origin_of(results: Results, study: str) -> dict[str, Any]:
    """The origin of a study's results, or what is wrong with them."""
    try:
        return _origin(results.study(study).directory)
    except Missing as error:
        return {"study": study, "command": command_of(study), "manifest": None, "missing": str(error)}


def _origin(directory: Path) -> dict[str, Any]:
    manifest = read_manifest(directory)
    return {"study": directory.name, "command": command_of(directory.name, manifest), "manifest": manifest}


_SECTIONS: dict[str, Callable[[Results], Any]] = {
    "fronts": _fronts,
    "gains": _gains,
    "cross": lambda results: matrices(results.study("cross")),
    "changing": _changing,
    "race_lanes": _race,
    "assumptions": assumptions_with_effects,
}
