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


def drawn_points(figure: Figure) -> str:
    """Every line, marker, band, bar and cell of a figure as CSV: panel, series, x, y, and the value of a cell.

    A panel is called by its title and labels, a series by its label; one whose label begins with "_" is named in no
    legend.
    """
    rows = [
        {"panel": panel, "series": name} | dict(zip(("x", "y", "value"), point, strict=False))
        for ax in figure.axes
        for panel, name, points in _series(ax)
        for point in np.asarray(points, float).tolist()
    ]
    return pd.DataFrame(rows).to_csv(index=False, lineterminator="\n", float_format="%.5g") if rows else ""


def _series(ax: Axes) -> Iterator[tuple[str, str, Any]]:
    """Panel, name and points of every series of a panel."""
    panel = " / ".join(filter(None, (ax.get_title().replace("\n", " "), ax.get_ylabel(), ax.get_xlabel())))
    for line in ax.get_lines():
        yield panel, _named(line), line.get_xydata()
    for collection in ax.collections:
        if isinstance(collection, PathCollection):
            yield panel, _named(collection), collection.get_offsets()
        else:
            for path in collection.get_paths():
                yield panel, f"{_named(collection)} (outline)", path.vertices
    bars = [bar for bar in ax.patches if isinstance(bar, Rectangle) and bar.get_width() and bar.get_height()]
    ends = [(bar.get_x() + bar.get_width(), bar.get_y() + bar.get_height() / 2) for bar in bars]
    yield panel, "bars (end, middle)", ends
    for image in ax.get_images():
        cells = np.ma.getdata(np.asarray(image.get_array()))
        yield panel, "cells", [(j, i, value) for (i, j), value in np.ndenumerate(cells)] if cells.ndim == 2 else []


def _named(artist: Any) -> str:
    return str(artist.get_label()).lstrip("_")
