"""What earlier studies found, to be compared: their best gaits and their policies, read from published results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import pandas as pd
from pydantic import AfterValidator, Field

from snakebench.controllers import GAITS, SeaSnake
from snakebench.errors import InvalidValue, StoreError
from snakebench.fluid import Fluid, FluidField, named_fluid
from snakebench.names import checked_name
from snakebench.physics.joints import Drives
from snakebench.policy import Policy
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController
from snakebench.snapshot import snapshot
from snakebench.store import ADAPTIVE, EXTENDED, INTEGRATED, PAPER, command_of, left_out_files, read_manifest
from snakebench.studies.config import Reference, Seeds, StudyConfig, once_each
from snakebench.tables import fourier_gait, read_table
from snakebench.value import Count, Name, Value

SINUSOIDS = (PAPER, EXTENDED)  # search spaces whose fastest gaits are compared
_PARAMETERS = list(SeaSnake.SPACE)  # which every contender has as columns, filled or not
_BY_RETURN = {"mean": INTEGRATED}  # what the sea-snake study calls a gait for all fluids


class Contender(NamedTuple):
    """A gait or a policy to be compared."""

    method: str  # a policy's name, or the search space or study of a gait
    tuned_to: str  # fluid, "integrated" for all of them, or "adaptive" for a policy
    seed: int
    controller: AnyController
    study: str  # whose results it is from
    commit: str | None  # of the code that made them

    def about(self) -> dict[str, object]:
        """Which one it is, as cells of a table."""
        return {"method": self.method, "tuned_to": self.tuned_to, "seed": self.seed}

    def origin(self) -> dict[str, object]:
        """The same, and where it comes from."""
        parameters = {name: getattr(self.controller, name) for name in getattr(self.controller, "SPACE", ())}
        about = self.about() | dict.fromkeys(_PARAMETERS) | parameters
        return about | {"study": self.study, "commit": self.commit, "digest": self.controller.digest()}


Pilots = Annotated[tuple[Name, ...], AfterValidator(once_each), Field(min_length=1, description="policies compared")]


NameOrNone = Annotated[str, AfterValidator(lambda text: text and checked_name(text))]


class Found(Value):
    """Whose results are read, by the names of their directories; an empty name leaves them out."""

    policies: NameOrNone = Field("teacher_student", description="study of the policies")
    sinusoids: NameOrNone = Field("pareto", description="study of sinusoidal torque gaits: the fastest of each space")
    sea_snakes: NameOrNone = Field("sea_snake", description="study of sea-snake gaits: those of the highest return")
    gaits: Annotated[tuple[Name, ...], AfterValidator(once_each)] = Field(
        (), description="studies of the fronts of other gaits: the fastest of each space"
    )
    waveforms: NameOrNone = Field("fourier", description="study of free waveforms: those of the highest return")


class ComparisonConfig(StudyConfig):
    """What every study has that compares what others found.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    found: Found = Field(default_factory=Found, description="whose results are compared")
    pilots: Pilots = ("student", "teacher", "symmetric")
    seeds: Seeds = Field(description="of the policies")
    verify_rate: Count = Field(960, description="of the published figures, in PyBullet [Hz]")
    reference: Reference = (0.0, 30.0)

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return ("pybullet",)

    def scenario(self, fluid: str | Fluid | FluidField, **changes: Any) -> Scenario:
        """Where contenders swim, in a fluid or in one by its name."""
        here = {"robot": self.robot, "engine": "pybullet", "physics_rate": self.verify_rate, "duration": self.duration}
        return Scenario(**{"fluid": named_fluid(fluid) if isinstance(fluid, str) else fluid, **here, **changes})

    @property
    def n_policies(self) -> int:
        """How many policies are compared, counting every seed."""
        return len(self.pilots) * len(self.seeds) if self.found.policies else 0

    def expected(self) -> dict[Drives, int]:
        """How many contenders there will be at most, by what they drive: policies and gaits of target angle; torque."""
        each, found = len(self.fluids) + 1, self.found
        angles = each * (bool(found.sea_snakes) + bool(found.waveforms) + len(found.gaits))
        return {"angle": angles + self.n_policies, "torque": each * len(SINUSOIDS) if found.sinusoids else 0}


def contenders(config: ComparisonConfig, results: Path) -> list[Contender]:
    """The policies of every seed, and of each kind of gait the best for each fluid and, if there is one, for all.

    The best gait of a front is the fastest that needs less power than the reference; the best sea-snake gait and the
    best waveform are those of the highest return.

    Raises:
        InvalidValue: naming the study to run first, when something is not there; or when two are called alike.
    """
    with snapshot(results) as taken:
        for study in filter(None, (*config.found.model_dump(exclude={"gaits"}).values(), *config.found.gaits)):
            if study in taken.problems:
                raise InvalidValue(taken.problems[study])
        compared = _found(config, taken.copy)
    if not compared:
        raise InvalidValue("[found]: all are left out, there is nothing to compare")
    names = [tuple(one.about().values()) for one in compared]
    for method, tuned_to, _ in (name for i, name in enumerate(names) if name in names[:i]):
        raise InvalidValue(f"found: {method}, tuned to {tuned_to}, is found twice: give the search spaces other names")
    return compared


