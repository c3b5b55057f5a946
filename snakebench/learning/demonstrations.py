"""Gaits as demonstrations: a teacher that shows, for each fluid and price of power, a gait's targets at its phase."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakebench.engines.planar import Batch
from snakebench.fluid import Fluid
from snakebench.learning.settings import Swimming
from snakebench.observation import PREFERENCE, PRIVILEGED, columns
from snakebench.value import FloatArray, digest

_WARM_UP = 30.0  # swim before the period whose joint angles are those of the steady cycle [s]
_IN_TIME = 30  # control steps from rest in which a gait keeps its time: joints do not follow the steady cycle yet
_WINDOW = 0.08  # of a period: how far from the expected phase it is looked for
_ALIKE = 0.05  # difference of joint angles that is accepted for a phase at the end of the window [rad]
_FOLLOWING = 0.4  # share of the phase's error that is corrected in a control step


class Demonstration(NamedTuple):
    """A gait for a fluid and a price of power."""

    viscosity: float  # kinematic [m^2/s]
    price: float  # of power [1/W]
    targets: FloatArray  # of one period, each held for a control step [rad], shape (control steps, n_joints)


class Demonstrations(tuple[Demonstration, ...]):
    """Gaits to be imitated; like a policy, they have a digest."""

    __slots__ = ()

    def digest(self) -> str:
        """A hash of all gaits and of what they are for."""
        return digest([[one.viscosity, one.price, one.targets.tolist()] for one in self])


class Demonstrator:
    """A teacher of many robots: it shows each the nearest demonstration, at the phase in which its joints are.

    The nearest is by the logarithms of viscosity and price, as they are observed. The phase follows a robot that is
    late or early: a student has no clock, and the targets of a gait that runs by one would contradict each other.
    """

    def __init__(self, demonstrations: Demonstrations, swimming: Swimming, members: int) -> None:
        n = swimming.robot.n_joints
        self._joints, self._last = columns(["joint angle"], n), columns(["last action"], n)
        self._conditions, self._places = columns(["viscosity", "price of power"], n), _observed(demonstrations)
        self._length = np.array([len(one.targets) for one in demonstrations])
        self._targets = np.zeros((len(demonstrations), self._length.max(), n))
        for k, one in enumerate(demonstrations):
            self._targets[k, : len(one.targets)] = one.targets
        self._angles = _steady_angles(demonstrations, self._targets, swimming)
        self._chosen, self._age = np.zeros((2, members), np.int64)
        self._phase = np.zeros(members)  # in control steps

    def state(self) -> dict[str, NDArray[Any]]:
        """What is remembered, not copies."""
        return {"chosen": self._chosen, "age": self._age, "phase": self._phase}

    def labels(self, observation: NDArray[np.float32], starts: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Target angles to be held now [rad], shape (members, n_joints).

        Args:
            observation: whole and scaled, shape (members, width).
            starts: which members begin an episode, shape (members,).
        """
        apart = observation[starts][:, self._conditions][:, None] - self._places
        self._chosen[starts] = np.square(apart).sum(axis=2).argmin(axis=1)
        self._age[starts], self._phase[starts] = 0, 0.0
        self._phase += np.where(self._age < _IN_TIME, 0.0, _FOLLOWING * self._ahead(observation))
        labels = self._targets[self._chosen, self._phase.astype(np.int64) % self._length[self._chosen]]
        self._age += 1
        self._phase += 1.0
        return labels.astype(np.float32)

    def _ahead(self, observation: NDArray[np.float32]) -> NDArray[np.int64]:
        """By how many control steps each member is ahead of its phase: where joints and last targets fit best."""
        chosen, length = self._chosen[:, None], self._length[self._chosen][:, None]
        reach = np.maximum(2, np.round(_WINDOW * length))
        offsets = np.arange(-int(reach.max()), int(reach.max()) + 1)
        at = (self._phase.astype(np.int64)[:, None] + offsets) % length
        angles, last = self._angles[chosen, at], self._targets[chosen, (at - 1) % length]
        apart = np.square(angles - observation[:, None, self._joints]).mean(axis=2)
        apart += np.square(last - observation[:, None, self._last]).mean(axis=2)
        apart += np.where(np.abs(offsets) > reach, np.inf, np.square(_ALIKE * offsets / reach))
        return np.asarray(offsets[apart.argmin(axis=1)])


def _observed(demonstrations: Sequence[Demonstration]) -> FloatArray:
    """Viscosities and prices as they are observed, shape (demonstrations, 2)."""
    scale, offset = zip(*(quantity[2:] for quantity in (PRIVILEGED[0], PREFERENCE[0])), strict=True)
    return np.log10([[one.viscosity, one.price] for one in demonstrations]) * scale + offset


def _steady_angles(demonstrations: Sequence[Demonstration], targets: FloatArray, swimming: Swimming) -> FloatArray:
    """Joint angles at the beginning of each control step of the steady cycle [rad], shaped as the targets."""
    scenario = swimming.scenario()
    every = scenario.physics_rate // scenario.control_rate
    fluids = [Fluid(kinematic_viscosity=one.viscosity) for one in demonstrations]
    batch = Batch([swimming.robot] * len(fluids), fluids, "angle", scenario.physics_rate)
    angles, members = np.zeros_like(targets), np.arange(len(fluids))
    length = np.array([len(one.targets) for one in demonstrations])
    for step in range(round(_WARM_UP * scenario.control_rate) + targets.shape[1]):
        angles[members, step % length] = batch.now.joint_angle  # the last period stays
        batch.advance(targets[members, step % length], every)
    return angles
