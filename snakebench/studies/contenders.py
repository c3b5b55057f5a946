"""Gaits and policies to be compared: the best of earlier studies, read from their published results.

A search that has seeds gives one gait for each: a mean over trainings is compared with a mean over searches.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import pandas as pd
from pydantic import AfterValidator, Field

from snakebench.collocation.front import gait_at, under_first_bounds
from snakebench.controllers import GAITS, SeaSnake
from snakebench.errors import InvalidValue, StoreError
from snakebench.fluid import Medium
from snakebench.manifest import command_of, left_out_files, read_manifest
from snakebench.names import ADAPTIVE, EXTENDED, INTEGRATED, PAPER
from snakebench.policy import Policy
from snakebench.publication import Snapshot, note_read, snapshot
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController
from snakebench.studies.config import Distinct, Reference, Seeds, StudyConfig, once_each
from snakebench.studies.protocol import STAND_INS
from snakebench.tables import Columns, fourier_gait, parametric_gait, read_table
from snakebench.value import Count, Name, Value, checked_name

SINUSOIDS = (PAPER, EXTENDED)  # search spaces whose fastest gaits are compared
USUAL_SEEDS = tuple(range(5))  # about those of a study whose results are not read yet
_PARAMETERS = list(SeaSnake.SPACE)  # which every contender has as columns, filled or not
# Columns of what is read: names of fluids may look like numbers.
FRONTS: Columns = {"space": str, "front": str, "currency": str, "power": float}
_LIMIT: Columns = {"fluid": str | None}
_OPTIMA: Columns = {"objective": str, "variant": str, "seed": int}
_WAVEFORMS: dict[str, Columns] = {
    "optima": {"tuned_to": str, "objective": str, "variant": str, "harmonics": int, "seed": int},
    "gaits": {"tuned_to": str, "objective": str, "harmonics": int, "seed": int},
}
Best = tuple[str, str, int, AnyController]  # method, what it is tuned to, seed, controller
Reader = Callable[..., Iterator[Best]]  # of settings, a directory of results and its manifest


class Contender(NamedTuple):
    """A gait or a policy to be compared."""

    method: str  # a policy's name, or the search space or study of a gait
    tuned_to: str  # fluid, "integrated" for all of them, or "adaptive" for a policy
    seed: int  # of the training or of the search
    controller: AnyController
    study: str  # whose results it is from
    commit: str | None  # of the code that made them
    gait: int | None = None  # its number, where there are several of a method

    def labels(self) -> dict[str, object]:
        """The cells of a table that identify it, but for the number."""
        return {"method": self.method, "tuned_to": self.tuned_to, "seed": self.seed}

    def origin(self) -> dict[str, object]:
        """The same, its parameters, and where it comes from."""
        parameters = {name: getattr(self.controller, name) for name in getattr(self.controller, "SPACE", ())}
        source = {"study": self.study, "commit": self.commit, "digest": self.controller.digest()}
        return self.labels() | dict.fromkeys(_PARAMETERS) | parameters | source


Pilots = Annotated[Distinct[Name], Field(description="policies compared")]
NameOrNone = Annotated[str, AfterValidator(lambda text: text and checked_name(text))]


class Contenders(Value):
    """Whose results are read, by the names of their directories; an empty name leaves them out."""

    policies: NameOrNone = Field("teacher_student", description="study of the policies")
    sinusoids: NameOrNone = Field("pareto", description="study of sinusoids: the fastest of `paper` and `extended`")
    sea_snakes: NameOrNone = Field("sea_snake", description="study of sea-snake gaits: that of each seed")
    gaits: Annotated[tuple[Name, ...], AfterValidator(once_each)] = Field(
        (), description="studies of the fronts of other gaits: the fastest of each space"
    )
    waveforms: NameOrNone = Field("fourier", description="study of free waveforms: of each seed the best by return")
    limit: NameOrNone = Field("", description="study of the limit of the body: the fastest gait of each fluid")


class ComparisonConfig(StudyConfig):
    """Settings of every study that compares gaits and policies of earlier studies."""

    contenders: Contenders = Field(default_factory=Contenders, description="whose results are compared")
    pilots: Pilots = ("student", "teacher", "symmetric")
    seeds: Seeds | None = Field(None, description="of the policies; all that there are by default")
    verify_rate: Count = Field(960, description="of the published figures, in PyBullet [Hz]")
    reference: Reference = (0.0, 30.0)

    def scenario(self, fluid: Medium | str, **changes: Any) -> Scenario:
        """Where contenders swim, in a fluid or in one by its name."""
        here = {"robot": self.robot, "engine": "pybullet", "physics_rate": self.verify_rate, "duration": self.duration}
        return Scenario(**{"fluid": fluid} | here | changes)

    def expected(self) -> list[Contender]:
        """Stand-ins for about as many contenders as there will be; a study of other gaits counts as one space."""
        studies, seeds = self.contenders, self.seeds or USUAL_SEEDS
        gaits = [
            STAND_INS["angle"] for study, _ in product((studies.sea_snakes, studies.waveforms), USUAL_SEEDS) if study
        ]
        gaits += [STAND_INS["angle"] for _ in (*studies.gaits, *filter(None, [studies.limit]))]
        gaits += [STAND_INS["torque"] for _ in SINUSOIDS if studies.sinusoids]
        policies = product(self.pilots, seeds) if studies.policies else ()
        return [
            *(Contender(name, ADAPTIVE, seed, STAND_INS["angle"], "", None) for name, seed in policies),
            *(Contender("", tuned_to, 0, gait, "", None) for gait in gaits for tuned_to in (*self.fluids, INTEGRATED)),
        ]


def contenders(config: ComparisonConfig, results: Path) -> list[Contender]:
    """The policies of every seed, and of each kind of gait the best for each fluid and, if there is one, for all.

    Of gaits whose search has seeds it is the best of each seed.
    """
    studies = config.contenders
    readers: list[tuple[str, Reader]] = [
        (studies.policies, _policies),
        (studies.sinusoids, partial(_fastest, spaces=SINUSOIDS)),
        (studies.sea_snakes, _sea_snakes),
        (studies.waveforms, _waveforms),
        (studies.limit, _of_the_limit),
        *((study, _fastest) for study in studies.gaits),
    ]
    compared = read_contenders(config, results, readers)
    if not compared:
        raise InvalidValue("[contenders]: all are left out, there is nothing to compare")
    check_distinct(compared)
    return compared


def read_contenders(config: StudyConfig, results: Path, readers: Sequence[tuple[str, Reader]]) -> list[Contender]:
    """What each reader makes of the published results of its study; studies without a name are left out."""
    found = list[Contender]()
    with snapshot(results) as taken:
        for study, read in [(study, read) for study, read in readers if study]:
            directory, manifest = read_study(config, taken, study)
            best = read(config, directory, manifest)
            found += [Contender(*one, study, manifest["commit"] or None) for one in best]
    return found


def check_distinct(compared: Sequence[Contender]) -> None:
    """Make sure that no two are called alike; an InvalidValue otherwise."""
    labels = pd.DataFrame(one.labels() for one in compared)
    for method, tuned_to, seed in labels.loc[labels.duplicated()].to_numpy():
        whose = f"{method}-{seed}" if tuned_to == ADAPTIVE else f"{method}, tuned to {tuned_to},"
        raise InvalidValue(f"[contenders]: {whose} is there twice: give policies and search spaces names of their own")


def _policies(config: ComparisonConfig, directory: Path, manifest: Mapping[str, Any]) -> Iterator[Best]:
    asked = [(name, seed) for name in config.pilots for seed in config.seeds or _seeds_there(name, directory, manifest)]
    for name, seed in asked:
        yield name, ADAPTIVE, seed, policy_in(directory, manifest, name, seed)


def policy_in(directory: Path, manifest: Mapping[str, Any], name: str, seed: int) -> Policy:
    """A policy of a study.

    Raises:
        InvalidValue: when there is none; if it is only left out of the repository, with the command that makes it.
    """
    path = directory / "policies" / f"{name}-{seed}.safetensors"
    if path.exists():
        return Policy.load(path)
    if f"policies/{path.name}" in left_out_files(manifest):
        first = f"run {command_of(directory.name, manifest)} first, or choose other policies"
        raise InvalidValue(f"{path.stem} is left out of {directory}: {first}")
    there = ", ".join(sorted(file.stem for file in path.parent.glob("*.safetensors")))
    raise InvalidValue(f"{path.stem} is no policy of {directory}: {there or 'none'} are there")


def _seeds_there(name: str, directory: Path, manifest: Mapping[str, Any]) -> list[int]:
    """The seeds of a policy that are there or left out of the repository; 0 if there are none, to be missed by name."""
    files = [*(directory / "policies").glob("*.safetensors"), *map(Path, left_out_files(manifest))]
    known = {path.stem.rpartition("-")[::2] for path in files}
    return sorted(int(seed) for policy, seed in known if policy == name and seed.isdecimal()) or [0]


def _fastest(
    config: ComparisonConfig, directory: Path, manifest: Mapping[str, Any], spaces: Sequence[str] = ()
) -> Iterator[Best]:
    """Of each front of P of a study of gaits the fastest within the reference; in all of its search spaces or in some.

    A front is the best of a grid, which has no seeds, and of all searches.
    """
    settings = manifest["config"]
    if "gait" not in settings:
        raise InvalidValue(f"{directory} is no study of the fronts of a gait: its method is {settings['method']}")
    fronts = read_table(directory / "fronts.csv", FRONTS)
    kind = GAITS.named(settings["gait"])
    usable = fronts[(fronts["currency"] == "net") & (fronts["power"] < config.reference[1])]
    usable = usable.rename(columns={"front": "tuned_to"})
    for space in spaces or list(fronts["space"].unique()):
        for row in _best(config, directory, usable[usable["space"] == space].assign(seed=0), "speed"):
            yield space, row["tuned_to"], 0, parametric_gait(kind, row)


def _sea_snakes(config: ComparisonConfig, directory: Path, _manifest: Mapping[str, Any]) -> Iterator[Best]:
    optima = read_table(directory / "optima.csv", _OPTIMA | dict.fromkeys(_PARAMETERS, float))
    searched = optima[optima["variant"] == "searched"].assign(tuned_to=optima["objective"].replace("mean", INTEGRATED))
    returns = searched.groupby(["tuned_to", "seed", *_PARAMETERS], sort=False)["return"].mean().reset_index()
    for row in _best(config, directory, returns, "return"):
        yield "sea_snake", row["tuned_to"], int(row["seed"]), parametric_gait(SeaSnake, row)


def _waveforms(config: ComparisonConfig, directory: Path, _manifest: Mapping[str, Any]) -> Iterator[Best]:
    tables = (read_table(directory / f"{name}.csv", columns) for name, columns in _WAVEFORMS.items())
    optima, gaits = (table[table["objective"] == "return"] for table in tables)
    search = ["tuned_to", "harmonics", "seed"]
    returns = optima[optima["variant"] == "searched"].groupby(search, sort=False)["return"].mean().reset_index()
    for row in _best(config, directory, returns, "return"):
        gait = fourier_gait(gaits[(gaits[search] == row[search]).all(axis=1)])
        yield "fourier", row["tuned_to"], int(row["seed"]), gait


def _of_the_limit(config: ComparisonConfig, directory: Path, manifest: Mapping[str, Any]) -> Iterator[Best]:
    """Of each fluid the fastest gait of net power within the reference, under the study's first bounds."""
    limit, gaits = limit_tables(directory)
    usual = under_first_bounds(limit, manifest["config"])
    usable = usual[(usual["currency"] == "net") & (usual["power"] < config.reference[1])]
    for row in _best(config, directory, usable.assign(tuned_to=usable["fluid"], seed=0), "speed"):
        yield "limit", row["tuned_to"], 0, gait_at(gaits, row)


