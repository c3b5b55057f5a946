"""Settings of the studies that search for gaits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import product
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from snakebench.controllers import GAITS, Fourier, Gait, SeaSnake
from snakebench.engines import PHYSICS_RATES, EngineName, check_resolved
from snakebench.errors import UnknownName
from snakebench.evaluation import METRICS, Evaluation
from snakebench.fluid import named_fluid
from snakebench.scenario import Scenario
from snakebench.store import INTEGRATED
from snakebench.studies.config import Reference, Seeds, StudyConfig, once_each
from snakebench.value import Count, Name, NonNegative, Positive, Real

# Where a gait of target angles swims as fast and as costly as in the limit to 0.03 % and 0.11 %, in 15 ms, the engine's
# own 240 Hz in 35 ms; all samplers are judged by the same values, and their winners are verified.
_COMPARED_RATES = {"planar": 90}  # [Hz]


def _ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    if any(second <= first for first, second in zip(values, values[1:], strict=False)):
        raise ValueError("each must be above the one before")
    return values


def _searchable(kind: str) -> str:
    """The kind, if there is a gait called so that has a search space."""
    if not (space := GAITS.named(kind).SPACE):
        others = ", ".join(name for name in GAITS if GAITS[name].SPACE)
        raise ValueError(f"it has no SPACE to be searched, as have {others}")
    for name in space.keys() & {*Evaluation.model_fields, *METRICS, *_COLUMNS}:
        raise ValueError(f"its parameter {name} is called like a column of the tables: give it another name")
    return kind


def _known_sampler(name: str) -> str:
    from snakebench.studies.samplers import SAMPLERS  # only where one is named: Optuna is slow to load

    SAMPLERS.named(name)
    return name


_COLUMNS = ("space", "method", "objective", "seed", "kept", "fluid", "front", "point")  # of the tables of fronts
_OWN_SPACE = {"sinusoidal-torque": "paper"}  # what the own search space of a gait is called, if not like the gait
Space = dict[str, tuple[Real, Real]]
Steps = Annotated[int, Field(strict=True, ge=2)]
Samplers = Annotated[tuple[Annotated[str, AfterValidator(_known_sampler)], ...], AfterValidator(once_each)]


class SearchConfig(StudyConfig):
    """What every search has: an engine to search in, and one to verify in what was found.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    seeds: Seeds = Field(description="of the searches")
    engine: EngineName = Field("pybullet", description="of the search")
    physics_rate: Count = Field(
        default_factory=lambda fields: PHYSICS_RATES.get(fields.get("engine", ""), 480),
        description="of the search [Hz]",
    )
    verify: EngineName = Field("pybullet", description="engine of the published figures")
    verify_rate: Count = Field(
        default_factory=lambda fields: 2 * PHYSICS_RATES.get(fields.get("verify", ""), 480),
        description="of the published figures; half of it tells their uncertainty [Hz]",
    )

    reference: Reference = (0.0, 30.0)

    @field_validator("verify_rate")
    @classmethod
    def _has_a_half(cls, rate: int) -> int:
        if rate % 2:
            raise ValueError("an even rate is needed, since half of it is run as well")
        return rate

    @model_validator(mode="after")
    def _steps_resolve_gaits(self) -> Self:
        for gait, rate in product(self.fastest(), (self.physics_rate, self.verify_rate // 2)):
            check_resolved(gait, self.robot.n_joints, rate)
        return self

    def fastest(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        return []

    def scenario(self, fluid: str, **changes: Any) -> Scenario:
        """Where this study tries a gait: as searched, unless told otherwise."""
        here = {"robot": self.robot, "engine": self.engine, "physics_rate": self.physics_rate}
        return Scenario(**{"fluid": named_fluid(fluid), "duration": self.duration, **here, **changes})

    def verified(self, fluid: str) -> tuple[Scenario, Scenario]:
        """Where what was found is verified: at the published rate and at half of it."""
        fine, coarse = (
            self.scenario(fluid, engine=self.verify, physics_rate=self.verify_rate // part) for part in (1, 2)
        )
        return fine, coarse

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return tuple(dict.fromkeys([self.engine, self.verify]))


class SeaSnakeConfig(SearchConfig):
    """Settings of the sea-snake study; `trials` and `seeds` count per objective: each fluid, and their mean.

    The samplers compared have the same trials, batch and seeds each, on an engine that makes so many gaits affordable.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    samples: ClassVar[bool] = True

    method: Literal["sea_snake"] = "sea_snake"
    trials: Count = Field(description="evaluated gaits per search")
    batch: Count = Field(8, description="gaits asked for at once; part of the search, unlike the workers")
    space: Space = Field(
        default_factory=lambda: dict(SeaSnake.SPACE),
        description="bounds of amplitude [rad], frequency [Hz], phase [rad]",
    )
    compared: Samplers = Field((), description="samplers to compare; differences are to the first of them")
    compared_engine: EngineName = Field("planar", description="of the comparison's searches")
    compared_rate: Count = Field(
        default_factory=lambda fields: (PHYSICS_RATES | _COMPARED_RATES).get(fields.get("compared_engine", ""), 480),
        description="of the comparison's searches [Hz]",
    )

    @field_validator("space")
    @classmethod
    def _of_the_gait(cls, space: Space) -> Space:
        return check_space(SeaSnake, space)

    def fastest(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        return [_at_upper_bounds(SeaSnake, self.space)]

    def objectives(self) -> dict[str, tuple[str, ...]]:
        """Name of each objective and the fluids whose returns it averages."""
        return objectives(self.fluids, "mean")

    def compared_scenario(self, fluid: str) -> Scenario:
        """Where the samplers compared try a gait."""
        return self.scenario(fluid, engine=self.compared_engine, physics_rate=self.compared_rate)

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        compared = [self.compared_engine] if self.compared else []
        return tuple(dict.fromkeys([*super().engines(), *compared]))


class FrontConfig(SearchConfig):
    """What every search for speed against power has.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    periods: Count = Field(6, description="that a gait swims at least, however long they are; a slow one settles late")

    def settling(self, gait: Gait) -> float:
        """How long a gait swims [s]: a slow one longer, so that it settles; one that names no frequency as others."""
        frequency = getattr(gait, "frequency", None)
        return float(max(self.duration, math.ceil(self.periods / frequency) if frequency else 0.0))

    def objectives(self) -> dict[str, tuple[str, ...]]:
        """Name of each front that one gait makes, and the fluids it averages over."""
        return objectives(self.fluids, INTEGRATED)


class ParetoConfig(FrontConfig):
    """Settings of a search for the fronts of a kind of gait with a few parameters.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

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

    def fastest(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        return [_at_upper_bounds(GAITS.named(self.gait), space) for space in self.spaces.values()]

    @property
    def parameters(self) -> list[str]:
        """What is searched for, in the order of the gait's own space."""
        return list(GAITS.named(self.gait).SPACE)

    def meanings(self) -> dict[str, Any]:
        """The same, and of each parameter what its field says."""
        fields = GAITS.named(self.gait).model_fields
        return super().meanings() | {"parameters": {name: fields[name].description for name in self.parameters}}

    def proposed(self, point: Iterable[float]) -> Gait:
        """The gait with these parameters."""
        return GAITS.named(self.gait)(**dict(zip(self.parameters, point, strict=True)))


class FourierConfig(FrontConfig):
    """Settings of the Fourier study; budgets count the gaits of one search, each tried in all fluids it is tuned to.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    method: Literal["fourier"] = "fourier"
    engine: EngineName = "planar"
    physics_rate: Count = Field(
        default_factory=lambda fields: {**PHYSICS_RATES, "planar": 90}.get(fields.get("engine", ""), 480),
        description="of the search [Hz]",
    )
    harmonics: Annotated[tuple[Count, ...], AfterValidator(_ascending)] = Field(
        min_length=1, description="numbers of harmonics, each search starting at the optimum of the one before"
    )
    prices: Annotated[tuple[NonNegative, ...], AfterValidator(_ascending)] = Field(
        min_length=1, description="of power, in speed: 10 v - price P is maximised for each [1/W]"
    )
    trials: Count = Field(description="most gaits of a search for the return, per harmonic")
    price_trials: Count = Field(description="most gaits of a search at a price, per harmonic")
    population: Annotated[int, Field(strict=True, ge=4)] | None = Field(
        None, description="gaits per generation; by default 4 + 3 ln(number of variables)"
    )
    step: Positive = Field(0.1, description="first standard deviation of a search that starts at the travelling wave")
    continued_step: Positive = Field(0.05, description="the same of one that starts at another search's optimum")
    frequency: Annotated[tuple[Positive, Positive], AfterValidator(_ascending)] = Field(
        (0.1, 2.0), description="bounds of the base frequency [Hz]"
    )

    def fastest(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        ones = ((1.0,) * self.robot.n_joints,) * max(self.harmonics)
        return [Fourier(frequency=self.frequency[1], cosine=ones, sine=ones)]


def objectives(fluids: tuple[str, ...], shared: str) -> dict[str, tuple[str, ...]]:
    """Name of each objective and the fluids it averages over: each fluid alone, and all of several as `shared`."""
    single: dict[str, tuple[str, ...]] = {fluid: (fluid,) for fluid in fluids}
    return single if len(fluids) == 1 else single | {shared: fluids}


def _at_upper_bounds(gait: type[Gait], space: Space) -> Gait:
    return gait(**{"kind": gait.model_fields["kind"].default} | {name: high for name, (_, high) in space.items()})


def check_space(gait: type[Gait], space: Space) -> Space:
    """The gait's own search space with the bounds of `space` laid over it.

    Raises:
        InvalidValue: for a parameter that the gait lacks, bounds in the wrong order or out of its range.
    """
    kind, lowest = gait.model_fields["kind"].default, {name: low for name, (low, _) in gait.SPACE.items()}
    for name, bounds in space.items():
        if name not in gait.SPACE:
            raise UnknownName.among("parameter", name, gait.SPACE)
        if not bounds[0] < bounds[1]:
            raise ValueError(f"{name} = {list(bounds)}: the first bound must be below the second")
        for bound in bounds:
            gait(**lowest | {"kind": kind, name: bound})
    return dict(gait.SPACE) | space
