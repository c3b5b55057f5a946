"""Fronts of policies held against fronts of fixed gaits: at equal power, at equal speed, by hypervolume.

All by command power P, which searches and policies sought to keep low, as in the paper; of the points that are compared
P+ and CoT+ are told beside.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.report.standings import OVERALL, fastest_within, speeds_within
from snakebench.report.summary import mean, seeds, size, summary
from snakebench.report.tables import Table, averaged

_POWERS = (0.3, 1, 3, 5, 10, 15, 20)  # [W] at which speeds are compared
_FRONT = ["method", "front", "seed"]
_SPEEDS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # [m/s] at which the cost of transport is

Pair = tuple[str, str]  # a front of the policy, and the front of fixed gaits that it is held against


class Contest(NamedTuple):
    """Whose fronts are held against whose."""

    chosen: str  # the policy
    teacher: str | None  # which it was distilled from
    baselines: list[str]  # methods of fixed gaits
    policies: list[str]


def compared(
    points: pd.DataFrame, worth: pd.DataFrame, contest: Contest, names: Sequence[str], weight: float
) -> dict[str, Any]:
    """How fronts compare, as tables and sentences.

    Args:
        points: of every front: columns method, front, seed, speed, power, positive_power.
        worth: of every front, by method, front and seed: hypervolume, and hypervolume_searched in the other engine.
        contest: whose fronts are held against whose.
        names: of the fronts, in the order to be shown.
        weight: of the robot [N], for the cost of transport.
    """
    costs, positive_costs = (points[name] / (weight * points["speed"]) for name in ("power", "positive_power"))
    points = points.assign(cost=costs, positive_cost=positive_costs)
    fastest = {power: _of_every_front(fastest_within(points, power, _FRONT), points) for power in _POWERS}
    cheapest = {speed: _of_every_front(_cheapest(points, speed), points) for speed in _SPEEDS}
    speeds = {power: best["speed"] for power, best in fastest.items()}
    pairs = [(name, name) for name in names]
    if set(names) >= set(OVERALL):
        pairs.append(OVERALL)
    chosen, teacher, baselines, policies = contest
    n = points[points["method"] == chosen]["seed"].nunique()
    order = [(name, method) for name in names for method in (*baselines, *policies)]
    return {
        "answers": list(_answers(worth, chosen, teacher, pairs, baselines)),
        "gains": _gains(points, speeds, contest, pairs, n) if baselines else None,
        "losses": list(_losses(speeds, cheapest, worth, chosen, pairs, baselines)),
        "equal_power": _filled(
            "Highest speed [m/s] on each front for at most a power P: mean over the seeds ± half its 95 % Student-t"
            f" interval (n = {n}; fixed gaits have one front); a dash where not every seed has a point of so little"
            " power.",
            {f"{power:g} W": values for power, values in speeds.items() if power >= 1},
            order,
        ),
        "equal_speed": _filled(
            "Lowest cost of transport on each front of a point at least as fast: mean over the seeds ± half its 95 %"
            f" Student-t interval (n = {n}; fixed gaits have one front); a dash where not every seed is so fast.",
            {f"{speed:g} m/s": best["cost"] for speed, best in cheapest.items()},
            order,
        ),
        "worth": _hypervolumes(worth, order),
        "paid": _paid(fastest, cheapest, order) if points["positive_power"].notna().any() else [],
    }


def _paid(
    fastest: dict[float, pd.DataFrame], cheapest: dict[float, pd.DataFrame], order: Sequence[tuple[str, str]]
) -> list[Table]:
    """What the points that are compared take in the other currency."""
    return [
        _filled(
            "Positive power P+ [W] of the fastest points for at most a power P.",
            {f"{power:g} W": best["positive_power"] for power, best in fastest.items() if power >= 1},
            order,
        ),
        _filled(
            "Positive cost of transport CoT+ of the points of the lowest CoT that are at least as fast.",
            {f"{speed:g} m/s": best["positive_cost"] for speed, best in cheapest.items()},
            order,
        ),
    ]


def _cheapest(points: pd.DataFrame, speed: float) -> pd.DataFrame:
    """The point of each front of the lowest cost of transport that is at least as fast."""
    return points[points["speed"] >= speed].sort_values("cost", kind="stable").drop_duplicates(_FRONT)


def _of_every_front(best: pd.DataFrame, points: pd.DataFrame) -> pd.DataFrame:
    """A point of each front, by method, front and seed; NaN where there is none."""
    return best.set_index(_FRONT).reindex(points.groupby(_FRONT).size().index)


def _of(values: Any, method: str, front: str) -> Any:
    """The seeds of a method's front; empty if it has none."""
    level = values.index
    return values[(level.get_level_values("method") == method) & (level.get_level_values("front") == front)]


