"""Workers of a Dask cluster, through joblib's backend: on this machine, or wherever a scheduler listens."""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import Any
from urllib.parse import urlsplit

from distributed import Client, KilledWorker, Security, rpc
from distributed.protocol.pickle import dumps, loads
from distributed.utils import LoopRunner
from joblib import Parallel
from joblib._dask import DaskDistributedBackend
from joblib.parallel import BatchedCalls

from snakebench.errors import InvalidValue, WorkersLost

_PATIENCE = 8.0  # with a scheduler that does not answer, and with a cluster without workers [s]
_LOGS = ("distributed", "distributed.client", "tornado.application", "asyncio")  # silent: what matters is raised
_LOOK = 1.0  # between two looks at who works [s]


@contextmanager
def open_cluster(count: int, scheduler: str | None, prepare: Callable[[], None]) -> Iterator[Parallel]:
    """The workers of the cluster whose scheduler listens there; without one, of a cluster of `count` processes here.

    Args:
        count: how many processes, without a scheduler.
        scheduler: its address.
        prepare: what a worker does before it unpacks tasks, such as loading what they need; its errors are raised here.

    Raises:
        InvalidValue: when there is no such scheduler, it has no worker, or a worker has several threads.
        WorkersLost: when they are lost later.
    """
    for name in _LOGS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with _local_cluster(count) if scheduler is None else _connection(scheduler) as client:
        threads = _threads(client)
        if complaint := _complaint(threads):
            raise InvalidValue(f"{complaint}: start workers by `{_start(scheduler)}`")
        backend = _Backend(client, prepare)
        with _watch(backend):
            yield Parallel(len(threads), backend=backend, return_as="generator")


