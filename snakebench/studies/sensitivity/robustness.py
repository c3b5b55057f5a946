"""Which conclusions about a policy hold where: each a margin of every swim or seed, positive where it holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from snakebench.report.equal_power import speeds_within
from snakebench.report.table import Cell, Table, summary
from snakebench.store import EXTENDED, INTEGRATED, PAPER

CONCLUSIONS = {  # by id, in the order of the table
    f"faster-than-{PAPER}": "faster than the sinusoids' front of each fluid",
    f"faster-than-{PAPER}-for-all": "faster than one sinusoid for all fluids, by means over them",
    f"faster-than-{EXTENDED}": "faster than the wider sinusoids' front of each fluid",
    f"faster-than-{EXTENDED}-for-all": "faster than one wider sinusoid for all fluids, by means over them",
    "frequency-falls": "frequency falls from the first fluid to the last, as the paper's does",
    "tail-grows": "tail amplitude grows, as the paper's does",
    "torque-grows": "torque grows, as the paper's does",
    "keeps-its-teachers-speed": "at least 95 % as fast as its teacher",
}
_TRENDS = {"frequency-falls": ("swim_frequency", -1), "tail-grows": ("tail_amplitude", 1)} | {
    "torque-grows": ("torque_amplitude", 1)
}
_KEPT = 0.95  # of the teacher's speed


def margins(swims: pd.DataFrame, fronts: pd.DataFrame, fluids: Sequence[str], pilots: Sequence[str]) -> pd.DataFrame:
    """The margins of every conclusion at every place where it can be tried: columns conclusion, place, margin.

    Args:
        swims: of policies: columns place, method, seed, fluid, robot (whose fronts they are compared with) and figures.
        fronts: of fixed gaits: columns robot, space, front, speed, power.
        fluids: in the order of their viscosity.
        pilots: the policy that conclusions are about, and its teacher if that was compared too.
    """
    own = swims[swims["method"] == pilots[0]]
    by_seed = own.groupby(["place", "robot", "seed"], sort=False)[["speed", "power"]]
    means = by_seed.mean()[by_seed.size() == len(fluids)].reset_index().assign(fluid=INTEGRATED)
    parts = {}
    for space, of_space in fronts.groupby("space", sort=False):
        parts[f"faster-than-{space}"] = beyond(of_space, own)
        parts[f"faster-than-{space}-for-all"] = beyond(of_space, means)
    for id, (column, sign) in _TRENDS.items() if len(fluids) > 1 else ():
        wide = own.pivot(index=["place", "seed"], columns="fluid", values=column).reindex(columns=list(fluids))
        change = sign * (wide[fluids[-1]] / wide[fluids[0]] - 1)
        parts[id] = change.rename("margin").dropna().reset_index()
    teachers = swims[swims["method"].isin(pilots[1:2])]
    both = own.merge(teachers, on=["place", "seed", "fluid"], suffixes=("", "_taught"))
    parts["keeps-its-teachers-speed"] = both.assign(margin=both["speed"] / both["speed_taught"] - _KEPT)
    tables = [part[["place", "margin"]].assign(conclusion=id) for id, part in parts.items() if len(part)]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["place", "margin", "conclusion"])


def beyond(fronts: pd.DataFrame, swims: pd.DataFrame) -> pd.DataFrame:
    """Swims with `margin`: the share by which they are faster than the front of their robot and fluid at their power.

    It is infinite where the front has no gait of so low a power; swims without a front are left out.
    """
    parts = [swims.iloc[:0].assign(margin=0.0)]
    for (robot, fluid), part in swims.groupby(["robot", "fluid"], sort=False):
        front = fronts[(fronts["robot"] == robot) & (fronts["front"] == fluid)]
        if len(front):
            bound = pd.Series(speeds_within(front, part["power"].to_numpy()), part.index).fillna(0.0)
            parts.append(part.assign(margin=part["speed"] / bound.where(part["power"].notna()) - 1))
    return pd.concat(parts)


def margin_table(found: pd.DataFrame) -> Table:
    """For how many swims or seeds each conclusion holds at each place, and the least margin."""

    def cell(place: str) -> Cell:
        def held(part: pd.DataFrame) -> str:
            here = part[part["place"] == place]["margin"]
            least = f", least {100 * here.min():+.0f} %" if np.isfinite(here.min()) else ""
            return f"{(here > 0).sum()} of {len(here)}{least}" if len(here) else "–"

        return held

    columns = [(str(place), cell(str(place))) for place in found["place"].unique()]
    return summary(found, {"conclusion": CONCLUSIONS}, columns, label=lambda id: CONCLUSIONS[id])