def _filled(caption: str, columns: dict[str, pd.Series], order: Sequence[tuple[str, str]]) -> Table:
    """A table with a row for each front and method, and a column for each series of values by seed."""
    table = pd.DataFrame(columns).reset_index()
    return summary(caption, table, _by(order), [(name, mean(name)) for name in columns], label="{}, {}".format)


def _by(order: Sequence[tuple[str, str]]) -> dict[str, Iterable[str]]:
    """A row for each front and method."""
    return {"front": dict.fromkeys(front for front, _ in order), "method": dict.fromkeys(name for _, name in order)}


def _against(pair: Pair, baseline: str) -> str:
    """Which front of fixed gaits a front of the policy is held against."""
    own, other = pair
    return f"{own}, {baseline}" + ("" if own == other else f"’s {other}")


def _answers(
    worth: pd.DataFrame, chosen: str, teacher: str | None, pairs: Sequence[Pair], baselines: Sequence[str]
) -> Iterator[str]:
    """The findings, a sentence each."""
    volumes = worth["hypervolume"]
    for own, other in pairs:
        mine = _of(volumes, chosen, own)
        if not len(mine):
            continue
        beside = [
            f"{100 * (mine.mean() / theirs.mean() - 1):+.0f} % against the {baseline}"
            for baseline in baselines
            if len(theirs := _of(volumes, baseline, other))
        ]
        where = f"In {own}" if own not in OVERALL else f"Over all fluids, {own}"
        held = "" if own == other else f", held against {other} fronts"
        tail = f": {', '.join(beside)}" if beside else ""
        yield f"{where}, the {chosen}'s front is worth {averaged(mine, 2)} m/s W (n = {len(mine)}){held}{tail}."
    if teacher:
        kept = {
            own: shares
            for own, other in pairs
            if own == other and len(shares := _shares(volumes, chosen, teacher, own))
        }
        said = "; ".join(f"{name} {averaged(100 * shares, 1)} %" for name, shares in kept.items())
        if said:
            n = len(next(iter(kept.values())))
            yield f"The {chosen} keeps of its teacher's hypervolume: {said} (n = {n})."


def _shares(volumes: pd.Series, student: str, teacher: str, front: str) -> pd.Series:
    """The student's share of its teacher's hypervolume, by seed."""
    own, taught = (_of(volumes, name, front).droplevel(["method", "front"]) for name in (student, teacher))
    return (own / taught).dropna()


def _gains(
    points: pd.DataFrame, speeds: dict[float, pd.Series], contest: Contest, pairs: Sequence[Pair], n: int
) -> Table:
    """How much faster the policy, of n seeds, is than fixed gaits at equal power."""
    rows, chosen = [], contest.chosen
    for own, other in pairs:
        for baseline in contest.baselines:
            held = next(iter(speeds.values()))
            if len(_of(held, baseline, other)) and len(_of(held, chosen, own)):
                cells = [
                    averaged(100 * (_of(values, chosen, own) / _of(values, baseline, other).mean() - 1), 0)
                    for values in speeds.values()
                ]
                rows.append([_against((own, other), baseline), *cells, _leads(points, chosen, own, baseline, other)])
    return Table(
        f"How much faster the {chosen} is at equal power P than a front of fixed gaits [%]: mean ± half its 95 %"
        f" Student-t interval (n = {n}); and from which power on its mean is the faster one, up to 20 W.",
        ["front, against", *(f"{power:g} W" for power in speeds), "leads from"],
        rows,
    )


