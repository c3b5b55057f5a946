"""The gain ledger: what makes the student faster than the paper's sinusoids, step by step (ours).

Speeds are compared at equal command power P on the fronts of P; a front that ends at less power is compared at that of
its fastest point. The power stands beside, as do both costs of transport. Free waveforms and policies have one speed
for each seed of their search or training. The sinusoids' front has one: it is the best of a grid, which has no seeds,
and of all searches.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from snakebench.comparison.bounds import by_sign, shifted
from snakebench.comparison.results import Measurement, Results, Rows
from snakebench.names import EXTENDED, FASTER, FINE, INTEGRATED, PAPER, SIMPLE_SUM, STRONGER
from snakebench.report.equal_power import fastest_within, front_line
from snakebench.report.intervals import confidence_interval
from snakebench.report.table import COSTS, LABELS, POWERS, Column, Table, first, summary
from snakebench.studies.fronts import simple_sum

EVERYWHERE = "all fluids"
TOP = 30.0  # power within which speeds count as top speed, as for hypervolume [W]
EQUAL = 10.0  # power at which preference-conditioned policies are compared [W]
VIEWS = {"equal": f"at {EQUAL:g} W", "own": "at the student's power", "top": f"top speed within {TOP:g} W"}
STEPS = {  # in their order
    "sinusoid": "sinusoid in the paper's range",
    "faster sinusoid": "wider range: frequency",
    "wider sinusoid": "wider range: frequency and torque",
    "free waveform": "free waveform",
    "teacher": "privileged feedback",
    "student": "proprioceptive feedback only",
    "one waveform for all": "no feedback: one gait for all",
}
_SPACES = {"sinusoid": PAPER, "faster sinusoid": FASTER, "wider sinusoid": EXTENDED}  # of steps
_SPENT = ["speed", *POWERS]
_DIGITS = {"speed": 3, "power": 1}  # after the point

# The columns `_SPENT` of the swims of a step, a row a seed, by sign of their errors as in `bounds`.
Swims = Callable[[int], pd.DataFrame]


def change(before: Measurement, after: Measurement, *, paired: bool = False) -> tuple[float, float, float]:
    """Difference of two means and its 95 % interval: Student's for paired seeds, else Welch's; wider by both bounds."""
    a, b = np.array(after.values), np.array(before.values)
    center, error = float(a.mean() - b.mean()), before.error + after.error
    samples = (a - b,) if paired and before.seeds == after.seeds else (a, -b)
    low, high = confidence_interval(*samples) or (center, center)
    return center, low - error, high + error


def ledger(results: Results) -> pd.DataFrame:
    """The ledger, a row a step at each place in each view; the column `measured` has its measurements by name."""
    return pd.DataFrame(
        {"view": view, "place": place} | step
        for view, powers in _powers(results).items()
        for place in powers
        for step in _measured_steps(results, view, place, powers)
    )


def _powers(results: Results) -> dict[str, dict[str, float]]:
    """The power within which speeds are compared at each place, by view [W]."""
    own = {fluid: power.mean for fluid, power in results.in_fluids("power").items()}
    own[EVERYWHERE] = float(np.mean(list(own.values())))
    return {"equal": dict.fromkeys(own, EQUAL), "own": own, "top": dict.fromkeys(own, TOP)}


def _measured_steps(results: Results, view: str, place: str, powers: dict[str, float]) -> Iterator[dict[str, Any]]:
    """Speed and costs of transport of each step, the gain over the first one [1] and the change from the last [m/s]."""
    speeds: list[Measurement] = []
    for id, rows, swims_of, what in _steps(results, view, place, powers):
        name, weight = f"ledger/{view}/{place}/{id}", rows.study.weight
        swims, measured = by_sign(swims_of), dict[str, Measurement]()
        for power, cost in zip(POWERS, COSTS, strict=True):
            costs = {sign: part[power] / (weight * part["speed"]) for sign, part in swims.items()}
            measured[cost] = rows.measure(f"{name}/{cost}", "1", costs, f"{what}: its {LABELS[cost]}")
        powers_there = {sign: part["power"] for sign, part in swims.items()}
        measured["power"] = rows.measure(f"{name}/power", "W", powers_there, f"{what}: its {LABELS['power']}")
        speed = rows.measure(name, "m/s", {sign: part["speed"] for sign, part in swims.items()}, what)
        measured["speed"] = speed
        speeds.append(speed)
        center, low, high = change(*speeds[-2:], paired=id == "student") if len(speeds) > 1 else (None, None, None)
        row = {"step": id, "speed": speed.mean, "power": measured["power"].mean}
        row |= {"gain": speed.mean / speeds[0].mean - 1, "change": center, "low": low, "high": high}
        row |= {cost: measured[cost].mean for cost in COSTS}
        yield row | {"n": speed.n, "table": speed.table, "rows": speed.rows, "measured": measured}


def _steps(results: Results, view: str, place: str, powers: dict[str, float]) -> Iterator[tuple[str, Rows, Swims, str]]:
    """Each step: its id of `STEPS`, rows, the swims made of them, and how."""
    power, most = powers[place], powers[EVERYWHERE]
    fluids = results.fluids if place == EVERYWHERE else [place]
    table, where = front_rows(place)
    at = f"at {power:.1f} W, or of the fastest point if it needs less"
    for id, space in _SPACES.items():
        rows = results.rows("pareto", table, space=space, **where)
        yield id, rows, partial(_fastest, rows.bounded(), power, []), f"speed {at}"
    rows = results.rows("fourier", "optima", variant=FINE)
    what = f"of each seed, tuned to {', '.join(fluids)}: mean speed {at}"
    yield "free waveform", rows, partial(_waveforms, rows.bounded(), fluids, power), what
    for id in ("teacher", "student"):
        if view == "equal":
            rows, what = results.rows("learned_front", table, **where), f"space = {id} SEED: speed {at}"
            points = rows.bounded()
            swims: Swims = partial(_fastest, points[points["method"] == id], power, ["seed"])
        else:
            of = {"policy": id, "variant": FINE} | ({} if place == EVERYWHERE else {"fluid": place})
            rows, what = results.rows("teacher_student", "evaluations", **of), "speed"
            swims = partial(_means, rows.bounded())
        yield id, rows, swims, what
    what = f"of each seed at a mean power of {most:.1f} W, or of the fastest gait if it needs less: speed, {place}"
    rows = results.rows("fourier", "optima", variant=FINE, tuned_to=INTEGRATED)
    yield "one waveform for all", rows, partial(_one_for_all, rows.bounded(), results.fluids, fluids, most), what


def orders(results: Results) -> pd.DataFrame:
    """What frequency and torque add to the speed of the paper's sinusoids [m/s], at each place in each view.

    Each `alone`, each after the other, `both`, and the `interaction`: what both add beyond the sum of each alone.
    """
    spaces = {"paper": PAPER, "frequency": FASTER, "torque": STRONGER, "both": EXTENDED}
    rows = []
    for view, powers in _powers(results).items():
        for place, power in powers.items():
            table, where = front_rows(place)
            fronts = {id: results.rows("pareto", table, space=space, **where).frame for id, space in spaces.items()}
            speeds = {id: fastest_within(front, power)["speed"].max() for id, front in fronts.items()}
            rows.append({"view": view, "place": place} | added(**speeds))
    return pd.DataFrame(rows)


def added(*, paper: float, frequency: float, torque: float, both: float) -> dict[str, float]:
    """What two changes add to a speed in either order, from the speeds with neither, with one and with both."""
    alone = {"frequency": frequency - paper, "torque": torque - paper}
    after = {"torque after frequency": both - frequency, "frequency after torque": both - torque}
    return alone | after | {"both": both - paper, "interaction": both - frequency - torque + paper}


def front_rows(place: str, currency: str = "net") -> tuple[str, dict[str, str]]:
    """The table of a study that a front is in, and which of its rows; ideal switching has a table of its own."""
    if place in (EVERYWHERE, SIMPLE_SUM):
        return "switching", {"currency": currency}
    return "fronts", {"front": place, "currency": currency}


def _fastest(points: pd.DataFrame, power: float, by: list[str], sign: int) -> pd.DataFrame:
    """The front at a power, or that of each seed."""
    best = fastest_within(shifted(points, sign), power, by)
    return best.set_index(by).sort_index()[_SPENT] if by else best[_SPENT].reset_index(drop=True)


def _means(swims: pd.DataFrame, sign: int) -> pd.DataFrame:
    return shifted(swims, sign).groupby("seed")[_SPENT].mean(skipna=False)


def _waveforms(swims: pd.DataFrame, fluids: Sequence[str], power: float, sign: int) -> pd.DataFrame:
    """The front at a power of each seed's waveforms tuned to a fluid; over all fluids that of ideal switching."""
    swims = shifted(swims, sign)
    valid = swims[(swims["status"] == "ok") & swims["tuned_to"].isin(fluids)]
    fastest = [
        fastest_within(switched([part for _, part in of_seed.groupby("fluid")]), power).assign(seed=seed)
        for seed, of_seed in valid.groupby("seed")
        if of_seed["fluid"].nunique() == len(fluids)
    ]
    return pd.concat(fastest).set_index("seed")[_SPENT] if fastest else pd.DataFrame(columns=_SPENT, dtype=float)


