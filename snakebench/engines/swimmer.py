"""The compiled half of the PyBullet engine: what the robot feels, does and leaves on record in one physics step.

Bullet's step is a leapfrog: it changes the velocities, then moves the body by the new velocity times the step. So the
poses before and after a step give the velocity in the middle of the step, exactly, and nothing but poses is needed.
The impulse of a step acts at its beginning: one half ends the step before, at the old command, the other half begins
the next step, at the new command. The velocity between the halves is that at this instant: all forces depend on it, it
is observed, and it divides the work of a torque that jumps.

It is the velocity half a step ago and half a step of acceleration. The part of the joints' torques is known, and solved
for together with their own damping, so that a stiff servo is stable; all else accelerates as in the last step.

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
from snakebench.kinematics import factorise, joint_response, move_links, place_links, solve
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
        ("a_n", "f8", (MAX_LINKS,)),  # its change over the last step [m/s^2]
        ("force", "f8", (MAX_LINKS, 2)),  # of the fluid, x and y [N]
        ("load", "f8", (MAX_LINKS + 2,)),  # the same, generalised: head x, y [N], head turn and joints [N m]
        ("command_torque", "f8", (MAX_LINKS,)),  # at the old command [N m]
        ("begun_torque", "f8", (MAX_LINKS,)),  # at the new command [N m]
        ("torque", "f8", (MAX_LINKS,)),  # with the passive joints, at the old command [N m]
        ("drive", "f8", (MAX_LINKS + 2,)),  # what Bullet is given: the load with the joint torques added
        ("response", "f8", (MAX_LINKS + 2, MAX_LINKS)),  # joint_response
        # The last step.
        ("step_rate", "f8", (MAX_LINKS + 2,)),  # velocity of head x, y, heading and joints in its middle
        ("impulse", "f8", (MAX_LINKS,)),  # of the joints' torques [N m s]
        ("place_before", "f8", (MAX_LINKS, 2)),  # of links, at its beginning [m]
        # Room to work in.
        ("gain", "f8", (MAX_LINKS + 2,)),  # of velocity in half a step by all but the joints' torques
        ("bias", "f8", (MAX_LINKS, 2)),
        ("excess", "f8", (2,)),
        ("momentum", "f8", (2,)),
        ("feed", "?"),
        ("guess", "f8", (MAX_LINKS,)),
        ("matrix", "f8", (MAX_LINKS + 2, MAX_LINKS + 2)),
    ]
)
Swimmer = NDArray[np.void]


def swimmer_at_rest(robot: Robot, medium: Fluid | FluidField, drives: Drives, dt: float) -> Swimmer:
    """The record of a robot that lies straight and at rest, the tip of its head at the origin."""
    swimmer = np.zeros(1, _RECORD)
    describe(swimmer[0], robot, drives)
    immerse(swimmer[0], medium)
    swimmer["dt"] = dt
    import os
    swimmer["feed"]="FEED" in os.environ
    swimmer["pose"][0, :4] = -robot.lengths[0] / 2, 0.0, 0.0, 1.0
    return swimmer


@njit(error_model="numpy")
def _observe(swimmer: Any, rows: FloatArray, k: int, command: FloatArray) -> bool:
    """Write row k from the pose read back and find the fluid's load; False when the state is not finite or too fast.

    `command` is that at the end of the last step.
    """
    n, dt, pose = swimmer.n_joints, swimmer.dt, swimmer.pose
    now, before = record_of(rows[k], n), record_of(rows[max(k - 1, 0)], n)
    turn = 2 * math.atan2(pose[2], pose[3]) - before.head[2]
    now.head[0], now.head[1] = pose[0], pose[1]
    now.head[2] = before.head[2] + turn - 2 * math.pi * np.rint(turn / (2 * math.pi))
    for j in range(n):
        now.joint_angle[j] = pose[4 + j]
    work = 0.0
    for i in range(n + 1):
        for a in range(2):
            work -= dt / 4 * swimmer.force[i, a] * swimmer.rate[i, a]
            swimmer.place_before[i, a] = swimmer.place[i, a]
    place_links(swimmer.length, now.head, now.joint_angle, swimmer.place)
    _find_rates(swimmer, now, before, command, k)
    fastest = 0.0
    for i in range(4):
        now.energy[i] = before.energy[i]
    for j in range(n):
        then, here, between = before.joint_rate[j], now.joint_rate[j], swimmer.step_rate[3 + j]
        first, last = dt / 4 * (then + between), dt / 4 * (between + here)
        begun, ended = swimmer.begun_torque[j] * first, swimmer.command_torque[j] * last
        now.energy[0] += begun + ended
        now.energy[1] += max(begun, 0.0) + max(ended, 0.0)
        now.energy[2] += swimmer.damping * (then * first + here * last)
        fastest = max(fastest, abs(here))
    now.energy[3] += work + _immerse(swimmer, now.head_rate, now.joint_rate, k * dt)
    total = 0.0
    for i in range(n + 1):
        total += swimmer.mass[i]
    for a in range(2):
        now.center[a] = now.center_rate[a] = 0.0
        for i in range(n + 1):
            now.center[a] += swimmer.mass_share[i] * swimmer.place[i, a]
            now.center_rate[a] += swimmer.mass_share[i] * swimmer.rate[i, a]
        if k > 0:
            swimmer.excess[a] = total * (now.center[a] - before.center[a]) / dt - swimmer.momentum[a]
        swimmer.momentum[a] += dt * swimmer.load[a]
    return math.hypot(now.center_rate[0], now.center_rate[1]) <= V_MAX and fastest <= JOINT_RATE_MAX


@njit(error_model="numpy")
def _find_rates(swimmer: Any, now: Any, before: Any, command: FloatArray, k: int) -> None:
    """Find the velocities at the end of the last step, and the joints' torques there at its command."""
    n, dt, step, gain = swimmer.n_joints, swimmer.dt, swimmer.step_rate, swimmer.gain
    matrix, response = swimmer.matrix, swimmer.response
    for a in range(3 + n):
        here, there = (now.head[a], before.head[a]) if a < 3 else (now.joint_angle[a - 3], before.joint_angle[a - 3])
        rate = (here - there) / dt
        gain[a] = (rate - step[a]) / 2
        for j in range(n):
            gain[a] -= response[a, j] * swimmer.impulse[j] / 2
        step[a] = rate
    joint_response(swimmer.length, swimmer.mass, swimmer.inertia, swimmer.place, n, matrix, response)
    damping = swimmer.damping + (swimmer.derivative_gain if swimmer.servo else 0.0)
    for i in range(n):
        for j in range(n):
            matrix[i, j] = dt / 4 * damping * response[3 + i, j] + (1.0 if i == j else 0.0)
    factorise(matrix, n)
    if k == 0:
        return
    _kick(swimmer, now, command, step[3:])
    for j in range(n):
        q = now.joint_angle[j]
        middle = (step[3 + j] + swimmer.guess[j]) / 2
        swimmer.command_torque[j] = command_torque(swimmer, command[j], q, middle)
        swimmer.torque[j] = applied_torque(swimmer, swimmer.command_torque[j], q, middle)
        now.joint_rate[j] = swimmer.guess[j]
    for a in range(3):
        now.head_rate[a] = step[a] + gain[a]
        for j in range(n):
            now.head_rate[a] += dt / 2 * response[a, j] * swimmer.torque[j]


