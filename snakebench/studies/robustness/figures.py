"""Figures of the study of robustness."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import method_look, svg
from snakebench.report.seed_figure import draw_seeds
from snakebench.report.table import name_of

_ROWS = {"speed": "v / v₀", "power": "P / P₀", "course": "course [°]"}
_LEAST = (0.9, 1.1), (0.9, 1.1), (0.0, 10.0)  # that panels show, so that small effects look small


def sweep(swims: pd.DataFrame, label: str, fluids: Sequence[str]) -> str:
    """Speed, power and course over the size of a perturbation: every seed of each method, and their mean."""
    names = list(_ROWS.values())
    fig, axes = panels(3, len(fluids), 3.2, 1.7, titles=fluids, x=label, y=names, sharex=True, sharey="row")
    shown = swims.assign(course=np.degrees(swims["course"].astype(float)))
    for column, fluid in enumerate(fluids):
        for method, part in shown[shown["fluid"] == fluid].groupby("method", sort=False):
            name = name_of(str(method))
            for ax, quantity in zip(axes[:, column], _ROWS, strict=True):
                draw_seeds(ax, part, "value", quantity, name, method_look(name).color, band=False)
    for ax in axes[:2].flat:
        ax.axhline(1.0, color="#888888", lw=0.6)
    for ax, (low, high) in zip(axes[:, 0], _LEAST, strict=True):
        ax.set_ylim(min(ax.get_ylim()[0], low), max(ax.get_ylim()[1], high))
    legend_below(fig)
    return svg(fig, f"Speed, power and course over {label}")


def combinations(swims: pd.DataFrame, fluids: Sequence[str]) -> str:
    """What share of the random combinations, of all seeds, leaves less than so much of the speed."""
    fig, axes = panels(1, len(fluids), 3.2, 2.6, titles=fluids, x="v / v₀", y="share of combinations", sharey=True)
    for ax, fluid in zip(axes[0], fluids, strict=True):
        for method, part in swims[swims["fluid"] == fluid].groupby("method", sort=False):
            speeds, name = np.sort(part["speed"].dropna()), name_of(str(method))
            shares = np.arange(1, len(speeds) + 1) / max(len(speeds), 1)
            ax.step(speeds, shares, where="post", color=method_look(name).color, label=name)
    legend_below(fig)
    return svg(fig, "Speed that random combinations of perturbations leave")
