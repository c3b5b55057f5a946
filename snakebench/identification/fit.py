"""Least squares: the robot whose replays of all logs come nearest, and intervals of what was fitted."""

from collections.abc import Sequence
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student_t

from snakebench.errors import InvalidValue, UnknownName
from snakebench.fluid import Medium
from snakebench.identification.checks import check_swims, doubt_of
from snakebench.identification.log import Log
from snakebench.identification.replay import Replay, Signals
from snakebench.perturbation import DRAG, Perturbations
from snakebench.robot import Robot
from snakebench.value import FloatArray

FITTED = ("diameter", "joint_stiffness", "joint_damping")  # by default
FITTABLE = (*FITTED, "proportional_gain", "derivative_gain", *DRAG)
_SPAN = 50.0  # times larger than assumed that a value may be (ours)
_DRAG_SPAN = 10.0  # the same of a factor of the drag
_STEP = 1e-4  # of finite differences, relative to what is assumed
_ROUNDS = 6  # of fits, each weighted by the noise that the one before left
_SETTLED = 0.01  # change of noise between rounds that counts as none
_START_SCALE = 1.0, 10.0, 10.0, 1.0  # how well a start is known before: angles [rad], rates, gyro [rad/s], speed [m/s]
_CALLS = 30  # of the replays in a round, at most
_SINGULAR = 1e12  # condition of the normal equations from which on they determine nothing (ours)
_EXACT = 1e-4  # least noise: replays are no more exact [rad, rad/s, m]
_CORRELATED = 0.3  # of residuals from row to row, which white noise does not have (ours)


class Parameter(NamedTuple):
    """One fitted number with its 95 % interval, in the unit of the robot's field, or a factor of its drag."""

    name: str
    assumed: float
    value: float
    low: float
    high: float


class Identified(NamedTuple):
    """A fitted robot and its drag, the parameters with intervals, the noise of each kind of sensor, and doubts."""

    robot: Robot
    drag: Perturbations  # factors of its drag, which a robot's description does not have
    parameters: list[Parameter]
    noise: dict[str, float]  # root mean square of the residuals: angle [rad], gyro [rad/s], position [m]
    remarks: list[str]  # what casts doubt on the intervals, a sentence each


def identify(
    logs: Sequence[Log], medium: Medium, robot: Robot, names: Sequence[str] = FITTED, hold: bool = False
) -> Identified:
    """The robot whose replays come nearest to the logs, all else as in `robot`.

    Residuals are weighted by the noise of their kind of sensor, which is estimated from them. The start of each log is
    fitted as well. Intervals are those of linear least squares (Student's t): they hold for white noise.

    Args:
        logs: swims of one robot.
        medium: the fluid of all of them.
        robot: what is known or assumed of it.
        names: which of its fields and of the factors of its drag are fitted, of `FITTABLE`.
        hold: commands are held between rows, as by a digital controller.

    Raises:
        InvalidValue: when a log looks wrong, or the logs do not determine a parameter.
    """
    fit = _Fit(logs, medium, robot, list(dict.fromkeys(names)), hold)
    shown = fit.signals(fit.x)
    check_swims(logs, shown)
    fit.check_effects()
    doubt = doubt_of(logs, shown)
    for _ in range(_ROUNDS):
        before, after = fit.noise, fit.solve()
        if doubt and (doubt := doubt_of(logs, fit.signals(fit.x))):  # not only the assumed robot is another one
            raise doubt
        fit.settled = all(abs(after[kind] / before[kind] - 1) < _SETTLED for kind in after)
        if fit.settled:
            break
    return fit.result()


