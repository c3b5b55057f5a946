"""The fluid force on one cylindrical link, written like the paper's equations (section "Environment setup").

All functions are pure, in SI units, and compiled. `v_t` and `v_n` are the velocity components of the link's centre
of mass along and across the link; forces have the same components and act at the centre of mass, without moment.
"""

import math
from typing import Any

from snakebench.compilation import njit

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
    """Force along a link per -v_t [kg/s]: pressure drag and viscous resistance (paper, f_F and f_R).

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
    """Force across a link per -v_n [kg/s]: pressure drag (paper, f_F).

    `shape` multiplies C_D: P_4 on the head, P_5 on the tail, or 1.
    """
    speed = abs(v_n)
    reynolds = speed * diameter / viscosity
    if reynolds < 1e-300:  # at rest, or so slow that C_D overflows: the force itself tends to zero
        return 0.0
    return 0.5 * shape * drag_coefficient(reynolds) * density * diameter * length * speed


@njit(inline="always")
def fluid_at(medium: Any, time: float, x: float) -> tuple[float, float]:
    """Kinematic viscosity [m^2/s] and density [kg/m^3] at a time [s] and a place x [m] of a `MEDIUM` record."""
    at = x if medium.along_x else time
    last = medium.n_knots - 1
    k = 0
    while k < last and at >= medium.knots[k + 1]:
        k += 1
    if k == last or not medium.ramp or at <= medium.knots[0]:
        return medium.viscosity[k], medium.density[k]
    share = (at - medium.knots[k]) / (medium.knots[k + 1] - medium.knots[k])
    viscosity = medium.viscosity[k] * (medium.viscosity[k + 1] / medium.viscosity[k]) ** share
    return viscosity, medium.density[k] + share * (medium.density[k + 1] - medium.density[k])
