"""A scenario: where and how a controller is tried."""

from typing import Any, Self

from pydantic import Field, model_validator

from snakebench.engines import PHYSICS_RATES, EngineName
from snakebench.errors import InvalidValue
from snakebench.fluid import AnyMedium, Medium
from snakebench.physics.record import row_width
from snakebench.robot import AnyRobot, Robot
from snakebench.value import Count, Positive, Value

_MOST_BYTES = 2_000_000_000  # of a run's record
_PEAK = 2.4, 600  # of memory while a run is made and measured: times its record, and beside that a step [bytes]


class Scenario(Value):
    """Where and how a controller is tried: from rest, straight, heading +x.

    Raises:
        InvalidValue: when a field is out of range, or the physics rate is no multiple of the control rate.
    """

    fluid: AnyMedium = Field("water", validate_default=True, description="a Fluid, a FluidField or a name")
    robot: AnyRobot = Field(default_factory=Robot, description="a Robot or a name")
    engine: EngineName = "pybullet"
    physics_rate: Count = Field(
        default_factory=lambda fields: PHYSICS_RATES.get(fields.get("engine", ""), 480),
        description="physics steps per second [Hz]",
    )
    control_rate: Count = Field(30, description="policy steps per second [Hz]")
    duration: Positive = Field(30.0, description="length of the run [s]")

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


def scenario_of(where: Scenario | Medium | str | None, scenario: Scenario | None, **settings: Any) -> Scenario:
    """The scenario that the arguments of `simulate` describe; None is what is not given."""
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
