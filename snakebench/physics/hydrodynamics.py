"""The fluid force on one cylindrical link, written like the paper's equations (section "Environment setup").

All functions are pure, in SI units, and compiled. `v_t` and `v_n` are the velocity components of the link's centre
of mass along and across the link; forces have the same components and act at the centre of mass, without moment.
"""

from __future__ import annotations

import math

from snakebench.compilation import njit
from snakebench.fluid import FluidTable, Medium, fluid_table

# Dimensionless parameters (paper, table of dimensionless parameters for the fluid force model).
C_A = 0.011514  # added mass
C_F = 0.022556  # tangential pressure drag
C_MU = 0.31584  # viscous drag on a link
C_NU = 1.0612  # viscous drag due to boundary layer compression
P_1, P_2, P_3 = 0.039276, -0.43683, 0.91538  # log-quadratic fit of the normal drag coefficient
C_1, C_2 = 1.36759, 2.72646e3  # Lamb form of the normal drag coefficient
P_4, P_5 = 2.9302, 2.8501  # head and tail multiples of the normal drag coefficient
LN_10 = math.log(10.0)
EULER_GAMMA = 0.57722  # as printed in the paper
LAMB_REYNOLDS = 1e-6  # the Lamb form holds below this Reynolds number


@njit(inline="always")
def drag_coefficient(reynolds: float) -> float:
    """C_D of a smooth cylinder in cross flow, at Reynolds number abs(v_n) d/nu > 0 (paper, C_D fit and Lamb form)."""
    if reynolds < LAMB_REYNOLDS:
        return C_1 / (reynolds * (0.5 - EULER_GAMMA - math.log(reynolds / 8))) + C_2
    log = math.log10(reynolds)
    return math.exp(LN_10 * (P_1 * log * log + P_2 * log + P_3))


@njit(inline="always")
def added_mass(density: float, length: float, diameter: float) -> float:
    """Added mass c_a of a link for motion across it [kg] (paper, dimensionless coefficients)."""
    return math.pi * diameter**2 / 4 * C_A * density * length


@njit(inline="always")
def tangential_resistance(
    v_t: float, v_n: float, viscosity: float, density: float, length: float, diameter: float
) -> float:
    """Force along a link per v_t [kg/s]: pressure drag and viscous resistance (paper, f_F and f_R).

    Not smooth at rest, on purpose.
    """
    c_f = 0.5 * C_F * density * math.pi * diameter * length  # [kg/m]
    c_v = density * math.pi * diameter * math.sqrt(viscosity * length)  # c_mu / C_mu = c_nu / C_nu [kg m^-1/2 s^-1/2]
    pressure = c_f * abs(v_t)
    viscous = c_v * (C_MU * math.sqrt(abs(v_t)) + C_NU * math.sqrt(abs(v_n)))
    return pressure + viscous


@njit(inline="always")
def normal_resistance(
    v_n: float, viscosity: float, density: float, length: float, diameter: float, shape: float
) -> float:
    """Force across a link per v_n [kg/s]: pressure drag (paper, f_F).

    `shape` multiplies C_D: P_4 on the head, P_5 on the tail, or 1.
    """
    speed = abs(v_n)
    reynolds = speed * diameter / viscosity
    if reynolds < 1e-300:  # at rest, or so slow that C_D overflows: the force itself tends to zero
        return 0.0
    return 0.5 * shape * drag_coefficient(reynolds) * density * diameter * length * speed


@njit(inline="always")
def tangential_force(v_t: float, v_n: float, viscosity: float, density: float, length: float, diameter: float) -> float:
    """Pressure drag and viscous resistance along a link [N]: `tangential_resistance` against v_t."""
    return -tangential_resistance(v_t, v_n, viscosity, density, length, diameter) * v_t


@njit(inline="always")
def normal_force(v_n: float, viscosity: float, density: float, length: float, diameter: float, shape: float) -> float:
    """Pressure drag across a link [N]: `normal_resistance` against v_n."""
    return -normal_resistance(v_n, viscosity, density, length, diameter, shape) * v_n


@njit(inline="always")
def fluid_at(table: FluidTable, time: float, x: float) -> tuple[float, float]:
    """Kinematic viscosity [m^2/s] and density [kg/m^3] of a medium at a time [s] and a place x [m]."""
    at = x if table.along_x else time
    last = len(table.knots) - 1
    k = 0
    while k < last and at >= table.knots[k + 1]:
        k += 1
    if k == last or not table.ramp or at <= table.knots[0]:
        return table.viscosity[k], table.density[k]
    share = (at - table.knots[k]) / (table.knots[k + 1] - table.knots[k])
    viscosity = table.viscosity[k] * (table.viscosity[k + 1] / table.viscosity[k]) ** share
    return viscosity, table.density[k] + share * (table.density[k + 1] - table.density[k])


def viscosity_at(medium: Medium, time: float, x: float) -> float:
    """Kinematic viscosity [m^2/s] of a medium at a time [s] and a place x [m]."""
    return fluid_at.py_func(fluid_table(medium), time, x)[0]
