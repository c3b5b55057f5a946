"""Workers: processes of this machine, or of a cluster, that answer tasks in their order."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any, Protocol, TypeVar

from joblib import Parallel, cpu_count, delayed

from snakebench.errors import InvalidValue, StoreError, UnknownName, WorkersLost
from snakebench.memory import check_memory
from snakebench.registry import VARIABLE
from snakebench.store import plugin_digests

EXECUTORS = ("processes", "dask")
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
    """Workers that stay until the end.

    Args:
        count: how many processes; for a single one, this process itself.
        executor: "processes" of this machine, or "dask" for a Dask cluster of so many.
        scheduler: address of a Dask cluster that runs already; it has as many workers as it has.

    Raises:
        InvalidValue: when there is not at least one, they do not fit into memory, Dask is not installed, or no cluster
            is there.
        WorkersLost: when the cluster is lost later.
    """
    if scheduler is None:
        check_workers(count)
    if executor not in EXECUTORS:
        raise UnknownName.among("executor", executor, EXECUTORS)
    if scheduler is not None and executor != "dask":
        raise InvalidValue(f"scheduler = {scheduler}: only --executor dask has one")
    if executor == "dask":
        with _open_cluster(count, scheduler) as workers:
            yield workers
    elif count == 1:
        yield Parallel(n_jobs=1, backend="sequential", return_as="generator")
    else:
        with (
            warnings.catch_warnings(),
            Parallel(count, "loky", return_as="generator", initializer=_leave_interrupts_to_parent) as workers,
        ):
            # Those that have grown by much, as by importing PyTorch, are replaced.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
            yield workers


def check_workers(workers: int) -> None:
    """Make sure that work can be spread over that many processes.

    Raises:
        InvalidValue: when there is not at least one, or more than fit into memory.
    """
    if workers < 1:
        raise InvalidValue(f"workers = {workers}: at least 1 is needed")
    if workers > 1:
        check_memory(f"workers = {workers}, of {_WORKER_BYTES / 1e6:g} MB each", workers * _WORKER_BYTES)


def usable_cores() -> int:
    """How many cores this process may use."""
    return int(cpu_count())


def _same_plugins(wanted: Mapping[str, str | None]) -> None:
    """Make sure that this process has the plug-ins of another one, and no others.

    Raises:
        StoreError: otherwise, with their names.
    """
    try:
        here = plugin_digests()
    except InvalidValue as error:
        raise StoreError(f"a worker {error}: {_AS_HERE}") from None
    lacking = [name for name, code in wanted.items() if code not in here.values()]
    further = [name for name, code in here.items() if code not in wanted.values()]
    if lacking:
        raise StoreError(f"a worker lacks the plug-in {', '.join(lacking)}, or has another version of it: {_AS_HERE}")
    if further:
        raise StoreError(f"a worker has a plug-in that is not here, {', '.join(further)}: {_AS_HERE}")


@contextmanager
def answers_to(
    workers: Workers, function: Callable[..., _T], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Iterator[_T]]:
    """What workers answer to tasks; those not yet answered at the end are dropped.

    Raises:
        WorkersLost: when one was killed: joblib then kills all.
    """
    try:
        answers = workers(delayed(function)(*task) for task in tasks)
        try:
            yield answers
        finally:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # joblib advises to use all answers
                answers.close()
    except BrokenProcessPool:
        raise WorkersLost("a worker process was killed, as happens when memory runs out") from None


def _open_cluster(count: int, scheduler: str | None) -> AbstractContextManager[Workers]:
    try:
        from snakebench.cluster import open_cluster
    except ModuleNotFoundError:
        raise InvalidValue('executor = dask: Dask is needed: pip install "snakebench[cluster]"') from None
    return open_cluster(count, scheduler, partial(_same_plugins, plugin_digests()))


def _leave_interrupts_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
