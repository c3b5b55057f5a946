"""Study files: TOML tables of a question, a method and its settings, with one table per profile that overrides them."""

import hashlib
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import AfterValidator, Field, field_validator

from snakebench.errors import InvalidValue, UnknownName
from snakebench.fluid import FLUIDS, Fluid, named_fluid
from snakebench.names import SMALLER
from snakebench.robot import AnyRobot, Robot
from snakebench.value import Count, Name, NonNegative, Positive, Value, checked_name

_T = TypeVar("_T")

_LONGEST = 100  # name of a study [characters]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**32)]
_INSTALLED = Path(__file__).with_name("library")
LIBRARY = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2] / "studies"


def once_each(values: tuple[_T, ...]) -> tuple[_T, ...]:
    """The values, if they differ from each other."""
    if len(set(values)) < len(values):
        raise ValueError("values must differ from each other")
    return values


def ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    """The same values, each of which must be above the one before."""
    if any(second <= first for first, second in zip(values, values[1:], strict=False)):
        raise ValueError("each must be above the one before")
    return values


Distinct = Annotated[tuple[_T, ...], Field(min_length=1), AfterValidator(once_each)]
Seeds = Distinct[Seed]
Reference = Annotated[tuple[NonNegative, Positive], Field(description="of hypervolume: speed [m/s] and power [W]")]
Powers = Annotated[Distinct[Positive], Field(description="at which speeds of fronts are compared [W]")]
EQUAL_POWERS = (1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 30.0)  # [W] what the fronts of the paper's robot span
Setting = str | int | list[int] | list[str]
Rates = Distinct[Count]


class StudyConfig(Value):
    """What every study has."""

    name: Name = Field(description="of the results' directory; from the file's name")
    profile: Name = Field(description="of the file, unless --profile says otherwise")
    question: str = Field(description="what the study asks, for its page")
    method: str = Field(description="how it answers")
    named_fluids: dict[Name, Fluid] = Field(default_factory=dict, description="fluids that this study names")
    fluids: tuple[str, ...] = Field(description="names, or VISCOSITY or VISCOSITY,DENSITY in SI units")
    robot: AnyRobot = Field(default_factory=Robot, description="its dimensions, or a name")
    duration: Positive = Field(30.0, description="length of each run [s]")

    samples: ClassVar[bool] = False  # whether Optuna's samplers search

    @field_validator("name")
    @classmethod
    def _own_page(cls, name: str) -> str:
        if name in ("index", "bench", "leaderboard", "play"):
            raise ValueError(f"reports have another page called {name}: give the study another name")
        return name

    @field_validator("named_fluids")
    @classmethod
    def _known_by_name(cls, fluids: dict[str, Fluid]) -> dict[str, Fluid]:
        FLUIDS.update({name: fluid for name, fluid in fluids.items() if FLUIDS.get(name) != fluid})
        return fluids

    @field_validator("fluids")
    @classmethod
    def _known_once(cls, fluids: tuple[str, ...]) -> tuple[str, ...]:
        if not fluids:
            raise ValueError(f"one fluid or more is needed, such as {', '.join(FLUIDS)}")
        once_each(tuple(named_fluid(text) for text in fluids))
        return tuple(map(checked_name, fluids))

    def engines(self) -> tuple[str, ...]:
        """The engines that the study uses; both, unless its settings name them."""
        return "pybullet", "planar"

    def check_installed(self) -> None:
        """Make sure that the packages are installed which the study needs beside those of snakebench."""

    def meanings(self) -> dict[str, Any]:
        """What names in the settings stand for, which only a plug-in may know; written into the manifest."""
        return {"fluids": {name: named_fluid(name).model_dump() for name in self.fluids}}


def study_names() -> list[str]:
    """The studies that come with snakebench."""
    return sorted(path.stem for path in LIBRARY.glob("*.toml"))


def study_path(name_or_toml: str) -> Path:
    """The file of a study given by name or by path."""
    if name_or_toml in study_names():
        return LIBRARY / f"{name_or_toml}.toml"
    path = Path(name_or_toml)
    if path.suffix == ".toml" and len(path.name) <= 200 and not path.exists():
        raise InvalidValue(f"cannot read the study {path}: no such file")
    if len(path.name) > 200 or not path.is_file():
        raise UnknownName.among("study", name_or_toml, [*study_names(), "or the path of a TOML file"])
    return path


def study_settings(
    path: Path, profile: str | None = None, name: str | None = None, **overrides: Setting | None
) -> dict[str, Any]:
    """The settings in a study file with those of a profile, then `overrides` that are not None, laid over them.

    Without a `name`, the study's name contains the profile, unless it is the study's own, and the overrides: no budget
    overwrites another's results. Another engine runs at its own physics rate, another gait in its own search space.

    Raises:
        InvalidValue: when the file, the profile or the name cannot be used.
    """
    if name in study_names():
        raise InvalidValue(f"name = {name}: a study of the library is called so: give another name")
    content = _content(path)
    profiles, default = content.pop("profiles"), content.pop("profile", "full")
    chosen = str(default if profile is None else profile)
    if chosen not in profiles:
        raise UnknownName.among(f"profile of {path.name}", chosen, profiles)
    settings = content | profiles[chosen]
    changes = {key: value for key, value in overrides.items() if value is not None and value != settings.get(key)}
    for key, dependent in {"engine": "physics_rate", "gait": "spaces"}.items():
        if key in changes:
            settings.pop(dependent, None)
    if "gait" in changes:
        gait = f"gait of the kind {changes['gait']}"
        settings["question"] = str(settings["question"]).replace("sinusoidal gait", gait)
    own = path.stem if chosen == default else f"{path.stem}-{chosen}"
    settings = {"name": name or _name(own, changes), "profile": chosen} | settings | changes
    if name is None and _is_anothers(path, str(settings["name"])):
        raise InvalidValue(f"name = {settings['name']}: a study of the library is called so: give another name")
    return settings


def _is_anothers(path: Path, name: str) -> bool:
    """Whether a study would take the place of one of the library, and is another."""
    endings = "", *(f"-{profile}" for profile in SMALLER)
    called = {f"{study}{ending}": study for study in study_names() for ending in endings}
    return name in called and path.read_bytes() != (LIBRARY / f"{called[name]}.toml").read_bytes()


def _name(name: str, changes: Mapping[str, Setting]) -> str:
    for key, value in changes.items():
        values = [re.sub(r"[^\w.,@+-]", "-", str(one)) for one in (value if isinstance(value, list) else [value])]
        name = "-".join([name, key, *values])
    if changes and len(name) > _LONGEST:
        name = f"{name[: _LONGEST - 9].rstrip('-')}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return name


def study_profiles(path: Path) -> list[str]:
    """The profiles of a study file; errors as `study_settings`."""
    return list(_content(path)["profiles"])


def _content(path: Path) -> dict[str, Any]:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidValue(f"cannot read the study {path}: {error}") from None
    profiles = content.setdefault("profiles", {"full": {}})
    if not isinstance(profiles, dict) or not all(isinstance(settings, dict) for settings in profiles.values()):
        raise InvalidValue(f"{path}: profiles must be tables of settings, such as [profiles.smoke]")
    return content
