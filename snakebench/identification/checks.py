"""What looks wrong in a log beside a replay by the assumed robot: swapped joints, reversed signs, other units."""

from collections.abc import Iterable

import numpy as np

from snakebench.errors import InvalidValue
from snakebench.identification.log import Log
from snakebench.identification.replay import Signals
from snakebench.value import FloatArray

_FROM = 1.0  # when the start is mostly forgotten [s]
_REVERSED = -0.5  # correlation below which a sign is reversed (ours)
_BETTER = 0.1  # sum of two correlations, by which swapped joints fit better (ours)
_STILL = 1e-3  # standard deviation of an angle that does not move [rad]
_MILLIMETRES = 100.0  # times the way that is expected, far from 1 and below 1000 (ours)
_DEGREES = 20.0  # times what is expected, far from 1 and below 180 / pi (ours)


def check_swims(logs: Iterable[Log], replays: Iterable[Signals]) -> None:
    """Make sure that the assumed robot swims under the commands of every log; an InvalidValue names the one."""
    for log, shown in zip(logs, replays, strict=True):
        if not np.isfinite(shown.gyro).all():
            raise InvalidValue(f"{log.name}: the assumed robot diverges under these commands: check robot and units")


def doubt_of(logs: Iterable[Log], replays: Iterable[Signals]) -> InvalidValue | None:
    """What looks wrong in the first log that does not resemble its replay: swapped, reversed, dead, in other units.

    The replayed robot may as well be another one than that of the logs.
    """
    try:
        for log, shown in zip(logs, replays, strict=True):
            _check_log(log, shown)
    except InvalidValue as error:
        return error
    return None


def _check_log(log: Log, shown: Signals) -> None:
    late = log.time >= _FROM
    n = log.joint_angle.shape[1]
    _check_joints(log, _correlation(log.joint_angle[late], shown.angle[late])[:n, n:])
    for still in np.flatnonzero((log.joint_angle.std(axis=0) < _STILL) & (shown.angle.std(axis=0) > _STILL)):
        raise InvalidValue(f"{log.name}: angle_{still + 1} does not move, but its command does: is it connected?")
    gyro, expected = log.gyro[late, None], shown.gyro[late]
    if _correlation(gyro, expected)[0, 1] < _REVERSED:
        raise InvalidValue(
            f"{log.name}: gyro_{log.link} turns against what the joints imply: is its sign reversed?"
            " Counter-clockwise is positive, as for angles"
        )
    if gyro.std() < _STILL < expected.std():
        raise InvalidValue(f"{log.name}: gyro_{log.link} does not move, but the joints do: is it connected?")
    if (times := gyro.std() / max(expected.std(), _STILL)) > _DEGREES:
        raise InvalidValue(
            f"{log.name}: gyro_{log.link} is {times:.0f} times what the joints imply:"
            " it looks like degrees per second, radians per second are needed"
        )
    if log.tracked:
        way, expected_way = (np.hypot(*np.ptp(places, axis=0)) for places in (log.position, shown.position))
        if way > _MILLIMETRES * max(expected_way, _STILL):
            raise InvalidValue(f"{log.name}: the {log.tracked} moves by {way:.4g}: it looks like mm, m are needed")


def _check_joints(log: Log, alike: FloatArray) -> None:
    """`alike`: the correlations of measured angles, rows, with those of the replay."""
    if not (log.joint_angle.std(axis=0) > _STILL).any():
        raise InvalidValue(f"{log.name}: no joint moves: a gait is needed")
    gain, reversed_ = alike - np.diag(alike)[:, None], np.flatnonzero(np.diag(alike) < _REVERSED)
    swapped = np.argwhere(np.triu((gain > 0) & (gain.T > 0) & (gain + gain.T > _BETTER)))
    if swapped.size and len(reversed_) < len(alike):
        i, k = swapped[0] + 1
        raise InvalidValue(
            f"{log.name}: angle_{i} follows the command of joint {k} and angle_{k} that of joint {i}: are they swapped?"
        )
    if reversed_.size:
        names = ", ".join(f"angle_{i + 1}" for i in reversed_)
        raise InvalidValue(f"{log.name}: {names}: opposite to the commands: is the sign of angle or command reversed?")


def _correlation(measured: FloatArray, shown: FloatArray) -> FloatArray:
    """The correlations of all columns, zero for those that are constant."""
    both = np.column_stack([measured, shown])
    both = (both - both.mean(axis=0)) / np.maximum(both.std(axis=0), 1e-12)
    return both.T @ both / len(both)
