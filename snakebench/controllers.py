"""What tells the joints what to do: the Controller protocol, the gaits, which are open loop, and their registry.

A gait drives either the joints' target angles, through the robot's servo law, or their command torques directly.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, SerializeAsAny, model_validator

from snakebench.errors import InvalidValue
from snakebench.physics.joints import Drives
from snakebench.physics.waveform import HARMONICS, HELD, SAMPLES, Waveform, commands_at
from snakebench.registry import Registry
from snakebench.sources import plugin_digest
from snakebench.value import FloatArray, NonNegative, Positive, Real, Value, digest


def _of_one_width(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len({len(row) for row in rows}) > 1:
        raise ValueError("as many joints in every row are needed")
    return rows


Rows = Annotated[tuple[tuple[Real, ...], ...], AfterValidator(_of_one_width)]  # one number for each joint in a row


@runtime_checkable
class Controller(Protocol):
    """Anything that can drive a robot through time."""

    @property
    def drives(self) -> Drives:
        """Whether commands are target angles [rad] or command torques [N m]."""

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """The command of every joint at every time [s], shape (n_times, n_joints).

        Raises:
            InvalidValue: when the controller is made for another number of joints.
        """

    def digest(self) -> str:
        """A hash of everything that determines the commands."""


class Gait(Value, ABC):
    """A controller in open loop that is described by its kind and its parameters.

    A class with a search space can be searched for fronts: bounds of its parameters, in the units of their fields.
    """

    SPACE: ClassVar[Mapping[str, tuple[float, float]]] = {}
    kind: str

    @property
    @abstractmethod
    def drives(self) -> Drives:
        """Whether commands are target angles [rad] or command torques [N m]."""

    @abstractmethod
    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """The command of every joint [rad or N m] at increasing times [s], shape (n_times, n_joints).

        Raises:
            InvalidValue: when the gait is made for another number of joints.
        """

    def digest(self) -> str:
        """A hash of everything that determines the commands; for a gait of a plug-in, its code as well."""
        code = plugin_digest(type(self))
        return super().digest() if code is None else digest([self.model_dump(mode="json"), code])


class WaveformGait(Gait):
    """A gait whose commands are a waveform, which compiled code can follow."""

    @abstractmethod
    def waveform(self, n_joints: int) -> Waveform:
        """The commands as a table.

        Raises:
            InvalidValue: when the gait is made for another number of joints.
        """

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """Commands [rad or N m] at times [s], shape (n_times, n_joints); errors as `waveform`."""
        return commands_at(self.waveform(n_joints), np.asarray(times, np.float64))

    def _table(self, rows: Rows, n_joints: int) -> FloatArray:
        if len(rows[0]) != n_joints:
            raise InvalidValue(f"the {self.kind} gait is made for {len(rows[0])} joints, the robot has {n_joints}")
        return np.array(rows)


def _sine(frequency: float, amplitude: FloatArray, phase: NDArray[np.floating[Any]]) -> Waveform:
    """A_i sin(2 pi f t + phi_i)."""
    return Waveform(HARMONICS, frequency, np.stack([amplitude * np.sin(phase), amplitude * np.cos(phase)]), np.inf)


class SeaSnake(WaveformGait):
    """Travelling wave of target angles whose amplitude grows from head to tail (paper, kinematic sea snake model).

    a_i(t) = (i/N) A sin(2 pi f t + (N - i) psi). A positive phase is a wave from head to tail: it swims head first.
    """

    SPACE: ClassVar = {"amplitude": (0.1, np.pi / 3), "frequency": (0.1, 0.8), "phase": (0.1, 3 * np.pi / 7)}

    drives: ClassVar[Drives] = "angle"
    kind: Literal["sea-snake"] = "sea-snake"
    amplitude: NonNegative = Field(description="target angle of the last joint A [rad]")
    frequency: Positive = Field(description="frequency f [Hz]")
    phase: Real = Field(description="phase difference between adjacent joints psi [rad]")

    def waveform(self, n_joints: int) -> Waveform:
        """Target angles [rad]."""
        i = np.arange(1, n_joints + 1)
        return _sine(self.frequency, i / n_joints * self.amplitude, (n_joints - i) * self.phase)


class SinusoidalTorque(WaveformGait):
    """Travelling wave of command torque of equal amplitude at every joint (paper, sinusoidal torque control).

    u_i(t) = A sin(2 pi f t - (i - 1) psi). The minus sign is ours: with joint 1 at the head only it makes a positive
    phase swim head first, as the paper reports for its own (opposite) sign.
    """

    SPACE: ClassVar = {"amplitude": (0.1, 4.0), "frequency": (0.1, 0.8), "phase": (0.1, 3 * np.pi / 7)}

    drives: ClassVar[Drives] = "torque"
    kind: Literal["sinusoidal-torque"] = "sinusoidal-torque"
    amplitude: NonNegative = Field(description="torque amplitude A [N m]")
    frequency: Positive = Field(description="frequency f [Hz]")
    phase: Real = Field(description="phase difference between adjacent joints psi [rad]")

    def waveform(self, n_joints: int) -> Waveform:
        """Command torques [N m]."""
        return _sine(self.frequency, np.full(n_joints, self.amplitude), -np.arange(n_joints) * self.phase)


class Fourier(WaveformGait):
    """Free periodic target angles: a cosine and a sine amplitude per joint and harmonic (ours).

    a_i(t) = sum_h C_hi cos(2 pi h f t) + S_hi sin(2 pi h f t), clipped to [-1, 1] rad like a policy's actions.

    Raises:
        InvalidValue: when `cosine` and `sine` are not of one shape (harmonics, n_joints).
    """

    drives: ClassVar[Drives] = "angle"
    kind: Literal["fourier"] = "fourier"
    frequency: Positive = Field(description="base frequency f [Hz]")
    cosine: Rows = Field(min_length=1, description="cosine amplitudes C [rad], shape (harmonics, n_joints)")
    sine: Rows = Field(min_length=1, description="sine amplitudes S [rad], shape (harmonics, n_joints)")

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        if np.shape(self.cosine) != np.shape(self.sine):
            raise ValueError("cosine and sine must both have the shape (harmonics, n_joints)")
        return self

    def waveform(self, n_joints: int) -> Waveform:
        """Target angles [rad]."""
        amplitudes = np.stack([self._table(self.cosine, n_joints), self._table(self.sine, n_joints)], axis=1)
        return Waveform(HARMONICS, self.frequency, amplitudes.reshape(-1, n_joints), 1.0)


class ReplayedTorque(WaveformGait):
    """A recorded waveform of command torque, repeated; linear between its equally spaced samples (ours).

    Raises:
        InvalidValue: when the samples have different numbers of joints.
    """

    drives: ClassVar[Drives] = "torque"
    kind: Literal["replayed-torque"] = "replayed-torque"
    period: Positive = Field(description="duration of the waveform [s]")
    torque: Rows = Field(min_length=2, description="samples over one period [N m], shape (samples, n_joints)")

    def waveform(self, n_joints: int) -> Waveform:
        """Command torques [N m]."""
        return Waveform(SAMPLES, len(self.torque) / self.period, self._table(self.torque, n_joints), np.inf)


class HeldTargets(WaveformGait):
    """Target angles that are held between control steps, like a policy's actions; the last one stays (ours).

    Raises:
        InvalidValue: when the rows have different numbers of joints.
    """

    drives: ClassVar[Drives] = "angle"
    kind: Literal["held-targets"] = "held-targets"
    rate: Positive = Field(description="control steps per second [Hz]")
    targets: Rows = Field(min_length=1, description="target angles [rad], shape (control steps, n_joints)")

    def waveform(self, n_joints: int) -> Waveform:
        """Target angles [rad], clipped to [-1, 1] like a policy's actions."""
        return Waveform(HELD, self.rate, self._table(self.targets, n_joints), 1.0)


