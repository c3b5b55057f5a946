"""Where the links of a planar chain are, how they move, and how easily its joints accelerate.

The head's centre of mass (x, y), its heading and the joint angles place the chain; link i + 1 hangs behind link i.
The unit vector along a link points towards the head; the one across it is that vector turned left.
"""

import math
from contextlib import suppress

import numpy as np

from snakebench.compilation import njit
from snakebench.errors import InvalidValue
from snakebench.robot import Robot
from snakebench.value import FloatArray


@njit(error_model="numpy")
def place_links(lengths: FloatArray, head: FloatArray, joint_angle: FloatArray, links: FloatArray) -> None:
    """Write each link's centre x, y [m], angle [rad] and its cosine and sine into `links`, shape (n_links, 5).

    `head` is (x, y, heading), shape (3,); `joint_angle` has shape (n_joints,).
    """
    x, y, angle = head
    cos, sin = math.cos(angle), math.sin(angle)
    links[0, 0], links[0, 1], links[0, 2], links[0, 3], links[0, 4] = x, y, angle, cos, sin
    for i in range(1, len(joint_angle) + 1):
        x, y = x - lengths[i - 1] / 2 * cos, y - lengths[i - 1] / 2 * sin
        angle += joint_angle[i - 1]
        cos, sin = math.cos(angle), math.sin(angle)
        x, y = x - lengths[i] / 2 * cos, y - lengths[i] / 2 * sin
        links[i, 0], links[i, 1], links[i, 2], links[i, 3], links[i, 4] = x, y, angle, cos, sin


@njit(error_model="numpy")
def move_links(
    lengths: FloatArray, links: FloatArray, head_rate: FloatArray, joint_rate: FloatArray, rates: FloatArray
) -> None:
    """Write the time derivatives of x, y and angle of placed `links` into `rates`, shape (n_links, 3)."""
    rates[0] = head_rate
    for i in range(1, len(joint_rate) + 1):
        front, rear = lengths[i - 1] / 2 * rates[i - 1, 2], lengths[i] / 2 * (rates[i - 1, 2] + joint_rate[i - 1])
        rates[i, 0] = rates[i - 1, 0] + front * links[i - 1, 4] + rear * links[i, 4]
        rates[i, 1] = rates[i - 1, 1] - front * links[i - 1, 3] - rear * links[i, 3]
        rates[i, 2] = rates[i - 1, 2] + joint_rate[i - 1]


@njit(cache=True)
def link_poses(lengths: FloatArray, heads: FloatArray, joint_angles: FloatArray) -> FloatArray:
    """Centre and angle of every link at every time as `place_links` writes them, shape (n_times, n_links, 5)."""
    poses = np.empty((len(heads), len(lengths), 5))
    for k in range(len(heads)):
        place_links(lengths, heads[k], joint_angles[k], poses[k])
    return poses


@njit(cache=True)
def link_rates(lengths: FloatArray, poses: FloatArray, head_rates: FloatArray, joint_rates: FloatArray) -> FloatArray:
    """Time derivatives of x, y and angle in `link_poses`, shape (n_times, n_links, 3)."""
    rates = np.empty((len(poses), len(lengths), 3))
    for k in range(len(poses)):
        move_links(lengths, poses[k], head_rates[k], joint_rates[k], rates[k])
    return rates


@njit(error_model="numpy")
def write_mass_matrix(
    lengths: FloatArray, masses: FloatArray, inertias: FloatArray, links: FloatArray, n_joints: int, matrix: FloatArray
) -> None:
    """Write the lower half of the mass matrix of placed `links`, by head x, y, heading and joint angles.

    The heading turns all links about the head's centre, a joint angle those behind the joint about it: a coordinate has
    a pivot, and what it turns has a mass, a first and a second moment about the head's centre [kg, kg m, kg m^2].
    """
    pivots = matrix[:2]  # their upper half
    pivots[0, 2] = pivots[1, 2] = 0.0
    for i in range(n_joints):
        x, y, half = links[i, 0] - links[0, 0], links[i, 1] - links[0, 1], lengths[i] / 2
        pivots[0, 3 + i], pivots[1, 3 + i] = x - half * links[i, 3], y - half * links[i, 4]
    mass = first_x = first_y = second = 0.0
    for i in range(n_joints, -1, -1):
        x, y = links[i, 0] - links[0, 0], links[i, 1] - links[0, 1]
        mass += masses[i]
        first_x += masses[i] * x
        first_y += masses[i] * y
        second += inertias[i] + masses[i] * (x * x + y * y)
        c = 2 + i
        x_c, y_c = pivots[0, c], pivots[1, c]
        beyond_x, beyond_y = mass * x_c - first_x, mass * y_c - first_y
        matrix[c, 0], matrix[c, 1] = beyond_y, -beyond_x
        own = second - x_c * first_x - y_c * first_y
        for b in range(2, c + 1):
            matrix[c, b] = own + pivots[0, b] * beyond_x + pivots[1, b] * beyond_y
    matrix[0, 0] = matrix[1, 1] = mass
    matrix[1, 0] = 0.0


def joint_mobility(robot: Robot, joint_angle: FloatArray) -> FloatArray:
    """Acceleration of each joint per unit torque on each, the body floating freely at rest [rad/s^2 per N m].

    The joint block of the inverse mass matrix, shape (n_joints, n_joints).

    Raises:
        InvalidValue: when the links are too unlike each other for it to be known.
    """
    n = robot.n_links
    links, lower = np.empty((n, 5)), np.zeros((n + 2, n + 2))
    place_links.py_func(robot.link_lengths, np.zeros(3), joint_angle, links)
    write_mass_matrix.py_func(robot.link_lengths, robot.link_masses, robot.link_inertias, links, n - 1, lower)
    mass_matrix = np.tril(lower) + np.tril(lower, -1).T
    with suppress(np.linalg.LinAlgError):
        mobility = np.linalg.inv(mass_matrix)[3:, 3:].astype(np.float64)
        if np.linalg.eigvalsh(mobility)[0] > 0:
            return mobility
    raise InvalidValue("Robot: lengths, masses or diameter differ too much to tell how the links move each other")
