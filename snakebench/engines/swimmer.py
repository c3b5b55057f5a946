"""The compiled half of the PyBullet engine: what the robot feels, does and leaves on record in one physics step.

Bullet integrates semi-implicitly: a step first changes the velocities, then moves the body by velocity times step.
So the poses before and after a step give the velocity exactly, and nothing but poses is needed.

The fluid acts at each link's centre of mass. Those forces reach Bullet as their generalised equivalent (a force and a
moment on the head, a torque on each joint), which has the same effect on the chain at a fifth of the calls.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakebench.compilation import njit
from snakebench.controllers import Drives
from snakebench.engines import body
from snakebench.engines.body import BODY, describe, immerse, medium_of
from snakebench.fluid import Fluid, FluidField
from snakebench.hydrodynamics import added_mass, fluid_at, normal_force, tangential_force
from snakebench.joints import applied_torque, command_torque
from snakebench.kinematics import move_links, place_links
from snakebench.robot import MAX_LINKS, Robot
from snakebench.sources import code_digest
from snakebench.trajectory import JOINT_RATE_MAX, V_MAX, record_of
from snakebench.value import FloatArray

_RECORD = np.dtype(
    [
        *BODY,
        ("dt", "f8"),  # physics step [s]
        # The present.
        ("pose", "f8", (MAX_LINKS + 3,)),  # read from Bullet: x, y, z and w of the quaternion, joint angles
        ("place", "f8", (MAX_LINKS, 5)),  # of links: place_links
        ("rate", "f8", (MAX_LINKS, 3)),  # of links: move_links
        ("v_n", "f8", (MAX_LINKS,)),  # normal velocity [m/s]
        ("force", "f8", (MAX_LINKS, 2)),  # of the fluid, x and y [N]
        ("load", "f8", (MAX_LINKS + 2,)),  # the same, generalised: head x, y [N], head turn and joints [N m]
        ("drive", "f8", (MAX_LINKS + 2,)),  # the load with the joint torques added: what Bullet is given
    ]
)
Swimmer = NDArray[np.void]


def swimmer_at_rest(robot: Robot, medium: Fluid | FluidField, drives: Drives, dt: float) -> Swimmer:
    """The record of a robot that lies straight and at rest, the tip of its head at the origin."""
    swimmer = np.zeros(1, _RECORD)
    describe(swimmer[0], robot, drives)
    immerse(swimmer[0], medium)
    swimmer["dt"] = dt
    swimmer["pose"][0, :4] = -robot.lengths[0] / 2, 0.0, 0.0, 1.0
    return swimmer


@njit(error_model="numpy")
def _observe(swimmer: Any, rows: FloatArray, k: int) -> bool:
    """Write row k from the pose read back and find the fluid's load; False when the state is not finite or too fast."""
    n, dt, pose = swimmer.n_joints, swimmer.dt, swimmer.pose
    now, before = record_of(rows[k], n), record_of(rows[max(k - 1, 0)], n)
    turn = 2 * math.atan2(pose[2], pose[3]) - before.head[2]
    now.head[0], now.head[1] = pose[0], pose[1]
    now.head[2] = before.head[2] + turn - 2 * math.pi * np.rint(turn / (2 * math.pi))
    for a in range(3):
        now.head_rate[a] = (now.head[a] - before.head[a]) / dt
    work = positive_work = damper_work = fastest = 0.0
    for j in range(n):
        now.joint_angle[j] = pose[4 + j]
        moved = now.joint_angle[j] - before.joint_angle[j]
        now.joint_rate[j] = moved / dt
        work += before.command_torque[j] * moved
        positive_work += max(before.command_torque[j] * moved, 0.0)
        damper_work += swimmer.damping * before.joint_rate[j] * moved
        fastest = max(fastest, abs(now.joint_rate[j]))
    fluid_work = _immerse(swimmer, now.head, now.head_rate, now.joint_angle, now.joint_rate, k * dt)
    now.energy[0] = before.energy[0] + work
    now.energy[1] = before.energy[1] + positive_work
    now.energy[2] = before.energy[2] + damper_work
    now.energy[3] = before.energy[3] + fluid_work
    for a in range(2):
        now.center[a] = now.center_rate[a] = 0.0
        for i in range(n + 1):
            now.center[a] += swimmer.mass_share[i] * swimmer.place[i, a]
            now.center_rate[a] += swimmer.mass_share[i] * swimmer.rate[i, a]
    return math.hypot(now.center_rate[0], now.center_rate[1]) <= V_MAX and fastest <= JOINT_RATE_MAX


