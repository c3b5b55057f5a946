"""The gain ledger: what makes the student faster than the paper's sinusoids, step by step (ours).

The paper compares the two ends. Between them lie the range of the actuators, the free waveform, feedback with and
without knowing the fluid, and, last, what is lost where one gait without any feedback must do in all fluids.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.reporting.fronts import fastest
from snakebench.reporting.quantities import Quantity, Results, policy
from snakebench.reporting.tables import Table
from snakebench.store import EXTENDED, INTEGRATED, PAPER, SIMPLE_SUM

EVERYWHERE = "all fluids"
MOST = 30.0  # power within which speeds count as top speed [W], as for hypervolume
EQUAL = 10.0  # power at which policies with a dial are compared [W]

_At = Callable[[str], float]  # the power at a place [W]


class Step(NamedTuple):
    """A speed of the ledger, and whose it is."""

    name: str
    method: str
    speed: Quantity


class Account(NamedTuple):
    """The steps from the paper's sinusoids to the student, and to a gait that does not adapt, at one place."""

    view: str  # at which power
    place: str  # a fluid, or all
    steps: list[Step]

    def changes(self) -> Iterator[tuple[float, float, float]]:
        """Change of speed from each step to the next, and its 95 % interval [m/s]."""
        for before, after in zip(self.steps, self.steps[1:], strict=False):
            yield change(before.speed, after.speed, paired=(before.method, after.method) == ("teacher", "student"))


def change(before: Quantity, after: Quantity, *, paired: bool = False) -> tuple[float, float, float]:
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
    views: dict[str, tuple[_At, Callable[..., Quantity]]] = {
        f"at {EQUAL:g} W": (lambda _: EQUAL, _dial),
        "at the student's power": (own.__getitem__, _published),
        f"top speed within {MOST:g} W": (lambda _: MOST, _published),
    }
    return [
        Account(view, place, list(_steps(results, view, place, at, learned)))
        for view, (at, learned) in views.items()
        for place in (*results.fluids, EVERYWHERE)
    ]


def _steps(results: Results, view: str, place: str, at: _At, learned: Callable[..., Quantity]) -> Iterator[Step]:
    power = at(place)

    def said(what: str) -> str:
        return f"{what}, {place}, {view}"

    for name, method, space in (
        ("sinusoid in the paper's range", "sinusoid", PAPER),
        ("wider range of the actuators", "wider sinusoid", EXTENDED),
    ):
        yield Step(name, method, _sinusoid(results, said(method), space, place, power))
    yield Step("free waveform", "free waveform", _waveform(results, said("free waveform"), place, power))
    for name, method in (("feedback, told the fluid", "teacher"), ("must infer the fluid", "student")):
        yield Step(name, method, learned(results, said(method), method, place, power))
    fixed = _fixed(results, said("one waveform for all"), place, at(EVERYWHERE))
    yield Step("no feedback: one gait for all", "one waveform for all", fixed)


def front_rows(place: str) -> tuple[str, dict[str, str]]:
    """The table of a study that a front is in, and which of its rows; ideal switching has a table of its own."""
    return ("switching", {}) if place in (EVERYWHERE, SIMPLE_SUM) else ("fronts", {"front": place})


def _sinusoid(results: Results, name: str, space: str, place: str, power: float) -> Quantity:
    def values(part: pd.DataFrame) -> pd.Series:
        return pd.Series([fastest(part, power)])

    table, where = front_rows(place)
    what = f"highest speed for at most {power:.1f} W"
    return results.derived(name, "m/s", "pareto", table, values, what, space=space, **where)


def _waveform(results: Results, name: str, place: str, power: float) -> Quantity:
    """Each seed's fastest waveforms tuned to the fluid; over all fluids the best combination of one for each."""
    fluids = results.fluids if place == EVERYWHERE else [place]

    def values(part: pd.DataFrame) -> pd.Series:
        valid = part[(part["status"] == "ok") & part["tuned_to"].isin(fluids)]
        by_seed = {
            seed: best_mean([points[["speed", "power"]].to_numpy() for _, points in of_seed.groupby("fluid")], power)
            for seed, of_seed in valid.groupby("seed")
            if of_seed["fluid"].nunique() == len(fluids)
        }
        return pd.Series(by_seed, dtype=float)

    what = f"of each seed, tuned to {', '.join(fluids)}: highest mean speed for at most {power:.1f} W"
    return results.derived(name, "m/s", "fourier", "optima", values, what, variant="finer step")


