"""What the environments share: spaces, random fluids, and the reward of a control step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium import spaces

from snakebench.fluid import Fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.observation import GROUPS, LARGEST, Senses, columns
from snakebench.physics.record import Record
from snakebench.reward import rewards
from snakebench.robot import Robot
from snakebench.value import FloatArray


def observation_space(names: Sequence[str], n_joints: int) -> spaces.Box:
    """The named groups or quantities side by side, scaled as `snakebench.observation` says."""
    return spaces.Box(-LARGEST, LARGEST, (len(columns(names, n_joints)),), np.float32)


def group_spaces(n_joints: int) -> spaces.Dict:
    """A dict of all groups."""
    return spaces.Dict({name: observation_space([name], n_joints) for name in GROUPS})


def action_space(n_joints: int) -> spaces.Box:
    """Target angles [rad], shape (n_joints,)."""
    return spaces.Box(-1.0, 1.0, (n_joints,), np.float32)


def random_fluid(rng: np.random.Generator, viscosities: tuple[float, float] = VISCOSITIES) -> Fluid:
    """A fluid whose viscosity is drawn log-uniformly."""
    return Fluid(kinematic_viscosity=float(10 ** rng.uniform(*np.log10(viscosities))))


class StepReward(NamedTuple):
    """The reward of members for a control step, each part of shape (members,)."""

    reward: FloatArray  # r_n at the published weights, without the termination penalty
    velocity: FloatArray  # mean, forward [m/s]
    power: FloatArray  # mean [W]


class ControlStep:
    """The control steps of robots with equal joints.

    Args:
        robot: whose joint law determines the torques.
        control_rate: actions per second [Hz].
        members: how many robots.

    Attributes:
        senses: make the observations.
    """

    def __init__(self, robot: Robot, control_rate: int, members: int = 1) -> None:
        self.senses, self._rate = Senses(robot, members), control_rate
        self._x, self._work = np.zeros((2, members))

    def begin(self, now: Record, members: Sequence[int] | slice = slice(None)) -> None:
        """Let members begin an episode; `now` is the present of all."""
        self.senses.rest(members)
        self._x[members], self._work[members] = now.center[members, 0], now.energy[members, 0]

    def step(self, action: FloatArray, now: Record) -> StepReward:
        """The reward for the step that ends now.

        Args:
            action: target angles that were held [rad], shape (members, n_joints).
            now: the present of all members.
        """
        velocity, power = (now.center[:, 0] - self._x) * self._rate, (now.energy[:, 0] - self._work) * self._rate
        self._x[:], self._work[:] = now.center[:, 0], now.energy[:, 0]
        reward = rewards(velocity, action, now.joint_rate, self.senses.act(action, now), power)
        return StepReward(reward, velocity, power)

    def state(self) -> dict[str, FloatArray]:
        """What is remembered, not copies: what is written into these arrays is remembered instead."""
        return {"x": self._x, "work": self._work, **self.senses.state()}
