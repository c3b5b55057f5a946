"""The data of a figure: every point that it draws, so that nobody has to read numbers off a picture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

_DIGITS = "%.5g"


def drawn_points(figure: Figure) -> str:
    """Every line, marker, band, bar and cell of a figure as CSV: panel, series, x, y, and the value of a cell.

    A panel is called by its title and labels, a series by its label; one whose label begins with "_" is named in no
    legend.
    """
    parts = [
        pd.DataFrame(points, columns=["x", "y", "value"][: len(points[0])]).assign(panel=_panel(ax), series=series)
        for ax in figure.axes
        for series, points in _series(ax)
        if len(points)
    ]
    if not parts:
        return ""
    table = pd.concat(parts, ignore_index=True)
    columns = ["panel", "series", *(name for name in ("x", "y", "value") if name in table)]
    return table[columns].to_csv(index=False, lineterminator="\n", float_format=_DIGITS)


def _panel(ax: Axes) -> str:
    words = [ax.get_title().replace("\n", " "), ax.get_ylabel(), ax.get_xlabel()]
    return " / ".join(word for word in words if word)


def _series(ax: Axes) -> Iterator[tuple[str, Any]]:
    for line in ax.get_lines():
        yield _named(line), np.asarray(line.get_xydata(), float)
    for collection in ax.collections:
        if isinstance(collection, PathCollection):
            yield _named(collection), np.asarray(collection.get_offsets(), float)
        else:
            for path in collection.get_paths():
                yield f"{_named(collection)} (outline)", np.asarray(path.vertices, float)
    bars = [bar for bar in ax.patches if isinstance(bar, Rectangle) and bar.get_width() and bar.get_height()]
    yield "bars (end, middle)", [(bar.get_x() + bar.get_width(), bar.get_y() + bar.get_height() / 2) for bar in bars]
    for image in ax.get_images():
        cells: Any = np.ma.getdata(np.asarray(image.get_array()))
        yield "cells", [(j, i, cells[i, j]) for i, j in np.ndindex(cells.shape[:2])] if cells.ndim == 2 else []


def _named(artist: Any) -> str:
    return str(artist.get_label()).lstrip("_")
