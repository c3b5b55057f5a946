"""The one way to a number: a controller in a scenario gives a trajectory, and a trajectory an evaluation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, Self, runtime_checkable

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator

from snakebench import engines, metrics
from snakebench.controllers import GAITS, Controller, Drives
from snakebench.engines import PHYSICS_RATES, EngineName, load_engine
from snakebench.errors import InvalidValue
from snakebench.fluid import Medium, named_fluid
from snakebench.hydrodynamics import viscosity_at
from snakebench.memory import check_memory
from snakebench.registry import Registry, to_be_called
from snakebench.reward import episode_return
from snakebench.robot import AnyRobot, Robot
from snakebench.sources import code_digest, plugin_digest
from snakebench.trajectory import Record, Trajectory, row_width
from snakebench.value import Count, FloatArray, Positive, Value, digest

ENERGY_BOUND = 0.1  # largest part of the driving work that the integrator may lose or make in a valid run (ours)
_MOST_BYTES = 2_000_000_000  # of a run's record
_PEAK = 2.4, 600  # of memory while a run is made and measured: times its record, and beside that a step [bytes]

_CODE = code_digest("controllers.py", "evaluation.py", "metrics.py", "observation.py", "policy.py", "reward.py")


class Scenario(Value):
    """Where and how a controller is tried: from rest, straight, heading +x.

    Raises:
        InvalidValue: when a field is out of range, or the physics rate is no multiple of the control rate.
    """

    fluid: Medium = Field(default_factory=lambda: named_fluid("water"), description="a Fluid, a FluidField or a name")
    robot: AnyRobot = Field(default_factory=Robot, description="a Robot or a name")
    engine: EngineName = "pybullet"
    physics_rate: Count = Field(
        default_factory=lambda fields: PHYSICS_RATES.get(fields.get("engine", ""), 480),
        description="physics steps per second [Hz]",
    )
    control_rate: Count = Field(30, description="policy steps per second [Hz]")
    duration: Positive = Field(30.0, description="length of the run [s]")

    @field_validator("fluid", mode="before")
    @classmethod
    def _by_name(cls, fluid: object) -> object:
        return named_fluid(fluid) if isinstance(fluid, str) else fluid

    @model_validator(mode="after")
    def _whole_steps(self) -> Self:
        if self.physics_rate % self.control_rate:
            raise ValueError(f"physics_rate {self.physics_rate} must be a multiple of control_rate {self.control_rate}")
        most = _MOST_BYTES // (8 * row_width(self.robot.n_joints))
        if self.duration * self.control_rate < 1 or self.duration * self.physics_rate > most:
            raise ValueError(
                f"duration = {self.duration} s is out of range: at least a control step, {1 / self.control_rate:.3g} s,"
                f" and at most {most} physics steps, {most / self.physics_rate:.3g} s at {self.physics_rate} Hz"
            )
        return self

    @property
    def n_steps(self) -> int:
        """Number of physics steps, of whole control steps, as many as come nearest to the duration."""
        return round(self.duration * self.control_rate) * (self.physics_rate // self.control_rate)

    @property
    def memory(self) -> float:
        """What an evaluation here takes at most, beside what the process takes in any case [bytes]; measured."""
        records, beside = _PEAK
        return self.n_steps * (records * 8 * row_width(self.robot.n_joints) + beside)


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
    energy_gap: float | None = Field(None, description="lost by the integrator, as a share of the driving work [1]")
    episode_return: float | None = Field(None, alias="return", description="J over the run from rest [1]")

    def row(self) -> dict[str, str | bool | float | None]:
        """The evaluation as a table's row: plain values by name, metrics of plug-ins among them.

        Example:
            >>> sb.evaluate(gait, "oil1", engine="planar").row()["status"]
            'ok'
        """
        return self.model_dump()


def _complaint(name: str, metric: object) -> str | None:
    """What is wrong with what is to be registered as a metric of that name; the name becomes one of a column."""
    own = {field.alias or name for name, field in Evaluation.model_fields.items()} | Evaluation.model_fields.keys()
    if name in own.union(*(gait.SPACE for gait in GAITS.values())):
        return "there is a column of that name already: give yours another one"
    if not name.isidentifier():
        return "a name of letters, digits and _ is needed"
    return to_be_called(name, metric)


# Further metrics, of plug-ins: each a number of a run that did not diverge over a window, None where it is not defined.
Metric = Callable[[Trajectory, metrics.Window], float | None]
METRICS: Registry[Metric] = Registry("metric", {}, _complaint)


@runtime_checkable
class ClosedLoop(Protocol):
    """A controller that looks at the robot before it tells each control step's target angles, such as a policy."""

    @property
    def drives(self) -> Drives:
        """Target angles."""

    def begin(self, robot: Robot, control_rate: int) -> Callable[[Record, float], FloatArray]:
        """What tells the target angles [rad] of a step from the present and the viscosity at the head [m^2/s].

        Raises:
            InvalidValue: when it is made for another number of joints or another control rate [Hz].
        """

    def digest(self) -> str:
        """A hash of everything that determines the target angles."""


