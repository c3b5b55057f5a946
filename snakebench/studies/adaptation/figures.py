"""Figures of the adaptation study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from snakebench.report.figure_style import method_look, svg
from snakebench.report.seed_figure import draw_seeds, legend_below, policy_colors
from snakebench.report.table import LABELS

_PLACES = 240  # along x, where the seeds of a policy are averaged


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
        ax.set_ylabel(LABELS[column])
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
