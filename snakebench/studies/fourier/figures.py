"""Figures of the Fourier study."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns

from snakebench.report.figure_style import drawing, svg
from snakebench.value import FloatArray


def growth(table: pd.DataFrame) -> str:
    """Best value found so far against the gaits tried: one line a seed, a panel a fluid and one for all."""
    order = sorted(table["harmonics"].unique())
    with drawing():
        grid = sns.relplot(
            table.rename(columns={"harmonics": "number of harmonics"}),
            x="gaits",
            y="best",
            col="tuned_to",
            hue="number of harmonics",
            hue_order=order,
            palette=_by_harmonics(order),
            units="seed",
            estimator=None,
            kind="line",
            height=2.6,
            aspect=1.2,
            facet_kws={"sharey": False},
        )
    grid.set_titles("{col_name}")
    grid.set_axis_labels("gaits tried", "best return J")
    sns.move_legend(grid, "upper center", bbox_to_anchor=(0.45, 0.02), ncols=len(order), frameon=False)
    return svg(grid.figure, "Best return found so far against the number of gaits tried")


def fronts(points: pd.DataFrame, beside: pd.DataFrame) -> str:
    """Speed over power of every optimum, a panel for each `tuned_to`; those of another study `beside` as stars."""
    names, order = list(points["tuned_to"].unique()), sorted(points["harmonics"].unique())
    colors = _by_harmonics(order)
    fig, axes = plt.subplots(1, len(names), figsize=(3.3 * len(names), 3.6), layout="constrained", squeeze=False)
    for ax, tuned_to in zip(axes[0], names, strict=True):
        here = points[points["tuned_to"] == tuned_to]
        for harmonics, marker in zip(order, cycle("osD^v"), strict=False):
            part = here[here["harmonics"] == harmonics]
            label = f"{harmonics} harmonic{'s' if harmonics > 1 else ''}"
            ax.plot(part["power"], part["speed"], marker, color=colors[harmonics], mfc="none", ms=5, label=label)
        stars = beside[beside["tuned_to"] == tuned_to]
        if len(stars):
            ax.plot(stars["power"], stars["speed"], "*", color="#111111", ms=10, label="best sea snake")
        ax.set(title=tuned_to, xlabel="P [W]", xscale="log", ylim=(0, None))
    axes[0][0].set_ylabel("v [m/s]")
    handles = {name: handle for ax in axes[0] for handle, name in zip(*ax.get_legend_handles_labels(), strict=True)}
    fig.legend(handles.values(), handles, loc="outside lower center", ncols=len(handles), frameon=False)
    return svg(fig, "Speed over power of the free waveforms")


def waveforms(targets: Mapping[str, FloatArray], frequencies: Mapping[str, float]) -> str:
    """Target angles over one period, shape (n_times, n_joints), their harmonics and phase lag along the body."""
    fig, axes = plt.subplots(
        3, len(targets), figsize=(3.1 * len(targets), 6.6), layout="constrained", squeeze=False, sharey="row"
    )
    for (over_time, size, lag), (name, angles) in zip(axes.T, targets.items(), strict=True):
        n_times, n_joints = angles.shape
        joints, harmonics = np.arange(1, n_joints + 1), np.fft.rfft(angles, axis=0) * 2 / n_times
        for joint, color in zip(joints, sns.color_palette("viridis", n_joints), strict=True):
            label = f"{'joint ' if joint == 1 else ''}{joint}" if over_time is axes[0, 0] else None
            over_time.plot(np.arange(n_times) / n_times, angles[:, joint - 1], color=color, lw=1.2, label=label)
        for h, color in zip((1, 2, 3), ("#111111", "#8a949e", "#c2410c"), strict=True):
            label = f"harmonic {h}" if over_time is axes[0, 0] else None
            size.plot(joints, np.abs(harmonics[h]), marker=".", color=color, lw=1.2, label=label)
        phase = np.unwrap(np.angle(harmonics[1]))
        lag.plot(joints, phase[0] - phase, marker=".", color="#111111", lw=1.2)
        over_time.set(title=f"{name}, {frequencies[name]:.2f} Hz", xlabel="time / period")
        size.set(xticks=joints)
        lag.set(xlabel="joint, from head to tail", xticks=joints)
    labels = ("target angle [rad]", "amplitude [rad]", "lag behind joint 1 [rad]")
    for ax, label in zip(axes[:, 0], labels, strict=True):
        ax.set_ylabel(label)
    fig.legend(loc="outside lower center", ncols=10, frameon=False)
    return svg(fig, "Target angles over one period, their amplitudes and phase lag along the body")


def _by_harmonics(order: list[int]) -> dict[int, str]:
    return dict(zip(order, sns.color_palette("colorblind", len(order)).as_hex(), strict=True))
