"""Settings of the studies that search for gaits, and of those that have fronts."""

import math
from collections.abc import Callable
from itertools import product
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from snakebench.controllers import Gait
from snakebench.engines import PHYSICS_RATES, EngineName, check_resolved
from snakebench.errors import UnknownName
from snakebench.names import COARSE, FINE, INTEGRATED
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController
from snakebench.studies.config import EQUAL_POWERS, Distinct, Powers, Reference, Seeds, StudyConfig
from snakebench.value import Count, Real

Space = dict[str, tuple[Real, Real]]
Currency = Literal["net", "positive"]  # those of CURRENCIES
PERIODS = 6  # that a gait swims at least
Currencies = Annotated[Distinct[Currency], Field(description="of power that fronts count: net, P, or positive, P+")]


def usual_rate(engine: str, **rates: int) -> Callable[[dict[str, Any]], int]:
    """A default: the physics rate of the engine that a field names [Hz], with other rates for some engines."""
    return lambda fields: (PHYSICS_RATES | rates).get(fields.get(engine, ""), 480)


class FrontSettings(StudyConfig):
    """Settings of every study that has fronts of speed against power."""

    reference: Reference = (0.0, 30.0)
    powers: Powers = EQUAL_POWERS
    currencies: Currencies = ("net", "positive")

    shared: ClassVar[str] = INTEGRATED  # name of the objective over all fluids

    def objectives(self) -> dict[str, tuple[str, ...]]:
        """Name of each objective, or of each front of gaits, and the fluids that it averages over."""
        single: dict[str, tuple[str, ...]] = {fluid: (fluid,) for fluid in self.fluids}
        return single if len(single) == 1 else single | {self.shared: self.fluids}


class SearchConfig(FrontSettings):
    """Settings of every search: an engine to search in, and one to verify the optima in."""

    seeds: Seeds = Field(description="of the searches")
    engine: EngineName = Field("pybullet", description="of the search")
    physics_rate: Count = Field(default_factory=usual_rate("engine"), description="of the search [Hz]")
    verify: EngineName = Field("pybullet", description="engine of the published figures")
    verify_rate: Annotated[Count, Field(multiple_of=2)] = Field(
        default_factory=lambda fields: 2 * usual_rate("verify")(fields),
        description="of the published figures; half of it gives their uncertainty [Hz]",
    )

    @model_validator(mode="after")
    def _steps_resolve_gaits(self) -> Self:
        for gait, rate in product(self.fastest_gaits(), (self.physics_rate, self.verify_rate // 2)):
            check_resolved(gait, self.robot.n_joints, rate)
        return self

    def fastest_gaits(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        return []

    def variants(self, fluid: str) -> dict[str, Scenario]:
        """Where optima are evaluated in a fluid: as searched, and verified at half the published rate and at it."""
        here = {"fluid": fluid, "robot": self.robot, "duration": self.duration}
        fine = Scenario(**here, engine=self.verify, physics_rate=self.verify_rate)
        return {
            "searched": Scenario(**here, engine=self.engine, physics_rate=self.physics_rate),
            COARSE: fine.but(physics_rate=self.verify_rate // 2),
            FINE: fine,
        }

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return tuple(dict.fromkeys([self.engine, self.verify]))


class FrontConfig(SearchConfig):
    """Settings of every search for speed against power."""

    periods: Count = Field(PERIODS, description="that a gait swims at least, however long; a slow one settles late")

    def settling(self, gait: Gait) -> float:
        """How long a gait swims [s]."""
        return settled_duration(gait, self.duration, self.periods)


def settled_duration(gait: AnyController, least: float, periods: int = PERIODS) -> float:
    """How long a gait swims [s]: a slow one for so many periods, so that it settles; one that names none as others."""
    frequency = getattr(gait, "frequency", None) or 1 / getattr(gait, "period", math.inf)
    return float(max(least, math.ceil(periods / frequency) if frequency else 0.0))


def check_space(gait: type[Gait], space: Space) -> Space:
    """The gait's own search space with the bounds of `space` laid over it, which must be within the gait's range."""
    lowest = {name: low for name, (low, _) in gait.SPACE.items()}
    for name, bounds in space.items():
        if name not in gait.SPACE:
            raise UnknownName.among("parameter", name, gait.SPACE)
        if not bounds[0] < bounds[1]:
            raise ValueError(f"{name} = {list(bounds)}: the first bound must be below the second")
        for bound in bounds:
            gait(**lowest | {name: bound})
    return dict(gait.SPACE) | space
