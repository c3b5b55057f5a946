"""Figures of the teacher-student study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from snakebench.report.figure_style import COLORS, fluid_lines, svg
from snakebench.report.seed_figure import draw_seeds, legend_below, policy_colors
from snakebench.trajectory import Trajectory

_SNAPSHOTS = 6  # over a gait period
_TORQUE_SECONDS = 4.0


def learning(curves: pd.DataFrame, policies: Sequence[str]) -> str:
    """Mean return of the training episodes over control steps: every seed, their mean and standard deviation."""
    fig, ax = plt.subplots(figsize=(7, 3.8), layout="constrained")
    for name, color in policy_colors(policies).items():
        seeds = curves[curves["policy"] == name].dropna(subset=["return_mean"]).groupby("seed")
        lines = [(part["steps"].to_numpy() / 1e6, part["return_mean"].to_numpy()) for _, part in seeds]
        draw_seeds(ax, lines, name, color)
    ax.set(xlabel="control steps [millions]", ylabel="return of an episode J")
    legend_below(fig)
    return svg(fig, "Return of the training episodes over the control steps")


def distillation(curves: pd.DataFrame, policies: Sequence[str]) -> str:
    """Mean squared error of the students' actions, and speed in each fluid, over the iterations."""
    fluids = [str(name).removeprefix("speed_") for name in curves if str(name).startswith("speed_")]
    fig, (error, speed) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for name, color in policy_colors(policies).items():
        seeds = [part for _, part in curves[curves["policy"] == name].groupby("seed")]
        draw_seeds(error, [(part["steps"].to_numpy(), part["error"].to_numpy()) for part in seeds], name, color)
        for fluid, line in fluid_lines(fluids).items():
            mean = pd.concat(seeds).groupby("steps")[f"speed_{fluid}"].mean()
            speed.plot(mean.index, mean, color=color, ls=line, label=f"_{name}, {fluid}")
    for fluid, line in fluid_lines(fluids).items():
        speed.plot([], [], color="#444444", ls=line, label=fluid)
    error.set(xlabel="iteration", ylabel="mean squared error [rad²]", yscale="log")
    speed.set(xlabel="iteration", ylabel="v, planar engine [m/s]")
    legend_below(fig)
    return svg(fig, "Error of the student's actions and its speed over the iterations of distillation")


def torques(swims: Mapping[str, Trajectory]) -> str:
    """Applied torque of the first, middle and last joint over the last seconds of each swim."""
    fig, axes = plt.subplots(
        len(swims),
        1,
        figsize=(8, 1.8 * len(swims) + 0.6),
        sharex=True,
        sharey=True,
        layout="constrained",
        squeeze=False,
    )
    for (ax,), (name, swim) in zip(axes, swims.items(), strict=True):
        last = swim.time >= swim.time[-1] - _TORQUE_SECONDS
        n = swim.robot.n_joints
        for joint, color in zip((0, n // 2, n - 1), ("#111111", "#8a949e", "#c2410c"), strict=True):
            label = f"joint {joint + 1}" if ax is axes[0, 0] else None
            ax.plot(swim.time[last], swim.torque[last, joint], color=color, lw=1.2, label=label)
        ax.set_title(name)
        ax.set_ylabel("u [N m]")
    axes[-1, 0].set_xlabel("t [s]")
    legend_below(fig)
    return svg(fig, "Applied torques over the last seconds")


def snapshots(swims: Mapping[str, Trajectory], frequencies: Mapping[str, float]) -> str:
    """The body at equal times over the last period of each swim, from earlier (light) to later (dark)."""
    fig, axes = plt.subplots(
        len(swims), 1, figsize=(8, 2.0 * len(swims)), sharex=True, sharey=True, layout="constrained", squeeze=False
    )
    for (ax,), (name, swim) in zip(axes, swims.items(), strict=True):
        end = swim.time[-1]
        times = np.linspace(end - 1 / frequencies[name], end, _SNAPSHOTS)
        for time, shade in zip(times, np.linspace(0.25, 1, _SNAPSHOTS), strict=True):
            row = min(round(time * swim.rate), len(swim.time) - 1)
            x, y = _body(swim, row)
            ax.plot(x - swim.center[-1, 0], y - swim.center[-1, 1], color=COLORS.get(name, "#444444"), alpha=shade)
        ax.set(title=f"{name}, {frequencies[name]:.2f} Hz", aspect="equal", ylabel="y [m]")
    axes[-1, 0].set_xlabel("x [m], from the last place of the centre of mass")
    return svg(fig, "The body over one period in each fluid")


def _body(swim: Trajectory, row: int) -> tuple[np.ndarray, np.ndarray]:
    """The line through head tip, joints and tail tip."""
    links, half = swim.links[row], swim.robot.link_lengths / 2
    front = links[:, :2] + half[:, None] * links[:, 3:]
    rear = links[-1, :2] - half[-1] * links[-1, 3:]
    return np.append(front[:, 0], rear[0]), np.append(front[:, 1], rear[1])
