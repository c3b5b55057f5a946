"""The swimming robot: a trajectory as the numbers that the page's player draws."""

from functools import cache
from typing import Any

import numpy as np

from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

_STEPS = {"head": 1000, "joints": 250, "torque": 50, "center": 250}  # to a metre, a radian and a newton metre
_MOST = 1e6  # m, rad or N m that are drawn, before a divergence
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"


def swimmer(label: str, trajectory: Trajectory) -> dict[str, Any]:
    """What the player needs to draw a run: 30 frames a second of head pose, joint angles and torques, packed."""
    shown = trajectory.thinned(max(round(trajectory.rate / 30), 1))
    finite = np.isfinite(shown.head).all(axis=1) & np.isfinite(shown.torque).all(axis=1)  # not the end of a divergence
    return {"label": label} | _drawn(shown, finite, "torque", "center")


def lane(label: str, where: str, trajectory: Trajectory, seconds: float) -> dict[str, Any]:
    """What a race needs to draw a run from rest: 15 frames a second of head pose and joint angles, packed."""
    shown = trajectory.thinned(max(round(trajectory.rate / 15), 1))
    return {"label": label, "where": where} | _drawn(shown, slice(round(seconds * shown.rate) + 1))


def _drawn(shown: Trajectory, frames: Any, *further: str) -> dict[str, Any]:
    rows = {"head": shown.head, "joints": shown.joint_angle} | {name: getattr(shown, name) for name in further}
    body = {"rate": shown.rate, "lengths": shown.robot.lengths, "diameter": shown.robot.diameter}
    return body | {name: packed_rows(values[frames], _STEPS[name]) for name, values in rows.items()}


def packed_rows(rows: FloatArray, steps: int) -> tuple[int, int, str]:
    """Rows of numbers for player.js, in so many steps to a unit: how many a row has, the steps, and all as text.

    They are even in time, so that second differences are small: mostly a letter each.
    """
    whole = np.round(np.clip(rows, -_MOST, _MOST) * steps).astype(np.int64)
    changes = np.diff(whole, n=2, axis=0, prepend=np.zeros((2, whole.shape[1]), np.int64))
    codes = np.where(changes < 0, -2 * changes - 1, 2 * changes)
    return whole.shape[1], steps, "".join(map(_letters, codes.ravel().tolist()))


@cache
def _letters(code: int) -> str:
    """A whole number in letters of five bits, the lowest first; those of the upper 32 have more to follow."""
    return _LETTERS[code] if code < 32 else _LETTERS[32 + code % 32] + _letters(code // 32)
