"""Environments of perturbed robots: each episode has its own, whose sensors err and whose commands come late."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakebench.channel import Channel
from snakebench.engines.perturbed import limp_target, scale_drag
from snakebench.fluid import Medium
from snakebench.learning.settings import Swimming
from snakebench.learning.vector import SplitBatch, SwimVecEnv
from snakebench.observation import Groups, Senses, grouped
from snakebench.perturbation import Perturbations, changed_robot, drag_of, drawn, first_pose
from snakebench.physics.record import Record
from snakebench.robot import Robot
from snakebench.value import FloatArray


class _PerturbedBatch(SplitBatch):
    """A batch whose robots are perturbed anew whenever they begin; `advance` makes a control step."""

    def __init__(self, robot: Robot, media: Sequence[Medium], swimming: Swimming, channel: Channel) -> None:
        self.channel, self.dead = channel, np.zeros(len(media), np.int64)
        self.n_joints, self._described, self._ranges = robot.n_joints, robot, swimming.randomisation.perturbations
        super().__init__([robot] * len(media), media, "angle", swimming.scenario().physics_rate)

    def restart(
        self,
        members: Sequence[int],
        media: Sequence[Medium] | None = None,
        robots: Sequence[Robot] | None = None,
        joint_angles: FloatArray | None = None,
    ) -> None:
        """As `Batch.restart`, with perturbations drawn for each member."""
        draws = [drawn(self._ranges, self.channel.rng) for _ in members]
        described = robots or [self._described] * len(members)
        changed = [changed_robot(robot, p) for robot, p in zip(described, draws, strict=True)]
        if "start" in self._ranges:
            poses = np.array([first_pose(self.n_joints, p) for p in draws])
            joint_angles = poses if joint_angles is None else poses + joint_angles
        super().restart(members, media, changed, joint_angles)
        for b, p in zip(members, draws, strict=True):
            self.dead[b] = p.dead_joint
            scale_drag(self._members["chain"][b], drag_of(p), self._described.n_links)
        self.channel.begin(draws, list(members))
        self.channel.measure(self.now, list(members))

    def advance(self, commands: FloatArray, n_steps: int) -> Record:
        """Make a control step of `n_steps` physics steps with target angles that may come late."""
        servoless = np.flatnonzero(self.dead)
        joints = self.dead[servoless] - 1
        for target in self.channel.delayed(commands) - self.channel.offset:
            angle, rate = (part[servoless, joints] for part in (self.now.joint_angle, self.now.joint_rate))
            target[servoless, joints] = limp_target(self._described, angle, rate)
            super().advance(target, n_steps // self.channel.parts)
        self.channel.measure(self.now)
        return self.now


class PerturbedVecEnv(SwimVecEnv):
    """`SwimVecEnv` whose settings name perturbations; rewards are of what robots do, observations of their sensors."""

    _batch: _PerturbedBatch

    def __init__(self, members: int, swimming: Swimming) -> None:
        super().__init__(members, swimming)
        n, media = self._robot.n_joints, [swimming.scenario().fluid] * members
        channel = Channel([Perturbations()] * members, n, self._rate, self._every, self._rng)
        self._batch = _PerturbedBatch(self._robot, media, swimming, channel)
        self._measured = Senses(self._robot, members)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Choose the random stream from the next `reset` on."""
        seeds = super().seed(seed)
        self._batch.channel.rng = self._rng
        return seeds

    def observe(self) -> Groups:
        """The present observation of all members, as their sensors measured it; so is the torque that it includes."""
        seen = self._batch.channel.seen(self._batch.now)
        self._measured.act(self._control_step.state()["action"], seen)
        self._measured.rest(np.flatnonzero(self.starts).tolist())
        return grouped(self._measured.observation(seen, self._viscosity, self._price), self._robot.n_joints)

    def truth(self) -> Groups:
        """What members would observe if their sensors did not err."""
        return super().observe()

    def _own(self) -> dict[str, NDArray[Any]]:
        channel = {f"channel {name}": array for name, array in self._batch.channel.state().items()}
        return {**super()._own(), **channel, "dead": self._batch.dead}
