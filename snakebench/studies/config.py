"""Study files: TOML tables of a question, a method and its settings, with one table per profile that overrides them."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import AfterValidator, Field, field_validator, model_validator

from snakebench.controllers import Gait, SeaSnake, SinusoidalTorque
from snakebench.engines import PHYSICS_RATES, EngineName
from snakebench.errors import InvalidValue, UnknownName
from snakebench.evaluation import Scenario
from snakebench.fluid import Fluid, fluid_names, named_fluid
from snakebench.robot import Robot
from snakebench.value import Count, NonNegative, Positive, Real, Value

_T = TypeVar("_T")

Seed = Annotated[int, Field(strict=True, ge=0, lt=2**32)]
_INSTALLED = Path(__file__).with_name("library")
# Where a gait of target angles swims as fast and as costly as in the limit to 0.03 % and 0.11 %, in 15 ms, the engine's
# own 240 Hz in 35 ms; all samplers are judged by the same values, and their winners are verified.
_COMPARED_RATES = {"planar": 90}  # [Hz]
LIBRARY = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2] / "studies"


def _once_each(values: tuple[_T, ...]) -> tuple[_T, ...]:
    return _once("values", values)


def _ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    if any(second <= first for first, second in zip(values, values[1:], strict=False)):
        raise ValueError("each must be above the one before")
    return values


def _known_sampler(name: str) -> str:
    from snakebench.studies.samplers import known_sampler  # only where one is named: Optuna is slow to load

    return known_sampler(name)


INTEGRATED = "integrated"
Setting = str | int | list[int] | list[str]
Space = dict[str, tuple[Real, Real]]
Steps = Annotated[int, Field(strict=True, ge=2)]
Samplers = Annotated[tuple[Annotated[str, AfterValidator(_known_sampler)], ...], AfterValidator(_once_each)]
Rates = Annotated[tuple[Count, ...], Field(min_length=1), AfterValidator(_once_each)]
RatesByEngine = Annotated[dict[EngineName, Rates], Field(min_length=1)]


class StudyConfig(Value):
    """What every study has.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    name: str = Field(pattern=r"^\w[\w.,-]{0,99}$")
    profile: str
    question: str
    method: str
    fluids: tuple[str, ...] = Field(description="names, or VISCOSITY or VISCOSITY,DENSITY in SI units")
    robot: Robot = Field(default_factory=Robot)
    duration: Positive = Field(30.0, description="length of each run [s]")

    learns: ClassVar[bool] = False  # whether it trains policies, in this machine's files

    @field_validator("fluids")
    @classmethod
    def _known_once(cls, fluids: tuple[str, ...]) -> tuple[str, ...]:
        if not fluids:
            raise ValueError(f"one fluid or more is needed, such as {', '.join(fluid_names())}")
        _once("fluids", tuple(medium(text) for text in fluids))
        return fluids


