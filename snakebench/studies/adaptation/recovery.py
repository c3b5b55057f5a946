"""How a swimmer answers a change of the fluid: speed over gait periods, recovery, and the ideal without delay."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from snakebench.fluid import Fluid, FluidField
from snakebench.physics.hydrodynamics import viscosity_at
from snakebench.value import FloatArray

TOLERANCE = 0.05  # of the steady speed, within which a swimmer is back
_STEADILY = 5.0  # how long it must stay there [s]
_STEP = 0.02  # of the ideal swim [s]


Steady = Callable[[float], tuple[float, float, float]]  # v [m/s], P and P+ [W] at a viscosity [m^2/s]
_STEADY = ["speed", "power", "positive_power"]  # columns of them


class Recovery(NamedTuple):
    """When a swimmer is back at its steady speed after a change."""

    seconds: float  # from the change to the first gait period of those that stay within tolerance; NaN if there is none
    held: float  # share of the periods that begin after the change and are within tolerance


def recovery(position: FloatArray, rate: float, start: float, end: float, period: float, steady: float) -> Recovery:
    """When a swimmer is back within 5 % of its steady speed after a change, and stays there for 5 s.

    In a new fluid that lasts less than 5 s it must stay to the end; in one shorter than a gait period nothing is known.

    Args:
        position: along x, shape (n_times,) [m].
        rate: rows of it per second [Hz].
        start: of the new fluid [s].
        end: of it [s].
        period: of the gait in it, over which speed is a mean; each counts from its beginning [s].
        steady: speed in it [m/s].
    """
    speed = period_speed(position, rate, period)[round(start * rate) : round((end - period) * rate) + 1]
    within = np.abs(speed - steady) <= TOLERANCE * abs(steady)
    if not len(within):
        return Recovery(np.nan, np.nan)
    needed = min(round(_STEADILY * rate), len(within))
    run = np.convolve(within, np.ones(needed, int))[needed - 1 : len(within)]  # periods within tolerance, of `needed`
    back = np.flatnonzero(run == needed)
    return Recovery(float(back[0] / rate) if len(back) else np.nan, float(within.mean()))


def period_speed(position: FloatArray, rate: float, period: float) -> FloatArray:
    """Mean speed over the gait period that begins at each row [m/s]; the last rows have none."""
    rows = max(round(period * rate), 1)
    return (position[rows:] - position[:-rows]) * rate / rows


def ideal_swim(medium: Fluid | FluidField, duration: float, steady: Steady, start: float) -> tuple[float, float, float]:
    """How far a swimmer gets that is at every moment at its steady state [m], its work and its positive work [J].

    Args:
        medium: what it swims in.
        duration: of the swim [s].
        steady: of the swimmer.
        start: where it begins [m].
    """
    x, work, positive_work = start, 0.0, 0.0
    for time in np.arange(round(duration / _STEP)) * _STEP:
        speed, power, positive_power = steady(viscosity_at(medium, float(time), x))
        x += speed * _STEP
        work += power * _STEP
        positive_work += positive_power * _STEP
    return x - start, work, positive_work


def between_viscosities(table: pd.DataFrame) -> Steady:
    """What is steady at a viscosity, linear in its logarithm between the rows: columns viscosity and `_STEADY`."""
    rows = table.sort_values("viscosity").drop_duplicates("viscosity")
    at = np.log10(rows["viscosity"].to_numpy())
    figures = [rows[name].to_numpy() for name in _STEADY]

    def steady(viscosity: float) -> tuple[float, float, float]:
        speed, power, positive_power = (float(np.interp(np.log10(viscosity), at, figure)) for figure in figures)
        return speed, power, positive_power

    return steady


def fastest(of_gaits: Mapping[str, Steady]) -> Steady:
    """Speed and powers of the fastest of several gaits at a viscosity: ideal switching among them.

    A gait that is not known there, since it diverged, is not switched to.
    """
    return lambda viscosity: max(
        (steady(viscosity) for steady in of_gaits.values()), key=lambda at: np.nan_to_num(at[0], nan=-np.inf)
    )
