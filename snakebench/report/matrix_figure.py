"""The figure of gaits in all fluids: a matrix of numbers for each method."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from snakebench.report.figure_axes import panels
from snakebench.report.figure_style import svg
from snakebench.report.table import number

_PANELS = [
    ("open", "speed", "v replayed [m/s]"),
    ("open", "cost_of_transport", "CoT replayed"),
    ("closed", "speed", "v itself [m/s]"),
    ("closed", "cost_of_transport", "CoT itself"),
]
_FACTOR = 2.0  # where the colours end
_PALE = 1.6  # how much further the darkest would be, under which no number can be read


def matrices(swims: pd.DataFrame, fluids: list[str]) -> str:
    """Mean speed and cost of transport of gaits in all fluids, replayed and itself; a row of panels for each method."""
    columns = ["method", "loop", "gait_of", "fluid"]
    means = swims.groupby(columns, sort=False)[["speed", "cost_of_transport"]].mean().reset_index()
    methods = list(means["method"].unique())
    width, height = max(2.7, min(0.5 * len(fluids), 5.0)), 0.45 * len(fluids) + 1.0
    fig, axes = panels(len(methods), len(_PANELS), width, height)
    for row, method in zip(axes, methods, strict=True):
        part = means[means["method"] == method]
        for ax, (loop, column, title) in zip(row, _PANELS, strict=True):
            of_loop = part[part["loop"] == loop]
            if of_loop[column].notna().any():
                _draw_matrix(ax, of_loop, part, column, list(fluids))
                ax.set_title(f"{method}\n{title}", fontsize=9)
            else:
                ax.axis("off")
        for ax in [ax for ax in row if ax.axison][1:]:
            ax.set(ylabel="", yticklabels=[])
    return svg(fig, "Speed and cost of transport of every gait in every fluid")


def _draw_matrix(ax: Axes, shown: pd.DataFrame, part: pd.DataFrame, column: str, fluids: list[str]) -> None:
    """One matrix: numbers, on the colour of their ratio to the replay of the fluid's own gait."""
    gaits = sorted(shown["gait_of"].unique(), key=[*fluids, *shown["gait_of"]].index)
    values = shown.pivot(index="fluid", columns="gait_of", values=column).reindex(index=fluids, columns=gaits)
    home = part[(part["loop"] == "open") & (part["gait_of"] == part["fluid"])].set_index("fluid")[column]
    better, bound = 1 if column == "speed" else -1, np.log(_FACTOR)
    ratio = better * np.log(values.div(home.reindex(fluids), axis="index").where(lambda x: x > 0))
    ax.imshow(ratio.clip(-bound, bound), cmap="RdBu", vmin=-_PALE * bound, vmax=_PALE * bound, aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        ax.text(j, i, number(value), ha="center", va="center", fontsize=min(9, 90 / len(fluids)), in_layout=False)
    ax.set_xticks(range(len(gaits)), gaits, fontsize=8)
    ax.set_yticks(range(len(fluids)), fluids, fontsize=8)
    ax.set_ylabel("swims in")
    ax.tick_params(length=0)
    ax.grid(visible=False)
