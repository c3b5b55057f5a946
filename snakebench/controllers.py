"""What tells the joints what to do: the Controller protocol and the open-loop gaits.

A gait drives either the joints' target angles, through the robot's servo law, or their command torques directly.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Protocol, Self, get_args

import numpy as np
from pydantic import Field, model_validator

from snakebench.errors import InvalidValue, UnknownName
from snakebench.value import FloatArray, NonNegative, Positive, Real, Value

Drives = Literal["angle", "torque"]
Waveform = tuple[tuple[Real, ...], ...]


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


class SeaSnake(Value):
    """Travelling wave of target angles whose amplitude grows from head to tail (paper, kinematic sea snake model).

    a_i(t) = (i/N) A sin(2 pi f t + (N - i) psi). A positive phase is a wave from head to tail: it swims head first.
    """

    SPACE: ClassVar = {"amplitude": (0.1, np.pi / 3), "frequency": (0.1, 0.8), "phase": (0.1, 3 * np.pi / 7)}

    kind: Literal["sea-snake"] = "sea-snake"
    amplitude: NonNegative = Field(description="target angle of the last joint A [rad]")
    frequency: Positive = Field(description="frequency f [Hz]")
    phase: Real = Field(description="phase difference between adjacent joints psi [rad]")

    @property
    def drives(self) -> Drives:
        """Target angles."""
        return "angle"

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """Target angles [rad], shape (n_times, n_joints)."""
        i = np.arange(1, n_joints + 1)
        angle = 2 * np.pi * self.frequency * times[:, None] + (n_joints - i) * self.phase
        return i / n_joints * self.amplitude * np.sin(angle)


class SinusoidalTorque(Value):
    """Travelling wave of command torque of equal amplitude at every joint (paper, sinusoidal torque control).

    u_i(t) = A sin(2 pi f t - (i - 1) psi). The minus sign is ours: with joint 1 at the head only it makes a positive
    phase swim head first, as the paper reports for its own (opposite) sign.
    """

    SPACE: ClassVar = {"amplitude": (0.1, 4.0), "frequency": (0.1, 0.8), "phase": (0.1, 3 * np.pi / 7)}

    kind: Literal["sinusoidal-torque"] = "sinusoidal-torque"
    amplitude: NonNegative = Field(description="torque amplitude A [N m]")
    frequency: Positive = Field(description="frequency f [Hz]")
    phase: Real = Field(description="phase difference between adjacent joints psi [rad]")

    @property
    def drives(self) -> Drives:
        """Command torques."""
        return "torque"

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """Command torques [N m], shape (n_times, n_joints)."""
        angle = 2 * np.pi * self.frequency * times[:, None] - np.arange(n_joints) * self.phase
        return self.amplitude * np.sin(angle)


class Fourier(Value):
    """Free periodic target angles: a cosine and a sine amplitude per joint and harmonic (ours).

    a_i(t) = sum_h C_hi cos(2 pi h f t) + S_hi sin(2 pi h f t), clipped to [-1, 1] rad like a policy's actions.

    Raises:
        InvalidValue: when `cosine` and `sine` are not of one shape (harmonics, n_joints).
    """

    kind: Literal["fourier"] = "fourier"
    frequency: Positive = Field(description="base frequency f [Hz]")
    cosine: Waveform = Field(min_length=1, description="cosine amplitudes C [rad], shape (harmonics, n_joints)")
    sine: Waveform = Field(min_length=1, description="sine amplitudes S [rad], shape (harmonics, n_joints)")

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        if len({len(row) for row in self.cosine + self.sine}) > 1 or len(self.cosine) != len(self.sine):
            raise ValueError("cosine and sine must both have the shape (harmonics, n_joints)")
        return self

    @property
    def drives(self) -> Drives:
        """Target angles."""
        return "angle"

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """Target angles [rad], shape (n_times, n_joints)."""
        _check_joints("Fourier gait", len(self.cosine[0]), n_joints)
        harmonics = np.arange(1, len(self.cosine) + 1)
        angle = 2 * np.pi * self.frequency * np.outer(times, harmonics)
        wave = np.cos(angle) @ np.array(self.cosine) + np.sin(angle) @ np.array(self.sine)
        return np.clip(wave, -1.0, 1.0)


class ReplayedTorque(Value):
    """A recorded waveform of command torque, repeated; linear between its equally spaced samples (ours).

    Raises:
        InvalidValue: when the samples have different numbers of joints.
    """

    kind: Literal["replayed-torque"] = "replayed-torque"
    period: Positive = Field(description="duration of the waveform [s]")
    torque: Waveform = Field(min_length=2, description="samples over one period [N m], shape (samples, n_joints)")

    @model_validator(mode="after")
    def _one_width(self) -> Self:
        if len({len(row) for row in self.torque}) > 1:
            raise ValueError("torque must have the shape (samples, n_joints)")
        return self

    @property
    def drives(self) -> Drives:
        """Command torques."""
        return "torque"

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """Command torques [N m], shape (n_times, n_joints)."""
        _check_joints("replayed torque", len(self.torque[0]), n_joints)
        samples = np.array(self.torque)
        at = np.arange(len(samples)) * self.period / len(samples)
        return np.stack([np.interp(times, at, column, period=self.period) for column in samples.T], axis=1)


AnyGait = SeaSnake | SinusoidalTorque | Fourier | ReplayedTorque
Gait = Annotated[AnyGait, Field(discriminator="kind")]
GAITS: dict[str, type[AnyGait]] = {gait.model_fields["kind"].default: gait for gait in get_args(AnyGait)}


def gait_class(kind: str) -> type[AnyGait]:
    """The gait called `kind`.

    Raises:
        UnknownName: with the nearest valid names.
    """
    if kind not in GAITS:
        raise UnknownName.among("gait", kind, GAITS)
    return GAITS[kind]


def _check_joints(what: str, made_for: int, n_joints: int) -> None:
    if made_for != n_joints:
        raise InvalidValue(f"{what} is made for {made_for} joints, the robot has {n_joints}")
