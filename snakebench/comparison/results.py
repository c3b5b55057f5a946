"""Numbers that can be followed: each knows the rows of the published table that it is from, and their command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.errors import StoreError
from snakebench.report.table import averaged, confidence_interval
from snakebench.store import SMALLER, command_of
from snakebench.studies.published import Published, published
from snakebench.tables import table_file

FINE = {"variant": "finer step"}
_UNITS = {"speed": "m/s", "power": "W", "swim_frequency": "Hz", "tail_amplitude": "m", "torque_amplitude": "N m"}


class Missing(StoreError):
    """Results of a study that are not there, or not to be used; its words name the command that makes them."""


class Measurement(NamedTuple):
    """A number of the comparison."""

    id: str
    unit: str
    values: tuple[float, ...]  # one a seed
    table: str  # such as "cross/matrix.csv"
    rows: str  # which of its rows
    command: str  # that makes the table

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
        """95 % Student-t interval of the mean; None for a single value."""
        return confidence_interval(np.array(self.values))

    def text(self, digits: int = 3) -> str:
        """Mean ± half the interval, where there are several seeds."""
        return averaged(pd.Series(self.values), digits)

    def row(self) -> dict[str, Any]:
        """The measurement as a row of the table of all numbers."""
        low, high = self.interval or (None, None)
        seeds = " ".join(f"{value:.6g}" for value in self.values)
        numbers = {"number": self.id, "unit": self.unit, "mean": self.mean, "low": low, "high": high, "n": self.n}
        return numbers | {"seeds": seeds, "table": self.table, "rows": self.rows, "command": self.command}


class Results:
    """All published results in a directory; of each study those of its largest profile.

    Args:
        root: the directory.
        problems: what is wrong with results that are not in it.

    Attributes:
        measurements: all that were taken from the results, in order.
    """

    def __init__(self, root: Path, problems: Mapping[str, str] | None = None) -> None:
        self.root, self.measurements, self._problems = root, list[Measurement](), problems or {}
        self._studies: dict[str, Published] = {}

    def study(self, name: str) -> Published:
        """The results of a study.

        Raises:
            Missing: when there are none that can be used.
        """
        if name in self._studies:
            return self._studies[name]
        names = name, *(f"{name}-{profile}" for profile in SMALLER)
        problem = next((self._problems[name] for name in names if name in self._problems), "no results")
        for directory in (self.root / name for name in names if (self.root / name).is_dir()):
            try:
                return self._studies.setdefault(name, published(directory))
            except StoreError as error:
                problem = str(error)
        raise Missing(f"{name}: {problem}; {command_of(name)} makes them")

    def rows(self, study: str, table: str, **where: Any) -> pd.DataFrame:
        """The rows of a table in which columns have these values.

        Raises:
            Missing: when there are none.
        """
        part = self.study(study).tables[table]
        for column, value in where.items():
            part = part[part[column] == value]
        if part.empty:
            raise Missing(f"{study}: no rows with {_equalities(where)} in {table}.csv: {command_of(study)} makes them")
        return part

    def measure(
        self,
        id: str,
        unit: str,
        study: str,
        table: str,
        values: str | Callable[[pd.DataFrame], pd.Series],
        what: str | None = None,
        by: str = "seed",
        **where: Any,
    ) -> Measurement:
        """Take a number from a table.

        Args:
            id: of the number.
            unit: of it.
            study: that made the table.
            table: its name.
            values: a column, whose mean is taken for each of `by`, or a function of the rows with one value a seed.
            what: in words what the function makes of the rows.
            by: what there is one value of.
            where: columns and their values in the rows.

        Raises:
            Missing: when there are no such rows.
        """
        part = self.rows(study, table, **where)
        taken = (part.groupby(by)[values].mean() if isinstance(values, str) else values(part)).dropna()
        rows, what = _equalities(where), what or str(values)
        if not len(taken):
            raise Missing(f"{study}: {id} is not defined in {table}.csv: {command_of(study)} makes it anew")
        path = table_file(self.study(study).directory / f"{table}.csv")
        measurement = Measurement(
            id,
            unit,
            tuple(taken.to_numpy(float).tolist()),
            f"{path.parent.name}/{path.name}",
            f"{rows}: {what}" if rows else what,
            command_of(path.parent.name),
        )
        self.measurements.append(measurement)
        return measurement

    @cached_property
    def fluids(self) -> list[str]:
        """The fluids that the policies were judged in; errors as `study`."""
        return list(self.study("teacher_student").config["fluids"])

    def policy(self, column: str, fluid: str, name: str = "student") -> Measurement:
        """A figure of the policies of the paper's reward in a fluid, by seed."""
        where = {"policy": name, "fluid": fluid} | FINE
        unit = _UNITS.get(column, "1")
        return self.measure(f"{name}/{fluid}/{column}", unit, "teacher_student", "evaluations", column, **where)

    def in_fluids(self, column: str, name: str = "student") -> dict[str, Measurement]:
        """As `policy`, in every fluid."""
        return {fluid: self.policy(column, fluid, name) for fluid in self.fluids}


def _equalities(where: Mapping[str, Any]) -> str:
    return ", ".join(f"{column} = {value}" for column, value in where.items())


def combined(id: str, of: Mapping[str, Measurement], how: Callable[..., float], unit: str) -> Measurement:
    """A number made of others seed by seed; those with a single value count for every seed."""
    parts = list(of.values())
    n = max(part.n for part in parts)
    rows = [part.values if part.n == n else part.values * n for part in parts]
    values = tuple(how(*each) for each in zip(*rows, strict=True))
    tables = " and ".join(dict.fromkeys(part.table for part in parts))
    commands = " and ".join(dict.fromkeys(part.command for part in parts))
    return Measurement(id, unit, values, tables, " against ".join(of), commands)
