"""The judges of the paper's claims: each measures from the published tables, and states which parts of a rule hold."""

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from snakebench.comparison.bounds import by_sign, shifted
from snakebench.comparison.course_judges import COURSE_JUDGES
from snakebench.comparison.gain_ledger import front_rows
from snakebench.comparison.gait_judges import GAIT_JUDGES, TOP_SPEED
from snakebench.comparison.results import Finding, Judge, Measurement, Missing, Numbers, Results, Rows
from snakebench.names import CURRENCIES, EXTENDED, FINE, INTEGRATED, PAPER, SIMPLE_SUM
from snakebench.report.equal_power import fastest_within, powers_needed, speeds_within, top_power
from snakebench.report.table import COSTS, CURRENCY_LABELS, LABELS, POWERS, name_of
from snakebench.studies.published_fronts import OVERALL

_LEARNED = ("teacher_student", "ablations", "memory")  # studies of policies of the paper's reward
_OTHER_BUDGETS = ("symmetric_short", "symmetric_long")  # beginnings of names of symmetric policies of other budgets


def ratios_of(own: Rows, others: Rows, column: str) -> dict[int, pd.DataFrame]:
    """A column of every seed over that of every seed of others, by sign of the errors of the engine."""

    def ratios(sign: int) -> pd.DataFrame:
        sides = (shifted(own.bounded(), sign), shifted(others.bounded(), -sign))
        a, b = (rows.groupby("seed")[column].mean() for rows in sides)
        return pd.DataFrame(np.divide.outer(a.to_numpy(), b.to_numpy()), a.index, b.index)

    return by_sign(ratios)


def mean_return(results: Results, name: str) -> Measurement:
    """The return of policies of the paper's reward, by seed, averaged over the range of viscosities."""
    study = _homes(results).get(name, _LEARNED[0])
    return results.rows(study, "range", policy=name).measure(f"{name}/return", "1", "return")


def _homes(results: Results) -> dict[str, str]:
    """The study of each policy of the paper's reward, of the studies that there are."""
    homes = dict[str, str]()
    for study in reversed(_LEARNED):
        with suppress(Missing):
            homes |= dict.fromkeys(results.study(study).tables["range"]["policy"].unique(), study)
    return homes


def _student(results: Results, *, at_top: bool = False, **where: str) -> Rows:
    """Rows of the student at the paper's power, or at top speed."""
    if at_top:
        return results.rows("teacher_student", "evaluations", policy="student", variant=FINE, **where)
    return results.student(**where)


def _swims(results: Results, rows: Rows, place: str) -> dict[int, pd.DataFrame]:
    """Speed and powers of rows in a fluid, or their means over all, by seed and by sign of the errors of the engine."""
    fluids = results.fluids if place in OVERALL else [place]
    whole = rows.bounded()
    swims = whole[whole["fluid"].isin(fluids)]
    return by_sign(lambda sign: shifted(swims, sign).groupby("seed")[["speed", *POWERS]].mean(skipna=False))


def _gain(
    results: Results, place: str, space: str = PAPER, *, at_top: bool = False, currency: str = "net"
) -> Measurement:
    """How much faster the student is than a front of sinusoids, of a fluid or over all, at each seed's power [%]."""
    table, where = front_rows(place, currency)
    points = results.rows("pareto", table, space=space, **where).bounded()
    rows = _student(results, at_top=at_top)
    swims = _swims(results, rows, place)

    def gains(sign: int) -> pd.Series:
        own = swims[sign]
        power = own[CURRENCIES[currency]].to_numpy()
        return 100 * (own["speed"] / speeds_within(shifted(points, -sign), power, currency) - 1)

    fluids = ", ".join(results.fluids if place in OVERALL else [place])
    front = f"pareto/{table}, space = {space}, front = {place}, currency = {currency}"
    what = f"{fluids}: speed over that of {front}, at its power or that of its fastest point, less 1"
    at = ("" if at_top else " at the paper's power") + ("" if currency == "net" else ", at equal P+")
    return rows.measure(f"student/{place}/gain over {space}{at}", "%", by_sign(gains), what)


