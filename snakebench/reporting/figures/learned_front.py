"""Figures of the learned-front study."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from snakebench.reporting.figures.pareto import draw_attained, draw_steps, power_axis
from snakebench.reporting.figures.style import palette, svg

FIXED = {  # colour, line
    "sea snake": ("#b58900", ":"),
    "sinusoid": ("#8a949e", "-"),
    "wider sinusoid": ("#444444", "--"),
    "free waveform": ("#6a3d9a", "-"),
}
_LEARNED = {"teacher": "#2b5fd9", "student": "#2a9d57"}
_OTHER = "#c2410c"


def fronts(fixed: pd.DataFrame, learned: pd.DataFrame, names: Sequence[str]) -> str | None:
    """The fronts of fixed gaits, and those of every seed of each policy; None without names."""
    if not names:
        return None
    fig, axes = plt.subplots(1, len(names), figsize=(10.8, 3.8), sharex=True, layout="constrained", squeeze=False)
    shown: dict[str, Line2D] = {}
    for ax, name in zip(axes[0], names, strict=True):
        for method, part in fixed[fixed["front"] == name].groupby("method", sort=False):
            color, line = FIXED[str(method)]
            draw_steps(ax, part, color, line)
            shown[str(method)] = Line2D([], [], color=color, ls=line, label=method)
        for method, policy in learned[learned["front"] == name].groupby("method", sort=False):
            color = _LEARNED.get(str(method), _OTHER)
            for _, part in policy.groupby("seed"):
                draw_steps(ax, part, color, "-", width=0.8)
            shown[str(method)] = Line2D([], [], color=color, label=f"{method}, every seed")
        ax.set_title(name)
        power_axis(ax)
    axes[0][0].set_ylabel("speed v [m/s]")
    fig.legend(handles=list(shown.values()), loc="outside lower center", ncols=3, frameon=False)
    return svg(fig, f"Learned and fixed fronts, {', '.join(names)}")


def attainment(surfaces: pd.DataFrame, names: Sequence[str]) -> str:
    """Between what the best and the worst seed of a policy attain, and the median."""
    fig, axes = plt.subplots(
        1, len(names), figsize=(2.7 * len(names), 2.8), sharex=True, layout="constrained", squeeze=False
    )
    at = np.logspace(-2, 2, 300)
    for ax, name in zip(axes[0], names, strict=True):
        draw_attained(ax, surfaces[surfaces["front"] == name], at, "#2a9d57")
        ax.set_title(name)
        power_axis(ax)
    axes[0][0].set_ylabel("speed v [m/s]")
    return svg(fig, "Attainment surfaces of the seeds of the policy")


def turned(swims: pd.DataFrame, fluids: Sequence[str]) -> str:
    """Speed, power, frequency, tail amplitude and wave speed along the dial: every seed, and their mean."""
    labels = {
        "speed": "v [m/s]",
        "power": "P [W]",
        "swim_frequency": "f [Hz]",
        "tail_amplitude": "tail amplitude [m]",
        "joint_amplitude": "joint amplitude [rad]",
        "wave_speed": "wave speed [m/s]",
    }
    fig, axes = plt.subplots(2, 3, figsize=(10, 5.6), sharex=True, layout="constrained")
    for ax, (column, label) in zip(axes.flat, labels.items(), strict=True):
        for fluid, color in zip(fluids, palette(list(fluids)), strict=True):
            part = swims[swims["fluid"] == fluid]
            for _, seed in part.groupby("seed"):
                ax.plot(seed["price"], seed[column], color=color, lw=0.5, alpha=0.5)
            mean = part.groupby("price")[column].mean()
            ax.plot(mean.index, mean, color=color, lw=1.8, label=fluid if column == "speed" else None)
        ax.set(xscale="log", ylabel=label)
    for ax in axes[1]:
        ax.set_xlabel("price of power λ [1/W]")
    fig.legend(loc="outside lower center", ncols=len(fluids), frameon=False)
    return svg(fig, "Speed, power and gait along the dial")
