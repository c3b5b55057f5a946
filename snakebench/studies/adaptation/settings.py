"""Settings of the study."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from snakebench.fluid import FluidField, named_fluid
from snakebench.studies.config import Distinct
from snakebench.studies.contenders import ComparisonConfig, NameOrNone
from snakebench.value import Count, Name, Positive, Real, Value


class Course(Value):
    """A swim through a fluid that changes along time or x, by the names of its fluids."""

    along: Literal["time", "x"] = Field("time", description="coordinate: time [s] or x [m]")
    knots: tuple[Real, ...] = Field(description="increasing coordinates [s or m]")
    fluids: tuple[Name, ...] = Field(description="the fluid at each knot")
    between: Literal["ramp", "step"] = Field("ramp", description="knots: the viscosity's logarithm linear, or a jump")
    duration: Positive = Field(60.0, description="of the swim [s]")

    def field(self) -> FluidField:
        """The fluid; knots must increase, and each have its fluid."""
        fluids = tuple(named_fluid(name) for name in self.fluids)
        return FluidField(along=self.along, knots=self.knots, fluids=fluids, between=self.between)

    def stretches(self) -> Iterator[tuple[str, str, float, float]]:
        """The fluid before, the fluid after, the beginning and the end [s] of what follows each sudden change.

        Changes before the start or after the end of the swim do not count.
        """
        if self.along == "time" and self.between == "step":
            ends = [*self.knots[2:], self.duration]
            for before, after, start, end in zip(self.fluids, self.fluids[1:], self.knots[1:], ends, strict=False):
                if 0 < start < self.duration:
                    yield before, after, start, min(end, self.duration)


class Worth(Value):
    """Conditions in which the gain of tuning a gait to each fluid is estimated, from the candidates' steady swims."""

    fluids: tuple[tuple[Name, ...], ...] = Field(min_length=1, description="sets of fluids, each with equal time")
    diameters: tuple[Positive, ...] = Field((0.10,), min_length=1, description="of the robot [m]")
    powers: Distinct[Positive] = Field(
        (1.0, 2.0, 5.0, 10.0, 15.0), description="means over the fluids at which speeds are compared [W]"
    )


class AdaptationConfig(ComparisonConfig):
    """Settings of the adaptation study."""

    method: Literal["adaptation"] = "adaptation"
    viscosities: Annotated[int, Field(ge=2, le=10_000)] = Field(16, description="evaluated between 1e-7 and 1e-2 m^2/s")
    courses: dict[Name, Course] = Field(min_length=1, description="swims through changing fluids, by name")
    preferred: dict[Name, Distinct[Name]] = Field(
        {"learned_front": ("student",), "imitation": ("imitator", "imitator_positive")},
        description="policies with an adjustable preference, by their study",
    )
    powers: Distinct[Positive] = Field(
        (1.0, 3.0, 5.0, 10.0), description="means over the fluids for which preferences are chosen [W]"
    )
    limit: NameOrNone = Field("limit", description="study of the limit of the body, whose results may be missing")
    candidates: Annotated[int, Field(ge=2, le=1000)] = Field(24, description="gaits tried of each front of fixed gaits")
    worth: Worth | None = Field(None, description="conditions in which the gain of tuning is estimated")
    shown: tuple[Name, ...] = Field(
        ("student", "fourier"), description="policies, of their first seed, and methods whose single gait is shown"
    )
    planar_rate: Count = Field(180, description="of the second engine [Hz]; the limit's gaits need more than 90")
