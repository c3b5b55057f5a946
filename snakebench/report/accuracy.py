"""How exact a study's numbers are: what its tables say of the error of speed and power, and which values go beyond."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pandas as pd

from snakebench.accuracy import LARGEST_ERROR
from snakebench.report.tables import Table, number
from snakebench.store import read_tables

_ERRORS = {"speed": "speed_error", "power": "power_error"}
_LISTED = 10  # values of a table that are listed
_SHORT = 1000  # rows of a table whose values are listed: longer ones are of searches


class Accuracy(NamedTuple):
    """What a page says of its numbers."""

    flagged: int  # valid swims whose v or P may be wrong by more than `LARGEST_ERROR`
    swims: int  # valid ones
    limit: str  # beyond which they are flagged
    bounds: Table  # of each table
    worst: Table | None


def accuracy_of(directory: Path) -> Accuracy | None:
    """The accuracy of all swims in a study's tables; None where they say none, as those of snakebench 1."""
    tables = read_tables(directory)
    valid = {
        name: table[table["status"] == "ok"]
        for name, table in tables.items()
        if {"status", *_ERRORS, *_ERRORS.values()} <= set(table)
    }
    if not valid:
        return None
    flagged = {name: table[(table[[*_ERRORS.values()]] > LARGEST_ERROR).any(axis=1)] for name, table in valid.items()}
    listed = [row for name, table in flagged.items() if len(valid[name]) <= _SHORT for row in _rows(name, table)]
    limit = f"{100 * LARGEST_ERROR:g} %"
    head = ["table", "valid swims", "v, median / largest [%]", "P, median / largest [%]", f"beyond {limit}"]
    return Accuracy(
        sum(map(len, flagged.values())),
        sum(map(len, valid.values())),
        limit,
        Table(
            "Bounds on the error that the physics step makes, estimated in each run; single swims in a table.",
            head,
            [
                [name, str(len(table)), *(_spread(table[error]) for error in _ERRORS.values()), str(len(flagged[name]))]
                for name, table in valid.items()
            ],
        ),
        Table(
            f"Swims whose v or P may be wrong by more than {limit}: the worst {_LISTED} of each table.",
            ["swim", "v [m/s]", "bound [%]", "P [W]", "bound [%]"],
            listed,
        )
        if listed
        else None,
    )


def bounds_held(swims: pd.DataFrame, limits: pd.DataFrame, names: list[str]) -> Table | None:
    """Bounds on errors beside the errors, of valid swims that were measured alike, by engine and physics rate.

    Args:
        swims: evaluations with `names`, engine and physics_rate.
        limits: those that they tend to, indexed by `names`.
        names: what tells a swim from the others.

    Returns:
        None where swims have no bounds, as those of snakebench 1.
    """
    if not set(_ERRORS.values()) <= set(swims):
        return None
    swims = swims.reset_index(drop=True)
    limit = swims[names].join(limits[["steady", *_ERRORS]], on=names)
    alike = (swims["status"] == "ok") & (swims["steady"] == limit["steady"])
    rows = []
    for (engine, rate), part in swims[alike].groupby(["engine", "physics_rate"]):
        cells = [f"{engine}, {rate} Hz", str(len(part))]
        for value, bound in _ERRORS.items():
            error = (part[value] / limit.loc[part.index, value] - 1).abs()
            cells += [_spread(error), _spread(part[bound]), str(int((error <= part[bound]).sum()))]
        rows.append(cells)
    head = ["engine", "swims"]
    for name in ("v", "P"):
        head += [f"error of {name} [%]", "its bound [%]", "bounds that hold"]
    return Table("Errors and the bounds that each swim states by itself, median / largest.", head, rows)


def _spread(errors: pd.Series) -> str:
    return f"{number(100 * errors.median())} / {number(100 * errors.max())}"


def _rows(name: str, swims: pd.DataFrame) -> list[list[str]]:
    """The worst swims, by the words and whole numbers before their status."""
    worst = swims.loc[swims[[*_ERRORS.values()]].max(axis=1).sort_values(ascending=False).index[:_LISTED]]
    before = worst.columns[: worst.columns.get_loc("status")]
    known = [column for column in before if worst[column].dtype.kind not in "fb"]
    return [
        [
            ", ".join([name, *(str(row[column]) for column in known if pd.notna(row[column]))]),
            *(text for value, error in _ERRORS.items() for text in (number(row[value]), number(100 * row[error]))),
        ]
        for _, row in worst.iterrows()
    ]