def _gain_at_power(results: Results, fluid: str, power: float) -> Measurement:
    """How much faster the preference-conditioned student is than the paper's sinusoids, both at a power [%]."""
    points = results.rows("pareto", "fronts", space=PAPER, front=fluid, currency="net").bounded()
    rows = results.rows("learned_front", "fronts", front=fluid, currency="net")
    own = rows.bounded().query("method == 'student'")
    shared = min(power, top_power(points))

    def gains(sign: int) -> pd.Series:
        best = fastest_within(shifted(own, sign), shared, ["seed"]).set_index("seed")["speed"].sort_index()
        return 100 * (best / fastest_within(shifted(points, -sign), shared)["speed"].max() - 1)

    what = f"space = student SEED: speed at {shared:.3g} W over that of pareto/fronts, space = paper, less 1"
    id = f"preference-conditioned student/{fluid}/gain over {PAPER} at {power:g} W"
    return rows.measure(id, "%", by_sign(gains), what)


def _beats_each_fluid(results: Results, text: Mapping[str, Any]) -> Finding:
    here = {fluid: _gain(results, fluid) for fluid in results.fluids}
    measured = {"faster at the paper's power (%)": (here, 0)}
    measured["than wider sinusoids"] = {fluid: _gain(results, fluid, EXTENDED) for fluid in results.fluids}, 0
    measured["at equal P+"] = {fluid: _gain(results, fluid, currency="positive") for fluid in results.fluids}, 0
    alike = {fluid: _gain_at_power(results, fluid, text["power"]) for fluid in results.fluids}
    measured[f"at {text['power']:g} W"] = alike, 0
    for label, space in ((TOP_SPEED, PAPER), (f"{TOP_SPEED}, than wider sinusoids", EXTENDED)):
        measured[label] = {fluid: _gain(results, fluid, space, at_top=True) for fluid in results.fluids}, 0
    return Finding(measured, [one.above(0) for one in here.values()])


def _beats_overall(results: Results, _: Mapping[str, Any], front: str) -> Finding:
    spaces = {name_of(space): space for space in (PAPER, EXTENDED)}
    here = {name: _gain(results, front, space) for name, space in spaces.items()}
    thrifty = {name: _gain(results, front, space, currency="positive") for name, space in spaces.items()}
    top = {name: _gain(results, front, space, at_top=True) for name, space in spaces.items()}
    measured = {"faster at the paper's power (%) than": (here, 0)}
    measured |= {"at equal P+": (thrifty, 0), TOP_SPEED: (top, 0)}
    return Finding(measured, [here[name_of(PAPER)].above(0)])


def _cheaper_than_switching(results: Results, text: Mapping[str, Any]) -> Finding:
    """Costs of transport over all fluids at equal power, and powers at equal mean speeds, over those of switching."""
    at_power = _cost_at_papers_power(results)
    measured = {"change of CoT at the paper's power (%)": ({"all fluids": at_power}, 0)}
    for currency in CURRENCIES:
        changes = _powers_at_speeds(results, text["speeds"], currency)
        measured[f"change of {CURRENCY_LABELS[currency]} at equal mean speed (%)"] = changes, 0
    return Finding(measured, [at_power.below(0)])


def _cost_at_papers_power(results: Results) -> Measurement:
    """P over v of the student, both means over the fluids, over that of ideal switching at its power [%]."""
    rows = _student(results)
    swims = _swims(results, rows, SIMPLE_SUM)
    fixed = results.rows("pareto", "switching", space=PAPER, currency="net").bounded()

    def change(sign: int) -> pd.Series:
        own, front = swims[sign], shifted(fixed, -sign)
        best = pd.concat({seed: fastest_within(front, power) for seed, power in own["power"].items()}).droplevel(1)
        return 100 * (own["power"] / own["speed"] / (best["power"] / best["speed"]) - 1)

    what = (
        "P / v, means over the fluids, over that of pareto/switching, space = paper, at its power or that of its"
        " fastest point, less 1"
    )
    return rows.measure("student/simple-sum/CoT at the paper's power", "%", by_sign(change), what)


