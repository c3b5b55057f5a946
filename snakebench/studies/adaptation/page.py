"""What the adaptation page shows: gaits over viscosity and through fluids that change, to sentences and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import paper
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of_comparison
from snakebench.report.measurements import of, paid, readable
from snakebench.report.method_names import name_of
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.summary import mean, mean_share, percent, size, step_and_engine, summary
from snakebench.report.tables import TAKEN, Table, averaged, downloads, failures, in_both_currencies, number
from snakebench.store import INTEGRATED, PAPER
from snakebench.studies.adaptation import figures
from snakebench.tables import read_table, table_file
from snakebench.trajectory import Trajectory

_SHAPES = {"swim_frequency": ("frequency", "Hz"), "tail_amplitude": ("tail amplitude", "m")} | {
    "torque_amplitude": ("torque amplitude", "N m")
}
_ENDS = ("water", "oil2")  # of the paper's trend
_TABLES = ("courses", "steady", "recoveries", "switching")


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the adaptation page shows."""
    config = manifest["config"]
    tables = {name: _read(directory, name) for name in (*_TABLES, "traces")}
    courses, steady = readable(tables["courses"]), readable(tables["steady"])
    tables |= {"courses": courses, "steady": steady}
    order = list(dict.fromkeys(courses["method"]))
    policies = [name for name in config["pilots"] if name in order]
    chosen = (policies or order)[0]
    fine = courses[courses["variant"] == "finer step"]
    return {
        "manifest": manifest,
        "config": config,
        "answers": list(_answers(tables, chosen, config)),
        "swimmers": list(_swimmers(directory, config, order)),
        "over_viscosity": _over_viscosity(steady, policies),
        "trend": _trend(steady, policies),
        "courses": [_course(name, config, tables, fine, policies, order) for name in config["courses"]],
        "switching": _switching(fine, tables["switching"], order, list(config["courses"])),
        "recoveries": _recoveries(tables["recoveries"], order) if len(tables["recoveries"]) else None,
        "engines": _engines(courses, order, manifest),
        "failed": failures(fine),
        "n_swims": len(fine),
        "downloads": downloads(
            directory, *(name for name in (*_TABLES, "contenders") if table_file(directory / f"{name}.csv").exists())
        ),
        "assumptions": assumptions_of_comparison(config),
    }


def _read(directory: Path, name: str) -> pd.DataFrame:
    """A table of the study; an empty one where there was nothing to tell."""
    columns = {
        "recoveries": ["course", "method", "seed", "time", "from", "to", "steady_speed", "seconds", "held"],
        "switching": ["course", "method", "distance", "speed", *TAKEN],
        "traces": ["course", "method", "seed", "time", "x", "viscosity", "speed", *TAKEN],
    }
    if name in columns and not table_file(directory / f"{name}.csv").exists():
        return pd.DataFrame(columns=columns[name])
    table = read_table(directory / f"{name}.csv")
    return table if name == "recoveries" else in_both_currencies(table)


def _answers(tables: Mapping[str, pd.DataFrame], chosen: str, config: dict[str, Any]) -> Iterator[str]:
    """The findings, a sentence each."""
    ends = _at_ends(tables["steady"], chosen)
    if ends is not None:
        n = len(ends[0])
        trends = [
            f"{name} from {number(ends[0][column].mean())} to {number(ends[1][column].mean())} {unit} (paper:"
            f" {paper.trend(column)})"
            for column, (name, unit) in _SHAPES.items()
        ]
        yield (
            f"From {_ENDS[0]} to {_ENDS[1]} the {name_of(chosen)} changes its {trends[0]}, its {trends[1]} and its"
            f" {trends[2]}; mean of {n} seed{'s' if n > 1 else ''}."
        )
    yield from _recovery_answers(tables["recoveries"], chosen)
    fine = tables["courses"][tables["courses"]["variant"] == "finer step"]
    for course in config["courses"]:
        part = fine[(fine["course"] == course) & (fine["method"] == chosen)]
        switched = tables["switching"][tables["switching"]["course"] == course]
        beside = [
            f"{percent(part['distance'] / row['distance'].mean(), 0)} % of ideal switching between gaits of the"
            f" {name_of(str(method))} ({paid(row)})"
            for method, row in switched.groupby("method", sort=False)
        ]
        if len(part):
            yield (
                f"Through the course {course} the {name_of(chosen)} swims {averaged(part['distance'], 1)} m at"
                f" {paid(part)}: {percent(part['distance'] / part['ideal_distance'])} % of what it"
                f" would without delay{''.join(f', {text}' for text in beside)}."
            )


