"""Numbers that can be followed: each knows the rows of the published table that it is from, and their command."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.comparison.bounds import bounded, by_sign, shifted
from snakebench.errors import StoreError
from snakebench.manifest import command_of
from snakebench.names import FINE, SMALLER
from snakebench.report.intervals import comparison_interval
from snakebench.report.table import LABELS, MEASURED, chosen, of_valid, with_interval
from snakebench.studies.published import Published, published
from snakebench.tables import table_file


class Missing(StoreError):
    """Results of a study that are missing or cannot be used; the message names the command that makes them."""


class Measurement(NamedTuple):
    """A number of the comparison."""

    id: str
    unit: str
    values: tuple[float, ...]  # one a seed
    seeds: tuple[object, ...]
    table: str  # such as "cross/matrix.csv"
    rows: str  # which of its rows
    command: str  # that makes the table
    opponents: tuple[float, ...] = ()  # the same mean by the seeds of what it is compared with, if it has several
    error: float = 0.0  # bound on the error of the mean that no seed shows, in its unit
    counted: bool = False  # in how many seeds something is so, 0 or 1 in each: no interval is meant

    @property
    def mean(self) -> float:
        """Mean over the seeds."""
        return float(np.mean(self.values))

    @property
    def n(self) -> int:
        """Number of seeds."""
        return len(self.values)

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the mean by the seeds of both sides, wider by the bound.

        None if neither is known, and for a count.
        """
        found = comparison_interval(self.values, self.opponents)
        if self.counted or (found is None and not self.error):
            return None
        low, high = found or (self.mean, self.mean)
        return low - self.error, high + self.error

    def by_seed(self) -> pd.Series:
        """The values, by their seeds."""
        return pd.Series(self.values, self.seeds)

    def text(self, digits: int = 3) -> str:
        """Mean ± half the interval, where there is one; a count as such."""
        if self.counted:
            return f"{sum(self.values):.0f} of {self.n}"
        return with_interval(self.mean, self.interval, digits)

    def above(self, bound: float) -> bool:
        """Whether the mean is above a bound with its whole interval."""
        return (self.interval or (self.mean,))[0] > bound

    def below(self, bound: float) -> bool:
        """Whether the mean is below a bound with its whole interval."""
        return (self.interval or (self.mean,))[-1] < bound

    def row(self) -> dict[str, Any]:
        """The measurement as a row of the table of all numbers."""
        low, high = self.interval or (None, None)
        numbers = {"number": self.id, "unit": self.unit, "mean": self.mean, "low": low, "high": high, "n": self.n}
        numbers |= {"seeds": _listed(self.values), "opponents": _listed(self.opponents), "error": self.error}
        return numbers | {"table": self.table, "rows": self.rows, "command": self.command}


Numbers = dict[str, Measurement]  # by place