AnyController = Controller | ClosedLoop


class Swim:
    """A run in control steps: target angles from outside are held for a control step each; a context manager.

    Attributes:
        scenario: where.
        steps: control steps made so far.

    Raises:
        UnstableRate: when the engine needs a higher physics rate for this robot.
    """

    def __init__(self, scenario: Scenario) -> None:
        check_scenario(scenario, "angle")
        self.scenario, self.steps, self._alive = scenario, 0, True
        self._every = scenario.physics_rate // scenario.control_rate
        self._engine = load_engine(scenario.engine).open_simulation(
            scenario.robot, scenario.fluid, "angle", scenario.physics_rate, scenario.n_steps
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._engine.__exit__(*error)

    @property
    def now(self) -> Record:
        """The present of the robot, valid until the next step."""
        return self._engine.now

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity at the head's centre, now [m^2/s]."""
        time = self.steps / self.scenario.control_rate
        return viscosity_at(self.scenario.fluid, time, float(self.now.head[0]))

    @property
    def alive(self) -> bool:
        """Whether the run has not diverged."""
        return self._alive

    @property
    def over(self) -> bool:
        """Whether the run has diverged or lasted as long as it should."""
        return not self._alive or self.steps * self._every == self.scenario.n_steps

    def hold(self, target: FloatArray) -> None:
        """Hold target angles [rad], shape (n_joints,), for a control step; they are clipped to [-1, 1].

        Raises:
            InvalidValue: when they do not fit or are not finite.
        """
        self._alive = self._engine.advance(np.tile(np.clip(target, -1.0, 1.0), (self._every, 1)))
        self.steps += 1

    def trajectory(self) -> Trajectory:
        """All physics steps made so far."""
        return self._engine.trajectory()


def check_controller(controller: object) -> None:
    """Make sure that something is a gait or a policy.

    Raises:
        InvalidValue: otherwise.
    """
    if isinstance(controller, type) or not isinstance(controller, ClosedLoop | Controller):
        raise InvalidValue(f"controller = {controller!r}: a gait with its parameters or a policy is needed")


def check_scenario(scenario: Scenario, drives: Drives) -> None:
    """Make sure that a run fits into memory, and that the engine is stable for gaits that drive angle or torque.

    Raises:
        InvalidValue: when the run does not fit, with the memory needed and available.
        UnstableRate: when the physics rate is too low, with the rate that is needed.
    """
    check_memory(f"duration = {scenario.duration} s", scenario.memory)
    needed = load_engine(scenario.engine).stable_rate(scenario.robot, drives)
    engines.check_rate(scenario.engine, needed, drives, scenario.physics_rate, scenario.control_rate)


def simulate(
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
) -> Trajectory:
    """Let a controller swim, from rest.

    What is not given is as in the scenario, or as the defaults of `Scenario`: in water, the paper's robot, PyBullet at
    480 Hz, 30 control steps per second, for 30 s.

    Args:
        controller: a gait or a policy.
        where: a scenario or a fluid; as `scenario` or `fluid`.
        fluid: a `Fluid`, a `FluidField`, a name such as "oil1", or VISCOSITY,DENSITY as "1e-3,900" [m^2/s, kg/m^3].
        robot: a `Robot` or a name.
        engine: "pybullet" or "planar".
        physics_rate: physics steps per second [Hz], a multiple of the control rate.
        control_rate: policy steps per second [Hz].
        duration: length of the run [s].
        scenario: all of these in one; those given beside it change it.

    Raises:
        InvalidValue: for an invalid setting, or a controller made for another robot.
        UnstableRate: when the engine needs a higher physics rate for this robot and gait.

    Example:
        >>> gait = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
        >>> sb.simulate(gait, "oil1", engine="planar", duration=5.0).time[-1]
        5.0
    """
    check_controller(controller)
    settings = {"fluid": fluid, "robot": robot, "engine": engine, "duration": duration}
    scenario = scenario_of(where, scenario, **settings, physics_rate=physics_rate, control_rate=control_rate)
    if isinstance(controller, ClosedLoop):
        choose = controller.begin(scenario.robot, scenario.control_rate)
        with Swim(scenario) as swim:
            while not swim.over:
                swim.hold(choose(swim.now, swim.viscosity))
            return swim.trajectory()
    check_scenario(scenario, controller.drives)
    steps, drives = scenario.n_steps, controller.drives
    with load_engine(scenario.engine).open_simulation(
        scenario.robot, scenario.fluid, drives, scenario.physics_rate, steps
    ) as simulation:
        simulation.follow(controller, steps)
        return simulation.trajectory()


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
    """All metrics of a trajectory over its steady window, and its return over the whole run."""
    earned = episode_return(trajectory, control_rate)
    if trajectory.diverged:
        undefined = dict.fromkeys(METRICS)
        return Evaluation(status="diverged", steady=False, episode_return=_finite(earned), **undefined)
    frequency = metrics.swim_frequency(trajectory)
    window = metrics.steady_window(trajectory, frequency)
    v, p, gap = metrics.speed(trajectory, window), metrics.power(trajectory, window), metrics.energy_gap(trajectory)
    p_plus, mass = metrics.positive_power(trajectory, window), trajectory.robot.total_mass
    impossible = trajectory.command_work[-1] < 0 or (window.steady and p < 0)
    closes = gap is None or abs(gap) <= ENERGY_BOUND
    return Evaluation(
        status="invalid" if impossible or not closes else "ok",
        steady=window.steady,
        speed=v,
        path_speed=metrics.path_speed(trajectory, window),
        power=p,
        positive_power=p_plus,
        cost_of_transport=metrics.cost_of_transport(p, v, mass),
        positive_cost_of_transport=metrics.positive_cost_of_transport(p, p_plus, v, mass),
        swim_frequency=frequency,
        tail_amplitude=metrics.tail_amplitude(trajectory, window, frequency),
        wave_speed=metrics.wave_speed(trajectory, frequency),
        joint_amplitude=metrics.joint_amplitude(trajectory, window, frequency),
        torque_amplitude=metrics.torque_amplitude(trajectory, window, frequency),
        command_torque_rms=metrics.command_torque_rms(trajectory, window),
        command_torque_peak=metrics.command_torque_peak(trajectory, window),
        joint_speed_peak=metrics.joint_speed_peak(trajectory, window),
        heat=metrics.heat(trajectory, window),
        heading_drift=metrics.heading_drift(trajectory, window),
        energy_gap=gap,
        episode_return=earned,
        **{name: _further(name, metric(trajectory, window)) for name, metric in METRICS.items()},
    )


def evaluation_key(controller: AnyController, scenario: Scenario) -> str:
    """The hash of everything that determines an evaluation: controller, scenario, engine, and the code of them all."""
    further = [f"{name} {plugin_digest(metric)}" for name, metric in METRICS.items()]
    versions = [load_engine(scenario.engine).VERSION, _CODE, *further]
    return digest([controller.digest(), scenario.digest(), versions])


def _further(name: str, value: object) -> float | None:
    """What a metric of a plug-in tells; None for what is not finite.

    Raises:
        InvalidValue: when it is no number.
    """
    if value is not None and not isinstance(value, int | float | np.integer | np.floating):
        raise InvalidValue(f"metric {name!r}: {value!r} is no number")
    return None if value is None else _finite(float(value))


def scenario_of(where: Scenario | Medium | str | None, scenario: Scenario | None, **settings: Any) -> Scenario:
    """The scenario that the arguments of `simulate` describe; None is what is not given.

    Raises:
        InvalidValue: when it is impossible, or one argument says what another one says.
    """
    given = {name: value for name, value in {**settings, "scenario": scenario}.items() if value is not None}
    if where is not None:
        name = "scenario" if isinstance(where, Scenario) else "fluid"
        if name in given:
            raise InvalidValue(f"{name} = {given[name]!r}: another one is given by its place: one is allowed")
        given[name] = where
    base = given.pop("scenario", None)
    if base is not None and not isinstance(base, Scenario):
        raise InvalidValue(f"scenario = {base!r}: a Scenario is needed")
    return Scenario(**given) if base is None else base.but(**given)


def _finite(number: float | None) -> float | None:
    return number if number is not None and np.isfinite(number) else None
