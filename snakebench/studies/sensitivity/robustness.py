"""Which conclusions about a policy hold where: each a margin of every swim, positive where it holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from snakebench.report.equal_power import speeds_within
from snakebench.report.measurements import of
from snakebench.report.method_names import name_of
from snakebench.report.tables import Table
from snakebench.store import EXTENDED, INTEGRATED, PAPER

_KEPT = 0.95  # of the teacher's speed


class Place(NamedTuple):
    """Where policies swam: at a physics rate, with a robot, as they were found or learned anew."""

    name: str
    swims: pd.DataFrame  # of policies, columns method, seed, fluid and figures
    robot: str  # whose fronts they are held against


class Conclusion(NamedTuple):
    """A conclusion, and its margins at each place: shares by which it holds, one a swim or a seed."""

    name: str
    margins: dict[str, pd.Series]

    def holds(self, place: str) -> bool:
        """Whether it holds for every swim there."""
        return bool((self.margins[place] > 0).all())

    def cell(self, place: str) -> str:
        """Whether it holds there, for how many, and the least margin [%]."""
        margins = self.margins.get(place)
        if margins is None:
            return "–"
        held = int((margins > 0).sum())
        word = "yes" if held == len(margins) else "partly" if held else "no"
        least = margins.min()
        return f"{word}, {held} of {len(margins)}" + (f", least {100 * least:+.0f} %" if np.isfinite(least) else "")


def conclusions(
    places: Sequence[Place], fronts: pd.DataFrame, fluids: Sequence[str], pilots: Sequence[str]
) -> list[Conclusion]:
    """Every conclusion that can be tried, at every place where it can be.

    Args:
        places: where policies swam.
        fronts: of fixed gaits, columns robot, space, front, speed, power.
        fluids: in the order of their viscosity.
        pilots: the policy that conclusions are about, and its teacher if that was compared too.
    """
    tried = []
    for name, margins_at in _conclusions(fronts, fluids, pilots):
        margins = {place.name: found for place in places if len(found := margins_at(place))}
        if margins:
            tried.append(Conclusion(name, margins))
    return tried


def conclusion_table(found: Sequence[Conclusion], places: Sequence[Place]) -> Table:
    """The conclusions as a table."""
    names = [place.name for place in places]
    return Table(
        "Which conclusions hold where: for how many swims (or seeds, where fluids are compared), and the least margin"
        " [%]. Fronts are those of the same robot's sinusoids, from this study's grid; speeds compare at the policy's"
        " own power.",
        ["the policy", *names],
        [[verdict.name, *map(verdict.cell, names)] for verdict in found],
    )


def _conclusions(
    fronts: pd.DataFrame, fluids: Sequence[str], pilots: Sequence[str]
) -> Iterator[tuple[str, Callable[[Place], pd.Series]]]:
    policy = pilots[0]
    for space in [name for name in (PAPER, EXTENDED) if name in set(fronts["space"])]:
        of_space = fronts[fronts["space"] == space]
        yield f"is faster than the {name_of(space)}'s front of each fluid", partial(_beyond, of_space, policy, fluids)
        overall = f"is faster than one {name_of(space)} for all fluids, by means over them"
        yield overall, partial(_beyond_overall, of_space, policy, len(fluids))
    if len(fluids) > 1:
        ends = fluids[0], fluids[-1]
        way = f"from {ends[0]} to {ends[1]}"
        yield f"lowers its frequency {way}, as the paper's does", partial(_changes, policy, ends, "swim_frequency", -1)
        yield (
            f"widens its tail's swing {way}, as the paper's does",
            partial(_changes, policy, ends, "tail_amplitude", 1),
        )
        yield f"raises its torque {way}, as the paper's does", partial(_changes, policy, ends, "torque_amplitude", 1)
    for teacher in [name for name in pilots[1:] if name == "teacher"]:
        yield f"is at least {100 * _KEPT:g} % as fast as its teacher", partial(_keeps, policy, teacher)


def _beyond(fronts: pd.DataFrame, policy: str, fluids: Sequence[str], place: Place) -> pd.Series:
    """How much faster each swim is than the front of its fluid at its own power."""
    of_robot = fronts[fronts["robot"] == place.robot]
    own = place.swims[place.swims["method"] == policy]
    parts = [
        beyond(of_robot[of_robot["front"] == fluid], own[own["fluid"] == fluid].set_index(["seed", "fluid"]))
        for fluid in fluids
        if fluid in set(of_robot["front"])
    ]
    return pd.concat(parts) if parts else pd.Series(dtype=float)


def _beyond_overall(fronts: pd.DataFrame, policy: str, n_fluids: int, place: Place) -> pd.Series:
    """The same of the means over the fluids and the front of gaits that are one for all."""
    shared = fronts[(fronts["robot"] == place.robot) & (fronts["front"] == INTEGRATED)]
    own = place.swims[place.swims["method"] == policy].groupby("seed")[["speed", "power"]]
    means = own.mean()[own.size() == n_fluids]
    return beyond(shared, means) if len(shared) else pd.Series(dtype=float)


def beyond(front: pd.DataFrame, swims: pd.DataFrame) -> pd.Series:
    """By what share swims are faster than a front at their own powers; infinitely where it has no gait so thrifty."""
    at = pd.Series(speeds_within(front, swims["power"].to_numpy()), swims.index).fillna(0.0)
    return swims["speed"] / at.where(swims["power"].notna()) - 1


def _changes(policy: str, ends: tuple[str, str], column: str, sign: int, place: Place) -> pd.Series:
    """How much a figure of each seed grows, or falls, between two fluids."""
    own = place.swims[place.swims["method"] == policy].set_index(["seed", "fluid"])[column]
    first, last = (of(own, fluid=fluid).droplevel("fluid") for fluid in ends)
    change: pd.Series = last / first
    return (change - 1) * sign if len(first) and len(last) else pd.Series(dtype=float)


def _keeps(policy: str, teacher: str, place: Place) -> pd.Series:
    """How much more than the share to be kept a policy has of the speed of its teacher of the same seed."""
    speeds = place.swims.set_index(["method", "seed", "fluid"])["speed"]
    own, taught = (of(speeds, method=name).droplevel("method") for name in (policy, teacher))
    both = own.index.intersection(taught.index)
    return own[both] / taught[both] - _KEPT