def switched(sets: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The means of one point of the front of each set, for all combinations that no other dominates."""
    fronts = [front_line(points, widest=np.inf)[_SPENT].to_numpy(float) for points in sets]
    _, members = simple_sum([points[:, :2] for points in fronts])
    chosen = [points[own] for points, own in zip(fronts, members.T, strict=True)]
    return pd.DataFrame(np.mean(chosen, axis=0), columns=_SPENT)


def _one_for_all(swims: pd.DataFrame, fluids: list[str], shown: list[str], power: float, sign: int) -> pd.DataFrame:
    """Each seed's front of one waveform for all fluids at a mean power, and what it swims in those fluids `shown`."""
    gait, swims = ["seed", "harmonics", "objective", "price"], shifted(swims, sign)
    by_gait = swims[swims["status"] == "ok"].groupby(gait, dropna=False)
    means = by_gait[_SPENT].mean()[by_gait.size() == len(fluids)]
    there = swims[swims["fluid"].isin(shown)].groupby(gait, dropna=False)[_SPENT].mean().add_suffix("_there")
    best = fastest_within(means.join(there).reset_index(), power, ["seed"]).set_index("seed")
    return best[[f"{name}_there" for name in _SPENT]].set_axis(_SPENT, axis=1)


def ledger_table(view: pd.DataFrame) -> Table:
    """One view of the ledger: speeds, what each step changes, and both costs of transport."""

    def measured(part: pd.DataFrame, name: str) -> str:
        return str(part["measured"].iloc[0][name].text(_DIGITS.get(name, 2)))

    def changed(part: pd.DataFrame) -> str:
        center, low, high = part[["change", "low", "high"]].iloc[0]
        return "" if np.isnan(center) else f"{center:+.3f} [{low:+.3f}, {high:+.3f}]"

    columns: list[Column] = [(LABELS[name], partial(measured, name=name)) for name in ("speed", "power", *COSTS)]
    columns[2:2] = [("n", first("n")), ("change", changed)]
    named = view.assign(step=view["step"].map(STEPS))
    return summary(named, ["place", "step"], columns)


def orders_table(part: pd.DataFrame) -> Table:
    """One view of `orders`: what frequency and torque add in either order, and their interaction [m/s]."""
    names = [name for name in part if name not in ("view", "place")]
    return summary(part, ["place"], [(str(name), first(str(name), "+.3f")) for name in names])
