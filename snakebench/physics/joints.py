"""The joints' law: what torque a command makes, and what torque acts (paper, section on action parameters).

Pure functions in SI units of numbers or arrays; compiled for numbers.
"""

import math
from typing import Any, Literal

import numpy as np

from snakebench.compilation import njit
from snakebench.robot import Robot
from snakebench.value import FloatArray

Drives = Literal["angle", "torque"]  # what commands are: target angles [rad] or command torques [N m]

# The law of a robot's joints as a record for compiled code; to the type checker it is `Any`.
JOINT_LAW = [
    ("servo", "?"),  # commands are target angles, not torques
    ("proportional_gain", "f8"),  # [N m/rad]
    ("derivative_gain", "f8"),  # [N m s/rad]
    ("torque_limit", "f8"),  # [N m]
    ("torque_fall", "f8"),  # with speed, to zero at the no-load speed [N m s/rad]
    ("speed_limit", "f8"),  # [rad/s]
    ("stiffness", "f8"),  # [N m/rad]
    ("damping", "f8"),  # [N m s/rad]
    ("angle_limit", "f8"),  # [rad]
    ("stop_stiffness", "f8"),  # [N m/rad]
]


def write_joint_law(law: Any, robot: Robot, drives: Drives) -> None:
    """Write the law of a robot's joints, under commands that drive "angle" or "torque", into a record."""
    law["servo"] = drives == "angle"
    law["proportional_gain"], law["derivative_gain"] = robot.proportional_gain, robot.derivative_gain
    law["stiffness"], law["damping"] = robot.joint_stiffness, robot.joint_damping
    law["torque_limit"] = math.inf if robot.torque_limit is None else robot.torque_limit
    law["torque_fall"] = robot.torque_fall
    law["speed_limit"] = math.inf if robot.speed_limit is None else robot.speed_limit
    law["angle_limit"] = math.inf if robot.angle_limit is None else robot.angle_limit
    law["stop_stiffness"] = robot.stop_stiffness


@njit(inline="always")
def torque_bounds(law: Any, rate: Any) -> tuple[Any, Any]:
    """The least and the greatest torque u_in [N m] that a servo exerts at a joint rate [rad/s] (ours).

    That of a motor at its voltage: the torque limit at rest and against the motion, falling along a line to zero at
    the no-load speed in the direction of motion. A joint that is faster is not driven further. Without a speed limit
    the torque limit holds at any rate.
    """
    least = -np.maximum(law.torque_limit + law.torque_fall * np.minimum(rate, 0.0), 0.0)
    return least, np.maximum(law.torque_limit - law.torque_fall * np.maximum(rate, 0.0), 0.0)


@njit(inline="always")
def command_torque(law: Any, command: Any, angle: Any, rate: Any) -> Any:
    """The torque u_in [N m] that a command makes in a joint, within the servo's bounds (ours).

    Before them it is the command itself or the servo's PD law (paper).
    """
    u_in = command
    if law.servo:
        u_in = law.proportional_gain * (command - angle) - law.derivative_gain * rate
    least, greatest = torque_bounds(law, rate)
    return np.minimum(np.maximum(u_in, least), greatest)


@njit(inline="always")
def applied_torque(law: Any, u_in: Any, angle: Any, rate: Any) -> Any:
    """The torque u [N m] that acts in a joint: u_in, the cover's spring and damper (paper), and the end stop (ours)."""
    beyond = angle - np.minimum(np.maximum(angle, -law.angle_limit), law.angle_limit)
    return u_in - law.stiffness * angle - law.damping * rate - law.stop_stiffness * beyond


@njit(inline="always")
def slopes(law: Any, u_in: float, angle: float, rate: float) -> tuple[float, float]:
    """Stiffness [N m/rad] and damping [N m s/rad] of a joint's applied torque at an angle and rate, under u_in.

    A servo at the bound of its torque is damped only by its fall with speed, while it drives below its no-load speed.
    """
    stiffness, damping = law.stiffness, law.damping
    least, greatest = torque_bounds(law, rate)
    if abs(angle) > law.angle_limit:
        stiffness += law.stop_stiffness
    if least < u_in < greatest:
        if law.servo:
            stiffness += law.proportional_gain
            damping += law.derivative_gain
    elif u_in * rate >= 0.0 and abs(rate) < law.speed_limit:
        damping += law.torque_fall
    return stiffness, damping


def torque_under(robot: Robot, drives: Drives, command: FloatArray, angle: FloatArray, rate: FloatArray) -> FloatArray:
    """The applied torque u [N m] of joints at angles [rad] and rates [rad/s] under commands; arrays of one shape."""
    law = np.recarray(1, JOINT_LAW)
    write_joint_law(law[0], robot, drives)
    u_in = command_torque.py_func(law[0], command, angle, rate)
    return applied_torque.py_func(law[0], u_in, angle, rate)
