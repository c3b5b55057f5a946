"""The judges of the paper's claims: each measures from the published tables, and states which parts of a rule hold."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import pandas as pd

from snakebench.comparison.finding import Finding, Judge, Numbers, above, below
from snakebench.comparison.gain_ledger import front_rows
from snakebench.comparison.gait_judges import GAIT_JUDGES, TOP_SPEED
from snakebench.comparison.results import FINE, STUDENT, Measurement, Results, Rows
from snakebench.report.equal_power import fastest_within, speeds_within
from snakebench.report.method_names import METHOD_NAMES, name_of
from snakebench.report.table import COSTS, LABELS, POWERS
from snakebench.store import EXTENDED, INTEGRATED, PAPER, SIMPLE_SUM
from snakebench.studies.published_fronts import OVERALL, by_seed


def mean_return(results: Results, name: str) -> Measurement:
    """The return of policies of the paper's reward, by seed, averaged over the range of viscosities."""
    return results.rows("teacher_student", "range", policy=name).measure(f"{name}/return", "1", "return")


def _swims(results: Results, place: str, *, at_top: bool = False) -> tuple[Rows, pd.DataFrame]:
    """Rows of the student at the paper's power or at top speed, and its speed and power there by seed.

    Over all fluids they are means.
    """
    fluids = results.fluids if place in OVERALL else [place]
    top = ("teacher_student", "evaluations", {"policy": "student", **FINE})
    study, table, where = top if at_top else ("operating_point", "points", STUDENT)
    rows = results.rows(study, table, **where)
    return rows, rows.frame[rows.frame["fluid"].isin(fluids)].groupby("seed")[["speed", "power"]].mean()


def _gain(results: Results, place: str, space: str = PAPER, *, at_top: bool = False) -> Measurement:
    """How much faster the student is than a front of sinusoids, of a fluid or over all, at each seed's power [%]."""
    table, where = front_rows(place)
    points = results.rows("pareto", table, space=space, **where).frame
    rows, swims = _swims(results, place, at_top=at_top)
    gains = 100 * (swims["speed"] / speeds_within(points, swims["power"].to_numpy()) - 1)
    front = f"pareto/{table}, space = {space}" + (f", front = {place}" if where else "")
    fluids = ", ".join(results.fluids if place in OVERALL else [place])
    what = f"{fluids}: speed over the highest for at most its power in {front}, less 1"
    at = "" if at_top else " at the paper's power"
    return rows.measure(f"student/{place}/gain over {space}{at}", "%", gains, what)


def _gain_at_power(results: Results, fluid: str, power: float) -> Measurement:
    """How much faster the preference-conditioned student is than the paper's sinusoids, both at a power [%]."""
    points = results.rows("pareto", "fronts", space=PAPER, front=fluid).frame
    rows = results.rows("learned_front", "fronts", front=fluid)
    own = by_seed(rows.frame).query("method == 'student'")
    best = fastest_within(own, power, ["seed"]).set_index("seed")["speed"].sort_index()
    gains = 100 * (best / fastest_within(points, power)["speed"].max() - 1)
    what = f"space = student SEED: highest speed for at most {power:g} W over that of pareto/fronts, space = paper"
    return rows.measure(f"preference-conditioned student/{fluid}/gain over {PAPER} at {power:g} W", "%", gains, what)


def _beats_each_fluid(results: Results, text: Mapping[str, Any]) -> Finding:
    here = {fluid: _gain(results, fluid) for fluid in results.fluids}
    measured = {"faster at the paper's power (%)": (here, 0)}
    measured["than wider sinusoids"] = {fluid: _gain(results, fluid, EXTENDED) for fluid in results.fluids}, 0
    alike = {fluid: _gain_at_power(results, fluid, text["power"]) for fluid in results.fluids}
    measured[f"at {text['power']:g} W"] = alike, 0
    for label, space in ((TOP_SPEED, PAPER), (f"{TOP_SPEED}, than wider sinusoids", EXTENDED)):
        measured[label] = {fluid: _gain(results, fluid, space, at_top=True) for fluid in results.fluids}, 0
    return Finding(measured, [above(one, 0) for one in here.values()])


def _beats_overall(results: Results, _: Mapping[str, Any], front: str) -> Finding:
    here, top = (
        {name_of(space): _gain(results, front, space, at_top=at_top) for space in (PAPER, EXTENDED)}
        for at_top in (False, True)
    )
    measured = {"faster at the paper's power (%), than the": (here, 0), TOP_SPEED: (top, 0)}
    return Finding(measured, [above(here[name_of(PAPER)], 0)])


def _cheaper_than_switching(results: Results, text: Mapping[str, Any]) -> Finding:
    """Costs of transport over all fluids at equal power, and powers at equal mean speeds, over those of switching."""
    at_power = _cost_at_papers_power(results)
    measured = {"change of CoT at the paper's power (%)": ({"all fluids": at_power}, 0)}
    for label, column in zip(("P", "P+"), POWERS, strict=True):
        changes = _powers_at_speeds(results, text["speeds"], column)
        measured[f"change of {label} at equal mean speed (%)"] = changes, 0
    return Finding(measured, [below(at_power, 0)])


def _cost_at_papers_power(results: Results) -> Measurement:
    """P over v of the student, both means over the fluids, over that of the fastest switching for its power [%]."""
    rows, swims = _swims(results, SIMPLE_SUM)
    fixed = results.rows("pareto", "switching", space=PAPER).frame
    best = pd.concat({seed: fastest_within(fixed, power) for seed, power in swims["power"].items()}).droplevel(1)
    change = 100 * (swims["power"] / swims["speed"] / (best["power"] / best["speed"]) - 1)
    what = "P / v, means over the fluids, over that of the fastest of pareto/switching, space = paper, for its power"
    return rows.measure("student/simple-sum/CoT at the paper's power", "%", change, what)


