"""What the pages of comparisons share: the measured figures of swims, and rows chosen by their index."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from snakebench.report.tables import TAKEN, averaged, in_both_currencies
from snakebench.store import ADAPTIVE

MEASURED = ["speed", *TAKEN]


def readable(table: pd.DataFrame, column: str = "tuned_to") -> pd.DataFrame:
    """A table of swims whose speed, powers and costs are NaN unless valid; policies are tuned to what adapts."""
    table, valid = in_both_currencies(table), table["status"] == "ok"
    return table.assign(
        **{column: table[column].fillna(ADAPTIVE)}, **{name: table[name].where(valid) for name in MEASURED}
    )


def paid(swims: pd.DataFrame) -> str:
    """The mean of both powers, of P+ where it is known."""
    power, positive_power = (averaged(swims[name], 1) for name in ("power", "positive_power"))
    return f"{power} W" + ("" if positive_power == "–" else f", P+ {positive_power} W")


def of(values: Any, **chosen: object) -> Any:
    """The rows of a series or table whose index has these values, by the names of its levels."""
    levels = [values.index.get_level_values(name) == value for name, value in chosen.items()]
    return values[np.logical_and.reduce(levels)]
