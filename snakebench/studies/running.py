"""Studies: each asks a question, proposes controllers, has them evaluated and writes tidy tables."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snakebench.errors import InvalidValue, StoreError, UnknownName
from snakebench.execution import Evaluator, compile_engine, physics_fingerprint
from snakebench.progress import Whole, Work
from snakebench.publication import check_results, locked, publish
from snakebench.store import EvaluationCache, provenance, read_manifest
from snakebench.studies import METHODS
from snakebench.studies.config import StudyConfig
from snakebench.studies.outcome import Outcome
from snakebench.studies.planning import PAGE_SECONDS, Load, check_loads, expected_seconds, swim_seconds
from snakebench.studies.published import tables_of
from snakebench.studies.swim_rows import loads_of
from snakebench.studies.training_jobs import LearningConfig, check_learning, learning_seconds
from snakebench.value import digest
from snakebench.workers import open_workers

if TYPE_CHECKING:
    from snakebench.studies.samplers import StoredStudies


def settings_of(method: str) -> type[StudyConfig]:
    """The class of a method's settings: the one whose field `method` is called so.

    Raises:
        UnknownName: when there is no such method, with the nearest names.
    """
    if method not in METHODS:
        raise UnknownName.among("method", method, METHODS)
    room = vars(import_module(f"{__package__}.{method}.settings")).values()
    kinds = (kind for kind in room if isinstance(kind, type) and issubclass(kind, StudyConfig))
    return next(kind for kind in kinds if kind.model_fields["method"].default == method)


def study_config(settings: dict[str, Any]) -> StudyConfig:
    """The checked configuration of a study from the settings of `config.study_settings`.

    Raises:
        InvalidValue: for an unknown method or a wrong, missing or unknown setting.
    """
    if "method" not in settings:
        raise InvalidValue(f"{settings.get('name', 'the study')}: method is missing: allowed are {', '.join(METHODS)}")
    return settings_of(str(settings["method"]))(**settings)


def study_plan(config: StudyConfig) -> list[Load]:
    """What a study is going to evaluate, from its settings alone: results of other studies may not be there yet.

    Raises:
        InvalidValue: when the study cannot be run with these settings, or here.
    """
    if config.learns:
        check_learning()
    run = _run_of(config)
    loads = run.plan(config) if hasattr(run, "plan") else loads_of(case for _, case in run.cases(config))
    check_loads(config.name, loads)
    return loads


def run_study(
    config: StudyConfig,
    results: Path,
    workers: int,
    executor: str = "processes",
    scheduler: str | None = None,
    whole: Whole | None = None,
    optuna: Path | None = None,
    command: str | None = None,
    page: Callable[[Path], object] | None = None,
) -> Path:
    """Run a study and return the directory of its tables; run again after an interruption, it continues.

    Results are published together at the end; until then older results stay as they are. Who evaluates is said as to
    `open_workers`; it changes the time, never the result. `whole` is told of the progress, if the study is part of one.
    `optuna` is a file in which searches by Optuna's samplers are shown as studies; nothing is read from it.
    `command` is what the user typed, for the pages. `page` is what writes one from the results' directory.

    Raises:
        InvalidValue: when the study cannot be run with these settings, which is found out before anything is run.
        StoreError: when the results or the Optuna studies cannot be written, or results were written in another format
            or are being written.
        WorkersLost: when a cluster is lost while it evaluates.
    """
    _check_options(config, executor, optuna)
    loads = study_plan(config)
    directory, here = results / config.name, provenance()
    total, started = sum(load.times for load in loads), time.monotonic()
    with (
        _stored(optuna) as stored,
        open_workers(workers, executor, scheduler) as crew,
        locked(check_results(directory)),
        Work(config.name, total, whole) as work,
        EvaluationCache(results, lambda text: work.say(f"{config.name}: {text}")) as cache,
    ):
        physics = _compile(config, cache, work)
        _compare(directory, physics, work)
        expected = study_seconds(config, loads, crew.n_jobs) | ({"page": PAGE_SECONDS} if page else {})
        with _remembered(config, cache, work, expected):
            left = work.left() or "all are in the cache"
            work.say(f"{config.name}: {total} evaluations, {crew.n_jobs} at a time: {left}")
            evaluator = Evaluator(
                cache, crew, work, lambda gait, scenario: swim_seconds(gait.drives, scenario) / crew.n_jobs
            )
            outcome: Outcome = _run_of(config).run(config, evaluator, *stored)
        seconds = round(time.monotonic() - started, 1)
        effort = {"evaluations": evaluator.answered, "computed": evaluator.computed, "seconds": seconds}
        workers_of = {"workers": crew.n_jobs, "executor": executor}
        study = {"study": config.name, "command": command, "config": config.model_dump(mode="json")}
        manifest = study | config.meanings() | effort | workers_of | {"physics": physics} | here
        tables = outcome.checked_tables(tables_of(config.method))
        left_out = [name for name in outcome.policies if config.leaves_out(name)]
        publish(directory, tables, outcome.swims, manifest, outcome.policies, work.say, left_out)
        if page:
            page(directory)
    return directory


def study_seconds(config: StudyConfig, loads: Sequence[Load], workers: int) -> dict[str, float]:
    """How long the parts of a study take if nothing is kept from before: units, choosing and learning [s]."""
    jobs = config.training_jobs() if isinstance(config, LearningConfig) else []
    return expected_seconds(loads, workers) | {"learning": learning_seconds(jobs, workers)}


def shares_known(config: StudyConfig, cache: EvaluationCache) -> dict[str, float]:
    """What share of the parts of a study earlier runs have left behind, so that it is found again."""
    known = json.loads(cache.get(_progress_key(config)) or "{}")
    return {part: share for part, share in known.items() if part in ("units", "learning")}


def _progress_key(config: StudyConfig) -> str:
    physics = {engine: physics_fingerprint(engine) for engine in config.engines()}
    return digest(["progress", config.model_dump(mode="json"), physics])


@contextmanager
def _remembered(config: StudyConfig, cache: EvaluationCache, work: Work, expected: dict[str, float]) -> Iterator[None]:
    """Meanwhile, a work whose length is known; however it ends, how far it has come is for the next run to know."""
    work.begin(**expected, known=shares_known(config, cache))
    try:
        yield
        reached = dict.fromkeys(expected, 1.0)
    except BaseException:
        reached = work.shares()
        raise
    finally:
        if any(reached.values()):
            with suppress(StoreError):
                cache.put(_progress_key(config), json.dumps(reached))


def _run_of(config: StudyConfig) -> Any:
    """The module with a method's `plan` and `run`."""
    return import_module(f"{__package__}.{config.method}.run")


