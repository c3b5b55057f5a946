"""A robot in its medium as one record for compiled code: what both engines share."""

from __future__ import annotations

from typing import Any

from snakebench.compilation import njit
from snakebench.fluid import MAX_KNOTS, Fluid, FluidField, FluidTable, fluid_table
from snakebench.physics.hydrodynamics import P_4, P_5
from snakebench.physics.joints import JOINT_LAW, Drives, write_joint_law
from snakebench.robot import MAX_LINKS, Robot

# Compiled code is handed one record instead of many arrays; to the type checker it is `Any`.
# Fields per link use their first places only.
BODY = [
    ("n_joints", "i8"),
    *JOINT_LAW,
    # The links.
    ("diameter", "f8"),  # [m]
    ("length", "f8", (MAX_LINKS,)),  # [m]
    ("mass", "f8", (MAX_LINKS,)),  # [kg]
    ("mass_share", "f8", (MAX_LINKS,)),  # of the total mass
    ("inertia", "f8", (MAX_LINKS,)),  # across the axis [kg m^2]
    ("drag_multiple", "f8", (MAX_LINKS,)),  # of the normal drag coefficient
    # The medium: a FluidTable.
    ("along_x", "?"),
    ("ramp", "?"),
    ("n_knots", "i8"),
    ("knots", "f8", (MAX_KNOTS,)),
    ("viscosity", "f8", (MAX_KNOTS,)),
    ("density", "f8", (MAX_KNOTS,)),
]


def describe(body: Any, robot: Robot, drives: Drives) -> None:
    """Write a robot and its joints' law into the record `body`."""
    n = robot.n_links
    body["n_joints"], body["diameter"] = robot.n_joints, robot.diameter
    write_joint_law(body, robot, drives)
    body["length"][:n], body["mass"][:n], body["inertia"][:n] = robot.lengths, robot.link_masses, robot.link_inertias
    body["mass_share"][:n] = robot.link_masses / robot.total_mass
    body["drag_multiple"][:n] = [P_4, *(1.0,) * (n - 2), P_5]


def immerse(body: Any, medium: Fluid | FluidField) -> None:
    """Write a medium into the record `body`."""
    table = fluid_table(medium)
    m = len(table.knots)
    body["along_x"], body["ramp"], body["n_knots"] = table.along_x, table.ramp, m
    body["knots"][:m], body["viscosity"][:m], body["density"][:m] = table.knots, table.viscosity, table.density


@njit(inline="always")
def medium_of(body: Any) -> FluidTable:
    """The medium of a body."""
    m = body.n_knots
    return FluidTable(body.along_x, body.ramp, body.knots[:m], body.viscosity[:m], body.density[:m])
