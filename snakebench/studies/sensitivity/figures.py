"""Figures of the sensitivity study."""

from itertools import cycle
from typing import Any

import pandas as pd
import seaborn as sns

from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import palette, svg
from snakebench.report.front_figure import SPEED, draw_front, power_axis


def fronts(points: pd.DataFrame, names: list[str], robots: list[str], policies: pd.DataFrame) -> str:
    """The named fronts of each robot, a line style for each search space, and swims of the policies there."""
    fig, axes = panels(1, len(names), 10.8 / len(names), 4.2, titles=names, sharex=True, y=SPEED)
    colors = dict(zip(robots, sns.color_palette("dark", len(robots)), strict=True))
    lines = dict(zip(points["space"].unique(), cycle(("-", "--", ":", "-.")), strict=False))
    fills = palette(list(policies["method"].unique()), "Set2")
    for ax, name in zip(axes[0], names, strict=True):
        for (robot, space), part in points[points["front"] == name].groupby(["robot", "space"], sort=False):
            draw_front(ax, part, colors[str(robot)], f"_{robot}, {space} space", ls=lines[space])
        for (method, robot), swims in policies[policies["fluid"] == name].groupby(["method", "robot"], sort=False):
            look: dict[str, Any] = {"mec": colors[str(robot)], "mew": 1.2, "ms": 5, "zorder": 3}
            ax.plot(swims["power"], swims["speed"], "o", color=fills[str(method)], label=f"_{method}, {robot}", **look)
        power_axis(ax)
    looks = {robot.replace("_", " "): {"color": color} for robot, color in colors.items()}
    looks |= {f"{space} space": {"color": "#444444", "ls": line} for space, line in lines.items()}
    looks |= {method: {"color": color, "marker": "o", "ls": ""} for method, color in fills.items()}
    legend_below(fig, looks)
    return svg(fig, "Fronts of speed against power of each robot")
