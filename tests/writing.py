"""Writes parts of results by hand: for tests of what reads them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.files import write_file
from snakebench.store import MANIFEST, manifest_text
from snakebench.tables import table_text


def write_manifest(directory: Path, content: Mapping[str, Any]) -> None:
    """Write what is known about the results in a directory; it marks them as complete."""
    write_file(directory / MANIFEST, manifest_text(content))


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Write a table as CSV, for `read_table`."""
    write_file(path, table_text(table))
