"""What is printed on a terminal: lines and tables, in which nothing is obeyed that came from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from snakebench.errors import printable

_WIDEST = 200  # characters of a cell, a name or a description


def say(*lines: object) -> None:
    """Print lines."""
    for line in lines:
        print(printable(line))


def said(cell: object) -> str:
    """A part of a line, such as a name."""
    return printable(cell, _WIDEST)


def print_rows(head: list[str], rows: list[list[str]]) -> None:
    """Print rows under their head, in columns."""
    table = [[said(cell) for cell in row] for row in (head, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        first, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join([first.strip().ljust(widths[0]), *others]))


def print_table(numbers: dict[str, Any], about: Mapping[str, str | None]) -> None:
    """Print named numbers, each with what is said about it."""
    width = max(len(said(name)) for name in numbers)
    for name, value in numbers.items():
        shown = f"{value:.5g}" if isinstance(value, float) else "undefined" if value is None else str(value)
        print(f"{said(name):{width}} {said(shown):>12}  {said(about[name])}")
