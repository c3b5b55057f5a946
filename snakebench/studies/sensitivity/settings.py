"""Settings of the study."""

from typing import Literal, Self

from pydantic import Field, model_validator

from snakebench.robot import Robot
from snakebench.studies.contenders import ComparisonConfig, Pilots
from snakebench.studies.pareto.settings import ParetoConfig, Steps
from snakebench.studies.search_settings import Space
from snakebench.value import Count, Name, Positive, Value


class Body(Value):
    """A robot of another shape; the paper's by default."""

    joints: Count = Field(7, description="of a body of the same length and mass")
    diameter: Positive = Field(0.10, description="of its links [m]")

    def robot(self) -> Robot:
        """The robot."""
        return Robot.with_joints(self.joints, self.diameter)


class SensitivityConfig(ComparisonConfig):
    """Settings of the sensitivity study."""

    method: Literal["sensitivity"] = "sensitivity"
    pilots: Pilots = ("student", "teacher")
    robots: dict[Name, Body] = Field(min_length=1, description="whose fronts are searched for anew, by name")
    rates: tuple[Count, ...] = Field((480, 960, 1920), min_length=1, description="of PyBullet [Hz]")
    planar_rate: Count = Field(960, description="of the second engine [Hz]")
    search_rate: Count = Field(180, description="of the search for fronts, in planar [Hz]")
    spaces: dict[Name, Space] = Field(default={"paper": {}}, min_length=1, description="as of the study pareto")
    grid: tuple[Steps, Steps, Steps] = Field((10, 8, 8), description="values of amplitude, frequency and phase")

    @model_validator(mode="after")
    def _has_what_others_are_compared_with(self) -> Self:
        if self.verify_rate not in self.rates:
            raise ValueError(f"rates: {self.verify_rate} Hz, the verify_rate, must be among them")
        if self.robot not in (body.robot() for body in self.robots.values()):
            raise ValueError("robots: the study's own robot must be among them")
        return self

    def fronts_of(self, robot: Robot) -> ParetoConfig:
        """The search for the fronts of a robot."""
        same = ("name", "profile", "question", "fluids", "duration", "reference", "verify_rate", "spaces", "grid")
        search = {"robot": robot, "seeds": (0,), "engine": "planar", "physics_rate": self.search_rate}
        search |= {"currencies": ("net",)}  # in which the paper's claims are judged
        return ParetoConfig(**{name: getattr(self, name) for name in same}, **search)
