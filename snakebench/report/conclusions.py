"""Conclusions: Markdown that a person wrote beside a study, with placeholders for numbers from its tables, such as
`{{ evaluations(policy="student", fluid="water").mean("speed") }}`.
"""

from collections.abc import Mapping
from typing import Self

import pandas as pd
from jinja2 import Environment, StrictUndefined, TemplateError
from markdown_it import MarkdownIt
from markupsafe import Markup

from snakebench.errors import StoreError
from snakebench.report.table import averaged, chosen


class Rows:
    """Rows of a table; calling it with values of columns chooses among them."""

    def __init__(self, name: str, table: pd.DataFrame) -> None:
        self._name, self._table = name, table

    def __call__(self, **where: object) -> Self:
        """The rows with these values; a StoreError when there are none."""
        rows, choice = chosen(self._table, where)
        if rows.empty:
            raise StoreError(f"{self._name}.csv has no rows with {choice}")
        return type(self)(self._name, rows)

    def known(self, expression: str) -> Self:
        """The rows in which a value is known."""
        return type(self)(self._name, self._table[self.values(expression).notna()])

    def highest(self, expression: str) -> Self:
        """The row with the highest value."""
        return type(self)(self._name, self._table.loc[[self.values(expression).idxmax()]])

    def name(self, column: str) -> str:
        """What the first row has in a column of names."""
        return str(self._table[column].iloc[0])

    def count(self, **where: object) -> int:
        """How many rows have these values, if any."""
        return len(chosen(self._table, where)[0])

    def values(self, expression: str) -> pd.Series:
        """A column, or what an expression makes of columns, such as "100 * distance / ideal_distance"."""
        table = self._table
        return table[expression] if expression in table else pd.Series(table.eval(expression))

    def mean(self, expression: str, digits: int = 3) -> str:
        """The mean ± half its 95 % interval, of the means by seed where rows have a seed, and by `seed_fixed`.

        A dash where a value is not known.
        """
        values = self.values(expression)
        sides = (name for name in ("seed", "seed_fixed") if name in self._table)
        by = {name: values.groupby(self._table[name]).mean(skipna=False) for name in sides}
        opponents = by.get("seed_fixed", pd.Series(dtype=float)).to_list()
        return averaged(by.get("seed", values), digits, opponents if len(opponents) > 1 else ())

    def value(self, expression: str) -> float:
        """The mean as a number, to calculate with."""
        return float(self.values(expression).mean())

    def text(self, expression: str, form: str = ".3f", of: str = "mean") -> str:
        """The mean, median, sum, min or max in a format, without interval; a dash where a value is not known."""
        values = self.values(expression)
        return "–" if values.isna().any() else f"{values.agg(of):{form}}"

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self._table)


def conclusions(text: str, tables: Mapping[str, pd.DataFrame], label: str) -> Markup:
    """Conclusions in Markdown as HTML, with numbers from tables; a StoreError with `label` if one is not there."""
    environment = Environment(undefined=StrictUndefined, autoescape=False, trim_blocks=True, lstrip_blocks=True)
    try:
        filled = environment.from_string(text).render({name: Rows(name, table) for name, table in tables.items()})
    except (TemplateError, StoreError, LookupError, ArithmeticError, NameError) as error:
        raise StoreError(f"the conclusions in {label} cannot be filled in: {error}") from None
    return Markup(MarkdownIt("commonmark", {"html": False}).render(filled))
