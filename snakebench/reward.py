"""The reward of a control step, term by term, and the return of an episode (paper, tables of the reward)."""

from typing import NamedTuple

import numpy as np

from snakebench.errors import InvalidValue
from snakebench.physics.joints import torque_under
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray


class Weights(NamedTuple):
    """Weights of the reward terms (paper, table of reward weights); every reported return uses these."""

    propulsion: float = 10.0  # w_1 [s/m]
    action: float = -0.08  # w_2 [1/rad^2]
    joint_rate: float = -0.002  # w_3 [s^2/rad^2]
    torque_rate: float = -0.02  # w_4 [1/(N m)^2]
    work: float = -0.005  # w_5 [1/W]
    termination: float = -10_000.0  # w_6


WEIGHTS = Weights()
PUBLISHED_PRICE = -WEIGHTS.work  # of power [1/W]
_ROOT = 16.0  # weight of the root of speed: as steep as 10 v at 0.64 m/s, about the fastest there is [(s/m)^1/2] (ours)


def check_price(price: float) -> float:
    """The same price of power [1/W], if it is finite and positive."""
    if not 0 < price < np.inf:
        raise InvalidValue(f"price = {price!r}: a finite positive number of 1/W is needed")
    return price


def preferred(reward: FloatArray, velocity: FloatArray, power: FloatArray, price: FloatArray) -> FloatArray:
    """The reward of control steps at a price of power (ours); all arrays have shape (n_steps,).

    It is the published reward with w_5 = -price and with 16 times the signed root of the velocity in place of 10 times
    the velocity. With the velocity itself, from some price on the best gait in the oils is to stand still: the other
    terms exceed what a slow gait earns. The root has an infinite slope at rest, so that some gait always pays.

    Args:
        reward: published, of the step.
        velocity: mean forward velocity over the step [m/s].
        power: command work done in the step over its duration [W].
        price: of power [1/W].
    """
    root = np.sign(velocity) * np.sqrt(np.abs(velocity))
    return reward + _ROOT * root - WEIGHTS.propulsion * velocity + (PUBLISHED_PRICE - price) * power


def rewards(
    velocity: FloatArray,
    action: FloatArray,
    joint_rate: FloatArray,
    torque_change: FloatArray,
    power: FloatArray,
) -> FloatArray:
    """The reward r_n of each control step, without the termination penalty, shape (n_steps,).

    Args:
        velocity: mean forward velocity of the centre of mass over the step [m/s], shape (n_steps,).
        action: target angles at the step's start [rad], shape (n_steps, n_joints).
        joint_rate: joint speeds at the step's end [rad/s], shape (n_steps, n_joints).
        torque_change: applied torque at the step's end, under its own target, minus the step before's [N m], shape
            (n_steps, n_joints).
        power: command work done in the step over its duration [W], shape (n_steps,).

    Velocity and power are means over the step, not samples (ours): nothing is hidden between samples.
    """
    return (
        WEIGHTS.propulsion * velocity
        + WEIGHTS.action * np.sum(action**2, axis=-1)
        + WEIGHTS.joint_rate * np.sum(joint_rate**2, axis=-1)
        + WEIGHTS.torque_rate * np.sum(torque_change**2, axis=-1)
        + WEIGHTS.work * power
    )


def episode_return(trajectory: Trajectory, control_rate: int) -> float | None:
    """The return J = sum of r_n times the control step, over the whole run [dimensionless].

    None for gaits that drive torque, which have no target angle, and for thinned trajectories. A diverged run pays the
    termination penalty. The factor of the control step is ours: without it the returns in the paper would mean about
    0.01 m/s.

    Raises:
        InvalidValue: when the control rate does not divide the physics rate.
    """
    if trajectory.drives != "angle" or trajectory.rate != trajectory.physics_rate:
        return None
    every, rest = divmod(round(trajectory.rate), control_rate)
    if rest:
        raise InvalidValue(f"control rate {control_rate} Hz must divide the physics rate {trajectory.rate:g} Hz")
    ends = np.arange(every, len(trajectory.time), every)
    starts = ends - every
    angle, rate = trajectory.joint_angle[ends], trajectory.joint_rate[ends]
    torque = torque_under(trajectory.robot, trajectory.drives, trajectory.command[ends - 1], angle, rate)
    reward = rewards(
        velocity=(trajectory.center[ends, 0] - trajectory.center[starts, 0]) * control_rate,
        action=trajectory.command[starts],
        joint_rate=rate,
        torque_change=np.diff(torque, axis=0, prepend=np.zeros((1, torque.shape[1]))),
        power=(trajectory.command_work[ends] - trajectory.command_work[starts]) * control_rate,
    )
    penalty = WEIGHTS.termination if trajectory.diverged else 0.0
    return float(sum(reward.tolist(), penalty) / control_rate)
