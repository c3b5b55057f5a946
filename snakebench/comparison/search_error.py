"""How much a front of sinusoids depends on the seeds of its search.

Such a front is published as the best of a grid, which has no seeds, and of every seed of NSGA-II, so that a policy is
compared with the best sinusoids known. With one seed only, it could have been as low as the grid and what all seeds
attain; as much may be missing from it. Of free waveforms and sea snakes there is one gait or front for each seed.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from snakebench.report.equal_power import speeds_within
from snakebench.report.table import MEASURED
from snakebench.store import CURRENCIES
from snakebench.studies.fronts import eligible, means_by_gait, objectives

_LABELS = {"space", "fluid", "status", "steady", *MEASURED}  # columns of a grid that are no parameters of a gait


def search_gap(tables: Mapping[str, pd.DataFrame]) -> pd.Series:
    """How much slower the worst seed and the grid are than each point of a study's fronts, as searched [1].

    NaN where it is not known, as of fronts that no seeds have searched.
    """
    points, attainment = tables["fronts"], tables.get("attainment", pd.DataFrame())
    gaps = pd.Series(np.nan, points.index)
    if "objective" not in attainment:
        return gaps
    worst = dict(iter(attainment[attainment["surface"] == "worst"].groupby(["space", "objective", "currency"])))
    for key, part in points.groupby(["space", "front", "currency"]):
        space, front, currency = map(str, key)
        if (space, front, currency) in worst:
            power = CURRENCIES[currency]
            of_seeds = worst[space, front, currency].rename(columns={"power": power})[["speed", power]]
            of_grid = _of_grid(tables["grid"].query("space == @space"), front, currency)
            attained = pd.concat([of_seeds, of_grid], ignore_index=True)
            speeds = speeds_within(attained, part[f"{power}_searched"].to_numpy(), currency)
            gaps[part.index] = np.maximum(1 - speeds / part["speed_searched"], 0.0)
    return gaps


def _of_grid(grid: pd.DataFrame, front: str, currency: str) -> pd.DataFrame:
    """Speed and power of the gaits of a grid in a fluid, or their means over all fluids."""
    columns, fluids = objectives(currency), list(grid["fluid"].unique())
    here = grid[grid["fluid"] == front]
    if len(here):
        return here.loc[eligible(here), columns].astype(float)
    parameters = [str(column) for column in grid if column not in _LABELS]
    return means_by_gait(grid, parameters, fluids, currency).dropna() if len(grid) else grid[columns]
