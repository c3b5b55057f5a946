"""The gain ledger: what makes the student faster than the paper's sinusoids, step by step (ours).

The paper compares the two ends. Between them lie the range of the actuators, the free waveform, feedback with and
without privileged information, and, last, what is lost where one gait without any feedback must do in all fluids.

Speeds are compared at equal command power P, since fronts are of P. Beside each stand both costs of transport of the
very gaits whose speed it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.comparison.results import FINE, Measurement, Results, Rows
from snakebench.metrics import GRAVITY
from snakebench.report.equal_power import fastest_within
from snakebench.report.table import COSTS, LABELS, POWERS, Table, confidence_interval
from snakebench.robot import Robot
from snakebench.store import EXTENDED, INTEGRATED, PAPER, SIMPLE_SUM
from snakebench.studies.published_fronts import by_seed

EVERYWHERE = "all fluids"
TOP = 30.0  # power within which speeds count as top speed, as for hypervolume [W]
EQUAL = 10.0  # power at which preference-conditioned policies are compared [W]
VIEWS = {
    "equal": f"at {EQUAL:g} W",
    "own": "at the student's power",
    "top": f"top speed within {TOP:g} W",
}
STEPS = {  # in their order
    "sinusoid": "sinusoid in the paper's range",
    "wider sinusoid": "wider range of the actuators",
    "free waveform": "free waveform",
    "teacher": "privileged feedback",
    "student": "proprioceptive feedback only",
    "one waveform for all": "no feedback: one gait for all",
}
_SPENT = ["speed", *POWERS]


class Step(NamedTuple):
    """A speed of the ledger, by an id of `STEPS`, and the costs of transport at it where they are known."""

    id: str
    speed: Measurement
    costs: dict[str, Measurement]


class Account(NamedTuple):
    """The steps from the paper's sinusoids to the student, and to a gait that does not adapt, at one place."""

    view: str  # at which power, an id of `VIEWS`
    place: str  # a fluid, or all
    steps: list[Step]

    def changes(self) -> Iterator[tuple[float, float, float]]:
        """Change of speed from each step to the next, and its 95 % interval [m/s]."""
        for before, after in zip(self.steps, self.steps[1:], strict=False):
            yield change(before.speed, after.speed, paired=(before.id, after.id) == ("teacher", "student"))


def change(before: Measurement, after: Measurement, *, paired: bool = False) -> tuple[float, float, float]:
    """Difference of two means and its 95 % interval: Student's for paired seeds or one sure side, else Welch's."""
    a, b = np.array(after.values), np.array(before.values)
    center = float(a.mean() - b.mean())
    if (paired and len(a) == len(b)) or 1 in (len(a), len(b)):
        low, high = confidence_interval(a - b) or (center, center)
    else:
        low, high = stats.ttest_ind(a, b, equal_var=False).confidence_interval()
    return center, float(low), float(high)


def ledger(results: Results) -> list[Account]:
    """All accounts, by view and place.

    Raises:
        Missing: when results that they need are not there.
    """
    own = {fluid: power.mean for fluid, power in results.in_fluids("power").items()}
    own[EVERYWHERE] = float(np.mean(list(own.values())))
    powers = {"equal": dict.fromkeys(own, EQUAL), "own": own, "top": dict.fromkeys(own, TOP)}
    return [Account(view, place, list(_steps(results, view, place, powers[view]))) for view in VIEWS for place in own]


def _steps(results: Results, view: str, place: str, powers: Mapping[str, float]) -> Iterator[Step]:
    power, most = powers[place], powers[EVERYWHERE]
    fluids = results.fluids if place == EVERYWHERE else [place]
    table, where = front_rows(place)
    at = f"for at most {power:.1f} W"
    step = partial(_step, f"ledger/{view}/{place}")
    for id, space in (("sinusoid", PAPER), ("wider sinusoid", EXTENDED)):
        rows = results.rows("pareto", table, space=space, **where)
        yield step(id, rows, fastest_within(rows.frame, power), f"highest speed {at}")
    rows = results.rows("fourier", "optima", **FINE)
    what = f"of each seed, tuned to {', '.join(fluids)}: highest mean speed {at}"
    yield step("free waveform", rows, _waveforms(rows.frame, fluids, power), what)
    for id in ("teacher", "student"):
        if view == "equal":
            rows, what = results.rows("learned_front", table, **where), f"space = {id} SEED: highest speed {at}"
            points = by_seed(rows.frame)
            swims = fastest_within(points[points["method"] == id], power, ["seed"]).set_index("seed").sort_index()
        else:
            of = {"policy": id, **FINE} | ({} if place == EVERYWHERE else {"fluid": place})
            rows, what = results.rows("teacher_student", "evaluations", **of), "speed"
            swims = rows.frame.groupby("seed")[_SPENT].mean()
        yield step(id, rows, swims, what)
    what = f"of each seed the gait of the highest mean speed for at most {most:.1f} W in the mean: its speed, {place}"
    rows = results.rows("fourier", "optima", **FINE, tuned_to=INTEGRATED)
    yield step("one waveform for all", rows, _one_for_all(rows.frame, results.fluids, fluids, most), what)


