"""Numbers that can be followed: each knows the rows of the published table that it is from, and their command."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.errors import StoreError
from snakebench.report.table import LABELS, averaged, chosen, confidence_interval
from snakebench.store import SMALLER, command_of
from snakebench.studies.published import Published, published
from snakebench.tables import table_file

FINE = {"variant": "finer step"}
STUDENT = {
    "method": "student",
    "as_trained": True,
    **FINE,
}  # of the study operating_point, on the robot of its training


class Missing(StoreError):
    """Results of a study that are missing or cannot be used; the message names the command that makes them."""


class Measurement(NamedTuple):
    """A number of the comparison."""

    id: str
    unit: str
    values: tuple[float, ...]  # one a seed
    table: str  # such as "cross/matrix.csv"
    rows: str  # which of its rows
    command: str  # that makes the table
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
        """95 % Student-t interval of the mean; None for a single value or a count."""
        return None if self.counted else confidence_interval(np.array(self.values))

    def text(self, digits: int = 3) -> str:
        """Mean ± half the interval, where there are several seeds; a count as such."""
        if self.counted:
            return f"{sum(self.values):.0f} of {self.n}"
        return averaged(pd.Series(self.values), digits)

    def row(self) -> dict[str, Any]:
        """The measurement as a row of the table of all numbers."""
        low, high = self.interval or (None, None)
        numbers = {"number": self.id, "unit": self.unit, "mean": self.mean, "low": low, "high": high, "n": self.n}
        seeds = " ".join(f"{value:.6g}" for value in self.values)
        return numbers | {"seeds": seeds, "table": self.table, "rows": self.rows, "command": self.command}


class Rows(NamedTuple):
    """Rows of a published table, which numbers are taken from."""

    frame: pd.DataFrame
    study: Published
    table: str  # such as "cross/matrix.csv"
    where: str  # which rows of it, such as "fluid = water"
    measurements: list[Measurement]  # where each number is added

    def measure(
        self, id: str, unit: str, values: str | pd.Series, what: str = "", *, counted: bool = False
    ) -> Measurement:
        """Add a number: a column's mean for each seed, or values, one a seed, and what they are; `Missing` if none."""
        if isinstance(values, str):
            return self.measure(id, unit, self.frame.groupby("seed")[values].mean(), values)
        known, command = tuple(values.dropna().to_numpy(float).tolist()), command_of(self.study.directory.name)
        if not known:
            raise Missing(f"{self.table}: {id} is not defined: {command} makes it anew")
        rows = f"{self.where}: {what}" if self.where else what
        self.measurements.append(Measurement(id, unit, known, self.table, rows, command, counted))
        return self.measurements[-1]


class Results:
    """All published results in a directory, of each study those of its largest profile, and `measurements` of them."""

    def __init__(self, root: Path, problems: Mapping[str, str] | None = None) -> None:
        self.root, self.measurements, self._problems = root, list[Measurement](), problems or {}
        self._studies: dict[str, Published] = {}

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
        frame, equalities = chosen(source.tables[table], where)
        if frame.empty:
            raise Missing(f"{study}: no rows with {equalities} in {table}.csv: {command_of(study)} makes them")
        path = table_file(source.directory / f"{table}.csv")
        return Rows(frame, source, f"{path.parent.name}/{path.name}", equalities, self.measurements)

    @cached_property
    def fluids(self) -> list[str]:
        """The fluids that the policies were judged in; errors as `study`."""
        return list(self.study("teacher_student").config["fluids"])

    def policy(self, column: str, fluid: str, name: str = "student", study: str = "teacher_student") -> Measurement:
        """A figure of policies in a fluid, by seed; those of the paper's reward unless another study trained them."""
        rows = self.rows(study, "evaluations", policy=name, fluid=fluid, **FINE)
        return rows.measure(f"{name}/{fluid}/{column}", unit_of(column), column)

    def in_fluids(self, column: str) -> dict[str, Measurement]:
        """A figure of the student of the paper's reward in every fluid, by seed."""
        return {fluid: self.policy(column, fluid) for fluid in self.fluids}

    def at_papers_power(self, column: str) -> dict[str, Measurement]:
        """A figure of the preference-conditioned student at the paper's power in every fluid, by seed."""
        return {
            fluid: self.rows("operating_point", "points", **STUDENT, fluid=fluid).measure(
                f"student/{fluid}/{column} at the paper's power", unit_of(column), column
            )
            for fluid in self.fluids
        }


def unit_of(column: str) -> str:
    """The unit in the label of a column, or "1"."""
    return LABELS[column].partition(" ")[2].strip("[]") or "1"
