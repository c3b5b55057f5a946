"""Fronts of speed against power, of fixed gaits and of policies: one picture for every page that compares them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from snakebench.report.equal_power import speeds_within
from snakebench.report.figure_axes import legend_below, panels, plain_log
from snakebench.report.figure_style import Color, method_look, svg

SPEED_OVER_POWER = {"x": "power P [W]", "y": "speed v [m/s]"}  # labels
_POWERS = np.logspace(-2, 2, 300)  # of an attainment surface [W]
_LEAST_POWER = 0.01  # shown [W]
_PLACES = 100  # points of a front drawn for each factor e of power
_STAR = 1.8  # size of a star beside other markers


def fronts(points: pd.DataFrame, marks: pd.DataFrame, names: Sequence[str], title: str) -> str:
    """Every seed's front of each method, and `marks`, gaits and policies that are no front: a panel for each name.

    Both have columns method, front, seed, speed [m/s] and power [W].
    """
    fig, axes = panels(1, len(names), 10.8 / len(names), 4, titles=names, sharex=True, **SPEED_OVER_POWER)
    looks: dict[str, dict[str, Any]] = {}
    for ax, name in zip(axes[0], names, strict=True):
        for method, part in points[points["front"] == name].groupby("method", sort=False):
            color, seeds = method_look(str(method)).color, part.groupby("seed")
            several = len(seeds) > 1
            for seed, front in seeds:
                label = f"_{method}" + f", seed {seed}" * several
                draw_steps(ax, front, color, label, width=0.7 if several else 1.4)
            looks.setdefault(f"{method}, front" + " of every seed" * several, {"color": color})
        for method, part in marks[marks["front"] == name].groupby("method", sort=False):
            color, marker, _ = method_look(str(method))
            size = 6 * (_STAR if marker == "*" else 1)
            look = {"color": color, "marker": marker, "ms": size, "ls": "", "mfc": "none", "mew": 1.1}
            ax.plot(part["power"], part["speed"], zorder=3, label=f"_{method}", **look)
            looks.setdefault(str(method), look)
        power_axis(ax)
    legend_below(fig, looks)
    return svg(fig, title)


def draw_attained(ax: Axes, surfaces: pd.DataFrame, color: Color) -> None:
    """A band between what the best and the worst seed attain at each power, and a line for the median."""
    speed = {name: np.nan_to_num(speeds_within(surface, _POWERS)) for name, surface in surfaces.groupby("surface")}
    ax.fill_between(_POWERS, speed["worst"], speed["best"], color=color, alpha=0.3, lw=0, step="post")
    ax.plot(_POWERS, speed["median"], color=color, lw=1, drawstyle="steps-post")
    power_axis(ax)


def draw_steps(ax: Axes, front: pd.DataFrame, color: Color, label: str, *, line: Any = "-", width: float = 1.4) -> None:
    """One front as a staircase; of thousands of points, as many as can be told apart."""
    ordered = front.sort_values("power")
    shown = ordered[~np.floor(np.log(ordered["power"]) * _PLACES).duplicated()]
    ax.plot(shown["power"], shown["speed"], drawstyle="steps-post", color=color, label=label, ls=line, lw=width)


def power_axis(ax: Axes) -> None:
    """Power on a logarithmic axis, the same in all figures."""
    ax.set(xscale="log", xlim=(_LEAST_POWER, 100))
    plain_log(ax.xaxis)
