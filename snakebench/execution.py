"""Many evaluations at once: looked up in the cache, computed by worker processes, remembered as they come."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Sequence
from threading import Timer
from typing import NamedTuple

from joblib import Parallel, delayed

from snakebench.controllers import Controller, SeaSnake
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation, Scenario, evaluate, evaluation_key
from snakebench.store import EvaluationCache

_PATIENCE = 2.0  # of a user, without a word [s]


class Case(NamedTuple):
    """One evaluation to be made."""

    controller: Controller
    scenario: Scenario


class Evaluator:
    """Evaluates cases on `workers` processes, each case once ever; results do not depend on the number of workers.

    Args:
        cache: where evaluations are remembered. Only this process writes it.
        workers: number of processes; 1 evaluates in this process.
        on_done: called with the number of cases just answered, from the cache or computed.

    Attributes:
        computed: how many evaluations were made, not found in the cache.
    """

    def __init__(self, cache: EvaluationCache, workers: int = 1, on_done: Callable[[int], None] | None = None) -> None:
        self._cache, self._on_done = cache, on_done or _ignore
        self.computed = 0
        self._map = Parallel(
            n_jobs=workers,
            backend="sequential" if workers == 1 else "loky",
            return_as="generator",
            batch_size=1,
            **({} if workers == 1 else {"initializer": _leave_interrupts_to_parent}),
        )

    def __call__(self, cases: Sequence[Case]) -> list[Evaluation]:
        """The evaluations of `cases`; each is stored as soon as it and those before it are there."""
        keys = [evaluation_key(case.controller, case.scenario) for case in cases]
        answers = {key: found for key in keys if (found := self._cache.get(key)) is not None}
        missing = {key: case for key, case in zip(keys, cases, strict=True) if key not in answers}
        self._on_done(len(keys) - len(missing))
        computed = self._map(delayed(evaluate)(*case) for case in missing.values())
        for key, evaluation in zip(missing, computed, strict=True):
            answers[key] = evaluation
            self.computed += 1
            self._cache.put(key, evaluation)
            self._on_done(1)
        return [answers[key] for key in keys]


def check_workers(workers: int, what: str = "workers", most: int | None = None) -> None:
    """Make sure that work can be spread over that many processes or threads.

    Raises:
        InvalidValue: when there is not at least one, or more than `most`.
    """
    if workers < 1 or (most is not None and workers > most):
        allowed = "at least 1 is needed" if most is None else f"allowed are 1 to {most}"
        raise InvalidValue(f"{what} = {workers}: {allowed}")


def compile_engine(name: str, say: Callable[[str], object]) -> None:
    """Make one short run, so that all later ones find the engine's compiled code in numba's cache.

    Says so when it takes long: the first time on a machine, and after a change of the physics.
    """
    notice = Timer(_PATIENCE, say, [f"compiling the {name} engine, some 20 s for this time only"])
    notice.daemon = True
    notice.start()
    try:
        evaluate(SeaSnake(amplitude=0.1, frequency=0.5, phase=0.5), engine=name, duration=0.1)
    finally:
        notice.cancel()


def usable_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _leave_interrupts_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _ignore(_count: int) -> None:
    """Count nothing."""
