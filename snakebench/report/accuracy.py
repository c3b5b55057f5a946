"""How exact a study's numbers are: the bounds on the error of speed and power that each swim states by itself, and how
much figures depend on the physics step and the engine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.accuracy import LARGEST_ERROR
from snakebench.report.table import LONGEST, Cell, Table, number, size, summary

_ERRORS = {"speed": "speed_error", "power": "power_error"}
_LISTED = 10  # values of a table that are listed


class Accuracy(NamedTuple):
    """The accuracy of a study's swims."""

    flagged: int  # valid swims whose v or P may be wrong by more than `LARGEST_ERROR`
    swims: int  # valid ones
    limit: str  # beyond which they are flagged
    bounds: Table  # of each table
    worst: Table


def accuracy_of(tables: Mapping[str, pd.DataFrame]) -> Accuracy | None:
    """The accuracy of all swims in a study's tables; None where they have no bounds, as those of snakebench 1."""
    errors = [*_ERRORS.values()]
    valid = {
        name: table[table["status"] == "ok"]
        for name, table in tables.items()
        if {"status", *errors} <= set(table) and table[errors].notna().any(axis=None)
    }
    if not valid:
        return None
    flagged = {name: table[(table[errors] > LARGEST_ERROR).any(axis=1)] for name, table in valid.items()}
    limit = f"{100 * LARGEST_ERROR:g} %"
    head = ["table", "valid swims", "v, median / largest [%]", "P, median / largest [%]", f"beyond {limit}"]
    bounds = [
        [name, str(len(table)), *(spread(error)(table) for error in errors), str(len(flagged[name]))]
        for name, table in valid.items()
    ]
    listed = [row for name, table in flagged.items() if len(valid[name]) <= LONGEST for row in _worst(name, table)]
    return Accuracy(
        sum(map(len, flagged.values())),
        sum(map(len, valid.values())),
        limit,
        Table(head, bounds),
        Table(["swim", "v [m/s]", "bound [%]", "P [W]", "bound [%]"], listed),
    )


def _worst(name: str, swims: pd.DataFrame) -> list[list[str]]:
    """The swims of the largest bounds, by their labels: the texts and whole numbers before their status."""
    worst = swims.loc[swims[[*_ERRORS.values()]].max(axis=1).sort_values(ascending=False).index[:_LISTED]]
    before = worst.columns[: worst.columns.get_loc("status")]
    labels = [column for column in before if worst[column].dtype.kind not in "fb"]
    return [
        [
            ", ".join([name, *(str(row[column]) for column in labels if pd.notna(row[column]))]),
            *(text for value, error in _ERRORS.items() for text in (number(row[value]), number(100 * row[error]))),
        ]
        for _, row in worst.iterrows()
    ]


def bounds_held(swims: pd.DataFrame, limits: pd.DataFrame, names: list[str]) -> Table | None:
    """Bounds on errors beside the errors, of valid swims that were measured alike, by engine and physics rate.

    Args:
        swims: evaluations with `names`, engine and physics_rate.
        limits: those that they tend to, indexed by `names`.
        names: columns that identify a swim.

    Returns:
        None where swims have no bounds, as those of snakebench 1.
    """
    if swims[[*_ERRORS.values()]].isna().all(axis=None):
        return None
    swims = swims.reset_index(drop=True)
    limit = swims[names].join(limits[["steady", *_ERRORS]], on=names)
    alike = (swims["status"] == "ok") & (swims["steady"] == limit["steady"])
    columns: list[Any] = [("swims", size)]
    for label, (value, bound) in zip(("v", "P"), _ERRORS.items(), strict=True):
        error, holds = f"error of {value}", f"bound of {value} holds"
        swims[error] = (swims[value] / limit[value] - 1).abs()
        swims[holds] = swims[error] <= swims[bound]
        columns += [(f"error of {label} [%]", spread(error)), ("its bound [%]", spread(bound))]
        columns += [("bounds that hold", lambda part, holds=holds: str(part[holds].sum()))]
    return summary(swims[alike].sort_values(["engine", "physics_rate"]), ["engine", "physics_rate"], columns)


def step_changes(
    swims: pd.DataFrame, keys: Sequence[str], figures: Mapping[str, str], manifest: Mapping[str, Any]
) -> pd.DataFrame:
    """Relative differences of figures to those with the finer step: of other variants, and of the planar engine to
    PyBullet extrapolated to vanishing steps.

    Args:
        swims: columns variant ("finer step", "coarser step", "planar" and others), those of `keys`, and figures.
        keys: columns that identify a swim.
        figures: columns, and their labels.
        manifest: of the study.

    Returns:
        Columns of `keys`, and one for each variant and figure, "VARIANT: LABEL".
    """
    variants = {name: part.set_index([*keys])[[*figures]] for name, part in swims.groupby("variant", sort=False)}
    fine = variants.pop("finer step")
    variants = {name: part.reindex(fine.index) for name, part in variants.items()}
    changes = {name: part / fine - 1 for name, part in variants.items()}
    if {"planar", "coarser step"} <= set(variants):
        # Richardson's extrapolation; the step of version 1 is of first order, that of later versions of second.
        order = 1 if int(manifest["versions"]["snakebench"].partition(".")[0]) < 2 else 2
        limit = fine + (fine - variants["coarser step"]) / (2**order - 1)
        changes["planar, extrapolated"] = variants["planar"] / limit - 1
    heads = [f"{kind!s}: {label}" for kind in changes for label in figures.values()]
    return pd.concat(changes, axis=1).set_axis(heads, axis=1).reset_index()


def step_table(changes: pd.DataFrame, by: Mapping[str, Iterable[Any]]) -> Table:
    """Differences of `step_changes` by groups: median / largest [%]."""
    heads = [str(name) for name in changes if ": " in str(name)]
    return summary(changes, by, [("n", size), *((head, spread(head)) for head in heads)])


def spread(column: str) -> Cell:
    """Sizes of shares, median / largest [%]; a dash where none is known."""

    def cell(part: pd.DataFrame) -> str:
        known = (100 * part[column].abs()).replace(np.inf, np.nan).dropna()
        return f"{number(known.median())} / {number(known.max())}" if len(known) else "–"

    return cell
