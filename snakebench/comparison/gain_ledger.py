"""The gain ledger: what makes the student faster than the paper's sinusoids, step by step (ours).

The paper compares the two ends. Between them lie the range of the actuators, the free waveform, feedback with and
without knowing the fluid, and, last, what is lost where one gait without any feedback must do in all fluids.

Speeds are compared at equal command power P, since fronts are of P. Beside each stand both costs of transport of the
very gaits whose speed it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.comparison.quantities import Measurement, Results, known, policy
from snakebench.metrics import GRAVITY
from snakebench.report.equal_power import fastest_within
from snakebench.report.tables import Table, in_both_currencies
from snakebench.robot import Robot
from snakebench.store import EXTENDED, INTEGRATED, PAPER, SIMPLE_SUM

EVERYWHERE = "all fluids"
MOST = 30.0  # power within which speeds count as top speed [W], as for hypervolume
EQUAL = 10.0  # power at which policies with a dial are compared [W]

_At = Callable[[str], float]  # the power at a place [W]
_Swims = Callable[[pd.DataFrame], pd.DataFrame]  # of rows of a table, what each seed swims: columns `_SPENT`
_SPENT = ["speed", "power", "positive_power"]
COSTS = {"cost_of_transport": "CoT", "positive_cost_of_transport": "CoT+"}


class Found(NamedTuple):
    """A speed, and the costs of transport at it where they are known, by the keys of `COSTS`."""

    speed: Measurement
    costs: dict[str, Measurement]


class Step(NamedTuple):
    """A speed of the ledger, whose it is, and the costs of transport at it, as `Found`."""

    name: str
    method: str
    speed: Measurement
    costs: dict[str, Measurement]


class Account(NamedTuple):
    """The steps from the paper's sinusoids to the student, and to a gait that does not adapt, at one place."""

    view: str  # at which power
    place: str  # a fluid, or all
    steps: list[Step]

    def changes(self) -> Iterator[tuple[float, float, float]]:
        """Change of speed from each step to the next, and its 95 % interval [m/s]."""
        for before, after in zip(self.steps, self.steps[1:], strict=False):
            yield change(before.speed, after.speed, paired=(before.method, after.method) == ("teacher", "student"))


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
    own = {fluid: policy(results, "power", fluid, unit="W").mean for fluid in results.fluids}
    own[EVERYWHERE] = float(np.mean([own[fluid] for fluid in results.fluids]))
    views: dict[str, tuple[_At, Callable[..., Found]]] = {
        f"at {EQUAL:g} W": (lambda _: EQUAL, _dial),
        "at the student's power": (own.__getitem__, _published),
        f"top speed within {MOST:g} W": (lambda _: MOST, _published),
    }
    return [
        Account(view, place, list(_steps(results, view, place, at, learned)))
        for view, (at, learned) in views.items()
        for place in (*results.fluids, EVERYWHERE)
    ]


def _steps(results: Results, view: str, place: str, at: _At, learned: Callable[..., Found]) -> Iterator[Step]:
    power = at(place)

    def name_at(what: str) -> str:
        return f"{what}, {place}, {view}"

    for name, method, space in (
        ("sinusoid in the paper's range", "sinusoid", PAPER),
        ("wider range of the actuators", "wider sinusoid", EXTENDED),
    ):
        yield Step(name, method, *_sinusoid(results, name_at(method), space, place, power))
    yield Step("free waveform", "free waveform", *_waveform(results, name_at("free waveform"), place, power))
    for name, method in (("feedback, told the fluid", "teacher"), ("must infer the fluid", "student")):
        yield Step(name, method, *learned(results, name_at(method), method, place, power))
    fixed = _fixed(results, name_at("one waveform for all"), place, at(EVERYWHERE))
    yield Step("no feedback: one gait for all", "one waveform for all", *fixed)


def _found(results: Results, name: str, study: str, table: str, swims: _Swims, what: str, **where: str) -> Found:
    """What a table says of a speed and its costs; `what` says which swims are meant."""
    weight = Robot(**results.manifest(study)["config"]["robot"]).total_mass * GRAVITY

    def cost(power: str, label: str) -> Measurement:
        def values(part: pd.DataFrame) -> pd.Series:
            taken = swims(in_both_currencies(part))
            return taken[power] / (weight * taken["speed"])

        return results.derived(f"{name}: {label}", "1", study, table, values, f"{what}: its {label}", **where)

    speed = results.derived(
        name, "m/s", study, table, lambda part: swims(in_both_currencies(part))["speed"], what, **where
    )
    powers = zip(COSTS.items(), _SPENT[1:], strict=True)
    costs = {key: known(partial(cost, power, label)) for (key, label), power in powers}
    return Found(speed, {key: one for key, one in costs.items() if one})


def front_rows(place: str) -> tuple[str, dict[str, str]]:
    """The table of a study that a front is in, and which of its rows; ideal switching has a table of its own."""
    return ("switching", {}) if place in (EVERYWHERE, SIMPLE_SUM) else ("fronts", {"front": place})


def _sinusoid(results: Results, name: str, space: str, place: str, power: float) -> Found:
    def swims(part: pd.DataFrame) -> pd.DataFrame:
        return fastest_within(part, power)[_SPENT]

    table, where = front_rows(place)
    what = f"highest speed for at most {power:.1f} W"
    return _found(results, name, "pareto", table, swims, what, space=space, **where)


