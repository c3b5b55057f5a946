"""The gaits of the limit as demonstrations: those of held targets, each at the price of power at which it is best."""

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

_POINT = ["viscosity", "currency", "bounds", "allowed"]


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
    if settings.powers:
        rows = rows[rows["allowed"].isin(settings.powers)]
    if rows.empty:
        asked = f"P{'+' * (settings.currency == 'positive')}" + "".join(f", {power:g} W" for power in settings.powers)
        raise InvalidValue(f"{study} has no gaits of held targets at {asked}")
    knots = {tuple(point): part for point, part in gaits.groupby(_POINT, sort=False)}
    return Demonstrations(_demonstration(row, knots[tuple(row[_POINT])], settings) for _, row in rows.iterrows())


def _demonstration(row: pd.Series, knots: pd.DataFrame, settings: Imitation | Scheduling) -> ScheduledGait:
    gait = limit_gait(knots)
    targets = np.array(gait.stepped(settings.control_rate, gait.period).targets).round(6).tolist()
    price = preference(float(row["optimal_speed"]), float(row["multiplier"]))
    return ScheduledGait(viscosity=float(row["viscosity"]), price=price, targets=targets)


def preference(speed: float, slope: float) -> float:
    """The price of power [1/W] at which a gait is the best of its front in the reward of a preference.

    That is where a little more speed is worth the power that it takes, at 16 times the root of speed.

    Args:
        speed: of the gait [m/s].
        slope: of the front there, dv/dP [m/s/W].
    """
    return _ROOT / 2 / float(np.sqrt(speed)) * slope
