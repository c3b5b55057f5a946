"""Gaits as demonstrations: a teacher that shows, for each fluid and price of power, a gait's targets at its phase."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakebench.engines.planar import Batch
from snakebench.fluid import Fluid
from snakebench.gain_schedule import ScheduledGait
from snakebench.learning.settings import Swimming
from snakebench.observation import PREFERENCE, PRIVILEGED, columns
from snakebench.value import FloatArray, digest

_WARM_UP = 30.0  # swim before the period whose joint angles are those of the steady cycle [s]
_IN_TIME = 30  # control steps from rest in which a gait keeps its time: joints do not follow the steady cycle yet
_WINDOW = 0.08  # of a period: how far from the expected phase it is looked for
_ALIKE = 0.05  # difference of joint angles that is accepted for a phase at the end of the window [rad]
_FOLLOWING = 0.4  # share of the phase's error that is corrected in a control step
_NEAR = 3  # demonstrations, from which a robot is shown the one that it follows best
_SLOWNESS = 33  # control steps over which a misfit is averaged
_BETTER = 0.6  # ratio of misfits below which another demonstration is shown


class Demonstrations(tuple[ScheduledGait, ...]):
    """Gaits to be imitated, each for a fluid and a price of power; like a policy, they have a digest."""

    __slots__ = ()

    def digest(self) -> str:
        """A hash of all gaits and of what they are for."""
        return digest([one.digest() for one in self])


class Demonstrator:
    """A teacher of many robots: it shows each a near demonstration, at the phase in which its joints are.

    Near is by the logarithms of viscosity and price, as they are observed. A student that swims nearly as a neighbour
    of the nearest demonstration is shown that one: else it would learn a mixture of both, which is worse than either.
    The phase follows a robot that is late or early: a student has no clock, and the targets of a gait that runs by one
    would contradict each other.
    """

    def __init__(self, demonstrations: Demonstrations, swimming: Swimming, members: int) -> None:
        n, near = swimming.robot.n_joints, min(_NEAR, len(demonstrations))
        self._joints, self._last = columns(["joint angle"], n), columns(["last action"], n)
        self._conditions, self._places = columns(["viscosity", "price of power"], n), _observed(demonstrations)
        self._length = np.array([len(one.targets) for one in demonstrations])
        self._targets = np.zeros((len(demonstrations), self._length.max(), n))
        for k, one in enumerate(demonstrations):
            self._targets[k, : len(one.targets)] = one.targets
        self._angles = _steady_angles(demonstrations, self._targets, swimming)
        self._rows = np.arange(members)
        self._near = np.zeros((members, near), np.int64)
        self._phase, self._misfit = np.zeros((2, members, near))  # in control steps, and [rad^2]
        self._shown, self._age = np.zeros((2, members), np.int64)  # a place in `_near`, and control steps

    def state(self) -> dict[str, NDArray[Any]]:
        """What is remembered, not copies."""
        counts = {"near": self._near, "shown": self._shown, "age": self._age}
        return {**counts, "phase": self._phase, "misfit": self._misfit}

    def labels(self, observation: NDArray[np.float32], starts: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Target angles to be held now [rad], shape (members, n_joints).

        Args:
            observation: whole and scaled, shape (members, width).
            starts: which members begin an episode, shape (members,).
        """
        self._begin(observation, starts)
        ahead, misfit = self._fit(observation)
        self._misfit += (misfit - self._misfit) / _SLOWNESS
        self._phase += np.where(self._age < _IN_TIME, 0.0, _FOLLOWING * ahead.T).T
        best = self._misfit.argmin(axis=1)
        better = self._misfit[self._rows, best] < _BETTER * self._misfit[self._rows, self._shown]
        self._shown = np.where(better & (self._age >= _IN_TIME + _SLOWNESS), best, self._shown)
        chosen, phase = self._near[self._rows, self._shown], self._phase[self._rows, self._shown]
        labels = self._targets[chosen, phase.astype(np.int64) % self._length[chosen]]
        self._age += 1
        self._phase += 1.0
        return labels.astype(np.float32)

    def _begin(self, observation: NDArray[np.float32], starts: NDArray[np.bool_]) -> None:
        apart = np.square(observation[starts][:, self._conditions][:, None] - self._places).sum(axis=2)
        self._near[starts] = apart.argsort(axis=1, kind="stable")[:, : self._near.shape[1]]
        self._shown[starts], self._age[starts], self._phase[starts], self._misfit[starts] = 0, 0, 0.0, 0.0

    def _fit(self, observation: NDArray[np.float32]) -> tuple[NDArray[np.int64], FloatArray]:
        """How well each member follows its near demonstrations, both of shape (members, near).

        That is by how many control steps it is ahead of the phase, where joints and last targets fit best, and the
        squared difference there [rad^2].
        """
        length = self._length[self._near][..., None]
        reach = np.maximum(2, np.round(_WINDOW * length))
        offsets = np.arange(-int(reach.max()), int(reach.max()) + 1)
        at, near = (self._phase.astype(np.int64)[..., None] + offsets) % length, self._near[..., None]
        angles, last = self._angles[near, at], self._targets[near, (at - 1) % length]
        apart = np.square(angles - observation[:, None, None, self._joints]).mean(axis=3)
        apart += np.square(last - observation[:, None, None, self._last]).mean(axis=3)
        late = np.where(np.abs(offsets) > reach, np.inf, np.square(_ALIKE * offsets / reach))
        best = (apart + late).argmin(axis=2)
        return offsets[best], np.take_along_axis(apart, best[..., None], axis=2)[..., 0]


def _observed(demonstrations: Sequence[ScheduledGait]) -> FloatArray:
    """Viscosities and prices as they are observed, shape (demonstrations, 2)."""
    scale, offset = zip(*(quantity[2:] for quantity in (PRIVILEGED[0], PREFERENCE[0])), strict=True)
    return np.log10([[one.viscosity, one.price] for one in demonstrations]) * scale + offset


def _steady_angles(demonstrations: Sequence[ScheduledGait], targets: FloatArray, swimming: Swimming) -> FloatArray:
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
