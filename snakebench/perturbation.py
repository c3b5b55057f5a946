"""What differs between a real robot and its description: values, all without effect by default.

Sources of the ranges are in docs/robustness.md.
"""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from snakebench.errors import InvalidValue, UnknownName
from snakebench.robot import MAX_LINKS, Robot
from snakebench.value import FloatArray, NonNegative, Value, within

STALL_TORQUE = 8.3  # of servos with a speed limit, if their robot has no torque limit [N m] (XW540-T140 at 14.8 V)
_NO_JOINT = 0.5  # share of draws in which no joint is dead, where none may be (ours)
DROPOUT = 0.1  # how long a dropout of the sensors lasts [s] (ours)
DRAG = ("pressure_drag", "viscous_drag", "normal_drag", "head_drag", "tail_drag")

Factor = Annotated[float, Field(strict=True), within(0.1, 10)]
Noise = Annotated[float, Field(strict=True), within(0, 100)]
Steps = Annotated[float, Field(strict=True), within(0, 3)]
Off = Annotated[int, Field(strict=True, ge=0, lt=MAX_LINKS)]


class Perturbations(Value):
    """How one robot, in one run, differs from its description; without any argument it does not.

    Noise and offsets are uniform between minus and plus what is given. What is random depends on `seed` only.

    Raises:
        InvalidValue: when a field is out of range.

    Example:
        >>> controller, scenario = sb.perturbed(gait, sb.Scenario(fluid="oil1"), sb.Perturbations(mass=1.1, delay=1.0))
        >>> sb.evaluate(controller, scenario).status
        'ok'
    """

    angle_noise: Noise = Field(0.0, description="of measured joint angles [rad]")
    rate_noise: Noise = Field(0.0, description="of measured joint rates [rad/s]")
    gyro_noise: Noise = Field(0.0, description="of the measured turning rate of the head [rad/s]")
    dropouts: NonNegative = Field(0.0, description="of all sensors, which repeat for 0.1 s what they measured [1/s]")
    joint_offset: Noise = Field(0.0, description="of each joint's angle sensor, which its servo uses as well [rad]")
    delay: Steps = Field(0.0, description="from a policy's action, or a gait's command, to the servos [control steps]")
    jitter: Steps = Field(0.0, description="largest further delay, drawn for each action [control steps]")
    servo_strength: Factor = Field(1.0, description="factor of all torques that servos exert [1]")
    speed_limit: NonNegative = Field(0.0, description="no-load speed of the servos; 0 for none [rad/s]")
    dead_joint: Off = Field(0, description="joint whose servo exerts no torque, counted from the head; 0 for none")
    mass: Factor = Field(1.0, description="factor of all masses [1]")
    cover_stiffness: Factor = Field(1.0, description="factor of the joints' stiffness [1]")
    pressure_drag: Factor = Field(1.0, description="factor of the tangential pressure drag, C_F [1]")
    viscous_drag: Factor = Field(1.0, description="factor of the tangential viscous drag, C_mu and C_nu [1]")
    normal_drag: Factor = Field(1.0, description="factor of the normal drag of all links, C_D [1]")
    head_drag: Factor = Field(1.0, description="factor of the head's further normal drag, P_4 [1]")
    tail_drag: Factor = Field(1.0, description="factor of the tail's further normal drag, P_5 [1]")
    start: Noise = Field(0.0, description="standard deviation of the first joint angles [rad]")
    seed: int = Field(0, strict=True, ge=0, lt=2**32, description="of all that is random")

    @property
    def active(self) -> dict[str, Any]:
        """Those that have an effect, by name."""
        values = self.model_dump(exclude_defaults=True, exclude={"seed"})
        return {name: value for name, value in values.items() if name != "jitter" or value}


NAMES = tuple(name for name in Perturbations.model_fields if name != "seed")


def known_perturbation(name: str) -> str:
    """The name, if a perturbation is called so."""
    if name not in NAMES:
        raise UnknownName.among("perturbation", name, NAMES)
    return name


