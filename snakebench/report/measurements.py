"""What the pages of comparisons share: names of policies and gaits, and how much of a figure the step makes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report.standings import named
from snakebench.report.tables import TAKEN, averaged, in_both_currencies, number
from snakebench.store import ADAPTIVE

MEASURED = ["speed", *TAKEN]


def said(method: str) -> str:
    """A policy or a kind of gait as it is called on a page."""
    return named(method).replace("_", " ")


def readable(table: pd.DataFrame, column: str = "tuned_to") -> pd.DataFrame:
    """A table of swims whose speed, powers and costs are NaN unless valid; policies are tuned to what adapts."""
    table, valid = in_both_currencies(table), table["status"] == "ok"
    return table.assign(
        **{column: table[column].fillna(ADAPTIVE)}, **{name: table[name].where(valid) for name in MEASURED}
    )


def each(values: Iterable[float]) -> str:
    """Every seed's number."""
    return ", ".join(map(number, values))


def percent(values: pd.Series, digits: int = 1) -> str:
    """A mean of shares ± half its 95 % interval [%]."""
    return averaged(100 * values, digits)


def paid(swims: pd.DataFrame) -> str:
    """The mean of both powers, of P+ where it is known."""
    power, positive_power = (averaged(swims[name], 1) for name in ("power", "positive_power"))
    return f"{power} W" + ("" if positive_power == "–" else f", P+ {positive_power} W")


def gap(fine: pd.Series, other: pd.Series) -> str:
    """Relative difference between two series of the same index, median / largest [%]."""
    gaps = (100 * (other / fine - 1).abs()).replace(np.inf, np.nan).dropna()
    return f"{number(gaps.median())} / {number(gaps.max())}" if len(gaps) else "–"


def of(values: Any, **chosen: object) -> Any:
    """The rows of a series or table whose index has these values, by the names of its levels."""
    levels = [values.index.get_level_values(name) == value for name, value in chosen.items()]
    return values[np.logical_and.reduce(levels)]