def dask_setup(_: object) -> None:
    """What Dask calls in each worker process of `open_cluster`: an interrupt at the terminal is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class _Batch:
    """Tasks as a worker does them; they come as bytes, since on their way the scheduler would unpack anything else."""

    def __init__(self, prepare: Callable[[], None]) -> None:
        self._prepare = prepare

    def __call__(self, tasks: bytes) -> list[Any]:
        self._prepare()
        try:
            unpacked = loads(tasks)
        except (ImportError, AttributeError) as error:
            raise InvalidValue(
                f"a worker lacks what it is sent, {error}: install the same version of snakebench on every machine"
            ) from None
        return [function(*args, **options) for function, args, options in unpacked]


class _Backend(DaskDistributedBackend):
    """joblib's Dask backend, but it waits for no task that Dask has given up, and makes nothing in this process.

    joblib exports only the name of that backend. Of what it does, the public `ParallelBackendBase` has nothing: tasks
    sent from the event loop, answers as they come, all given up at once. It would have to be written anew here.
    """

    def __init__(self, client: Client, prepare: Callable[[], None]) -> None:
        super().__init__(client=client)
        self._batch = _Batch(prepare)
        self._waiting: dict[Future[Any], Callable[[object], None]] = {}

    def effective_n_jobs(self, _: int) -> int:
        """How many tasks to have at once; for a single one, joblib would not ask the cluster."""
        return max(2, len(_threads(self.client)))

    def submit(self, func: object, callback: Callable[[object], None]) -> Future[Any]:
        """Send a batch of tasks; its outcome is told to `callback`, also when Dask gives it up."""
        future: Future[Any] = super().submit(func, callback)
        self._waiting[future] = callback
        future.add_done_callback(self._is_done)
        return future

    async def _to_func_args(self, func: BatchedCalls) -> tuple[_Batch, bytes]:
        """What is sent for a batch of tasks: what a worker calls, and its argument."""
        return self._batch, dumps(func.items)

    def retrieve_result_callback(self, out: object) -> object:
        """The results of a batch, or the error that took their place."""
        if isinstance(out, CancelledError):
            raise WorkersLost("the connection to the scheduler was lost")
        return super().retrieve_result_callback(out)

    def give_up(self, error: Exception) -> None:
        """End the work in progress by this error."""
        for callback in list(self._waiting.values()):
            callback(error)

    def _is_done(self, future: Future[Any]) -> None:
        callback, error = self._waiting.pop(future), future.exception()
        if error is not None:  # of Dask: one of the evaluation itself is a result to Dask
            callback(WorkersLost(_reason(error)))


@contextmanager
def _watch(backend: _Backend) -> Iterator[None]:
    """Meanwhile, give up the work in progress as soon as no cluster is left that can do it."""
    over = Event()

    def watch() -> None:
        patience = _PATIENCE
        while not over.wait(_LOOK):
            threads = _threads(backend.client)
            patience = _PATIENCE if threads else patience - _LOOK
            if patience <= 0 or max(threads.values(), default=1) > 1:
                backend.give_up(WorkersLost(str(_complaint(threads))))

    Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()


def _local_cluster(count: int) -> Client:
    return Client(
        n_workers=count,
        threads_per_worker=1,
        memory_limit=0,
        dashboard_address="127.0.0.1:0",  # of the status that Dask serves in any case
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
        preload=[__name__],
        set_as_default=False,
    )


def _connection(scheduler: str) -> Client:
    _check_address(scheduler)
    try:
        LoopRunner().run_sync(_meet, scheduler, callback_timeout=_PATIENCE)
        client = Client(scheduler, timeout=_PATIENCE, set_as_default=False)
    except InvalidValue:
        raise
    except Exception as error:  # of sockets, of TLS, or of what the bytes of another server are taken for
        silent = isinstance(error, OSError)
        why = f"no answer within {_PATIENCE:g} s" if silent else "what answers there is no scheduler of Dask"
        raise InvalidValue(
            f"scheduler = {scheduler}: {why}; start one by `dask scheduler`, and workers by `{_start(scheduler)}`"
        ) from None
    with suppress(TimeoutError):  # that there are none is said by who asks for their threads
        client.wait_for_workers(1, timeout=_PATIENCE)
    return client


async def _meet(scheduler: str) -> None:
    """Make sure that a scheduler answers there; a `Client` would wait for long for a server that is none."""
    options = Security().get_connection_args("client")
    if scheduler.startswith("tls:") and options["ssl_context"] is None:
        raise InvalidValue(
            f"scheduler = {scheduler}: tls needs certificates: name them in Dask's configuration, distributed.comm.tls"
        )
    async with rpc(scheduler, connection_args=options) as there:
        if (kind := (await there.identity())["type"]) != "Scheduler":
            raise InvalidValue(f"scheduler = {scheduler}: what answers there is a {kind} of Dask, no Scheduler")


def _check_address(scheduler: str) -> None:
    try:
        parts = urlsplit(scheduler if "://" in scheduler else f"tcp://{scheduler}")
        known = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:
        known = False
    if not known:
        raise InvalidValue(f"scheduler = {scheduler!r}: an address such as tcp://HOST:8786 is needed")


def _threads(client: Client) -> dict[str, int]:
    """Threads of each worker by its address; none when the scheduler does not answer."""
    try:
        return dict(client.ncores())
    except Exception:  # Dask's, of several kinds
        return {}


def _complaint(threads: dict[str, int]) -> str | None:
    """What is wrong with workers of so many threads."""
    if not threads:
        return "the cluster has no workers"
    several = [worker for worker, count in threads.items() if count > 1]
    if several:
        return f"worker {several[0]} has {threads[several[0]]} threads, but PyBullet allows one simulation a process"
    return None


def _reason(error: BaseException) -> str:
    if isinstance(error, KilledWorker):
        return "an evaluation killed every worker that tried it, as the workers' logs tell"
    text = " ".join(str(error).split())
    return f"the cluster gave up an evaluation: {type(error).__name__}: {text}"


def _start(scheduler: str | None) -> str:
    return f"dask worker {scheduler or 'ADDRESS'} --nthreads 1"