def checked_ranges(ranges: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Ranges of perturbations by name, if there are such, and their bounds are allowed."""
    for name, (low, high) in ranges.items():
        known_perturbation(name)
        if low > high:
            raise ValueError(f"{name} = {[low, high]}: an ascending range is needed")
        for bound in (low, high):
            one_of(name, bound)
    return dict(ranges)


Ranges = Annotated[dict[str, tuple[float, float]], AfterValidator(checked_ranges)]  # of perturbations, by name


def one_of(name: str, value: float, seed: int = 0) -> Perturbations:
    """A single perturbation of a size."""
    return Perturbations(**{name: _typed(name, value)}, seed=seed)


def drawn(ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator) -> Perturbations:
    """Perturbations, each drawn uniformly from its range, independently.

    From a range of dead joints that begins at 0, none is drawn half of the time.
    """
    values = {name: rng.uniform(low, high) for name, (low, high) in ranges.items() if name != "dead_joint"}
    if "dead_joint" in ranges:
        low, high = ranges["dead_joint"]
        one = rng.uniform(max(low, 1.0), max(high, 1.0) + 1)
        values["dead_joint"] = 0.0 if low < 1 and (high < 1 or rng.random() < _NO_JOINT) else one
    return Perturbations(**{name: _typed(name, value) for name, value in values.items()}, seed=int(rng.integers(2**32)))


def corner(ranges: Mapping[str, tuple[float, float]], *low: str) -> Perturbations:
    """Some perturbations at the lower end of their ranges, and all others at the upper end."""
    ends = {name: bounds[0 if name in low else 1] for name, bounds in ranges.items()}
    values: dict[str, Any] = {name: _typed(name, value) for name, value in ends.items()}
    return Perturbations(**values)


def _typed(name: str, value: float) -> float | int:
    return int(value) if name == "dead_joint" else float(value)


class Specimen(Robot):
    """A robot that differs from what a `Robot` describes: for the engines of `engines/perturbed.py`.

    In files, such as those of trajectories, it is written as the robot that it seems to be.
    """

    dead_joint: Off = Field(
        0, exclude=True, description="joint whose servo exerts no torque, counted from the head; 0 for none"
    )
    drag: tuple[Factor, ...] = Field(
        (1.0,) * len(DRAG), exclude=True, description="factors: pressure, viscous, normal, head, tail"
    )
    pose: tuple[float, ...] = Field((), exclude=True, description="first joint angles [rad]; straight by default")
    offset: tuple[float, ...] = Field(
        (), exclude=True, description="measured less true joint angles [rad]; none by default"
    )


def changed_robot(robot: Robot, p: Perturbations) -> Robot:
    """The robot with other masses, stiffness and servos, under gaits of target angles."""
    limits = {"torque_limit": robot.torque_limit or STALL_TORQUE, "speed_limit": p.speed_limit} if p.speed_limit else {}
    changes: dict[str, Any] = {}
    if p.mass != 1.0:
        changes |= {"masses": tuple(p.mass * mass for mass in robot.masses), "cover_mass": p.mass * robot.cover_mass}
    if p.cover_stiffness != 1.0:
        changes["joint_stiffness"] = p.cover_stiffness * robot.joint_stiffness
    changes |= limits
    if p.servo_strength != 1.0:
        gains = ("proportional_gain", "derivative_gain", "torque_limit")
        limit = limits.get("torque_limit", robot.torque_limit)
        values = (robot.proportional_gain, robot.derivative_gain, limit)
        changes |= {name: p.servo_strength * x for name, x in zip(gains, values, strict=True) if x is not None}
    return robot.but(**changes) if changes else robot


def specimen(robot: Robot, p: Perturbations) -> Robot:
    """The changed robot; a `Specimen` where a robot cannot express what is perturbed.

    Raises:
        InvalidValue: when it has no such joint, or a dead one whose servo has no proportional gain.
    """
    if p.dead_joint and not robot.proportional_gain:
        raise InvalidValue("Perturbations: dead_joint: a robot with a proportional_gain above 0 is needed")
    if p.dead_joint > robot.n_joints:
        raise InvalidValue(f"Perturbations: dead_joint = {p.dead_joint}: the robot has {robot.n_joints} joints")
    changed, drag = changed_robot(robot, p), drag_of(p)
    if not (p.dead_joint or p.start or p.joint_offset) and set(drag) == {1.0}:
        return changed
    own = {name: getattr(changed, name) for name in Robot.model_fields}
    drawn_once = {
        "pose": tuple(first_pose(robot.n_joints, p).tolist()) if p.start else (),
        "offset": tuple(offsets(robot.n_joints, p).tolist()) if p.joint_offset else (),
    }
    return Specimen(**own, dead_joint=p.dead_joint, drag=drag, **drawn_once)


def first_pose(n_joints: int, p: Perturbations) -> FloatArray:
    """First joint angles [rad]."""
    return p.start * np.random.default_rng([p.seed, 1]).standard_normal(n_joints)


def offsets(n_joints: int, p: Perturbations) -> FloatArray:
    """Measured less true joint angles [rad]."""
    return p.joint_offset * np.random.default_rng([p.seed, 2]).uniform(-1, 1, n_joints)


def drag_of(p: Perturbations) -> tuple[float, ...]:
    """Factors of the drag, in the order of `Specimen.drag`."""
    return tuple(getattr(p, name) for name in DRAG)
