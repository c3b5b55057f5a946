"""Logs of swims: time, joint angles, the turning rate of a link, commands and, where tracked, positions, as CSV."""

import re
import warnings
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from snakebench.errors import InvalidValue
from snakebench.files import readable_file, write_file
from snakebench.physics.joints import Drives
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

SHORTEST = 3.0  # of a log that is fitted [s] (ours)
_LONGEST = 1_000_000  # rows; 17 minutes at 1 kHz
_SLOWEST = 20.0  # rows per second that resolve the gaits of this field [Hz] (ours)
_LARGEST = 1e15  # number of a log, whatever it means: times may be counted from 1970, positions across a country
_GAP = 1.5  # usual intervals between two rows, with nothing missing (ours)
_TURN = np.pi  # no joint of a snake robot goes further [rad]
TRACKED: tuple[Literal["head", "center"], ...] = ("head", "center")


class Log(NamedTuple):
    """One swim of a robot; its rows need not be equally spaced in time."""

    name: str
    time: FloatArray  # from zero [s], shape (rows,)
    joint_angle: FloatArray  # [rad], shape (rows, n_joints)
    gyro: FloatArray  # turning rate of a link, counter-clockwise seen from above [rad/s], shape (rows,)
    link: int  # which carries the gyro, from 1 at the head
    drives: Drives  # what the commands are
    command: FloatArray  # target angles [rad] or command torques [N m], shape (rows, n_joints)
    tracked: Literal["head", "center"] | None  # whose position is known
    position: FloatArray  # of it in any frame [m], shape (rows, 2); without rows if nothing is tracked


def read_log(path: Path) -> Log:
    """Read a log with columns time, angle_1…, gyro_LINK, target_1… or torque_1… and maybe head_x, head_y.

    Angles and commands are numbered from the head; positions may be those of the centre of mass, center_x and center_y.
    Other columns are ignored.

    Raises:
        InvalidValue: when the file is no such table, with what is missing or looks wrong.
    """
    table = _table(path)
    n_joints, drives, gyro, tracked = _layout(path, [str(name) for name in table.columns])
    command = "target" if drives == "angle" else "torque"
    angles, commands = ([f"{kind}_{j + 1}" for j in range(n_joints)] for kind in ("angle", command))
    places = [f"{tracked}_x", f"{tracked}_y"] if tracked else []
    numbers = _numbers(path, table, ["time", *angles, gyro, *commands, *places])
    log = Log(
        name=str(path),
        time=numbers["time"] - numbers["time"][0],
        joint_angle=np.stack([numbers[name] for name in angles], axis=1),
        gyro=numbers[gyro],
        link=int(gyro.removeprefix("gyro_")),
        drives=drives,
        command=np.stack([numbers[name] for name in commands], axis=1),
        tracked=tracked,
        position=np.stack([numbers[name] for name in places], axis=1) if tracked else np.empty((0, 2)),
    )
    _check_time(log)
    _check_units(log)
    return log


def write_log(path: Path, trajectory: Trajectory) -> None:
    """Write what the sensors of a simulated robot would log, without noise; its gyro is in the head.

    Raises:
        StoreError: when it cannot be written.
    """
    joints = range(trajectory.robot.n_joints)
    command = "target" if trajectory.drives == "angle" else "torque"
    columns = {
        "time": trajectory.time,
        **{f"angle_{j + 1}": trajectory.joint_angle[:, j] for j in joints},
        "gyro_1": trajectory.head_rate[:, 2],
        **{f"{command}_{j + 1}": trajectory.command[:, j] for j in joints},
        "head_x": trajectory.head[:, 0],
        "head_y": trajectory.head[:, 1],
    }
    table = pd.DataFrame(columns).assign(time=[f"{time:.10g}" for time in trajectory.time])
    write_file(path, table.to_csv(index=False, float_format="%.7g"))


