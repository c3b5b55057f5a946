"""Studies: each asks a question, proposes controllers, has them evaluated and writes tidy tables."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from snakebench.errors import InvalidValue, StoreError, UnknownName
from snakebench.evaluation import evaluate
from snakebench.execution import Evaluator, compile_engine, physics_fingerprint
from snakebench.files import writable_directory
from snakebench.manifest import provenance, read_manifest
from snakebench.memory import check_memory
from snakebench.physics.joints import Drives
from snakebench.progress import Whole, Work, time_kept, timed
from snakebench.publication import check_results, locked, publish, reads_noted
from snakebench.scenario import Scenario
from snakebench.simulation import check_scenario
from snakebench.store import EvaluationCache
from snakebench.studies import METHODS
from snakebench.studies.config import StudyConfig
from snakebench.studies.protocol import STAND_INS, Load, Outcome, loads_of
from snakebench.studies.published import tables_of
from snakebench.studies.training_jobs import LearningConfig, learning_seconds
from snakebench.tables import checked
from snakebench.value import digest
from snakebench.workers import open_workers

_BYTES = 4000  # of memory that an evaluation takes at most until its study ends: it is a row of several tables
_PIECE = 2.0  # of swimming to take an engine's time [s]
_ROUNDS = 3  # of it, of which the best counts
_COSTS: dict[tuple[object, ...], float] = {}  # of a second of swimming here, by what it depends on [s/s]
PAGE_SECONDS = 4.0  # that a page takes, about: those of the published results, on two cores [s]


def settings_of(method: str) -> type[StudyConfig]:
    """The class of a method's settings: the one whose field `method` is called so."""
    if method not in METHODS:
        raise UnknownName.among("method", method, METHODS)
    room = vars(import_module(f"{__package__}.{method}.settings")).values()
    kinds = (kind for kind in room if isinstance(kind, type) and issubclass(kind, StudyConfig))
    return next(kind for kind in kinds if kind.model_fields["method"].default == method)


def study_config(settings: dict[str, Any]) -> StudyConfig:
    """The configuration of a study from the settings of `config.study_settings`; they are checked."""
    if "method" not in settings:
        raise InvalidValue(f"{settings.get('name', 'the study')}: method is missing: allowed are {', '.join(METHODS)}")
    return settings_of(str(settings["method"]))(**settings)


