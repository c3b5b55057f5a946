"""Study files: TOML tables of a question, a method and its settings, with one table per profile that overrides them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, Field, field_validator, model_validator

from snakebench.controllers import Gait, SeaSnake
from snakebench.engines import PHYSICS_RATES, EngineName
from snakebench.errors import InvalidValue, UnknownName
from snakebench.evaluation import Scenario
from snakebench.fluid import named_fluid
from snakebench.robot import Robot
from snakebench.value import Count, Positive, Real, Value

_T = TypeVar("_T")

Seed = Annotated[int, Field(strict=True, ge=0, lt=2**32)]
_INSTALLED = Path(__file__).with_name("library")
LIBRARY = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2] / "studies"


def _once_each(values: tuple[_T, ...]) -> tuple[_T, ...]:
    return _once("values", values)


Rates = Annotated[tuple[Count, ...], Field(min_length=1), AfterValidator(_once_each)]
RatesByEngine = Annotated[dict[EngineName, Rates], Field(min_length=1)]


class StudyConfig(Value):
    """What every study has.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    name: str = Field(pattern=r"^\w[\w.-]{0,99}$")
    profile: str
    question: str
    method: str
    fluids: tuple[str, ...] = Field(min_length=1)
    robot: Robot = Field(default_factory=Robot)
    duration: Positive = Field(30.0, description="length of each run [s]")

    @field_validator("fluids")
    @classmethod
    def _known_once(cls, fluids: tuple[str, ...]) -> tuple[str, ...]:
        for name in fluids:
            named_fluid(name)
        return _once("fluids", fluids)


class SeaSnakeConfig(StudyConfig):
    """Settings of the sea-snake study; `trials` and `seeds` count per objective: each fluid, and their mean.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    method: Literal["sea_snake"] = "sea_snake"
    trials: Count = Field(description="evaluated gaits per search")
    batch: Count = Field(8, description="gaits asked for at once; part of the search, unlike the workers")
    seeds: tuple[Seed, ...] = Field(min_length=1)
    space: dict[str, tuple[Real, Real]] = Field(
        default_factory=lambda: dict(SeaSnake.SPACE),
        description="bounds of amplitude [rad], frequency [Hz], phase [rad]",
    )
    engine: EngineName = "pybullet"
    physics_rate: Count = Field(
        default_factory=lambda fields: PHYSICS_RATES.get(fields.get("engine", ""), 480),
        description="of the search [Hz]",
    )
    check_rate: Count = Field(
        default_factory=lambda fields: 2 * fields.get("physics_rate", 480),
        description="of the optima, beside `physics_rate` [Hz]",
    )

    @field_validator("seeds")
    @classmethod
    def _seeds_once(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        return _once("seeds", seeds)

    @field_validator("space")
    @classmethod
    def _of_the_gait(cls, space: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        for name, (low, high) in space.items():
            if name not in SeaSnake.SPACE:
                raise UnknownName.among("parameter", name, SeaSnake.SPACE)
            if not low < high:
                raise ValueError(f"{name} = [{low}, {high}]: the first bound must be below the second")
            SeaSnake(**{"amplitude": 0.1, "frequency": 0.1, "phase": 0.1, name: low})
        return SeaSnake.SPACE | space

    def scenario(self, fluid: str, physics_rate: int, robot: Robot) -> Scenario:
        """Where this study tries a gait."""
        return Scenario(fluid=fluid, robot=robot, engine=self.engine, physics_rate=physics_rate, duration=self.duration)

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return (self.engine,)

    def objectives(self) -> dict[str, tuple[str, ...]]:
        """Name of each objective and the fluids whose returns it averages."""
        single: dict[str, tuple[str, ...]] = {fluid: (fluid,) for fluid in self.fluids}
        return single if len(self.fluids) == 1 else single | {"mean": self.fluids}


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


def study_settings(path: Path, profile: str | None = None, **overrides: list[int] | str | None) -> dict[str, Any]:
    """The settings in a study file with those of a profile, then `overrides` that are not None, laid over them.

    The name tells the profile, unless it is the study's own, and the overrides: no budget overwrites another's results.

    Raises:
        InvalidValue: when the file is no TOML, or its profiles are no tables.
        UnknownName: when it has no such profile.
    """
    content = _content(path)
    profiles, default = content.pop("profiles"), content.pop("profile", None)
    chosen = str(default if profile is None else profile)
    if chosen not in profiles:
        raise UnknownName.among(f"profile of {path.name}", chosen, profiles)
    given = {key: value for key, value in overrides.items() if value is not None}
    changes = [
        f"{key}-{value if isinstance(value, str) else '-'.join(map(str, value))}" for key, value in given.items()
    ]
    name = "-".join([path.stem, *([] if chosen == default else [chosen]), *changes])
    return {"name": name, "profile": chosen} | content | profiles[chosen] | given


def study_profiles(path: Path) -> list[str]:
    """The profiles of a study file; errors as `study_settings`."""
    return list(_content(path)["profiles"])


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