class SearchConfig(StudyConfig):
    """What every search has: an engine to search in, and one to verify in what was found.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    seeds: tuple[Seed, ...] = Field(min_length=1)
    engine: EngineName = "pybullet"
    physics_rate: Count = Field(
        default_factory=lambda fields: PHYSICS_RATES.get(fields.get("engine", ""), 480),
        description="of the search [Hz]",
    )
    verify: EngineName = Field("pybullet", description="engine of the published figures")
    verify_rate: Count = Field(
        default_factory=lambda fields: 2 * PHYSICS_RATES.get(fields.get("verify", ""), 480),
        description="of the published figures; half of it tells their uncertainty [Hz]",
    )

    reference: tuple[NonNegative, Positive] = Field(
        (0.0, 30.0), description="speed [m/s] and power [W] from which hypervolume is counted"
    )

    @field_validator("seeds")
    @classmethod
    def _seeds_once(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        return _once("seeds", seeds)

    @field_validator("verify_rate")
    @classmethod
    def _has_a_half(cls, rate: int) -> int:
        if rate % 2:
            raise ValueError("an even rate is needed, since half of it is run as well")
        return rate

    def scenario(self, fluid: str, **changes: Any) -> Scenario:
        """Where this study tries a gait: as searched, unless told otherwise."""
        here = {"robot": self.robot, "engine": self.engine, "physics_rate": self.physics_rate}
        return Scenario(**{"fluid": medium(fluid), "duration": self.duration, **here, **changes})

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

    def settling(self, frequency: float) -> float:
        """How long a gait of a frequency [Hz] swims [s]: a slow one longer, so that it settles."""
        return float(max(self.duration, math.ceil(self.periods / frequency)))


class ParetoConfig(FrontConfig):
    """Settings of the Pareto study of sinusoidal torque gaits.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    method: Literal["pareto"] = "pareto"
    search: Literal["grid", "nsga2", "both"] = Field("grid", description="what proposes the gaits")
    spaces: dict[str, Space] = Field(
        default_factory=lambda: {"paper": SinusoidalTorque.SPACE},
        min_length=1,
        description="bounds of amplitude [N m], frequency [Hz], phase [rad] of each search space, by its name",
    )
    grid: tuple[Steps, Steps, Steps] = Field((20, 15, 15), description="values of amplitude, frequency and phase")
    population: Annotated[Count, Field(ge=4)] = Field(30, description="gaits in a generation of NSGA-II")
    generations: Count = Field(30, description="of NSGA-II")

    @field_validator("spaces")
    @classmethod
    def _of_the_gait(cls, spaces: dict[str, Space]) -> dict[str, Space]:
        return {name: check_space(SinusoidalTorque, space) for name, space in spaces.items()}

    def objectives(self) -> dict[str, tuple[str, ...]]:
        """Name of each front that one gait makes, and the fluids it averages over."""
        return objectives(self.fluids, INTEGRATED)


class FourierConfig(FrontConfig):
    """Settings of the Fourier study; budgets count the evaluations of one search, and grow with its variables.

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
    trials: Count = Field(description="most evaluations of a search for the return, per harmonic")
    price_trials: Count = Field(description="most evaluations of a search at a price, per harmonic")
    population: Annotated[int, Field(strict=True, ge=4)] | None = Field(
        None, description="gaits per generation; by default 4 + 3 ln(number of variables)"
    )
    step: Positive = Field(0.1, description="first standard deviation of a search that starts at the travelling wave")
    continued_step: Positive = Field(0.05, description="the same of one that starts at another search's optimum")
    frequency: Annotated[tuple[Positive, Positive], AfterValidator(_ascending)] = Field(
        (0.1, 2.0), description="bounds of the base frequency [Hz]"
    )


class ValidationConfig(StudyConfig):
    """Settings of the validation study.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    method: Literal["validation"] = "validation"
    gaits: dict[str, Gait] = Field(min_length=1, description="the gaits that every engine swims, by name")
    rates: RatesByEngine = Field(description="physics rates to compare, by engine [Hz]")
    reference_rate: Count = Field(description="of the planar engine, for what counts as the limit [Hz]")
    order_duration: Positive = Field(description="when the state is compared to find the order [s]")
    order_rates: RatesByEngine = Field(description="physics rates for the order, by engine [Hz]")
    order_reference_rate: Count = Field(description="of the planar engine, for the state it tends to [Hz]")
    adversaries: Annotated[tuple[Literal["random", "bang-bang", "alternating"], ...], AfterValidator(_once_each)] = (
        Field(
            min_length=1, description="target angles at the control rate: uniform, -1 or 1 at random, -1 and 1 in turns"
        )
    )
    adversary_seed: Seed = 0
    adversary_duration: Positive = Field(description="length of those runs [s]")
    adversary_rates: RatesByEngine = Field(description="physics rates for them, by engine [Hz]")

    @model_validator(mode="after")
    def _orders_can_be_observed(self) -> Self:
        for engine, rates in self.order_rates.items():
            if len(rates) < 2 or max(rates) >= self.order_reference_rate:
                raise ValueError(
                    f"order_rates.{engine} = {list(rates)}: two rates or more, below order_reference_rate"
                    f" {self.order_reference_rate}, are needed"
                )
        return self

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return tuple(dict.fromkeys([*self.rates, *self.order_rates, *self.adversary_rates, "planar"]))


