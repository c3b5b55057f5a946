"""A controller and a scenario under perturbations are a controller and a scenario: all else works as without them.

What happens between a policy and its robot is here; what is different in the robot is in `perturbation.py`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakebench.controllers import Controller
from snakebench.observation import of_one
from snakebench.perturbation import DROPOUT, Perturbations, Specimen, offsets, specimen
from snakebench.physics.joints import Drives
from snakebench.physics.record import Record
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController, ClosedLoop
from snakebench.sources import code_digest
from snakebench.value import FloatArray, digest

_CODE = code_digest("channel", "perturbation", "controllers")
_PARTS = 8  # of a control step, to whose ends delays are rounded
_AHEAD = 8  # actions that may be under way at once: more than the largest delay and jitter
_SENSED = ("angle_noise", "rate_noise", "gyro_noise", "dropouts", "joint_offset")
_LATE = ("delay", "jitter")


class Channel:
    """What lies between policies and their robots: sensors that err, and commands that come late.

    Args:
        drawn: the perturbations of each member.
        n_joints: of the robots.
        control_rate: actions per second [Hz].
        parts: of a control step, to whose ends delays are rounded.
        rng: of all that is random.
    """

    def __init__(
        self, drawn: Sequence[Perturbations], n_joints: int, control_rate: int, parts: int, rng: np.random.Generator
    ) -> None:
        members = len(drawn)
        self.rng, self._rate, self.parts = rng, control_rate, parts
        self._sizes = np.zeros((members, len(_SENSED) + len(_LATE)))
        self.offset = np.zeros((members, n_joints))
        self._measured = np.zeros((members, 2 * n_joints + 1))
        self._lost, self._time = np.zeros((2, members))  # control steps: left of a dropout, since the start
        self._actions = np.zeros((_AHEAD, members, n_joints))  # the newest last
        self._arrivals = np.zeros((_AHEAD, members))  # [parts of a control step since the start]
        self.begin(drawn)

    def begin(self, drawn: Sequence[Perturbations], members: Any = slice(None)) -> None:
        """Let members begin a run, with perturbations of their own."""
        self._sizes[members] = [[getattr(p, name) for name in _SENSED + _LATE] for p in drawn]
        self.offset[members] = [offsets(self.offset.shape[1], p) for p in drawn]
        self._lost[members] = self._time[members] = 0.0
        self._actions[:, members], self._arrivals[:, members] = 0.0, -1.0

    def measure(self, now: Record, members: Any = slice(None)) -> None:
        """Read the sensors of members, once a control step; `now` is the present of all."""
        n, size = self.offset.shape[1], dict(zip(_SENSED + _LATE, self._sizes.T, strict=True))
        scale = np.repeat([size[name] for name in _SENSED[:3]], [n, n, 1], axis=0).T
        true = np.column_stack([now.joint_angle + self.offset, now.joint_rate, now.head_rate[:, 2]])
        fresh = true + scale * self.rng.uniform(-1, 1, true.shape)
        begins = self.rng.random(len(true)) < size["dropouts"] / self._rate
        begins &= (self._lost <= 0) & (self._time > 0)
        lost = np.where(begins, round(DROPOUT * self._rate), self._lost)
        shown = np.where(lost[:, None] > 0, self._measured, fresh)
        self._measured[members], self._lost[members] = shown[members], lost[members] - 1

    def seen(self, now: Record) -> Record:
        """The present with the angles, rates and gyro that were measured last; all else is as it is."""
        n = self.offset.shape[1]
        head_rate = np.column_stack([now.head_rate[:, :2], self._measured[:, -1]])
        angle, rate = self._measured[:, :n], self._measured[:, n:-1]
        return now._replace(joint_angle=angle, joint_rate=rate, head_rate=head_rate)

    def delayed(self, action: FloatArray) -> FloatArray:
        """The target angles [rad] in each part of the control step that begins, shape (parts, members, n_joints).

        Actions arrive in their order; before the first the joints are straight.
        """
        late = self._sizes[:, -2] + self._sizes[:, -1] * self.rng.random(len(action))
        arrival = np.maximum(np.rint((self._time + late) * self.parts), self._arrivals[-1])
        self._actions[:], self._actions[-1] = np.roll(self._actions, -1, axis=0), action
        self._arrivals[:], self._arrivals[-1] = np.roll(self._arrivals, -1, axis=0), arrival
        times = self._time * self.parts + np.arange(self.parts)[:, None]
        newest = (self._arrivals <= times[:, None]).sum(axis=1) - 1  # of those that have arrived
        self._time += 1
        return self._actions[newest, np.arange(len(action))]

    def state(self) -> dict[str, NDArray[Any]]:
        """All that the future depends on but the random stream: the arrays themselves, not copies."""
        return {name: array for name, array in vars(self).items() if isinstance(array, np.ndarray)}


class PerturbedPolicy:
    """A policy whose sensors err and whose commands come late, as a controller in closed loop.

    It is called `parts` times a control step. What the policy knows of its robot is the description: the torque that
    it observes is computed from what is measured, with the servos' nominal law.
    """

    drives: Drives = "angle"

    def __init__(self, policy: ClosedLoop, p: Perturbations, robot: Robot, parts: int) -> None:
        self.policy, self.perturbations, self._robot, self._parts = policy, p, robot, parts

    def begin(self, robot: Robot, control_rate: int) -> Callable[[Record, float], FloatArray]:
        """The policy at the start of a run; errors as its own."""
        rate = control_rate // self._parts
        choose, rng = self.policy.begin(self._robot, rate), np.random.default_rng([self.perturbations.seed, 0])
        channel = Channel([self.perturbations], robot.n_joints, rate, self._parts, rng)
        targets: list[FloatArray] = []

        def target(now: Record, viscosity: float) -> FloatArray:
            if not targets:
                channel.measure(of_one(now))
                seen = Record(*(part[0] for part in channel.seen(of_one(now))))
                action = np.clip(np.asarray(choose(seen, viscosity), np.float64), -1.0, 1.0)
                targets.extend(channel.delayed(action[None])[:, 0])
            return targets.pop(0)

        return target

    def digest(self) -> str:
        """A hash of everything that determines the target angles."""
        return digest([self.policy.digest(), self.perturbations.digest(), self._robot.digest(), self._parts, _CODE])


class PerturbedGait:
    """A gait whose commands come late, or whose torques are others than it commands, as a controller in open loop."""

    def __init__(self, gait: Controller, p: Perturbations, control_rate: int) -> None:
        self.gait, self.perturbations, self._rate = gait, p, control_rate

    @property
    def drives(self) -> Drives:
        """As the gait."""
        return self.gait.drives

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """Commands [rad or N m] at increasing times [s]; before the first arrives, zero. Errors as the gait's."""
        p, rng = self.perturbations, np.random.default_rng([self.perturbations.seed, 0])
        step = np.floor(np.asarray(times) * self._rate + 1e-9).astype(int)
        late = p.delay + p.jitter * rng.random(int(step.max(initial=0)) + 1)  # [control steps]
        count = np.arange(len(late), dtype=np.float64)
        late = count - np.maximum.accumulate(count - late)  # no command overtakes another
        sent = times - late[step] / self._rate
        commands = np.where((sent >= -1e-12)[:, None], self.gait.commands(np.maximum(sent, 0.0), n_joints), 0.0)
        return p.servo_strength * commands if self.drives == "torque" else commands

    def digest(self) -> str:
        """A hash of everything that determines the commands."""
        return digest([self.gait.digest(), self.perturbations.digest(), self._rate, _CODE])


