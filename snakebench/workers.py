"""Workers: processes of this machine, or of a cluster, that answer tasks in their order."""

import signal
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache, partial
from typing import Any, Protocol, TypeVar

from joblib import Parallel, cpu_count, delayed
from threadpoolctl import ThreadpoolController

from snakebench.errors import InvalidValue, StoreError, UnknownName, WorkersLost, missing
from snakebench.manifest import plugin_digests
from snakebench.memory import check_memory
from snakebench.registry import VARIABLE

EXECUTORS = ("processes", "dask")
_LEAVE_INTERRUPTS = partial(signal.signal, signal.SIGINT, signal.SIG_IGN)  # to the parent process
usable_cores: Callable[[], int] = cpu_count  # that this process may use
_T = TypeVar("_T")
_WORKER_BYTES = 180e6  # of memory that a worker process takes at least: libraries and compiled code
_AS_HERE = f"install the same, or name the same file in {VARIABLE}, wherever workers are started, and start them again"


class Workers(Protocol):
    """So many workers, which answer the tasks of `joblib.delayed` in their order; joblib's `Parallel` is such."""

    n_jobs: int

    def __call__(self, tasks: Iterable[Any]) -> Generator[Any]:
        """Their answers; closed, it drops those that are not there yet."""


@contextmanager
def open_workers(count: int, executor: str = "processes", scheduler: str | None = None) -> Iterator[Workers]:
    """Worker processes of this machine (a single one is this process) or of a Dask cluster; they stay until the end.

    `scheduler` is the address of a Dask cluster that runs already, with as many workers as it has.
    """
    if scheduler is None:
        check_workers(count)
    if executor not in EXECUTORS:
        raise UnknownName.among("executor", executor, EXECUTORS)
    if scheduler is not None and executor != "dask":
        raise InvalidValue(f"scheduler = {scheduler}: only --executor dask has one")
    if executor == "dask":
        try:
            from snakebench.cluster import open_cluster
        except ModuleNotFoundError:
            raise missing("executor = dask", "Dask", "cluster") from None
        with open_cluster(count, scheduler, partial(_same_plugins, plugin_digests())) as workers:
            yield workers
    elif count == 1:
        yield Parallel(n_jobs=1, backend="sequential", return_as="generator")
    else:
        with (
            warnings.catch_warnings(),
            Parallel(count, "loky", return_as="generator", initializer=_LEAVE_INTERRUPTS) as workers,
        ):
            # Those that have grown by much, as by importing PyTorch, are replaced.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
            yield workers


def check_workers(workers: int) -> None:
    """Make sure that there is at least one worker, and that all fit into memory."""
    if workers < 1:
        raise InvalidValue(f"workers = {workers}: at least 1 is needed")
    if workers > 1:
        check_memory(f"workers = {workers}, of {_WORKER_BYTES / 1e6:g} MB each", workers * _WORKER_BYTES)


def _same_plugins(wanted: Mapping[str, str | None]) -> None:
    """Make sure that this process has the plug-ins of another one, and no others."""
    try:
        here = plugin_digests()
    except InvalidValue as error:
        raise StoreError(f"a worker {error}: {_AS_HERE}") from None
    if lacking := [name for name, code in wanted.items() if code not in here.values()]:
        raise StoreError(f"a worker lacks the plug-in {', '.join(lacking)}, or has another version of it: {_AS_HERE}")
    if further := [name for name, code in here.items() if code not in wanted.values()]:
        raise StoreError(f"a worker has a plug-in that is not here, {', '.join(further)}: {_AS_HERE}")


@contextmanager
def answers_to(
    workers: Workers, function: Callable[..., _T], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Iterator[_T]]:
    """What workers answer to tasks; those not yet answered at the end are dropped. When one is killed, all are lost."""
    try:
        answers = workers(delayed(in_one_thread)(function, *task) for task in tasks)
        try:
            yield answers
        finally:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # joblib advises to use all answers
                answers.close()
    except BrokenProcessPool:
        raise WorkersLost("a worker process was killed, as happens when memory runs out") from None


def in_one_thread(function: Callable[..., _T], *arguments: Any) -> _T:
    """The answer with linear algebra in one thread: the last digit of a sum depends on how many share it."""
    with _linear_algebra().limit(limits=1, user_api="blas"):
        return function(*arguments)


@cache
def _linear_algebra() -> ThreadpoolController:
    """The libraries of NumPy and SciPy, found once: looking for them takes as long as a short swim."""
    return ThreadpoolController()
