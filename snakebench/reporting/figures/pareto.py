"""Figures of the Pareto study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator

from snakebench.reporting.figures.style import Color, palette, svg
from snakebench.reporting.fronts import speeds_at

_LINES = ("-", "--", ":", "-.")  # of the search spaces
_BASELINES = {  # marker, size, colour
    "sea snake": ("*", 10, "#111111"),
    "Fourier": ("D", 3, "#6a3d9a"),
    "symmetric": ("X", 6, "#c2410c"),
    "teacher": ("P", 6, "#2b5fd9"),
    "student": ("o", 6, "#2a9d57"),
}
_LEAST_POWER = 0.01  # shown [W]
_PLACES = 100  # points of a front drawn for each factor e of power
_SPACE_COLORS = {"integrated": "#2a9d57", "simple-sum": "#2b5fd9"}  # as in the paper


def by_fluid(fronts: pd.DataFrame, fluids: Sequence[str], others: pd.DataFrame) -> str:
    """Each fluid's front in each search space, and the optima of other baselines."""
    fig, axes = plt.subplots(
        1, len(fluids), figsize=(3.6 * len(fluids), 3.6), sharex=True, layout="constrained", squeeze=False
    )
    colors = dict(zip(fluids, palette(list(fluids)), strict=True))
    for ax, fluid in zip(axes[0], fluids, strict=True):
        _draw(ax, fronts[fronts["front"] == fluid], colors[fluid])
        _draw_others(ax, others[others["front"] == fluid])
        ax.set(title=fluid)
        power_axis(ax)
    axes[0][0].set_ylabel("speed v [m/s]")
    handles = [*_space_handles(fronts), *_baseline_handles(others)]
    fig.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return svg(fig, "Front of speed against power of each fluid")


def overall(fronts: pd.DataFrame, others: pd.DataFrame) -> str:
    """The integrated and the simple-sum front of each search space: means over the fluids.

    Of another baseline what is integrated is hollow.
    """
    fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
    for name, color in _SPACE_COLORS.items():
        _draw(ax, fronts[fronts["front"] == name], color)
    shared = others[others["front"].isin(_SPACE_COLORS)]
    one_for_all = shared["front"] == "integrated"
    _draw_others(ax, shared[~one_for_all])
    _draw_others(ax, shared[one_for_all], hollow=True)
    power_axis(ax)
    ax.set_ylabel("speed v, mean over the fluids [m/s]")
    ax.set_xlabel("power P, mean over the fluids [W]")
    handles = [Line2D([], [], color=color, label=name) for name, color in _SPACE_COLORS.items()]
    handles += [*_space_handles(fronts), *_baseline_handles(shared)]
    fig.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
    return svg(fig, "Integrated and simple-sum front")


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
            ax.set(xscale="log", title=f"{objective}, {space}", xlim=(20, None))
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
    at = np.logspace(np.log10(_LEAST_POWER), 2, 300)
    for i, space in enumerate(spaces):
        for j, objective in enumerate(objectives):
            ax = axes[i][j]
            part = surfaces[(surfaces["space"] == space) & (surfaces["objective"] == objective)]
            draw_attained(ax, part, at, "#c2410c")
            front = fronts[(fronts["space"] == space) & (fronts["front"] == objective)]
            ax.plot(front["power_searched"], front["speed_searched"], ".", color="#111111", ms=1.5)
            ax.set(title=f"{objective}, {space}")
            power_axis(ax, label=i == len(spaces) - 1)
        axes[i][0].set_ylabel("speed v [m/s]")
    return svg(fig, "Attainment surfaces of the seeds of NSGA-II")


def parameters(fronts: pd.DataFrame, fluids: Sequence[str], unit: str) -> str:
    """Amplitude, frequency and phase of the gaits along each fluid's front and the integrated one."""
    labels = {"amplitude": f"A [{unit}]", "frequency": "f [Hz]", "phase": "ψ [rad]"}
    spaces = fronts["space"].unique()
    fig, axes = plt.subplots(
        len(labels),
        len(spaces),
        figsize=(4.6 * max(len(spaces), 2), 6),
        sharex="col",
        sharey="row",
        layout="constrained",
        squeeze=False,
    )
    names = [*fluids, "integrated"]
    colors = dict(zip(names, [*palette(list(fluids)), _SPACE_COLORS["integrated"]], strict=True))
    for j, space in enumerate(spaces):
        for i, (column, label) in enumerate(labels.items()):
            for name in names:
                part = fronts[(fronts["space"] == space) & (fronts["front"] == name)]
                axes[i][j].plot(part["speed"], part[column], ".", ms=4, color=colors[name])
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
            ax.plot(part["power"], np.maximum(gap, 1e-6), ".", ms=3, color=color, label=fluid)
        ax.set(yscale="log", ylim=(1e-6, 10), title=f"difference of {symbol}")
        power_axis(ax)
    axes[0].set_ylabel("relative difference")
    handles, labels = axes[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=len(fluids), frameon=False, markerscale=3)
    return svg(fig, "Relative difference between the two engines against power")


def draw_attained(ax: Axes, surfaces: pd.DataFrame, powers: np.ndarray, color: Color) -> None:
    """A band between what the best and the worst seed attain at powers, and a line for the median."""
    speed = {name: speeds_at(surface, powers) for name, surface in surfaces.groupby("surface")}
    ax.fill_between(powers, speed["worst"], speed["best"], color=color, alpha=0.3, lw=0, step="post")
    ax.plot(powers, speed["median"], color=color, lw=1, drawstyle="steps-post")


def draw_steps(ax: Axes, front: pd.DataFrame, color: Color, line: str, width: float = 1.4) -> None:
    """One front as a staircase; of thousands of points, as many as can be told apart."""
    ordered = front.sort_values("power")
    shown = ordered[~np.floor(np.log(ordered["power"]) * _PLACES).duplicated()]
    ax.plot(shown["power"], shown["speed"], drawstyle="steps-post", color=color, ls=line, lw=width)


def _draw(ax: Axes, front: pd.DataFrame, color: Color) -> None:
    """A front in each search space, a line style for each."""
    for (_, part), line in zip(front.groupby("space", sort=False), _LINES, strict=False):
        draw_steps(ax, part, color, line)


def _draw_others(ax: Axes, others: pd.DataFrame, *, hollow: bool = False) -> None:
    look = {"mfc": "none", "mew": 0.8} if hollow else {"mew": 0}
    for name, part in others.groupby("baseline"):
        marker, size, color = _BASELINES[str(name)]
        ax.plot(part["power"], part["speed"], marker, ms=size, color=color, zorder=3, **look)


def _space_handles(fronts: pd.DataFrame) -> list[Line2D]:
    return [
        Line2D([], [], color="#444444", ls=line, label=f"{space} space")
        for space, line in zip(fronts["space"].unique(), _LINES, strict=False)
    ]


def _baseline_handles(others: pd.DataFrame) -> list[Line2D]:
    shown = set(others["baseline"])
    return [
        Line2D([], [], marker=marker, color=color, ls="", label=name)
        for name, (marker, _, color) in _BASELINES.items()
        if name in shown
    ]


def power_axis(ax: Axes, *, label: bool = True) -> None:
    """Power on a logarithmic axis, the same in all figures."""
    ax.set(xscale="log", xlim=(_LEAST_POWER, 100))
    ax.xaxis.set_major_locator(LogLocator(10))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda power, _: f"{power:g}"))
    if label:
        ax.set_xlabel("power P [W]")
