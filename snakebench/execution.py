"""Many evaluations at once: looked up in the cache, computed by workers, remembered as they come."""

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from threading import Timer
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from snakebench.controllers import Controller, Gait, SeaSnake, WaveformGait
from snakebench.engines import PERTURBED, load_engine
from snakebench.errors import InvalidValue, StoreError
from snakebench.evaluation import METRICS, Evaluation, evaluate
from snakebench.files import writable_directory
from snakebench.fluid import PAPERS, Fluid, FluidField, Medium
from snakebench.physics.joints import Drives
from snakebench.progress import Work
from snakebench.robot import Robot
from snakebench.scenario import Scenario, scenario_of
from snakebench.simulation import AnyController, ClosedLoop, check_controller, simulate
from snakebench.sources import code_digest, plugin_digest
from snakebench.store import EvaluationCache
from snakebench.trajectory import Trajectory
from snakebench.value import digest
from snakebench.workers import Workers, answers_to, in_one_thread, open_workers, usable_cores

_T = TypeVar("_T")
_Fluids = Mapping[str, Medium | str] | Iterable[Medium | str] | Medium | str
_PATIENCE = 2.0  # of a user, without a word [s]
_OTHER_VERSION = (
    "a worker has another version of snakebench or PyBullet, and its evaluation was refused:"
    " install the same on every machine and start the workers again"
)
_FIXED = SeaSnake(amplitude=0.1, frequency=0.5, phase=0.5)  # a gait to try an engine with

# An evaluation's key is a hash of all that determines it and nothing else: code, apart from its prose, and numbers.
_MEASURES = code_digest("accuracy", "evaluation", "metrics", "reward", "simulation", "trajectory")
_POLICIES = code_digest("observation", "policy")


class Case(NamedTuple):
    """One evaluation to be made."""

    controller: AnyController
    scenario: Scenario


def evaluation_key(controller: AnyController, scenario: Scenario) -> str:
    """The key of a controller's evaluation in a scenario; the code of a plug-in has to be in a file."""
    rate = scenario.physics_rate
    further = [f"{name} {plugin_digest(metric)}" for name, metric in METRICS.items()]
    return digest(
        [
            [load_engine(scenario.engine).VERSION, _MEASURES, *further],
            inputs_digest(scenario.engine, scenario.robot, scenario.fluid, controller.drives, rate),
            [rate, scenario.control_rate, scenario.n_steps],
            _commands(controller, scenario.robot.n_joints),
        ]
    )


@lru_cache(maxsize=1024)
def inputs_digest(engine: str, robot: Robot, medium: Medium, drives: Drives, physics_rate: int) -> str:
    """The hash of the numbers that an engine makes of a robot in a medium."""
    return hashlib.sha256(load_engine(engine).inputs(robot, medium, drives, physics_rate)).hexdigest()


def _commands(controller: AnyController, n_joints: int) -> list[Any]:
    """What stands for a controller: its waveform's numbers if it has one, whatever it is called."""
    if isinstance(controller, ClosedLoop):
        return ["closed loop", controller.digest(), _POLICIES]
    if isinstance(controller, WaveformGait) and type(controller).commands is WaveformGait.commands:
        kind, rate, table, bound = controller.waveform(n_joints)
        content = hashlib.sha256(table.astype(np.float64).tobytes()).hexdigest()
        return ["waveform", controller.drives, kind, repr(float(rate)), repr(float(bound)), table.shape, content]
    return ["commands", controller.drives, controller.digest()]


