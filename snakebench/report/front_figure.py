"""Fronts of speed against power, of fixed gaits and of policies: one picture for every page that compares them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator

from snakebench.report.equal_power import speeds_within
from snakebench.report.figure_style import Color, method_look, svg

_LEAST_POWER = 0.01  # shown [W]
_PLACES = 100  # points of a front drawn for each factor e of power
_STAR = 1.8  # size of a star beside other markers


def fronts(points: pd.DataFrame, marks: pd.DataFrame, names: Sequence[str], title: str) -> str:
    """Every seed's front of each method, and single points, one panel for each front by name.

    Args:
        points: of fronts: columns method, front, seed, speed [m/s], power [W].
        marks: gaits and policies that are no front: the same columns.
        names: of the fronts, a panel each.
        title: of the picture, for those who do not see it.
    """
    fig, axes = plt.subplots(1, len(names), figsize=(10.8, 4), sharex=True, layout="constrained", squeeze=False)
    handles: dict[str, Line2D] = {}
    for ax, name in zip(axes[0], names, strict=True):
        for method, part in points[points["front"] == name].groupby("method", sort=False):
            look, seeds = method_look(str(method)), part.groupby("seed")
            for seed, of_seed in seeds:
                drawn = f"_{method}" + (f", seed {seed}" if len(seeds) > 1 else "")
                draw_steps(ax, of_seed, look.color, drawn, width=1.4 if len(seeds) == 1 else 0.7)
            every = f"{method}, front" + (" of every seed" if len(seeds) > 1 else "")
            handles.setdefault(every, Line2D([], [], color=look.color, label=every))
        for method, part in marks[marks["front"] == name].groupby("method", sort=False):
            look = method_look(str(method))
            style: dict[str, Any] = {"color": look.color, "marker": look.marker, "ls": "", "mfc": "none", "mew": 1.1}
            size = 6 * (_STAR if look.marker == "*" else 1)
            ax.plot(part["power"], part["speed"], ms=size, zorder=3, label=f"_{method}", **style)
            handles.setdefault(str(method), Line2D([], [], ms=size, label=str(method), **style))
        ax.set_title(name)
        power_axis(ax)
    axes[0][0].set_ylabel("speed v [m/s]")
    fig.legend(handles=list(handles.values()), loc="outside lower center", ncols=4, frameon=False)
    return svg(fig, title)


def draw_attained(ax: Axes, surfaces: pd.DataFrame, powers: np.ndarray, color: Color) -> None:
    """A band between what the best and the worst seed attain at powers, and a line for the median."""
    speed = {name: np.nan_to_num(speeds_within(surface, powers)) for name, surface in surfaces.groupby("surface")}
    ax.fill_between(powers, speed["worst"], speed["best"], color=color, alpha=0.3, lw=0, step="post")
    ax.plot(powers, speed["median"], color=color, lw=1, drawstyle="steps-post")


def draw_steps(ax: Axes, front: pd.DataFrame, color: Color, label: str, *, line: Any = "-", width: float = 1.4) -> None:
    """One front as a staircase; of thousands of points, as many as can be told apart."""
    ordered = front.sort_values("power")
    shown = ordered[~np.floor(np.log(ordered["power"]) * _PLACES).duplicated()]
    ax.plot(shown["power"], shown["speed"], drawstyle="steps-post", color=color, label=label, ls=line, lw=width)


def power_axis(ax: Axes, *, label: bool = True) -> None:
    """Power on a logarithmic axis, the same in all figures."""
    ax.set(xscale="log", xlim=(_LEAST_POWER, 100))
    ax.xaxis.set_major_locator(LogLocator(10))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda power, _: f"{power:g}"))
    if label:
        ax.set_xlabel("power P [W]")
