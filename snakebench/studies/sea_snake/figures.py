"""Figures of the sea-snake study and of its samplers."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.lines import Line2D

from snakebench.metrics import settled_angle, spectrum, swim_frequency
from snakebench.report.figure_style import COLORS, drawing, palette, svg
from snakebench.trajectory import Trajectory

_PERIODS_SHOWN = 2


def convergence(trials: pd.DataFrame) -> str:
    """Best value found so far against the number of gaits tried: one line a seed, one panel an objective."""
    per_gait = trials.drop_duplicates(["objective", "seed", "trial"]).sort_values("trial", kind="stable")
    best = per_gait.groupby(["objective", "seed"])["value"].cummax()
    table = per_gait.assign(best=best, gaits=per_gait["trial"] + 1)
    order = list(trials["objective"].unique())
    with drawing():
        grid = sns.relplot(
            table,
            x="gaits",
            y="best",
            col="objective",
            col_order=order,
            hue="objective",
            hue_order=order,
            palette=palette(order),
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
    return svg(grid.figure, "Best return found so far against the number of gaits tried")


def samplers(progress: pd.DataFrame, goals: pd.DataFrame, names: Mapping[str, str]) -> str:
    """Best value found so far by each sampler, one panel an objective; a dotted line at the goal that counts."""
    fig, axes = plt.subplots(
        *((len(goals) + 1) // 2, 2), figsize=(9, 2.7 * ((len(goals) + 1) // 2)), layout="constrained", squeeze=False
    )
    shown = [str(sampler) for sampler in progress["sampler"].unique()]
    colors = dict(zip(shown, palette(shown), strict=True))
    for ax, (objective, goal) in zip(axes.flat, goals.iterrows(), strict=False):
        for sampler in shown:
            part = progress[(progress["objective"] == objective) & (progress["sampler"] == sampler)]
            seeds = part.pivot(index="gaits", columns="seed", values="best").ffill()
            style = {"color": colors[sampler], "drawstyle": "steps-post"}
            ax.plot(seeds.index, seeds, lw=0.6, alpha=0.45, **style)
            ax.plot(seeds.index, seeds.median(axis=1), lw=1.8, **style)
        ax.axhline(goal["goal"], color="#444444", lw=0.8, ls=":")
        way = goal["best"] - goal["start"]
        ax.set(title=objective, xlabel="gaits tried", ylabel="best return J")
        if way > 0:
            ax.set_ylim(goal["best"] - 0.3 * way, goal["best"] + 0.02 * way)
    for ax in axes.flat[len(goals) :]:
        ax.remove()
    handles = [Line2D([], [], color=colors[sampler], label=names.get(sampler, sampler)) for sampler in shown]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(shown), frameon=False)
    return svg(fig, "Best return found so far by each sampler against the number of gaits tried")


def search_space(trials: pd.DataFrame, bounds: Mapping[str, tuple[float, float]]) -> str:
    """Where the searches looked: frequency and amplitude of every gait, coloured by the objective's value."""
    order = list(trials["objective"].unique())
    per_gait = trials.drop_duplicates(["objective", "seed", "trial"]).dropna(subset="value")
    fig, axes = plt.subplots(
        1, len(order), figsize=(2.4 * len(order), 2.6), sharey=True, layout="constrained", squeeze=False
    )
    for ax, objective in zip(axes[0], order, strict=True):
        gaits = per_gait[per_gait["objective"] == objective].sort_values("value", kind="stable")
        points = ax.scatter(
            gaits["frequency"], gaits["amplitude"], c=gaits["value"], s=9, cmap="viridis", rasterized=True
        )
        fig.colorbar(points, ax=ax, location="bottom", label="J", aspect=30)
        ax.set(title=objective, xlabel="frequency [Hz]", xlim=bounds["frequency"], ylim=bounds["amplitude"])
    axes[0][0].set_ylabel("amplitude [rad]")
    return svg(fig, "Frequency and amplitude of every gait tried, coloured by its return")


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
    return svg(fig, "Joint angles and applied torques over the last two gait periods")


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
    return svg(fig, "Spectrum of the last joint's angle")
