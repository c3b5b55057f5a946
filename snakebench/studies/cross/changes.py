"""What the wrong gait and what the lost feedback change, from the table of every gait in every fluid."""

from __future__ import annotations

import pandas as pd

from snakebench.report.table import COSTS
from snakebench.store import ADAPTIVE

FIGURES = ("speed", *COSTS)
_SWIM = ["method", "seed", "fluid"]


def replays(fine: pd.DataFrame) -> pd.DataFrame:
    """Every replay beside that of the fluid's own gait.

    Args:
        fine: swims with the finer step, a row for each method, seed, loop, fluid and gait_of.

    Returns:
        The replays with further columns: `home` marks the fluid's own gaits; for each of `FIGURES`, FIGURE_change is
        the relative change against the replay of the fluid's own gait, and FIGURE_best whether no gait of the method
        and seed is better in that fluid, NaN unless there are several.
    """
    table = fine[fine["loop"] == "open"]
    table = table.assign(home=table["gait_of"] == table["fluid"])
    own = table[table["home"]].set_index(_SWIM)[list(FIGURES)].add_suffix("_own")
    table = table.join(own, on=_SWIM)
    for name in FIGURES:
        group = table.groupby(_SWIM)[name]
        best = table[name] == group.transform("max" if name == "speed" else "min")
        table[f"{name}_change"] = table[name] / table[f"{name}_own"] - 1
        table[f"{name}_best"] = best.astype(float).where(group.transform("count") > 1)
    return table


def feedback(fine: pd.DataFrame) -> pd.DataFrame:
    """What belongs in a fluid, swimming itself and replayed there, by method, seed and fluid.

    Columns for each of `FIGURES`: FIGURE_itself, FIGURE_replayed, and FIGURE_lost, the relative change between them.
    """
    at_home = fine[(fine["gait_of"] == fine["fluid"]) | (fine["gait_of"] == ADAPTIVE)]
    itself, replayed = (at_home[at_home["loop"] == loop].set_index(_SWIM)[[*FIGURES]] for loop in ("closed", "open"))
    replayed = replayed.reindex(itself.index)
    parts = {"itself": itself, "replayed": replayed, "lost": replayed / itself - 1}
    return pd.concat([part.add_suffix(f"_{label}") for label, part in parts.items()], axis=1).reset_index()


def without_replay(fine: pd.DataFrame) -> pd.DataFrame:
    """The swims that left no torque to replay, having no rhythm where they belong: method, seed, fluid."""
    own, there = feedback(fine), fine[fine["loop"] == "open"]
    known = there[["method", "seed", "gait_of"]].drop_duplicates().rename(columns={"gait_of": "fluid"})
    return own[_SWIM].merge(known, how="left", indicator=True).query("_merge == 'left_only'")[_SWIM]
