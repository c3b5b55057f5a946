"""Training jobs: which policies a study learns, and the learning itself, in parallel.

Each has a folder, named after a hash of all that determines it. It is read if finished, and continued if interrupted.
The estimator of a gain schedule starts again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast

import pandas as pd
from pydantic import Field, ValidationInfo, field_validator, model_validator

from snakebench.errors import SnakebenchError, UnknownName, missing
from snakebench.execution import Evaluator
from snakebench.files import writable_directory
from snakebench.gain_schedule import GainSchedule
from snakebench.learning.settings import Distillation, Imitating, Imitation, Scheduling, Training
from snakebench.memory import keep_freed_memory
from snakebench.policy import Policy
from snakebench.progress import seconds_kept, time_kept
from snakebench.publication import file_lock
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.studies.config import Seeds, StudyConfig
from snakebench.studies.learning_log import log_in, logs_followed
from snakebench.studies.protocol import Load, variants
from snakebench.value import Count, Name

if TYPE_CHECKING:
    from snakebench.learning.demonstrations import Demonstrations

Settings = dict[str, Any]
Kind = Training | Distillation | Imitation | Scheduling
Key = tuple[str, int]  # name and seed of a policy
_POLICY, _SECONDS = "policy.safetensors", "seconds.txt"  # files of a folder
# Of one step on one core, about, two side by side on two cores of the machine that learned the published policies [s].
_STEP_SECONDS = {"memoryless": 1e-4, "recurrent": 2.6e-4, "distilled": 8.5e-5, "scheduled": 4e-3}
_ALONE = 1.55e-4  # of a step of recurrent PPO there, with nothing beside it [s]
_TIMED = 600.0  # estimate from which on the speed of this machine is measured [s]


def _all(settings: dict[str, Any]) -> tuple[str, ...]:
    return tuple(settings.get("policies", ()))


def _without_schedules(settings: dict[str, Any]) -> tuple[str, ...]:
    return tuple(name for name, own in settings.get("policies", {}).items() if "estimator" not in own)


class LearningConfig(StudyConfig):
    """Which policies are learned: settings of all that are learned in one way, and of each policy over them."""

    seeds: Seeds = Field(description="of every policy that has no seeds of its own")
    training: Settings = Field(default_factory=dict, description="of every training")
    distillation: Settings = Field(default_factory=dict, description="of every distillation")
    imitation: Settings = Field(default_factory=dict, description="of every imitation of gaits")
    policies: dict[Name, Settings] = Field(
        min_length=1,
        description="of each policy, by name; with a teacher it is distilled from it, with demonstrations it imitates"
        " them, with an estimator as well it is a gain schedule of them",
    )
    only: tuple[Name, ...] = Field((), description="which of them, in this profile; all by default")
    verify_rate: Count = Field(960, description="of published figures, in PyBullet; half of it gives their error [Hz]")
    planar_rate: Count = Field(90, description="of the engine that policies learn in [Hz]")
    published: tuple[Name, ...] = Field(
        default_factory=_without_schedules, description="policies whose files are published; no gain schedules"
    )
    left_out: tuple[str, ...] = Field((), description="policies, or NAME-SEED, whose files the repository leaves out")
    shown: tuple[Name, ...] = Field(default_factory=_all, description="policies whose first seed's swims are published")

    @field_validator("only", "published", "left_out", "shown")
    @classmethod
    def _are_policies(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        for name in names:
            if info.field_name == "published" and "estimator" in info.data.get("policies", {}).get(name, ()):
                raise ValueError(f"{name} is a gain schedule, whose file is not published")
            known = {name, _without_seed(name)} if info.field_name == "left_out" else {name}
            if not known & set(info.data.get("policies", [name])):
                raise UnknownName.among("policy", name, info.data["policies"])
        return names

    def leaves_out(self, file: str) -> bool:
        """Whether the repository leaves out the policy NAME-SEED."""
        return bool({file, _without_seed(file)} & set(self.left_out))

    @model_validator(mode="after")
    def _teachers_are_learned(self) -> Self:
        jobs = {job.key: job for job in self.training_jobs()}
        for job in jobs.values():
            if job.teacher and job.teacher not in jobs:
                raise ValueError(f"{job}: its teacher {job.teacher[0]!r} is not learned with that seed")
            teacher = jobs[job.teacher].settings if job.teacher else None
            if job.teacher and not isinstance(teacher, Training):
                raise ValueError(f"{job}: its teacher {job.teacher[0]!r} imitates itself or is a gain schedule")
            if teacher and job.settings.randomisation.prices != teacher.randomisation.prices:
                raise ValueError(f"{job}: randomisation.prices must be its teacher's")
            ours, theirs = ((one.robot.n_joints, one.control_rate) for one in (job.settings, teacher or job.settings))
            if ours != theirs:
                raise ValueError(f"{job}: joints and control_rate must be its teacher's: {theirs[0]}, {theirs[1]} Hz")
        return self

    def check_installed(self) -> None:
        """Make sure that the libraries of learning are installed."""
        try:
            import snakebench.learning.training  # noqa: F401
        except ModuleNotFoundError as error:
            raise missing("learning", error.name, "learning") from None

    def training_jobs(self) -> list[TrainingJob]:
        """One for every policy and seed, trainings before the distillations that need them."""
        jobs = []
        for name in self.only or self.policies:
            own = dict(self.policies[name])
            seeds, robot = own.pop("seeds", self.seeds), own.pop("robot", {})
            listed = isinstance(seeds, list | tuple) and len(seeds) > 0
            if not (listed and all(type(seed) is int and 0 <= seed < 2**32 for seed in seeds)):
                raise ValueError(f"policies.{name}.seeds = {seeds!r}: a list of whole numbers from 0 is needed")
            if not isinstance(robot, dict):
                raise ValueError(f"policies.{name}.robot = {robot!r}: a table is needed")
            body = Robot(**(self.robot.model_dump(exclude_unset=True) | robot))
            kind, shared = self._kind(own)
            settings = kind(**({"robot": body, "duration": self.duration} | shared | own))
            jobs += [TrainingJob(name, seed, settings) for seed in seeds]
        return sorted(jobs, key=lambda job: job.teacher is not None)

    def _kind(self, own: Settings) -> tuple[type[Kind], Settings]:
        """How a policy of these settings is learned, and what all that are learned so share."""
        if "estimator" in own:
            return Scheduling, {}
        if "demonstrations" in own:
            return Imitation, self.imitation
        return (Distillation, self.distillation) if "teacher" in own else (Training, self.training)

    def variants(self, job: TrainingJob) -> dict[str, Scenario]:
        """Where a policy is evaluated in water; in other fluids likewise."""
        own = {"robot": job.settings.robot, "control_rate": job.settings.control_rate, "duration": self.duration}
        fine = Scenario(**own, engine="pybullet", physics_rate=self.verify_rate)
        return variants(fine, self.planar_rate)


class TrainingJob(NamedTuple):
    """A policy to be learned with one seed."""

    name: str
    seed: int
    settings: Kind

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
    def seconds(self) -> float:
        """About how long it takes on one core of the machine that learned the published ones [s]."""
        own = self.settings
        if isinstance(own, Training):
            kind = "recurrent" if own.lstm else "memoryless"
        else:
            kind = "distilled" if isinstance(own, Imitating) else "scheduled"
        return own.all_steps * _STEP_SECONDS[kind]


class Learned(NamedTuple):
    """What was learned."""

    policies: Mapping[Key, Policy | GainSchedule]
    published: dict[str, Policy]  # those whose files are published with the results, by the names of their files
    curves: pd.DataFrame  # the logs of all, one row a checkpoint, with the policy's name and seed
    steps: pd.DataFrame  # of each: control steps, those of a rollout, and the change per update aimed at, `kl`


def learning_load(jobs: Sequence[TrainingJob], scenario: Scenario) -> Load:
    """What `learn` counts: every policy once; it reports its own time."""
    return Load("angle", scenario.but(duration=1 / scenario.control_rate), len(jobs))


def learning_seconds(jobs: Sequence[TrainingJob], workers: int) -> float:
    """About how long `learn` takes here if nothing is learned yet [s]."""
    stages = [[job.seconds for job in stage] for stage in _stages(jobs)]
    seconds = sum(max(sum(stage) / workers, *stage) for stage in stages if stage)
    return seconds * _slowness() if seconds > _TIMED else seconds


def _slowness() -> float:
    """How many times slower PPO is here than where `_STEP_SECONDS` was measured."""
    from snakebench.learning.pace import step_seconds

    return step_seconds() / _ALONE


def _stages(jobs: Sequence[TrainingJob]) -> list[list[TrainingJob]]:
    return [[job for job in jobs if (job.teacher is not None) is distilled] for distilled in (False, True)]


def learn(config: LearningConfig, evaluate: Evaluator) -> Learned:
    """Learn all policies; when a training fails, all others of its stage are finished first."""
    from snakebench.learning.resume import TrainingFolder, learning_key
    from snakebench.learning.schedule import read_schedule, set_damaged_schedule_aside
    from snakebench.studies.demonstrated import demonstrations

    jobs = config.training_jobs()
    steps = sum(job.settings.all_steps for job in jobs) / 1e6
    evaluate.work.say(f"{config.name}: first {len(jobs)} policies are learned, {steps:.3g} million steps in all")
    policies: dict[Key, Policy] = {}
    schedules: dict[Key, GainSchedule] = {}
    folders: dict[Key, Path] = {}
    with logs_followed(jobs, folders, evaluate):
        for stage in _stages(jobs):
            tasks = []
            for job in stage:
                teacher: Policy | Demonstrations | None = policies[job.teacher] if job.teacher else None
                if isinstance(job.settings, Imitation | Scheduling):
                    teacher = demonstrations(config, job.settings, evaluate.results)
                key = learning_key(job.settings, job.seed, teacher)
                folder = evaluate.directory / "training" / f"{job.name}-{job.seed}-{key}"
                if TrainingFolder(folder).set_damaged_aside() or set_damaged_schedule_aside(folder):
                    evaluate.work.say(f"{job}: what was learned is damaged: it is set aside, and learned again")
                folders[job.key] = folder  # from now on its log is followed
                tasks.append((job, teacher, folder))
            errors = [error for error in evaluate.compute(_learn_one, tasks) if error]
            if errors:
                raise errors[0]
            for job in stage:
                if isinstance(job.settings, Scheduling):
                    schedules[job.key] = cast(GainSchedule, read_schedule(folders[job.key]))
                else:
                    policies[job.key] = Policy.load(folders[job.key] / _POLICY)
    kept = {str(job): seconds_kept(folders[job.key] / _SECONDS) for job in jobs}
    evaluate.training_seconds |= {name: seconds for name, seconds in kept.items() if seconds is not None}
    published = {f"{name}-{seed}": policy for (name, seed), policy in policies.items() if name in config.published}
    logs = pd.concat({key: log_in(folder) for key, folder in folders.items()}, names=["policy", "seed"])
    effort = pd.DataFrame(
        {"policy": job.name, "seed": job.seed, "steps": job.settings.all_steps}
        | {name: getattr(job.settings, name, None) for name in ("rollout", "kl")}
        for job in jobs
    )
    return Learned({**policies, **schedules}, published, logs.reset_index(["policy", "seed"]), effort)


def _without_seed(file: str) -> str:
    return re.sub(r"-\d+$", "", file)


def _learn_one(job: TrainingJob, teacher: Policy | Demonstrations | None, folder: Path) -> SnakebenchError | None:
    """What a worker does: it leaves everything in the folder."""
    from snakebench.learning.perturbed_distillation import distil_perturbed
    from snakebench.learning.schedule import learn_schedule, read_schedule
    from snakebench.learning.training import distil, train

    keep_freed_memory()
    labels: dict[str, str | int] = {"policy": job.name, "seed": job.seed, "steps": job.settings.all_steps}

    def is_learned() -> bool:
        return (folder / _POLICY).exists() or read_schedule(folder) is not None

    try:
        if is_learned():  # its time was kept then, or never
            return None
        with file_lock(writable_directory(folder) / ".lock", wait=True):  # another study may be learning the same
            if is_learned():
                return None
            with time_kept(folder / _SECONDS):
                if isinstance(job.settings, Training):
                    train(job.settings, job.seed, folder, labels)
                elif isinstance(job.settings, Scheduling):
                    learn_schedule(job.settings, cast("Demonstrations", teacher), job.seed, folder)
                elif teacher is not None:
                    teach = distil_perturbed if job.settings.randomisation.perturbations else distil
                    teach(job.settings, teacher, job.seed, folder, labels)
    except SnakebenchError as error:
        error.args = (f"{job}: {error}",)
        return error
    return None
