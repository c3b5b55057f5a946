"""Figures of the sensitivity study."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import pandas as pd
import seaborn as sns
from matplotlib.lines import Line2D

from snakebench.report.figure_style import svg
from snakebench.report.front_figure import draw_steps, power_axis
from snakebench.report.seed_figure import policy_colors

_LINES = ("-", "--", ":", "-.")  # of the search spaces


def fronts(points: pd.DataFrame, names: Sequence[str], robots: Sequence[str], policies: pd.DataFrame) -> str:
    """The front of each robot in each fluid, a line style for each search space, and the policies as they swim there.

    Args:
        points: columns robot, space, front, speed, power.
        names: of the fronts shown.
        robots: by name, in order.
        policies: swims, columns method, robot, fluid, speed, power.
    """
    fig, axes = plt.subplots(1, len(names), figsize=(10.8, 4.2), sharex=True, layout="constrained", squeeze=False)
    colors = dict(zip(robots, sns.color_palette("dark", len(robots)), strict=True))
    spaces = list(points["space"].unique())
    looks = policy_colors(list(dict.fromkeys(policies["method"])))
    for ax, name in zip(axes[0], names, strict=True):
        for (robot, space), part in points[points["front"] == name].groupby(["robot", "space"], sort=False):
            line = _LINES[spaces.index(space) % len(_LINES)]
            draw_steps(ax, part, colors[str(robot)], f"_{robot}, {space} space", line=line)
        for (method, robot), swims in policies[policies["fluid"] == name].groupby(["method", "robot"], sort=False):
            edge = colors[str(robot)]
            style = {"color": looks[str(method)], "mec": edge, "mew": 1.2, "zorder": 3, "label": f"_{method}, {robot}"}
            ax.plot(swims["power"], swims["speed"], "o", ms=5, **style)
        ax.set_title(name)
        power_axis(ax)
    axes[0][0].set_ylabel("speed v [m/s]")
    handles = [Line2D([], [], color=color, label=robot.replace("_", " ")) for robot, color in colors.items()]
    handles += [
        Line2D([], [], color="#444444", ls=_LINES[k % len(_LINES)], label=f"{space} space")
        for k, space in enumerate(spaces)
    ]
    handles += [Line2D([], [], color=color, marker="o", ls="", label=name) for name, color in looks.items()]
    fig.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return svg(fig, "Fronts of speed against power of each robot")
