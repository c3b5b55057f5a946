"""Figures: tables and trajectories to inline SVG, with seaborn."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping

import matplotlib

matplotlib.use("svg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from snakebench.metrics import settled_angle, spectrum, swim_frequency
from snakebench.trajectory import Trajectory

COLORS = {"water": "#1f77b4", "oil1": "#d98c00", "oil2": "#8c3b12", "mean": "#444444"}
ENGINE_COLORS = {"pybullet": "#c2410c", "planar": "#0b6e99"}
_MARKERS = {"torque": "o", "angle": "s"}
_PERIODS_SHOWN = 2

sns.set_theme(
    style="whitegrid",
    context="paper",
    font_scale=1.15,
    rc={"svg.fonttype": "none", "svg.hashsalt": "snakebench", "font.family": "sans-serif", "axes.titleweight": "bold"},
)


def convergence(trials: pd.DataFrame) -> str:
    """Best value found so far against the number of gaits tried: one line a seed, one panel an objective."""
    per_gait = trials.drop_duplicates(["objective", "seed", "trial"]).sort_values("trial", kind="stable")
    best = per_gait.groupby(["objective", "seed"])["value"].cummax()
    table = per_gait.assign(best=best, gaits=per_gait["trial"] + 1)
    order = list(trials["objective"].unique())
    grid = sns.relplot(
        table,
        x="gaits",
        y="best",
        col="objective",
        col_order=order,
        hue="objective",
        hue_order=order,
        palette=_palette(order),
        units="seed",
        estimator=None,
        kind="line",
        drawstyle="steps-post",
        legend=False,
        col_wrap=2,
        height=2.3,
        aspect=1.7,
        facet_kws={"sharey": False},
    )
    grid.set_titles("{col_name}")
    grid.set_axis_labels("gaits tried", "best return J")
    return _svg(grid.figure, "Best return found so far against the number of gaits tried")


def search_space(trials: pd.DataFrame, bounds: Mapping[str, tuple[float, float]]) -> str:
    """Where the searches looked: frequency and amplitude of every gait, coloured by the objective's value."""
    order = list(trials["objective"].unique())
    per_gait = trials.drop_duplicates(["objective", "seed", "trial"]).dropna(subset="value")
    fig, axes = plt.subplots(
        1, len(order), figsize=(2.4 * len(order), 2.6), sharey=True, layout="constrained", squeeze=False
    )
    for ax, objective in zip(axes[0], order, strict=True):
        gaits = per_gait[per_gait["objective"] == objective].sort_values("value", kind="stable")
        points = ax.scatter(gaits["frequency"], gaits["amplitude"], c=gaits["value"], s=9, cmap="viridis")
        fig.colorbar(points, ax=ax, location="bottom", label="J", aspect=30)
        ax.set(title=objective, xlabel="frequency [Hz]", xlim=bounds["frequency"], ylim=bounds["amplitude"])
    axes[0][0].set_ylabel("amplitude [rad]")
    return _svg(fig, "Frequency and amplitude of every gait tried, coloured by its return")


def time_series(trajectories: Mapping[str, Trajectory]) -> str:
    """Joint angles and applied torques over the last two gait periods, one column a fluid."""
    fig, axes = plt.subplots(
        2,
        len(trajectories),
        figsize=(2.9 * len(trajectories), 4),
        sharex="col",
        sharey="row",
        layout="constrained",
        squeeze=False,
    )
    for column, (name, trajectory) in enumerate(trajectories.items()):
        colors = sns.color_palette("viridis", trajectory.robot.n_joints)
        period = 1 / (swim_frequency(trajectory) or 0.5)
        shown = trajectory.time >= trajectory.time[-1] - _PERIODS_SHOWN * period
        for ax, series in zip(axes[:, column], (trajectory.joint_angle, trajectory.torque), strict=True):
            for joint, color in enumerate(colors):
                label = f"{joint + 1}" if ax is axes[0, 0] else None
                ax.plot(trajectory.time[shown], series[shown, joint], color=color, lw=1.2, label=label)
        axes[0, column].set_title(name)
        axes[1, column].set_xlabel("time [s]")
    axes[0, 0].set_ylabel("q [rad]")
    axes[1, 0].set_ylabel("u [N m]")
    fig.legend(loc="outside lower center", ncols=12, title="joint, from head to tail", frameon=False)
    return _svg(fig, "Joint angles and applied torques over the last two gait periods")


