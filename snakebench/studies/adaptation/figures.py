"""Figures of the adaptation study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from snakebench.report.figure_style import fluid_lines, method_look, svg
from snakebench.report.tables import TAKEN
from snakebench.studies.teacher_student.figures import draw_seeds, legend_below, policy_colors

_LABELS = {
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail amplitude [m]",
    "torque_amplitude": "torque amplitude [N m]",
    "speed": "v [m/s]",
} | TAKEN
_COSTS = ("cost_of_transport", "positive_cost_of_transport")
_PLACES = 240  # along x, where the seeds of a policy are averaged
Trend = Mapping[str, tuple[float, float]]


def over_viscosity(
    swims: pd.DataFrame,
    policies: Sequence[str],
    gaits: pd.DataFrame,
    ends: tuple[float, float] | None,
    trend: Trend,
) -> str:
    """Gait, speed, powers and costs of transport over viscosity.

    Args:
        swims: of the policies over viscosities, columns method, seed, viscosity and figures.
        policies: to be shown.
        gaits: the same of fixed gaits, with the column tuned_to.
        ends: the viscosities [m^2/s] between which the paper has a trend, if they are shown.
        trend: what it says there, by figure.
    """
    fig, axes = plt.subplots(2, 4, figsize=(12.4, 5.8), sharex=True, layout="constrained")
    tuned = list(gaits["tuned_to"].unique())
    for ax, (column, label) in zip(axes.flat, _LABELS.items(), strict=True):
        first = column == "speed"
        for name, color in policy_colors(policies).items():
            seeds = swims[swims["method"] == name].groupby("seed")
            lines = [(part["viscosity"].to_numpy(), part[column].to_numpy()) for _, part in seeds]
            draw_seeds(ax, lines, name, color, legend=first)
        for name, line in fluid_lines(tuned).items():
            part = gaits[gaits["tuned_to"] == name]
            label_of = f"sinusoid, {name}" if first else f"_sinusoid, {name}"
            style = {"color": method_look("sinusoid").color, "ls": line, "lw": 1}
            ax.plot(part["viscosity"], part[column], label=label_of, **style)
        if ends and column in trend:
            own_label = "paper's policy" if column == "swim_frequency" else None
            ax.plot(ends, trend[column], "D:", color="#111111", ms=5, lw=1, label=own_label)
        ax.set(xscale="log", ylabel=label)
        if column in _COSTS:
            _readable_costs(ax)
    for ax in axes[1]:
        ax.set_xlabel("kinematic viscosity ν [m²/s]")
    legend_below(fig)
    return svg(fig, "Gait, speed, powers and costs of transport over viscosity")


def course(name: str, along: str, traces: pd.DataFrame, policies: Sequence[str], gaits: Mapping[str, str]) -> str:
    """Viscosity, speed and powers through a course: every seed of the policies, their mean, and fixed gaits.

    Args:
        name: of the course.
        along: "time" or "x".
        traces: columns method, seed, time, x, viscosity, speed, power, and positive_power, of version 1.0 without it.
        policies: to be shown.
        gaits: fixed gaits by method, and as they are called.
    """
    shown = [name for name in ("speed", "power", "positive_power") if name in traces and traces[name].notna().any()]
    size, ratios = (10.0, 1.6 + 2.4 * len(shown)), [1, *(2 for _ in shown)]
    fig, (fluid, *axes) = plt.subplots(
        len(ratios), figsize=size, sharex=True, layout="constrained", height_ratios=ratios
    )
    furthest = traces.loc[[traces[along].idxmax()], ["method", "seed"]].to_numpy()[0]
    track = traces[(traces["method"] == furthest[0]) & (traces["seed"] == furthest[1])].sort_values(along)
    fluid.plot(track[along], track["viscosity"], color="#444444")
    fluid.fill_between(track[along], track["viscosity"].min(), track["viscosity"], color="#8a949e", alpha=0.3, lw=0)
    fluid.set(yscale="log", ylabel="ν [m²/s]")
    for ax, column in zip(axes, shown, strict=True):
        for method, color in policy_colors(policies).items():
            lines = _lines(traces[traces["method"] == method], along, column)
            draw_seeds(ax, lines, method, color, legend=column == "speed")
        for method, called in gaits.items():
            for x, y in _lines(traces[traces["method"] == method], along, column):
                label = called if column == "speed" else f"_{called}"
                ax.plot(x, y, color=method_look(called).color, lw=1.1, label=label)
        ax.set_ylabel(_LABELS[column])
    axes[-1].set_xlabel("t [s]" if along == "time" else "x [m]")
    legend_below(fig)
    return svg(fig, f"Viscosity, speed and powers through the course {name}")


def _lines(traces: pd.DataFrame, along: str, column: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """A figure of every seed over time, or over places along x that are the same for all."""
    seeds = [part for _, part in traces.groupby("seed")]
    if along == "time":
        return [(part["time"].to_numpy(), part[column].to_numpy()) for part in seeds]
    places = np.linspace(traces["x"].min(), traces["x"].max(), _PLACES)
    ways = [(np.maximum.accumulate(part["x"]), part[column]) for part in seeds]
    return [(places, np.interp(places, x, y, left=np.nan, right=np.nan)) for x, y in ways]


def _readable_costs(ax: Axes) -> None:
    """A logarithmic axis with plain numbers."""
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(10, subs=(1, 2, 5)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
