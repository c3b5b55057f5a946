"""Figures of the learned-front study."""

from collections.abc import Sequence
from itertools import product

import pandas as pd

from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import METHOD_LOOKS, fluid_lines, svg
from snakebench.report.front_figure import SPEED, draw_attained
from snakebench.report.seed_figure import draw_seeds

_COLOR = METHOD_LOOKS["student"].color
_TURNED = {
    "speed": "v [m/s]",
    "power": "P [W]",
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail amplitude [m]",
    "joint_amplitude": "joint amplitude [rad]",
    "wave_speed": "wave speed [m/s]",
}


def attainment(surfaces: pd.DataFrame) -> str:
    """Between what the best and the worst seed of a policy attain, and the median; a row for each currency."""
    names, currencies = surfaces["front"].unique(), surfaces["currency"].unique()
    fig, axes = panels(len(currencies), len(names), 2.7, 2.8, titles=names, y=SPEED)
    for ax, (currency, name) in zip(axes.flat, product(currencies, names), strict=True):
        chosen = (surfaces["front"] == name) & (surfaces["currency"] == currency)
        draw_attained(ax, surfaces[chosen], _COLOR, currency)
    return svg(fig, "Attainment surfaces of the seeds of the policy")


def turned(swims: pd.DataFrame, fluids: Sequence[str]) -> str:
    """Speed, power and gait of a preference-conditioned policy over the price of power: every seed, and their mean."""
    fig, axes = panels(2, 3, 3.3, 2.8, x="price of power λ [1/W]", sharex=True)
    for ax, (column, label) in zip(axes.flat, _TURNED.items(), strict=True):
        for fluid, line in fluid_lines(fluids).items():
            draw_seeds(ax, swims[swims["fluid"] == fluid], "price", column, fluid, _COLOR, band=False, ls=line)
        ax.set(xscale="log", ylabel=label)
    legend_below(fig)
    return svg(fig, "Speed, power and gait over the price of power")