def study_names() -> list[str]:
    """The studies that come with snakebench."""
    return sorted(path.stem for path in LIBRARY.glob("*.toml"))


def study_path(name_or_toml: str) -> Path:
    """The file of a study given by name or by path.

    Raises:
        UnknownName: when there is neither, with the nearest names.
    """
    if name_or_toml in study_names():
        return LIBRARY / f"{name_or_toml}.toml"
    path = Path(name_or_toml)
    if len(path.name) > 200 or not path.is_file():
        raise UnknownName.among("study", name_or_toml, [*study_names(), "or the path of a TOML file"])
    return path


def study_settings(path: Path, profile: str | None = None, **overrides: Setting | None) -> dict[str, Any]:
    """The settings in a study file with those of a profile, then `overrides` that are not None, laid over them.

    The name tells the profile, unless it is the study's own, and what else differs from it: no budget overwrites
    another's results. Another engine runs at its own physics rate.

    Raises:
        InvalidValue: when the file is no TOML, or its profiles are no tables.
        UnknownName: when it has no such profile.
    """
    content = _content(path)
    profiles, default = content.pop("profiles"), content.pop("profile", None)
    chosen = str(default if profile is None else profile)
    if chosen not in profiles:
        raise UnknownName.among(f"profile of {path.name}", chosen, profiles)
    settings = content | profiles[chosen]
    given = {key: value for key, value in overrides.items() if value is not None and value != settings.get(key)}
    if "engine" in given:
        settings.pop("physics_rate", None)
    changes = [
        "-".join([key, *map(str, value if isinstance(value, list) else [value])]) for key, value in given.items()
    ]
    name = "-".join([path.stem, *([] if chosen == default else [chosen]), *changes])
    return {"name": name, "profile": chosen} | settings | given


def study_profiles(path: Path) -> list[str]:
    """The profiles of a study file; errors as `study_settings`."""
    return list(_content(path)["profiles"])


def medium(text: str) -> Fluid:
    """The fluid called so, or described as VISCOSITY or VISCOSITY,DENSITY [m^2/s, kg/m^3], such as 1e-3,900.

    Raises:
        UnknownName: when it is neither.
        InvalidValue: for a number out of range.
    """
    if text in fluid_names():
        return named_fluid(text)
    try:
        numbers = [float(part) for part in text.split(",")]
        return Fluid(**dict(zip(("kinematic_viscosity", "density"), numbers, strict=len(numbers) > 1)))
    except InvalidValue:
        raise
    except ValueError:
        raise UnknownName.among("fluid", text, [*fluid_names(), "or VISCOSITY,DENSITY such as 1e-3,900"]) from None


def objectives(fluids: tuple[str, ...], shared: str) -> dict[str, tuple[str, ...]]:
    """Name of each objective and the fluids it averages over: each fluid alone, and all of several as `shared`."""
    single: dict[str, tuple[str, ...]] = {fluid: (fluid,) for fluid in fluids}
    return single if len(fluids) == 1 else single | {shared: fluids}


def check_space(gait: type[SeaSnake | SinusoidalTorque], space: Space) -> Space:
    """The gait's own search space with the bounds of `space` laid over it.

    Raises:
        InvalidValue: for a parameter that the gait lacks, bounds in the wrong order or out of its range.
    """
    for name, (low, high) in space.items():
        if name not in gait.SPACE:
            raise UnknownName.among("parameter", name, gait.SPACE)
        if not low < high:
            raise ValueError(f"{name} = [{low}, {high}]: the first bound must be below the second")
        gait(**{"amplitude": 0.1, "frequency": 0.1, "phase": 0.1, name: low})
    return gait.SPACE | space


def _content(path: Path) -> dict[str, Any]:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidValue(f"cannot read the study {path}: {error}") from None
    profiles = content.setdefault("profiles", {})
    if not isinstance(profiles, dict) or not all(isinstance(settings, dict) for settings in profiles.values()):
        raise InvalidValue(f"{path}: profiles must be tables of settings, such as [profiles.smoke]")
    return content


def _once(what: str, values: tuple[_T, ...]) -> tuple[_T, ...]:
    if len(set(values)) < len(values):
        raise ValueError(f"{what} must differ from each other")
    return values