def _powers_at_speeds(results: Results, speeds: list[float], currency: str) -> Numbers:
    """Change from ideal switching to the student of the least power of a currency for a mean speed [%]."""
    rows = results.rows("learned_front", "switching", currency=currency)
    switching = results.rows("pareto", "switching", space=PAPER, currency=currency)
    own, fixed = rows.bounded().query("method == 'student'"), switching.bounded()

    def change(speed: float, sign: int) -> pd.Series:
        seeds = shifted(own, sign).groupby("seed")
        needed = pd.Series({seed: powers_needed(part, np.array([speed]), currency)[0] for seed, part in seeds})
        return 100 * (needed / powers_needed(shifted(fixed, -sign), np.array([speed]), currency)[0] - 1)

    changes, power = Numbers(), CURRENCIES[currency]
    for speed in (speed for speed in speeds if speed <= fixed["speed"].max()):
        what = f"space = student SEED: least {power} for {speed:g} m/s over that of pareto/switching, less 1"
        id = f"preference-conditioned student/simple-sum/{power} at {speed:g} m/s"
        if (values := by_sign(partial(change, speed)))[0].notna().all():  # all seeds swim so fast
            changes[f"at {speed:g} m/s"] = rows.measure(id, "%", values, what)
    return changes


def _sea_snake(results: Results, _: Mapping[str, Any]) -> Finding:
    """Figures of the policy as multiples of those of the sea snake tuned to each fluid."""
    labels = {"speed": "v, ratio", **{cost: f"{LABELS[cost]}, ratio" for cost in COSTS}}
    here = {label: _over_sea_snake(results, name) for name, label in labels.items()}
    top = {f"{TOP_SPEED}, {label}": _over_sea_snake(results, name, at_top=True) for name, label in labels.items()}
    names = "speed", COSTS[0]
    judged = [ratio for name in names for ratio in here[labels[name]].values()]
    measured = {label: (ratios, 1) for label, ratios in (here | top).items()}
    return Finding(measured, [ratio.above(1) for ratio in judged], leading=len(names))


def _over_sea_snake(results: Results, column: str, *, at_top: bool = False) -> Numbers:
    ratios, at = Numbers(), "" if at_top else " at the paper's power"
    for fluid in results.fluids:
        own = _student(results, at_top=at_top, fluid=fluid)
        gaits = results.rows("sea_snake", "optima", objective=fluid, fluid=fluid, variant=FINE)
        id, what = f"student/{fluid}/{column} over sea snake's{at}", f"{column} over that of sea_snake/optima"
        ratios[fluid] = own.measure(id, "1", ratios_of(own, gaits, column), what)
    return ratios


def _privilege(results: Results, text: Mapping[str, Any]) -> Finding:
    names = ["teacher", "symmetric", *(name for name in _homes(results) if name.startswith(_OTHER_BUDGETS))]
    returns = {name_of(name): mean_return(results, name) for name in names}
    without, with_it = returns["symmetric"].by_seed(), returns["teacher"].by_seed()
    shares = pd.DataFrame(np.divide.outer(without.to_numpy(), with_it.to_numpy()), without.index, with_it.index)
    rows = results.rows("teacher_student", "range")
    share = rows.measure("symmetric/share of the teacher's return", "1", shares, "symmetric against teacher")
    return Finding({"return": (returns, 1)}, [share.below(1), share.below(text["share"])])


def _imitation(results: Results, text: Mapping[str, Any]) -> Finding:
    own, teacher = (mean_return(results, name) for name in ("student", "teacher"))
    shares = 100 * own.by_seed() / teacher.by_seed()
    rows = results.rows("teacher_student", "range")
    share = rows.measure("student/share of its teacher's return", "%", shares, "student against teacher")
    return Finding({"share of its teacher's return (%)": ({"student": share}, 1)}, [share.above(text["share"])])


JUDGES: dict[str, Judge] = {  # by the claim's id
    "beats-each-fluid": _beats_each_fluid,
    "beats-integrated": partial(_beats_overall, front=INTEGRATED),
    "beats-switching": partial(_beats_overall, front=SIMPLE_SUM),
    "cheaper-than-switching": _cheaper_than_switching,
    "sea-snake": _sea_snake,
    "privilege": _privilege,
    "imitation": _imitation,
    **GAIT_JUDGES,
    **COURSE_JUDGES,
}
