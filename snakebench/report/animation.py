"""The swimming robot: a trajectory as the numbers that the page's player draws."""

from __future__ import annotations

from typing import Any

import numpy as np

from snakebench.trajectory import Trajectory

_FRAMES_PER_SECOND = 30
_LANE_FRAMES_PER_SECOND = 15


def swimmer(label: str, trajectory: Trajectory) -> dict[str, Any]:
    """What the player needs to draw a run: 30 frames a second of head pose, joint angles and torques, rounded."""
    shown = trajectory.thinned(max(round(trajectory.rate / _FRAMES_PER_SECOND), 1))
    frames = np.isfinite(shown.head).all(axis=1) & np.isfinite(shown.torque).all(axis=1)  # not the end of a divergence
    return {
        "label": label,
        "rate": shown.rate,
        "lengths": trajectory.robot.lengths,
        "diameter": trajectory.robot.diameter,
        "head": np.round(shown.head[frames], 4).tolist(),
        "joints": np.round(shown.joint_angle[frames], 3).tolist(),
        "torque": np.round(shown.torque[frames], 3).tolist(),
        "center": np.round(shown.center[frames], 4).tolist(),
    }


def lane(label: str, where: str, trajectory: Trajectory, seconds: float) -> dict[str, Any]:
    """What a race needs to draw a run from rest: 15 frames a second of head pose and joint angles, rounded."""
    shown = trajectory.thinned(max(round(trajectory.rate / _LANE_FRAMES_PER_SECOND), 1))
    frames = round(seconds * shown.rate) + 1
    return {
        "label": label,
        "where": where,
        "rate": shown.rate,
        "lengths": trajectory.robot.lengths,
        "diameter": trajectory.robot.diameter,
        "head": np.round(shown.head[:frames], 3).tolist(),
        "joints": np.round(shown.joint_angle[:frames], 2).tolist(),
    }