class _Fit:
    """The unknowns x: fitted fields relative to what is assumed, then the start of each log."""

    def __init__(self, logs: Sequence[Log], medium: Medium, robot: Robot, names: list[str], hold: bool) -> None:
        for name in names:
            if name not in FITTABLE:
                raise UnknownName.among("parameter", name, FITTABLE)
        if not names or not logs:
            raise InvalidValue(f"{len(names)} parameters and {len(logs)} logs: at least one of both is needed")
        if wrong := {log.joint_angle.shape[1] for log in logs} - {robot.n_joints}:
            name, n = next((log.name, n) for log in logs if (n := log.joint_angle.shape[1]) in wrong)
            raise InvalidValue(f"{name}: a log of {n} joints, but a robot of {robot.n_joints}: give the robot's")
        self.robot, self.names = robot, names
        self.assumed = np.array([1.0 if name in DRAG else getattr(robot, name) for name in names])
        usual = [1.0 if name in DRAG else getattr(Robot(), name) or 1e-3 for name in names]
        self.unit = np.where(self.assumed > 0, self.assumed, usual)
        self.low, self.high = np.array([_bounds(name) for name in names]).T
        ends = [(1.0,) if name in DRAG else _bounds(name) for name in names]  # drag does not make joints stiffer
        corners = [self._robot(np.array(corner)) for corner in product(*ends)]
        self.replays = [Replay(log, medium, hold, corners) for log in logs]
        n = robot.n_joints
        self.ends = len(names) + (2 * n + 3) * np.arange(len(logs) + 1)
        self.scale = np.tile(np.repeat(_START_SCALE, (n, n, 1, 2)), len(logs))
        self.noise = {
            kind: 1.0 for kind in Signals._fields if any(getattr(r.measured, kind).size for r in self.replays)
        }
        self.x = np.ones(self.ends[-1])
        for (first, last), replay in zip(pairwise(self.ends), self.replays, strict=True):
            self.x[first:last] = replay.likelier_guess(robot)
        self.guess = self.x[self.ends[0] :]
        self.noise = self._left(self.signals(self.x))
        self.settled = False  # the noise, from one fit to the next

    def check_effects(self) -> None:
        """Make sure that the logs depend on all that is fitted."""
        effects = np.abs(self._jacobian(self.x)[:, : len(self.names)]).max(axis=0)
        for name in np.array(self.names)[effects < 1e-9]:
            raise InvalidValue(f"{name} has no effect on these logs: leave it out, or add logs of the other commands")

    def solve(self) -> dict[str, float]:
        """Fit with the present noise, and estimate it anew."""
        p = len(self.names)
        low, high = np.full_like(self.x, -np.inf), np.full_like(self.x, np.inf)
        low[:p], high[:p] = self.low, self.high
        found = least_squares(
            self._residuals, self.x, self._jacobian, (low, high), x_scale="jac", xtol=1e-6, ftol=1e-6, max_nfev=_CALLS
        )
        self.x, self.converged = found.x, found.success
        self.noise = self._left(self.signals(self.x))
        return self.noise

    def result(self) -> Identified:
        """What was fitted, with intervals."""
        p, jacobian, residuals = len(self.names), self._jacobian(self.x), self._residuals(self.x)
        sizes = np.linalg.norm(jacobian, axis=0)
        normal = (jacobian / sizes).T @ (jacobian / sizes)
        if not np.linalg.cond(normal) < _SINGULAR:
            raise InvalidValue(f"the logs do not tell {', '.join(self.names)} apart: fit fewer, or add other swims")
        covariance = np.linalg.inv(normal)[:p, :p] / np.outer(sizes[:p], sizes[:p])
        free = len(residuals) - len(self.scale) - len(self.x)
        variance = float(residuals @ residuals) / free
        half = np.sqrt(variance * np.diag(covariance)) * student_t.ppf(0.975, free)
        rows = zip(self.names, self.assumed, self.unit * self.x[:p], self.unit * half, strict=True)
        parameters = [Parameter(name, *map(float, (assumed, x, x - h, x + h))) for name, assumed, x, h in rows]
        drag: dict[str, Any] = {one.name: one.value for one in parameters if one.name in DRAG}
        return Identified(self._robot(self.x), Perturbations(**drag), parameters, self.noise, self._remarks(parameters))

    def signals(self, x: FloatArray) -> list[Signals]:
        """Of each log, at x."""
        return [self._replayed(k, x[None])[0] for k in range(len(self.replays))]

    def _replayed(self, k: int, xs: FloatArray) -> list[Signals]:
        """The signals of log k at several x."""
        drags = [[values.get(name, 1.0) for name in DRAG] for values in map(self._values, xs)]
        return self.replays[k]([self._robot(x) for x in xs], xs[:, self.ends[k] : self.ends[k + 1]], drags)

    def _robot(self, x: FloatArray) -> Robot:
        return self.robot.but(**{name: value for name, value in self._values(x).items() if name not in DRAG})

    def _values(self, x: FloatArray) -> dict[str, Any]:
        return dict(zip(self.names, (self.unit * x[: len(self.names)]).tolist(), strict=True))

    def _weighted(self, k: int, signals: Signals) -> FloatArray:
        """The residuals of log k in units of their noise."""
        both = zip(Signals._fields, signals, self.replays[k].measured, strict=True)
        return np.concatenate([((a - b) / self.noise.get(kind, 1.0)).ravel() for kind, a, b in both])

    def _residuals(self, x: FloatArray) -> FloatArray:
        start = (x[self.ends[0] :] - self.guess) / self.scale
        return np.concatenate([*(self._weighted(k, s) for k, s in enumerate(self.signals(x))), start])

    def _jacobian(self, x: FloatArray) -> FloatArray:
        """By forward differences; a start moves the replays of its own log only."""
        p, blocks = len(self.names), []
        for k, (first, last) in enumerate(pairwise(self.ends)):
            moved = [*range(p), *range(first, last)]
            xs = np.vstack([x, x + _STEP * np.eye(len(x))[moved]])
            base, *others = (self._weighted(k, signals) for signals in self._replayed(k, xs))
            block = np.zeros((len(base), len(x)))
            block[:, moved] = np.stack(others, axis=1) / _STEP - base[:, None] / _STEP
            blocks.append(block)
        known = np.zeros((len(self.scale), len(x)))
        known[:, p:] = np.diag(1 / self.scale)
        return np.vstack([*blocks, known])

    def _left(self, signals: list[Signals]) -> dict[str, float]:
        """The root mean square of the residuals of each kind of signal."""
        return {
            kind: max(float(np.sqrt(np.mean(np.vstack(self._misses(kind, signals)) ** 2))), _EXACT)
            for kind in self.noise
        }

    def _misses(self, kind: str, signals: list[Signals]) -> list[FloatArray]:
        """The residuals of one kind of signal in each log that has it, shape (rows, signals)."""
        pairs = zip(signals, self.replays, strict=True)
        return [getattr(s, kind) - getattr(r.measured, kind) for s, r in pairs if getattr(r.measured, kind).size]

    def _remarks(self, parameters: list[Parameter]) -> list[str]:
        remarks = [f"{p.name} is not determined: its interval contains zero" for p in parameters if not p.low > 0]
        remarks += [
            f"{name} ends at the bound of the search"
            for name, x, low, high in zip(self.names, self.x, self.low, self.high, strict=False)
            if not low + 1e-3 < x < high - 1e-3
        ]
        if not self.converged:
            remarks.append(f"the last fit has not converged in {_CALLS} replays")
        if not self.settled:
            remarks.append(f"the estimate of the noise has not settled in {_ROUNDS} fits: intervals may be wrong")
        signals = self.signals(self.x)
        for kind in self.noise:
            misses = self._misses(kind, signals)
            after = sum(float((miss[1:] * miss[:-1]).sum()) for miss in misses)
            alike = after / max(sum(float((miss**2).sum()) for miss in misses), 1e-30)
            if alike > _CORRELATED:
                remarks.append(
                    f"residuals of {kind} are no white noise (correlation {alike:.2f} from row to row): the model does"
                    " not explain them, and intervals are too narrow"
                )
        return remarks


def _bounds(name: str) -> tuple[float, float]:
    """Of what is fitted, relative to what is assumed."""
    if name in DRAG:
        return 1 / _DRAG_SPAN, _DRAG_SPAN
    return 1 / _SPAN if name == "diameter" else 0.0, _SPAN
