"""The robot against the paper's table, and its freedom in joints, lengths and masses."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.physics.kinematics import joint_mobility, link_poses, link_rates


def test_the_default_robot_is_the_papers():
    robot = sb.Robot()
    assert robot.n_joints == 7
    assert sum(robot.lengths) == pytest.approx(1.490)
    assert robot.total_mass == pytest.approx(5.499)
    assert robot.neutral_diameter(999.0) == pytest.approx(0.0686, abs=5e-5)
    assert robot.joint_stiffness == pytest.approx(5.7296, abs=1e-4)
    assert robot.joint_damping == pytest.approx(2.8648e-3, abs=1e-7)
    assert (robot.proportional_gain, robot.derivative_gain) == (4.0, 0.3)


def test_a_link_has_the_inertia_of_a_solid_cylinder():
    robot = sb.Robot(lengths=(0.3, 0.2), masses=(2.0, 1.0), cover_mass=0.0, diameter=0.08)
    assert robot.link_inertias == pytest.approx([2 * (3 * 0.04**2 + 0.3**2) / 12, (3 * 0.04**2 + 0.2**2) / 12])
    assert robot.axial_inertias == pytest.approx([2 * 0.04**2 / 2, 0.04**2 / 2])


def test_a_changed_robot_has_its_own_inertia():
    robot = sb.Robot()
    assert robot.link_inertias[0] > 0  # now remembered by this robot, not to be inherited
    assert robot.but(diameter=0.05).link_inertias == pytest.approx(sb.Robot(diameter=0.05).link_inertias, rel=1e-15)


def test_derived_arrays_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        sb.Robot().link_masses[0] = 99.0


@pytest.mark.parametrize("joints", [2, 5, 12, 40])
def test_cutting_the_robot_keeps_length_and_mass(joints):
    robot = sb.Robot.with_joints(joints)
    assert robot.n_joints == joints
    assert sum(robot.lengths) == pytest.approx(1.490)
    assert robot.total_mass == pytest.approx(5.499)


def test_cutting_into_seven_joints_gives_the_papers_robot():
    assert sb.Robot.with_joints(7).lengths == pytest.approx(sb.Robot().lengths)


@pytest.mark.parametrize(
    ("given", "cover"),
    [
        ({"lengths": (0.3, 0.2), "masses": (2.0, 1.0)}, 0.0),
        ({"masses": (1.0,) * 8}, 0.0),
        ({"lengths": (0.2,) * 8}, 0.0),
        ({"lengths": (0.3, 0.2), "masses": (2.0, 1.0), "cover_mass": 0.1}, 0.1),
        ({"diameter": 0.07}, 0.542),
    ],
)
def test_only_the_papers_robot_has_its_cover_unless_told_otherwise(given, cover):
    assert sb.Robot(**given).cover_mass == sb.Robot().but(**given).cover_mass == cover
    assert sb.Robot.with_joints(4).cover_mass == 0.542


def test_the_urdf_says_what_the_robot_is():
    robot = sb.Robot.with_joints(5)
    tree = ElementTree.fromstring(robot.urdf())
    masses = [float(mass.get("value")) for mass in tree.iter("mass")]
    across = [float(inertia.get("izz")) for inertia in tree.iter("inertia")]
    assert masses == pytest.approx(robot.link_masses)
    assert across == pytest.approx(robot.link_inertias)
    assert len(tree.findall("joint")) == 5


def test_the_straight_robot_lies_behind_its_head():
    robot = sb.Robot()
    head = np.array([[-0.14, 0.0, 0.0]])
    links = link_poses(robot.link_lengths, head, np.zeros((1, 7)))[0]
    assert links[-1, 0] == pytest.approx(-1.490 + 0.161)
    assert np.all(links[:, 1] == 0)


def test_link_rates_are_the_time_derivative_of_link_poses():
    rng = np.random.default_rng(1)
    lengths, head, rate, q, dq = rng.uniform(0.1, 0.4, 6), *(rng.normal(size=(1, n)) for n in (3, 3, 5, 5))
    step = 1e-6
    ahead, behind = (link_poses(lengths, head + s * rate, q + s * dq) for s in (step, -step))
    now = link_poses(lengths, head, q)
    assert link_rates(lengths, now, rate, dq) == pytest.approx((ahead - behind)[..., :3] / (2 * step), abs=1e-8)


def test_mobility_of_two_equal_rods_on_a_hinge():
    # By symmetry the hinge transmits no force: each rod turns about its own centre, in opposite senses, by u / I.
    robot = sb.Robot(lengths=(0.4, 0.4), masses=(1.5, 1.5), cover_mass=0.0, diameter=0.05)
    assert joint_mobility(robot, np.zeros(1)) == pytest.approx(2 / robot.link_inertias[0])


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"diameter": -0.1}, "diameter = -0.1"),
        ({"lengths": (0.3,), "masses": (1.0,)}, "lengths"),
        ({"masses": (1.0, 2.0)}, "one mass per link"),
        ({"colour": "red"}, "unknown field 'colour'"),
        ({"cover_mass": "heavy"}, "cover_mass = 'heavy'"),
    ],
)
def test_impossible_robots_are_refused(fields, complaint):
    with pytest.raises(InvalidValue, match=complaint):
        sb.Robot(**fields)


@pytest.mark.parametrize("joints", [-1, 0, 1, 64])
def test_impossible_numbers_of_joints_are_refused(joints):
    with pytest.raises(InvalidValue, match="joints"):
        sb.Robot.with_joints(joints)


def test_equal_robots_are_equal_whatever_has_been_derived_from_them():
    one, other = sb.Robot(), sb.Robot()
    assert one.link_masses.sum() == other.link_masses.sum()
    assert one == other and hash(one) == hash(other) and len({one, other}) == 1
    assert one != sb.Robot(diameter=0.07) and one != "robot"
