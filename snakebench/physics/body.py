"""A robot in its medium as one record for compiled code: what both engines share."""

from typing import Any

import numpy as np

from snakebench.fluid import MAX_KNOTS, FluidField, Medium
from snakebench.physics.hydrodynamics import P_4, P_5, fluid_at
from snakebench.physics.joints import JOINT_LAW, Drives, write_joint_law
from snakebench.robot import MAX_LINKS, Robot

# Compiled code is handed one record instead of many arrays; to the type checker it is `Any`.
# Fields per link and per knot use their first places only.
MEDIUM = [
    ("along_x", "?"),  # not along time
    ("ramp", "?"),  # between knots, not steps
    ("n_knots", "i8"),
    ("knots", "f8", (MAX_KNOTS,)),  # [s or m]
    ("viscosity", "f8", (MAX_KNOTS,)),  # kinematic [m^2/s]
    ("density", "f8", (MAX_KNOTS,)),  # [kg/m^3]
]
BODY = [
    ("n_joints", "i8"),
    *JOINT_LAW,
    ("diameter", "f8"),  # [m]
    ("length", "f8", (MAX_LINKS,)),  # [m]
    ("mass", "f8", (MAX_LINKS,)),  # [kg]
    ("mass_share", "f8", (MAX_LINKS,)),  # of the total mass
    ("inertia", "f8", (MAX_LINKS,)),  # across the axis [kg m^2]
    ("drag_multiple", "f8", (MAX_LINKS,)),  # of the normal drag coefficient
    *MEDIUM,
]


def describe(body: Any, robot: Robot, drives: Drives) -> None:
    """Write a robot and its joints' law into the record `body`."""
    n = robot.n_links
    body["n_joints"], body["diameter"] = robot.n_joints, robot.diameter
    write_joint_law(body, robot, drives)
    body["length"][:n], body["mass"][:n], body["inertia"][:n] = robot.lengths, robot.link_masses, robot.link_inertias
    body["mass_share"][:n] = robot.link_masses / robot.total_mass
    body["drag_multiple"][:n] = [P_4, *(1.0,) * (n - 2), P_5]


def immerse(body: Any, medium: Medium) -> None:
    """Write a medium into the record `body`; a homogeneous fluid is a field with one knot."""
    field = medium if isinstance(medium, FluidField) else FluidField(along="time", knots=(0.0,), fluids=(medium,))
    m = len(field.knots)
    body["along_x"], body["ramp"], body["n_knots"] = field.along == "x", field.between == "ramp", m
    body["knots"][:m] = field.knots
    body["viscosity"][:m] = [fluid.kinematic_viscosity for fluid in field.fluids]
    body["density"][:m] = [fluid.density for fluid in field.fluids]


def viscosity_at(medium: Medium, time: float, x: float) -> float:
    """Kinematic viscosity [m^2/s] of a medium at a time [s] and a place x [m]."""
    record = np.recarray(1, MEDIUM)[0]
    immerse(record, medium)
    return float(fluid_at.py_func(record, time, x)[0])
