"""What a policy may observe: quantities in groups, as data, each scaled to the order of one (ours).

`SENSORS` are on board, `PRIVILEGED` is known only in simulation (paper, table of observations), `PREFERENCE` is what
the user wants (ours).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakebench.errors import InvalidValue, UnknownName
from snakebench.physics.joints import torque_under
from snakebench.physics.record import Record
from snakebench.robot import Robot
from snakebench.value import FloatArray


class Quantity(NamedTuple):
    """An observed quantity: `scale` times its value in SI units, plus `offset`."""

    name: str
    width: int | None  # how many numbers; None for one a joint
    scale: float
    offset: float = 0.0


SENSORS = (
    Quantity("joint angle", None, 1.0),  # q [rad]
    Quantity("joint rate", None, 0.1),  # dq/dt [rad/s]
    Quantity("joint torque", None, 0.2),  # u, applied, under the last action [N m]
    Quantity("head turning", 3, 0.2),  # angular velocity about x, y, z; the first two are 0 in a plane [rad/s]
    Quantity("last action", None, 1.0),  # target angles [rad]
)
PRIVILEGED = (
    Quantity("viscosity", 1, 0.4, 1.8),  # log10 of the kinematic viscosity at the head [m^2/s]: -1 at 1e-7, 1 at 1e-2
    Quantity("head velocity", 3, 1.0),  # x, y, z in the world frame; the last is 0 in a plane [m/s]
)
PREFERENCE = (Quantity("price of power", 1, 0.75, 0.75),)  # log10 of w_5's size [1/W]: about -1 at 0.005, 1 at 2
GROUPS = {"sensors": SENSORS, "privileged": PRIVILEGED, "preference": PREFERENCE}  # new ones come last: see `LAYOUT`
LAYOUT = tuple(f"{group}: {q.name} x {q.scale:g} + {q.offset:g}" for group in GROUPS for q in GROUPS[group])
LARGEST = 100.0  # of a scaled number, far beyond what swimming reaches
Groups = dict[str, NDArray[np.float32]]  # observations by group
STUDENT = ("sensors",)
TEACHER = ("sensors", "privileged")
_QUANTITIES = [quantity for group in GROUPS.values() for quantity in group]


def columns(names: Sequence[str], n_joints: int) -> NDArray[np.int64]:
    """Columns of the named groups or quantities in a whole observation, in the order of `GROUPS`."""
    known = [*GROUPS, *(quantity.name for quantity in _QUANTITIES)]
    for name in names:
        if name not in known:
            raise UnknownName.among("observation", name, known)
    chosen = [group in names or q.name in names for group, quantities in GROUPS.items() for q in quantities]
    return np.flatnonzero(np.repeat(chosen, _widths(n_joints)))


def grouped(whole: NDArray[np.float32], n_joints: int) -> Groups:
    """Whole observations, shape (…, width), as their groups by name."""
    ends = np.cumsum([len(columns([name], n_joints)) for name in GROUPS])
    return dict(zip(GROUPS, np.split(whole, ends[:-1], axis=-1), strict=True))


class Senses:
    """What robots with equal joints observe, and the last action and torque that an observation includes."""

    def __init__(self, robot: Robot, members: int = 1) -> None:
        self._robot = robot
        self._action, self._torque = np.zeros((2, members, robot.n_joints))
        self._scale, self._offset = (
            np.repeat(part, _widths(robot.n_joints)) for part in zip(*(q[2:] for q in _QUANTITIES), strict=True)
        )

    def rest(self, members: Sequence[int] | slice = slice(None)) -> None:
        """Let members begin an episode: no action, no torque."""
        self._action[members] = self._torque[members] = 0.0

    def act(self, action: FloatArray, now: Record) -> FloatArray:
        """Remember the action just held [rad]; returns the torque's change in the control step [N m].

        Both have the shape (members, n_joints).
        """
        torque = torque_under(self._robot, "angle", action, now.joint_angle, now.joint_rate)
        change = torque - self._torque
        self._action[:], self._torque[:] = action, torque
        return change

    def state(self) -> dict[str, FloatArray]:
        """The last action and torque themselves, not copies: what is written into them is remembered."""
        return {"action": self._action, "torque": self._torque}

    def observation(self, now: Record, viscosity: FloatArray, price: FloatArray) -> NDArray[np.float32]:
        """All groups side by side, scaled, shape (members, width); a run that diverged may be cut off at `LARGEST`.

        `viscosity` is kinematic, at each head [m^2/s], `price` that of power for each member [1/W]: shape (members,).
        """
        zero = np.zeros(len(viscosity))
        sensors = now.joint_angle, now.joint_rate, self._torque, zero, zero, now.head_rate[:, 2], self._action
        privileged = np.log10(viscosity), now.head_rate[:, 0], now.head_rate[:, 1], zero
        whole = self._scale * np.column_stack([*sensors, *privileged, np.log10(price)]) + self._offset
        return np.clip(np.nan_to_num(whole), -LARGEST, LARGEST).astype(np.float32)


class Pilot:
    """A policy in one run: called once a control step, it observes and returns the target angles.

    `made_for` are its number of joints and its control rate [Hz]. `act` makes of a whole scaled observation, shape
    (width,), and of the policy's memory target angles in [-1, 1] rad, shape (n_joints,), and the memory afterwards.
    """

    def __init__(
        self,
        made_for: tuple[int, int],
        robot: Robot,
        control_rate: int,
        price: float,
        act: Callable[[NDArray[np.float32], Any], tuple[NDArray[Any], Any]],
        memory: Any,
    ) -> None:
        if made_for != (robot.n_joints, control_rate):
            raise InvalidValue(
                f"the policy is made for {made_for[0]} joints at {made_for[1]} Hz,"
                f" the robot has {robot.n_joints} at {control_rate} Hz"
            )
        self._senses, self._price, self._act, self._memory = Senses(robot), np.array([price]), act, memory
        self._target: FloatArray | None = None

    def __call__(self, now: Record, viscosity: float) -> FloatArray:
        """Target angles [rad], shape (n_joints,), for the step that begins, at a kinematic viscosity [m^2/s]."""
        members = of_one(now)
        if self._target is not None:
            self._senses.act(self._target[None], members)
        observation = self._senses.observation(members, np.array([viscosity]), self._price)[0]
        target, self._memory = self._act(observation, self._memory)
        self._target = target.astype(np.float64)
        return self._target


def of_one(now: Record) -> Record:
    """The present of a single robot as that of a batch of one."""
    return Record(*(part[None] for part in now))


def _widths(n_joints: int) -> list[int]:
    return [n_joints if quantity.width is None else quantity.width for quantity in _QUANTITIES]
