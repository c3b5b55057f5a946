"""How far to trust a run: the energy that the integrator loses, and bounds on the error of speed and power (ours).

What a step leaves out grows with how much the links' velocities bend within it: `bend`. Power is also wrong by what the
integrator loses. The factors below hold for 600 random gaits in six fluids and for commands made to break them; most
bounds are several times too large.
"""

import numpy as np

from snakebench.metrics import Window, inside, rates_of_links, stored_energy
from snakebench.trajectory import Trajectory

LARGEST_ERROR = 0.02  # of speed or power that goes without a flag [1] (ours)
_LOST = 1.5  # relative error of the power, in the energy lost
# Largest relative errors of an engine's v, and of its P as a share of P+, in how much velocities bend.
_SPEED_FACTORS = {"pybullet": 2.5, "planar": 0.4}  # needed were 2.0 and 0.24
_POWER_FACTORS = {"pybullet": 2.5, "planar": 1.2}  # needed were 2.0 and 0.84
_CAUTIOUS = 2.5  # of a trajectory from elsewhere


def energy_gap(trajectory: Trajectory) -> float | None:
    """What the integrator lost (or, below zero, made), as a share of the driving work of the whole run [1] (ours).

    Command work, less the change of stored energy and the work into dampers and fluid, is zero in exact arithmetic.
    None without driving work.
    """
    ends = trajectory.thinned(max(len(trajectory.time) - 1, 1))
    command, driving, dampers, fluid = ends.energy[-1] - ends.energy[0]
    stored = stored_energy(ends)
    return float((command - (stored[-1] - stored[0]) - dampers - fluid) / driving) if driving > 0 else None


def speed_error(engine: str, bent: float | None, speed: float) -> float | None:
    """A bound on the relative error of v [1], from how much velocities bend in a step [m/s]; None at a stand."""
    return None if bent is None or not speed else _SPEED_FACTORS.get(engine, _CAUTIOUS) * bent / abs(speed)


def power_error(
    engine: str, bent: float | None, swing: float, power: float, positive_power: float, gap: float | None
) -> float | None:
    """A bound on the relative error of P [1]; None without power or movement.

    It is a share of P+: driving and braking are each wrong by a share of their own, and P is their difference.
    """
    if bent is None or not power or not swing or gap is None:
        return None
    return (_LOST * abs(gap) + _POWER_FACTORS.get(engine, _CAUTIOUS) * bent / swing) * positive_power / abs(power)


def bend(trajectory: Trajectory, window: Window) -> tuple[float | None, float]:
    """How much the links' velocities bend in a physics step, and their size [m/s].

    The first is the second difference of the velocity of the links, root mean square over their mass, median over the
    window: single steps in which held targets jump do not count; None of fewer than three rows. The second is the root
    mean square velocity.
    """
    robot, velocity = trajectory.robot, rates_of_links(trajectory, inside(trajectory, window))[..., :2]
    share = robot.link_masses / robot.total_mass
    if len(velocity) < 3:
        return None, 0.0
    second = (np.diff(velocity, 2, axis=0) ** 2).sum(axis=2) @ share
    coarser = trajectory.physics_rate / trajectory.rate
    return float(np.sqrt(np.median(second))) / coarser**2, float(np.sqrt(np.mean((velocity**2).sum(axis=2) @ share)))
