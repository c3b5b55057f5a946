"""How exact a study's numbers are: the error bounds of its swims, and the effects of the physics step and engine."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from snakebench.accuracy import LARGEST_ERROR
from snakebench.names import COARSE, FINE
from snakebench.report.table import LONGEST, Cell, Table, number, size, summary

_ERRORS = {"speed": "speed_error", "power": "power_error"}
_LISTED = 10  # values of a table that are listed


def accuracy_of(tables: Mapping[str, pd.DataFrame]) -> dict[str, Any] | None:
    """The accuracy of all swims in a study's tables; None where they have no bounds."""
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
        [name, size(table), *(spread(error)(table) for error in errors), size(flagged[name])]
        for name, table in valid.items()
    ]
    listed = [row for name, table in flagged.items() if len(valid[name]) <= LONGEST for row in _worst(name, table)]
    return {
        "flagged": sum(map(_published, flagged.values())),
        "swims": sum(map(_published, valid.values())),
        "finer": any("variant" in table for table in valid.values()),  # whether those at coarser steps are left out
        "limit": limit,
        "longest": LONGEST,
        "bounds": Table(head, bounds),
        "worst": Table(["swim", "v [m/s]", "bound [%]", "P [W]", "bound [%]"], listed),
    }


def _published(swims: pd.DataFrame) -> int:
    """How many are not only there to tell the error of others, as those of coarser steps."""
    return len(swims[swims["variant"] == FINE] if "variant" in swims else swims)


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
    """Bounds beside errors of valid swims, by engine and physics rate; None where there are none.

    Errors are differences to `limits`, indexed by the columns `names`, of swims that were measured alike.
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


def step_changes(swims: pd.DataFrame, keys: Sequence[str], figures: Mapping[str, str]) -> pd.DataFrame:
    """Relative differences [1] of each variant of a swim to its "finer step", in columns "VARIANT: LABEL".

    Also of the planar engine to PyBullet extrapolated to vanishing steps. `keys` identify a swim, and `figures` are
    columns and their labels.
    """
    variants = {name: part.set_index([*keys])[[*figures]] for name, part in swims.groupby("variant", sort=False)}
    fine = variants.pop(FINE)
    variants = {name: part.reindex(fine.index) for name, part in variants.items()}
    changes = {name: part / fine - 1 for name, part in variants.items()}
    if {"planar", COARSE} <= set(variants):
        limit = fine + (fine - variants[COARSE]) / 3  # Richardson's extrapolation, of second order
        changes["planar, extrapolated"] = variants["planar"] / limit - 1
    heads = [f"{kind!s}: {label}" for kind in changes for label in figures.values()]
    return pd.concat(changes, axis=1).set_axis(heads, axis=1).reset_index()


def step_table(changes: pd.DataFrame, by: Mapping[str, Iterable[Any]]) -> Table:
    """Differences of `step_changes` by groups: median / largest [%]."""
    heads = [str(name) for name in changes if ": " in str(name)]
    return summary(changes, by, [("n", size), *((head, spread(head)) for head in heads)])


def spread(column: str) -> Cell:
    """Sizes of shares, median / largest, or the only one [%]; a dash where none is known."""

    def cell(part: pd.DataFrame) -> str:
        known = (100 * part[column].abs()).replace(np.inf, np.nan).dropna()
        if len(known) < 2:
            return number(known.iloc[0]) if len(known) else "–"
        return f"{number(known.median())} / {number(known.max())}"

    return cell
