"""Figures of the study of the limit."""

from itertools import product

import numpy as np
import pandas as pd

from snakebench.names import CURRENCIES
from snakebench.report.figure_axes import legend_below, panels, plain_log
from snakebench.report.figure_style import method_look, palette, svg
from snakebench.report.front_figure import POWER_LABELS, cut_at_rest
from snakebench.report.table import CURRENCY_LABELS, name_of

_LOOKS = {"policies": "-", "wide": "--", "slow": ":"}


def speeds(limit: pd.DataFrame, others: pd.DataFrame) -> str:
    """Speed over power in both currencies, a panel for each fluid: all bounds, and the fronts of other methods.

    `others` are points of `rivals`.
    """
    fluids, currencies = list(limit["fluid"].dropna().unique()), list(limit["currency"].unique())
    fig, axes = panels(
        len(currencies), len(fluids), 10.8 / len(fluids), 3.4, titles=fluids, y="speed v [m/s]", sharex=True
    )
    for ax, (currency, fluid) in zip(axes.flat, product(currencies, fluids), strict=True):
        counted, here = CURRENCIES[currency], limit[(limit["fluid"] == fluid) & (limit["currency"] == currency)]
        for bounds, part in here.groupby("bounds", sort=False):
            line, front = _LOOKS.get(str(bounds), "-."), part.sort_values(counted)
            ax.plot(front[counted], front["speed"], color="#111111", ls=line, label=f"limit, {bounds}")
        for (method, is_front), points in others[others["fluid"] == fluid].groupby(["method", "is_front"], sort=False):
            color, marker, _ = method_look(str(method))
            single = {"marker": marker, "ms": 6, "mfc": "none"}
            look = {"marker": ".", "ms": 3, "rasterized": True} if is_front else single
            label = f"{name_of(str(method))}, front" if is_front else name_of(str(method))
            ax.plot(points[counted], points["speed"], ls="", color=color, label=label, zorder=1, **look)
        ax.set(xscale="log", xlim=(0.2, 40), xlabel=POWER_LABELS[currency])
        plain_log(ax.xaxis)
        cut_at_rest(ax, others[(others["fluid"] == fluid) & ~others["is_front"]])
    legend_below(fig)
    return svg(fig, "Speed over power: the limit of the body, and the fronts of other methods")


def over_viscosity(limit: pd.DataFrame, powers: list[float]) -> str:
    """Speed, frequency and tail amplitude over viscosity, a line for each power; a row for each currency."""
    currencies = list(limit["currency"].unique())
    columns = {"speed": "speed v [m/s]", "frequency": "f [Hz]", "tail_amplitude": "tail amplitude [m]"}
    fig, axes = panels(len(currencies), len(columns), 3.6, 2.9, x="kinematic viscosity ν [m²/s]", sharex=True)
    for ax, (currency, (column, label)) in zip(axes.flat, product(currencies, columns.items()), strict=True):
        colors = palette([f"{power:g} W" for power in powers], "viridis").items()
        for power, (name, color) in zip(powers, colors, strict=True):
            part = limit[(limit["currency"] == currency) & (limit["allowed"] == power)].sort_values("viscosity")
            ax.plot(part["viscosity"], part[column], ".-", color=color, label=name)
        ax.set(xscale="log", ylabel=label, title=CURRENCY_LABELS[currency])
    legend_below(fig)
    return svg(fig, "The limit over viscosity")


def waveforms(gaits: pd.DataFrame) -> str:
    """Target angles over a period, from head (dark) to tail (light), of each fluid and currency."""
    fluids, currencies = list(gaits["fluid"].unique()), list(gaits["currency"].unique())
    joints = [str(name) for name in gaits if str(name).startswith("joint_")]
    shades = palette(joints, "crest_r")
    fig, axes = panels(len(currencies), len(fluids), 10.8 / len(fluids), 2.6, titles=fluids, x="time [s]", sharey=True)
    for ax, (currency, fluid) in zip(axes.flat, product(currencies, fluids), strict=True):
        part = gaits[(gaits["fluid"] == fluid) & (gaits["currency"] == currency)]
        if part.empty:  # not published
            continue
        time = np.arange(len(part) + 1) / len(part) * part["period"].max()
        for joint in joints:
            around = [*part[joint], *part[joint][:1]]
            ax.plot(time, around, color=shades[joint], lw=1, label=joint.replace("_", " "))
        ax.set_ylabel(f"target angle [rad], {CURRENCY_LABELS[currency]}")
    legend_below(fig, columns=7)
    return svg(fig, "Target angles of the fastest gaits")