def _check_options(config: StudyConfig, executor: str, optuna: Path | None) -> None:
    if config.learns and executor != "processes":
        raise InvalidValue(f"executor = {executor}: {config.method} learns on this machine, with executor processes")
    if optuna is not None and not config.samples:
        samplers = ", ".join(method for method in METHODS if settings_of(method).samples)
        raise InvalidValue(f"optuna = {optuna}: {config.method} does not search with Optuna; {samplers} does")


def _compile(config: StudyConfig, cache: EvaluationCache, work: Work) -> dict[str, str]:
    """Make the engines ready, say where the cache knows only another version of one; returns their fingerprints."""
    fingerprints = {}
    for engine in config.engines():
        compile_engine(engine, work.say)
        fingerprints[engine] = physics_fingerprint(engine)
        if not cache.recognises(engine, fingerprints[engine]):
            other = f"another version of {engine}'s physics, or of other metrics"
            work.say(f"{config.name}: the cache is of {other}: it stays, unused")
    return fingerprints


def _compare(directory: Path, physics: dict[str, str], work: Work) -> None:
    """Say it when the results that are there were made by another version of the physics."""
    with suppress(StoreError):
        manifest = read_manifest(directory)
        if manifest.get("physics") != physics:
            version = manifest.get("versions", {}).get("snakebench")
            work.say(
                f"{directory.name}: the results in {directory} are of snakebench {version} with another version of the"
                " physics or the metrics; reports read them until this run has evaluated everything again"
            )


@contextmanager
def _stored(optuna: Path | None) -> Iterator[list[StoredStudies]]:
    """The Optuna studies of a file, if one is named."""
    if optuna is None:
        yield []
        return
    from snakebench.studies.samplers import StoredStudies  # only where they are asked for: Optuna is slow to load

    with closing(StoredStudies(optuna)) as studies:
        yield [studies]