def _listed(values: Sequence[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


Values = pd.Series | pd.DataFrame  # by seed, or by seed and, in columns, by seed of what is compared with


class Rows(NamedTuple):
    """Rows of a published table, which numbers are taken from."""

    frame: pd.DataFrame
    study: Published
    table: str  # such as "cross/matrix.csv"
    where: str  # which rows of it, such as "fluid = water"
    measurements: list[Measurement]  # where each number is added
    whole: Callable[[], pd.DataFrame]  # the table with `bounds`

    def bounded(self) -> pd.DataFrame:
        """The rows with bounds on the errors of v and P, for `shifted`."""
        return self.whole().loc[self.frame.index]

    def measure(
        self, id: str, unit: str, values: str | Values | Mapping[int, Values], what: str = "", *, counted: bool = False
    ) -> Measurement:
        """Add a number: a column's mean for each seed, or values, and what they are; `Missing` if none.

        Values may be those `by_sign` of the errors.
        """
        if isinstance(values, str):
            seeds = partial(_by_seed, self.bounded() if values in MEASURED else self.frame, values)
            return self.measure(id, unit, by_sign(seeds), values)
        signs = values if isinstance(values, Mapping) else {0: values}
        known, command = _crossed(signs[0]).dropna(), command_of(self.study.directory.name)
        if known.empty:
            raise Missing(f"{self.table}: {id} is not defined: {command} makes it anew")
        means, opponents = (tuple(known.mean(axis=axis)) for axis in (1, 0))
        where, sides = f"{self.where}: {what}" if self.where else what, opponents if len(opponents) > 1 else ()
        error = _largest_change(known, signs.values())
        own = tuple(known.index)
        self.measurements.append(Measurement(id, unit, means, own, self.table, where, command, sides, error, counted))
        return self.measurements[-1]


def _largest_change(known: pd.DataFrame, others: Iterable[Values]) -> float:
    """The largest mean difference from what values are otherwise, of those that are defined then as well."""
    changes = [(_crossed(other) - known).abs().to_numpy() for other in others]
    return max((float(np.nanmean(change)) for change in changes if not np.isnan(change).all()), default=0.0)


def _by_seed(rows: pd.DataFrame, column: str, sign: int) -> pd.Series:
    return (shifted(rows, sign) if column in MEASURED else rows).groupby("seed")[column].mean(skipna=False)


def _crossed(values: Values) -> pd.DataFrame:
    """Values as a table: rows are seeds, columns those of what is compared with."""
    return (values.to_frame() if isinstance(values, pd.Series) else values).astype(float)


class Results:
    """All published results in a directory, of each study those of its largest profile, and `measurements` of them."""

    def __init__(self, root: Path, problems: Mapping[str, str] | None = None) -> None:
        self.root, self.measurements, self._problems = root, list[Measurement](), problems or {}
        self._studies: dict[str, Published] = {}
        self._bounds: dict[tuple[str, str], pd.DataFrame] = {}

    def study(self, name: str) -> Published:
        """The results of a study; `Missing` is raised when there are none that can be used."""
        names = name, *(f"{name}-{profile}" for profile in SMALLER)
        problem = next((self._problems[name] for name in names if name in self._problems), "no results")
        for directory in (self.root / name for name in names if (self.root / name).is_dir()):
            try:
                return self._studies.get(name) or self._studies.setdefault(name, published(directory))
            except StoreError as error:
                problem = str(error)
        raise Missing(f"{name}: {problem}; {command_of(name)} makes them")

    def rows(self, study: str, table: str, **where: Any) -> Rows:
        """The rows of a table in which columns have these values; `Missing` is raised when there are none."""
        source = self.study(study)
        frame, equalities = chosen(_valid(source.tables[table]), where)
        if frame.empty:
            raise Missing(f"{study}: no rows with {equalities} in {table}.csv: {command_of(study)} makes them")
        path = table_file(source.directory / f"{table}.csv")
        whole = partial(self._bounded, study, table)
        return Rows(frame, source, f"{path.parent.name}/{path.name}", equalities, self.measurements, whole)

    def _bounded(self, study: str, table: str) -> pd.DataFrame:
        if (study, table) not in self._bounds:
            self._bounds[study, table] = _valid(bounded(self.study(study).tables, table))
        return self._bounds[study, table]

    @cached_property
    def fluids(self) -> list[str]:
        """The fluids that the policies were judged in; errors as `study`."""
        return list(self.study("teacher_student").config["fluids"])

    def policy(self, column: str, fluid: str, name: str = "student", study: str = "teacher_student") -> Measurement:
        """A figure of policies in a fluid, by seed; those of the paper's reward unless another study trained them."""
        rows = self.rows(study, "evaluations", policy=name, fluid=fluid, variant=FINE)
        return rows.measure(f"{name}/{fluid}/{column}", unit_of(column), column)

    def in_fluids(self, column: str) -> Numbers:
        """A figure of the student of the paper's reward in every fluid, by seed."""
        return {fluid: self.policy(column, fluid) for fluid in self.fluids}

    def student(self, table: str = "points", **where: Any) -> Rows:
        """Rows of the preference-conditioned student at the paper's power, on the robot of its training."""
        return self.rows("operating_point", table, method="student", as_trained=True, variant=FINE, **where)

    def at_papers_power(self, column: str) -> Numbers:
        """A figure of the preference-conditioned student at the paper's power in every fluid, by seed."""
        ids = {fluid: f"student/{fluid}/{column} at the paper's power" for fluid in self.fluids}
        return {fluid: self.student(fluid=fluid).measure(id, unit_of(column), column) for fluid, id in ids.items()}


def _valid(table: pd.DataFrame) -> pd.DataFrame:
    """A table whose swims that are not valid have no speed, power and cost of transport."""
    return of_valid(table) if {"status", *MEASURED} <= set(table) else table


def unit_of(column: str) -> str:
    """The unit in the label of a column, or "1"."""
    return LABELS[column].partition(" ")[2].strip("[]") or "1"


class Finding(NamedTuple):
    """What a judge found: numbers by label and place, with their digits, and whether each part of the rule holds."""

    measured: Mapping[str, tuple[Numbers, int]]
    holds: Sequence[bool]
    leading: int = 1  # how many of the labels answer the claim; others are shown beside


Judge = Callable[[Results, Mapping[str, Any]], Finding]


def rising(measurements: Sequence[Measurement]) -> bool:
    """Whether values rise from each measurement to the next, for every seed; not where one has no value."""
    values = [one.values for one in measurements]
    return len({len(row) for row in values}) == 1 and bool((np.diff(values, axis=0) > 0).all())
