"""The judges of the paper's claims: each measures from the published tables, and states which parts of a rule hold."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.comparison.gain_ledger import front_rows
from snakebench.comparison.results import FINE, Measurement, Results, Rows, unit_of
from snakebench.report.equal_power import fastest_within, speeds_within
from snakebench.report.method_names import name_of
from snakebench.report.table import COSTS, LABELS, POWERS
from snakebench.store import EXTENDED, PAPER
from snakebench.studies.adaptation import controls as adaptation
from snakebench.studies.published_fronts import OVERALL, by_seed


class Finding(NamedTuple):
    """What a judge found: numbers by label and place, with their digits, and whether each part of the rule holds."""

    measured: Mapping[str, tuple[Mapping[str, Measurement], int]]
    holds: Sequence[bool]


Judge = Callable[[Results, Mapping[str, Any]], Finding]


def above(measurement: Measurement, bound: float) -> bool:
    """Whether a mean is above a bound with its whole interval."""
    return (measurement.interval or (measurement.mean,))[0] > bound


def below(measurement: Measurement, bound: float) -> bool:
    """Whether a mean is below a bound with its whole interval."""
    return (measurement.interval or (measurement.mean,))[-1] < bound


def rising(measurements: Sequence[Measurement]) -> bool:
    """Whether values rise from each measurement to the next, for every seed."""
    return bool((np.diff([one.values for one in measurements], axis=0) > 0).all())


def mean_return(results: Results, name: str) -> Measurement:
    """The return of policies of the paper's reward, by seed, averaged over the range of viscosities."""
    return results.rows("teacher_student", "range", policy=name).measure(f"{name}/return", "1", "return")


def _gain(results: Results, place: str, space: str = PAPER) -> Measurement:
    """How much faster the student is than a front of sinusoids, of a fluid or over all, at each seed's power [%]."""
    fluids = results.fluids if place in OVERALL else [place]
    table, where = front_rows(place)
    points = results.rows("pareto", table, space=space, **where).frame
    rows = results.rows("teacher_student", "evaluations", policy="student", **FINE)
    swims = rows.frame[rows.frame["fluid"].isin(fluids)].groupby("seed")[["speed", "power"]].mean()
    gains = 100 * (swims["speed"] / speeds_within(points, swims["power"].to_numpy()) - 1)
    front = f"pareto/{table}, space = {space}" + (f", front = {place}" if where else "")
    what = f"{', '.join(fluids)}: speed over the highest for at most its power in {front}, less 1"
    return rows.measure(f"student/{place}/gain over {space}", "%", gains, what)


def _gain_at_power(results: Results, fluid: str, power: float) -> Measurement:
    """How much faster the preference-conditioned student is than the paper's sinusoids, both at a power [%]."""
    points = results.rows("pareto", "fronts", space=PAPER, front=fluid).frame
    rows = results.rows("learned_front", "fronts", front=fluid)
    own = by_seed(rows.frame).query("method == 'student'")
    best = fastest_within(own, power, ["seed"]).set_index("seed")["speed"].sort_index()
    gains = 100 * (best / fastest_within(points, power)["speed"].max() - 1)
    what = f"space = student SEED: highest speed for at most {power:g} W over that of pareto/fronts, space = paper"
    return rows.measure(f"preference-conditioned student/{fluid}/gain over {PAPER} at {power:g} W", "%", gains, what)


def _replayed(results: Results, fluid: str, **where: str) -> Rows:
    return results.rows("cross", "matrix", method="student", loop="open", fluid=fluid, **where, **FINE)


def _own_gait_is_best(results: Results, fluid: str, column: str) -> Measurement:
    """Whether a fluid's own gait, replayed, is the fastest there or has the lowest cost, by seed [%]."""
    rows = _replayed(results, fluid)
    by_gait = rows.frame.pivot(index="seed", columns="gait_of", values=column).dropna(how="all")
    which, best = ("fastest", by_gait.idxmax(axis=1)) if column == "speed" else ("lowest", by_gait.idxmin(axis=1))
    what = f"whether gait_of = {fluid} is the {which} by {column}"
    return rows.measure(f"own gait/{fluid}/best by {column}", "%", 100 * (best == fluid), what)


def _beats_each_fluid(results: Results, text: Mapping[str, Any]) -> Finding:
    own = {fluid: _gain(results, fluid) for fluid in results.fluids}
    wider = {fluid: _gain(results, fluid, EXTENDED) for fluid in results.fluids}
    alike = {fluid: _gain_at_power(results, fluid, text["power"]) for fluid in results.fluids}
    measured = {
        "faster at its own power (%)": (own, 0),
        f"preference-conditioned, at {text['power']:g} W": (alike, 0),
        "than sinusoids of a wider range, at its own power": (wider, 0),
    }
    return Finding(measured, [above(one, 0) for one in (*own.values(), *alike.values())])