def _step(prefix: str, id: str, rows: Rows, swims: pd.DataFrame, what: str) -> Step:
    """What rows give of a speed and its costs.

    Args:
        prefix: of the names of the numbers.
        id: of the step.
        rows: of a table.
        swims: made of the rows, columns `_SPENT`, one row a seed.
        what: describes how they were made.
    """
    weight = Robot(**rows.study.config["robot"]).total_mass * GRAVITY
    costs = {
        cost: rows.measure(
            f"{prefix}/{id}/{cost}", "1", swims[power] / (weight * swims["speed"]), f"{what}: its {LABELS[cost]}"
        )
        for power, cost in zip(POWERS, COSTS, strict=True)
        if swims[power].notna().any()
    }
    return Step(id, rows.measure(f"{prefix}/{id}", "m/s", swims["speed"], what), costs)


def front_rows(place: str) -> tuple[str, dict[str, str]]:
    """The table of a study that a front is in, and which of its rows; ideal switching has a table of its own."""
    return ("switching", {}) if place in (EVERYWHERE, SIMPLE_SUM) else ("fronts", {"front": place})


def _waveforms(swims: pd.DataFrame, fluids: Sequence[str], power: float) -> pd.DataFrame:
    """Each seed's fastest waveforms tuned to a fluid; over all fluids the best combination of one for each."""
    valid = swims[(swims["status"] == "ok") & swims["tuned_to"].isin(fluids)]
    fastest = {
        seed: best_mean([points[_SPENT].to_numpy() for _, points in of_seed.groupby("fluid")], power)
        for seed, of_seed in valid.groupby("seed")
        if of_seed["fluid"].nunique() == len(fluids)
    }
    return pd.DataFrame(fastest, _SPENT, dtype=float).T


def best_mean(fronts: Sequence[np.ndarray], power: float) -> np.ndarray:
    """The means of one point of each set that have the highest speed with a power within a bound; 0 if there are none.

    Args:
        fronts: speeds [m/s], powers [W] and more figures, shape (n_points, n_figures) each.
        power: the bound [W].
    """
    sums = np.zeros((1, fronts[0].shape[1]))
    for points in fronts:
        sums = (sums[:, None] + points).reshape(-1, points.shape[1])
    means = np.concatenate([np.zeros((1, sums.shape[1])), sums / len(fronts)])
    within = means[means[:, 1] <= power]
    return np.asarray(within[within[:, 0].argmax()])


def _one_for_all(swims: pd.DataFrame, fluids: Sequence[str], shown: Sequence[str], power: float) -> pd.DataFrame:
    """What each seed's one waveform that is fastest over all fluids within a mean power swims in those `shown`."""
    gait = ["seed", "harmonics", "objective", "price"]
    valid = swims[swims["status"] == "ok"]
    by_gait = valid.groupby(gait, dropna=False)
    means = by_gait[["speed", "power"]].mean()[by_gait.size() == len(fluids)]
    best = fastest_within(means.reset_index(), power, ["seed"])[gait]
    return valid[valid["fluid"].isin(shown)].merge(best, on=gait).groupby("seed")[_SPENT].mean()


def ledger_rows(accounts: Sequence[Account]) -> pd.DataFrame:
    """All accounts as one table, a row a step, with where each speed comes from."""
    rows = []
    for account in accounts:
        first = account.steps[0].speed.mean
        changes = [(None, None, None), *account.changes()]
        for (id, speed, costs), (center, low, high) in zip(account.steps, changes, strict=True):
            labels = {"view": account.view, "place": account.place, "step": id}
            gain = {"speed": speed.mean, "gain": speed.mean / first - 1, "change": center, "low": low, "high": high}
            known = {cost: costs[cost].mean if cost in costs else None for cost in COSTS}
            rows.append(labels | gain | known | {"n": speed.n, "table": speed.table, "rows": speed.rows})
    return pd.DataFrame(rows)


def ledger_tables(accounts: Sequence[Account], view: str) -> list[Table]:
    """One view as tables: speeds and what each step changes, then both costs of transport."""
    speeds, costs = {"": list(STEPS.values())}, {"": list(STEPS.values())}
    for account in (account for account in accounts if account.view == view):
        place, steps = account.place, account.steps
        speeds[f"{place}: v [m/s]"] = [f"{step.speed.text()} (n = {step.speed.n})" for step in steps]
        changes = [f"{center:+.3f} [{low:+.3f}, {high:+.3f}]" for center, low, high in account.changes()]
        speeds[f"{place}: change"] = ["", *changes]
        for name in COSTS:
            known = [step.costs.get(name) for step in steps]
            costs[f"{place}: {LABELS[name]}"] = ["–" if cost is None else cost.text(2) for cost in known]
    return [Table([*table], [list(row) for row in zip(*table.values(), strict=True)]) for table in (speeds, costs)]
