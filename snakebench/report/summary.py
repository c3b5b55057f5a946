"""Tables that summarise rows by groups, and how much figures of swims depend on the physics step and the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report.method_names import name_of
from snakebench.report.tables import Table, at_vanishing_steps, averaged, interval, number

Cell = Callable[[pd.DataFrame], str]  # what a table shows of the rows of a group
Groups = Mapping[str, Iterable[Any]]  # columns to group by, and their values in the order to be shown


def summary(
    caption: str,
    frame: pd.DataFrame,
    by: Groups,
    columns: Sequence[tuple[str, Cell]],
    *,
    head: str | None = None,
    label: Callable[..., str] | None = None,
) -> Table:
    """A table with a row for each group of a frame and a column for each cell.

    Args:
        caption: of the table.
        frame: what is summarised.
        by: what to group by; groups without rows are left out.
        columns: heads and cells.
        head: of the first column; the names in `by` if None.
        label: makes a row's name of the values that it is grouped by; if None, they are joined, the first one read as
            the name of a method.
    """
    parts = {key: part for key, part in frame.groupby(list(by), sort=False) if len(part)}
    rows = [
        [(label or name_of_group)(*key), *(cell(parts[key]) for _, cell in columns)]
        for key in product(*by.values())
        if key in parts
    ]
    return Table(caption, [head if head is not None else ", ".join(by), *(name for name, _ in columns)], rows)


def name_of_group(method: str, *others: object) -> str:
    """A method and where it swims."""
    return ", ".join([name_of(method), *map(str, others)])


def size(part: pd.DataFrame) -> str:
    """Number of rows."""
    return str(len(part))


def mean(column: str, digits: int = 3) -> Cell:
    """The mean ± half its 95 % interval."""
    return lambda part: averaged(part[column], digits)


def mean_share(column: str, digits: int = 1) -> Cell:
    """The mean of a share ± half its 95 % interval [%]."""
    return lambda part: percent(part[column], digits)


def every(column: str, form: str = ".2f") -> Cell:
    """Every value."""
    return lambda part: seeds(part[column].dropna(), form)


def first(column: str, form: str = "") -> Cell:
    """What all rows share; a dash where it is not known."""
    return lambda part: "–" if pd.isna(value := part[column].iloc[0]) else f"{value:{form}}"


def plain_mean(column: str, form: str = ".2f") -> Cell:
    """The mean alone."""
    return lambda part: f"{part[column].mean():{form}}"


def over_seeds(column: str, each: str, form: str = ".2f") -> list[tuple[str, Cell]]:
    """Columns of every seed's value, under a head, of their mean and of its interval."""
    bounds = ("95 % interval", lambda part: interval(part[column].dropna(), form))
    return [(each, every(column, form)), ("mean", plain_mean(column, form)), bounds]


def percent(values: pd.Series, digits: int = 1) -> str:
    """A mean of shares ± half its 95 % interval [%]."""
    return averaged(100 * values, digits)


def seeds(values: Iterable[float], form: str = ".2f") -> str:
    """The number of each seed."""
    return ", ".join(f"{value:{form}}" for value in values)


def spread(shares: pd.Series) -> str:
    """Sizes of shares, median / largest [%]; a dash where none is known."""
    known = (100 * shares.abs()).replace(np.inf, np.nan).dropna()
    return f"{number(known.median())} / {number(known.max())}" if len(known) else "–"


def step_and_engine(
    swims: pd.DataFrame,
    by: Groups,
    same: Sequence[str],
    figures: Mapping[str, str],
    manifest: Mapping[str, Any],
    of: str = "",
) -> Table:
    """How much figures of swims depend on the physics step and on the engine: relative differences to the finer step.

    Args:
        swims: columns variant ("finer step", "coarser step" and, if there is any, "planar"), those of `by` and `same`,
            and figures.
        by: what to group by.
        same: what else tells one swim from another.
        figures: columns, and their heads.
        manifest: of the study.
        of: which swims, as the caption says.
    """
    variants = {name: part.set_index([*by, *same])[[*figures]] for name, part in swims.groupby("variant")}
    fine, coarse = variants["finer step"], variants["coarser step"].reindex(variants["finer step"].index)
    shares = {"half rate": coarse / fine - 1}
    if "planar" in variants:
        planar = variants["planar"].reindex(fine.index)
        limit = at_vanishing_steps(fine, coarse, manifest)
        shares |= {"planar": planar / fine - 1, "planar, extrapolated": planar / limit - 1}
    heads = [f"{kind}: {head}" for kind in shares for head in figures.values()]
    table = pd.concat(shares, axis=1).set_axis(heads, axis=1).reset_index()
    columns = [(head, lambda part, head=head: spread(part[head])) for head in heads]
    engine = _ENGINE if "planar" in variants else ""
    return summary(f"{_STEP}{engine}; median / largest [%]{of}.", table, by, [("n", size), *columns])


_STEP = "How much the figures depend on the physics step and the engine: relative difference to half the physics rate"
_ENGINE = ", to the planar engine, and of that engine to PyBullet extrapolated to vanishing steps"
