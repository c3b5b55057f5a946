"""What a policy may observe: quantities in groups, as data (paper, table of observations; the preference is ours).

`SENSORS` is what the robot has on board; `PRIVILEGED` is known only in simulation; `PREFERENCE` is what its user wants.
Everything is scaled to the order of one (ours; the paper does not say how).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakebench.errors import InvalidValue, UnknownName
from snakebench.physics.joints import torque_under
from snakebench.physics.record import Record
from snakebench.robot import Robot
from snakebench.value import FloatArray


class Quantity(NamedTuple):
    """Something observed: `scale` times its value in SI units, plus `offset`."""

    name: str
    width: int | None  # numbers; None for one a joint
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
LARGEST = 100.0  # of a scaled number, far beyond what swimming shows
Groups = dict[str, NDArray[np.float32]]  # observations by group
STUDENT = ("sensors",)
TEACHER = ("sensors", "privileged")


def group_width(group: str, n_joints: int) -> int:
    """How many numbers a group has: 31, 4 and 1 for 7 joints.

    Raises:
        UnknownName: when there is no such group.
    """
    if group not in GROUPS:
        raise UnknownName.among("observation group", group, GROUPS)
    return sum(_width(quantity, n_joints) for quantity in GROUPS[group])


def columns(names: Sequence[str], n_joints: int) -> NDArray[np.int64]:
    """Where the named groups or single quantities stand in a whole observation, in the order of `GROUPS`.

    Raises:
        UnknownName: when a name is neither a group nor a quantity.
    """
    known = [*GROUPS, *(quantity.name for group in GROUPS.values() for quantity in group)]
    for name in names:
        if name not in known:
            raise UnknownName.among("observation", name, known)
    chosen: list[int] = []
    place = 0
    for group, quantities in GROUPS.items():
        for quantity in quantities:
            width = _width(quantity, n_joints)
            if group in names or quantity.name in names:
                chosen += range(place, place + width)
            place += width
    return np.array(chosen, np.int64)


def grouped(whole: NDArray[np.float32], n_joints: int) -> Groups:
    """Whole observations, shape (…, width), as their groups by name."""
    cut = np.cumsum([group_width(name, n_joints) for name in GROUPS])[:-1]
    return dict(zip(GROUPS, np.split(whole, cut, axis=-1), strict=True))


class Senses:
    """What robots with equal joints feel and did last: the memory that an observation needs, of all members.

    Args:
        robot: whose joint law tells the torque.
        members: how many robots.
    """

    def __init__(self, robot: Robot, members: int = 1) -> None:
        self._robot = robot
        self._action, self._torque = np.zeros((2, members, robot.n_joints))

    def rest(self, members: Sequence[int] | slice = slice(None)) -> None:
        """Let members begin anew: no action, no torque."""
        self._action[members] = self._torque[members] = 0.0

    def act(self, action: FloatArray, now: Record) -> FloatArray:
        """Remember the action just held, shape (members, n_joints), and the torque that it ended with.

        Returns:
            The change of the applied torque since the last control step [N m], shape (members, n_joints).
        """
        torque = torque_under(self._robot, "angle", action, now.joint_angle, now.joint_rate)
        change = torque - self._torque
        self._action[:], self._torque[:] = action, torque
        return change

    def state(self) -> dict[str, FloatArray]:
        """The memory itself: what is written into these arrays is remembered."""
        return {"action": self._action, "torque": self._torque}

    def observation(self, now: Record, viscosity: FloatArray, price: FloatArray) -> FloatArray:
        """All groups side by side, scaled, shape (members, width); a run that diverged may be cut off at `LARGEST`.

        Args:
            now: the present of all members.
            viscosity: kinematic, at each head [m^2/s], shape (members,).
            price: of power, that each is charged [1/W], shape (members,).
        """
        zero = np.zeros(len(viscosity))
        values = [
            now.joint_angle,
            now.joint_rate,
            self._torque,
            np.stack([zero, zero, now.head_rate[:, 2]], axis=1),
            self._action,
            np.log10(viscosity)[:, None],
            np.stack([now.head_rate[:, 0], now.head_rate[:, 1], zero], axis=1),
            np.log10(price)[:, None],
        ]
        quantities = (*SENSORS, *PRIVILEGED, *PREFERENCE)
        whole = np.hstack([q.scale * value + q.offset for q, value in zip(quantities, values, strict=True)])
        return np.clip(np.nan_to_num(whole), -LARGEST, LARGEST)


class Pilot:
    """What acts on observations, in one run: called once a control step, it observes and tells the target angles.

    Args:
        made_for: which joints and control rate [Hz] it acts for.
        robot: that it drives.
        control_rate: at which it is called [Hz].
        price: of power, observed as the preference [1/W].
        act: from a whole scaled observation, shape (width,), and whether it is the run's first, to target angles in
            [-1, 1] rad, shape (n_joints,); it keeps its own memory.

    Raises:
        InvalidValue: when it acts for another number of joints or another control rate.
    """

    def __init__(
        self, made_for: tuple[int, int], robot: Robot, control_rate: int, price: float, act: Callable[..., FloatArray]
    ) -> None:
        if made_for != (robot.n_joints, control_rate):
            raise InvalidValue(
                f"the policy is made for {made_for[0]} joints at {made_for[1]} Hz,"
                f" the robot has {robot.n_joints} at {control_rate} Hz"
            )
        self._senses, self._price, self._act = Senses(robot), np.array([price]), act
        self._target: FloatArray | None = None

    def __call__(self, now: Record, viscosity: float) -> FloatArray:
        """Target angles [rad], shape (n_joints,), for the step that begins.

        Args:
            now: the present of the robot.
            viscosity: kinematic, at its head [m^2/s]; only what is privileged looks at it.
        """
        members, first = of_one(now), self._target is None
        if self._target is not None:
            self._senses.act(self._target[None], members)
        whole = self._senses.observation(members, np.array([viscosity]), self._price)[0].astype(np.float32)
        self._target = self._act(whole, first)
        return self._target


def of_one(now: Record) -> Record:
    """The present of a single robot as that of a batch of one."""
    return Record(*(part[None] for part in now))


def _width(quantity: Quantity, n_joints: int) -> int:
    return n_joints if quantity.width is None else quantity.width
