"""Figures of the teacher-student study."""

from collections.abc import Mapping

import numpy as np

from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import COLORS, svg
from snakebench.trajectory import Trajectory

_SNAPSHOTS = 6  # over a gait period
_TORQUE_SECONDS = 4.0


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
