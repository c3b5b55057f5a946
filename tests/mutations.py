"""Constants of the physics, each a few per cent wrong: tests must notice, and keys must change."""

from __future__ import annotations

from typing import NamedTuple


class Mutation(NamedTuple):
    """One changed number."""

    file: str
    right: str
    wrong: str


MUTATIONS = {
    "added mass": Mutation("physics/hydrodynamics.py", "C_A = 0.011514", "C_A = 0.012"),
    "tangential pressure drag": Mutation("physics/hydrodynamics.py", "C_F = 0.022556", "C_F = 0.0237"),
    "viscous drag": Mutation("physics/hydrodynamics.py", "C_MU = 0.31584", "C_MU = 0.325"),
    "boundary layer": Mutation("physics/hydrodynamics.py", "C_NU = 1.0612", "C_NU = 1.1"),
    "drag fit, curvature": Mutation("physics/hydrodynamics.py", "= 0.039276, -0.43683", "= 0.0405, -0.43683"),
    "drag fit, slope": Mutation("physics/hydrodynamics.py", "-0.43683, 0.91538", "-0.4500, 0.91538"),
    "Lamb form": Mutation("physics/hydrodynamics.py", "C_1, C_2 = 1.36759", "C_1, C_2 = 1.42"),
    "head shape": Mutation("physics/hydrodynamics.py", "P_4, P_5 = 2.9302, 2.8501", "P_4, P_5 = 3.0, 2.8501"),
    "tail shape": Mutation("physics/hydrodynamics.py", "P_4, P_5 = 2.9302, 2.8501", "P_4, P_5 = 2.9302, 2.95"),
    "friction exponent": Mutation("physics/hydrodynamics.py", "C_MU * math.sqrt(abs(v_t))", "C_MU * abs(v_t) ** 0.52"),
    "inertia of a thick link": Mutation("robot.py", "(3 * (self.diameter / 2)", "(3.3 * (self.diameter / 2)"),
    "inertia of a long link": Mutation("robot.py", "self.link_lengths**2) / 12", "self.link_lengths**2) / 12.5"),
    "cover mass": Mutation("robot.py", "_COVER_MASS = 0.542", "_COVER_MASS = 0.57"),
    "proportional gain": Mutation("robot.py", "Field(4.0", "Field(4.2"),
    "derivative gain": Mutation("robot.py", "Field(0.3,", "Field(0.32,"),
    "joint stiffness": Mutation("robot.py", "Field(0.1 / DEGREE", "Field(0.105 / DEGREE"),
    "joint damping": Mutation("robot.py", "Field(5e-5 / DEGREE", "Field(5.4e-5 / DEGREE"),
    "density of an oil": Mutation("fluid.py", '"oil1": 874.0', '"oil1": 900.0'),
    "viscosity of an oil": Mutation("fluid.py", "15: 2.32e-4", "15: 2.40e-4"),
    "weight of speed": Mutation("reward.py", "propulsion: float = 10.0", "propulsion: float = 10.5"),
    "weight of torque": Mutation("reward.py", "torque_rate: float = -0.02", "torque_rate: float = -0.021"),
    "gravity": Mutation("metrics.py", "GRAVITY = 9.80665", "GRAVITY = 9.9"),
    "Runge-Kutta weights": Mutation("physics/stepping.py", "dt / 6 if", "dt / 6.2 if"),
}
