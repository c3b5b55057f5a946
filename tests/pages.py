"""What the page of a study shows, before it becomes HTML: for tests of structure and numbers."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from snakebench.studies.published import published, tables_of
from snakebench.tables import checked


def page_of(directory: Path, **tables: pd.DataFrame) -> dict[str, Any]:
    """The content of the page of the results in a directory, with some of their tables replaced.

    Its figures are made, but not written as pictures, which takes most of the time: the pages in `reports` are whole.
    """
    study = published(directory)
    method = study.config["method"]
    columns = tables_of(method)
    changed = {name: checked(table, columns[name], name) for name, table in tables.items()}
    with (
        patch("snakebench.report.figure_style.lay_out", lambda _: Bbox.unit()),
        patch.object(Figure, "savefig", lambda _, file, **__: file.write('<svg width="1pt" height="1pt"></svg>')),
    ):
        return import_module(f"snakebench.studies.{method}.page").page(study._replace(tables=study.tables | changed))


def cells(table: Any, column: str) -> dict[str, str]:
    """A column of a table of a page, by the names of its rows."""
    place = table.head.index(column)
    return {row[0]: row[place] for row in table.rows}
