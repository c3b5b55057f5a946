"""What the tables of all pages share: numbers as they are printed, with intervals and numerical uncertainty."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.tables import table_file
from snakebench.value import FloatArray

# What swimming takes, and how it stands in heads of tables: refunded for braking as in the paper, and, +, as a battery
# pays it.
TAKEN = {"power": "P [W]", "positive_power": "P+ [W]", "cost_of_transport": "CoT", "positive_cost_of_transport": "CoT+"}


_LARGEST = 100_000  # of a table in a page, packed [bytes]


class Table(NamedTuple):
    """A table ready to print; the first column names the rows."""

    caption: str
    head: list[str]
    rows: list[list[str]]


class Download(NamedTuple):
    """A table to save from the page, or only its name, if it is large."""

    name: str
    link: str | None


def downloads(directory: Path, *names: str) -> list[Download]:
    """Tables of a study, whole, to save from its page; large ones only named."""
    return [_download(directory / f"{name}.csv") for name in names]


def data_link(name: str, table: pd.DataFrame) -> Download:
    """A table to save from a page that made it."""
    return Download(name, packed(table.to_csv(index=False, lineterminator="\n").encode()))


def _download(path: Path) -> Download:
    """A table as a part of the page, if it is not too large for that."""
    file = table_file(path)
    if file == path and len(link := packed(file.read_bytes())) <= _LARGEST:
        return Download(path.name, link)
    return Download(file.name, None)


def packed(content: bytes) -> str:
    """A file as a link that holds it, gzipped; pages unpack it as they save it, and equal files are equal links."""
    return f"data:application/gzip;base64,{base64.b64encode(gzip.compress(content, mtime=0)).decode()}"


def confidence_interval(values: FloatArray, level: float = 0.95) -> tuple[float, float] | None:
    """Student-t interval of the mean; None for fewer than two values."""
    if len(values) < 2:
        return None
    center, error = float(np.mean(values)), float(stats.sem(values))
    half = error * float(stats.t.ppf((1 + level) / 2, len(values) - 1))
    return center - half, center + half


def interval(values: FloatArray | pd.Series, form: str = ".2f") -> str:
    """The 95 % Student-t interval of the mean in words."""
    found = confidence_interval(np.asarray(values))
    return "needs two seeds" if found is None else f"{found[0]:{form}} to {found[1]:{form}}"


def in_both_currencies(swims: pd.DataFrame) -> pd.DataFrame:
    """A table of swims with all columns of `TAKEN`; of what an older version did not write nothing is defined."""
    swims = with_positive_cost(swims)
    return swims.reindex(columns=[*swims, *(name for name in TAKEN if name not in swims)])


def with_positive_cost(swims: pd.DataFrame) -> pd.DataFrame:
    """A table of swims with CoT+ = CoT P+ / P, which version 1.0 did not write, if it has what that is made of."""
    power, positive_power, cost, positive_cost = TAKEN
    if positive_cost in swims or not {power, positive_power, cost} <= set(swims):
        return swims
    return swims.assign(**{positive_cost: swims[cost] * swims[positive_power] / swims[power]})


def failures(swims: pd.DataFrame) -> dict[str, int]:
    """How many swims there are of each status but ok."""
    return {str(status): count for status, count in swims[swims["status"] != "ok"]["status"].value_counts().items()}


def averaged(values: pd.Series, digits: int = 3) -> str:
    """A mean ± half its 95 % interval if there are several seeds; a dash unless every seed has a value."""
    if not len(values) or values.isna().any():
        return "–"
    found = confidence_interval(values.to_numpy())
    half = "" if found is None else f" ± {(found[1] - found[0]) / 2:.{digits}f}"
    return f"{round(values.mean(), digits) + 0.0:.{digits}f}{half}"  # no minus before a zero


def number(value: float | None) -> str:
    """A number with three digits; a dash where it is not defined."""
    return "–" if value is None or pd.isna(value) else f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"


def at_vanishing_steps(fine: pd.DataFrame, coarse: pd.DataFrame, manifest: Mapping[str, Any]) -> pd.DataFrame:
    """What figures tend to that PyBullet gave at a rate and at half of it (Richardson's extrapolation).

    PyBullet's step has been read to second order since version 2.0; results of version 1.0 are of first order.
    """
    order = 1 if str(manifest["versions"]["snakebench"]).startswith("1.") else 2
    return fine + (fine - coarse) / (2**order - 1)


def with_difference(value: float, other: float, of: str) -> str:
    """A number and how far it is from what was found otherwise, such as with another "step" or "engine"."""
    return number(value) + ("" if pd.isna(value - other) else f" (Δ {of} {abs(value - other):.1g})")
