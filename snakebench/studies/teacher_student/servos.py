"""What policies ask of their servos, beside what these can give: torque and speed of their bounds, and heat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from snakebench.report.tables import Table, number

_LIMITS = {"torque_limit": "N m", "speed_limit": "rad/s"}  # of robots
_NEEDED = {  # the heads of columns, how seeds are taken together, and the limit that it is held against
    "command_torque_rms": ("RMS torque [N m]", "mean", ""),
    "command_torque_peak": ("peak torque [N m]", "max", "torque_limit"),
    "joint_speed_peak": ("peak joint speed [rad/s]", "max", "speed_limit"),
    "heat": ("heat [N² m²]", "mean", ""),
}


def robot_of(config: Mapping[str, Any], policy: str) -> dict[str, Any]:
    """The settings of the robot that a policy of a study moves."""
    return config["robot"] | config["policies"][policy].get("robot", {})


def limits_said(robot: Mapping[str, Any]) -> str:
    """The bounds of a robot's servos that are set, to follow what a policy is; empty without any."""
    return "".join(f", up to {robot[limit]:g} {unit}" for limit, unit in _LIMITS.items() if robot.get(limit))


def servo_table(swims: pd.DataFrame, order: Sequence[str], config: Mapping[str, Any]) -> Table | None:
    """What each policy's servos must stand in every fluid; None of tables of version 1.0, which does not tell it.

    Args:
        swims: one a row, columns policy, fluid and what is needed.
        order: of the policies.
        config: of their study.
    """
    if not set(_NEEDED) <= set(swims):
        return None
    rows = []
    for policy in order:
        robot = robot_of(config, policy)
        for fluid, part in swims[swims["policy"] == policy].groupby("fluid", sort=False):
            needed = {name: part[name].agg(how) for name, (_, how, _) in _NEEDED.items()}
            cells = [_held(needed[name], robot.get(limit)) for name, (*_, limit) in _NEEDED.items()]
            rows.append([f"{policy.replace('_', ' ')}, {fluid}", str(len(part)), *cells])
    return Table(
        "What the servos must stand: root mean square of the command torque of the joint where it is largest, its peak"
        " and that of the joint speed, and the sum of squared torques, to which heat in the windings is proportional;"
        " means over the seeds, peaks of the worst one, and of which bound where the robot has one: torque, and the"
        " no-load speed, where a servo drives no more.",
        ["policy, fluid", "n", *(head for head, *_ in _NEEDED.values())],
        rows,
    )


def _held(needed: float, limit: float | None) -> str:
    return number(needed) + (f" of {limit:g}" if limit else "")
