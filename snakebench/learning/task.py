"""What the environments share: spaces, the reward of a control step, and what is observed after it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from snakebench.fluid import Fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.observation import GROUPS, LARGEST, Senses, group_width
from snakebench.physics.record import Record
from snakebench.reward import rewards
from snakebench.robot import Robot
from snakebench.value import FloatArray


def observation_space(n_joints: int) -> spaces.Dict:
    """A dict of `sensors`, `privileged` and `preference`, scaled as `snakebench.observation` says."""
    return spaces.Dict(
        {name: spaces.Box(-LARGEST, LARGEST, (group_width(name, n_joints),), np.float32) for name in GROUPS}
    )


def action_space(n_joints: int) -> spaces.Box:
    """Target angles [rad], shape (n_joints,)."""
    return spaces.Box(-1.0, 1.0, (n_joints,), np.float32)


def random_fluid(rng: np.random.Generator, viscosities: tuple[float, float] = VISCOSITIES) -> Fluid:
    """A fluid whose viscosity is drawn log-uniformly."""
    return Fluid(kinematic_viscosity=float(10 ** rng.uniform(*np.log10(viscosities))))


class Earned(NamedTuple):
    """What members earn in a control step, each of shape (members,)."""

    reward: FloatArray  # r_n at the published weights, without the termination penalty
    velocity: FloatArray  # mean, forward [m/s]
    power: FloatArray  # mean [W]


class Task:
    """The control steps of robots with equal joints: their reward and their observations.

    Args:
        robot: whose joint law tells the torques.
        control_rate: actions per second [Hz].
        members: how many robots.
    """

    def __init__(self, robot: Robot, control_rate: int, members: int = 1) -> None:
        self._rate, self._senses = control_rate, Senses(robot, members)
        self._x, self._work = np.zeros((2, members))

    def begin(self, now: Record, members: Sequence[int] | slice = slice(None)) -> None:
        """Let members begin an episode; `now` is the present of all."""
        self._senses.rest(members)
        self._x[members], self._work[members] = now.center[members, 0], now.energy[members, 0]

    def step(self, action: FloatArray, now: Record) -> Earned:
        """What is earned in the step that ends now.

        Args:
            action: target angles that were held [rad], shape (members, n_joints).
            now: the present of all members.
        """
        velocity, power = (now.center[:, 0] - self._x) * self._rate, (now.energy[:, 0] - self._work) * self._rate
        self._x[:], self._work[:] = now.center[:, 0], now.energy[:, 0]
        reward = rewards(velocity, action, now.joint_rate, self._senses.act(action, now), power)
        return Earned(reward, velocity, power)

    def state(self) -> dict[str, FloatArray]:
        """All that is remembered: what is written into these arrays is remembered instead."""
        return {"x": self._x, "work": self._work, **self._senses.state()}

    def observe(self, now: Record, viscosity: FloatArray, price: FloatArray) -> NDArray[np.float32]:
        """Whole observations of all members, shape (members, width); arguments as `Senses.observation`."""
        return self._senses.observation(now, viscosity, price).astype(np.float32)