def _found(config: ComparisonConfig, results: Path) -> list[Contender]:
    found = config.found
    return [
        *(_policies(config, results) if found.policies else ()),
        *(_fastest(config, results / found.sinusoids, SINUSOIDS) if found.sinusoids else ()),
        *(_sea_snakes(config, results / found.sea_snakes) if found.sea_snakes else ()),
        *(_waveforms(config, results / found.waveforms) if found.waveforms else ()),
        *(one for study in found.gaits for one in _fastest(config, results / study)),
    ]


def _policies(config: ComparisonConfig, results: Path) -> Iterator[Contender]:
    directory = results / config.found.policies
    commit = _commit(config, directory)
    for name in config.pilots:
        for seed in config.seeds:
            path = directory / "policies" / f"{name}-{seed}.safetensors"
            if not path.exists():
                raise _no_policy(directory, f"{name}-{seed}")
            yield Contender(name, ADAPTIVE, seed, Policy.load(path), directory.name, commit)


def _no_policy(directory: Path, name: str) -> InvalidValue:
    """Why a study has no such policy: it is left out of the repository, or was never published."""
    manifest = read_manifest(directory)
    if f"policies/{name}.safetensors" in left_out_files(manifest):
        command = command_of(directory.name, manifest)
        return InvalidValue(f"{name} is left out of {directory}: run {command} first, or choose other pilots")
    there = sorted(file.stem for file in (directory / "policies").glob("*.safetensors"))
    return InvalidValue(f"{name} is no policy of {directory}: {', '.join(there) or 'none'} are there")


def _fastest(config: ComparisonConfig, directory: Path, spaces: Sequence[str] = ()) -> Iterator[Contender]:
    """Of each front of a study of gaits the fastest within the reference; in all of its search spaces or in some."""
    commit, fronts = _commit(config, directory), read_table(directory / "fronts.csv")
    config_of_it = read_manifest(directory)["config"]
    if "gait" not in config_of_it:
        raise InvalidValue(f"{directory} is no study of the fronts of a gait: its method is {config_of_it['method']}")
    kind = GAITS.named(config_of_it["gait"])
    usable = fronts[fronts["power"] < config.reference[1]]
    for space in spaces or list(fronts["space"].unique()):
        of_space = usable[usable["space"] == space]
        for name in _names(config, directory, of_space["front"]):
            row = of_space[of_space["front"] == name].nlargest(1, "speed").iloc[0]
            gait = kind(**{parameter: float(row[parameter]) for parameter in kind.SPACE})
            yield Contender(space, name, 0, gait, directory.name, commit)


def _sea_snakes(config: ComparisonConfig, directory: Path) -> Iterator[Contender]:
    commit, optima = _commit(config, directory), read_table(directory / "optima.csv")
    searched = optima[optima["variant"] == "searched"].assign(tuned_to=optima["objective"].replace(_BY_RETURN))
    for name in _names(config, directory, searched["tuned_to"]):
        row = _highest(searched[searched["tuned_to"] == name], ["seed", *_PARAMETERS], "return")
        gait = SeaSnake(**{parameter: float(row[parameter]) for parameter in _PARAMETERS})
        yield Contender("sea_snake", name, 0, gait, directory.name, commit)


def _waveforms(config: ComparisonConfig, directory: Path) -> Iterator[Contender]:
    commit, optima, gaits = (
        _commit(config, directory),
        *(read_table(directory / f"{n}.csv") for n in ("optima", "gaits")),
    )
    searched = optima[(optima["variant"] == "searched") & (optima["objective"] == "return")]
    for name in _names(config, directory, searched["tuned_to"]):
        row = _highest(searched[searched["tuned_to"] == name], ["harmonics", "seed"], "return")
        of_return = gaits[(gaits["objective"] == "return") & (gaits["tuned_to"] == name)]
        rows = of_return[(of_return["harmonics"] == row["harmonics"]) & (of_return["seed"] == row["seed"])]
        yield Contender("fourier", name, 0, fourier_gait(rows), directory.name, commit)


def _names(config: ComparisonConfig, directory: Path, there: Iterable[str]) -> list[str]:
    """The fluids, and "integrated" where it is there as well.

    Raises:
        InvalidValue: when nothing was tuned to one of the fluids.
    """
    known = set(there)
    for fluid in config.fluids:
        if fluid not in known:
            raise InvalidValue(f"{fluid}: nothing in {directory} was tuned to it, only to {', '.join(sorted(known))}")
    return [*config.fluids, *([INTEGRATED] if INTEGRATED in known else [])]


def _highest(rows: pd.DataFrame, by: Sequence[str], column: str) -> pd.Series:
    """The group with the highest mean of a column, as one row of what groups it."""
    return rows.groupby(list(by), sort=False)[column].mean().reset_index().nlargest(1, column).iloc[0]


def _commit(config: ComparisonConfig, directory: Path) -> str | None:
    """The commit whose code made the results of a study.

    Raises:
        InvalidValue: when they are not there, naming the command that makes them, or are of another robot.
    """
    try:
        manifest = read_manifest(directory)
    except StoreError:
        there = [path.name for path in sorted(directory.parent.glob(f"{directory.name}-*")) if path.is_dir()]
        beside = f"; there is {', '.join(there)}" if there else ""
        raise InvalidValue(
            f"no results in {directory}{beside}: run {command_of(directory.name)} first, or leave them out under"
            " [found]"
        ) from None
    if Robot(**manifest["config"]["robot"]) != config.robot:
        raise InvalidValue(f"{directory} is of another robot: compare what was found for the same one")
    return str(manifest["commit"]) if manifest["commit"] else None