def _table(path: Path) -> pd.DataFrame:
    try:
        rules: dict[str, Any] = {"skipinitialspace": True, "index_col": False, "compression": None}
        with warnings.catch_warnings(action="error", category=pd.errors.ParserWarning):  # of rows that are too long
            table = pd.read_csv(readable_file(path), nrows=_LONGEST + 1, **rules)
    except (OSError, ValueError, pd.errors.ParserWarning) as error:
        raise InvalidValue(f"cannot read the log {path}: {error}") from None
    if len(table) > _LONGEST:
        raise InvalidValue(f"{path} has more than {_LONGEST} rows: leave out some, or divide it into several logs")
    return table


def _layout(path: Path, names: list[str]) -> tuple[int, Drives, str, Literal["head", "center"] | None]:
    """The number of joints, what commands are, the gyro's column and what is tracked, by the names of columns."""
    n_joints = max((int(name[6:]) for name in names if re.fullmatch(r"angle_[1-9]\d?", name)), default=0)
    if not n_joints:
        raise InvalidValue(f"{path}: no column angle_1: columns time, angle_1 …, gyro_1, target_1 … are needed")
    gyros = [name for name in names if re.fullmatch(r"gyro_[1-9]\d?", name) and int(name[5:]) <= n_joints + 1]
    if len(gyros) != 1:
        raise InvalidValue(f"{path}: {len(gyros)} gyros: one column is needed, such as gyro_1 for that of the head")
    tracked = next((body for body in TRACKED if f"{body}_x" in names), None)
    return n_joints, "angle" if "target_1" in names else "torque", gyros[0], tracked


def _numbers(path: Path, table: pd.DataFrame, names: list[str]) -> dict[str, FloatArray]:
    """Columns as numbers that can be computed with."""
    if missing := [name for name in names if name not in table]:
        raise InvalidValue(f"{path}: columns are missing: {', '.join(missing)}")
    if len(table) < 2:
        raise InvalidValue(f"{path}: {len(table)} rows: at least {SHORTEST:g} s are needed")
    numbers = {name: pd.to_numeric(table[name], errors="coerce").to_numpy(np.float64) for name in names}
    for name, column in numbers.items():
        if (wrong := ~(np.abs(column) <= _LARGEST)).any():
            row, needed = int(np.argmax(wrong)), f"a number within ±{_LARGEST:g} is needed"
            raise InvalidValue(f"{path}: {name} in row {row + 1} is {table[name].iloc[row]}: {needed}")
    return numbers


def _check_time(log: Log) -> None:
    """Make sure that a log is long and dense enough, without gaps."""
    step = np.diff(log.time)
    usual = float(np.median(step))
    if step.min() <= 0:
        raise InvalidValue(
            f"{log.name}: time does not increase after row {np.argmax(step <= 0) + 1}: sorted rows are needed"
        )
    if step.max() > _GAP * usual:
        at = int(np.argmax(step))
        raise InvalidValue(
            f"{log.name}: a gap of {step[at]:.3g} s after {log.time[at]:.3f} s, where rows are {usual:.3g} s apart:"
            " give the parts as logs of their own"
        )
    if log.time[-1] < SHORTEST or usual > 1 / _SLOWEST:
        raise InvalidValue(
            f"{log.name}: {log.time[-1]:.3g} s of {1 / usual:.3g} Hz: at least {SHORTEST:g} s of {_SLOWEST:g} Hz are"
            " needed; time is in seconds"
        )


def _check_units(log: Log) -> None:
    """Make sure that angles are in radians."""
    for kind, columns in (("angle", log.joint_angle), ("target", log.command)):
        largest = np.abs(columns).max(axis=0)
        if (kind == "angle" or log.drives == "angle") and largest.max() > _TURN:
            name = f"{kind}_{largest.argmax() + 1}"
            raise InvalidValue(
                f"{log.name}: {name} reaches {largest.max():.4g}: it looks like degrees, radians are needed"
            )