def _recovery_answers(recoveries: pd.DataFrame, chosen: str) -> Iterator[str]:
    """How soon the policy is back after the sudden changes."""
    own = recoveries[recoveries["method"] == chosen]
    for (before, after), part in own.groupby(["from", "to"], sort=False):
        lost = int(part["seconds"].isna().sum())
        never = f"; {lost} of {len(part)} not at all" if lost else ""
        worst = f", at worst {number(part['seconds'].max())} s" if len(part) > 1 else ""
        yield (
            f"When {before} suddenly becomes {after}, the {name_of(chosen)} is back within 5 % of its steady speed"
            f" after {number(part['seconds'].mean())} s{worst}{never}, and is there"
            f" {100 * part['held'].mean():.0f} % of the time."
        )


def _at_ends(steady: pd.DataFrame, policy: str) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """The steady swims of a policy where the paper's trend begins and ends."""
    thin, thick = (steady[(steady["method"] == policy) & (steady["fluid"] == fluid)] for fluid in _ENDS)
    return (thin, thick) if len(thin) and len(thick) else None


def _over_viscosity(steady: pd.DataFrame, policies: Sequence[str]) -> str:
    over = steady[steady["fluid"].isna()].sort_values("viscosity", kind="stable")
    named = steady.dropna(subset="fluid").groupby("fluid")["viscosity"].first()
    ends = (float(named[_ENDS[0]]), float(named[_ENDS[1]])) if set(_ENDS) <= set(named.index) else None
    trend = {column: (ends, values) for column, values in paper.TREND.items()} if ends else None
    return over_viscosity(over, policies, over[over["method"] == PAPER], trend)


def _trend(steady: pd.DataFrame, policies: Sequence[str]) -> Table | None:
    """What changes between the ends of the paper's trend."""
    parts = []
    for policy in policies:
        if ends := _at_ends(steady, policy):
            for column, (name, unit) in _SHAPES.items():
                thin, thick = (part.set_index("seed")[column] for part in ends)
                both = pd.DataFrame({"thin": thin, "thick": thick, "change": thick / thin - 1})
                parts.append(both.assign(row=f"{name_of(policy)}, {name} [{unit}]"))
    if not parts:
        return None
    table = pd.concat(parts)
    caption = (
        "What the gaits do in two fluids, and the change between them [%]: mean over the seeds ± half its 95 %"
        " interval."
    )
    columns = [("n", size), *zip(_ENDS, (mean("thin"), mean("thick")), strict=True), ("change", mean_share("change"))]
    ours = summary(caption, table, {"row": table["row"].unique()}, columns, head="", label=str)
    return ours._replace(rows=ours.rows + list(_papers_trend()))


def _papers_trend() -> Iterator[list[str]]:
    for column, (low, high) in paper.TREND.items():
        name, unit = _SHAPES[column]
        yield [f"paper's policy, {name} [{unit}]", "", f"{low:g}", f"{high:g}", f"{100 * (high / low - 1):.1f}"]


def _course(
    name: str,
    config: dict[str, Any],
    tables: Mapping[str, pd.DataFrame],
    fine: pd.DataFrame,
    policies: Sequence[str],
    order: Sequence[str],
) -> dict[str, Any]:
    """A course: what it is in words, its figure and what everything reaches."""
    settings, traces = config["courses"][name], tables["traces"]
    unit = "s" if settings["along"] == "time" else "m"
    knots = zip(settings["fluids"], settings["knots"], strict=True)
    stations = ", ".join(f"{fluid} {'at' if k else 'from'} {knot:g} {unit}" for k, (fluid, knot) in enumerate(knots))
    part = traces[traces["course"] == name]
    gaits = {method: name_of(method) for method in order if method not in policies}
    return {
        "name": name,
        "about": f"{'Suddenly' if settings['between'] == 'step' else 'Gradually'} {stations};"
        f" {settings['duration']:g} s.",
        "figure": figures.course(name, settings["along"], part, policies, gaits) if len(part) else None,
        "table": _reached(name, fine[fine["course"] == name], order),
    }


