"""Settings of the study."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, field_validator

from snakebench.controllers import Gait, SeaSnake
from snakebench.engines import EngineName
from snakebench.studies.config import once_each
from snakebench.studies.search_settings import SearchConfig, Space, check_space, usual_rate
from snakebench.value import Count


def _known_sampler(name: str) -> str:
    from snakebench.studies.samplers import SAMPLERS  # only where one is named: Optuna is slow to load

    SAMPLERS.named(name)
    return name


Samplers = Annotated[tuple[Annotated[str, AfterValidator(_known_sampler)], ...], AfterValidator(once_each)]


class SeaSnakeConfig(SearchConfig):
    """Settings of the sea-snake study; `trials` and `seeds` count per objective: each fluid, and their mean.

    The samplers compared have the same trials, batch and seeds each, on an engine that makes so many gaits affordable.
    """

    samples: ClassVar[bool] = True
    shared: ClassVar[str] = "mean"

    method: Literal["sea_snake"] = "sea_snake"
    trials: Count = Field(description="evaluated gaits per search")
    batch: Count = Field(8, description="gaits asked for at once; part of the search, unlike the workers")
    space: Space = Field(dict(SeaSnake.SPACE), description="bounds of amplitude [rad], frequency [Hz], phase [rad]")
    compared: Samplers = Field((), description="samplers to compare; differences are to the first of them")
    compared_engine: EngineName = Field("planar", description="of the comparison's searches")
    # Planar at 90 Hz swims gaits of target angles as fast and as costly as in the limit to 0.03 % and 0.11 %, in 15 ms,
    # at its own 240 Hz in 35 ms; all samplers are judged by the same values, and their winners are verified.
    compared_rate: Count = Field(default_factory=usual_rate("compared_engine", planar=90), description="the same [Hz]")

    @field_validator("space")
    @classmethod
    def _of_the_gait(cls, space: Space) -> Space:
        return check_space(SeaSnake, space)

    def fastest_gaits(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        return [SeaSnake(**{name: high for name, (_, high) in self.space.items()})]

    def comparison(self) -> Self:
        """The same searches on the engine of the comparison."""
        return self.but(engine=self.compared_engine, physics_rate=self.compared_rate)

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        compared = [self.compared_engine] if self.compared else []
        return tuple(dict.fromkeys([*super().engines(), *compared]))
