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
from matplotlib.figure import Figure

from snakebench.metrics import settled_angle, spectrum, swim_frequency
from snakebench.trajectory import Trajectory

COLORS = {"water": "#1f77b4", "oil1": "#d98c00", "oil2": "#8c3b12", "mean": "#444444"}
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
