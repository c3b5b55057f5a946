"""What the environments share: spaces, random fluids, and the reward of a control step."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from snakebench.fluid import Fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.observation import GROUPS, LARGEST, Senses, columns
from snakebench.physics.record import Record
from snakebench.reward import rewards
from snakebench.robot import Robot
from snakebench.value import FloatArray


def observation_space(feels: Sequence[str] | None, n_joints: int) -> spaces.Space[Any]:
    """Named groups or quantities as one array, scaled as `snakebench.observation` says; None gives a dict of groups."""
    if feels is None:
        return spaces.Dict({name: observation_space([name], n_joints) for name in GROUPS})
    return spaces.Box(-LARGEST, LARGEST, (len(columns(feels, n_joints)),), np.float32)


def action_space(n_joints: int) -> spaces.Box:
    """Target angles [rad], shape (n_joints,)."""
    return spaces.Box(-1.0, 1.0, (n_joints,), np.float32)


def random_fluid(rng: np.random.Generator, viscosities: tuple[float, float] = VISCOSITIES) -> Fluid:
    """A fluid whose viscosity is drawn log-uniformly."""
    return Fluid(kinematic_viscosity=float(10 ** rng.uniform(*np.log10(viscosities))))


class ControlStep(Senses):
    """The control steps of robots with equal joints: what they observe, and their rewards."""

    def __init__(self, robot: Robot, control_rate: int, members: int = 1) -> None:
        super().__init__(robot, members)
        self._rate, (self._x, self._work) = control_rate, np.zeros((2, members))

    def begin(self, now: Record, members: Sequence[int] | slice = slice(None)) -> None:
        """Let members begin an episode; `now` is the present of all."""
        self.rest(members)
        self._x[members], self._work[members] = now.center[members, 0], now.energy[members, 0]

    def step(self, action: FloatArray, now: Record) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What the reward of the step that ends now is made of, each of shape (members,).

        That is the published reward of target angles held [rad], shape (members, n_joints), without the termination
        penalty, and the mean forward velocity [m/s] and command power [W] of the step.
        """
        velocity, power = (now.center[:, 0] - self._x) * self._rate, (now.energy[:, 0] - self._work) * self._rate
        self._x[:], self._work[:] = now.center[:, 0], now.energy[:, 0]
        return rewards(velocity, action, now.joint_rate, self.act(action, now), power), velocity, power

    def state(self) -> dict[str, FloatArray]:
        """What is remembered, not copies."""
        return {"x": self._x, "work": self._work, **super().state()}
