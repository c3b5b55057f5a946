"""Equations of motion of the chain as CasADi expressions: what collocation must satisfy at every point (ours).

The same physics as the engines', derived once more: with B the distances along each link j from the centre of mass to
the centre of link i, link i moves at v_i = v + sum_j B_ij n_j w_j, where n_j is the vector across link j. Virtual work
gives one equation a coordinate. At zero velocity the force law has kinks, which an optimiser cannot pass: absolute
values are sqrt(v^2 + `smoothing`^2).
"""

import math
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from snakebench.physics import hydrodynamics as law
from snakebench.robot import Robot
from snakebench.value import FloatArray


class Motion(NamedTuple):
    """Symbols at one instant; coordinates are the links' angles, then the centre of mass where it is needed."""

    angle: Any  # of links [rad], (n_links,)
    rate: Any  # [rad/s] and of the centre of mass [m/s], (n_links + 2,)
    gain: Any  # their rates of change, (n_links + 2,)
    target: Any  # of joints [rad], (n_joints,)


class FluidSymbols(NamedTuple):
    """Symbols of the fluid."""

    viscosity: Any  # kinematic [m^2/s]
    density: Any  # [kg/m^3]
    smoothing: Any  # of absolute values of velocities [m/s]


def levers(robot: Robot) -> FloatArray:
    """B_ij [m], shape (n_links, n_links): link i's centre lies at the sum over j of B_ij times the unit vector of j."""
    n, half = robot.n_links, robot.link_lengths / 2
    behind = np.tril(np.tile(-2 * half, (n, 1)), -1) + np.diag(-half)
    behind[:, 0] += half[0]
    return behind - robot.link_masses @ behind / robot.total_mass


def command_torques(robot: Robot, motion: Motion) -> tuple[Any, Any]:
    """Command torques u_in [N m] of the servos and the joints' rates [rad/s], each (n_joints,)."""
    n = robot.n_links
    turn = ca.diff(motion.rate[:n])
    return robot.proportional_gain * (motion.target - ca.diff(motion.angle)) - robot.derivative_gain * turn, turn


def imbalance(robot: Robot, motion: Motion, fluid: FluidSymbols) -> Any:
    """Inertia less all forces, zero for a motion: moments on the links [N m], force on the body [N]; (n_links + 2,)."""
    n, b = robot.n_links, levers(robot)
    cos, sin, turn = ca.cos(motion.angle), ca.sin(motion.angle), motion.rate[:n]
    v_x, v_y = motion.rate[n] - b @ (sin * turn), motion.rate[n + 1] + b @ (cos * turn)
    a_x = motion.gain[n] - b @ (sin * motion.gain[:n] + cos * turn**2)
    a_y = motion.gain[n + 1] + b @ (cos * motion.gain[:n] - sin * turn**2)
    v_t, v_n = v_x * cos + v_y * sin, v_y * cos - v_x * sin
    f_t, f_n = _fluid_force(robot, fluid, v_t, v_n, a_y * cos - a_x * sin - turn * v_t)
    left_x = robot.link_masses * a_x - (f_t * cos - f_n * sin)
    left_y = robot.link_masses * a_y - (f_t * sin + f_n * cos)
    moments = robot.link_inertias * motion.gain[:n] + (b.T @ left_y) * cos - (b.T @ left_x) * sin
    u_in, _ = command_torques(robot, motion)
    torque = u_in - robot.joint_stiffness * ca.diff(motion.angle) - robot.joint_damping * ca.diff(turn)
    moments += ca.vertcat(torque, 0) - ca.vertcat(0, torque)
    return ca.vertcat(moments, ca.sum1(left_x), ca.sum1(left_y))


def _fluid_force(robot: Robot, fluid: FluidSymbols, v_t: Any, v_n: Any, gain_n: Any) -> tuple[Any, Any]:
    """Force along and across the links [N] at velocities [m/s] and the rate of change of v_n [m/s^2]."""
    viscosity, density, smoothing = fluid
    length, diameter = robot.link_lengths, robot.diameter
    along, across = (ca.sqrt(v**2 + smoothing**2) for v in (v_t, v_n))
    viscous = density * math.pi * diameter * ca.sqrt(viscosity * length)
    resistance_t = 0.5 * law.C_F * density * math.pi * diameter * length * along
    resistance_t += viscous * (law.C_MU * ca.sqrt(along) + law.C_NU * ca.sqrt(across))
    log = ca.log(across * diameter / viscosity) / law.LN_10
    coefficient = ca.exp(law.LN_10 * (law.P_1 * log**2 + law.P_2 * log + law.P_3))
    shape = np.array([law.P_4, *(1.0,) * (robot.n_links - 2), law.P_5])
    resistance_n = 0.5 * shape * coefficient * density * diameter * length * across
    added = math.pi * diameter**2 / 4 * law.C_A * density * length
    return -resistance_t * v_t, -resistance_n * v_n - added * gain_n
