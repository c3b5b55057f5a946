"""Equations of motion of a planar chain of links in a fluid, by its mass matrix (ours; forces from the paper).

Coordinates are the centre of mass (x, y) and the links' absolute angles, `place` and `rate` of shape (n_links + 2,).
With the centre of mass as a coordinate every integrator of these equations conserves linear momentum exactly: held
targets make the joints jump, and with the head's position instead a learner could swim on the integrator's error.

The velocity of link i's centre is v_i = v_head - sum_j b_ij n_j w_j, with w_j the links' angular rates, n_j the
vector across link j and b_ij the distance along link j between the head's centre and link i's centre. The head's
centre lies ahead of the centre of mass by the sum of `lever` j times the unit vector along link j.

Added mass is part of the mass matrix: f = -c_a d(v_n)/dt, with d(v_n)/dt = n.a - w v_t, acts at the link's centre.
"""

import math
from typing import Any

import numpy as np

from snakebench.compilation import njit
from snakebench.physics.algebra import factorise, solve
from snakebench.physics.body import BODY, describe
from snakebench.physics.hydrodynamics import added_mass, fluid_at, normal_resistance, tangential_resistance
from snakebench.physics.joints import Drives, applied_torque, command_torque, slopes
from snakebench.robot import MAX_LINKS, Robot
from snakebench.value import FloatArray

CHAIN = np.dtype(
    [
        *BODY,
        ("front", "f8", (MAX_LINKS,)),  # from a link's front joint to its centre [m]; none on the head
        ("rear", "f8", (MAX_LINKS,)),  # from a link's centre to its rear joint [m]
        ("lever", "f8", (MAX_LINKS,)),  # mean over the robot's mass of b_ij [m]
    ]
)


def describe_chain(chain: Any, robot: Robot, drives: Drives) -> None:
    """Write a robot and its joints' law into the record `chain`."""
    describe(chain, robot, drives)
    n, share = robot.n_links, robot.link_masses / robot.total_mass
    rear = robot.link_lengths / 2
    front = np.concatenate([[0.0], rear[1:]])
    behind = share.sum() - np.cumsum(share)  # the share of mass behind each link
    chain["front"][:n], chain["rear"][:n] = front, rear
    chain["lever"][:n] = front * share + (front + rear) * behind


# Products may be contracted into fused multiply-adds: one rounding instead of two.
compiled = njit(error_model="numpy", fastmath={"contract"})

# Room for one evaluation of the equations of motion; what `accelerate` leaves there, `spend` reads.
SCRATCH = np.dtype(
    [
        ("axis", "f8", (MAX_LINKS, 2)),  # cosine and sine of each link's angle
        ("resistance", "f8", (MAX_LINKS, 3)),  # along and across [kg/s] and added mass [kg]
        ("x", "f8", (MAX_LINKS,)),  # of each link's centre [m]
        # Along and across each link, at its centre:
        ("velocity", "f8", (MAX_LINKS, 2)),  # [m/s]
        ("start_velocity", "f8", (MAX_LINKS, 2)),  # the start's rates at the present place [m/s]
        ("drift", "f8", (MAX_LINKS, 2)),  # acceleration while no coordinate accelerates [m/s^2]
        ("inertia", "f8", (MAX_LINKS, 3)),  # xx, xy, yy of a link's mass, added mass and anticipated drag [kg]
        ("force", "f8", (MAX_LINKS, 2)),  # on a link's centre, inertial forces included [N]
        ("matrix", "f8", (MAX_LINKS + 2, MAX_LINKS + 2)),  # mass matrix, lower half
        ("acceleration", "f8", (MAX_LINKS + 2,)),  # of the coordinates; until solved, the generalised force
        ("power", "f8", (4,)),  # command power, its positive part, power into joint dampers and into the fluid [W]
    ]
)