class PeriodicTargets(WaveformGait):
    """Target angles over one period, repeated; linear between equally spaced knots (ours).

    The gaits of the limit of the body are of this kind. Targets are not clipped.

    Raises:
        InvalidValue: when the rows have different numbers of joints.
    """

    drives: ClassVar[Drives] = "angle"
    kind: Literal["periodic-targets"] = "periodic-targets"
    period: Positive = Field(description="duration of the waveform [s]")
    targets: Rows = Field(min_length=2, description="target angles at the knots [rad], shape (knots, n_joints)")

    def waveform(self, n_joints: int) -> Waveform:
        """Target angles [rad]."""
        return Waveform(SAMPLES, len(self.targets) / self.period, self._table(self.targets, n_joints), np.inf)

    def started_at(self, knot: int) -> Self:
        """The same gait, begun at another knot."""
        return self.but(targets=self.targets[knot:] + self.targets[:knot])

    def held(self, rate: float, duration: float) -> HeldTargets:
        """What a controller of that rate [Hz] makes of it: each control step holds the targets of its middle."""
        times = (np.arange(round(duration * rate), dtype=np.float64) + 0.5) / rate
        targets = self.commands(times, len(self.targets[0]))
        return HeldTargets(rate=rate, targets=tuple(map(tuple, targets.tolist())))

    def stepped(self, rate: float, duration: float) -> HeldTargets:
        """The gait whose targets stay as they are from knot to knot, for a controller of that rate [Hz].

        Raises:
            InvalidValue: when a knot does not last whole control steps.
        """
        each = self.period * rate / len(self.targets)
        if not np.isclose(each, round(each), atol=1e-6) or round(each) < 1:
            raise InvalidValue(f"knots {each:.4g} control steps apart: whole control steps are needed")
        steps = np.arange(round(duration * rate)) // round(each) % len(self.targets)
        return HeldTargets(rate=rate, targets=tuple(self.targets[k] for k in steps.tolist()))


def _complaint(name: str, gait: object) -> str | None:
    if not (isinstance(gait, type) and issubclass(gait, Gait)):
        return f"{gait!r} is no class derived from Gait"
    if (kind := gait.model_fields["kind"].default) != name:
        return f"its kind is {kind!r}: the two must be the same"
    if unknown := [parameter for parameter in gait.SPACE if parameter not in gait.model_fields]:
        return f"SPACE has bounds of {', '.join(unknown)}, which it has no field for"
    wrong = [f"{parameter} = {bounds}" for parameter, bounds in gait.SPACE.items() if not bounds[0] < bounds[1]]
    return f"SPACE has {', '.join(wrong)}: the first bound must be below the second" if wrong else None


_OWN: tuple[type[Gait], ...] = SeaSnake, SinusoidalTorque, Fourier, ReplayedTorque, PeriodicTargets, HeldTargets
GAITS: Registry[type[Gait]] = Registry(
    "gait",
    {gait.model_fields["kind"].default: gait for gait in _OWN},
    _complaint,
)


def gait_of(fields: Mapping[str, Any]) -> Gait:
    """The gait described by its kind and its parameters."""
    if "kind" not in fields:
        raise InvalidValue(f"a gait needs a kind: {', '.join(GAITS)}")
    return GAITS.named(str(fields["kind"]))(**fields)


AnyGait = Annotated[
    SerializeAsAny[Gait], BeforeValidator(lambda given: gait_of(given) if isinstance(given, Mapping) else given)
]
