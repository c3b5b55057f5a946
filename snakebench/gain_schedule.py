"""Gain scheduling, the classical rival of learning: an estimate of viscosity chooses among the limit's gaits (ours).

A small network estimates the viscosity from what the sensors measured in the last second. The gait that is best at this
viscosity and at the price of power is played, and its targets are held for a control step. A change of the gait keeps
the phase.
"""

from functools import cached_property
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from snakebench.controllers import Rows
from snakebench.observation import PREFERENCE, PRIVILEGED, Pilot, columns
from snakebench.physics.joints import Drives
from snakebench.robot import Robot
from snakebench.sources import code_digest
from snakebench.value import Count, FloatArray, Positive, Real, Value, digest

_CODE = code_digest("gain_schedule")
SCHEDULE = "gain-schedule"  # kind of its file
WINDOW = 30  # control steps that are looked at for an estimate
_SLOWNESS = 15.0  # of the estimate: control steps in which it approaches a new value by 63 %
_MARGIN = 0.1  # by which another gait must be nearer, in decades of viscosity and price
UNKNOWN = -4.5  # estimate at the start, the middle of the range [log10 of m^2/s]


class ScheduledGait(Value):
    """A gait, and where it is the best."""

    viscosity: Positive = Field(description="kinematic [m^2/s]")
    price: Positive = Field(description="of power [1/W]")
    targets: Rows = Field(min_length=2, description="of one period, held [rad], shape (control steps, n_joints)")


class Estimator(Value):
    """A network with ELU layers from the features of a window to log10 of the viscosity [m^2/s]."""

    weights: tuple[Rows, ...] = Field(min_length=1, description="of each layer, shape (outputs, inputs)")
    biases: tuple[tuple[Real, ...], ...] = Field(min_length=1, description="of each layer, shape (outputs,)")

    def __call__(self, features: FloatArray) -> float:
        """The estimate for features of shape (n,)."""
        x = features
        for k, (weights, biases) in enumerate(zip(*self._arrays, strict=True)):
            x = weights @ (np.where(x > 0, x, np.expm1(np.minimum(x, 0))) if k else x) + biases
        return float(x[0])

    @cached_property
    def _arrays(self) -> tuple[list[FloatArray], list[FloatArray]]:
        return [np.array(rows) for rows in self.weights], [np.array(row) for row in self.biases]


class Memory(NamedTuple):
    """What a schedule remembers from step to step."""

    phase: float  # of the gait, in periods
    gait: int
    estimate: float  # log10 of the viscosity [m^2/s]
    window: tuple[NDArray[np.float32], ...]  # of what the sensors measured


class GainSchedule(Value):
    """Gaits with their fluids and prices of power, and the estimator that chooses among them; a closed loop.

    Raises:
        InvalidValue: when the gaits have different numbers of joints.
    """

    kind: Literal["gain-schedule"] = "gain-schedule"
    control_rate: Count = Field(30, description="actions per second [Hz]")
    price: Positive = Field(0.1, description="of power [1/W]")
    gaits: tuple[ScheduledGait, ...] = Field(min_length=1, description="to choose from")
    estimator: Estimator

    @property
    def drives(self) -> Drives:
        """Target angles."""
        return "angle"

    @model_validator(mode="after")
    def _one_width(self) -> Self:
        if len({len(gait.targets[0]) for gait in self.gaits}) > 1:
            raise ValueError("gaits of equally many joints are needed")
        return self

    @property
    def prices(self) -> tuple[float, float]:
        """The lowest and the highest price of power that a gait is for [1/W]."""
        prices = [gait.price for gait in self.gaits]
        return min(prices), max(prices)

    def at(self, price: float) -> Self:
        """The same schedule at another price of power [1/W]."""
        return self.but(price=price)

    def begin(self, robot: Robot, control_rate: int) -> Pilot:
        """The schedule at the start of a run.

        Raises:
            InvalidValue: when it is made for another number of joints or another control rate.
        """
        made_for, first = (len(self.gaits[0].targets[0]), self.control_rate), self._nearest(UNKNOWN)
        return Pilot(
            made_for, robot, control_rate, self.price, self.act, Memory(self.origins[first], first, UNKNOWN, ())
        )

    def act(self, observation: NDArray[np.float32], memory: Memory) -> tuple[FloatArray, Memory]:
        """Target angles [rad], shape (n_joints,), and the memory afterwards; the observation is whole and scaled."""
        window = (*memory.window, observation[self._sensors])[-WINDOW:]
        estimate = memory.estimate
        if len(window) == WINDOW:
            now = features(np.array(window), self.gaits[memory.gait], memory.phase - self.origins[memory.gait])
            estimate += (self.estimator(now) - estimate) / _SLOWNESS
        gait, phase = self._nearest(estimate, memory.gait), memory.phase
        targets = self.gaits[gait].targets
        target = targets[int((phase - self.origins[gait]) % 1.0 * len(targets) + 1e-9) % len(targets)]
        return np.array(target), Memory(phase + 1 / len(targets), gait, estimate, window)

    def _nearest(self, estimate: float, now: int | None = None) -> int:
        """The gait that is nearest to an estimate and the price; the present one if none is nearer by the margin."""
        apart = np.hypot(self._places[:, 0] - estimate, self._places[:, 1] - np.log10(self.price))
        best = int(apart.argmin())
        return best if now is None or apart[best] < apart[now] - _MARGIN else now

    def digest(self) -> str:
        """A hash of everything that determines the actions: the fields and the code of this module."""
        return digest([super().digest(), _CODE])

    @cached_property
    def _sensors(self) -> NDArray[np.int64]:
        """Columns of the sensors in a whole observation."""
        return columns(["sensors"], len(self.gaits[0].targets[0]))

    @cached_property
    def _places(self) -> FloatArray:
        """Of each gait, log10 of viscosity [m^2/s] and price [1/W], shape (gaits, 2)."""
        return np.log10([[gait.viscosity, gait.price] for gait in self.gaits])

    @cached_property
    def origins(self) -> list[float]:
        """The phases, in periods, at which gaits begin, so that at equal phases their joints move alike.

        They are of the first harmonic, against that of the first gait.
        """
        waves = [np.fft.rfft(np.array(gait.targets), axis=0)[1] for gait in self.gaits]
        return [float(np.angle(np.vdot(waves[0], wave)) / (2 * np.pi)) for wave in waves]


def features(window: NDArray[np.float32], gait: ScheduledGait, phase: float) -> FloatArray:
    """What an estimate is made from: the sensors' numbers in a window, shape (WINDOW, sensors), the gait and its phase.

    Deviations of all sensors, the products of each joint's target, torque and rate, the gait's own fluid and price, and
    its phase in periods, since a window may be shorter than a period.
    """
    n = len(gait.targets[0])
    angle, rate, torque, _, target = np.split(window, np.cumsum([n, n, n, 3]), axis=1)
    target = np.vstack([target[1:], target[-1:]])  # a step's own target is observed after it
    products = [(target * rate).mean(axis=0), (torque * rate).mean(axis=0), (target * angle).mean(axis=0)]
    own = np.log10([gait.viscosity, gait.price]) * [PRIVILEGED[0].scale, PREFERENCE[0].scale]
    turns = 2 * np.pi * phase * np.array([1, 2])  # both halves of a period are alike but for the sign
    return np.concatenate([window.std(axis=0), *products, own, np.cos(turns), np.sin(turns)])
