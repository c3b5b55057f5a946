"""What a run leaves behind: the robot's state, commands and energies at every physics step."""

from __future__ import annotations

import io
import json
import zlib
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Self
from zipfile import BadZipFile

import numpy as np

from snakebench.compilation import njit
from snakebench.controllers import Drives
from snakebench.errors import InvalidValue
from snakebench.files import write_file
from snakebench.kinematics import link_poses
from snakebench.robot import Robot
from snakebench.value import FloatArray

V_MAX = 3.0  # speed of the centre of mass that counts as divergence [m/s] (ours; the paper gives no figure)
JOINT_RATE_MAX = 100.0  # joint speed that counts as divergence [rad/s] (ours)


class Record(NamedTuple):
    """One instant of a run; `record_of` names the parts of a row of numbers so."""

    head: FloatArray  # x, y of the head's centre of mass and heading [m, m, rad]
    head_rate: FloatArray  # their time derivatives [m/s, m/s, rad/s]
    joint_angle: FloatArray  # q, per joint [rad]
    joint_rate: FloatArray  # dq/dt, per joint [rad/s]
    command: FloatArray  # what the controller asked for: target angle [rad] or command torque [N m], per joint
    command_torque: FloatArray  # u_in, held over the step that follows, per joint [N m]
    torque: FloatArray  # u, with the passive joint, per joint [N m]
    center: FloatArray  # x, y of the robot's centre of mass [m]
    center_rate: FloatArray  # its velocity [m/s]
    energy: FloatArray  # done since t = 0 [J]: command work, its positive part, work into joint dampers, into the fluid


@njit(inline="always")
def record_of(row: FloatArray, n_joints: int) -> Record:
    """The named parts of a row of `row_width(n_joints)` numbers, as views."""
    n, end = n_joints, 6 + 5 * n_joints
    return Record(
        row[0:3],
        row[3:6],
        row[6 : 6 + n],
        row[6 + n : 6 + 2 * n],
        row[6 + 2 * n : 6 + 3 * n],
        row[6 + 3 * n : 6 + 4 * n],
        row[6 + 4 * n : end],
        row[end : end + 2],
        row[end + 2 : end + 4],
        row[end + 4 : end + 8],
    )


def row_width(n_joints: int) -> int:
    """How many numbers describe one instant."""
    return 14 + 5 * n_joints


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A run from rest: arrays whose first axis is time, as documented in `Record`, and what produced them."""

    robot: Robot
    drives: Drives
    engine: str
    physics_rate: float  # steps per second of the engine [Hz]
    rate: float  # rows per second [Hz], fewer in a thinned trajectory
    diverged: bool  # the run ended early: a non-finite state or a speed beyond V_MAX or JOINT_RATE_MAX
    head: FloatArray
    head_rate: FloatArray
    joint_angle: FloatArray
    joint_rate: FloatArray
    command: FloatArray
    command_torque: FloatArray
    torque: FloatArray
    center: FloatArray
    center_rate: FloatArray
    energy: FloatArray

    @classmethod
    def from_rows(
        cls, rows: FloatArray, *, robot: Robot, drives: Drives, engine: str, physics_rate: float, diverged: bool
    ) -> Self:
        """The trajectory written in `rows`, one a physics step, shape (n_times, row_width(n_joints))."""
        record = Record(*(part.T for part in record_of.py_func(rows.T, robot.n_joints)))
        return cls(
            robot=robot,
            drives=drives,
            engine=engine,
            physics_rate=physics_rate,
            rate=physics_rate,
            diverged=diverged,
            **record._asdict(),
        )

    @cached_property
    def time(self) -> FloatArray:
        """Time of each row [s], shape (n_times,)."""
        return np.arange(len(self.head)) / self.rate

    @cached_property
    def links(self) -> FloatArray:
        """Centre x, y, angle, its cosine and sine of every link [m, m, rad, 1, 1], shape (n_times, n_links, 5)."""
        return link_poses(
            self.robot.link_lengths, np.ascontiguousarray(self.head), np.ascontiguousarray(self.joint_angle)
        )

    @cached_property
    def tail_tip(self) -> FloatArray:
        """Position of the tail's end [m], shape (n_times, 2)."""
        tail = self.links[:, -1]
        return tail[:, :2] - self.robot.lengths[-1] / 2 * tail[:, 3:]

    @property
    def command_work(self) -> FloatArray:
        """Work of the command torques since t = 0 [J], shape (n_times,); exact, for torques held over each step."""
        return self.energy[:, 0]

    @property
    def positive_work(self) -> FloatArray:
        """The part of `command_work` done by joints that drive, not brake [J], shape (n_times,)."""
        return self.energy[:, 1]

    def thinned(self, every: int) -> Trajectory:
        """Every `every`-th row of this trajectory."""
        arrays = {name: getattr(self, name)[::every] for name in Record._fields}
        return replace(self, rate=self.rate / every, **arrays)

    def save(self, path: Path) -> None:
        """Write the trajectory to a file.

        Raises:
            StoreError: when it cannot be written.
        """
        write_file(path, self.content())

    def content(self) -> bytes:
        """The trajectory as a NumPy archive with one named array per field and a JSON header."""
        header = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in Record._fields}
        header["robot"] = self.robot.model_dump(mode="json")
        arrays = {name: getattr(self, name) for name in Record._fields}
        archive = io.BytesIO()
        np.savez_compressed(archive, time=self.time, header=np.array(json.dumps(header)), **arrays)
        return archive.getvalue()

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read what `save` wrote.

        Raises:
            InvalidValue: when the file is missing or is not a saved trajectory.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
                header = json.loads(str(archive["header"]))
                arrays = {name: archive[name] for name in Record._fields}
            return cls(robot=Robot(**header.pop("robot")), **header, **arrays)
        except (OSError, EOFError, LookupError, ValueError, TypeError, RuntimeError, BadZipFile, zlib.error) as error:
            raise InvalidValue(f"{path} is not a saved trajectory: {error}") from None