def perturbed(
    controller: AnyController, scenario: Scenario, perturbations: Perturbations
) -> tuple[AnyController, Scenario]:
    """A controller and a scenario that behave as the given ones under perturbations; without any, the given ones.

    Where actions of a policy come late, the scenario has a higher control rate, of which the policy knows nothing.

    Raises:
        InvalidValue: when the robot has no such joint as is dead.

    Example:
        >>> policy = sb.Policy.load("results/teacher_student/policies/student-10.safetensors")
        >>> case = sb.perturbed(policy, sb.Scenario(fluid="oil1"), sb.Perturbations(rate_noise=1.5, delay=1.0))
        >>> sb.evaluate(*case).speed
    """
    p, here, named = perturbations, perturbed_robot(scenario, perturbations), set(perturbations.active)
    if isinstance(controller, ClosedLoop):
        if not named & {*_SENSED, *_LATE} and here is scenario:
            return controller, scenario
        parts = parts_of(here, p)
        later = here.but(control_rate=parts * here.control_rate) if parts > 1 else here
        return PerturbedPolicy(controller, p, scenario.robot, parts), later
    if named & set(_LATE) or (controller.drives == "torque" and "servo_strength" in named):
        controller = PerturbedGait(controller, p, scenario.control_rate)
    return controller, here


def perturbed_robot(scenario: Scenario, p: Perturbations) -> Scenario:
    """The scenario with the perturbed robot, and with the engine that such a robot needs."""
    robot = specimen(scenario.robot, p)
    if robot is scenario.robot:
        return scenario
    engine = f"perturbed {scenario.engine}" if isinstance(robot, Specimen) else scenario.engine
    return scenario.but(robot=robot, engine=engine, physics_rate=scenario.physics_rate)


def parts_of(scenario: Scenario, p: Perturbations) -> int:
    """Into how many parts a control step is divided, to whose ends delays are rounded."""
    every = scenario.physics_rate // scenario.control_rate
    return 1 if not (p.delay or p.jitter) else _PARTS if every % _PARTS == 0 else every
