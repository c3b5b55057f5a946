"""Figures of the Pareto study."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from snakebench.names import CURRENCIES, INTEGRATED
from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import palette, svg
from snakebench.report.front_figure import SPEED, draw_attained, power_axis
from snakebench.report.table import CURRENCY_LABELS, name_of

_SEARCHES = {"grid": ("grid, in random order", "#8a949e"), "nsga2": ("NSGA-II", "#c2410c")}  # label, colour


def growth(table: pd.DataFrame, grids: pd.DataFrame) -> str:
    """Hypervolume of every search, as a share of its grid's (or in m/s W without grids), against simulations."""
    label = "hypervolume [% of the grid's]" if len(grids) else "hypervolume [m/s W]"
    rows, objectives = _rows(table), table["objective"].unique()
    fig, axes = panels(len(rows), len(objectives), 2.7, 2.5, x="simulations", y=label, sharey="row")
    for ax, ((space, currency), objective) in zip(axes.flat, product(rows, objectives), strict=True):
        part, scale = _of(table, space, objective, currency), 1.0
        for simulations, volume in grids[grids.index.isin([(space, objective, currency)])].to_numpy():
            ax.axhline(99, color="#444444", lw=0.8, ls=":")
            ax.axvline(simulations / 10, color="#444444", lw=0.8, ls=":")
            ax.set_ylim(70, 105)
            scale = 100 / volume
        for (method, _), line in part.groupby(["method", "seed"]):
            name, color = _SEARCHES[str(method)]
            ax.plot(line["simulations"], line["hypervolume"] * scale, color=color, lw=0.9, alpha=0.8, label=name)
        title = f"{objective}, {name_of(space)}, {CURRENCY_LABELS[currency]}"
        ax.set(xscale="log", title=title, xlim=(min(20, line["simulations"].max() / 2), None))
    legend_below(fig)
    return svg(fig, "Hypervolume of each search against its number of simulations")


def attainment(surfaces: pd.DataFrame, fronts: pd.DataFrame) -> str:
    """Between what the best and the worst seed of NSGA-II attain, the median, and the published front as searched."""
    rows, objectives = _rows(surfaces), surfaces["objective"].unique()
    fig, axes = panels(len(rows), len(objectives), 2.7, 2.5, sharey="col", y=SPEED)
    for ax, ((space, currency), objective) in zip(axes.flat, product(rows, objectives), strict=True):
        draw_attained(ax, _of(surfaces, space, objective, currency), "#c2410c", currency)
        front = _of(fronts.rename(columns={"front": "objective"}), space, objective, currency)
        power = front[f"{CURRENCIES[currency]}_searched"]
        ax.plot(power, front["speed_searched"], ".", color="#111111", ms=1.5, rasterized=True)
        ax.set_title(f"{objective}, {name_of(space)}")
    return svg(fig, "Attainment surfaces of the seeds of NSGA-II")


def _rows(table: pd.DataFrame) -> list[tuple[str, str]]:
    """The rows of panels: each search space in each currency."""
    return list(product(table["space"].unique(), table["currency"].unique()))


def _of(table: pd.DataFrame, space: str, objective: str, currency: str) -> pd.DataFrame:
    chosen = (table["space"] == space) & (table["objective"] == objective) & (table["currency"] == currency)
    return table[chosen]


def parameters(fronts: pd.DataFrame, fluids: Sequence[str], labels: Mapping[str, str]) -> str:
    """The parameters, by column, of the gaits along each fluid's front and the integrated one."""
    spaces, colors = fronts["space"].unique(), palette([*fluids, INTEGRATED])
    words = {"titles": [str(name_of(space)) for space in spaces], "x": "speed v [m/s]", "y": list(labels.values())}
    width, shared = max(9.2 / len(spaces), 4.6), {"sharex": "col", "sharey": "row"}
    fig, axes = panels(len(labels), len(spaces), width, 2, **words, **shared)
    for row, column in zip(axes, labels, strict=True):
        for ax, space in zip(row, spaces, strict=True):
            for name, color in colors.items():
                part = fronts[(fronts["space"] == space) & (fronts["front"] == name)]
                ax.plot(part["speed"], part[column], ".", ms=4, color=color, label=name, rasterized=True)
    legend_below(fig)
    return svg(fig, "Gait parameters along each front")


def differences(verified: pd.DataFrame) -> str:
    """How far the searching engine is from the verifying one, for every gait verified, against its power."""
    colors, shared = palette(list(verified["fluid"].unique())), {"sharex": True, "sharey": True}
    titles = ["difference of v", "difference of P"]
    fig, axes = panels(1, 2, 4.5, 3.2, titles=titles, y="relative difference", **shared)
    for ax, name in zip(axes[0], ("speed", "power"), strict=True):
        for fluid, color in colors.items():
            part = verified[(verified["fluid"] == fluid) & (verified["status"] == "ok")]
            gap = (part[name] / part[f"{name}_searched"] - 1).abs()
            ax.plot(part["power"], np.maximum(gap, 1e-6), ".", ms=3, color=color, label=fluid, rasterized=True)
        ax.set(yscale="log", ylim=(1e-6, 10))
        power_axis(ax)
    legend_below(fig, {name: {"color": color, "marker": ".", "ls": "", "ms": 9} for name, color in colors.items()})
    return svg(fig, "Relative difference between the two engines against power")
