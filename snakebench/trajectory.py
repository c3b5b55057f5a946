"""What a run leaves behind: the robot's state, commands and energies at every physics step."""

import io
import json
import zlib
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self
from zipfile import BadZipFile

import numpy as np

from snakebench.errors import InvalidValue
from snakebench.files import write_file
from snakebench.physics.joints import Drives
from snakebench.physics.kinematics import link_poses
from snakebench.physics.record import Record, as_record, row_width
from snakebench.robot import Robot
from snakebench.value import FloatArray

_SHOWN = ("head", "joint_angle", "torque", "center")  # what pages draw
_STEP = 2.0**-14  # of the numbers that are published [m, rad, N m]


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
        cls, rows: FloatArray, robot: Robot, drives: Drives, engine: str, physics_rate: float, *, diverged: bool
    ) -> Self:
        """The trajectory written in `rows`, one a physics step, shape (n_times, row_width(n_joints))."""
        return cls(
            robot=robot,
            drives=drives,
            engine=engine,
            physics_rate=physics_rate,
            rate=physics_rate,
            diverged=diverged,
            **as_record(rows, robot.n_joints)._asdict(),
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
        """Work of the command torques since t = 0 [J], shape (n_times,), as the engine integrates it."""
        return self.energy[:, 0]

    @property
    def positive_work(self) -> FloatArray:
        """The part of `command_work` done by joints that drive, not brake [J], shape (n_times,)."""
        return self.energy[:, 1]

    def thinned(self, every: int) -> Self:
        """Every `every`-th row of this trajectory."""
        arrays = {name: getattr(self, name)[::every] for name in Record._fields}
        return replace(self, rate=self.rate / every, **arrays)

    def save(self, path: Path | str) -> None:
        """Write the trajectory to a file.

        Raises:
            StoreError: when it cannot be written.
        """
        write_file(path, self.content())

    def content(self) -> bytes:
        """The trajectory as a NumPy archive with one named array per field and a JSON header."""
        return self._archive({}, {"time": self.time} | {name: getattr(self, name) for name in Record._fields})

    def shown(self) -> bytes:
        """What a study publishes of it: head, joint angles, torques and centre, in steps of 2⁻¹⁴ m, rad and N m.

        `load` reads the rest as NaN.
        """
        with np.errstate(over="ignore"):  # at the end of a divergence
            arrays = {name: (np.round(getattr(self, name) / _STEP) * _STEP).astype(np.float32) for name in _SHOWN}
        return self._archive({"shown": True}, arrays)

    def _archive(self, marks: dict[str, bool], arrays: dict[str, Any]) -> bytes:
        header = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in Record._fields} | marks
        header["robot"] = self.robot.model_dump(mode="json")
        archive = io.BytesIO()
        np.savez_compressed(archive, header=np.array(json.dumps(header)), **arrays)
        return archive.getvalue()

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read what `save` wrote, or what a study published.

        Raises:
            InvalidValue: when the file is missing or is not a saved trajectory.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
                header = json.loads(str(archive["header"]))
                robot, shown = Robot(**header.pop("robot")), header.pop("shown", False)
                arrays = {name: archive[name].astype(np.float64) for name in (_SHOWN if shown else Record._fields)}
            unknown = as_record(np.full((len(arrays["head"]), row_width(robot.n_joints)), np.nan), robot.n_joints)
            return cls(robot=robot, **header, **unknown._asdict() | arrays)
        except (OSError, EOFError, LookupError, ValueError, TypeError, RuntimeError, BadZipFile, zlib.error) as error:
            raise InvalidValue(f"{path} is not a saved trajectory: {error}") from None
