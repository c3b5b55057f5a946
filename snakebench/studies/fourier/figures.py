"""Figures of the Fourier study."""

from collections.abc import Mapping
from itertools import cycle, product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns

from snakebench.controllers import Fourier
from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import svg
from snakebench.report.table import LABELS, POWERS

_TIMES = 240  # at which a waveform is drawn over its period


def growth(table: pd.DataFrame) -> str:
    """Best value found so far against the gaits tried: one line a seed, a panel a fluid and one for all."""
    names, looks = list(table["tuned_to"].unique()), _looks(table)
    fig, axes = panels(1, len(names), 3.1, 2.9, titles=names, x="gaits tried", y="best return J", sharex=True)
    for ax, tuned_to in zip(axes[0], names, strict=True):
        for (harmonics, _), line in table[table["tuned_to"] == tuned_to].groupby(["harmonics", "seed"]):
            ax.plot(line["gaits"], line["best"], **looks[harmonics])
    legend_below(fig)
    return svg(fig, "Best return found so far against the number of gaits tried")


def fronts(points: pd.DataFrame, beside: pd.DataFrame) -> str:
    """Speed over both powers of every optimum, a panel for each `tuned_to`; those of a study `beside` as stars."""
    names, looks = list(points["tuned_to"].unique()), _looks(points)
    powers = [power for power in POWERS if points[power].notna().any()]
    fig, axes = panels(len(powers), len(names), 3.3, 3.2, titles=names, y="v [m/s]")
    for ax, (power, tuned_to) in zip(axes.flat, product(powers, names), strict=True):
        here, stars = points[points["tuned_to"] == tuned_to], beside[beside["tuned_to"] == tuned_to]
        for (number, look), marker in zip(looks.items(), cycle("osD^v"), strict=False):
            part = here[here["harmonics"] == number]
            ax.plot(part[power], part["speed"], marker, mfc="none", ms=4, rasterized=True, **look)
        if len(stars):
            ax.plot(stars[power], stars["speed"], "*", color="#111111", ms=10, label="best sea snake")
        ax.set(xscale="log", ylim=(0, None), xlabel=LABELS[power])
    legend_below(fig, columns=6)
    return svg(fig, "Speed over power of the free waveforms")


def waveforms(gaits: Mapping[str, Fourier]) -> str:
    """Target angles of gaits over one period, their harmonics and phase lag along the body."""
    titles = [f"{name}, {gait.frequency:.2f} Hz" for name, gait in gaits.items()]
    y = ["target angle [rad]", "amplitude [rad]", "lag behind joint 1 [rad]"]
    fig, axes = panels(3, len(gaits), 3.1, 2.2, titles=titles, x="joint, from head to tail", y=y, sharey="row")
    times = np.arange(_TIMES) / _TIMES
    for (over_time, size, lag), gait in zip(axes.T, gaits.values(), strict=True):
        n_joints = len(gait.cosine[0])
        angles = gait.commands(times / gait.frequency, n_joints)
        joints, harmonics = np.arange(1, n_joints + 1), np.fft.rfft(angles, axis=0) * 2 / _TIMES
        for joint, color in zip(joints, sns.color_palette("viridis", n_joints), strict=True):
            over_time.plot(times, angles[:, joint - 1], color=color, label=f"joint {joint}")
        for h, color in zip((1, 2, 3), ("#111111", "#8a949e", "#c2410c"), strict=True):
            size.plot(joints, np.abs(harmonics[h]), marker=".", color=color, label=f"harmonic {h}")
        phase = np.unwrap(np.angle(harmonics[1]))
        lag.plot(joints, phase[0] - phase, marker=".", color="#111111")
        over_time.set_xlabel("time / period")
        plt.setp([size, lag], xticks=joints)
    legend_below(fig, columns=10)
    return svg(fig, "Target angles over one period, their amplitudes and phase lag along the body")


def _looks(table: pd.DataFrame) -> dict[int, dict[str, str]]:
    order = sorted(table["harmonics"].unique())
    colors = zip(order, sns.color_palette("colorblind", len(order)).as_hex(), strict=True)
    return {n: {"color": color, "label": f"{n} harmonic{'s' if n > 1 else ''}"} for n, color in colors}
