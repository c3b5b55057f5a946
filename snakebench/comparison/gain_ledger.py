"""The gain ledger: what makes the student faster than the paper's sinusoids, step by step (ours).

The paper compares the two ends. Between them lie the range of the actuators, the free waveform, feedback with and
without privileged information, and, last, what is lost where one gait without any feedback must do in all fluids.

Speeds are compared at equal command power P, since fronts are of P. Beside each stand both costs of transport of the
very gaits whose speed it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.comparison.results import FINE, Measurement, Results
from snakebench.metrics import GRAVITY
from snakebench.report.equal_power import fastest_within
from snakebench.report.table import COSTS, LABELS, POWERS, Table
from snakebench.robot import Robot
from snakebench.store import EXTENDED, INTEGRATED, PAPER, SIMPLE_SUM

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
_SPACES = {"sinusoid": PAPER, "wider sinusoid": EXTENDED}
_SPENT = ["speed", *POWERS]

Swims = Callable[[pd.DataFrame], pd.DataFrame]  # of rows of a table, what each seed swims: columns `_SPENT`


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
    if paired and len(a) == len(b) > 1:
        low, high = stats.ttest_1samp(a - b, 0.0).confidence_interval()
    elif len(a) > 1 and len(b) > 1:
        low, high = stats.ttest_ind(a, b, equal_var=False).confidence_interval()
    elif len(a) > 1 or len(b) > 1:
        many = a if len(a) > 1 else b
        half = float(stats.sem(many) * stats.t.ppf(0.975, len(many) - 1))
        low, high = center - half, center + half
    else:
        low = high = center
    return center, float(low), float(high)


def ledger(results: Results) -> list[Account]:
    """All accounts, by view and place.

    Raises:
        Missing: when results that they need are not there.
    """
    own = {fluid: power.mean for fluid, power in results.in_fluids("power").items()}
    own[EVERYWHERE] = float(np.mean(list(own.values())))
    return [
        Account(view, place, list(_steps(results, view, place, own)))
        for view in VIEWS
        for place in (*results.fluids, EVERYWHERE)
    ]


def _steps(results: Results, view: str, place: str, own: dict[str, float]) -> Iterator[Step]:
    powers = {"equal": dict.fromkeys(own, EQUAL), "own": own, "top": dict.fromkeys(own, TOP)}[view]
    power, fluids = powers[place], results.fluids if place == EVERYWHERE else [place]
    at = f"for at most {power:.1f} W"
    table, where = front_rows(place)
    for id, space in _SPACES.items():
        what = f"highest speed {at}"
        yield _step(results, view, place, id, "pareto", table, _fastest(power), what, space=space, **where)
    what = f"of each seed, tuned to {', '.join(fluids)}: highest mean speed {at}"
    yield _step(results, view, place, "free waveform", "fourier", "optima", _waveforms(fluids, power), what, **FINE)
    for id in ("teacher", "student"):
        if view == "equal":
            what = f"space = {id} SEED: highest speed {at}"
            yield _step(results, view, place, id, "learned_front", table, _fastest(power, id), what, **where)
        else:
            of = {"policy": id, **FINE} | ({} if place == EVERYWHERE else {"fluid": place})
            yield _step(results, view, place, id, "teacher_student", "evaluations", _means, "speed", **of)
    most = powers[EVERYWHERE]
    what = f"of each seed the gait of the highest mean speed for at most {most:.1f} W in the mean: its speed, {place}"
    swims, of = _one_for_all(results.fluids, fluids, most), FINE | {"tuned_to": INTEGRATED}
    yield _step(results, view, place, "one waveform for all", "fourier", "optima", swims, what, **of)


def _step(
    results: Results, view: str, place: str, id: str, study: str, table: str, swims: Swims, what: str, **where: str
) -> Step:
    """What a table says of a speed and its costs; `what` says which swims are meant."""
    weight = Robot(**results.study(study).config["robot"]).total_mass * GRAVITY
    name = f"ledger/{view}/{place}/{id}"
    known = swims(results.rows(study, table, **where)).notna().any()

    def cost(power: str) -> Callable[[pd.DataFrame], pd.Series]:
        return lambda part: (taken := swims(part))[power] / (weight * taken["speed"])

    costs = {}
    for power, label in zip(POWERS, COSTS, strict=True):
        if known[power]:
            of = f"{what}: its {LABELS[label]}"
            costs[label] = results.measure(f"{name}/{label}", "1", study, table, cost(power), of, **where)
    speed = results.measure(name, "m/s", study, table, lambda part: swims(part)["speed"], what, **where)
    return Step(id, speed, costs)


def front_rows(place: str) -> tuple[str, dict[str, str]]:
    """The table of a study that a front is in, and which of its rows; ideal switching has a table of its own."""
    return ("switching", {}) if place in (EVERYWHERE, SIMPLE_SUM) else ("fronts", {"front": place})


def _fastest(power: float, policy: str | None = None) -> Swims:
    """The fastest point of a front within a power; of each seed of a preference-conditioned policy."""

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        if policy is None:
            return fastest_within(part, power)[_SPENT]
        own = part[part["space"].str.rsplit(" ", n=1).str[0] == policy]
        return fastest_within(own, power, ["space"]).set_index("space").sort_index()[_SPENT]

    return swims


def _waveforms(fluids: Sequence[str], power: float) -> Swims:
    """Each seed's fastest waveforms tuned to a fluid; over all fluids the best combination of one for each."""

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        valid = part[(part["status"] == "ok") & part["tuned_to"].isin(fluids)]
        by_seed = {
            seed: best_mean([points[_SPENT].to_numpy() for _, points in of_seed.groupby("fluid")], power)
            for seed, of_seed in valid.groupby("seed")
            if of_seed["fluid"].nunique() == len(fluids)
        }
        return pd.DataFrame(by_seed, _SPENT, dtype=float).T

    return swims


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