def _powers_at_speeds(results: Results, speeds: list[float], column: str) -> Numbers:
    """Change of a power from ideal switching to the student, each of its least P for a mean speed [%]."""
    rows, fixed = results.rows("learned_front", "switching"), results.rows("pareto", "switching", space=PAPER).frame
    own, changes = by_seed(rows.frame).query("method == 'student'"), Numbers()
    for speed in (speed for speed in speeds if speed <= fixed["speed"].max()):
        students, gait = (
            points[points["speed"] >= speed].sort_values("power", kind="stable") for points in (own, fixed)
        )
        power = students.drop_duplicates("seed").set_index("seed").sort_index()[column] / gait[column].iloc[0]
        if column == "power" or power.notna().any():  # P+ is not in the results of version 1.0
            what = f"{column} of the least power for at least {speed:g} m/s over that of pareto/switching"
            id = f"preference-conditioned student/simple-sum/{column} at {speed:g} m/s"
            changes[f"at {speed:g} m/s"] = rows.measure(id, "%", 100 * (power - 1), f"space = student SEED: {what}")
    return changes


def _sea_snake(results: Results, _: Mapping[str, Any]) -> Finding:
    """Figures of the policy as multiples of those of the sea snake tuned to each fluid."""
    labels = {"speed": "v, ratio", **{cost: f"{LABELS[cost]}, ratio" for cost in COSTS}}
    here = {label: _over_sea_snake(results, name, results.at_papers_power(name)) for name, label in labels.items()}
    top = {
        f"{TOP_SPEED}, {label}": _over_sea_snake(results, name, results.in_fluids(name))
        for name, label in labels.items()
    }
    judged = [ratio for name in ("speed", COSTS[0]) for ratio in here[labels[name]].values()]
    measured = {label: (ratios, 1) for label, ratios in (here | top).items()}
    return Finding(measured, [above(ratio, 1) for ratio in judged])


def _over_sea_snake(results: Results, column: str, own: Numbers) -> Numbers:
    ratios = Numbers()
    for fluid, number in own.items():
        rows = results.rows("sea_snake", "optima", objective=fluid, fluid=fluid, **FINE)
        gait = rows.measure(f"sea snake/{fluid}/{column}", "", column)
        ratios[fluid] = number._replace(values=tuple(value / gait.mean for value in number.values), unit="1")
    return ratios


def _privilege(results: Results, text: Mapping[str, Any]) -> Finding:
    known = results.study("teacher_student").tables["range"]["policy"].unique()
    names = ["teacher", "symmetric", *(name for name in known if name.startswith("symmetric_short"))]
    returns = {name_of(name): mean_return(results, name) for name in names}
    teacher, symmetric = returns["teacher"], returns["symmetric"]
    lower = symmetric.mean < text["share"] * teacher.mean
    return Finding({"return": (returns, 1)}, [above(teacher, symmetric.mean), lower])


def _imitation(results: Results, text: Mapping[str, Any]) -> Finding:
    own, teacher = (mean_return(results, name) for name in ("student", "teacher"))
    shares = 100 * pd.Series(own.values) / pd.Series(teacher.values)
    rows = results.rows("teacher_student", "range")
    share = rows.measure("student/share of its teacher's return", "%", shares, "student against teacher")
    return Finding({"share of its teacher's return (%)": ({"student": share}, 1)}, [above(share, text["share"])])


def _adapts(results: Results, text: Mapping[str, Any]) -> Finding:
    rows = results.rows("adaptation", "recoveries", method="student")
    recoveries = rows.frame.groupby("seed")["seconds"]
    longest = rows.measure("student/recovery/max", "s", recoveries.max(), "the longest of each seed's")
    courses, shares = results.rows("adaptation", "courses", method="student", **FINE), dict[str, Measurement]()
    switching = results.study("adaptation").tables["switching"].set_index("course")
    for kind in (kind for kind in METHOD_NAMES if kind in set(switching["method"])):
        ideal = courses.frame["course"].map(switching[switching["method"] == kind]["distance"])
        share = (100 * courses.frame["distance"] / ideal).groupby(courses.frame["seed"]).mean()
        what = f"distance over that of adaptation/switching, method = {kind}; mean over the courses"
        id = f"student/distance/share of switching, {kind}"
        shares[name_of(kind)] = courses.measure(id, "%", share, what)
    mean = rows.measure("student/recovery/mean", "s", recoveries.mean(), "the mean of each seed's")
    measured = {
        "recovery (s)": ({"mean": mean, "longest of each seed": longest}, 2),
        "distance relative to ideal switching (%), among gaits of the": (shares, 0),
    }
    back = max(longest.values) <= text["seconds"]
    return Finding(measured, [back, *(above(one, text["share"]) for one in shares.values())])


JUDGES: dict[str, Judge] = {  # by the claim's id
    "beats-each-fluid": _beats_each_fluid,
    "beats-integrated": partial(_beats_overall, front=INTEGRATED),
    "beats-switching": partial(_beats_overall, front=SIMPLE_SUM),
    "cheaper-than-switching": _cheaper_than_switching,
    "sea-snake": _sea_snake,
    "privilege": _privilege,
    "imitation": _imitation,
    "adapts": _adapts,
    **GAIT_JUDGES,
}
