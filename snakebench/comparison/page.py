"""The index page: the answer, the claims, and every comparison, each number with where it comes from."""

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.collocation.front import under_first_bounds
from snakebench.comparison import figures
from snakebench.comparison.claims import CLAIMS, claims, markdown
from snakebench.comparison.gain_ledger import EQUAL, VIEWS, ledger, ledger_table, orders, orders_table
from snakebench.comparison.judges import mean_return
from snakebench.comparison.results import Measurement, Missing, Results
from snakebench.manifest import command_of, read_manifest
from snakebench.names import CURRENCIES, PAPER, STUDIES
from snakebench.report.animation import lane
from snakebench.report.assumptions import ledger as assumption_ledger
from snakebench.report.figure_style import packed
from snakebench.report.front_figure import fronts
from snakebench.report.table import CURRENCY_LABELS, Table, name_of
from snakebench.studies.adaptation.figures import course as course_figure
from snakebench.studies.cross.page import matrices
from snakebench.studies.front_comparison import compared
from snakebench.studies.limit_shares import ALLOWED_POWERS, shares_at
from snakebench.studies.published_fronts import OVERALL, same_settings, single_points, standings, with_limit
from snakebench.tables import table_text

_RACE = 20.0  # length of the race [s]
_NEAR_LIMIT = {  # policies with a preference: study, name and the power that their price is of
    ("learned_front", "student", "net"): "preference-conditioned student",
    ("imitation", "imitator", "net"): "imitator of the limit's gaits of P",
    ("imitation", "imitator_positive", "positive"): "imitator of the limit's gaits of P+",
    ("gain_schedule", "schedule", "net"): "gain schedule of the limit's gaits of P",
    ("gain_schedule", "schedule_positive", "positive"): "gain schedule of the limit's gaits of P+",
}


