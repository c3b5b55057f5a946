"""The gaits of the limit as demonstrations: those of held targets, each at the price of power at which it is best.

A policy is shown mixtures, too, between gaits of neighbouring powers in a fluid, so that the demonstrations change
little from one price to the next.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from snakebench.collocation.front import limit_gait, of_held_targets
from snakebench.errors import InvalidValue
from snakebench.gain_schedule import ScheduledGait
from snakebench.learning.demonstrations import Demonstrations
from snakebench.learning.settings import Imitation, Scheduling
from snakebench.reward import _ROOT
from snakebench.studies.config import StudyConfig
from snakebench.studies.contenders import read_limit
from snakebench.value import FloatArray

_POINT = ["viscosity", "currency", "bounds", "allowed"]
_LEAST_PRICE = 1e-9  # of a gait from which on more power gains nothing [1/W]
_SHARES = (0.25, 0.5, 0.75)  # of the gait of more power in the mixtures of two neighbours


def demonstrations(config: StudyConfig, settings: Imitation | Scheduling, results: Path) -> Demonstrations:
    """The gaits of a study of the limit that were found for targets held for a control step.

    Raises:
        InvalidValue: when the study has no results, is of another robot, or has no such gaits.
    """
    study = settings.demonstrations
    limit, gaits, of_limit = read_limit(config, results, study)
    if settings.robot != config.robot:
        raise InvalidValue(f"{study} is of another robot than the policy")
    rows = of_held_targets(limit, of_limit)
    rows = rows[rows["currency"] == settings.currency]
    low, high = settings.randomisation.viscosities
    rows = rows[rows["viscosity"].between(0.999 * low, 1.001 * high)]
    if rows.empty:
        raise InvalidValue(f"{study} has no gaits of held targets at P{'+' * (settings.currency == 'positive')}")
    knots = {tuple(point): part for point, part in gaits.groupby(_POINT, sort=False)}
    shown = list[ScheduledGait]()
    for _, of_fluid in rows.sort_values("allowed", kind="stable").groupby(["viscosity", "bounds"], sort=False):
        known = [_demonstration(row, knots[tuple(row[_POINT])], settings) for _, row in of_fluid.iterrows()]
        if prices := settings.randomisation.prices:
            known = spanning(known, *prices)
        shown += known
        if isinstance(settings, Imitation):
            shown += [mixed(*pair, share) for pair in pairwise(known) for share in _SHARES]
    return Demonstrations(shown)


def _demonstration(row: pd.Series, knots: pd.DataFrame, settings: Imitation | Scheduling) -> ScheduledGait:
    gait = limit_gait(knots)
    targets = np.array(gait.stepped(settings.control_rate, gait.period).targets).round(6).tolist()
    price = preference(float(row["optimal_speed"]), float(row["multiplier"]))  # about 0 where more power gains nothing
    return ScheduledGait(viscosity=float(row["viscosity"]), price=max(price, _LEAST_PRICE), targets=targets)


def spanning(gaits: Sequence[ScheduledGait], low: float, high: float) -> list[ScheduledGait]:
    """The gaits of a fluid by their power, from the highest to the lowest price of power that is asked for [1/W].

    At prices beyond theirs the first and the last are the best. Of those for prices below the lowest only the first is
    left, for the lowest: more power gains less than that.
    """
    inside = [gait for gait in gaits if gait.price > low]
    last = next((gait for gait in gaits if gait.price <= low), gaits[-1])
    ends = [gaits[0].but(price=high)] if gaits[0].price < high else []
    return [*ends, *inside, last.but(price=low)]


def mixed(first: ScheduledGait, second: ScheduledGait, share: float) -> ScheduledGait:
    """A gait between two of a fluid: the means of their targets at equal phases, and of the logarithms otherwise.

    Phases are equal where the first harmonics of all joints agree best. Half a period stays a number of control steps,
    as it is of the gaits of the limit, which are mirrored then.
    """
    one, other = np.array(first.targets), np.array(second.targets)
    steps = 2 * round(len(one) ** (1 - share) * len(other) ** share / 2)
    lead = float(np.angle(np.vdot(*(np.fft.rfft(rows, axis=0)[1] for rows in (one, other))))) / (2 * np.pi)
    targets = (1 - share) * _at_phases(one, steps, 0.0) + share * _at_phases(other, steps, -lead)
    price = first.price ** (1 - share) * second.price**share
    return ScheduledGait(viscosity=first.viscosity, price=price, targets=targets.round(6).tolist())


def _at_phases(targets: FloatArray, steps: int, start: float) -> FloatArray:
    """Periodic targets at equally spaced phases from a start [periods], linear between control steps."""
    places = (np.arange(steps) / steps + start) * len(targets)
    return np.stack([np.interp(places, np.arange(len(rows)), rows, period=len(rows)) for rows in targets.T], axis=1)


def preference(speed: float, slope: float) -> float:
    """The price of power [1/W] at which a gait is the best of its front in the reward of a preference.

    That is where a little more speed is worth the power that it takes, at 16 times the root of speed.

    Args:
        speed: of the gait [m/s].
        slope: of the front there, dv/dP [m/s/W].
    """
    return _ROOT / 2 / float(np.sqrt(speed)) * slope
