"""Workers of a Dask cluster: on this machine, or wherever a scheduler listens."""

from __future__ import annotations

import asyncio
import logging
import re
import signal
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from itertools import islice
from typing import Any

from distributed import Client, Future, KilledWorker, Security, rpc
from distributed.protocol.pickle import dumps, loads

from snakebench.errors import InvalidValue, SnakebenchError, WorkersLost

_PATIENCE = 8.0  # with a scheduler that does not answer, and with a cluster without workers [s]
_LOOK = 1.0  # between two looks at who works [s]
_AHEAD = 3  # batches that are sent for each worker
_BATCH = 0.3  # about how long a worker takes for the tasks that are sent together [s]
_LOGS = ("distributed", "distributed.client", "tornado.application", "asyncio")  # silent: what matters is raised

_LOCAL = {
    "threads_per_worker": 1,
    "memory_limit": 0,
    "dashboard_address": "127.0.0.1:0",  # of the status that Dask serves in any case
    "scheduler_kwargs": {"dashboard": False},
    "silence_logs": logging.CRITICAL,
    "preload": [__name__],
    "set_as_default": False,
}


@contextmanager
def open_cluster(count: int, scheduler: str | None, prepare: Callable[[], None]) -> Iterator[Cluster]:
    """The workers of the cluster of a scheduler, or of `count` processes here, which `prepare` themselves first."""
    for name in _LOGS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    start = f"dask worker {scheduler or 'ADDRESS'} --nthreads 1"
    with Client(**_LOCAL, n_workers=count) if scheduler is None else _connection(scheduler, start) as client:
        threads = _threads(client)
        if complaint := _complaint(threads):
            raise InvalidValue(f"{complaint}: start workers by `{start}`")
        yield Cluster(client, len(threads), prepare)


def dask_setup(_: object) -> None:
    """What Dask calls in each worker process of `open_cluster`: an interrupt at the terminal is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class Cluster:
    """The workers of a cluster, at first `n_jobs`, called like joblib's `Parallel`."""

    def __init__(self, client: Client, n_jobs: int, prepare: Callable[[], None]) -> None:
        self._client, self.n_jobs, self._prepare = client, n_jobs, prepare

    def __call__(self, tasks: Iterable[Any]) -> Generator[Any]:
        """The answers to tasks, made by `joblib.delayed`, in their order; the rest is given up when it is closed."""
        most = _AHEAD * max(self.n_jobs, len(_threads(self._client)))  # workers may have joined
        rest, size = iter(tasks), 1
        sent: deque[Future[Any]] = deque()
        try:
            while True:
                while len(sent) < most and (batch := list(islice(rest, size))):
                    sent.append(self._client.submit(_answers, self._prepare, dumps(batch), pure=False))
                if not sent:
                    return
                answers, seconds = self._result(sent[0])
                sent.popleft()
                size = max(1, min(round(_BATCH / max(seconds, 1e-6) * len(answers)), 2 * len(answers)))
                yield from answers
        finally:
            self._client.cancel(list(sent))

    def _result(self, batch: Future[Any]) -> tuple[list[Any], float]:
        deadline = time.monotonic() + _PATIENCE
        try:
            while not batch.done():
                with suppress(TimeoutError):
                    return batch.result(_LOOK)
                if threads := _threads(self._client):
                    deadline = time.monotonic() + _PATIENCE
                if (complaint := _complaint(threads)) and (threads or time.monotonic() > deadline):
                    raise WorkersLost(complaint)
            return batch.result()
        except SnakebenchError:
            raise
        except CancelledError:
            raise WorkersLost("the connection to the scheduler was lost") from None
        except KilledWorker:
            raise WorkersLost("an evaluation killed every worker that tried it, as the workers' logs tell") from None
        except Exception as error:  # of what is sent, or of the evaluation itself
            raise WorkersLost(f"the cluster gave up an evaluation: {type(error).__name__}: {error}") from error


def _answers(prepare: Callable[[], None], tasks: bytes) -> tuple[list[Any], float]:
    """What a worker does: the answers to tasks, which come as bytes the scheduler does not unpack, and its time [s]."""
    prepare()
    try:
        unpacked = loads(tasks)
    except (ImportError, AttributeError) as error:
        raise InvalidValue(
            f"a worker lacks what it is sent, {error}: install the same version of snakebench on every machine"
        ) from None
    started = time.perf_counter()
    answers = [function(*args, **options) for function, args, options in unpacked]
    return answers, time.perf_counter() - started


def _connection(scheduler: str, start: str) -> Client:
    if not re.fullmatch(r"((tcp|tls)://)?([^/:]+|\[[^/\]]+\]):\d+", scheduler):
        raise InvalidValue(f"scheduler = {scheduler!r}: an address such as tcp://HOST:8786 is needed")
    try:
        asyncio.run(asyncio.wait_for(_meet(scheduler), _PATIENCE))
        client = Client(scheduler, timeout=_PATIENCE, set_as_default=False)
    except InvalidValue:
        raise
    except Exception as error:  # of sockets, of TLS, or of what the bytes of another server are taken for
        silent = isinstance(error, OSError)
        why = f"no answer within {_PATIENCE:g} s" if silent else "what answers there is no scheduler of Dask"
        raise InvalidValue(
            f"scheduler = {scheduler}: {why}; start one by `dask scheduler`, and workers by `{start}`"
        ) from None
    with suppress(TimeoutError):  # `open_cluster` refuses a cluster without workers
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


def _threads(client: Client) -> dict[str, int]:
    """Threads of each worker by its address; none when the scheduler does not answer."""
    try:
        return dict(client.ncores())
    except Exception:  # Dask's, of several kinds
        return {}


def _complaint(threads: dict[str, int]) -> str | None:
    """What is wrong with workers of so many threads."""
    for worker, count in threads.items():
        if count > 1:
            return f"worker {worker} has {count} threads, but PyBullet allows one simulation a process"
    return None if threads else "the cluster has no workers"