class Evaluator:
    """Evaluates cases on workers, each case once ever; results do not depend on who or how many the workers are.

    `price` is about how long a swim takes here, as a share of all workers [s]; `results` is where the results of all
    studies are, `directory` where else work may leave what it will need again; `answered` counts what was asked for,
    `computed` what of it was not found in the cache; `training_seconds` how long policies were trained, by their names.
    """

    def __init__(
        self,
        cache: EvaluationCache,
        workers: Workers,
        work: Work | None = None,
        price: Callable[[AnyController, Scenario], float] | None = None,
    ) -> None:
        self._cache, self._workers, self._price = cache, workers, price
        self.work = work or Work("", 0, silent=True)
        self.directory, self.results = cache.directory, cache.results
        self.answered = self.computed = 0
        self.training_seconds = dict[str, float]()

    def __call__(self, cases: Sequence[Case]) -> list[Evaluation]:
        """The evaluations of `cases`; each is stored as soon as it and those before it are there."""
        return [Evaluation.model_validate_json(text) for text in self._remembered([(case,) for case in cases])]

    def measured(self, measure: Callable[..., _T], asked: Sequence[tuple[Case, Sequence[Any]]]) -> list[_T]:
        """What a function makes of each swim, its scenario and further arguments, remembered like an evaluation.

        What it computes is in its own module, or in those that every evaluation's key is of.
        """
        tasks = [(case, measure, arguments) for case, arguments in asked]
        return [json.loads(text) for text in self._remembered(tasks)]

    def remembered(self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> list[Any]:
        """What a function of this package answers to each task's arguments, all plain values, remembered by them.

        The digest `CODE` of what it computes stands in its module.
        """
        asked = [(function, *arguments) for arguments in tasks]
        return [json.loads(text) for text in self._remembered(asked, _function_key, _function_answer)]

    def trajectory(self, case: Case, frames: int) -> Trajectory:
        """About so many rows of a swim a second, remembered in a file beside the cache."""
        every = max(case.scenario.physics_rate // frames, 1)
        key = digest([evaluation_key(*case), "kept", every])
        path = writable_directory(self.directory / "swims") / f"{key}.npz"
        try:
            return Trajectory.load(path)
        except InvalidValue:  # it is not there, or damaged
            in_one_thread(simulate, *case).thinned(every).save(path)
            return Trajectory.load(path)

    def compute(self, function: Callable[..., _T], tasks: Iterable[tuple[Any, ...]]) -> Iterator[_T]:
        """Let the workers do other work: `function` of every task's arguments, answered in their order."""
        tasks = list(tasks)
        with answers_to(self._workers, function, tasks) as computed:
            for task, answer in zip(tasks, computed, strict=True):
                self._count([task])
                yield answer

    def _remembered(
        self,
        tasks: Sequence[tuple[Any, ...]],
        key_of: Callable[..., str] | None = None,
        answer_to: Callable[..., tuple[str, str]] | None = None,
    ) -> list[str]:
        """What is in the cache by its key, and of the rest what workers answer to its task, stored."""
        keys = [(key_of or _key)(*task) for task in tasks]
        answers = {key: found for key in keys if (found := self._cache.get(key)) is not None}
        self._count([task for key, task in zip(keys, tasks, strict=True) if key in answers], found=True)
        missing = {key: task for key, task in zip(keys, tasks, strict=True) if key not in answers}
        times = Counter(keys)
        with answers_to(self._workers, answer_to or _answer, missing.values()) as computed:
            for (key, task), (its_key, answer) in zip(missing.items(), computed, strict=True):
                if its_key != key:
                    raise StoreError(_OTHER_VERSION)
                answers[key] = answer
                self.computed += 1
                self._cache.put(key, answer)
                self._count([task] * times[key])
        return [answers[key] for key in keys]

    def _count(self, tasks: Sequence[tuple[Any, ...]], found: bool = False) -> None:
        """Count tasks as answered; one that is a case, or has one in it, has its price."""
        self.answered += len(tasks)
        if tasks:
            cases = [part for task in tasks for part in (task, *task) if isinstance(part, Case)]
            seconds = sum(self._price(*case) for case in cases) if self._price and cases else None
            self.work.advance(len(tasks), seconds, found)


def evaluate_many(  # 22 lines of logic: the rest is signature and docstring, which users read
    gaits: Iterable[AnyController] | AnyController,
    fluids: _Fluids = PAPERS,
    *,
    robot: Robot | str | None = None,
    engine: str | None = None,
    physics_rate: int | None = None,
    control_rate: int | None = None,
    duration: float | None = None,
    scenario: Scenario | None = None,
    cache: Path | str | None = None,
    workers: int | None = None,
) -> pd.DataFrame:
    """Evaluate each gait in each fluid, on several processes.

    Args:
        gaits: gaits or policies.
        fluids: fluids, fields or names as for `evaluate`, or a dictionary of them by names of your own.
        robot: a `Robot` or a name; this and all up to `scenario` as for `evaluate`.
        engine: "pybullet" or "planar".
        physics_rate: physics steps per second [Hz].
        control_rate: policy steps per second [Hz].
        duration: length of a run [s].
        scenario: all of these in one; its fluid does not count.
        cache: directory of results in which evaluations are remembered, as those of studies; by default none is. A
            gait typed at a prompt cannot be: its code is in no file.
        workers: how many processes; by default one per core.

    Returns:
        A row for each gait and fluid: `gait`, its place in `gaits`; `kind`; its parameters, as far as they are numbers
        or words; `fluid`; and what `Evaluation` has, in SI units.

    Raises:
        InvalidValue: without a gait or a fluid, for an invalid setting, or for fewer than one worker.
        UnstableRate: when the engine needs a higher physics rate for this robot and a gait.
        StoreError: when the cache cannot be used.
        WorkersLost: when a worker was killed.

    Example:
        >>> gaits = [sb.SeaSnake(amplitude=a, frequency=0.6, phase=0.7) for a in (0.3, 0.6, 0.9)]
        >>> table = sb.evaluate_many(gaits, ["water", "oil1"], engine="planar")
        >>> table[["amplitude", "fluid", "speed"]]
    """
    tried = [gaits] if isinstance(gaits, ClosedLoop | Controller) or not isinstance(gaits, Iterable) else list(gaits)
    media = _by_label(fluids)
    for what, values in (("gait", tried), ("fluid", media)):
        if not values:
            raise InvalidValue(f"no {what} is given: at least one is needed")
    for gait in tried:
        check_controller(gait)
    settings = {"robot": robot, "engine": engine, "duration": duration}
    where = scenario_of(None, scenario, **settings, physics_rate=physics_rate, control_rate=control_rate)
    labels = [_label(i, gait) | {"fluid": fluid} for i, gait in enumerate(tried) for fluid in media]
    places = [where.but(fluid=medium) for medium in media.values()]
    cases = [Case(gait, place) for gait in tried for place in places]
    count = min(usable_cores(), len(cases)) if workers is None else workers
    if count > 1:
        compile_engine(where.engine, lambda _: None)  # once, not once per worker
    with ExitStack() as stack:
        pool = stack.enter_context(open_workers(count))
        if cache is None:
            evaluations = list(stack.enter_context(answers_to(pool, evaluate, cases)))
        else:
            evaluations = Evaluator(stack.enter_context(EvaluationCache(Path(cache))), pool)(cases)
    return pd.DataFrame([label | evaluation.row() for label, evaluation in zip(labels, evaluations, strict=True)])


def compile_engine(name: str, say: Callable[[str], object]) -> None:
    """Make one short run, so that all later ones find compiled code in numba's cache; says so when it takes long."""
    name = PERTURBED.get(name, name)  # which has the same code
    notice = Timer(_PATIENCE, say, [f"compiling the {name} engine, some 20 s for this time only"])
    notice.daemon = True
    notice.start()
    try:
        evaluate(_FIXED, engine=name, duration=0.1)
    finally:
        notice.cancel()


def physics_fingerprint(engine: str) -> str:
    """A name for the physics of an engine as it is now: the key of one fixed evaluation."""
    return evaluation_key(_FIXED, Scenario(engine=engine, duration=0.1))


def _key(case: Case, measure: Callable[..., Any] | None = None, arguments: Sequence[Any] = ()) -> str:
    """The key of an evaluation, or of what a function of this package measures of the swim."""
    if measure is None:
        return evaluation_key(*case)
    code = code_digest(measure.__module__.partition(".")[2])
    return digest([evaluation_key(*case), code, measure.__qualname__, arguments])


def _answer(case: Case, measure: Callable[..., Any] | None = None, arguments: Sequence[Any] = ()) -> tuple[str, str]:
    """What a worker does: the same as JSON, under the key that the worker's own code gives it."""
    if measure is None:
        return _key(case), evaluate(*case).model_dump_json()
    swim = simulate(case.controller, case.scenario)
    return _key(case, measure, arguments), json.dumps(measure(swim, case.scenario, *arguments))


def _function_key(function: Callable[..., Any], *arguments: Any) -> str:
    """The key of what a function of this package answers."""
    return digest([import_module(function.__module__).CODE, function.__qualname__, arguments])


def _function_answer(function: Callable[..., Any], *arguments: Any) -> tuple[str, str]:
    """What a worker does: the answer as JSON, under the key that the worker's own code gives it."""
    return _function_key(function, *arguments), json.dumps(function(*arguments))


def _by_label(fluids: _Fluids) -> Mapping[str, Medium | str]:
    """Fluids by what a table calls them; those without a name are described."""
    if isinstance(fluids, Mapping):
        return fluids
    if isinstance(fluids, Fluid | FluidField | str) or not isinstance(fluids, Iterable):
        fluids = [fluids]
    return {str(fluid): fluid for fluid in fluids}


def _label(index: int, gait: AnyController) -> dict[str, Any]:
    parameters = gait.model_dump() if isinstance(gait, Gait) else {}
    plain = {name: value for name, value in parameters.items() if isinstance(value, str | int | float)}
    return {"gait": index, "kind": type(gait).__name__} | plain
