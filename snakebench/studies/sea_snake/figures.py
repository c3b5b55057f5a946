"""Figures of the sea-snake study and of its samplers."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import seaborn as sns

from snakebench.metrics import settled_angle, spectrum, swim_frequency
from snakebench.report.figure_axes import legend_below, panels, wrapped_panels
from snakebench.report.figure_style import COLORS, palette, svg
from snakebench.trajectory import Trajectory

_PERIODS_SHOWN = 2
_LABELS = {"x": "gaits tried", "y": "best return J"}


def convergence(trials: pd.DataFrame) -> str:
    """Best value found so far against the number of gaits tried: one line a seed, one panel an objective."""
    per_gait = trials.drop_duplicates(["objective", "seed", "trial"]).sort_values("trial", kind="stable")
    colors = palette(list(trials["objective"].unique()))
    fig, axes = wrapped_panels(list(colors), 2, 3.9, 2.3, **_LABELS)
    for ax, (objective, color) in zip(axes, colors.items(), strict=True):
        for _, part in per_gait[per_gait["objective"] == objective].groupby("seed"):
            ax.plot(part["trial"] + 1, part["value"].cummax(), color=color, drawstyle="steps-post")
    return svg(fig, "Best return found so far against the number of gaits tried")


def samplers(progress: pd.DataFrame, goals: pd.DataFrame, names: Mapping[str, str]) -> str:
    """Best value found so far by each sampler, one panel an objective; a dotted line at the goal that counts."""
    colors = palette([str(sampler) for sampler in progress["sampler"].unique()])
    fig, axes = wrapped_panels(list(goals.index), 2, 4.5, 2.7, **_LABELS)
    for ax, (objective, goal) in zip(axes, goals.iterrows(), strict=True):
        for sampler, color in colors.items():
            part = progress[(progress["objective"] == objective) & (progress["sampler"] == sampler)]
            seeds = part.pivot(index="gaits", columns="seed", values="best").ffill()
            ax.plot(seeds.index, seeds, lw=0.6, alpha=0.45, color=color, drawstyle="steps-post")
            ax.plot(seeds.index, seeds.median(axis=1), lw=1.8, color=color, drawstyle="steps-post")
        ax.axhline(goal["goal"], color="#444444", lw=0.8, ls=":")
        way = goal["best"] - goal["start"]
        if way > 0:
            ax.set_ylim(goal["best"] - 0.3 * way, goal["best"] + 0.02 * way)
    legend_below(fig, {names.get(sampler, sampler): {"color": color} for sampler, color in colors.items()})
    return svg(fig, "Best return found so far by each sampler against the number of gaits tried")


def search_space(trials: pd.DataFrame, bounds: Mapping[str, tuple[float, float]]) -> str:
    """Where the searches looked: frequency and amplitude of every gait, coloured by the objective's value."""
    names = list(trials["objective"].unique())
    per_gait = trials.drop_duplicates(["objective", "seed", "trial"]).dropna(subset="value")
    fig, axes = panels(1, len(names), 2.4, 2.6, titles=names, x="frequency [Hz]", y="amplitude [rad]", sharey=True)
    for ax, objective in zip(axes[0], names, strict=True):
        gaits = per_gait[per_gait["objective"] == objective].sort_values("value", kind="stable")
        look = {"c": gaits["value"], "s": 9, "cmap": "viridis", "rasterized": True}
        points = ax.scatter(gaits["frequency"], gaits["amplitude"], **look)
        fig.colorbar(points, ax=ax, location="bottom", label="J", aspect=30)
        ax.set(xlim=bounds["frequency"], ylim=bounds["amplitude"])
    return svg(fig, "Frequency and amplitude of every gait tried, coloured by its return")


def time_series(trajectories: Mapping[str, Trajectory]) -> str:
    """Joint angles and applied torques over the last two gait periods, one column a fluid."""
    labels, shared = {"x": "time [s]", "y": ["q [rad]", "u [N m]"]}, {"sharex": "col", "sharey": "row"}
    fig, axes = panels(2, len(trajectories), 2.9, 2, titles=list(trajectories), **labels, **shared)
    for column, trajectory in zip(axes.T, trajectories.values(), strict=True):
        colors = sns.color_palette("viridis", trajectory.robot.n_joints)
        period = 1 / (swim_frequency(trajectory) or 0.5)
        shown = trajectory.time >= trajectory.time[-1] - _PERIODS_SHOWN * period
        for ax, series in zip(column, (trajectory.joint_angle, trajectory.torque), strict=True):
            for joint, color in enumerate(colors):
                ax.plot(trajectory.time[shown], series[shown, joint], color=color, label=f"joint {joint + 1}")
    legend_below(fig, columns=8)
    return svg(fig, "Joint angles and applied torques over the last two gait periods")


def spectra(trajectories: Mapping[str, Trajectory]) -> str:
    """Amplitude spectrum of the last joint's angle over the last two thirds of the run."""
    fig, ((ax,),) = panels(1, 1, 6.4, 2.6, x="frequency [Hz]", y="amplitude of the\nlast joint's angle [rad]")
    for name, trajectory in trajectories.items():
        frequencies, amplitude = spectrum(settled_angle(trajectory), trajectory.rate)
        shown = (frequencies > 0) & (frequencies <= 3)
        ax.plot(frequencies[shown], np.maximum(amplitude[shown], 1e-6), label=name, color=COLORS.get(name))
    ax.set(yscale="log", ylim=(1e-5, None))
    ax.legend(frameon=False)
    return svg(fig, "Spectrum of the last joint's angle")
