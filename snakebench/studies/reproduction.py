"""Reproduction: the studies of the library one after another, all checked and weighed before anything is run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from snakebench.errors import SnakebenchError
from snakebench.execution import compile_engine
from snakebench.progress import Whole, in_words
from snakebench.publication import check_results
from snakebench.store import STUDIES
from snakebench.studies.config import StudyConfig, study_path, study_settings
from snakebench.studies.planning import expected_seconds
from snakebench.studies.running import run_study, study_config, study_plan
from snakebench.studies.training_jobs import LearningConfig, learning_seconds


def checked_configs(profile: str | None = None, studies: Sequence[str] = STUDIES) -> list[StudyConfig]:
    """The configurations of studies in a profile, their own if None; each can be run here.

    Raises:
        SnakebenchError: naming the first study that cannot.
    """
    configs = []
    for name in studies:
        with _named(name):
            configs.append(study_config(study_settings(study_path(name), profile)))
            study_plan(configs[-1])
    return configs


def reproduce(
    configs: Sequence[StudyConfig], results: Path, workers: int, finished: Callable[[Path], object] = lambda _: None
) -> list[Path]:
    """Run studies in this order and return the directories of their tables; run again, it continues.

    Each is published when it is finished, as by `run_study`, and `finished` is told its directory; one that was
    finished before is answered from the cache.

    Raises:
        SnakebenchError: of the first study that fails, naming it; those before it are published.
    """
    directories = [check_results(results / config.name) for config in configs]
    with Whole([config.name for config in configs]) as whole:
        _weigh(configs, workers, whole)
        for config in configs:
            with _named(config.name):
                finished(run_study(config, results, workers, whole=whole))
    return directories


def _weigh(configs: Sequence[StudyConfig], workers: int, whole: Whole) -> None:
    """Say how long each study takes, and all of them."""
    for engine in dict.fromkeys(engine for config in configs for engine in config.engines()):
        compile_engine(engine, whole.say)
    for config in configs:
        lessons = config.lessons() if isinstance(config, LearningConfig) else []
        counted, learning = expected_seconds(study_plan(config), workers), learning_seconds(lessons, workers)
        whole.expect(config.name, counted, learning)
        steps = sum(lesson.steps for lesson in lessons) / 1e6
        learned = f", {in_words(learning)} of them to learn {steps:.3g} million control steps" if lessons else ""
        whole.say(f"{whole.place(config.name)}, {config.name}: about {in_words(counted + learning)}{learned}")
    whole.say(f"all: {whole.left()}, {workers} at a time, if nothing is kept from before")


@contextmanager
def _named(study: str) -> Iterator[None]:
    """Errors that name the study."""
    try:
        yield
    except SnakebenchError as error:
        raise type(error)(f"{study}: {error}") from None