def _waveform(results: Results, name: str, place: str, power: float) -> Found:
    """Each seed's fastest waveforms tuned to the fluid; over all fluids the best combination of one for each."""
    fluids = results.fluids if place == EVERYWHERE else [place]

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        valid = part[(part["status"] == "ok") & part["tuned_to"].isin(fluids)]
        by_seed = {
            seed: best_mean([points[_SPENT].to_numpy() for _, points in of_seed.groupby("fluid")], power)
            for seed, of_seed in valid.groupby("seed")
            if of_seed["fluid"].nunique() == len(fluids)
        }
        return pd.DataFrame(by_seed, _SPENT, dtype=float).T

    what = f"of each seed, tuned to {', '.join(fluids)}: highest mean speed for at most {power:.1f} W"
    return _found(results, name, "fourier", "optima", swims, what, variant="finer step")


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


def _published(results: Results, name: str, pilot: str, place: str, _: float) -> Found:
    """The speed of the policies of the paper's reward, whatever their power."""

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        return part.groupby("seed")[_SPENT].mean()

    where = {"policy": pilot, "variant": "finer step"} | ({} if place == EVERYWHERE else {"fluid": place})
    return _found(results, name, "teacher_student", "evaluations", swims, "speed", **where)


def _dial(results: Results, name: str, pilot: str, place: str, power: float) -> Found:
    """The speed at a power of the fronts of policies with a dial."""

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        own = part[part["space"].str.rsplit(" ", n=1).str[0] == pilot]
        return fastest_within(own, power, ["space"]).set_index("space").sort_index()[_SPENT]

    table, where = front_rows(place)
    what = f"space = {pilot} SEED: highest speed for at most {power:.1f} W"
    return _found(results, name, "learned_front", table, swims, what, **where)


def _fixed(results: Results, name: str, place: str, power: float) -> Found:
    """The speed of each seed's one waveform for all fluids that is fastest over all of them within a mean power."""

    def swims(part: pd.DataFrame) -> pd.DataFrame:
        gait = ["seed", "harmonics", "objective", "price"]
        by_gait = part[part["status"] == "ok"].groupby(gait, dropna=False)
        means = by_gait[["speed", "power"]].mean()[by_gait.size() == len(results.fluids)]
        best = fastest_within(means.reset_index(), power, ["seed"]).sort_values("seed")
        found = {index[0]: part.set_index(gait).loc[[index]] for index in best[gait].itertuples(index=False, name=None)}
        here = {
            seed: rows.loc[rows["fluid"].isin([place]) | (place == EVERYWHERE), _SPENT].mean()
            for seed, rows in found.items()
        }
        return pd.DataFrame(here, _SPENT, dtype=float).T

    what = f"of each seed the gait of the highest mean speed for at most {power:.1f} W in the mean: its speed, {place}"
    return _found(results, name, "fourier", "optima", swims, what, variant="finer step", tuned_to=INTEGRATED)


def ledger_table(accounts: Sequence[Account], view: str) -> Table:
    """One view as a table: the speed at each step, and the change that it makes."""
    own = [account for account in accounts if account.view == view]
    changes = [list(account.changes()) for account in own]
    rows = []
    for k, step in enumerate(own[0].steps):
        cells = []
        for account, changed in zip(own, changes, strict=True):
            speed = account.steps[k].speed
            cells.append(f"{speed.text()} (n = {speed.n})")
            cells.append("" if k == 0 else _change_text(changed[k - 1], account.steps[k - 1].speed.mean))
        rows.append([step.name, *cells])
    head = [cell for account in own for cell in (f"{account.place}: v [m/s]", "change")]
    return Table(
        f"{view[0].upper()}{view[1:]}: speed, and what each step changes: in m/s with its 95 % interval, and in %.",
        ["", *head],
        rows,
    )


def cost_table(accounts: Sequence[Account], view: str) -> Table:
    """One view as a table: both costs of transport at the speed of each step, and what they are of the first step's."""
    own = [account for account in accounts if account.view == view]
    rows = [
        [
            step.name,
            *(
                _times(account.steps[k].costs.get(key), account.steps[0].costs.get(key))
                for account in own
                for key in COSTS
            ),
        ]
        for k, step in enumerate(own[0].steps)
    ]
    return Table(
        f"{view[0].upper()}{view[1:]}: costs of transport of the same gaits, and as multiples of the first one's.",
        ["", *(f"{account.place}: {label}" for account in own for label in COSTS.values())],
        rows,
    )


def _times(cost: Measurement | None, first: Measurement | None) -> str:
    """A cost and how many times another it is, as far as they are known."""
    if cost is None:
        return "–"
    return cost.text(2) + (f", × {cost.mean / first.mean:.2f}" if first and first is not cost else "")


def ledger_rows(accounts: Sequence[Account]) -> pd.DataFrame:
    """All accounts as one table, a row a step, with where each speed comes from."""
    rows = []
    for account in accounts:
        changes = [(None, None, None), *account.changes()]
        for step, (center, low, high) in zip(account.steps, changes, strict=True):
            about = {"view": account.view, "place": account.place, "step": step.name, "speed": step.speed.mean}
            gained = {"change": center, "low": low, "high": high, "n": step.speed.n}
            costs = {key: step.costs[key].mean if key in step.costs else None for key in COSTS}
            rows.append(about | gained | costs | {"table": step.speed.table, "rows": step.speed.rows})
    return pd.DataFrame(rows)


def _change_text(step: tuple[float, float, float], before: float) -> str:
    center, low, high = step
    interval = f" [{low:+.3f}, {high:+.3f}]" if high > low else ""
    share = f", {100 * center / before:+.0f} %" if before > 0 else ""
    return f"{center:+.3f}{interval}{share}"
