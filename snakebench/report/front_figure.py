"""Fronts of speed against power, of fixed gaits and of policies: one picture for every page that compares them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from snakebench.names import CURRENCIES
from snakebench.report.equal_power import front_line, speeds_within
from snakebench.report.figure_axes import legend_below, panels, plain_log
from snakebench.report.figure_style import Color, method_look, svg

POWER_LABELS = {"net": "power P [W]", "positive": "positive power P+ [W]"}
SPEED = "speed v [m/s]"  # its label
_POWERS = np.logspace(-2, 2, 100)  # of an attainment surface [W]
_LEAST_POWER = 0.01  # shown [W]
_PLACES = 25  # points of a front drawn for each factor e of power
_STAR = 1.8  # size of a star beside other markers
_BELOW_REST = 0.05  # share of the axis that is kept below 0 if something swims backwards
_LEAST_TOP = 0.1  # of the axis, if everything does [m/s]


def fronts(points: pd.DataFrame, marks: pd.DataFrame, names: Sequence[str], title: str) -> str:
    """Every seed's front of each method, and `marks`, gaits and policies that are no front.

    A panel for each name, a row for each currency of power that points have. Points have columns method, front, seed,
    currency, speed [m/s] and both powers [W]; marks the same but the currency.
    """
    currencies = [currency for currency in CURRENCIES if currency in set(points["currency"])]
    width, height = 10.8 / len(names), 4 if len(currencies) == 1 else 3.5
    fig, axes = panels(len(currencies), len(names), width, height, titles=names, y=SPEED)
    looks: dict[str, dict[str, Any]] = {}
    for row, currency in zip(axes, currencies, strict=True):
        own = points[points["currency"] == currency]
        for ax, name in zip(row, names, strict=True):
            looks |= _draw_fronts(ax, own[own["front"] == name], currency)
            looks |= _draw_marks(ax, marks[marks["front"] == name], CURRENCIES[currency])
            power_axis(ax, currency)
            cut_at_rest(ax, marks[marks["front"] == name])
    legend_below(fig, looks)
    return svg(fig, title)


def _draw_fronts(ax: Axes, points: pd.DataFrame, currency: str) -> dict[str, dict[str, Any]]:
    """Every seed's front of each method, and what they look like by the label of a legend."""
    looks: dict[str, dict[str, Any]] = {}
    for method, part in points.groupby("method", sort=False):
        look, seeds = method_look(str(method)), part.groupby("seed")
        several = len(seeds) > 1
        for seed, front in seeds:
            label = f"_{method}" + f", seed {seed}" * several
            draw_front(ax, front, look.color, label, currency=currency, ls=look.line, lw=0.7 if several else 1.4)
        looks[f"{method}, front" + " of every seed" * several] = {"color": look.color, "ls": look.line}
    return looks


def _draw_marks(ax: Axes, marks: pd.DataFrame, power: str) -> dict[str, dict[str, Any]]:
    """Single gaits and policies, and what they look like by the label of a legend."""
    looks: dict[str, dict[str, Any]] = {}
    for method, part in marks.groupby("method", sort=False):
        color, marker, _ = method_look(str(method))
        size = 6 * (_STAR if marker == "*" else 1)
        look: dict[str, Any] = {"color": color, "marker": marker, "ms": size, "ls": "", "mfc": "none", "mew": 1.1}
        ax.plot(part[power], part["speed"], zorder=3, label=f"_{method}", **look)
        looks[str(method)] = look
    return looks


def cut_at_rest(ax: Axes, marks: pd.DataFrame) -> None:
    """Leave out what swims backwards, and say how many do."""
    bottom = -_BELOW_REST * max(ax.get_ylim()[1], _LEAST_TOP)
    if (backwards := marks.loc[marks["speed"] < bottom, "method"]).empty:
        return
    ax.set_ylim(bottom=bottom)
    told = [
        f"{method}: {left} of {(marks['method'] == method).sum()}\nbackwards, not shown"
        for method, left in backwards.value_counts().items()
    ]
    ax.text(0.02, 0.97, "\n".join(told), transform=ax.transAxes, va="top", fontsize="small")


def draw_attained(ax: Axes, surfaces: pd.DataFrame, color: Color, currency: str = "net") -> None:
    """A band between what the best and the worst seed attain at each power, and a line for the median."""
    power_axis(ax, currency)
    if surfaces.empty:
        return
    speed = {name: np.nan_to_num(speeds_within(part, _POWERS, widest=1)) for name, part in surfaces.groupby("surface")}
    ax.fill_between(_POWERS, speed["worst"], speed["best"], color=color, alpha=0.3, lw=0, step="post")
    ax.plot(_POWERS, speed["median"], color=color, lw=1, drawstyle="steps-post")


def draw_front(
    ax: Axes, front: pd.DataFrame, color: Color, label: str, *, currency: str = "net", ls: Any = "-", lw: float = 1.4
) -> None:
    """One front as the line that it is compared by; of thousands of points, as many as can be told apart."""
    drawn = front_line(front, currency).loc[lambda line: line.index > 0]  # a logarithmic axis has no place for rest
    power = drawn.index.to_numpy()
    places = np.floor(np.log(power) * _PLACES)
    apart = (np.diff(places, prepend=-np.inf) > 0) | (np.diff(places, append=np.inf) > 0)
    ax.plot(power[apart], drawn["speed"].to_numpy()[apart], color=color, label=label, ls=ls, lw=lw)


def power_axis(ax: Axes, currency: str = "net") -> None:
    """Power on a logarithmic axis, the same in all figures."""
    ax.set(xscale="log", xlim=(_LEAST_POWER, 100), xlabel=POWER_LABELS[currency])
    plain_log(ax.xaxis)
