"""A controller in a scenario gives a trajectory."""

from collections.abc import Callable
from typing import Protocol, Self, get_args, runtime_checkable

import numpy as np

from snakebench.controllers import Controller
from snakebench.engines import check_rate, load_engine
from snakebench.errors import InvalidValue
from snakebench.fluid import Medium
from snakebench.memory import check_memory
from snakebench.physics.body import viscosity_at
from snakebench.physics.joints import Drives
from snakebench.physics.record import Record
from snakebench.robot import Robot
from snakebench.scenario import Scenario, scenario_of
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray


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
    """A run in control steps: target angles from outside are held for a control step each; a context manager."""

    def __init__(self, scenario: Scenario) -> None:
        check_scenario(scenario, "angle")
        self.scenario, self.steps, self.alive = scenario, 0, True
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
    def over(self) -> bool:
        """Whether the run has diverged or lasted as long as it should."""
        return not self.alive or self.steps * self._every == self.scenario.n_steps

    def hold(self, target: FloatArray) -> None:
        """Hold target angles [rad], shape (n_joints,), for a control step; they are clipped to [-1, 1]."""
        self.alive = self._engine.advance(np.tile(np.clip(target, -1.0, 1.0), (self._every, 1)))
        self.steps += 1

    def trajectory(self) -> Trajectory:
        """All physics steps made so far."""
        return self._engine.trajectory()


def check_controller(controller: object) -> None:
    """Make sure that something is a gait or a policy."""
    if isinstance(controller, type) or not isinstance(controller, ClosedLoop | Controller):
        raise InvalidValue(f"controller = {controller!r}: a gait with its parameters or a policy is needed")
    allowed = ("angle",) if isinstance(controller, ClosedLoop) else get_args(Drives)
    if controller.drives not in allowed:
        of = f"{type(controller).__name__}: drives = {controller.drives!r}"
        raise InvalidValue(f"{of}: it drives {' or '.join(allowed)}")


def check_scenario(scenario: Scenario, drives: Drives) -> None:
    """Make sure that a run fits into memory, and that the engine is stable for gaits that drive angle or torque."""
    check_memory(f"duration = {scenario.duration} s", scenario.memory)
    needed = load_engine(scenario.engine).stable_rate(scenario.robot, drives)
    check_rate(scenario.engine, needed, drives, scenario.physics_rate, scenario.control_rate)


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