def _beats_overall(results: Results, _: Mapping[str, Any], front: str) -> Finding:
    gains = {name_of(space): _gain(results, front, space) for space in (PAPER, EXTENDED)}
    return Finding({"faster at its own power (%), than the": (gains, 0)}, [above(gains[name_of(PAPER)], 0)])


def _cheaper_than_switching(results: Results, text: Mapping[str, Any]) -> Finding:
    """Powers of the student over those of ideal switching, each of its least P for a mean speed."""
    rows, fixed = results.rows("learned_front", "switching"), results.rows("pareto", "switching", space=PAPER).frame
    own = by_seed(rows.frame).query("method == 'student'")
    measured = dict[str, tuple[dict[str, Measurement], int]]()
    for label, column in zip(("P", "P+"), POWERS, strict=True):
        changes = dict[str, Measurement]()
        for speed in (speed for speed in text["speeds"] if speed <= fixed["speed"].max()):
            students, gait = (
                points[points["speed"] >= speed].sort_values("power", kind="stable") for points in (own, fixed)
            )
            power = students.drop_duplicates("seed").set_index("seed").sort_index()[column] / gait[column].iloc[0]
            if column == "power" or power.notna().any():  # P+ is not in the results of version 1.0
                what = f"{column} of the least power for at least {speed:g} m/s over that of pareto/switching"
                id = f"preference-conditioned student/simple-sum/{column} at {speed:g} m/s"
                changes[f"at {speed:g} m/s"] = rows.measure(id, "%", 100 * (power - 1), f"space = student SEED: {what}")
        measured[f"change of {label} at equal mean speed (%)"] = changes, 0
    power_changes, _digits = next(iter(measured.values()))
    return Finding(measured, [below(one, 0) for one in power_changes.values()])


def _sea_snake(results: Results, _: Mapping[str, Any]) -> Finding:
    """Figures of the policy as multiples of those of the sea snake tuned to each fluid."""
    measured = dict[str, tuple[dict[str, Measurement], int]]()
    for label, column in (("v", "speed"), *zip(("CoT", "CoT+"), COSTS, strict=True)):
        ratios = dict[str, Measurement]()
        for fluid in results.fluids:
            rows = results.rows("sea_snake", "optima", objective=fluid, fluid=fluid, **FINE)
            gait, own = rows.measure(f"sea snake/{fluid}/{column}", "", column), results.policy(column, fluid)
            ratios[fluid] = own._replace(values=tuple(value / gait.mean for value in own.values), unit="1")
        measured[f"{label}, ratio"] = ratios, 1
    judged = [ratio for label in ("v, ratio", "CoT, ratio") for ratio in measured[label][0].values()]
    return Finding(measured, [above(ratio, 1) for ratio in judged])


def _own_fluid(results: Results, _: Mapping[str, Any]) -> Finding:
    speed, cost, positive_cost = (results.in_fluids(column) for column in ("speed", *COSTS))
    measured = {"v (m/s)": (speed, 3), "CoT": (cost, 2), "CoT+": (positive_cost, 2)}
    return Finding(measured, [rising([*speed.values()][::-1]), rising([*cost.values()])])


def _trend(results: Results, _: Mapping[str, Any], column: str, label: str, *, rises: bool) -> Finding:
    """Whether a figure rises or falls from the first fluid to the last."""
    numbers = results.in_fluids(column)
    first, *_between, last = numbers.values()
    return Finding({label: (numbers, 3)}, [rising([first, last] if rises else [last, first])])


def _torque(results: Results, text: Mapping[str, Any]) -> Finding:
    torque = results.in_fluids("torque_amplitude")
    means = [one.mean for one in torque.values()]
    alike = max(means) <= text["ratio"] * min(means)
    return Finding({"torque (N m)": (torque, 1)}, [alike, all(text["least"] <= mean <= text["most"] for mean in means)])


def _fixed_sinusoid(results: Results, _: Mapping[str, Any]) -> Finding:
    tails = {}
    for fluid in results.fluids:
        rows = results.rows("validation", "runs", fluid=fluid, gait="calibration", engine="pybullet", physics_rate=960)
        values = rows.frame["tail_amplitude"]
        tails[fluid] = rows.measure(f"fixed sinusoid/{fluid}/tail", "m", values, "tail_amplitude")
    return Finding({"tail amplitude (m)": (tails, 3)}, [rising([*tails.values()][::-1])])


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


