"""The swimming robot as an image, for `render`: NumPy draws it, with no window and no other library."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snakebench.physics.kinematics import link_poses
from snakebench.physics.record import Record
from snakebench.robot import Robot
from snakebench.value import FloatArray

_SIZE = 240, 480  # rows and columns; even numbers, as video formats want them
_ROOM = 1.6  # width of the image, in lengths of the robot
_MESH = 0.25  # distance between the lines that stay in place [m]
_WATER, _LINE = np.array([222, 238, 245]), np.array([190, 214, 226])
_BODY, _HEAD = np.array([38, 70, 83]), np.array([231, 111, 81])


def picture(robot: Robot, now: Record) -> NDArray[np.uint8]:
    """The robot from above, its centre of mass in the middle, +x to the right; lines a quarter of a metre apart stay.

    Returns:
        Red, green and blue, shape (240, 480, 3).
    """
    rows, columns = _SIZE
    pixel = _ROOM * float(robot.link_lengths.sum()) / columns  # [m]
    x = now.center[0] + (np.arange(columns) - columns / 2 + 0.5) * pixel
    y = now.center[1] - (np.arange(rows)[:, None] - rows / 2 + 0.5) * pixel
    lines = (np.mod(x, _MESH) < pixel) | (np.mod(y, _MESH) < pixel)
    image = np.where(lines[..., None], _LINE, _WATER)
    links = link_poses(robot.link_lengths, np.array([now.head]), np.array([now.joint_angle]))[0]
    gaps = [_distance(x - links[i, 0], y - links[i, 1], links[i, 3:], robot.lengths[i]) for i in range(robot.n_links)]
    for gap, colour in ((np.min(gaps, axis=0), _BODY), (gaps[0], _HEAD)):
        covered = np.clip(0.5 + (robot.diameter / 2 - gap) / pixel, 0.0, 1.0)[..., None]
        image = (1 - covered) * image + covered * colour
    return image.astype(np.uint8)


def _distance(x: FloatArray, y: FloatArray, forward: FloatArray, length: float) -> FloatArray:
    """How far points, as seen from a link's centre, lie from its axis [m]."""
    beyond = np.abs(x * forward[0] + y * forward[1]) - length / 2
    return np.hypot(np.maximum(beyond, 0.0), y * forward[0] - x * forward[1])
