"""Figures of policies: every seed as a thin line, their mean as a thick one."""

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from snakebench.report import paper
from snakebench.report.figure_axes import legend_below, panels, plain_log
from snakebench.report.figure_style import Color, fluid_lines, method_look, palette, svg
from snakebench.report.table import LABELS, MEASURED

_OVER_VISCOSITY = {
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail amplitude [m]",
    "torque_amplitude": "torque amplitude [N m]",
} | {name: LABELS[name] for name in MEASURED}


def over_viscosity(
    swims: pd.DataFrame, policies: Sequence[str], gaits: pd.DataFrame | None = None, trend: dict[str, Any] | None = None
) -> str:
    """Gait, speed, powers and costs of transport over viscosity: of policies, and of fixed gaits by `tuned_to`.

    `trend` is what the paper reports: of each figure, two viscosities [m²/s] and the values there.
    """
    fig, axes = panels(2, 4, 3.1, 2.9, x="kinematic viscosity ν [m²/s]", sharex=True)
    for ax, (column, label) in zip(axes.flat, _OVER_VISCOSITY.items(), strict=True):
        for name, color in palette(policies, "Set2").items():
            draw_seeds(ax, swims[swims["method"] == name], "viscosity", column, name, color)
        if gaits is not None:
            for name, line in fluid_lines(list(gaits["tuned_to"].unique())).items():
                part, color = gaits[gaits["tuned_to"] == name], method_look("sinusoid").color
                ax.plot(part["viscosity"], part[column], color=color, ls=line, lw=1, label=f"sinusoid, {name}")
        if trend and column in trend:
            ax.plot(*trend[column], "D:", color="#111111", ms=5, lw=1, label=paper.NAME)
        ax.set(xscale="log", ylabel=label)
        if column.endswith("cost_of_transport"):
            ax.set_yscale("log")
            plain_log(ax.yaxis, (1, 2, 5))
    legend_below(fig, columns=3)
    return svg(fig, "Gait, speed, powers and costs of transport over viscosity")


def draw_seeds(
    ax: Axes, table: pd.DataFrame, x: str, y: str, name: str, color: Color, *, band: bool = True, **mean_line: Any
) -> None:
    """Draw every seed as a thin line, their mean where all have one as a thick line, and a band of one deviation."""
    label = name.replace("_", " ")
    seeds = table.pivot(index=x, columns="seed", values=y)
    for k, (_, seed) in enumerate(seeds.items()):
        line = seed.dropna()
        ax.plot(line.index, line, color=color, lw=0.5, alpha=0.5, label=f"_{label}, seed {k + 1} of {len(seeds.T)}")
    if seeds.empty:
        return
    mean = seeds.mean(axis=1, skipna=False).dropna()
    ax.plot(mean.index, mean, **{"color": color, "lw": 1.8, "label": label} | mean_line)
    if band and len(seeds.T) > 1:
        spread = seeds.loc[mean.index].std(axis=1)
        ax.fill_between(mean.index, mean - spread, mean + spread, color=color, alpha=0.15, lw=0)