@njit(error_model="numpy")
def _kick(swimmer: Any, now: Any, command: FloatArray, start: FloatArray) -> None:
    """Write the joints' rates half a step after `start` into `guess`: the trapezoidal rule for their damping."""
    n, dt = swimmer.n_joints, swimmer.dt
    guess = swimmer.guess
    for i in range(n):
        guess[i] = start[i] + swimmer.gain[3 + i]
    damping = swimmer.damping + (swimmer.derivative_gain if swimmer.servo else 0.0)
    for j in range(n):
        q = now.joint_angle[j]
        torque = applied_torque(swimmer, command_torque(swimmer, command[j], q, 0.0), q, 0.0) - damping * start[j] / 2
        for i in range(n):
            guess[i] += dt / 2 * swimmer.response[3 + i, j] * torque
    solve(swimmer.matrix, guess, n)


@njit(error_model="numpy")
def _immerse(swimmer: Any, head_rate: FloatArray, joint_rate: FloatArray, time: float) -> float:
    """Move the links and sum the fluid's forces on them from tail to head into `swimmer.load`.

    Returns the work [J] done on the fluid in the step just made, but for what its first forces do at their own rates.
    """
    place, rate, force, load = swimmer.place, swimmer.rate, swimmer.force, swimmer.load
    move_links(swimmer.length, place, head_rate, joint_rate, rate)
    fluid = medium_of(swimmer)
    work = force_x = force_y = moment = 0.0
    for i in range(swimmer.n_joints, -1, -1):
        length, cos, sin = swimmer.length[i], place[i, 3], place[i, 4]
        dx, dy = place[i, 0] - swimmer.place_before[i, 0], place[i, 1] - swimmer.place_before[i, 1]
        work -= (force[i, 0] * dx + force[i, 1] * dy) / 4
        v_t = rate[i, 0] * cos + rate[i, 1] * sin
        v_n = rate[i, 1] * cos - rate[i, 0] * sin
        a_n = (v_n - swimmer.v_n[i]) / swimmer.dt
        viscosity, density = fluid_at(fluid, time, place[i, 0])
        f_t = tangential_force(v_t, v_n, viscosity, density, length, swimmer.diameter)
        f_n = normal_force(v_n, viscosity, density, length, swimmer.diameter, swimmer.drag_multiple[i])
        f_n -= added_mass(density, length, swimmer.diameter) * (1.5 * a_n - 0.5 * swimmer.a_n[i])
        swimmer.v_n[i], swimmer.a_n[i] = v_n, a_n
        force[i, 0], force[i, 1] = f_t * cos - f_n * sin, f_t * sin + f_n * cos
        work -= (force[i, 0] * (dx + swimmer.dt * rate[i, 0]) + force[i, 1] * (dy + swimmer.dt * rate[i, 1])) / 4
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
    """Write the joint torques that a new command makes in row k; half the step's impulse is theirs, half the old one's."""
    n = swimmer.n_joints
    now = record_of(rows[k], n)
    swimmer.drive[:3] = swimmer.load[:3]
    for j in range(n):
        q, rate = now.joint_angle[j], now.joint_rate[j]
        now.command[j] = command[j]
        now.command_torque[j] = command_torque(swimmer, command[j], q, rate)
        now.torque[j] = applied_torque(swimmer, now.command_torque[j], q, rate)
    _kick(swimmer, now, command, now.joint_rate)
    for j in range(n):
        q, middle = now.joint_angle[j], (now.joint_rate[j] + swimmer.guess[j]) / 2
        swimmer.begun_torque[j] = command_torque(swimmer, command[j], q, middle)
        torque = (swimmer.torque[j] + applied_torque(swimmer, swimmer.begun_torque[j], q, middle)) / 2
        swimmer.impulse[j] = swimmer.dt * torque
        swimmer.drive[3 + j] = swimmer.load[3 + j] + torque
    _correct(swimmer, now)