@njit(error_model="numpy")
def _immerse(
    swimmer: Any,
    head: FloatArray,
    head_rate: FloatArray,
    joint_angle: FloatArray,
    joint_rate: FloatArray,
    time: float,
) -> float:
    """Move the links to the present and sum the fluid's forces on them from tail to head into `swimmer.load`.

    Returns the work [J] done on the fluid in the step just made, in which the last forces were held.
    """
    place, rate, force, load = swimmer.place, swimmer.rate, swimmer.force, swimmer.load
    work = 0.0
    for i in range(swimmer.n_joints + 1):
        work += force[i, 0] * place[i, 0] + force[i, 1] * place[i, 1]
    place_links(swimmer.length, head, joint_angle, place)
    move_links(swimmer.length, place, head_rate, joint_rate, rate)
    fluid = medium_of(swimmer)
    force_x = force_y = moment = 0.0
    for i in range(swimmer.n_joints, -1, -1):
        work -= force[i, 0] * place[i, 0] + force[i, 1] * place[i, 1]
        length, cos, sin = swimmer.length[i], place[i, 3], place[i, 4]
        v_t = rate[i, 0] * cos + rate[i, 1] * sin
        v_n = rate[i, 1] * cos - rate[i, 0] * sin
        viscosity, density = fluid_at(fluid, time, place[i, 0])
        f_t = tangential_force(v_t, v_n, viscosity, density, length, swimmer.diameter)
        f_n = normal_force(v_n, viscosity, density, length, swimmer.diameter, swimmer.drag_multiple[i])
        f_n -= added_mass(density, length, swimmer.diameter) * (v_n - swimmer.v_n[i]) / swimmer.dt
        swimmer.v_n[i] = v_n
        force[i, 0], force[i, 1] = f_t * cos - f_n * sin, f_t * sin + f_n * cos
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
    """Write the joint torques that a command makes in row k, and add them to the fluid's load."""
    n = swimmer.n_joints
    now = record_of(rows[k], n)
    swimmer.drive[:3] = swimmer.load[:3]
    for j in range(n):
        q, rate = now.joint_angle[j], now.joint_rate[j]
        now.command[j] = command[j]
        now.command_torque[j] = command_torque(swimmer, command[j], q, rate)
        now.torque[j] = applied_torque(swimmer, now.command_torque[j], q, rate)
        swimmer.drive[3 + j] = swimmer.load[3 + j] + now.torque[j]


SOURCES = ("engines/swimmer.py", *body.SOURCES)


def _entries(code: str) -> tuple[Any, Any, Any]:
    """The compiled functions that Python calls. numba keeps them on disk under a key that includes `code`.

    On its own it would compare only this file and reuse what was compiled from another force law.
    """

    @njit(cache=True)
    def begin(record: Swimmer, rows: FloatArray) -> bool:
        code  # noqa: B018
        return _observe(record[0], rows, 0)

    @njit(cache=True)
    def command(record: Swimmer, rows: FloatArray, k: int, commands: FloatArray, i: int) -> None:
        code  # noqa: B018
        _actuate(record[0], rows, k, commands[i])

    @njit(cache=True)
    def react(record: Swimmer, rows: FloatArray, k: int, commands: FloatArray, i: int) -> bool:
        code  # noqa: B018
        alive = _observe(record[0], rows, k)
        _actuate(record[0], rows, k, commands[i])
        return alive

    return begin, command, react


# begin(record, rows): observe the start, row 0.
# command(record, rows, k, commands, i): actuate by row i of `commands` for the step that follows row k.
# react(record, rows, k, commands, i): observe row k, then as `command`; False once the run diverged.
begin, command, react = _entries(code_digest(*SOURCES))