def _leads(points: pd.DataFrame, chosen: str, own: str, baseline: str, other: str) -> str:
    """The power from which on the policy's mean speed is above that of fixed gaits, up to 20 W."""
    powers = np.geomspace(0.05, 20, 261)
    mine = points[(points["method"] == chosen) & (points["front"] == own)]
    theirs = points[(points["method"] == baseline) & (points["front"] == other)]
    of_seeds = [np.nan_to_num(speeds_within(part, powers)) for _, part in mine.groupby("seed")]
    behind = np.flatnonzero(np.mean(of_seeds, axis=0) <= np.nan_to_num(speeds_within(theirs, powers)))
    if not len(behind):
        return f"{powers[0]:g} W"
    return "not at 20 W" if behind[-1] == len(powers) - 1 else f"{powers[behind[-1] + 1]:.2g} W"


def _losses(
    speeds: dict[float, pd.Series],
    cheapest: dict[float, pd.DataFrame],
    worth: pd.DataFrame,
    chosen: str,
    pairs: Sequence[Pair],
    baselines: Sequence[str],
) -> Iterator[str]:
    """Where fixed gaits are better than the policy by their means, a sentence each."""
    for own, other in pairs:
        for baseline in baselines:
            faster = [
                f"{power:g} W ({theirs:.3f} against {mine:.3f} m/s)"
                for power, values in speeds.items()
                if (theirs := _of(values, baseline, other).mean()) > (mine := _of(values, chosen, own).fillna(0).mean())
            ]
            cheaper = [
                f"{speed:g} m/s ({theirs['cost']:.3f} against {mine['cost']:.3f}{_positive(theirs, mine)})"
                for speed, best in cheapest.items()
                if (theirs := _of(best, baseline, other).mean())["cost"]
                < (mine := _of(best, chosen, own).mean())["cost"]
            ]
            mine, theirs = (_of(worth["hypervolume"], *which).mean() for which in ((chosen, own), (baseline, other)))
            lost = [f"faster for {', '.join(faster)}"] if faster else []
            lost += [f"of lower cost of transport for at least {', '.join(cheaper)}"] if cheaper else []
            if mine < theirs:
                lost.append(f"of more hypervolume ({theirs:.2f} against {mine:.2f})")
            if lost:
                yield f"{_against((own, other), baseline)}: {'; '.join(lost)}"


def _positive(theirs: pd.Series, mine: pd.Series) -> str:
    """The CoT+ of two of the lowest CoT, where both are known."""
    costs = theirs["positive_cost"], mine["positive_cost"]
    return "" if np.isnan(costs).any() else f", CoT+ {costs[0]:.3f} against {costs[1]:.3f}"


def _hypervolumes(worth: pd.DataFrame, order: Sequence[tuple[str, str]]) -> Table:
    gap = (worth["hypervolume"] - worth["hypervolume_searched"]).abs()
    return summary(
        "Hypervolume [m/s W] of each front from the reference: mean ± half its 95 % Student-t interval, its largest"
        " difference Δ to the planar engine, every seed.",
        worth.assign(gap=gap).reset_index(),
        _by(order),
        [
            *(("n", size), ("hypervolume", mean("hypervolume", 2))),
            ("Δ engine", lambda part: f"{part['gap'].max():.2f}"),
            ("seeds", lambda part: seeds(part["hypervolume"]) if len(part) > 1 else ""),
        ],
        label="{}, {}".format,
    )
