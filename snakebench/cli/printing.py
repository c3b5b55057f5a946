"""What is printed on a terminal: lines and tables, in which nothing is obeyed that came from a file."""

from collections.abc import Mapping
from typing import Any

from snakebench.errors import printable

_WIDEST = 200  # characters of a cell


def say(*lines: object) -> None:
    """Print lines."""
    for line in lines:
        print(printable(line))


def cell(content: object) -> str:
    """A part of a line, such as a name or a description."""
    return printable(content, _WIDEST)


def print_rows(head: list[str], rows: list[list[str]]) -> None:
    """Print rows under their head, in columns."""
    table = [list(map(cell, row)) for row in (head, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        first, *others = (text.rjust(width) for text, width in zip(row, widths, strict=True))
        print("  ".join([first.strip().ljust(widths[0]), *others]))


def print_table(numbers: dict[str, Any], descriptions: Mapping[str, str | None]) -> None:
    """Print named numbers, each with its description."""
    width = max(len(cell(name)) for name in numbers)
    for name, value in numbers.items():
        known = value is not None and value == value  # not NaN
        shown = "undefined" if not known else f"{value:.5g}" if isinstance(value, float) else str(value)
        print(f"{cell(name):{width}} {cell(shown):>12}  {cell(descriptions[name])}")
