"""Figures of a score and of the leaderboard."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.ticker import MaxNLocator

from snakebench.report.figure_axes import legend_below, panels, plain_log, wrapped_panels
from snakebench.report.figure_style import FLUIDS, Color, palette, svg
from snakebench.scoring.swims import Swim
from snakebench.value import FloatArray

_TOP = 1.1  # of the axes of scores
_LINES, _MARKERS = ("-", "--", ":", "-."), "os^Dv"
_DKW = 1.358  # over the root of the number of swims: half the 95 % band of a whole distribution (Dvoretzky et al.)


def over_power(swims: Sequence[Swim]) -> str:
    """Scores in `known` over mean power P+, a line a fluid."""
    fig, axes = panels(1, 1, 5.5, 3.0, x="P+ [W]", y="score")
    for name in dict.fromkeys(swim.where for swim in swims):
        own = [(swim.positive_power or np.nan, swim.score) for swim in swims if swim.where == name]
        axes[0, 0].plot(*np.array(sorted(own)).T, "o-", color=FLUIDS[name].color, label=name)
    powers = [swim.positive_power for swim in swims if swim.positive_power]
    axes[0, 0].set(xscale="log", xlim=(min(0.5, *powers), max(50, *powers) * 1.1), ylim=(0, _TOP))
    plain_log(axes[0, 0].xaxis, (1, 2, 5))
    legend_below(fig)
    return svg(fig, "Score over power in known fluids")


def over_viscosity(viscosity: Sequence[float], swims: Sequence[Swim]) -> str:
    """Scores in `unknown` over viscosity, of both currencies."""
    fig, axes = panels(1, 1, 7.0, 3.0, x="kinematic viscosity ν [m²/s]", y="score")
    axes[0, 0].plot(viscosity, [swim.score for swim in swims], "o-", color="#0b6e99", label="P+")
    axes[0, 0].plot(viscosity, [swim.net_score for swim in swims], "o", ms=3, color="#8a949e", label="P")
    axes[0, 0].set(xscale="log", ylim=(0, _TOP))
    legend_below(fig)
    return svg(fig, "Score over viscosity")


def along_courses(courses: Mapping[str, tuple[FloatArray, FloatArray, float]]) -> str | None:
    """Along each course the speed over the limit's at the mean power, and the viscosity; None without any.

    Each has rows of time, viscosity and that ratio, and its score.
    """
    if not courses:
        return None
    fig, axes = wrapped_panels(list(courses), 4, 2.6, 1.9, x="t [s]", y="v / limit", sharex=True, sharey=True)
    for ax, (time, rows, score) in zip(axes, courses.values(), strict=True):
        viscosity, ratio = rows
        fluid = ax.twinx()
        fluid.fill_between(time, 1e-7, viscosity, color="#8a949e", alpha=0.25, lw=0)
        fluid.set(yscale="log", ylim=(1e-7, 1e-2), yticks=[])
        ax.plot(time, ratio, color="#0b6e99", lw=1.2)
        ax.axhline(score, color="#c2410c", lw=0.8, ls="--")
        ax.set_ylim(0, 1.6)
    return svg(fig, "Speed over the limit's along each course")


def over_perturbations(names: Mapping[str, str], swims: Sequence[Swim]) -> str:
    """Scores in `robust`: a row for each perturbation, a point for each swim."""
    fig, axes = panels(1, 1, 7.0, 5.0, x="score")
    rows = list(dict.fromkeys(swim.perturbation for swim in swims))
    for name in dict.fromkeys(swim.where for swim in swims):
        own = [(swim.score, rows.index(swim.perturbation)) for swim in swims if swim.where == name]
        axes[0, 0].plot(*np.array(own).T, "o", color=FLUIDS[name].color, label=name)
    axes[0, 0].set(xlim=(0, _TOP), yticks=range(len(rows)), yticklabels=[names[row] for row in rows])
    axes[0, 0].invert_yaxis()
    legend_below(fig)
    return svg(fig, "Score under each perturbation")


def profiles(entries: Mapping[str, FloatArray]) -> str:
    """Of each entry the share of its swims with a score of at least x, with the 95 % band of the whole line."""
    fig, axes = panels(1, 1, 8.0, 4.6, x="score x", y="share of swims ≥ x")
    for (name, scores), (color, line) in zip(entries.items(), _looks(len(entries), _LINES), strict=True):
        x, half = np.linspace(0, _TOP, 111), _DKW / np.sqrt(len(scores))
        share = (scores[:, None] >= x).mean(axis=0)
        axes[0, 0].plot(x, share, color=color, ls=line, label=name)
        low, high = np.clip([share - half, share + half], 0, 1)
        axes[0, 0].fill_between(x, low, high, (share > 0) & (share < 1), color=color, alpha=0.08, lw=0)
    legend_below(fig, columns=3)
    return svg(fig, "Share of swims with at least a score")


def over_training(steps: Mapping[str, tuple[int, float]]) -> str:
    """Totals over training steps; those without training are at 1."""
    fig, axes = panels(1, 1, 8.0, 4.6, x="control steps of training", y="total score")
    for (name, (count, total)), (color, marker) in zip(steps.items(), _looks(len(steps), _MARKERS), strict=True):
        axes[0, 0].plot(max(count, 1), total, marker, color=color, label=name)
    axes[0, 0].set(xscale="log", xlim=(0.5, None), ylim=(None, 1))
    axes[0, 0].yaxis.set_major_locator(MaxNLocator(5))
    legend_below(fig, columns=3)
    return svg(fig, "Total score over training steps")


def _looks(count: int, styles: Sequence[str]) -> Iterator[tuple[Color, str]]:
    """So many colours, each with a style: neighbours differ in both."""
    return zip(palette([str(k) for k in range(count)], "husl").values(), cycle(styles), strict=False)
