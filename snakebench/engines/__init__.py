"""Engines: what integrates the robot's motion. Each is loaded when first asked for."""

import math
from abc import ABC, abstractmethod
from functools import cache
from importlib import import_module
from typing import Annotated, Any, ClassVar, Protocol, Self

import numpy as np
from pydantic import AfterValidator

from snakebench.controllers import Controller, WaveformGait
from snakebench.errors import InvalidValue, UnknownName, UnstableRate
from snakebench.fluid import Medium
from snakebench.physics.joints import Drives
from snakebench.physics.record import Record, as_record, row_width
from snakebench.physics.waveform import HARMONICS, HELD, Waveform
from snakebench.robot import Robot
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray


class Simulation(ABC):
    """One robot in one medium, from rest, advanced by commands; a context manager that frees the engine."""

    engine: ClassVar[str]

    def __init__(self, robot: Robot, drives: Drives, physics_rate: int, n_steps: int) -> None:
        self._robot, self._drives, self._rate = robot, drives, physics_rate
        self._rows = np.zeros((n_steps + 1, row_width(robot.n_joints)))
        self._step, self._alive = 0, True

    def __enter__(self) -> Self:
        return self

    @abstractmethod
    def __exit__(self, *_: object) -> None: ...

    def advance(self, commands: FloatArray) -> bool:
        """Make one physics step per row of `commands`, shape (n_steps, n_joints); False once the run diverged.

        Raises:
            InvalidValue: when the commands do not fit or are not finite.
        """
        room, n_joints = len(self._rows) - 1 - self._step, self._robot.n_joints
        if commands.shape[1:] != (n_joints,) or len(commands) > room:
            raise InvalidValue(f"commands of shape {commands.shape}: at most {room} x {n_joints} fit here")
        check_finite(commands, "step")
        return self._hold(commands)

    def follow(self, controller: Controller, n_steps: int) -> bool:
        """Let a controller, whose clock starts now, drive for `n_steps`; False once the run diverged.

        Raises:
            InvalidValue: when the steps do not fit or do not resolve the commands, or these are not finite.
        """
        check_resolved(controller, self._robot.n_joints, self._rate)
        if n_steps > (room := len(self._rows) - 1 - self._step):
            raise InvalidValue(f"{n_steps} steps: at most {room} fit here")
        return self._follow(controller, n_steps)

    @abstractmethod
    def _hold(self, commands: FloatArray) -> bool: ...

    @abstractmethod
    def _follow(self, controller: Controller, n_steps: int) -> bool: ...

    @property
    def now(self) -> Record:
        """The present, as a view of the simulation's own record."""
        return as_record(self._rows[self._step], self._robot.n_joints)

    def trajectory(self) -> Trajectory:
        """All steps made so far, as views of the simulation's own record."""
        rows, diverged = self._rows[: self._step + 1], not self._alive
        return Trajectory.from_rows(rows, self._robot, self._drives, self.engine, self._rate, diverged=diverged)


class Engine(Protocol):
    """A module with a `VERSION`, part of every evaluation's key, and the functions below."""

    VERSION: str

    def open_simulation(
        self, robot: Robot, medium: Medium, drives: Drives, physics_rate: int, n_steps: int
    ) -> Simulation:
        """A simulation with room for `n_steps` steps."""

    def inputs(self, robot: Robot, medium: Medium, drives: Drives, physics_rate: int) -> bytes:
        """All numbers that a run is computed from, beside the commands: part of every evaluation's key."""

    def stable_rate(self, robot: Robot, drives: Drives) -> float:
        """The lowest physics rate [Hz] at which the joints' law is stable in this engine."""


ENGINES = {"pybullet": "snakebench.engines.bullet", "planar": "snakebench.engines.planar"}
PERTURBED = {f"perturbed {name}": name for name in ENGINES}  # those of specimens, which `sb.perturbed` chooses
_STEPS_PER_PERIOD = 10  # of the fastest command that is taken
_ROUNDING = 1e-9
PHYSICS_RATES = {"pybullet": 480, "planar": 240}  # unless a scenario says otherwise [Hz]


def known_engine(name: str) -> str:
    """The name, if an engine is called so."""
    if name not in ENGINES and name not in PERTURBED:
        raise UnknownName.among("engine", name, ENGINES)
    return name


