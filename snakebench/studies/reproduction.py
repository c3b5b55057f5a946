"""Reproduction: the studies of the library one after another, all checked and weighed before anything is run."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from snakebench.errors import SnakebenchError
from snakebench.execution import compile_engine
from snakebench.manifest import command_of
from snakebench.names import STUDIES
from snakebench.progress import Whole, Work, in_words
from snakebench.publication import check_results
from snakebench.store import EvaluationCache
from snakebench.studies.config import StudyConfig, study_path, study_settings
from snakebench.studies.running import run_study, shares_known, study_config, study_plan, study_seconds


class Task(NamedTuple):
    """What is done after the studies."""

    seconds: float  # about [s]
    do: Callable[[], object]


def checked_configs(profile: str | None = None, studies: Sequence[str] = STUDIES) -> list[StudyConfig]:
    """The configurations of studies in a profile, their own if None; each can be run here."""
    configs = []
    for name in studies:
        with _named(name):
            configs.append(study_config(study_settings(study_path(name), profile)))
            study_plan(configs[-1])
    return configs


def reproduce(
    configs: Sequence[StudyConfig],
    results: Path,
    workers: int,
    page: Callable[[Path], object] | None = None,
    last: Mapping[str, Task] | None = None,
) -> list[Path]:
    """Run studies in this order, publish each when it ends, and return their directories; run again, it continues.

    `page` writes the page of each from its directory; what is done at `last` has names.
    """
    directories = [check_results(results / config.name) for config in configs]
    last = last or {}
    with Whole([*(config.name for config in configs), *last]) as whole:
        for name, task in last.items():
            whole.estimate.expect(name, {"units": task.seconds})
        _weigh(configs, results, workers, whole)
        for config in configs:
            with _named(config.name):
                command = f"{command_of(config.name)} --workers {workers}"
                run_study(config, results, workers, whole=whole, command=command, page=page)
        for name, task in last.items():
            with Work(name, 1, whole) as work:
                task.do()
                work.advance()
    return directories


def _weigh(configs: Sequence[StudyConfig], results: Path, workers: int, whole: Whole) -> None:
    for engine in dict.fromkeys(engine for config in configs for engine in config.engines()):
        compile_engine(engine, whole.say)
    with EvaluationCache(results, whole.say) as cache:
        for config in configs:
            parts = study_seconds(config, study_plan(config), workers)
            known = shares_known(config, cache)
            whole.estimate.expect(config.name, parts, known)
            seconds = in_words(whole.estimate.seconds(config.name))
            learned = parts["learning"] * (1 - known.get("learning", 0.0))
            learning = f", learning {in_words(learned)} of it" if learned else ""
            whole.say(f"{whole.place(config.name)}, {config.name}: about {seconds}{learning}")
    whole.say(f"all: {whole.left()}, {workers} at a time")


@contextmanager
def _named(study: str) -> Iterator[None]:
    try:
        yield
    except SnakebenchError as error:
        error.args = (f"{study}: {error}",)
        raise