def _reached(course: str, fine: pd.DataFrame, order: Sequence[str]) -> Table:
    swims = fine.assign(share=fine["distance"] / fine["ideal_distance"], stray=np.degrees(fine["stray"]))
    swims["who"] = swims["method"].map({name: _who(str(name), part) for name, part in swims.groupby("method")})
    taken = [(head.removesuffix(" [W]"), mean(name, 1 if "[W]" in head else 3)) for name, head in TAKEN.items()]
    return summary(
        f"The course {course}, from rest: distance along x [m], mean speed [m/s] and powers [W], costs of transport,"
        " and the distance as a share of its own ideal, which is at every moment at its steady speed [%]: mean over the"
        " seeds ± half its 95 % interval; and the largest angle between x and the direction of travel over 5 s, of the"
        " worst seed.",
        swims,
        {"who": [_who(name, part) for name in order if len(part := swims[swims["method"] == name])]},
        [
            *(("n", size), ("distance", mean("distance", 1)), ("v", mean("speed")), *taken),
            ("of own ideal", mean_share("share")),
            ("strays", lambda part: f"{part['stray'].max():.0f}°"),
        ],
        head="",
        label=str,
    )


def _who(method: str, part: pd.DataFrame) -> str:
    return f"{name_of(method)}, one for all fluids" if (part["tuned_to"] == INTEGRATED).all() else name_of(method)


def _switching(
    fine: pd.DataFrame, switching: pd.DataFrame, order: Sequence[str], courses: Sequence[str]
) -> Table | None:
    """Distances as shares of those of ideal switching."""
    kinds, rows = list(dict.fromkeys(switching["method"])), []
    ideal = switching.set_index(["course", "method"])
    for course in courses:
        best = [of(ideal, course=course, method=kind) for kind in kinds]
        itself = [
            f"{averaged(row['distance'], 1)} m at {averaged(row['power'], 1)} / {averaged(row['positive_power'], 1)} W"
            for row in best
        ]
        rows.append([f"{course}: ideal switching", *itself])
        for method in order:
            part = fine[(fine["course"] == course) & (fine["method"] == method)].set_index("seed")
            if len(part):
                shares = [percent(part["distance"] / row["distance"].mean()) if len(row) else "–" for row in best]
                rows.append([f"{course}: {_who(method, part)}", *shares])
    caption = (
        "Distance as a share of ideal switching, at once and without cost, to the fastest of the gaits of a kind that"
        " are tuned to a fluid [%], whatever power they take; of ideal switching itself the distance, at P / P+."
    )
    return Table(caption, ["course", *map(name_of, kinds)], rows) if kinds else None


def _recoveries(recoveries: pd.DataFrame, order: Sequence[str]) -> Table:
    """How soon everything is back at its own steady speed, and whether it stays."""
    named = [
        f"{one['course']}, {one['time']:g} s, {one['from']} to {one['to']}" for one in recoveries.to_dict("records")
    ]
    return summary(
        "Steady speed in the new fluid [m/s]; seconds until a swimmer is back within 5 % of it and stays for 5 s: mean"
        " over the seeds ± half its 95 % interval, the worst, and each; and the share of the gait periods from the"
        " change to the next one that are within 5 % [%].",
        recoveries.assign(change=named),
        {"change": dict.fromkeys(named), "method": order},
        [
            *(("n", size), ("steady v", mean("steady_speed")), ("seconds", mean("seconds", 2))),
            ("worst", lambda part: "never" if part["seconds"].isna().any() else number(part["seconds"].max())),
            ("each", lambda part: ", ".join(map(number, part["seconds"]))),
            ("held", mean_share("held", digits=0)),
        ],
        head="change",
        label=lambda change, method: f"{change}: {name_of(method)}",
    )


def _engines(courses: pd.DataFrame, order: Sequence[str], manifest: dict[str, Any]) -> Table:
    figures = {"distance": "distance", "power": "P", "positive_power": "P+"}
    by = {"method": order, "course": manifest["config"]["courses"]}
    return step_and_engine(courses, by, ["seed"], figures, manifest, ", of the seeds")


def _swimmers(directory: Path, config: dict[str, Any], order: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The runs that are there."""
    for course in config["courses"]:
        for method in order:
            if (path := directory / "trajectories" / f"{course}-{method}.npz").exists():
                yield swimmer(f"{course}: {name_of(method)}", Trajectory.load(path))
