"""Figures of the validation study."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from snakebench.report.figure_style import ENGINE_COLORS, svg
from snakebench.report.table import LABELS, MEASURED

_ABREAST = 3  # panels in a row
_MARKERS = {"torque": "o", "angle": "s"}


def work_precision(errors: pd.DataFrame) -> str:
    """Error against the planar limit over cost: median of all swims as a line, from least to largest as a band."""
    known = set(errors.dropna(subset="error")["metric"])
    names = {metric: f"error of {LABELS[metric].split()[0]}" for metric in MEASURED if metric in known}
    rows = -(-len(names) // _ABREAST)
    fig, axes = plt.subplots(
        rows, _ABREAST, figsize=(10, 3 * rows + 0.4), sharey=True, layout="constrained", squeeze=False
    )
    for ax in axes.flat[len(names) :]:
        ax.set_axis_off()
    for ax, (metric, name) in zip(axes.flat, names.items(), strict=False):
        of_metric = errors[errors["metric"] == metric]
        for (engine, drives), part in of_metric.groupby(["engine", "drives"]):
            by_cost = (
                part.groupby(["seconds_per_second", "physics_rate"])["error"].quantile(np.array([0, 0.5, 1])).unstack()
            )
            cost, rate = (by_cost.index.get_level_values(level).to_numpy() for level in (0, 1))
            color, marker = ENGINE_COLORS[str(engine)], _MARKERS[str(drives)]
            floor = np.maximum(by_cost.to_numpy(), 1e-7)
            ax.fill_between(cost, floor[:, 0], floor[:, 2], color=color, alpha=0.10, lw=0)
            ax.plot(cost, floor[:, 1], marker=marker, color=color, lw=1.3, ms=5, label=f"{engine}, {drives}")
            for end in (0, -1):
                at = (cost[end], floor[end, 1])
                ax.annotate(
                    f"{rate[end]} Hz", at, xytext=(3, 5), textcoords="offset points", fontsize=7, color="#5b6875"
                )
        ax.set(xscale="log", yscale="log", title=name, xlabel="seconds per simulated second")
    for ax in axes[:, 0]:
        ax.set_ylabel("relative error")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return svg(fig, "Errors of speed, powers and costs of transport against computing time")


def order(errors: pd.DataFrame) -> str:
    """Error of the joint angles against the physics rate, one line a gait, beside slopes of whole orders."""
    kinds = [("pybullet", "torque", 2), ("pybullet", "angle", 2), ("planar", "torque", 4), ("planar", "angle", 2)]
    fig, axes = plt.subplots(1, len(kinds), figsize=(10, 3), sharey=True, layout="constrained")
    for ax, (engine, drives, slope) in zip(axes, kinds, strict=True):
        part = errors[(errors["engine"] == engine) & (errors["drives"] == drives)]
        for _, gait in part.groupby("gait"):
            ax.plot(gait["physics_rate"], gait["error"], marker=".", color=ENGINE_COLORS[engine], lw=0.9, alpha=0.8)
        if len(part):
            rates = np.array(sorted(part["physics_rate"].unique()), float)
            top = 2 * part.loc[part["physics_rate"] == rates[0], "error"].max()
            ax.plot(rates, top * (rates[0] / rates) ** slope, "--", color="#444444", lw=1, label=f"order {slope}")
            ax.legend(frameon=False, loc="lower left")
        ax.set(xscale="log", yscale="log", title=f"{engine}, {drives}", xlabel="physics rate [Hz]")
        _tick_rates(ax, part["physics_rate"])
    axes[0].set_ylabel("largest error of a\njoint angle [rad]")
    return svg(fig, "Error of the joint angles against the physics rate")


def energy(runs: pd.DataFrame, adversaries: pd.DataFrame) -> str:
    """Part of the driving work that does not close against the physics rate: gaits, and each adversary's fluids."""
    gaits = runs[["engine", "gait", "fluid", "physics_rate", "energy_gap"]].assign(swim="gaits")
    attacks = adversaries.rename(columns={"adversary": "swim"})
    names = ["gaits", *attacks["swim"].unique()]
    colors = dict(zip(names, ["#8a949e", *sns.color_palette("deep", len(names) - 1)], strict=True))
    fig, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
    for ax, engine in zip(axes, ("pybullet", "planar"), strict=True):
        for table, by in ((gaits, ["gait", "fluid"]), (attacks, ["swim", "fluid"])):
            for _, line in table[table["engine"] == engine].sort_values("physics_rate").groupby(by):
                name = line["swim"].iloc[0]
                gap = np.maximum(line["energy_gap"].abs(), 1e-8)
                ax.plot(line["physics_rate"], gap, marker=".", color=colors[name], lw=0.9, alpha=0.8)
        ax.axhline(0.01, color="#c2410c", lw=1, ls=":")
        ax.set(xscale="log", yscale="log", title=engine, xlabel="physics rate [Hz]")
        rates = pd.concat([table[table["engine"] == engine]["physics_rate"] for table in (gaits, attacks)])
        _tick_rates(ax, rates)
    axes[0].set_ylabel("|energy gap|\nover driving work")
    handles = [Line2D([], [], color=color, label=name) for name, color in colors.items()]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(names), frameon=False)
    return svg(fig, "Energy that the integrator lost or made against the physics rate")


def _tick_rates(ax: Axes, rates: pd.Series) -> None:
    """Label every second of the rates that there are, the finest among them."""
    shown = sorted(rates.unique())[::-2]
    ax.set_xticks(shown, [f"{rate}" for rate in shown])
    ax.xaxis.set_minor_locator(NullLocator())
