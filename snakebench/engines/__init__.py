"""Engines: what integrates the robot's motion. Each is loaded when first asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol, Self

from snakebench.controllers import Drives
from snakebench.errors import UnknownName
from snakebench.fluid import Fluid, FluidField
from snakebench.robot import Robot
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray


class Simulation(Protocol):
    """One robot in one medium, from rest, advanced by commands; a context manager that frees the engine."""

    def advance(self, commands: FloatArray) -> bool:
        """Make one physics step per row of `commands`, shape (n_steps, n_joints); False once the run diverged."""

    def trajectory(self) -> Trajectory:
        """All steps made so far."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


class Engine(Protocol):
    """A module with a `VERSION`, part of every evaluation's key, and the two functions below."""

    VERSION: str

    def open_simulation(
        self, robot: Robot, medium: Fluid | FluidField, drives: Drives, physics_rate: int, n_steps: int
    ) -> Simulation:
        """A simulation with room for `n_steps` steps."""

    def stable_rate(self, robot: Robot, drives: Drives) -> float:
        """The lowest physics rate [Hz] at which the joints' law is stable in this engine."""


ENGINES = {"pybullet": "snakebench.engines.bullet"}


def load_engine(name: str) -> Engine:
    """The engine called `name`.

    Raises:
        UnknownName: with the nearest valid names.
    """
    if name not in ENGINES:
        raise UnknownName.among("engine", name, ENGINES)
    return import_module(ENGINES[name])