EngineName = Annotated[str, AfterValidator(known_engine)]


def load_engine(name: str) -> Engine:
    """The engine of that name."""
    if known_engine(name) in PERTURBED:
        return _variant(PERTURBED[name])
    return import_module(ENGINES[name])


@cache
def _variant(base: str) -> Engine:
    return import_module("snakebench.engines.perturbed").variant(load_engine(base))


def check_rate(engine: str, needed: float, drives: Drives, physics_rate: int, multiple_of: int = 30) -> None:
    """Make sure that an engine which needs a rate [Hz] is stable at `physics_rate`; else the next multiple is named."""
    if physics_rate < needed:
        raise UnstableRate(
            f"physics rate {physics_rate} Hz is unstable for gaits that drive {drives} with this robot in {engine}:"
            f" at least {needed:.0f} Hz is needed, such as {math.ceil(needed / multiple_of) * multiple_of}"
        )


def check_resolved(controller: Controller | Waveform, n_joints: int, physics_rate: float) -> None:
    """Make sure that physics steps resolve what a gait asks for: faster commands would alias to slow ones.

    Needed are ten steps in a period of the highest harmonic (ours). Of a sampled waveform, 5 % of the variance may be
    faster, and 1 % may lie above half the physics rate; held values need a step each. Of a gait without a waveform, its
    field `frequency` counts, if it has one.

    Raises:
        InvalidValue: otherwise, with the rate that is needed.
    """
    needed = _resolving_rate(controller.waveform(n_joints) if isinstance(controller, WaveformGait) else controller)
    if needed > physics_rate * (1 + _ROUNDING):
        raise InvalidValue(
            f"physics rate {physics_rate:g} Hz is too low for a gait as fast as this one: at least {needed:.6g} Hz is"
            f" needed, {_STEPS_PER_PERIOD} steps in a period of its highest harmonic"
        )


def _resolving_rate(commands: Controller | Waveform) -> float:
    """The lowest physics rate [Hz] that resolves a waveform, or a gait without one by its frequency."""
    if not isinstance(commands, Waveform):
        frequency = getattr(commands, "frequency", 0.0)
        return _STEPS_PER_PERIOD * frequency if isinstance(frequency, int | float) else 0.0
    kind, rate, table, _ = commands
    if kind == HELD:
        return rate if len(table) > 1 else 0.0
    if kind == HARMONICS:
        harmonics = np.flatnonzero(table.any(axis=1)) // 2 + 1
        return _STEPS_PER_PERIOD * rate * float(harmonics.max(initial=0))
    variance = np.cumsum((np.abs(np.fft.rfft(table - table.mean(axis=0), axis=0)) ** 2).sum(axis=1))
    if not variance[-1] > 0:
        return 0.0
    most, nearly_all = np.searchsorted(variance, variance[-1] * np.array([0.95, 0.99])) * rate / len(table)
    return float(max(_STEPS_PER_PERIOD * most, 2 * nearly_all))


def commands_of(controller: Controller, times: FloatArray, n_joints: int) -> FloatArray:
    """What a gait commands at times [s], shape (n_times, n_joints)."""
    returned: Any = controller.commands(times, n_joints)
    try:
        commands = np.asarray(returned)
    except ValueError:  # rows of different lengths
        commands = np.asarray(None)
    if commands.dtype.kind not in "iuf" or commands.shape != (len(times), n_joints):
        found = f"shape {commands.shape} and type {commands.dtype}" if commands.shape else f"{type(returned).__name__}"
        needed = f"real numbers of shape {(len(times), n_joints)} are needed"
        raise InvalidValue(f"{type(controller).__name__}: commands of {found}: {needed}")
    check_finite(commands, "step")
    return np.ascontiguousarray(commands, np.float64)


def check_finite(commands: FloatArray, row: str) -> None:
    """Make sure that all commands, shape (rows, n_joints), are finite."""
    finite = np.isfinite(commands)
    if not finite.all():
        k, j = np.argwhere(~finite)[0]
        raise InvalidValue(f"{row} {k}, joint {j + 1}: the command is {commands[k, j]}: a finite number is needed")
