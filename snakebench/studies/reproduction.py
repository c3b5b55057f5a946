"""Reproduction: the studies of the library one after another, all checked and weighed before anything is run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from snakebench.errors import SnakebenchError
from snakebench.execution import compile_engine
from snakebench.progress import Whole, Work, in_words
from snakebench.publication import check_results
from snakebench.store import STUDIES, EvaluationCache
from snakebench.studies.config import StudyConfig, study_path, study_settings
from snakebench.studies.planning import PAGE_SECONDS
from snakebench.studies.running import run_study, shares_known, study_config, study_plan, study_seconds
from snakebench.studies.training_jobs import LearningConfig

_PAGES = "pages"


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
    configs: Sequence[StudyConfig],
    results: Path,
    workers: int,
    page: Callable[[Path], object] | None = None,
    pages: Callable[[], object] | None = None,
) -> list[Path]:
    """Run studies in this order and return the directories of their tables; run again, it continues.

    Each is published when it is finished, as by `run_study`; one that was finished before is answered from the cache.
    `page` writes the page of each from its directory, and at last `pages` those of all.

    Raises:
        SnakebenchError: of the first study that fails, naming it; those before it are published.
    """
    directories = [check_results(results / config.name) for config in configs]
    with Whole([*(config.name for config in configs), *([_PAGES] if pages else [])]) as whole:
        if pages:
            whole.estimate.expect(_PAGES, {"units": PAGE_SECONDS * (len(configs) + 1)})
        _weigh(configs, results, workers, whole)
        for config in configs:
            with _named(config.name):
                run_study(config, results, workers, whole=whole, page=page)
        if pages:
            with Work(_PAGES, 1, whole) as work:
                pages()
                work.advance()
    return directories


def _weigh(configs: Sequence[StudyConfig], results: Path, workers: int, whole: Whole) -> None:
    """Say how long each study takes, and all of them; what is in the cache takes no time."""
    for engine in dict.fromkeys(engine for config in configs for engine in config.engines()):
        compile_engine(engine, whole.say)
    with EvaluationCache(results, whole.say) as cache:
        for config in configs:
            parts = study_seconds(config, study_plan(config), workers)
            whole.estimate.expect(config.name, parts, shares_known(config, cache))
            text = f"{whole.place(config.name)}, {config.name}: about {in_words(whole.estimate.seconds(config.name))}"
            if isinstance(config, LearningConfig):
                steps = sum(job.steps for job in config.training_jobs()) / 1e6
                learning = in_words(parts["learning"])
                text += f"; {steps:.3g} million control steps are learned in about {learning}, once"
            whole.say(text)
    whole.say(f"all: {whole.left()}, {workers} at a time")


@contextmanager
def _named(study: str) -> Iterator[None]:
    """Errors that name the study."""
    try:
        yield
    except SnakebenchError as error:
        raise type(error)(f"{study}: {error}") from None