def index_sections(root: Path, problems: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The comparisons of all results in a directory, None where some are missing, as the index page shows them.

    `problems` are of results that are not there, by study.
    """
    results = Results(root, problems)
    judged, missing = claims(results)
    sections: dict[str, Any] = {"claims": judged, "claim_pages": {id: text["page"] for id, text in CLAIMS.items()}}
    for name, section in _SECTIONS.items():
        try:
            sections[name] = section(results)
        except Missing as error:
            sections[name] = None
            missing.append(str(error))
    gains, changing = sections["gains"], sections["changing"]
    findings = {
        "numbers": pd.DataFrame([one.row() for one in results.measurements]).drop_duplicates(ignore_index=True),
        "ledger": gains["ledger"] if gains else pd.DataFrame(),
        "recoveries": changing["recoveries"] if changing else pd.DataFrame(),
        "claims": pd.DataFrame({"verdict": [claim.verdict for claim in judged.values()]}),
    }
    return sections | {
        "missing": list(dict.fromkeys(missing)),
        "findings": findings,
        "verdicts": Counter(findings["claims"]["verdict"]),
        "downloads": [
            {"name": f"{name}.csv", "link": packed(table_text(findings[name]).encode())}
            for name in ("numbers", "ledger")
            if len(findings[name])
        ],
        "studies": [_origin_of(results, name) for name in STUDIES],
    }


def index_page(root: Path, pages: dict[str, str], problems: dict[str, str], sections: dict[str, Any]) -> dict[str, Any]:
    """Everything the index page of the results in a directory shows.

    `pages` were made from them, and `problems` kept others from being made, both by the name of the results' directory;
    `sections` are those of `index_sections`.
    """
    benchmark = not pages or any(name.partition("-")[0] in STUDIES for name in (*pages, *problems))
    rows = sections["studies"] if benchmark else []
    listed = {row["study"] for row in rows} | {"bench"}  # which is of this machine, and no study
    rows = rows + [_origin(root / name) for name in sorted(pages) if name not in listed]
    return {
        **sections,
        "benchmark": benchmark,  # whether these are results of the studies that the comparison is made of
        "pages": pages,
        "studies": [row | {"page": pages.get(row["study"])} for row in rows],
        "simulations": sum(row["manifest"]["evaluations"] for row in rows if row["manifest"]),
        "made_by": "snakebench report",
    }


INDEX_FILES = ("claims.md", "fronts.svg", "ledger.svg")


def index_files(content: Mapping[str, Any]) -> dict[str, str]:
    """Which of `INDEX_FILES` are written beside the index page, for a README to show: what there are results of."""
    files = {"claims.md": markdown([*content["claims"].values()])} if content["claims"] else {}
    for name, section, figure in (("fronts.svg", "fronts", "by_fluid"), ("ledger.svg", "gains", "waterfall")):
        if content[section]:
            files[name] = str(content[section][figure]).partition("</svg>")[0] + "</svg>\n"
    return files


def _gains(results: Results) -> dict[str, Any]:
    found, either = ledger(results), orders(results)
    return {
        "ledger": found.drop(columns="measured"),
        "equal_power": EQUAL,
        "seeds": dict(zip(found["step"], found["n"], strict=True)),
        "waterfall": figures.waterfall(found),
        "tables": {label: ledger_table(found[found["view"] == view]) for view, label in VIEWS.items()},
        "orders": {VIEWS[str(view)]: orders_table(part) for view, part in either.groupby("view", sort=False)},
    }


def _fronts(results: Results) -> dict[str, Any]:
    """The two Pareto figures with everything in them, and how the fronts compare."""
    study = results.study("learned_front")
    points, worth, fixed = standings(study)
    marks, fluids = single_points(study), study.config["fluids"]
    overall = [name for name in OVERALL if name in set(points["front"])]
    chosen = dict.fromkeys(CURRENCIES, "student")
    return compared(points, worth, fixed, chosen, {"student": "teacher"}, study.weight) | {
        "by_fluid": fronts(with_limit(points, study), marks, fluids, "Speed against power in each fluid, everything"),
        "overall": overall and fronts(points, marks, overall, "Speed against power over all fluids, everything"),
        "reference": study.config["reference"],
    }


def _of_limit(results: Results) -> Table:
    """Speeds of policies with a preference as shares of the limit of the body at equal power [%], by seed."""
    found, rows = results.study("limit"), list[list[str]]()
    limit = under_first_bounds(found.tables["limit"], found.config)
    for (study, method, currency), fluid in product(_NEAR_LIMIT, results.fluids):
        front = results.rows(study, "fronts", front=fluid, currency=currency)
        if not same_settings(front.study, found):
            raise Missing(f"limit: {study} is of another robot")
        own = front.frame.query("method == @method").assign(fluid=fluid, is_front=True)
        reached = shares_at(limit[limit["currency"] == currency], own).pivot(
            index="seed", columns="allowed", values="share"
        )
        p, cells = CURRENCY_LABELS[currency], []
        for power in ALLOWED_POWERS:
            shares = reached.get(power, pd.Series(dtype=float)).reindex(own["seed"].unique())
            what = f"method = {method}: speed at {power:g} W of {p} over that of the limit"
            id = f"{method}/{fluid}/share of the limit at {power:g} W of {p}"
            cells.append("–" if shares.isna().any() else front.measure(id, "%", 100 * shares, what).text(0))
        rows.append([f"{_NEAR_LIMIT[study, method, currency]}, {fluid}", p, *cells])
    return Table(["policy, fluid", "power counted", *(f"{power:g} W" for power in ALLOWED_POWERS)], rows)


def _changing(results: Results) -> dict[str, Any]:
    """The first course through a changing fluid: every seed of the policy, and gaits that are one for all fluids."""
    config, tables = results.study("adaptation").config, results.study("adaptation").tables
    recoveries = tables["recoveries"]
    name, course = next(iter(config["courses"].items()))
    traces = results.rows("adaptation", "traces", course=name).frame
    gaits = {method: name_of(method) for method in traces["method"].unique() if method not in config["pilots"]}
    return {
        "figure": course_figure(name, course["along"], traces, config["pilots"][:1], gaits),
        "recoveries": recoveries[recoveries["method"] == "student"],
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


def _assumptions(results: Results) -> list[dict[str, str]]:
    """Every assumption of the learned policies with its effect, as far as a study has measured it."""
    found = []
    for id, assumption in assumption_ledger(results.study("teacher_student").config).items():
        effects = []
        for effect in _EFFECTS.get(id, ()):
            with suppress(Missing):
                effects.append(effect(results))
        found.append(assumption | {"effect": "; ".join(effects)})
    return found


def _same_student(results: Results, fluid: str, robot: str = "default", rate: int = 960) -> Measurement:
    """The speed of the published student, on a robot at a rate of PyBullet."""
    where = {"physics_rate": rate, "method": "student", "robot": robot, "fluid": fluid, "engine": "pybullet"}
    id = f"student/{fluid}/speed, {robot} robot, {rate} Hz"
    return results.rows("sensitivity", "swims", **where).measure(id, "m/s", "speed")


def _trained(results: Results, fluid: str, policy: str = "student") -> Measurement:
    """The speed of a policy trained otherwise, or of the usual student, at the same rate of PyBullet."""
    if policy == "student":
        return _same_student(results, fluid)
    return results.policy("speed", fluid, policy, "relearned")


def _changes(results: Results, what: str, speed: Callable[..., Measurement], digits: int = 0, **assumption: Any) -> str:
    """How much a speed in each fluid changes with an assumption."""
    pairs = {fluid: (speed(results, fluid, **assumption), speed(results, fluid)) for fluid in results.fluids}
    changes = [f"{fluid} {100 * (new.mean / usual.mean - 1):+.{digits}f}" for fluid, (new, usual) in pairs.items()]
    new, usual = next(iter(pairs.values()))
    return f"{what}, change of v [%]: {', '.join(changes)} (n = {new.n} and {usual.n})"


def _returns(results: Results, policy: str, usual: str) -> str:
    """The return of policies that learned under another assumption beside that of the usual ones."""
    new, old = mean_return(results, policy), mean_return(results, usual)
    numbers = f"{new.text(1)} against {old.text(1)} (n = {new.n} and {old.n})"
    return f"return, {name_of(policy)} against {name_of(usual)}: {numbers}"


def _origin_of(results: Results, study: str) -> dict[str, Any]:
    try:
        return _origin(results.study(study).directory)
    except Missing as error:
        return {"study": study, "command": command_of(study), "manifest": None, "missing": str(error)}


def _origin(directory: Path) -> dict[str, Any]:
    manifest = read_manifest(directory)
    return {"study": directory.name, "command": command_of(directory.name, manifest), "manifest": manifest}


_EFFECTS: dict[str, tuple[Callable[[Results], str], ...]] = {
    "diameter": (
        partial(_changes, speed=_same_student, what="same student at 0.0686 m", robot="slim"),
        partial(_changes, speed=_trained, what="student trained at 0.0686 m", policy="student_slim"),
    ),
    "rates": (
        partial(_changes, speed=_same_student, what="same student at 1920 Hz", rate=1920, digits=1),
        partial(_changes, speed=_trained, what="student trained at 15 Hz control", policy="student_15Hz"),
        partial(_changes, speed=_trained, what="at 60 Hz", policy="student_60Hz"),
    ),
    "limits": (partial(_returns, policy="limited_student", usual="student"),),
    "ppo": (
        partial(_returns, policy="symmetric_short", usual="symmetric"),
        partial(_returns, policy="teacher_short", usual="teacher"),
    ),
    "distillation": (partial(_returns, policy="literal_student", usual="student"),),
}

_SECTIONS: dict[str, Callable[[Results], Any]] = {
    "fronts": _fronts,
    "of_limit": _of_limit,
    "gains": _gains,
    "cross": lambda results: matrices(results.study("cross")),
    "changing": _changing,
    "race_lanes": _race,
    "assumptions": _assumptions,
}
