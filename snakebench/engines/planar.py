"""The planar engine: many robots at once, each in its own medium, stepped together over threads.

It integrates the same physics as the shared evaluator from an independent derivation (`physics/chain.py`), to a higher
order (`physics/stepping.py`): it checks, searches and trains; published results are the evaluator's.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, get_args

import numba
import numpy as np
from numpy.typing import NDArray

from snakebench.controllers import Controller, WaveformGait
from snakebench.engines import Simulation, check_finite, check_rate, check_resolved, commands_of
from snakebench.errors import InvalidValue, UnknownName
from snakebench.fluid import Medium
from snakebench.physics.body import immerse
from snakebench.physics.chain import CHAIN, describe_chain
from snakebench.physics.joints import Drives
from snakebench.physics.kinematics import joint_mobility, link_poses
from snakebench.physics.record import Record, as_record, row_width
from snakebench.physics.stepping import MEMBER, WORK, swim_in_turn, swim_side_by_side
from snakebench.physics.waveform import HELD, SAMPLES, Waveform
from snakebench.robot import Robot
from snakebench.sources import code_digest
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

VERSION = f"planar, code {code_digest('engines.planar')}"
MOST_THREADS = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]  # one a core unless set otherwise
_STEEPEST = 50.0  # decays in a step that the fall of torque with speed may cause under target angles (ours)


class Batch:
    """Robots with equally many joints, each in its own medium, from rest, straight, heading +x.

    A member that diverges is frozen; the others are untouched. Numbers do not depend on the threads or on who else is
    in the batch.

    Args:
        robots: one for each member.
        media: a fluid or a field for each member.
        drives: whether commands are target angles or torques.
        physics_rate: steps per second [Hz].
        threads: how many threads share the members, at most one a core.

    Attributes:
        rows: what `Record` describes, of every member, shape (n_members, n_rows, row width): before the last call
            and, equally spaced, in it; its last row is the present.

    Raises:
        InvalidValue: when there is not a medium for each robot, robots have different numbers of joints, `drives` is
            unknown, or there is no thread or rate.
        UnstableRate: when a robot needs a higher physics rate.
    """

    def __init__(
        self, robots: Sequence[Robot], media: Sequence[Medium], drives: Drives, physics_rate: int, threads: int = 1
    ) -> None:
        if len(robots) != len(media) or len({robot.n_joints for robot in robots}) != 1:
            raise InvalidValue(f"{len(robots)} robots in {len(media)} media: as many, with equal joints, are needed")
        if drives not in get_args(Drives):
            raise UnknownName.among("kind of command", drives, get_args(Drives))
        if threads < 1 or physics_rate < 1:
            raise InvalidValue(f"threads = {threads}, physics_rate = {physics_rate}: at least 1 is needed of both")
        self.robots, self.drives, self.physics_rate = list(robots), drives, physics_rate
        self.n_joints = robots[0].n_joints
        self._members = np.zeros(len(robots), MEMBER)
        self._places, self._rates = np.zeros((2, len(robots), self.n_joints + 3))
        self.rows = np.zeros((len(robots), 1, row_width(self.n_joints)))
        self._work = np.empty(min(threads, len(robots), MOST_THREADS), WORK)
        self.restart(range(len(robots)), media, robots)

    def __len__(self) -> int:
        return len(self._members)

    @property
    def alive(self) -> NDArray[np.bool_]:
        """Which members have not diverged, shape (n_members,)."""
        return self._members["alive"].copy()

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps that each member has made since it was at rest, shape (n_members,)."""
        return self._members["steps"].copy()

    def restart(
        self,
        members: Sequence[int],
        media: Sequence[Medium] | None = None,
        robots: Sequence[Robot] | None = None,
        joint_angles: FloatArray | None = None,
    ) -> None:
        """Put some members back to rest, their heads' tips at the origin, as new robots and into new media if given.

        Args:
            media: a fluid or a field for each of them.
            robots: a robot for each of them, with as many joints as before.
            joint_angles: the pose of each [rad], shape (len(members), n_joints), the head along x; straight by default.

        Raises:
            InvalidValue: when there is not a medium, robot or pose for each of them.
            UnstableRate: when a robot needs a higher physics rate.
        """
        for what, given in (("media", media), ("robots", robots), ("poses", joint_angles)):
            if given is not None and len(given) != len(members):
                raise InvalidValue(f"{len(given)} {what} for {len(members)} members: as many are needed")
        self.rows = self.rows[:, -1:].copy()
        self._whole = len(members) == len(self)  # whether `rows` tell every step since the members were at rest
        for i, b in enumerate(members):
            member, place = self._members[b], self._places[b]
            if robots is not None:
                if robots[i].n_joints != self.n_joints:
                    raise InvalidValue(f"a robot with {robots[i].n_joints} joints among those with {self.n_joints}")
                check_rate("planar", stable_rate(robots[i], self.drives), self.drives, self.physics_rate)
                describe_chain(member["chain"], robots[i], self.drives)
                self.robots[b] = robots[i]
            if media is not None:
                immerse(member["chain"], media[i])
            member["alive"], member["steps"], member["halvings"], member["energy"] = True, 0, 0, 0.0
            place[:], self._rates[b], self.rows[b], robot = 0.0, 0.0, 0.0, self.robots[b]
            now = as_record(self.rows[b, 0], self.n_joints)
            now.head[0] = -robot.lengths[0] / 2
            if joint_angles is None:
                behind = np.cumsum(robot.link_lengths) - robot.link_lengths / 2  # the head's tip [m]
                place[0] = -float(robot.link_masses @ behind) / robot.total_mass
            else:
                now.joint_angle[:] = joint_angles[i]
                links = link_poses(robot.link_lengths, now.head[None], now.joint_angle[None])[0]
                place[:2], place[2:] = robot.link_masses @ links[:, :2] / robot.total_mass, links[:, 2]
            now.center[:] = place[:2]

    def advance(self, commands: FloatArray, n_steps: int) -> Record:
        """Hold each member's command for some steps and return the present.

        Args:
            commands: target angles [rad] or command torques [N m], shape (n_members, n_joints).
            n_steps: physics steps to make, such as those of a control step.

        Raises:
            InvalidValue: for a command that is not finite, naming environment and joint, another shape, or no steps.
        """
        commands = np.ascontiguousarray(commands, np.float64)
        if commands.shape != (len(self), self.n_joints):
            raise InvalidValue(f"commands of shape {commands.shape}: ({len(self)}, {self.n_joints}) is needed")
        check_finite(commands, "environment")
        self._members["kind"], self._members["rate"], self._members["rows"] = HELD, 0.0, 1
        self._members["bound"], self._whole = np.inf, False
        self._swim(commands[:, None, :], n_steps, np.empty((len(self), 2, row_width(self.n_joints))))
        return self.now

    def follow(self, waveforms: Sequence[Waveform], n_steps: int, every: int = 1) -> Record:
        """Let each member follow its own waveform from now on, keep each `every`-th step, and return the present.

        Raises:
            InvalidValue: without a finite waveform of all joints for each member, or if `every` divides no steps.
        """
        if every < 1 or n_steps % every:
            raise InvalidValue(f"every = {every}: it must divide the {n_steps} steps")
        tables = self._load(waveforms)
        for waveform in waveforms:
            check_resolved(waveform, self.n_joints, self.physics_rate)
        self._whole = every == 1 and not self._members["steps"].any()
        self._swim(tables, n_steps, np.empty((len(self), n_steps // every + 1, row_width(self.n_joints))))
        return self.now

    @property
    def now(self) -> Record:
        """The present of all members, each part of `Record` with the members as first axis; it stays as it is."""
        return as_record(self.rows[:, -1], self.n_joints)

    def trajectory(self, b: int) -> Trajectory:
        """What member `b` did since it was at rest.

        Raises:
            InvalidValue: unless the last call made all of its steps and kept them.
        """
        if not self._whole:
            raise InvalidValue("no trajectory: `rows` do not tell every step since the robots were at rest")
        rows, diverged = self.rows[b, : self.steps[b] + 1], not self.alive[b]
        return Trajectory.from_rows(rows, self.robots[b], self.drives, "planar", self.physics_rate, diverged=diverged)

    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of all that the members' future depends on, as plain arrays, for `restore`."""
        return {
            "members": self._members.view(np.uint8).copy(),
            "places": self._places.copy(),
            "rates": self._rates.copy(),
            "now": self.rows[:, -1:].copy(),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from what `state` gave, of a batch of the same robots."""
        self._members[:] = state["members"].view(MEMBER)
        self._places[:], self._rates[:], self.rows = state["places"], state["rates"], state["now"].copy()
        self._whole = False

    def _load(self, waveforms: Sequence[Waveform]) -> FloatArray:
        """Give each member its waveform and return their tables, filled up to equal size."""
        if len(waveforms) != len(self):
            raise InvalidValue(f"{len(waveforms)} waveforms for {len(self)} robots: as many are needed")
        for waveform in waveforms:
            if waveform.table.shape[1:] != (self.n_joints,):
                raise InvalidValue(f"a waveform of shape {waveform.table.shape}: {self.n_joints} joints are needed")
            if not np.isfinite(waveform.rate):
                raise InvalidValue(f"a waveform of {waveform.rate} Hz: a finite rate is needed")
        kinds, rates, tables, bounds = zip(*waveforms, strict=True)
        sizes = [len(table) for table in tables]
        for name, values in {"kind": kinds, "rate": rates, "rows": sizes, "bound": bounds}.items():
            self._members[name] = values
        filled = np.zeros((len(self), max(sizes), self.n_joints))
        for b, table in enumerate(tables):
            filled[b, : sizes[b]] = table
        return filled

    def _swim(self, tables: FloatArray, n_steps: int, rows: FloatArray) -> None:
        if n_steps < 1:
            raise InvalidValue(f"n_steps = {n_steps}: at least 1 is needed")
        self.rows = rows
        swimming = self._members, tables, float(self.physics_rate), n_steps, self._places, self._rates, rows, self._work
        if len(self._work) == 1:
            swim_in_turn(*swimming)
            return
        before = numba.get_num_threads()
        numba.set_num_threads(len(self._work))
        swim_side_by_side(*swimming)
        numba.set_num_threads(before)


class PlanarSimulation(Simulation):
    """One robot in one medium: a batch of one that keeps all its steps."""

    engine = "planar"

    def __init__(self, robot: Robot, medium: Medium, drives: Drives, physics_rate: int, n_steps: int) -> None:
        super().__init__(robot, drives, physics_rate, n_steps)
        self._batch = Batch([robot], [medium], drives, physics_rate)
        self._rows[:1] = self._batch.rows[0]

    def __exit__(self, *_: object) -> None:
        pass

    def _hold(self, commands: FloatArray) -> bool:
        return self._swim(Waveform(HELD, self._rate, commands, np.inf), len(commands))

    def _follow(self, controller: Controller, n_steps: int) -> bool:
        """Waveforms are evaluated wherever the integrator asks; other commands are linear between half steps."""
        if isinstance(controller, WaveformGait):
            return self._swim(controller.waveform(self._robot.n_joints), n_steps)
        times = np.arange(2 * n_steps + 1) / (2 * self._rate)
        commands = commands_of(controller, times, self._robot.n_joints)
        return self._swim(Waveform(SAMPLES, 2 * self._rate, commands, np.inf), n_steps)

    def _swim(self, waveform: Waveform, n_steps: int) -> bool:
        if n_steps and self._alive:
            rows = self._rows[None, self._step : self._step + n_steps + 1]
            self._batch._swim(self._batch._load([waveform]), n_steps, rows)
            self._step, self._alive = int(self._batch.steps[0]), bool(self._batch.alive[0])
        return self._alive


open_simulation = PlanarSimulation


def inputs(robot: Robot, medium: Medium, drives: Drives, physics_rate: int) -> bytes:
    """All numbers that a run is computed from, beside the commands."""
    chain = np.zeros(1, CHAIN)
    describe_chain(chain[0], robot, drives)
    immerse(chain[0], medium)
    return chain.tobytes() + np.float64(physics_rate).tobytes()


@lru_cache(maxsize=4096)
def stable_rate(robot: Robot, drives: Drives) -> float:
    """The lowest physics rate [Hz] at which this engine integrates the joints' law stably.

    Torque gaits: the order-four Runge-Kutta method amplifies no mode of the spring and damper of the straight chain,
    the stiffest, with a margin of 5 % (ours). Target angles: any rate, the method is implicit in the joints' law, but a
    servo's fall of torque with speed may damp by 50 in a step at most: steeper, joints chatter (measured; ours). The
    fluid is not considered: torques in more than about 0.1 m^2/s, twenty times oil2's, need finer steps or diverge.
    """
    if drives == "angle" and robot.speed_limit is None:
        return 0.0
    mobility = np.linalg.eigvalsh(joint_mobility(robot, np.zeros(robot.n_joints)))
    if drives == "angle":
        return float(robot.torque_fall * mobility[-1] / _STEEPEST)
    damping, stiffness = robot.damping(drives) * mobility, robot.stiffness(drives) * mobility
    root = np.sqrt(damping**2 - 4 * stiffness + 0j)
    modes = np.concatenate([root - damping, -root - damping]) / 2  # [1/s]
    fastest = float(np.abs(modes).max())
    if fastest == 0.0:
        return 0.0
    sizes = np.linspace(0.0, 3.0, 1001)  # of the fastest mode times the step; no mode is stable at 3
    z = modes[:, None] / fastest * sizes
    grows = (np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))) > 1 + 1e-9).any(axis=0)
    return float(1.05 * fastest / sizes[np.argmax(grows) - 1])
