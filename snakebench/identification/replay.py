"""Replays of logs: robots follow the logged commands side by side in the planar engine."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from snakebench.engines.perturbed import scale_drag
from snakebench.engines.planar import Batch, stable_rate
from snakebench.fluid import Medium
from snakebench.identification.log import Log
from snakebench.memory import check_memory
from snakebench.physics.record import as_record, row_width
from snakebench.physics.waveform import HELD, SAMPLES, Waveform
from snakebench.robot import Robot
from snakebench.value import FloatArray

RATE = 240  # physics steps per second, more where a robot needs them [Hz]
_MARGIN = 1.05  # of a stable rate for robots between extremes (ours)
_FIRST = 4  # rows that show the start
_BESIDE = 10  # replays at a time, of a start and parameters, beside two for each joint


class Signals(NamedTuple):
    """What a log measures, of one robot; the first axis is the log's rows."""

    angle: FloatArray  # of joints [rad], shape (rows, n_joints)
    gyro: FloatArray  # [rad/s], shape (rows, 1)
    position: FloatArray  # tracked, in any frame [m], shape (rows, 2); without rows if nothing is


class Replay:
    """A log that robots can follow, each from a start of its own.

    A start has 2 n_joints + 3 numbers: joint angles [rad] and rates [rad/s], the gyro [rad/s] and the velocity of the
    centre of mass along and across the head [m/s].

    Args:
        log: what is followed.
        medium: where.
        hold: commands are held until the next row, as by a digital controller; else a cubic spline leads through them.
        extremes: robots between which all lie that will follow.
    """

    def __init__(self, log: Log, medium: Medium, hold: bool, extremes: Sequence[Robot]) -> None:
        self.log, self._medium = log, medium
        needed = _MARGIN * max(stable_rate(robot, log.drives) for robot in extremes)
        row_rate = max(round(1 / float(np.median(np.diff(log.time)))), 1)
        self.rate = row_rate * math.ceil(max(RATE, needed) / row_rate)
        steps, n = math.ceil(log.time[-1] * self.rate), log.joint_angle.shape[1]
        check_memory(f"{log.name}: {log.time[-1]:g} s", 8.0 * steps * row_width(n) * (2 * n + _BESIDE))
        self._times = np.arange(steps + 1) / self.rate
        if hold:
            row = np.searchsorted(log.time, self._times + 0.5 / self.rate, side="right") - 1
            self._waveform = Waveform(HELD, self.rate, log.command[row], np.inf)
        else:
            self._waveform = Waveform(SAMPLES, self.rate, CubicSpline(log.time, log.command)(self._times), np.inf)
        self.measured = Signals(log.joint_angle, log.gyro[:, None], log.position)

    def likelier_guess(self, robot: Robot) -> FloatArray:
        """The start, shape (2 n_joints + 3,), at rest or as the first rows move, from which angles are nearer."""
        n, first = self.log.joint_angle.shape[1], np.column_stack([self.log.joint_angle, self.log.gyro])[:_FIRST]
        value, slope = np.polynomial.polynomial.polyfit(self.log.time[:_FIRST], first, 1)
        rest = np.concatenate([first.mean(axis=0)[:n], np.zeros(n + 3)])
        guesses = np.stack([rest, np.concatenate([value[:n], slope[:n], [value[n], 0.0, 0.0]])])
        misses = [np.square(signals.angle - self.log.joint_angle).sum() for signals in self([robot] * 2, guesses)]
        return guesses[int(np.argmin(np.nan_to_num(misses, nan=np.inf)))]

    def __call__(
        self, robots: Sequence[Robot], starts: FloatArray, drags: Sequence[Sequence[float]] = ()
    ) -> list[Signals]:
        """The signals of each robot from its start, shape (n_robots, 2 n_joints + 3); NaN where it diverges.

        `drags` are the factors of each robot's drag, in the order of `perturbation.DRAG`; none by default.
        """
        log, n = self.log, self.log.joint_angle.shape[1]
        batch = Batch(robots, [self._medium] * len(robots), log.drives, self.rate)
        batch.restart(range(len(robots)), joint_angles=starts[:, :n])
        for b, drag in enumerate(drags):
            scale_drag(batch._members["chain"][b], drag, n + 1)
        state = batch.state()
        relative = np.pad(np.cumsum(starts[:, n : 2 * n], axis=1), ((0, 0), (1, 0)))  # of links to the head [rad/s]
        state["rates"][:, 2:] = relative + (starts[:, 2 * n] - relative[:, log.link - 1])[:, None]
        state["rates"][:, :2] = starts[:, 2 * n + 1 :]
        batch.restore(state)
        batch.follow([self._waveform] * len(robots), len(self._times) - 1)
        batch.rows[~batch.alive] = np.nan
        return [self._shown(rows) for rows in batch.rows]

    def _shown(self, rows: FloatArray) -> Signals:
        """The signals at the log's rows, of rows of records; positions are moved and turned to fit the log's."""
        log, n = self.log, self.log.joint_angle.shape[1]
        now = as_record(rows, n)
        turning = now.head_rate[:, 2] + now.joint_rate[:, : log.link - 1].sum(axis=1)
        place = now.head[:, :2] if log.tracked == "head" else now.center
        known = np.column_stack([now.joint_angle, turning, place])
        shown = np.stack([np.interp(log.time, self._times, column) for column in known.T], axis=1)
        position = _laid_on(shown[:, n + 1 :], log.position) if log.tracked else log.position
        return Signals(shown[:, :n], shown[:, n : n + 1], position)


def _laid_on(path: FloatArray, goal: FloatArray) -> FloatArray:
    """A path, moved and turned so that its squared distances from another, shape (rows, 2), are least."""
    (x, y), (u, v) = (path - path.mean(axis=0)).T, (goal - goal.mean(axis=0)).T
    turn = math.atan2(x @ v - y @ u, x @ u + y @ v)
    cos, sin = math.cos(turn), math.sin(turn)
    return np.column_stack([cos * x - sin * y, sin * x + cos * y]) + goal.mean(axis=0)
