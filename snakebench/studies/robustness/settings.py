"""Settings of the study."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator

from snakebench.engines import EngineName
from snakebench.perturbation import Perturbations, Ranges, corner, known_perturbation
from snakebench.studies.contenders import ComparisonConfig, Contenders, NameOrNone, Pilots
from snakebench.value import Name, Positive, Value

Perturbation = Annotated[str, AfterValidator(known_perturbation)]


class Target(Value):
    """What a policy should bear, and the speed that it should keep."""

    perturbations: dict[Perturbation, float] = Field({}, description="their sizes, all at once; none by default")
    share: Positive = Field(description="of the unperturbed speed of the first of the `pilots` [1]")

    def together(self) -> Perturbations:
        """All of them."""
        return corner({name: (size, size) for name, size in self.perturbations.items()})


class RobustnessConfig(ComparisonConfig):
    """Settings of the study of robustness."""

    method: Literal["robustness"] = "robustness"
    contenders: Contenders = Field(
        Contenders(sinusoids="", sea_snakes="", limit="limit"), description="whose results are compared"
    )
    pilots: Pilots = ("student", "teacher")
    robust: NameOrNone = Field("robust", description="study of the robust policies; left out while it has no results")
    robust_pilots: Pilots = ("robust_student",)
    engine: EngineName = Field("planar", description="of sweeps, at `verify_rate`")
    verify: EngineName = Field("pybullet", description="of combinations and targets, at `verify_rate`")
    targets: dict[Name, Target] = Field({}, description="what the first of the `robust_pilots` should bear, by name")
    ranges: Ranges = Field(min_length=1, description="from the smallest to the largest value of each perturbation")
    steps: Annotated[int, Field(ge=2, le=1000)] = Field(11, description="values of each perturbation, equally spaced")
    combinations: Annotated[int, Field(ge=0, le=10_000)] = Field(50, description="of all, drawn uniformly")
    alone: tuple[Perturbation, ...] = Field(("dead_joint",), description="perturbations that are in no combination")

    @field_validator("ranges")
    @classmethod
    def _with_a_width(cls, ranges: Ranges) -> Ranges:
        for name, (low, high) in ranges.items():
            if (round(low) if name == "dead_joint" else low) == (round(high) if name == "dead_joint" else high):
                raise ValueError(f"{name} = {[low, high]}: a range of more than one value is needed")
        return ranges

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return tuple(dict.fromkeys([self.engine, self.verify]))
