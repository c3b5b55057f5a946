"""Figures of the validation study."""

from typing import Any

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from snakebench.report.figure_axes import legend_below, panels, wrapped_panels
from snakebench.report.figure_style import ENGINE_COLORS, svg
from snakebench.report.table import LABELS, MEASURED

_MARKERS = {"torque": "o", "angle": "s"}
_ORDERS = {("planar", "torque"): 4}  # of convergence; all others are 2


def work_precision(errors: pd.DataFrame) -> str:
    """Error against the planar limit over cost: median of all swims as a line, from least to largest as a band."""
    measured = [metric for metric in MEASURED if errors[metric].notna().any()]
    titles = [f"error of {LABELS[metric].split()[0]}" for metric in measured]
    labels = {"x": "seconds per simulated second", "y": "relative error"}
    fig, axes = wrapped_panels(titles, 3, 3.3, 3.2, sharey=True, **labels)
    for ax, metric in zip(axes, measured, strict=True):
        for (engine, drives), part in errors.groupby(["engine", "drives"]):
            by_cost = part.groupby(["seconds_per_second", "physics_rate"])[metric]
            least, median, largest = (by_cost.quantile(share).clip(lower=1e-7) for share in (0, 0.5, 1))
            color, cost = ENGINE_COLORS[str(engine)], median.index.get_level_values(0)
            ax.fill_between(cost, least, largest, color=color, alpha=0.10, lw=0)
            ax.plot(cost, median, marker=_MARKERS[str(drives)], color=color, lw=1.3, ms=5, label=f"{engine}, {drives}")
            for (_, rate), x, y in zip(median.index[[0, -1]], cost[[0, -1]], median.iloc[[0, -1]], strict=True):
                look: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "color": "#5b6875"}
                ax.annotate(f"{rate} Hz", (x, y), (3, 5), **look)
        ax.set(xscale="log", yscale="log")
    legend_below(fig)
    return svg(fig, "Errors of speed, powers and costs of transport against computing time")


def order(errors: pd.DataFrame) -> str:
    """Error of the joint angles against the physics rate, one line a gait, beside slopes of whole orders."""
    kinds = list(dict.fromkeys(zip(errors["engine"], errors["drives"], strict=True)))
    labels = {"x": "physics rate [Hz]", "y": "largest error of a\njoint angle [rad]"}
    fig, axes = panels(1, len(kinds), 2.5, 3, titles=[", ".join(kind) for kind in kinds], sharey=True, **labels)
    for ax, (engine, drives) in zip(axes[0], kinds, strict=True):
        slope = _ORDERS.get((engine, drives), 2)
        part = errors[(errors["engine"] == engine) & (errors["drives"] == drives)]
        for _, gait in part.groupby("gait"):
            ax.plot(gait["physics_rate"], gait["error"], marker=".", color=ENGINE_COLORS[engine], lw=0.9, alpha=0.8)
        if len(part):
            rates = np.unique(part["physics_rate"].astype(float))
            top = 2 * part.loc[part["physics_rate"] == rates[0], "error"].max()
            ax.plot(rates, top * (rates[0] / rates) ** slope, "--", color="#444444", lw=1, label=f"order {slope}")
            ax.legend(frameon=False, loc="lower left")
        _rate_axis(ax, part["physics_rate"])
    return svg(fig, "Error of the joint angles against the physics rate")


def energy(runs: pd.DataFrame, adversaries: pd.DataFrame) -> str:
    """Part of the driving work that does not close against the physics rate: gaits, and each adversary's fluids."""
    attacks = adversaries.rename(columns={"adversary": "swim"})
    gaps = pd.concat([runs.assign(swim="gaits"), attacks.assign(gait="")]).sort_values("physics_rate")
    names = ["gaits", *attacks["swim"].unique()]
    colors = dict(zip(names, ["#8a949e", *sns.color_palette("deep", len(names) - 1)], strict=True))
    titles, labels = list(runs["engine"].unique()), {"x": "physics rate [Hz]", "y": "|energy gap|\nover driving work"}
    fig, axes = panels(1, len(titles), 4.5, 3.4, titles=titles, sharey=True, **labels)
    for ax, engine in zip(axes[0], titles, strict=True):
        part = gaps[gaps["engine"] == engine]
        for (swim, _, _), line in part.groupby(["swim", "gait", "fluid"]):
            gap = np.maximum(line["energy_gap"].abs(), 1e-8)
            ax.plot(line["physics_rate"], gap, marker=".", color=colors[str(swim)], lw=0.9, alpha=0.8)
        ax.axhline(0.01, color="#c2410c", lw=1, ls=":")
        _rate_axis(ax, part["physics_rate"])
    legend_below(fig, {name: {"color": color} for name, color in colors.items()})
    return svg(fig, "Energy that the integrator lost or made against the physics rate")


def _rate_axis(ax: Axes, rates: pd.Series) -> None:
    """Logarithmic axes; labels at every second of the physics rates that there are, the finest among them."""
    shown = sorted(rates.unique())[::-2]
    ax.set(xscale="log", yscale="log")
    ax.set_xticks(shown, [f"{rate}" for rate in shown])
    ax.xaxis.set_minor_locator(NullLocator())