@compiled
def accelerate(
    chain: Any,
    time: float,
    place: FloatArray,
    rate: FloatArray,
    start: FloatArray,
    start_rate: FloatArray,
    ahead: float,
    command: FloatArray,
    s: Any,
) -> None:
    """Write into `s.acceleration` the acceleration at `place` that carries the chain from its start on.

    Drag and the joints' law are linearised at (place, rate) and taken at the velocity and angles which a constant
    acceleration reaches after `ahead` seconds from (start, start_rate). With `ahead` = 0 and the start at
    (place, rate) this is the plain derivative; with half a step it is the implicit midpoint rule, solved for its
    stiff terms. Drag is its coefficient at `rate` times velocity, so it brakes for any step.
    """
    n = chain.n_joints + 1
    _move(chain, place, rate, start_rate, s)
    _press(chain, time, rate, ahead, s)
    _assemble(chain, s)
    out, matrix = s.acceleration, s.matrix
    for j in range(n - 1):
        angle, turn = place[3 + j] - place[2 + j], rate[3 + j] - rate[2 + j]
        u_in = command_torque(chain, command[j], angle, turn)
        stiffness, damping = slopes(chain, u_in, angle, turn)
        at_rest = applied_torque(chain, u_in, angle, turn) + stiffness * angle + damping * turn
        angle_0, turn_0 = start[3 + j] - start[2 + j], start_rate[3 + j] - start_rate[2 + j]
        torque = at_rest - stiffness * (angle_0 + ahead * turn_0) - damping * turn_0
        out[2 + j] -= torque
        out[3 + j] += torque
        resisted = ahead * (damping + ahead * stiffness)
        matrix[2 + j, 2 + j] += resisted
        matrix[3 + j, 3 + j] += resisted
        matrix[3 + j, 2 + j] -= resisted
    factorise(matrix, n + 2)
    solve(matrix, out, n + 2)
    for i in range(n):  # from the head's centre to the centre of mass
        out[0] += chain.lever[i] * s.axis[i, 1] * out[2 + i]
        out[1] -= chain.lever[i] * s.axis[i, 0] * out[2 + i]


@compiled
def _move(chain: Any, place: FloatArray, rate: FloatArray, start_rate: FloatArray, s: Any) -> None:
    """Find each link's place, its velocity at both rates, and its drift, from head to tail."""
    n = chain.n_joints + 1
    x, v_x, v_y, u_x, u_y, b_x, b_y = place[0], rate[0], rate[1], start_rate[0], start_rate[1], 0.0, 0.0
    for i in range(n):
        cos, sin, lever = math.cos(place[2 + i]), math.sin(place[2 + i]), chain.lever[i]
        s.axis[i, 0], s.axis[i, 1] = cos, sin
        turn, turn_0, whirl = lever * rate[2 + i], lever * start_rate[2 + i], lever * rate[2 + i] ** 2
        x += lever * cos
        v_x, v_y = v_x - turn * sin, v_y + turn * cos
        u_x, u_y = u_x - turn_0 * sin, u_y + turn_0 * cos
        b_x, b_y = b_x - whirl * cos, b_y - whirl * sin
    for i in range(n):
        cos, sin, w, w_0 = s.axis[i, 0], s.axis[i, 1], rate[2 + i], start_rate[2 + i]
        front, rear = chain.front[i], chain.rear[i]
        x -= front * cos
        v_x, v_y = v_x + front * w * sin, v_y - front * w * cos
        u_x, u_y = u_x + front * w_0 * sin, u_y - front * w_0 * cos
        b_x, b_y = b_x + front * w * w * cos, b_y + front * w * w * sin
        s.x[i] = x
        s.velocity[i, 0], s.velocity[i, 1] = v_x * cos + v_y * sin, v_y * cos - v_x * sin
        s.start_velocity[i, 0], s.start_velocity[i, 1] = u_x * cos + u_y * sin, u_y * cos - u_x * sin
        s.drift[i, 0], s.drift[i, 1] = b_x * cos + b_y * sin, b_y * cos - b_x * sin
        x -= rear * cos
        v_x, v_y = v_x + rear * w * sin, v_y - rear * w * cos
        u_x, u_y = u_x + rear * w_0 * sin, u_y - rear * w_0 * cos
        b_x, b_y = b_x + rear * w * w * cos, b_y + rear * w * w * sin


@compiled
def _press(chain: Any, time: float, rate: FloatArray, ahead: float, s: Any) -> None:
    """Find each link's force and inertia."""
    for i in range(chain.n_joints + 1):
        viscosity, density = fluid_at(chain, time, s.x[i])
        v_t, v_n, length, diameter = s.velocity[i, 0], s.velocity[i, 1], chain.length[i], chain.diameter
        s.resistance[i, 0] = tangential_resistance(v_t, v_n, viscosity, density, length, diameter)
        s.resistance[i, 1] = normal_resistance(v_n, viscosity, density, length, diameter, chain.drag_multiple[i])
        s.resistance[i, 2] = added_mass(density, length, diameter)
    for i in range(chain.n_joints + 1):
        cos, sin, mass = s.axis[i, 0], s.axis[i, 1], chain.mass[i]
        along, across, carried = s.resistance[i, 0], s.resistance[i, 1], s.resistance[i, 2]
        m_t, m_n = mass + ahead * along, mass + carried + ahead * across
        s.inertia[i, 0] = m_t * cos * cos + m_n * sin * sin
        s.inertia[i, 1] = (m_t - m_n) * cos * sin
        s.inertia[i, 2] = m_t * sin * sin + m_n * cos * cos
        f_t = -along * s.start_velocity[i, 0] - mass * s.drift[i, 0]
        f_n = carried * (rate[2 + i] * s.velocity[i, 0] - s.drift[i, 1]) - across * s.start_velocity[i, 1]
        f_n -= mass * s.drift[i, 1]
        s.force[i, 0], s.force[i, 1] = f_t * cos - f_n * sin, f_t * sin + f_n * cos


