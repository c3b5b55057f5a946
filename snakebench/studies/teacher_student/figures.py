"""Figures of the teacher-student study."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import COLORS, fluid_lines, palette, svg
from snakebench.report.seed_figure import draw_seeds
from snakebench.trajectory import Trajectory

_SNAPSHOTS = 6  # over a gait period
_TORQUE_SECONDS = 4.0


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


def torques(swims: Mapping[str, Trajectory]) -> str:
    """Applied torque of the first, middle and last joint over the last seconds of each swim."""
    fig, axes = panels(len(swims), 1, 8, 1.8 + 0.6 / len(swims), x="t [s]", sharex=True, sharey=True)
    for ax, (name, swim) in zip(axes.flat, swims.items(), strict=True):
        last = swim.time >= swim.time[-1] - _TORQUE_SECONDS
        n = swim.robot.n_joints
        for joint, color in zip((0, n // 2, n - 1), ("#111111", "#8a949e", "#c2410c"), strict=True):
            ax.plot(swim.time[last], swim.torque[last, joint], color=color, label=f"joint {joint + 1}")
        ax.set(title=name, ylabel="u [N m]")
    legend_below(fig, columns=3)
    return svg(fig, "Applied torques over the last seconds")


def snapshots(swims: Mapping[str, Trajectory], frequencies: Mapping[str, float]) -> str:
    """The body at equal times over the last period of each swim, from earlier (light) to later (dark)."""
    label = "x [m], from the last place of the centre of mass"
    fig, axes = panels(len(swims), 1, 8, 2, x=label, sharex=True, sharey=True)
    for ax, (name, swim) in zip(axes.flat, swims.items(), strict=True):
        end = swim.time[-1]
        times = np.linspace(end - 1 / frequencies[name], end, _SNAPSHOTS)
        for time, shade in zip(times, np.linspace(0.25, 1, _SNAPSHOTS), strict=True):
            row = min(round(time * swim.rate), len(swim.time) - 1)
            x, y = (_body(swim, row) - swim.center[-1]).T
            ax.plot(x, y, color=COLORS.get(name, "#444444"), alpha=shade)
        ax.set(title=f"{name}, {frequencies[name]:.2f} Hz", aspect="equal", ylabel="y [m]")
    return svg(fig, "The body over one period in each fluid")


def _body(swim: Trajectory, row: int) -> np.ndarray:
    """The line through head tip, joints and tail tip [m], shape (n_links + 1, 2)."""
    centers, directions = swim.links[row, :, :2], swim.links[row, :, 3:]
    halves = swim.robot.link_lengths[:, None] / 2 * directions
    return np.vstack([centers + halves, centers[-1] - halves[-1]])