def spectra(trajectories: Mapping[str, Trajectory]) -> str:
    """Amplitude spectrum of the last joint's angle over the last two thirds of the run."""
    fig, ax = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
    for name, trajectory in trajectories.items():
        frequencies, amplitude = spectrum(settled_angle(trajectory), trajectory.rate)
        shown = (frequencies > 0) & (frequencies <= 3)
        ax.plot(frequencies[shown], np.maximum(amplitude[shown], 1e-6), label=name, color=COLORS.get(name), lw=1.2)
    ax.set(
        xlabel="frequency [Hz]", ylabel="amplitude of the\nlast joint's angle [rad]", yscale="log", ylim=(1e-5, None)
    )
    ax.legend(frameon=False)
    return _svg(fig, "Spectrum of the last joint's angle")


def work_precision(errors: pd.DataFrame) -> str:
    """Error against the planar limit over cost: median of all swims as a line, from least to largest as a band."""
    names = {"speed": "error of v", "power": "error of P", "cost_of_transport": "error of CoT"}
    fig, axes = plt.subplots(1, len(names), figsize=(10, 3.4), sharey=True, layout="constrained")
    for ax, (metric, name) in zip(axes, names.items(), strict=True):
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
    axes[0].set_ylabel("relative error")
    handles, labels = axes[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return _svg(fig, "Error of speed, power and cost of transport against computing time")


def order(errors: pd.DataFrame) -> str:
    """Error of the joint angles against the physics rate, one line a gait, beside slopes of whole orders."""
    kinds = [("pybullet", "torque", 1), ("pybullet", "angle", 1), ("planar", "torque", 4), ("planar", "angle", 2)]
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
    return _svg(fig, "Error of the joint angles against the physics rate")


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
    return _svg(fig, "Energy that the integrator lost or made against the physics rate")


def _tick_rates(ax: Axes, rates: pd.Series) -> None:
    """Label every second of the rates that there are, the finest among them."""
    shown = sorted(rates.unique())[::-2]
    ax.set_xticks(shown, [f"{rate}" for rate in shown])
    ax.xaxis.set_minor_locator(NullLocator())


def bench(table: pd.DataFrame) -> str:
    """Simulated seconds per second of every workload."""
    shown = table[table["workload"] != "bare loop"]
    labels = [
        f"{row['engine']}, {row['robots']} robot{'s' if row['robots'] > 1 else ''}, {row['physics_rate']} Hz"
        + (f", {row['threads']} threads" if row["threads"] > 1 else "")
        for row in shown.to_dict("records")
    ]
    grid = sns.catplot(
        shown.assign(label=labels),
        x="simulated",
        y="label",
        col="drives",
        hue="engine",
        palette=ENGINE_COLORS,
        kind="bar",
        legend=False,
        height=3.2,
        aspect=1.45,
    )
    grid.set(xscale="log", xlim=(20, None))
    grid.set_titles("{col_name}")
    grid.set_axis_labels("simulated seconds per second", "")
    for ax in grid.axes.flat:
        for bars in ax.containers:
            ax.bar_label(bars, fmt="{:.0f}", padding=3, fontsize=8)
    return _svg(grid.figure, "Simulated seconds per second of every workload")


def _palette(names: list[str]) -> list[object]:
    spare = iter(sns.color_palette("deep", len(names)))
    return [COLORS.get(name) or next(spare) for name in names]


def _svg(figure: Figure, title: str) -> str:
    """The figure as an SVG element that scales with the page; equal figures are equal bytes."""
    text = io.StringIO()
    figure.savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)
    svg = text.getvalue()[text.getvalue().index("<svg") :]
    svg = re.sub(r'<svg ([^>]*?)width="[\d.]+pt" height="[\d.]+pt"|<svg ', _scaled, svg, count=1)
    svg = re.sub(r' (d|x|y)="[^"]*"', lambda numbers: re.sub(r"(\d\.\d{2})\d+", r"\1", numbers[0]), svg)
    own = re.sub(r"\W+", "-", title)  # ids are the page's, and figures share glyphs and clips
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{own}-", svg)
    return svg.replace(">", f' role="img" aria-label="{title}">', 1)


def _scaled(match: re.Match[str]) -> str:
    return f'<svg class="figure" {match.group(1) or ""}'
