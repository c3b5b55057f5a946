"""The limit of the body as a yardstick: the speed that a swim is compared with, at its own power in its own fluid."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from snakebench.collocation.front import interpolated, with_doubt
from snakebench.collocation.ideal import at_power, ideal_curve, limit_front
from snakebench.errors import StoreError
from snakebench.fluid import Fluid, FluidField
from snakebench.names import CURRENCIES
from snakebench.robot import Robot
from snakebench.scoring.tasks import Tasks
from snakebench.tables import read_table
from snakebench.value import FloatArray

_BOUND = 1.0  # on target angles, that of policies [rad]


class Known(NamedTuple):
    """The limit of one viscosity: speed and its relative error over log10 of power, from the least to the largest."""

    power: FloatArray
    speed: FloatArray
    error: FloatArray


class Yardstick:
    """The limit in one currency over viscosity and power.

    Outside the table's range of viscosities and of powers it is constant: below the least power of the table it is the
    speed at that power, which is more than a swim of less power can reach; beyond the largest, no gait with targets
    within the limit's bound is faster. What leaves the bound, which is `wide`, would gain by power alone: there it is
    compared with a speed that grows with the square root of power, which is the law of laminar drag.
    """

    def __init__(self, tasks: Tasks, currency: str, wide: bool = False) -> None:
        column, table = CURRENCIES[currency], read_table(tasks.limit_path)
        table = table[np.isclose(table["bound"], _BOUND) & table["speed_limit"].isna()]
        fronts = {float(str(viscosity)): _front(part, currency) for viscosity, part in table.groupby("viscosity")}
        front = limit_front(pd.concat(fronts.values()), currency, _BOUND)
        if front is None:
            raise StoreError(f"{tasks.limit_path} has no rows of {currency} power")
        self._front, self._curves, self._wide = front, dict[FluidField, FloatArray](), wide
        self._known = {
            viscosity: Known(np.log10(part[column].to_numpy(float)), part["speed"].to_numpy(float), _error(part))
            for viscosity, part in fronts.items()
        }

    def at(self, fluid: Fluid, power: float) -> tuple[float, float]:
        """The limit's speed in a fluid at a power [m/s], and its relative error."""
        speeds, errors, place = [], [], np.log10(power)
        for known in self._known.values():
            speed, change = with_doubt(known.power, known.speed, place)
            speeds.append(speed * self._growth(power, 10 ** known.power[-1]))
            errors.append(change / speed + float(np.interp(place, known.power, known.error)))
        viscosities, here = np.log10(list(self._known)), np.log10(fluid.kinematic_viscosity)
        speed, change = with_doubt(viscosities, np.array(speeds), here)
        return speed, change / speed + float(np.interp(here, viscosities, errors))

    def speeds(self, viscosity: FloatArray, power: FloatArray) -> FloatArray:
        """The limit's speeds [m/s] at pairs of viscosity [m^2/s] and power [W], shapes (n,); without growth."""
        place, here = np.log10(power), np.log10(viscosity)
        rows = np.array([interpolated(known.power, known.speed, place) for known in self._known.values()])
        return np.asarray(interpolated(np.log10(list(self._known)), rows, here)).diagonal().copy()

    def through(self, field: FluidField, power: float, duration: float) -> tuple[float, float]:
        """The mean speed of the limit's ideal switching at a mean power [m/s], and the limit's relative error."""
        if field not in self._curves:
            self._curves[field] = ideal_curve(self._front, field, duration, -float(Robot().link_lengths.sum()) / 2)
        power, curve = max(power, float(self._front.power[1])), self._curves[field]
        speed = float(at_power(curve, power)) / duration * self._growth(power, curve[-1, 0])
        return speed, max(self.at(one, power)[1] for one in field.fluids)

    def _growth(self, power: float, largest: float) -> float:
        """By what the limit grows beyond its largest power."""
        return float(np.sqrt(max(power / largest, 1.0))) if self._wide else 1.0

    def along(self, viscosity: FloatArray, power: float) -> FloatArray:
        """The limit's speed at viscosities [m/s], shape (n,), at one power; without growth."""
        return np.array([np.interp(power, self._front.power, speeds) for speeds in self._front.at(viscosity)])


def _front(points: pd.DataFrame, currency: str) -> pd.DataFrame:
    """The points of one viscosity in a currency, and beyond them those of the other that are faster still."""
    column = CURRENCIES[currency]
    own, others = (points[points["currency"] == name] for name in (currency, *(CURRENCIES.keys() - {currency})))
    beyond = others[(others[column] > own[column].max()) & (others["speed"] > own["speed"].max())]
    ordered = pd.concat([own, beyond]).sort_values(column)
    return ordered[ordered["speed"] >= ordered["speed"].cummax()].assign(currency=currency)


def _error(points: pd.DataFrame) -> FloatArray:
    """The relative error of the points' speeds, by mesh and by replay."""
    return points[["change", "gap"]].abs().max(axis=1).fillna(0.0).to_numpy(float)
