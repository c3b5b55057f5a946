"""A figure of every gait in every fluid: what the lost feedback and what the wrong gait changes, and which is best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from snakebench.report.measurements import of
from snakebench.store import ADAPTIVE


class Swims(NamedTuple):
    """One figure of every swim, by method, seed, fluid and what the gait is of."""

    column: str  # speed or cost of transport
    replayed: pd.Series
    itself: pd.Series  # in closed loop

    def lost(self) -> pd.Series:
        """What replay changes where a gait belongs, as a share, by method, seed and fluid."""
        return (home(self.replayed) / home(self.itself) - 1).dropna()

    def wrong(self) -> pd.Series:
        """What a gait of another fluid changes against the fluid's own, both replayed, as a share."""
        own = home(self.replayed).reindex(self.replayed.droplevel("gait_of").index)
        changes = (self.replayed / own.to_numpy() - 1).dropna()
        return changes[level(changes, "gait_of") != level(changes, "fluid")]

    def best(self, values: pd.Series) -> pd.Series:
        """Of which fluid the best gait is, by method, seed and fluid; where there is only one, there is no best.

        Of two that are equally good the fluid's own counts.
        """
        values = values.iloc[np.argsort(level(values, "gait_of") != level(values, "fluid"), kind="stable")]
        groups = values[level(values, "gait_of") != ADAPTIVE].dropna().groupby(["method", "seed", "fluid"], sort=False)
        best = groups.idxmax() if self.column == "speed" else groups.idxmin()
        return best[groups.size() > 1].map(lambda where: where[-1])


def swims_of(fine: pd.DataFrame, column: str) -> Swims:
    """A figure of the swims at the finer rate."""
    values = fine.set_index(["loop", "method", "seed", "fluid", "gait_of"])[column]
    return Swims(column, *(of(values, loop=loop).droplevel("loop") for loop in ("open", "closed")))


def level(values: pd.Series, name: str) -> pd.Index:
    """A level of the index."""
    return values.index.get_level_values(name)


def home(values: pd.Series) -> pd.Series:
    """Of each fluid the gait of its own, or what adapts to it."""
    gait = level(values, "gait_of")
    return values[(gait == level(values, "fluid")) | (gait == ADAPTIVE)].droplevel("gait_of")
