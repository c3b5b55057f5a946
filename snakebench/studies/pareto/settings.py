"""Settings of the study."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from snakebench.controllers import GAITS, Gait
from snakebench.evaluation import METRICS, Evaluation
from snakebench.studies.search_settings import FrontConfig, Space, check_space
from snakebench.value import Count, Name


def _searchable(kind: str) -> str:
    """The kind, if there is a gait called so that has a search space."""
    if not (space := GAITS.named(kind).SPACE):
        others = ", ".join(name for name in GAITS if GAITS[name].SPACE)
        raise ValueError(f"it has no SPACE to be searched, as have {others}")
    for name in space.keys() & {*Evaluation.model_fields, *METRICS, *_COLUMNS}:
        raise ValueError(f"its parameter {name} is called like a column of the tables: give it another name")
    return kind


_COLUMNS = (  # of the tables of fronts
    *("space", "method", "objective", "seed", "survivor"),
    *("fluid", "front", "currency", "point"),
)
_OWN_SPACE = {"sinusoidal-torque": "paper"}  # what the own search space of a gait is called, if not like the gait
Steps = Annotated[int, Field(strict=True, ge=2)]


class ParetoConfig(FrontConfig):
    """Settings of a search for the fronts of a kind of gait with a few parameters."""

    method: Literal["pareto"] = "pareto"
    gait: Annotated[str, AfterValidator(_searchable)] = Field("sinusoidal-torque", description="its kind")
    search: Literal["grid", "nsga2", "both"] = Field("grid", description="what proposes the gaits")
    spaces: dict[Name, Space] = Field(
        default_factory=lambda fields: {_OWN_SPACE.get(fields.get("gait", ""), fields.get("gait", "")): {}},
        min_length=1,
        validate_default=True,
        description="bounds of the parameters in each search space, by its name; others are the gait's own",
    )
    grid: tuple[Steps, ...] = Field((20, 15, 15), description="number of values of each parameter, in their order")
    population: Annotated[Count, Field(ge=4)] = Field(30, description="gaits in a generation of NSGA-II")
    generations: Count = Field(30, description="of NSGA-II")

    @field_validator("spaces")
    @classmethod
    def _of_the_gait(cls, spaces: dict[str, Space], info: ValidationInfo) -> dict[str, Space]:
        gait = GAITS.get(info.data.get("gait", ""))
        return {name: check_space(gait, space) for name, space in spaces.items()} if gait else spaces

    @model_validator(mode="after")
    def _an_axis_for_each(self) -> Self:
        if self.search != "nsga2" and len(self.grid) != len(self.parameters):
            raise ValueError(
                f"grid = {list(self.grid)}: {self.gait} has {len(self.parameters)} parameters,"
                f" {', '.join(self.parameters)}, and each needs a number of values"
            )
        return self

    def fastest_gaits(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        return [self.proposed(high for _, high in space.values()) for space in self.spaces.values()]

    @property
    def parameters(self) -> list[str]:
        """What is searched for, in the order of the gait's own space."""
        return list(GAITS.named(self.gait).SPACE)

    def meanings(self) -> dict[str, Any]:
        """Those of every study, and what the field of each parameter says."""
        fields = GAITS.named(self.gait).model_fields
        return super().meanings() | {"parameters": {name: fields[name].description for name in self.parameters}}

    def proposed(self, point: Iterable[float]) -> Gait:
        """The gait with these parameters."""
        return GAITS.named(self.gait)(**dict(zip(self.parameters, point, strict=True)))