def _best_at_home(results: Results, _: Mapping[str, Any], columns: Sequence[str]) -> Finding:
    """Whether own gaits are best by the first column; of further ones numbers are shown."""
    ends = results.fluids[0], results.fluids[-1]
    measured = dict[str, Any]()
    for column in columns:
        label = LABELS[column].split()[0]
        best = {fluid: _own_gait_is_best(results, fluid, column) for fluid in results.fluids}
        pairs = {}
        for gait, fluid in (ends, ends[::-1]):
            rows, id = _replayed(results, fluid, gait_of=gait), f"gait of {gait}/{fluid}/{column}"
            pairs[f"{gait}'s in {fluid}"] = rows.measure(id, unit_of(column), column)
        measured |= {f"seeds whose own gait is best by {label} (%)": (best, 0), label: (pairs, 2)}
    judged, _digits = next(iter(measured.values()))
    return Finding(measured, [one.mean == 100 for one in judged.values()])


def _adapts(results: Results, text: Mapping[str, Any]) -> Finding:
    """The student and the single gaits nearest below its power, by the same rule."""
    results.rows("adaptation", "courses", method="student", **FINE)  # which must be there
    swims = adaptation.compared(results.study("adaptation").tables)
    single = {
        f"single {name_of(str(name))}": part
        for name, part in adaptation.controls(swims, "student").groupby("method", sort=False)
    }
    by_method = {str(name): part for name, part in swims.groupby("method", sort=False)}
    learned = {name_of(name): part for name, part in by_method.items() if name.startswith("student_")}
    swimmers = {"student": by_method["student"]} | single
    found = {name: _course_numbers(results, name, part) for name, part in (swimmers | learned).items()}
    passed = {name: _passed(part, found[name], text) for name, part in swimmers.items()}
    measured = {
        label: ({name: numbers[key] for name, numbers in found.items() if key in numbers}, digits)
        for key, (label, digits, *_) in _COURSE_NUMBERS.items()
    }
    return Finding(measured, [*passed["student"], not any(all(passed[name]) for name in single)])


# Of swims through courses: label and digits in the claim, unit, column of `compared`, and how courses are joined.
_COURSE_NUMBERS = {
    "recovery/max": ("longest recovery of each seed (s)", 2, "s", "recovery", "max"),
    "gain/P": ("gain of distance over the best single gait at equal P (%)", 1, "%", "gain_net", "mean"),
    "gain/P+": ("at equal P+ (%)", 1, "%", "gain_positive", "mean"),
    "of limit/P": ("distance as a share of the limit's ideal switching at equal P (%)", 1, "%", "of_limit_net", "mean"),
    "of limit/P+": ("the same at equal P+ (%)", 1, "%", "of_limit_positive", "mean"),
}


def _course_numbers(results: Results, name: str, swims: pd.DataFrame) -> dict[str, Measurement]:
    """What is known of the swims of a policy or of single gaits through all courses, by seed."""
    method = swims["method"].iloc[0]
    rows, found = results.rows("adaptation", "courses", method=method, **FINE), dict[str, Measurement]()
    for key, (_, _, unit, column, over) in _COURSE_NUMBERS.items():
        values = swims.groupby("seed")[column].agg(over).replace(np.inf, np.nan) * (100 if unit == "%" else 1)
        if values.notna().any():
            found[key] = rows.measure(f"{name}/{key}", unit, values, f"{over} of {column} over the courses")
    return found


def _passed(swims: pd.DataFrame, numbers: Mapping[str, Measurement], text: Mapping[str, Any]) -> list[bool]:
    """Which parts of the rule hold; one that is not known does not."""
    back = swims["recovery"].max() <= text["seconds"]
    bounds = {"gain/P": text["gain"], "of limit/P": text["share"]}
    return [bool(back), *(key in numbers and above(numbers[key], bound) for key, bound in bounds.items())]


JUDGES: dict[str, Judge] = {  # by the claim's id
    "beats-each-fluid": _beats_each_fluid,
    "beats-integrated": partial(_beats_overall, front="integrated"),
    "beats-switching": partial(_beats_overall, front="simple-sum"),
    "cheaper-than-switching": _cheaper_than_switching,
    "sea-snake": _sea_snake,
    "own-fluid": _own_fluid,
    "frequency": partial(_trend, column="swim_frequency", label="f (Hz)", rises=False),
    "tail": partial(_trend, column="tail_amplitude", label="tail amplitude (m)", rises=True),
    "torque": _torque,
    "fixed-sinusoid": _fixed_sinusoid,
    "privilege": _privilege,
    "imitation": _imitation,
    "fastest-at-home": partial(_best_at_home, columns=["speed"]),
    "cheapest-at-home": partial(_best_at_home, columns=COSTS),
    "adapts": _adapts,
}
