"""The robot: a planar chain of rigid cylindrical links with passive, servo-driven joints."""

from functools import cached_property
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from snakebench.errors import InvalidValue
from snakebench.files import read_object, readable_file
from snakebench.registry import Registry, instance_of
from snakebench.value import FloatArray, Positive, Value, within

MAX_LINKS = 64  # enough for any robot we know of; bounds the records handed to compiled code
DEGREE = np.pi / 180  # [rad]

# What a robot may be made of, from less than millimetres to tens of metres: what is computed of it stays finite.
Size = Annotated[float, Field(strict=True), within(1e-4, 1e2)]  # [m]
Mass = Annotated[float, Field(strict=True), within(1e-9, 1e6)]  # [kg]
Gain = Annotated[float, Field(strict=True), within(0, 1e6)]  # [N m/rad or N m s/rad]
Speed = Annotated[float, Field(strict=True), within(1e-3, 1e6)]  # [rad/s]

_LENGTHS = (0.280, *(0.148,) * 6, 0.322)  # of the paper's robot [m]
_MASSES = (0.991, *(0.462,) * 6, 1.194)  # of its links [kg]
_COVER_MASS = 0.542  # of its cover [kg]


class Robot(Value):
    """A swimming snake robot; link 1 is the head, joint i lies between links i and i + 1.

    The defaults are the robot of the paper (table "Specification of the snake-like robot") with the
    joint stiffness, joint damping and servo gains of its section on action parameters. The diameter is ours:
    the paper gives none, and neutral buoyancy in water would need 0.0686 m. A robot of your own lengths or masses has
    no cover unless you give its mass.

    Raises:
        InvalidValue: when a field is out of range, there are not as many masses as lengths, or there is a speed limit
            without a torque limit.

    Example:
        >>> sb.Robot(lengths=(0.2, 0.2, 0.2), masses=(0.5, 0.5, 0.5), diameter=0.06).total_mass
        1.5
    """

    lengths: tuple[Size, ...] = Field(
        _LENGTHS, min_length=2, max_length=MAX_LINKS, description="link lengths, head first [m]"
    )
    masses: tuple[Mass, ...] = Field(_MASSES, description="link masses without the cover, head first [kg]")
    cover_mass: Annotated[float, Field(strict=True), within(0, 1e6)] = Field(
        default_factory=lambda links: (
            _COVER_MASS if (links.get("lengths"), links.get("masses")) == (_LENGTHS, _MASSES) else 0.0
        ),
        description="waterproof cover, spread in proportion to length [kg]; 0.542 by default with the paper's lengths"
        " and masses, 0 with others",
    )
    diameter: Size = Field(0.10, description="link diameter [m]")
    joint_stiffness: Gain = Field(0.1 / DEGREE, description="torsion spring of the cover [N m/rad]")
    joint_damping: Gain = Field(5e-5 / DEGREE, description="torsion damper of the cover [N m s/rad]")
    proportional_gain: Gain = Field(4.0, description="servo gain K_p [N m/rad]")
    derivative_gain: Gain = Field(0.3, description="servo gain K_d [N m s/rad]")
    torque_limit: Positive | None = Field(None, description="bound on the command torque [N m]; none by default")
    speed_limit: Speed | None = Field(
        None, description="no-load speed, where a servo of that bound drives no more [rad/s]; none by default"
    )
    angle_limit: Positive | None = Field(None, description="joint angle where an elastic end stop begins [rad]")
    stop_stiffness: Annotated[float, Field(strict=True), within(1e-9, 1e6)] = Field(
        100.0, description="stiffness of that end stop [N m/rad]"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(self.masses) != len(self.lengths):
            raise ValueError(f"{len(self.masses)} masses for {len(self.lengths)} lengths: one mass per link is needed")
        if self.speed_limit is not None and self.torque_limit is None:
            raise ValueError(f"speed_limit = {self.speed_limit:g} needs a torque_limit, from which torque falls to 0")
        return self

    @classmethod
    def with_joints(cls, joints: int, diameter: float = 0.10) -> Self:
        """The paper's robot cut into `joints` + 1 links of the same total length and mass.

        Head and tail stay as they are; the middle's length and mass are shared equally by the other links.

        Raises:
            InvalidValue: for fewer than 2 joints or more than `MAX_LINKS` links.
        """
        if type(joints) is not int or not 2 <= joints < MAX_LINKS:
            raise InvalidValue(f"Robot: {joints} joints: allowed are 2 to {MAX_LINKS - 1}")

        def cut(links: tuple[float, ...]) -> tuple[float, ...]:
            return (links[0], *(6 * links[1] / (joints - 1),) * (joints - 1), links[-1])

        return cls(lengths=cut(_LENGTHS), masses=cut(_MASSES), cover_mass=_COVER_MASS, diameter=diameter)

    @property
    def n_links(self) -> int:
        """Number of links."""
        return len(self.lengths)

    @property
    def n_joints(self) -> int:
        """Number of joints, one fewer than links."""
        return len(self.lengths) - 1

    @cached_property
    def link_lengths(self) -> FloatArray:
        """Link lengths [m], shape (n_links,)."""
        return _constant(np.array(self.lengths))

    @cached_property
    def link_masses(self) -> FloatArray:
        """Link masses with their share of the cover [kg], shape (n_links,)."""
        share = self.link_lengths / self.link_lengths.sum()
        return _constant(np.array(self.masses) + self.cover_mass * share)

    @cached_property
    def link_inertias(self) -> FloatArray:
        """Inertia of each link across its axis, about its centre [kg m^2], shape (n_links,), as of a solid cylinder."""
        return _constant(self.link_masses * (3 * (self.diameter / 2) ** 2 + self.link_lengths**2) / 12)

    @cached_property
    def axial_inertias(self) -> FloatArray:
        """Inertia of each link about its axis [kg m^2], shape (n_links,), as of a solid cylinder."""
        return _constant(self.link_masses * (self.diameter / 2) ** 2 / 2)

    @property
    def total_mass(self) -> float:
        """Mass of links and cover [kg]."""
        return float(self.link_masses.sum())

    def neutral_diameter(self, density: float) -> float:
        """The diameter [m] at which the robot displaces its own mass of a fluid of `density` [kg/m^3]."""
        return float(np.sqrt(4 * self.total_mass / (np.pi * density * self.link_lengths.sum())))

    @property
    def torque_fall(self) -> float:
        """How fast a servo's torque falls with its speed [N m s/rad], zero without a speed limit."""
        return 0.0 if self.torque_limit is None or self.speed_limit is None else self.torque_limit / self.speed_limit

    def stiffness(self, drives: str) -> float:
        """Stiffest restoring rate of a joint [N m/rad] under a gait that drives "angle" or "torque"."""
        servo = self.proportional_gain if drives == "angle" else 0.0
        return self.joint_stiffness + servo + (0.0 if self.angle_limit is None else self.stop_stiffness)

    def damping(self, drives: str) -> float:
        """Highest damping of a joint [N m s/rad] under a gait that drives "angle" or "torque".

        To that of the cover comes either the servo's or, at its bound, the fall of torque with speed, never both.
        """
        return self.joint_damping + max(self.derivative_gain if drives == "angle" else 0.0, self.torque_fall)

    def urdf(self) -> str:
        """The robot as URDF text: explicit inertias, no shapes, joints about z, link frames at the front joints.

        The head's frame lies at its centre of mass, so that the base pose is the head's pose.
        """
        links = [
            f'<link name="link{i + 1}"><inertial><origin xyz="{0.0 if i == 0 else -length / 2!r} 0 0"/>'
            f'<mass value="{mass!r}"/><inertia ixx="{axial!r}" iyy="{across!r}" izz="{across!r}"'
            ' ixy="0" ixz="0" iyz="0"/></inertial></link>'
            for i, (length, mass, axial, across) in enumerate(
                np.stack([self.link_lengths, self.link_masses, self.axial_inertias, self.link_inertias], 1).tolist()
            )
        ]
        joints = [
            f'<joint name="joint{i + 1}" type="continuous"><parent link="link{i + 1}"/><child link="link{i + 2}"/>'
            f'<origin xyz="{-length / 2 if i == 0 else -length!r} 0 0"/><axis xyz="0 0 1"/></joint>'
            for i, length in enumerate(self.lengths[:-1])
        ]
        return "\n".join(['<?xml version="1.0"?>', '<robot name="snake">', *links, *joints, "</robot>"])


ROBOTS: Registry[Robot] = Registry("robot", {"paper": Robot()}, instance_of(Robot))
AnyRobot = Annotated[Robot, BeforeValidator(lambda given: named_robot(given) if isinstance(given, str) else given)]


def named_robot(name: str) -> Robot:
    """The robot called so in `ROBOTS`, or described in a JSON file with the fields of `Robot`: my-robot.json.

    Raises:
        UnknownName: when there is none, with the nearest valid names.
        InvalidValue: when the file describes no robot.
    """
    if not name.endswith(".json") or name in ROBOTS:
        return ROBOTS.named(name)
    return Robot(**read_object(readable_file(Path(name)), "robot", "the fields of a robot"))


def _constant(array: FloatArray) -> FloatArray:
    """The array, closed to writing: robots share it."""
    array.setflags(write=False)
    return array
