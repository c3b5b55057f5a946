"""What policies ask of their servos, beside what these can give: torque and speed of their bounds, and heat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from snakebench.report.table import Cell, Table, number, size, summary

_LIMITS = {"torque_limit": "N m", "speed_limit": "rad/s"}  # of robots
_NEEDED = {  # the heads of columns, how seeds are taken together, and the limit that it is compared with
    "command_torque_rms": ("RMS torque [N m]", "mean", ""),
    "command_torque_peak": ("peak torque [N m]", "max", "torque_limit"),
    "joint_speed_peak": ("peak joint speed [rad/s]", "max", "speed_limit"),
    "heat": ("heat [N² m²]", "mean", ""),
}


def robot_of(config: Mapping[str, Any], policy: str) -> dict[str, Any]:
    """The settings of the robot that a policy of a study moves."""
    return config["robot"] | config["policies"][policy].get("robot", {})


def limits(robot: Mapping[str, Any]) -> str:
    """The bounds of a robot's servos that are set."""
    return ", ".join(f"up to {robot[limit]:g} {unit}" for limit, unit in _LIMITS.items() if robot.get(limit)) or "none"


def servo_table(swims: pd.DataFrame, order: Sequence[str], config: Mapping[str, Any]) -> Table | None:
    """What the servos of each policy must stand in every fluid; None where tables of version 1.0 do not have it."""
    if swims[list(_NEEDED)].isna().all(axis=None):
        return None

    def needed(name: str, how: str, limit: str) -> Cell:
        def cell(part: pd.DataFrame) -> str:
            bound = robot_of(config, part["policy"].iloc[0]).get(limit)
            return number(part[name].agg(how)) + (f" of {bound:g}" if bound else "")

        return cell

    columns = [(head, needed(name, how, limit)) for name, (head, how, limit) in _NEEDED.items()]
    return summary(swims, {"policy": order, "fluid": swims["fluid"].unique()}, [("n", size), *columns])