def study_plan(config: StudyConfig) -> list[Load]:
    """What a study is going to evaluate, from its settings alone: results of other studies may not be there yet."""
    config.check_installed()
    run = _run_of(config)
    loads = run.plan(config) if hasattr(run, "plan") else loads_of(case for _, case in run.cases(config))
    evaluations = sum(load.times for load in loads)
    check_memory(f"{config.name}, {evaluations:.6g} evaluations", evaluations * _BYTES)
    for load in loads:
        check_scenario(load.scenario, load.drives)
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

    Results are published together at the end. The workers, as of `open_workers`, change the time, never the result.
    `whole` is told of the progress. `optuna` is a file in which searches by Optuna's samplers are shown as studies.
    `command` is what the user typed, for the pages. `page` writes one from the results' directory.

    Raises:
        InvalidValue: when the study cannot be run with these settings, before anything is run.
        StoreError: when results or Optuna studies cannot be written.
        WorkersLost: when a cluster is lost while it evaluates.
    """
    _check_options(config, executor, optuna)
    loads = study_plan(config)
    directory, here = results / config.name, provenance()
    total = sum(load.times for load in loads)
    with (
        _stored(optuna) as stored,
        open_workers(workers, executor, scheduler) as crew,
        locked(check_results(directory)),
        Work(config.name, total, whole) as work,
        EvaluationCache(results, lambda text: work.say(f"{config.name}: {text}")) as store,
        time_kept(writable_directory(store.directory / "seconds") / _progress_key(config)) as taken,
    ):
        physics = _compile(config, store, directory, work)
        expected = study_seconds(config, loads, crew.n_jobs) | ({"page": PAGE_SECONDS} if page else {})
        with _remembered(config, store, work, expected), reads_noted() as read:
            left = work.left() or "all are in the cache"
            work.say(f"{config.name}: {total} evaluations, {crew.n_jobs} at a time: {left}")
            evaluator = Evaluator(
                store, crew, work, lambda gait, scenario: _swim_seconds(gait.drives, scenario) / crew.n_jobs
            )
            outcome: Outcome = _run_of(config).run(config, evaluator, *([stored] if stored else []))
            swims = {name: evaluator.trajectory(case, outcome.frames) for name, case in outcome.swims.items()}
        effort: dict[str, Any] = {"evaluations": evaluator.answered, "computed": evaluator.computed}
        effort |= {"seconds": round(taken(), 1), "training_seconds": evaluator.training_seconds}
        workers_of = {"workers": crew.n_jobs, "executor": executor}
        study = {"study": config.name, "command": command, "config": config.model_dump(mode="json")}
        manifest = study | config.meanings() | {"read": read} | effort | workers_of | {"physics": physics} | here
        columns = tables_of(config.method)
        tables = {name: checked(table, columns[name], name) for name, table in outcome.tables.items() if len(table)}
        left_out = [name for name in outcome.policies if isinstance(config, LearningConfig) and config.leaves_out(name)]
        publish(directory, tables, swims, manifest, outcome.policies, work.say, left_out)
        if page:
            page(directory)
    return directory


def study_seconds(config: StudyConfig, loads: Sequence[Load], workers: int) -> dict[str, float]:
    """How long the parts of a study take if nothing is kept from before: units, choosing and learning [s]."""
    jobs = config.training_jobs() if isinstance(config, LearningConfig) else []
    units = sum(load.times * _swim_seconds(load.drives, load.scenario) + load.solving for load in loads) / workers
    choosing = sum(load.choosing for load in loads)
    return {"units": units, "choosing": choosing, "learning": learning_seconds(jobs, workers)}


def _swim_seconds(drives: Drives, scenario: Scenario) -> float:
    """How long a swim takes in this process, from a short one of its kind [s]."""
    piece = scenario.but(fluid="water", duration=min(_PIECE, scenario.duration))
    kind = drives, scenario.engine, scenario.physics_rate, scenario.robot.n_joints, piece.duration
    if kind not in _COSTS:
        swim = partial(evaluate, STAND_INS[drives], piece)
        _COSTS[kind] = min(timed(swim) for _ in range(_ROUNDS)) / piece.duration
    return scenario.duration * _COSTS[kind]


def shares_known(config: StudyConfig, store: EvaluationCache) -> dict[str, float]:
    """What share of the parts of a study earlier runs have left behind, so that it is found again."""
    known = json.loads(store.get(_progress_key(config)) or "{}")
    return {part: share for part, share in known.items() if part in ("units", "learning")}


def _progress_key(config: StudyConfig) -> str:
    physics = {engine: physics_fingerprint(engine) for engine in config.engines()}
    return digest(["progress", config.model_dump(mode="json"), physics])


@contextmanager
def _remembered(config: StudyConfig, store: EvaluationCache, work: Work, expected: dict[str, float]) -> Iterator[None]:
    """However the work ends, how far it has come is for the next run to know."""
    work.begin(**expected, known=shares_known(config, store))
    try:
        yield
        reached = dict.fromkeys(expected, 1.0)
    except BaseException:
        reached = work.shares()
        raise
    finally:
        if any(reached.values()):
            with suppress(StoreError):
                store.put(_progress_key(config), json.dumps(reached))


def _run_of(config: StudyConfig) -> Any:
    return import_module(f"{__package__}.{config.method}.run")


def _check_options(config: StudyConfig, executor: str, optuna: Path | None) -> None:
    if isinstance(config, LearningConfig) and executor != "processes":
        raise InvalidValue(f"executor = {executor}: {config.method} learns on this machine, with executor processes")
    if optuna is not None and not config.samples:
        samplers = ", ".join(method for method in METHODS if settings_of(method).samples)
        raise InvalidValue(f"optuna = {optuna}: {config.method} does not search with Optuna; {samplers} does")


def _compile(config: StudyConfig, store: EvaluationCache, directory: Path, work: Work) -> dict[str, str]:
    """Make the engines ready and return their fingerprints; say where cache or results are of another version."""
    physics = {}
    for engine in config.engines():
        compile_engine(engine, work.say)
        physics[engine] = physics_fingerprint(engine)
        if not store.recognises(engine, physics[engine]):
            other = f"another version of {engine}'s physics, or of other metrics"
            work.say(f"{config.name}: the cache is of {other}: it stays, unused")
    with suppress(StoreError):
        manifest = read_manifest(directory)
        if manifest.get("physics") != physics:
            version = manifest.get("versions", {}).get("snakebench")
            work.say(
                f"{directory.name}: the results in {directory} are of snakebench {version} with another version of the"
                " physics or the metrics; reports read them until this run has evaluated everything again"
            )
    return physics


def _stored(optuna: Path | None) -> Any:
    if optuna is None:
        return nullcontext()
    from snakebench.studies.samplers import StoredStudies  # only where they are asked for: Optuna is slow to load

    return closing(StoredStudies(optuna))
