"""Figures of trainings: returns, errors and speeds over their course."""

from collections.abc import Sequence

import pandas as pd

from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import fluid_lines, palette, svg
from snakebench.report.seed_figure import draw_seeds


def learning(curves: pd.DataFrame, policies: Sequence[str]) -> str:
    """Mean return of the training episodes over control steps: every seed, their mean and standard deviation."""
    fig, ((ax,),) = panels(1, 1, 7, 3.8, x="control steps [millions]", y="return of an episode J")
    ended = curves.dropna(subset="return_mean").assign(steps=curves["steps"] / 1e6)
    for name, color in palette(policies, "Set2").items():
        draw_seeds(ax, ended[ended["policy"] == name], "steps", "return_mean", name, color)
    legend_below(fig, columns=3)
    return svg(fig, "Return of the training episodes over the control steps")


def distillation(curves: pd.DataFrame, policies: Sequence[str]) -> str:
    """Mean squared error of the students' actions, and speed in each fluid, over the iterations."""
    lines = fluid_lines([str(name).removeprefix("speed_") for name in curves if str(name).startswith("speed_")])
    fig, ((error, speed),) = panels(1, 2, 4.5, 3.6, x="iteration")
    for name, color in palette(policies, "Set2").items():
        seeds = curves[curves["policy"] == name]
        draw_seeds(error, seeds, "steps", "error", name, color)
        for fluid, line in lines.items():
            mean = seeds.groupby("steps")[f"speed_{fluid}"].mean()
            speed.plot(mean.index, mean, color=color, ls=line, label=f"_{name}, {fluid}")
    for fluid, line in lines.items():
        speed.plot([], [], color="#444444", ls=line, label=fluid)
    error.set(ylabel="mean squared error [rad²]", yscale="log")
    speed.set_ylabel("v, planar engine [m/s]")
    legend_below(fig, columns=3)
    return svg(fig, "Error of the student's actions and its speed over the iterations of distillation")
