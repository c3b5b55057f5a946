"""One instant of a run as a row of numbers, and the bounds beyond which a run has diverged."""

from typing import NamedTuple

from snakebench.compilation import njit
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
    command_torque: FloatArray  # u_in, as the engine applies it at this instant, per joint [N m]
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


def as_record(rows: FloatArray, n_joints: int) -> Record:
    """The named parts of rows of numbers, shape (..., row_width(n_joints)), as views with the same leading axes."""
    return Record(*(part.T for part in record_of.py_func(rows.T, n_joints)))


def row_width(n_joints: int) -> int:
    """How many numbers describe one instant."""
    return 14 + 5 * n_joints
