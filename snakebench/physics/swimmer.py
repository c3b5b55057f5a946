"""The compiled half of the PyBullet engine: what the robot feels, does and leaves on record in one physics step.

How velocities are found from poses is said in `leapfrog`. The fluid acts at each link's centre of mass. Its forces
reach Bullet as their generalised equivalent (a force and a moment on the head, a torque on each joint), which has the
same effect on the chain at a fifth of the calls.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakebench.compilation import njit
from snakebench.fluid import Medium
from snakebench.physics.body import BODY, describe, immerse
from snakebench.physics.hydrodynamics import added_mass, fluid_at, normal_resistance, tangential_resistance
from snakebench.physics.joints import Drives, applied_torque, command_torque
from snakebench.physics.kinematics import move_links, place_links, write_mass_matrix
from snakebench.physics.leapfrog import LEAPFROG, balance, begin_step, end_step
from snakebench.physics.record import JOINT_RATE_MAX, V_MAX, record_of
from snakebench.robot import MAX_LINKS, Robot
from snakebench.sources import code_digest
from snakebench.value import FloatArray

_FURTHEST = 1e3  # from the head's centre that a force may act instead of a moment [m]

_RECORD = np.dtype(
    [
        *BODY,
        ("dt", "f8"),  # physics step [s]
        ("total_mass", "f8"),  # [kg]
        # The present.
        ("pose", "f8", (MAX_LINKS + 3,)),  # read from Bullet: x, y, z and w of the quaternion, joint angles
        ("place", "f8", (MAX_LINKS, 5)),  # of links: place_links
        ("place_before", "f8", (MAX_LINKS, 2)),  # a step ago, x and y [m]
        ("rate", "f8", (MAX_LINKS, 3)),  # of links: move_links
        ("v_n", "f8", (MAX_LINKS,)),  # normal velocity [m/s]
        ("a_n", "f8", (MAX_LINKS,)),  # its rate of change over the last step [m/s^2]
        ("force", "f8", (MAX_LINKS, 2)),  # of the fluid, x and y [N]
        ("load", "f8", (MAX_LINKS + 2,)),  # the same, generalised: head x, y [N], head turn and joints [N m]
        ("drive", "f8", (MAX_LINKS + 2,)),  # what acts in the next step: the load, the joints' torques and corrections
        (
            "calls",
            "f8",
            (MAX_LINKS + 4,),
        ),  # the same for Bullet: force x, y and the place x, y where it acts, moment, torques
        *LEAPFROG,
    ]
)
Swimmer = NDArray[np.void]


def swimmer_at_rest(robot: Robot, medium: Medium, drives: Drives, dt: float) -> Swimmer:
    """The record of a robot that lies straight and at rest, the tip of its head at the origin."""
    swimmer = np.zeros(1, _RECORD)
    describe(swimmer[0], robot, drives)
    immerse(swimmer[0], medium)
    swimmer["dt"], swimmer["total_mass"] = dt, robot.total_mass
    swimmer["pose"][0, :4] = -robot.lengths[0] / 2, 0.0, 0.0, 1.0
    return swimmer


@njit(error_model="numpy")
def _observe(swimmer: Any, rows: FloatArray, k: int, command: FloatArray) -> bool:
    """Write row k from the pose read back and find the fluid's load; False when the state is not finite or too fast.

    `command` is that which the last step ended with.
    """
    n, pose = swimmer.n_joints, swimmer.pose
    now, before = record_of(rows[k], n), record_of(rows[max(k - 1, 0)], n)
    turn = 2 * math.atan2(pose[2], pose[3]) - before.head[2]
    now.head[0], now.head[1] = pose[0], pose[1]
    now.head[2] = before.head[2] + turn - 2 * math.pi * np.rint(turn / (2 * math.pi))
    for j in range(n):
        now.joint_angle[j] = pose[4 + j]
    work = _moved(swimmer, now)
    if k > 0:
        end_step(swimmer, now, before, command)
    fastest = _spend(swimmer, now, before)
    now.energy[3] = before.energy[3] + work + _immerse(swimmer, now.head_rate, now.joint_rate, k * swimmer.dt)
    for a in range(2):
        now.center[a] = now.center_rate[a] = 0.0
        for i in range(n + 1):
            now.center[a] += swimmer.mass_share[i] * swimmer.place[i, a]
            now.center_rate[a] += swimmer.mass_share[i] * swimmer.rate[i, a]
    if k > 0:
        balance(swimmer, now, before)
    return math.hypot(now.center_rate[0], now.center_rate[1]) <= V_MAX and fastest <= JOINT_RATE_MAX


@njit(error_model="numpy")
def _moved(swimmer: Any, now: Any) -> float:
    """Place the links; returns what the fluid's last forces took as the last step began, at their own rates [J].

    The rest is said by `_immerse`: over half a step a force takes its product with the mean of the velocities at both
    ends, one of which is the way over the step.
    """
    work, force, rate, place = 0.0, swimmer.force, swimmer.rate, swimmer.place
    for i in range(swimmer.n_joints + 1):
        for a in range(2):
            work -= swimmer.dt / 4 * force[i, a] * rate[i, a]
            swimmer.place_before[i, a] = place[i, a]
    place_links(swimmer.length, now.head, now.joint_angle, place)
    write_mass_matrix(swimmer.length, swimmer.mass, swimmer.inertia, place, swimmer.n_joints, swimmer.mass_matrix)
    swimmer.factored = False
    return work


@njit(error_model="numpy")
def _spend(swimmer: Any, now: Any, before: Any) -> float:
    """Add the work of command torques and dampers in the last step; returns the highest joint speed [rad/s]."""
    fastest = 0.0
    for i in range(3):
        now.energy[i] = before.energy[i]
    for j in range(swimmer.n_joints):
        between = swimmer.d[3 + j]
        first, last = (before.joint_rate[j] + between) / 2, (between + now.joint_rate[j]) / 2
        begun = swimmer.dt / 2 * swimmer.new_command_torque[j] * first
        ended = swimmer.dt / 2 * swimmer.old_command_torque[j] * last
        now.energy[0] += begun + ended
        now.energy[1] += max(begun, 0.0) + max(ended, 0.0)
        now.energy[2] += swimmer.dt / 2 * swimmer.damping * (first * first + last * last)
        fastest = max(fastest, abs(now.joint_rate[j]))
    return fastest


@njit(error_model="numpy")
def _immerse(swimmer: Any, head_rate: FloatArray, joint_rate: FloatArray, time: float) -> float:
    """Move the links and sum the fluid's forces on them from tail to head into `swimmer.load`.

    Returns the work done on the fluid over the way of the last step [J].
    """
    place, rate, force, load = swimmer.place, swimmer.rate, swimmer.force, swimmer.load
    move_links(swimmer.length, place, head_rate, joint_rate, rate)
    work = force_x = force_y = moment = 0.0
    for i in range(swimmer.n_joints, -1, -1):
        length, cos, sin = swimmer.length[i], place[i, 3], place[i, 4]
        way_x, way_y = place[i, 0] - swimmer.place_before[i, 0], place[i, 1] - swimmer.place_before[i, 1]
        work -= (force[i, 0] * way_x + force[i, 1] * way_y) / 4
        v_t = rate[i, 0] * cos + rate[i, 1] * sin
        v_n = rate[i, 1] * cos - rate[i, 0] * sin
        a_n = (v_n - swimmer.v_n[i]) / swimmer.dt
        viscosity, density = fluid_at(swimmer, time, place[i, 0])
        f_t = -tangential_resistance(v_t, v_n, viscosity, density, length, swimmer.diameter) * v_t
        f_n = -normal_resistance(v_n, viscosity, density, length, swimmer.diameter, swimmer.drag_multiple[i]) * v_n
        f_n -= added_mass(density, length, swimmer.diameter) * (1.5 * a_n - 0.5 * swimmer.a_n[i])
        swimmer.v_n[i], swimmer.a_n[i] = v_n, a_n
        force[i, 0], force[i, 1] = f_t * cos - f_n * sin, f_t * sin + f_n * cos
        work -= (force[i, 0] * (way_x + swimmer.dt * rate[i, 0]) + force[i, 1] * (way_y + swimmer.dt * rate[i, 1])) / 4
        moment -= length / 2 * (cos * force_y - sin * force_x)  # of all that hangs behind, about this link's centre
        force_x += force[i, 0]
        force_y += force[i, 1]
        if i > 0:
            moment -= length / 2 * (cos * force_y - sin * force_x)  # and about the joint in front
            load[2 + i] = moment
    load[0], load[1], load[2] = force_x, force_y, moment
    return work


@njit(error_model="numpy")
def _actuate(swimmer: Any, rows: FloatArray, k: int, command: FloatArray) -> None:
    """Write a new command and its joint torques into row k, and what Bullet is given for the next step into `calls`.

    The head's force acts beside its centre, where the force's moment is that of the head: one call less for each step.
    Only a force too small for that leaves the moment to a call of its own.
    """
    n = swimmer.n_joints
    now = record_of(rows[k], n)
    for j in range(n):
        q, rate = now.joint_angle[j], now.joint_rate[j]
        now.command[j] = command[j]
        now.command_torque[j] = command_torque(swimmer, command[j], q, rate)
        now.torque[j] = applied_torque(swimmer, now.command_torque[j], q, rate)
    begin_step(swimmer, now, command)
    calls, force_x, force_y, moment = swimmer.calls, swimmer.drive[0], swimmer.drive[1], swimmer.drive[2]
    calls[0], calls[1], calls[2], calls[3], calls[4] = force_x, force_y, now.head[0], now.head[1], moment
    square = force_x * force_x + force_y * force_y
    if moment * moment < square * _FURTHEST**2:
        calls[2] += moment * force_y / square
        calls[3] -= moment * force_x / square
        calls[4] = 0.0
    for j in range(n):
        calls[5 + j] = swimmer.drive[3 + j]


def _entries(code: str) -> tuple[Any, Any, Any]:
    """The compiled functions that Python calls. numba keeps them on disk under a key that includes `code`.

    On its own it would compare only this file and reuse what was compiled from another force law.
    """

    @njit(cache=True)
    def begin(record: Swimmer, rows: FloatArray) -> bool:
        """Observe the start, row 0."""
        code  # noqa: B018
        return _observe(record[0], rows, 0, rows[0])

    @njit(cache=True)
    def command(record: Swimmer, rows: FloatArray, k: int, commands: FloatArray, i: int) -> None:
        """Actuate by row i of `commands` for the step that follows row k."""
        code  # noqa: B018
        _actuate(record[0], rows, k, commands[i])

    @njit(cache=True)
    def react(record: Swimmer, rows: FloatArray, k: int, commands: FloatArray, i: int, late: int) -> bool:
        """Observe row k, where step i has led, and actuate by row i + 1, or the last; False once the run diverged.

        The step ended with row i + `late` of `commands`.
        """
        code  # noqa: B018
        alive = _observe(record[0], rows, k, commands[i + late])
        _actuate(record[0], rows, k, commands[min(i + 1, len(commands) - 1)])
        return alive

    return begin, command, react


begin, command, react = _entries(code_digest("physics.swimmer"))
