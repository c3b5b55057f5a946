"""Tables on a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def print_rows(head: list[str], rows: list[list[str]]) -> None:
    """Print rows under their head, in columns."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        first, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join([first.strip().ljust(widths[0]), *others]))


def print_table(numbers: dict[str, Any], about: Mapping[str, str | None]) -> None:
    """Print named numbers, each with what is said about it."""
    for name, value in numbers.items():
        shown = f"{value:.5g}" if isinstance(value, float) else "undefined" if value is None else str(value)
        print(f"{name:20} {shown:>12}  {about[name]}")