def _means(part: pd.DataFrame) -> pd.DataFrame:
    """The policies of the paper's reward, whatever their power."""
    return part.groupby("seed")[_SPENT].mean()


def _one_for_all(fluids: Sequence[str], here: Sequence[str], power: float) -> Swims:
    """Each seed's one waveform that is fastest over all fluids within a mean power: what it swims in those here."""

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        gait = ["seed", "harmonics", "objective", "price"]
        valid = part[part["status"] == "ok"]
        by_gait = valid.groupby(gait, dropna=False)
        means = by_gait[["speed", "power"]].mean()[by_gait.size() == len(fluids)]
        best = fastest_within(means.reset_index(), power, ["seed"])[gait]
        return valid[valid["fluid"].isin(here)].merge(best, on=gait).groupby("seed")[_SPENT].mean()

    return swims


def ledger_rows(accounts: Sequence[Account]) -> pd.DataFrame:
    """All accounts as one table, a row a step, with where each speed comes from."""
    rows = []
    for account in accounts:
        changes = [(None, None, None), *account.changes()]
        for step, (center, low, high) in zip(account.steps, changes, strict=True):
            labels = {"view": account.view, "place": account.place, "step": step.id}
            first, mean = account.steps[0].speed.mean, step.speed.mean
            speed = {"speed": mean, "gain": mean / first - 1, "change": center, "low": low, "high": high}
            costs = {label: step.costs[label].mean if label in step.costs else None for label in COSTS}
            origin = {"n": step.speed.n, "table": step.speed.table, "rows": step.speed.rows}
            rows.append(labels | speed | costs | origin)
    return pd.DataFrame(rows)


def ledger_tables(accounts: Sequence[Account], view: str) -> list[Table]:
    """One view as tables: speeds and what each step changes, then both costs of transport."""
    speeds, costs = pd.DataFrame(index=list(STEPS)), pd.DataFrame(index=list(STEPS))
    for place, steps, account in ((one.place, one.steps, one) for one in accounts if one.view == view):
        speeds[f"{place}: v [m/s]"] = [f"{step.speed.text()} (n = {step.speed.n})" for step in steps]
        changes = [f"{center:+.3f} [{low:+.3f}, {high:+.3f}]" for center, low, high in account.changes()]
        speeds[f"{place}: change"] = ["", *changes]
        for name in COSTS:
            known = [step.costs.get(name) for step in steps]
            costs[f"{place}: {LABELS[name]}"] = ["–" if cost is None else cost.text(2) for cost in known]
    return [
        Table(["", *table], [[STEPS[id], *row] for id, *row in table.itertuples(name=None)])
        for table in (speeds, costs)
    ]
