"""Figures of the Pareto study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from snakebench.report.figure_style import palette, svg
from snakebench.report.front_figure import draw_attained, power_axis
from snakebench.store import INTEGRATED


def growth(table: pd.DataFrame, whole: Mapping[tuple[str, str], tuple[float, float]]) -> str:
    """Hypervolume of every search, as a share of the whole grid's (or in m/s W without one), against simulations."""
    spaces, objectives = table["space"].unique(), table["objective"].unique()
    fig, axes = plt.subplots(
        len(spaces),
        len(objectives),
        figsize=(2.7 * len(objectives), 2.5 * len(spaces)),
        sharey="row",
        layout="constrained",
        squeeze=False,
    )
    colors = {"grid": "#8a949e", "nsga2": "#c2410c"}
    names = {"grid": "grid, in random order", "nsga2": "NSGA-II"}
    for i, space in enumerate(spaces):
        for j, objective in enumerate(objectives):
            ax, part = axes[i][j], table[(table["space"] == space) & (table["objective"] == objective)]
            scale = 1.0
            if (space, objective) in whole:
                simulations, scale = whole[space, objective]
                ax.axhline(99, color="#444444", lw=0.8, ls=":")
                ax.axvline(simulations / 10, color="#444444", lw=0.8, ls=":")
                ax.set_ylim(70, 105)
                scale /= 100
            for (method, _), line in part.groupby(["method", "seed"]):
                ax.plot(line["simulations"], line["hypervolume"] / scale, color=colors[str(method)], lw=0.9, alpha=0.8)
            ax.set(xscale="log", title=f"{objective}, {space}", xlim=(min(20, line["simulations"].max() / 2), None))
        axes[i][0].set_ylabel("hypervolume [% of the grid's]" if whole else "hypervolume [m/s W]")
    for ax in axes[-1]:
        ax.set_xlabel("simulations")
    shown = [name for name in colors if name in set(table["method"])]
    handles = [Line2D([], [], color=colors[name], label=names[name]) for name in shown]
    fig.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return svg(fig, "Hypervolume of each search against its number of simulations")


def attainment(surfaces: pd.DataFrame, fronts: pd.DataFrame) -> str:
    """Between what the best and the worst seed of NSGA-II attain, the median, and the published front as searched."""
    spaces, objectives = surfaces["space"].unique(), surfaces["objective"].unique()
    fig, axes = plt.subplots(
        len(spaces),
        len(objectives),
        figsize=(2.7 * len(objectives), 2.5 * len(spaces)),
        sharex=True,
        sharey="col",
        layout="constrained",
        squeeze=False,
    )
    at = np.logspace(-2, 2, 300)
    for i, space in enumerate(spaces):
        for j, objective in enumerate(objectives):
            ax = axes[i][j]
            part = surfaces[(surfaces["space"] == space) & (surfaces["objective"] == objective)]
            draw_attained(ax, part, at, "#c2410c")
            front = fronts[(fronts["space"] == space) & (fronts["front"] == objective)]
            ax.plot(front["power_searched"], front["speed_searched"], ".", color="#111111", ms=1.5, rasterized=True)
            ax.set(title=f"{objective}, {space}")
            power_axis(ax, label=i == len(spaces) - 1)
        axes[i][0].set_ylabel("speed v [m/s]")
    return svg(fig, "Attainment surfaces of the seeds of NSGA-II")


def parameters(fronts: pd.DataFrame, fluids: Sequence[str], labels: Mapping[str, str]) -> str:
    """The parameters, by column, of the gaits along each fluid's front and the integrated one."""
    spaces = fronts["space"].unique()
    fig, axes = plt.subplots(
        len(labels),
        len(spaces),
        figsize=(4.6 * max(len(spaces), 2), 2 * len(labels)),
        sharex="col",
        sharey="row",
        layout="constrained",
        squeeze=False,
    )
    names = [*fluids, INTEGRATED]
    colors = dict(zip(names, palette(names), strict=True))
    for j, space in enumerate(spaces):
        for i, (column, label) in enumerate(labels.items()):
            for name in names:
                part = fronts[(fronts["space"] == space) & (fronts["front"] == name)]
                axes[i][j].plot(part["speed"], part[column], ".", ms=4, color=colors[name], rasterized=True)
            axes[i][0].set_ylabel(label)
        axes[0][j].set_title(f"{space} space")
        axes[-1][j].set_xlabel("speed v [m/s]")
    handles = [Line2D([], [], color=colors[name], marker=".", ls="", label=name) for name in names]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(names), frameon=False)
    return svg(fig, "Gait parameters along each front")


def differences(verified: pd.DataFrame) -> str:
    """How far the searching engine is from the verifying one, for every gait verified, against its power."""
    fig, axes = plt.subplots(1, 2, figsize=(9, 3.2), sharex=True, sharey=True, layout="constrained")
    fluids = list(verified["fluid"].unique())
    for ax, name, symbol in zip(axes, ("speed", "power"), "vP", strict=True):
        for fluid, color in zip(fluids, palette(fluids), strict=True):
            part = verified[(verified["fluid"] == fluid) & (verified["status"] == "ok")]
            gap = (part[name] / part[f"{name}_searched"] - 1).abs()
            ax.plot(part["power"], np.maximum(gap, 1e-6), ".", ms=3, color=color, label=fluid, rasterized=True)
        ax.set(yscale="log", ylim=(1e-6, 10), title=f"difference of {symbol}")
        power_axis(ax)
    axes[0].set_ylabel("relative difference")
    handles, labels = axes[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=len(fluids), frameon=False, markerscale=3)
    return svg(fig, "Relative difference between the two engines against power")
