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
from snakebench.studies.fronts import OBJECTIVES, eligible, means_by_gait

_LABELS = {"space", "fluid", "status", "steady", *MEASURED}  # columns of a grid that are no parameters of a gait


def search_gap(tables: Mapping[str, pd.DataFrame]) -> pd.Series:
    """How much slower the worst seed and the grid are than each point of a study's fronts, as searched [1].

    NaN where it is not known, as of fronts that no seeds have searched.
    """
    points, attainment = tables["fronts"], tables.get("attainment", pd.DataFrame())
    gaps = pd.Series(np.nan, points.index)
    if "objective" not in attainment:
        return gaps
    worst = dict(iter(attainment[attainment["surface"] == "worst"].groupby(["space", "objective"])[OBJECTIVES]))
    for (space, front), part in points.groupby(["space", "front"]):
        if (space, front) in worst:
            of_grid = _of_grid(tables["grid"].query("space == @space"), str(front))
            attained = pd.concat([worst[space, front], of_grid], ignore_index=True)
            speeds = speeds_within(attained, part["power_searched"].to_numpy())
            gaps[part.index] = np.maximum(1 - speeds / part["speed_searched"], 0.0)
    return gaps


def _of_grid(grid: pd.DataFrame, front: str) -> pd.DataFrame:
    """Speed and power of the gaits of a grid in a fluid, or their means over all fluids."""
    here = grid[grid["fluid"] == front]
    if len(here):
        return here.loc[eligible(here), OBJECTIVES].astype(float)
    parameters = [str(column) for column in grid if column not in _LABELS]
    return means_by_gait(grid, parameters, list(grid["fluid"].unique())).dropna() if len(grid) else grid[OBJECTIVES]
