"""The one way to a number: a controller in a scenario gives a trajectory, and a trajectory an evaluation."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from pydantic import ConfigDict, Field

from snakebench import accuracy, metrics
from snakebench.controllers import GAITS
from snakebench.errors import InvalidValue
from snakebench.fluid import Medium
from snakebench.registry import Registry, to_be_called
from snakebench.reward import episode_return
from snakebench.robot import Robot
from snakebench.scenario import Scenario, scenario_of
from snakebench.simulation import AnyController, simulate
from snakebench.trajectory import Trajectory
from snakebench.value import Value

ENERGY_BOUND = 0.1  # largest part of the driving work that the integrator may lose or make in a valid run (ours)


class Evaluation(Value):
    """What a controller achieved in a scenario; SI units, None where a number is not defined.

    Metrics of plug-ins stand beside its own, by their names.
    """

    model_config = ConfigDict(serialize_by_alias=True, validate_by_name=True, extra="allow")
    __pydantic_extra__: dict[str, float | None] = Field(init=False)

    status: Literal["ok", "diverged", "invalid"] = Field(
        description="diverged: not finite or too fast; invalid: negative work over the run, negative power in steady"
        " swimming, or energies that do not close"
    )
    steady: bool = Field(description="measured between three clear peaks of a velocity that has settled")
    speed: float | None = Field(None, description="v along x, signed [m/s]")
    path_speed: float | None = Field(None, description="along the mean course [m/s]")
    power: float | None = Field(None, description="mean command power P [W]")
    positive_power: float | None = Field(None, description="P+ of the joints that drive, what a battery pays [W]")
    cost_of_transport: float | None = Field(None, description="CoT = P / (m g v) [1]")
    positive_cost_of_transport: float | None = Field(None, description="CoT+ = P+ / (m g v) [1]")
    swim_frequency: float | None = Field(None, description="of the last joint's angle [Hz]")
    tail_amplitude: float | None = Field(None, description="half peak-to-peak across the course, mean of periods [m]")
    wave_speed: float | None = Field(None, description="of bending, along the body towards the tail [m/s]")
    joint_amplitude: float | None = Field(None, description="half peak-to-peak of the widest joint [rad]")
    torque_amplitude: float | None = Field(None, description="half peak-to-peak of the largest applied torque [N m]")
    command_torque_rms: float | None = Field(None, description="of the joint where it is largest [N m]")
    command_torque_peak: float | None = Field(None, description="largest of any joint [N m]")
    joint_speed_peak: float | None = Field(None, description="largest of any joint [rad/s]")
    heat: float | None = Field(None, description="mean of the sum of squared command torques [N^2 m^2]")
    heading_drift: float | None = Field(None, description="turning of the body [rad/s]")
    speed_error: float | None = Field(None, description="bound on the relative error of v that the step makes [1]")
    power_error: float | None = Field(None, description="bound on the relative error of P that the step makes [1]")
    energy_gap: float | None = Field(None, description="lost by the integrator, as a share of the driving work [1]")
    episode_return: float | None = Field(None, alias="return", description="J over the run from rest [1]")

    @property
    def uncertain(self) -> dict[str, float]:
        """Which of speed and power may be wrong by more than 2 %, and by how much [1]."""
        errors = {"speed": self.speed_error, "power": self.power_error}
        return {name: error for name, error in errors.items() if error is not None and error > accuracy.LARGEST_ERROR}

    def row(self) -> dict[str, str | bool | float | None]:
        """The evaluation as a table's row: plain values by name, metrics of plug-ins among them.

        Example:
            >>> sb.evaluate(gait, "oil1", engine="planar").row()["status"]
            'ok'
        """
        return self.model_dump()


def _complaint(name: str, metric: object) -> str | None:
    own = {field.alias or name for name, field in Evaluation.model_fields.items()} | Evaluation.model_fields.keys()
    if name in own.union(*(gait.SPACE for gait in GAITS.values())):
        return "there is a column of that name already: give yours another one"
    if not name.isidentifier():
        return "a name of letters, digits and _ is needed"
    return to_be_called(name, metric)


# Further metrics, of plug-ins: each a number of a run that did not diverge over a window, None where it is not defined.
Metric = Callable[[Trajectory, metrics.Window], float | None]
METRICS: Registry[Metric] = Registry("metric", {}, _complaint)
_MEANS = metrics.speed, metrics.power, metrics.positive_power, metrics.heat
_LOADS = metrics.command_torque_rms, metrics.command_torque_peak, metrics.joint_speed_peak
_OF_PERIODS = (  # of whole gait periods
    *(metrics.path_speed, metrics.heading_drift),
    *(metrics.tail_amplitude, metrics.joint_amplitude, metrics.torque_amplitude),
)
_NOTHING = 1e-4, 1e-3  # of the power below zero: that is none [W], and that share of P+ [1] (ours)


def evaluate(
    controller: AnyController,
    where: Scenario | Medium | str | None = None,
    /,
    *,
    fluid: Medium | str | None = None,
    robot: Robot | str | None = None,
    engine: str | None = None,
    physics_rate: int | None = None,
    control_rate: int | None = None,
    duration: float | None = None,
    scenario: Scenario | None = None,
) -> Evaluation:
    """Let a controller swim and measure it; arguments and errors as `simulate`.

    Example:
        >>> gait = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
        >>> sb.evaluate(gait, "oil1", engine="planar").status
        'ok'
    """
    settings = {"fluid": fluid, "robot": robot, "engine": engine, "duration": duration}
    scenario = scenario_of(where, scenario, **settings, physics_rate=physics_rate, control_rate=control_rate)
    return measure(simulate(controller, scenario), scenario.control_rate)


def measure(trajectory: Trajectory, control_rate: int = 30) -> Evaluation:
    """All metrics of a trajectory over its steady window, and its return over the whole run.

    Raises:
        InvalidValue: when the control rate [Hz] is no whole number from 1, or does not divide the physics rate.
    """
    if type(control_rate) is not int or control_rate < 1:
        raise InvalidValue(f"control_rate = {control_rate!r}: a whole number from 1 is needed")
    earned = episode_return(trajectory, control_rate)
    if trajectory.diverged:
        return Evaluation(status="diverged", steady=False, episode_return=_finite(earned), **dict.fromkeys(METRICS))
    frequency = metrics.swim_frequency(trajectory)
    window = metrics.steady_window(trajectory, frequency)
    means = {metric.__name__: metric(trajectory, window) for metric in _MEANS + _LOADS}
    of_periods = {metric.__name__: metric(trajectory, window, frequency) for metric in _OF_PERIODS}
    v, p, p_plus, mass = means["speed"], means["power"], means["positive_power"], trajectory.robot.total_mass
    gap, (bent, swing) = accuracy.energy_gap(trajectory), accuracy.bend(trajectory, window)
    spent = trajectory.command_work[-1] + metrics.stored_energy(trajectory, slice(1))[0]  # of what it had, too
    impossible = spent < 0 or (window.steady and p < -max(_NOTHING[0], _NOTHING[1] * p_plus))
    closes = gap is None or abs(gap) <= ENERGY_BOUND
    return Evaluation(
        status="invalid" if impossible or not closes else "ok",
        steady=window.steady,
        cost_of_transport=metrics.cost_of_transport(p, v, mass),
        positive_cost_of_transport=metrics.cost_of_transport(p_plus, v, mass),
        swim_frequency=frequency,
        wave_speed=metrics.wave_speed(trajectory, frequency),
        speed_error=accuracy.speed_error(trajectory.engine, bent, v),
        power_error=accuracy.power_error(trajectory.engine, bent, swing, p, p_plus, gap),
        energy_gap=gap,
        episode_return=earned,
        **means,
        **of_periods,
        **{name: _further(name, metric(trajectory, window)) for name, metric in METRICS.items()},
    )


def _further(name: str, value: object) -> float | None:
    """The number of a plug-in's metric; None for what is not finite."""
    if value is not None and not isinstance(value, int | float | np.integer | np.floating):
        raise InvalidValue(f"metric {name!r}: {value!r} is no number")
    return None if value is None else _finite(float(value))


def _finite(number: float | None) -> float | None:
    return number if number is not None and np.isfinite(number) else None