@njit(error_model="numpy")
def _correct(swimmer: Any, now: Any) -> None:
    n, place, dt = swimmer.n_joints, swimmer.place, swimmer.dt
    turn, ahead = swimmer.step_rate[2], 0.0
    ahead = now.head_rate[2] + swimmer.gain[2]
    for j in range(n):
        ahead += swimmer.response[2, j] * (swimmer.impulse[j] - dt / 2 * swimmer.torque[j])
    bias = swimmer.bias
    bias[0, 0] = bias[0, 1] = 0.0
    before = swimmer.length[0] / 4 * (ahead**2 - turn**2)
    for i in range(1, n + 1):
        turn += swimmer.step_rate[2 + i]
        ahead += swimmer.guess[i - 1]
        here = swimmer.length[i] / 4 * (ahead**2 - turn**2)
        bias[i, 0] = bias[i - 1, 0] + before * place[i - 1, 3] + here * place[i, 3]
        bias[i, 1] = bias[i - 1, 1] + before * place[i - 1, 4] + here * place[i, 4]
        before = here
    total = 0.0
    for i in range(n + 1):
        total += swimmer.mass[i]
    feed_x = feed_y = 0.0
    if swimmer.feed:
        feed_x = -swimmer.excess[0] / dt / total
        feed_y = -swimmer.excess[1] / dt / total
    force_x = force_y = moment = 0.0
    for i in range(n, -1, -1):
        length, cos, sin = swimmer.length[i], place[i, 3], place[i, 4]
        moment -= length / 2 * (cos * force_y - sin * force_x)
        force_x += swimmer.mass[i] * (feed_x - bias[i, 0])
        force_y += swimmer.mass[i] * (feed_y - bias[i, 1])
        if i > 0:
            moment -= length / 2 * (cos * force_y - sin * force_x)
            swimmer.drive[2 + i] += moment
    swimmer.drive[0] += force_x
    swimmer.drive[1] += force_y
    swimmer.drive[2] += moment


SOURCES = ("engines/swimmer.py", *body.SOURCES)


def _entries(code: str) -> tuple[Any, Any, Any]:
    """The compiled functions that Python calls. numba keeps them on disk under a key that includes `code`.

    On its own it would compare only this file and reuse what was compiled from another force law.
    """

    @njit(cache=True)
    def begin(record: Swimmer, rows: FloatArray) -> bool:
        code  # noqa: B018
        return _observe(record[0], rows, 0, rows[0])

    @njit(cache=True)
    def command(record: Swimmer, rows: FloatArray, k: int, commands: FloatArray, i: int) -> None:
        code  # noqa: B018
        _actuate(record[0], rows, k, commands[i])

    @njit(cache=True)
    def react(record: Swimmer, rows: FloatArray, k: int, ended: FloatArray, begun: FloatArray, i: int) -> bool:
        code  # noqa: B018
        alive = _observe(record[0], rows, k, ended[i])
        _actuate(record[0], rows, k, begun[min(i + 1, len(begun) - 1)])
        return alive

    return begin, command, react


# begin(record, rows): observe the start, row 0.
# command(record, rows, k, commands, i): actuate by row i of `commands` for the step that follows row k.
# react(record, rows, k, ended, begun, i): observe row k, after step i, which ended by row i of `ended`, then actuate by the
# row of `begun` that follows, or its last; False once the run diverged.
begin, command, react = _entries(code_digest(*SOURCES))
