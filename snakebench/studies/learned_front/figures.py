"""Figures of the learned-front study."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from snakebench.report.figure_style import METHOD_LOOKS, fluid_lines, svg
from snakebench.report.front_figure import draw_attained, power_axis


def attainment(surfaces: pd.DataFrame, names: Sequence[str]) -> str:
    """Between what the best and the worst seed of a policy attain, and the median."""
    fig, axes = plt.subplots(
        1, len(names), figsize=(2.7 * len(names), 2.8), sharex=True, layout="constrained", squeeze=False
    )
    at = np.logspace(-2, 2, 300)
    for ax, name in zip(axes[0], names, strict=True):
        draw_attained(ax, surfaces[surfaces["front"] == name], at, METHOD_LOOKS["student"].color)
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
    color = METHOD_LOOKS["student"].color
    fig, axes = plt.subplots(2, 3, figsize=(10, 5.6), sharex=True, layout="constrained")
    for ax, (column, label) in zip(axes.flat, labels.items(), strict=True):
        for fluid, line in fluid_lines(fluids).items():
            part = swims[swims["fluid"] == fluid]
            for _, seed in part.groupby("seed"):
                ax.plot(seed["price"], seed[column], color=color, lw=0.4, alpha=0.5)
            mean = part.groupby("price")[column].mean()
            ax.plot(mean.index, mean, color=color, ls=line, lw=1.8, label=fluid if column == "speed" else None)
        ax.set(xscale="log", ylabel=label)
    for ax in axes[1]:
        ax.set_xlabel("price of power λ [1/W]")
    fig.legend(loc="outside lower center", ncols=len(fluids), frameon=False)
    return svg(fig, "Speed, power and gait along the dial")
