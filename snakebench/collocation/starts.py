"""Where solutions start: the steady cycle of a gait, as the planar engine swims it, made to mirror itself."""

import numpy as np

from snakebench.collocation.transcription import Cycle, Mesh
from snakebench.controllers import PeriodicTargets
from snakebench.errors import InvalidValue
from snakebench.fluid import Fluid
from snakebench.metrics import swim_frequency
from snakebench.robot import Robot
from snakebench.simulation import AnyController, simulate
from snakebench.value import FloatArray

_PERIODS = 8  # that a gait swims; the last is taken
_RATE = 480  # of the swim [Hz]
_LONGEST = 30.0  # swim of a controller without a frequency [s]


def steady_cycle(controller: AnyController, robot: Robot, fluid: Fluid, mesh: Mesh, bound: float) -> Cycle:
    """The last period of a swim, the mean of its first half and the mirrored second one, on a mesh.

    Targets are those that make a servo exert the swim's command torques, within ± `bound` [rad].

    Raises:
        InvalidValue: for a swim that diverges or has no rhythm.
    """
    frequency = getattr(controller, "frequency", None)
    seconds = _LONGEST if frequency is None else _PERIODS / frequency
    swim = simulate(controller, fluid, robot=robot, engine="planar", physics_rate=_RATE, duration=round(seconds, 1))
    frequency = frequency or swim_frequency(swim)
    if swim.diverged or frequency is None:
        raise InvalidValue("a start has to swim with a rhythm: this one diverges or has none")
    n, half = robot.n_links, 0.5 / frequency
    links = swim.links
    angles = links[:, :, 2]
    rates = np.gradient(angles, 1 / swim.rate, axis=0)
    heading = angles[swim.time >= swim.time[-1] - 2 * half].mean()
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    states = np.hstack([angles, rates, swim.center_rate[:, :2] @ turn.T])
    gains = np.gradient(states[:, n:], 1 / swim.rate, axis=0)
    servo = (swim.command_torque + robot.derivative_gain * swim.joint_rate) / robot.proportional_gain
    mirror = np.array([-1.0] * (2 * n) + [1.0, -1.0])

    def folded(rows: FloatArray, places: FloatArray, signs: FloatArray) -> FloatArray:
        """The mean of a half period and the mirrored next one, at places in it."""
        first = swim.time[-1] - 2 * half - 2 / swim.rate
        halves = [
            np.stack([np.interp(first + (k + places) * half, swim.time, column) for column in rows.T], axis=1)
            for k in (0, 1)
        ]
        return (halves[0] + signs * halves[1]) / 2

    targets = folded(swim.joint_angle + servo, np.arange(mesh.knots) / mesh.knots, np.full(n - 1, -1.0))
    return Cycle(
        half,
        np.clip(targets, -bound, bound),
        folded(states, mesh.places, mirror),
        folded(gains, mesh.places[1:], mirror[n:]),
    )


def periodic_gait(cycle: Cycle) -> PeriodicTargets:
    """The whole period of a cycle as a gait."""
    targets = np.vstack([cycle.targets, -cycle.targets])
    return PeriodicTargets(period=2 * cycle.half_period, targets=tuple(map(tuple, targets.tolist())))


def released(cycle: Cycle) -> Cycle:
    """A start for linear targets from a cycle of held ones: each is the mean of those before and after its time."""
    before = np.vstack([-cycle.targets[-1:], cycle.targets[:-1]])
    return cycle._replace(targets=(before + cycle.targets) / 2)