@compiled
def _assemble(chain: Any, s: Any) -> None:
    """Sum the links' inertias and forces, from tail to head, into the mass matrix and the generalised force.

    Both are those of the head's centre and the links' angles, in which they are simplest; `accelerate` takes the
    solution to the centre of mass. All links behind j share its distance b = front + rear, so each entry of the matrix
    is one product.
    """
    matrix, out = s.matrix, s.acceleration
    xx = xy = yy = f_x = f_y = 0.0  # of all links behind
    for i in range(chain.n_joints, -1, -1):
        cos, sin, own, whole = s.axis[i, 0], s.axis[i, 1], chain.front[i], chain.front[i] + chain.rear[i]
        own_x, own_y = s.inertia[i, 1] * cos - s.inertia[i, 0] * sin, s.inertia[i, 2] * cos - s.inertia[i, 1] * sin
        all_x, all_y = xy * cos - xx * sin, yy * cos - xy * sin
        p_x, p_y = own * own_x + whole * all_x, own * own_y + whole * all_y
        matrix[2 + i, 0], matrix[2 + i, 1] = -p_x, -p_y
        for j in range(i):
            matrix[2 + i, 2 + j] = (chain.front[j] + chain.rear[j]) * (s.axis[j, 0] * p_y - s.axis[j, 1] * p_x)
        turned = own * own * (cos * own_y - sin * own_x) + whole * whole * (cos * all_y - sin * all_x)
        matrix[2 + i, 2 + i] = chain.inertia[i] + turned
        g_x, g_y = own * s.force[i, 0] + whole * f_x, own * s.force[i, 1] + whole * f_y
        out[2 + i] = sin * g_x - cos * g_y
        xx, xy, yy = xx + s.inertia[i, 0], xy + s.inertia[i, 1], yy + s.inertia[i, 2]
        f_x, f_y = f_x + s.force[i, 0], f_y + s.force[i, 1]
    matrix[0, 0], matrix[1, 0], matrix[1, 1] = xx, xy, yy
    out[0], out[1] = f_x, f_y


@compiled
def spend(chain: Any, place: FloatArray, rate: FloatArray, command: FloatArray, s: Any) -> None:
    """Write into `s.power` where energy goes while `s.acceleration`, just found, acts at (place, rate).

    Power into the fluid is drag and added mass together, as the force times the velocity of each link's centre.
    """
    n, a, power = chain.n_joints + 1, s.acceleration, s.power
    power[:] = 0.0
    for j in range(n - 1):
        angle, turn = place[3 + j] - place[2 + j], rate[3 + j] - rate[2 + j]
        driving = command_torque(chain, command[j], angle, turn) * turn
        power[0] += driving
        power[1] += max(driving, 0.0)
        power[2] += chain.damping * turn * turn
    v_x, v_y, a_x, a_y = rate[0], rate[1], a[0], a[1]
    for i in range(n):
        cos, sin, lever = s.axis[i, 0], s.axis[i, 1], chain.lever[i]
        v_x, v_y = v_x - lever * rate[2 + i] * sin, v_y + lever * rate[2 + i] * cos
        a_x, a_y = a_x - lever * a[2 + i] * sin, a_y + lever * a[2 + i] * cos
    for i in range(n):
        cos, sin, w, front, rear = s.axis[i, 0], s.axis[i, 1], rate[2 + i], chain.front[i], chain.rear[i]
        v_x, v_y = v_x + front * w * sin, v_y - front * w * cos
        a_x, a_y = a_x + front * a[2 + i] * sin, a_y - front * a[2 + i] * cos
        v_t, v_n = v_x * cos + v_y * sin, v_y * cos - v_x * sin
        gain = a_y * cos - a_x * sin + s.drift[i, 1] - w * v_t  # d(v_n)/dt
        power[3] += s.resistance[i, 0] * v_t * v_t + s.resistance[i, 1] * v_n * v_n + s.resistance[i, 2] * v_n * gain
        v_x, v_y = v_x + rear * w * sin, v_y - rear * w * cos
        a_x, a_y = a_x + rear * a[2 + i] * sin, a_y - rear * a[2 + i] * cos