def _best(config: ComparisonConfig, directory: Path, gaits: pd.DataFrame, column: str) -> Iterator[pd.Series]:
    """Of each seed the row with the highest value of a column for each fluid and, where there is one, for all."""
    known = set(gaits["tuned_to"])
    for fluid in config.fluids:
        if fluid not in known:
            raise InvalidValue(f"{fluid}: nothing in {directory} was tuned to it, only to {', '.join(sorted(known))}")
    for tuned_to in (*config.fluids, *(known & {INTEGRATED})):
        for _, of_seed in gaits[gaits["tuned_to"] == tuned_to].groupby("seed"):
            yield of_seed.nlargest(1, column).iloc[0]


def read_limit(config: StudyConfig, results: Path, study: str) -> tuple[pd.DataFrame, pd.DataFrame, dict[str, Any]]:
    """The points and the gaits of a study of the limit, and its settings; errors as of `read_study`."""
    with snapshot(results) as taken:
        directory, manifest = read_study(config, taken, study)
        return *limit_tables(directory), manifest["config"]


def limit_tables(directory: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The points and the gaits of a study of the limit."""
    return read_table(directory / "limit.csv", _LIMIT), read_table(directory / "gaits.csv", _LIMIT)


def read_study(config: StudyConfig, taken: Snapshot, study: str) -> tuple[Path, dict[str, Any]]:
    """The results of a study that another one reads, and their manifest.

    Raises:
        InvalidValue: when there are no results that can be used, or they are of another robot.
    """
    if study in taken.problems:
        raise InvalidValue(taken.problems[study])
    directory = taken.copy / study
    try:
        manifest = read_manifest(directory)
    except StoreError:
        there = [path.name for path in sorted(directory.parent.glob(f"{directory.name}-*")) if path.is_dir()]
        beside = f"; there is {', '.join(there)}" if there else ""
        first = f"run {command_of(directory.name)} first, or name another study"
        raise InvalidValue(f"no results in {directory}{beside}: {first}") from None
    if Robot(**manifest["config"]["robot"]) != config.robot:
        raise InvalidValue(f"{directory} is of another robot: compare what was found for the same one")
    note_read(study, manifest)
    return directory, manifest
