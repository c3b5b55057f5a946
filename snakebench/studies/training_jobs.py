"""What policies a study has to be learned: settings from a study file, and the learning itself, in parallel.

Each training has a folder of its own under `.cache/training` in the results directory, named after the policy, its seed
and a hash of all that determines it: a finished one is read, an interrupted one continues from its last checkpoint.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import pandas as pd
from pydantic import Field, field_validator, model_validator

from snakebench.errors import InvalidValue, SnakebenchError, UnknownName
from snakebench.execution import Evaluator
from snakebench.learning.settings import Distillation, Training
from snakebench.policy import Policy
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.studies.config import Seeds, StudyConfig
from snakebench.studies.planning import Load
from snakebench.value import Count, Name

Settings = dict[str, Any]
Key = tuple[str, int]  # name and seed of a policy
_SECONDS_BETWEEN_LOOKS = 2.0
# Of one control step on one core, about: logs of the published policies, two side by side on two cores [s].
_STEP_SECONDS = {"memoryless": 1e-4, "recurrent": 3e-4, "distilled": 1.5e-4}


def _all(settings: dict[str, Any]) -> tuple[str, ...]:
    """The names of all policies."""
    return tuple(settings.get("policies", ()))


class LearningConfig(StudyConfig):
    """Which policies are learned: settings of all trainings, of all distillations, and of each policy over them.

    Raises:
        InvalidValue: for a wrong, missing or unknown setting.
    """

    learns: ClassVar[bool] = True

    seeds: Seeds = Field(description="of every policy that has no seeds of its own")
    training: Settings = Field(default_factory=dict, description="of every training")
    distillation: Settings = Field(default_factory=dict, description="of every distillation")
    policies: dict[Name, Settings] = Field(
        min_length=1, description="of each policy, by name; one with a teacher is distilled from it"
    )
    only: tuple[Name, ...] = Field((), description="which of them, in this profile; all by default")
    verify_rate: Count = Field(
        960, description="of the published figures, in PyBullet; half of it tells their error [Hz]"
    )
    planar_rate: Count = Field(90, description="of the engine that policies learn in [Hz]")
    published: tuple[Name, ...] = Field(default_factory=_all, description="policies whose files are kept")
    left_out: tuple[Name, ...] = Field((), description="those of them that the repository leaves out")
    shown: tuple[Name, ...] = Field(default_factory=_all, description="policies whose first seed's swims are kept")

    @field_validator("published", "left_out", "shown")
    @classmethod
    def _are_learned(cls, names: tuple[str, ...], about: Any) -> tuple[str, ...]:
        for name in names:
            if name not in about.data.get("policies", {name: {}}):
                raise UnknownName.among("policy", name, about.data["policies"])
        return names

    @model_validator(mode="after")
    def _all_can_be_learned(self) -> Self:
        for name in self.only:
            if name not in self.policies:
                raise UnknownName.among("policy", name, self.policies)
        lessons = {lesson.key: lesson for lesson in self.lessons()}
        for lesson in lessons.values():
            if lesson.teacher is not None and lesson.teacher not in lessons:
                raise ValueError(f"{lesson}: its teacher {lesson.teacher[0]!r} is not learned with that seed")
            if lesson.teacher is not None and lesson.prices != lessons[lesson.teacher].prices:
                raise ValueError(f"{lesson}: randomisation.prices must be its teacher's")
        return self

    def leaves_out(self, policy: str) -> bool:
        """As for every study: those of `left_out`."""
        return policy.rpartition("-")[0] in self.left_out

    def lessons(self) -> list[Lesson]:
        """All policies to be learned, trainings before the distillations that need them."""
        found = []
        for name in self.only or self.policies:
            given = dict(self.policies[name])
            seeds = given.pop("seeds", self.seeds)
            if not isinstance(seeds, list | tuple) or not seeds or not all(map(_is_seed, seeds)):
                raise ValueError(f"policies.{name}.seeds = {seeds!r}: a list of whole numbers from 0 is needed")
            if not isinstance(own := given.pop("robot", {}), dict):
                raise ValueError(f"policies.{name}.robot = {own!r}: a table is needed")
            robot = Robot(**(self.robot.model_dump(exclude_unset=True) | own))
            common = {"robot": robot, "duration": self.duration}
            settings: Training | Distillation = (
                Distillation(**(common | self.distillation | given))
                if "teacher" in given
                else Training(**(common | self.training | given))
            )
            found += [Lesson(name, seed, settings) for seed in seeds]
        return sorted(found, key=lambda lesson: lesson.teacher is not None)

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return "planar", "pybullet"

    def variants(self, lesson: Lesson) -> dict[str, Scenario]:
        """Where a policy is evaluated in water; in other fluids likewise."""
        settings = lesson.settings
        common = {"robot": settings.robot, "duration": self.duration, "control_rate": settings.control_rate}
        fine = common | {"engine": "pybullet", "physics_rate": self.verify_rate}
        return {
            "finer step": Scenario(**fine),
            "coarser step": Scenario(**fine | {"physics_rate": self.verify_rate // 2}),
            "planar": Scenario(**common, engine="planar", physics_rate=self.planar_rate),
        }


class Lesson(NamedTuple):
    """A policy to be learned."""

    name: str
    seed: int
    settings: Training | Distillation

    def __str__(self) -> str:
        return f"{self.name} {self.seed}"

    @property
    def key(self) -> Key:
        """Name and seed."""
        return self.name, self.seed

    @property
    def teacher(self) -> Key | None:
        """The policy that it needs first."""
        return (self.settings.teacher, self.seed) if isinstance(self.settings, Distillation) else None

    @property
    def steps(self) -> int:
        """Control steps that it takes, of all members together."""
        s = self.settings
        return s.steps if isinstance(s, Training) else s.iterations * s.rollout * s.members

    @property
    def prices(self) -> tuple[float, float] | None:
        """The range of its dial [1/W]."""
        return self.settings.randomisation.prices

    @property
    def seconds(self) -> float:
        """About how long it takes on one core of the machine that learned the published ones [s]."""
        kind = "distilled" if self.teacher else "recurrent" if self.settings.lstm else "memoryless"
        return self.steps * _STEP_SECONDS[kind]

    def effort(self) -> dict[str, int | float | None]:
        """What it takes to learn: steps, those of a rollout, and the change per update that a training aims at."""
        kl = self.settings.kl if isinstance(self.settings, Training) else None
        return {"steps": self.steps, "rollout": self.settings.rollout, "kl": kl}


class Learned(NamedTuple):
    """What was learned."""

    policies: dict[Key, Policy]
    curves: pd.DataFrame  # the logs of all, one row a checkpoint, with the policy's name and seed
    steps: pd.DataFrame  # what each took to learn, as `Lesson.effort`

    def published(self, names: Sequence[str]) -> dict[str, Policy]:
        """The policies whose files are kept with the results, by the names of their files."""
        return {f"{name}-{seed}": policy for (name, seed), policy in self.policies.items() if name in names}


def _is_seed(value: object) -> bool:
    return type(value) is int and 0 <= value < 2**32


def learning_load(lessons: Sequence[Lesson], scenario: Scenario) -> Load:
    """What `learn` counts: every policy once; it tells of its own time."""
    return Load("angle", scenario.but(duration=1 / scenario.control_rate), len(lessons))


def check_learning() -> None:
    """Make sure that policies can be learned here.

    Raises:
        InvalidValue: when a library is missing, with the command that installs it.
    """
    try:
        import snakebench.learning.distillation
        import snakebench.learning.training  # noqa: F401
    except ModuleNotFoundError as error:
        raise InvalidValue(f'learning needs {error.name}: pip install "snakebench[learning]"') from None


def learning_seconds(lessons: Sequence[Lesson], workers: int) -> float:
    """About how long `learn` takes if nothing is learned yet: first the trainings, then the distillations [s]."""
    stages = [[one.seconds for one in lessons if (one.teacher is None) is first] for first in (True, False)]
    return sum(max(sum(stage) / workers, *stage) for stage in stages if stage)


def learn(config: LearningConfig, evaluate: Evaluator) -> Learned:
    """Learn all policies, those that need no teacher first.

    Raises:
        LearningFailed: when numbers of a training are no longer finite; all others are finished first.
    """
    from snakebench.learning.training_folder import TrainingFolder

    lessons = config.lessons()
    steps = sum(lesson.steps for lesson in lessons) / 1e6
    evaluate.say(f"{config.name}: first {len(lessons)} policies are learned, {steps:.3g} million control steps in all")
    policies: dict[Key, Policy] = {}
    folders: dict[Key, Path] = {}
    with _logs_followed(lessons, folders, evaluate):
        for needs_teacher in (False, True):
            now = [lesson for lesson in lessons if (lesson.teacher is not None) is needs_teacher]
            tasks = []
            for lesson in now:
                teacher = policies[lesson.teacher] if lesson.teacher else None
                folders[lesson.key] = folder = evaluate.directory / "training" / _folder(lesson, teacher)
                if TrainingFolder(folder).set_damaged_aside():
                    evaluate.say(f"{lesson}: what was learned is damaged: it is set aside, and learned again")
                tasks.append((lesson, teacher, folder))
            answers = list(evaluate.compute(_learned, tasks))
            for answer in answers:
                if isinstance(answer, SnakebenchError):
                    raise answer
            policies |= {lesson.key: Policy.load(folders[lesson.key] / "policy.safetensors") for lesson in now}
    rows = [{"policy": name, "seed": seed} | row for (name, seed), folder in folders.items() for row in _log(folder)]
    taken = [{"policy": lesson.name, "seed": lesson.seed} | lesson.effort() for lesson in lessons]
    return Learned(policies, pd.DataFrame(rows), pd.DataFrame(taken))


def _log(folder: Path) -> list[dict[str, Any]]:
    try:
        table = pd.read_csv(folder / "log.csv")
    except (OSError, ValueError):
        return []
    return [{str(name): cell for name, cell in row.items()} for row in table.to_dict("records")]


def _folder(lesson: Lesson, teacher: Policy | None) -> str:
    from snakebench.learning.resume import learning_key

    return f"{lesson.name}-{lesson.seed}-{learning_key(lesson.settings, lesson.seed, teacher)}"


def _learned(lesson: Lesson, teacher: Policy | None, folder: Path) -> SnakebenchError | None:
    """What a worker does: it leaves everything in the folder."""
    from snakebench.learning.distillation import distil
    from snakebench.learning.training import train

    origin: dict[str, str | int | float] = {"policy": lesson.name, "seed": lesson.seed, "steps": lesson.steps}
    try:
        if isinstance(lesson.settings, Training):
            train(lesson.settings, lesson.seed, folder, origin)
        else:
            assert teacher is not None
            distil(lesson.settings, teacher, lesson.seed, folder, origin)
    except SnakebenchError as error:
        return type(error)(f"{lesson}: {error}")
    return None


@contextmanager
def _logs_followed(lessons: Sequence[Lesson], folders: Mapping[Key, Path], evaluate: Evaluator) -> Iterator[None]:
    """Tell the user of every new row of a log meanwhile."""
    over = threading.Event()
    watcher = threading.Thread(target=_watch, args=(lessons, folders, evaluate, over), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def _watch(lessons: Sequence[Lesson], folders: Mapping[Key, Path], evaluate: Evaluator, over: threading.Event) -> None:
    rows_of: dict[Key, int] = {}
    whole = sum(lesson.seconds for lesson in lessons)
    done, ended = 0.0, False
    while not ended:
        ended = over.wait(_SECONDS_BETWEEN_LOOKS)  # and a last look
        logs = [(lesson, _log(folders[lesson.key])) for lesson in lessons if lesson.key in folders]
        for lesson, rows in logs:
            before = rows_of.get(lesson.key, 0)
            done += (len(rows) - before) / lesson.settings.checkpoints * lesson.seconds
            found = lesson.key not in rows_of  # what an earlier run has learned is no news
            evaluate.learned(done / whole, found)
            if not found and len(rows) > before:
                evaluate.say("; ".join(filter(None, (f"{lesson}: {_told(lesson, rows)}", evaluate.left()))))
            rows_of[lesson.key] = len(rows)


def _share(lesson: Lesson, rows: Sequence[Mapping[str, Any]]) -> float:
    return len(rows) / lesson.settings.checkpoints


def _told(lesson: Lesson, rows: Sequence[Mapping[str, Any]]) -> str:
    last = rows[-1]
    speeds = [f"{name.removeprefix('speed_')} {last[name]:.3f}" for name in last if name.startswith("speed_")]
    earned = "" if pd.isna(last["return_mean"]) else f", return {last['return_mean']:.1f}"
    return f"{_share(lesson, rows):.0%}{earned}, m/s in {', '.join(speeds)}"