def best_mean(fronts: Sequence[np.ndarray], power: float) -> float:
    """The highest mean speed of one point of each set whose mean power is within a bound; 0 when there is none.

    Args:
        fronts: speeds [m/s] and powers [W], shape (n_points, 2) each.
        power: the bound [W].
    """
    sums = np.zeros((1, 2))
    for points in fronts:
        sums = (sums[:, None] + points).reshape(-1, 2)
    means = sums / len(fronts)
    return float(means[means[:, 1] <= power, 0].max(initial=0.0))


def _published(results: Results, name: str, pilot: str, place: str, _: float) -> Quantity:
    """The speed of the policies of the paper's reward, whatever their power."""
    where = {"policy": pilot, "variant": "finer step"} | ({} if place == EVERYWHERE else {"fluid": place})
    return results.quantity(name, "m/s", "teacher_student", "evaluations", "speed", **where)


def _dial(results: Results, name: str, pilot: str, place: str, power: float) -> Quantity:
    """The speed at a power of the fronts of policies with a dial."""

    def values(part: pd.DataFrame) -> pd.Series:
        own = part[part["space"].str.rsplit(" ", n=1).str[0] == pilot]
        return own.groupby("space")[["speed", "power"]].apply(fastest, power)

    table, where = front_rows(place)
    what = f"space = {pilot} SEED: highest speed for at most {power:.1f} W"
    return results.derived(name, "m/s", "learned_front", table, values, what, **where)


def _fixed(results: Results, name: str, place: str, power: float) -> Quantity:
    """The speed of each seed's one waveform for all fluids that is fastest over all of them within a mean power."""

    def values(part: pd.DataFrame) -> pd.Series:
        gait = ["seed", "harmonics", "objective", "price"]
        swims = part[part["status"] == "ok"].groupby(gait, dropna=False)
        means = swims[["speed", "power"]].mean()[swims.size() == len(results.fluids)]
        best = means[means["power"] <= power].groupby("seed")["speed"].idxmax()
        found = {index[0]: part.set_index(gait).loc[[index]] for index in best}
        return pd.Series(
            {
                seed: rows.loc[rows["fluid"].isin([place]) | (place == EVERYWHERE), "speed"].mean()
                for seed, rows in found.items()
            }
        )

    what = f"of each seed the gait of the highest mean speed for at most {power:.1f} W in the mean: its speed, {place}"
    return results.derived(name, "m/s", "fourier", "optima", values, what, variant="finer step", tuned_to=INTEGRATED)


def ledger_table(accounts: Sequence[Account], view: str) -> Table:
    """One view as a table: the speed at each step, and the change that it makes."""
    own = [account for account in accounts if account.view == view]
    changes = [list(account.changes()) for account in own]
    rows = []
    for k, step in enumerate(own[0].steps):
        cells = []
        for account, changed in zip(own, changes, strict=True):
            speed = account.steps[k].speed
            cells.append(f"{speed.said()} (n = {speed.n})")
            cells.append("" if k == 0 else _said(changed[k - 1], account.steps[k - 1].speed.mean))
        rows.append([step.name, *cells])
    head = [cell for account in own for cell in (f"{account.place}: v [m/s]", "change")]
    return Table(
        f"{view[0].upper()}{view[1:]}: speed, and what each step changes: in m/s with its 95 % interval, and in %.",
        ["", *head],
        rows,
    )


def ledger_rows(accounts: Sequence[Account]) -> pd.DataFrame:
    """All accounts as one table, a row a step, with where each speed comes from."""
    rows = []
    for account in accounts:
        changes = [(None, None, None), *account.changes()]
        for step, (center, low, high) in zip(account.steps, changes, strict=True):
            about = {"view": account.view, "place": account.place, "step": step.name, "speed": step.speed.mean}
            gained = {"change": center, "low": low, "high": high, "n": step.speed.n}
            rows.append(about | gained | {"table": step.speed.table, "rows": step.speed.rows})
    return pd.DataFrame(rows)


def _said(step: tuple[float, float, float], before: float) -> str:
    center, low, high = step
    interval = f" [{low:+.3f}, {high:+.3f}]" if high > low else ""
    share = f", {100 * center / before:+.0f} %" if before > 0 else ""
    return f"{center:+.3f}{interval}{share}"
