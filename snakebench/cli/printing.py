"""What commands print: tables, and where pages are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any


def print_rows(head: list[str], rows: list[list[str]]) -> None:
    """Print rows under their head, in columns."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        first, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join([first.strip().ljust(widths[0]), *others]))


def print_table(numbers: dict[str, Any], about: dict[str, Any]) -> None:
    """Print named numbers, each with what its field says about it."""
    by_alias = {field.alias or name: field.description for name, field in about.items()}
    for name, value in numbers.items():
        shown = f"{value:.5g}" if isinstance(value, float) else "undefined" if value is None else str(value)
        print(f"{name:20} {shown:>12}  {by_alias[name]}")


def write_pages(directories: Iterable[Path], reports: Path) -> None:
    """Write the page of each study from its results, and say where it is."""
    from snakebench.reporting.page import write_report

    for directory in directories:
        print(f"report: {write_report(directory, reports)}")
