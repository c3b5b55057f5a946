"""Numbers that can be followed: each knows the rows of the published table that it is from, and their command."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.errors import StoreError
from snakebench.report.tables import averaged, confidence_interval, with_positive_cost
from snakebench.store import SMALLER, command_of, read_manifest
from snakebench.tables import read_table, table_file


class Missing(StoreError):
    """Results of a study that are not there, or not to be used; its words name the command that makes them."""


# What damaged tables, manifests and swims make calculations with them raise.
DAMAGE = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError)


@contextmanager
def damage_as_missing(what: str) -> Iterator[None]:
    """Say of what damaged results cannot give that it is missing.

    Raises:
        Missing: in place of what the calculation raises.
    """
    try:
        yield
    except Missing:
        raise
    except (*DAMAGE, StoreError) as error:
        raise Missing(f"{what}: results are damaged ({told(error)}): run their studies again") from None


def told(error: BaseException) -> str:
    """An error that was not meant for users, in a line."""
    return f"{type(error).__name__}: {error}".splitlines()[0]


class Measurement(NamedTuple):
    """A number of the report."""

    name: str
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
        """The quantity as a row of the table of all numbers."""
        low, high = self.interval or (None, None)
        about = {"number": self.name, "unit": self.unit, "mean": self.mean, "low": low, "high": high, "n": self.n}
        seeds = " ".join(f"{value:.6g}" for value in self.values)
        return about | {"seeds": seeds, "table": self.table, "rows": self.rows, "command": self.command}


class Results:
    """All published results in a directory; of each study those of its largest profile.

    Args:
        root: the directory.
        problems: what is wrong with results that are not in it.

    Attributes:
        taken: every quantity that was taken from them, in order.
    """

    def __init__(self, root: Path, problems: Mapping[str, str] | None = None) -> None:
        self.root, self.taken, self._problems = root, list[Measurement](), problems or {}
        self._tables: dict[Path, pd.DataFrame] = {}

    def directory(self, study: str) -> Path:
        """Where the results of a study are.

        Raises:
            Missing: when there are none that can be used.
        """
        names = study, *(f"{study}-{profile}" for profile in SMALLER)
        problem = next((self._problems[name] for name in names if name in self._problems), "no results")
        for name in names:
            try:
                if (path := self.root / name).is_dir():
                    read_manifest(path)
                    return path
            except StoreError as error:
                problem = str(error)
        raise Missing(f"{study}: {problem}; {command_of(study)} makes them")

    def manifest(self, study: str) -> dict[str, Any]:
        """The manifest of a study; errors as `directory`."""
        return read_manifest(self.directory(study))

    def table(self, study: str, name: str) -> pd.DataFrame:
        """A table of a study, with CoT+ where version 1.0 wrote but what it is made of.

        Raises:
            Missing: when it is not there or cannot be read.
        """
        path = self.directory(study) / f"{name}.csv"
        if path not in self._tables:
            try:
                self._tables[path] = with_positive_cost(read_table(path))
            except StoreError as error:
                raise Missing(f"{error}; {command_of(path.parent.name)} makes it") from None
        return self._tables[path]

    def rows(self, study: str, name: str, **where: Any) -> pd.DataFrame:
        """The rows of a table that are as said; errors as `table`."""
        part = self.table(study, name)
        for column, value in where.items():
            part = part[part[column] == value]
        return part

    def quantity(
        self, name: str, unit: str, study: str, table: str, column: str, by: str = "seed", **where: Any
    ) -> Measurement:
        """The values of a column in the rows that are as said, one for each of `by`.

        Raises:
            Missing: when there are no such rows.
        """
        return self.derived(name, unit, study, table, lambda part: part.groupby(by)[column].mean(), column, **where)

    def derived(
        self,
        name: str,
        unit: str,
        study: str,
        table: str,
        values: Callable[[pd.DataFrame], pd.Series],
        what: str,
        **where: Any,
    ) -> Measurement:
        """What a function makes of the rows that are as said, one value a seed; `what` says what it makes of them.

        Raises:
            Missing: when there are no such rows.
        """
        try:
            found = values(self.rows(study, table, **where)).dropna()
        except KeyError as error:
            raise Missing(f"{study}: {table}.csv has no column {error}: {command_of(study)} makes it anew") from None
        rows = ", ".join(f"{column} = {value}" for column, value in where.items())
        if not len(found):
            raise Missing(f"{study}: no rows with {rows} in {table}.csv: {command_of(study)} makes them")
        directory = self.directory(study).name
        file = table_file(self.root / directory / f"{table}.csv").name
        quantity = Measurement(
            name,
            unit,
            tuple(found.to_numpy(float).tolist()),
            f"{directory}/{file}",
            f"{rows}: {what}" if rows else what,
            command_of(directory),
        )
        self.taken.append(quantity)
        return quantity

    @cached_property
    def fluids(self) -> list[str]:
        """The fluids that the policies were judged in; errors as `directory`."""
        return list(self.manifest("teacher_student")["config"]["fluids"])


def policy(results: Results, column: str, fluid: str, name: str = "student", unit: str = "") -> Measurement:
    """What the policies of the paper's reward do in a fluid, by seed."""
    where = {"policy": name, "fluid": fluid, "variant": "finer step"}
    return results.quantity(f"{name} in {fluid}: {column}", unit, "teacher_student", "evaluations", column, **where)


def known(take: Callable[[], Measurement]) -> Measurement | None:
    """A quantity that results of older versions may lack; None where they do."""
    with suppress(Missing):
        return take()
    return None


def combined(
    name: str, of: Mapping[str, Measurement], how: Callable[..., float], unit: str | None = None
) -> Measurement:
    """A number made of others seed by seed; those with a single value count for every seed."""
    parts = list(of.values())
    n = max(part.n for part in parts)
    rows = [part.values if part.n == n else part.values * n for part in parts]
    values = tuple(how(*each) for each in zip(*rows, strict=True))
    tables = " and ".join(dict.fromkeys(part.table for part in parts))
    commands = " and ".join(dict.fromkeys(part.command for part in parts))
    return Measurement(name, unit or parts[0].unit, values, tables, " against ".join(of), commands)
