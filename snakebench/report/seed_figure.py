"""Figures of policies: every seed as a thin line, their mean as a thick one; among them what changes over viscosity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from snakebench.report.figure_style import METHOD_LOOKS, Color, fluid_lines, method_look, svg
from snakebench.report.table import COSTS as _COSTS
from snakebench.report.table import LABELS, MEASURED

_PALER = {"teacher_short": "#9db7f2", "symmetric_short": "#efae8d"}  # from short rollouts
_OVER_VISCOSITY = {
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail amplitude [m]",
    "torque_amplitude": "torque amplitude [N m]",
} | {name: LABELS[name] for name in MEASURED}
Trend = Mapping[
    str, tuple[tuple[float, float], tuple[float, float]]
]  # by figure: viscosities [m^2/s], and values there


def over_viscosity(
    swims: pd.DataFrame, policies: Sequence[str], gaits: pd.DataFrame | None = None, trend: Trend | None = None
) -> str:
    """Gait, speed, powers and costs of transport over viscosity.

    Args:
        swims: of the policies, columns method, seed, viscosity and figures.
        policies: to be shown.
        gaits: the same of fixed gaits, with the column tuned_to.
        trend: what the paper says.
    """
    fig, axes = plt.subplots(2, 4, figsize=(12.4, 5.8), sharex=True, layout="constrained")
    for ax, (column, label) in zip(axes.flat, _OVER_VISCOSITY.items(), strict=True):
        for name, color in policy_colors(policies).items():
            seeds = swims[swims["method"] == name].groupby("seed")
            lines = [(part["viscosity"].to_numpy(), part[column].to_numpy()) for _, part in seeds]
            draw_seeds(ax, lines, name, color, legend=column == "speed")
        if gaits is not None:
            _draw_gaits(ax, gaits, column)
        if trend and column in trend:
            own_label = "paper's policy" if column == "swim_frequency" else None
            ax.plot(*trend[column], "D:", color="#111111", ms=5, lw=1, label=own_label)
        ax.set(xscale="log", ylabel=label)
        if column in _COSTS:
            _readable_costs(ax)
    for ax in axes[1]:
        ax.set_xlabel("kinematic viscosity ν [m²/s]")
    legend_below(fig)
    return svg(fig, "Gait, speed, powers and costs of transport over viscosity")


def _draw_gaits(ax: Axes, gaits: pd.DataFrame, column: str) -> None:
    for name, line in fluid_lines(list(gaits["tuned_to"].unique())).items():
        part = gaits[gaits["tuned_to"] == name]
        label = f"sinusoid, {name}" if column == "speed" else f"_sinusoid, {name}"
        ax.plot(part["viscosity"], part[column], label=label, color=method_look("sinusoid").color, ls=line, lw=1)


def _readable_costs(ax: Axes) -> None:
    """A logarithmic axis with plain numbers."""
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(10, subs=(1, 2, 5)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def draw_seeds(
    ax: Axes, lines: list[tuple[np.ndarray, np.ndarray]], name: str, color: Color, *, legend: bool = True
) -> None:
    """Every seed as a thin line, their mean as a thick one, in the legend or not; a band of one standard deviation."""
    said = name.replace("_", " ")
    for k, (x, y) in enumerate(lines):
        ax.plot(x, y, color=color, lw=0.5, alpha=0.5, label=f"_{said}, seed {k + 1} of {len(lines)}")
    if not lines:
        return
    x = min((x for x, _ in lines), key=len)
    seeds = np.array([y[-len(x) :] for _, y in lines])
    ax.plot(x, seeds.mean(axis=0), color=color, lw=1.8, label=said if legend else f"_{said}, mean")
    if len(lines) > 1:
        spread = seeds.std(axis=0, ddof=1)
        ax.fill_between(x, seeds.mean(axis=0) - spread, seeds.mean(axis=0) + spread, color=color, alpha=0.15, lw=0)


def legend_below(fig: Figure) -> None:
    """What the lines of all panels mean, below them."""
    if any(ax.get_legend_handles_labels()[0] for ax in fig.axes):  # a short training may have ended no episode
        fig.legend(loc="outside lower center", ncols=3, frameon=False)


def policy_colors(policies: Sequence[str]) -> dict[str, Color]:
    """A colour for each policy, the same in every figure for those that are often shown."""
    spare = cycle(sns.color_palette("Set2", 8))
    return {
        name: METHOD_LOOKS[name].color if name in METHOD_LOOKS else _PALER.get(name) or next(spare) for name in policies
    }
