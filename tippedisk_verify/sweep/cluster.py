"""A Dask cluster as an executor: who answers at an address, what code its workers have, and when it has gone.

Neither a foreign port nor a lost scheduler makes Dask's client give up by itself, and a worker without the package ends
when it is sent a function of it. So the scheduler is asked who it is before a client is made, every worker is asked
where its numbers would come from before it is trusted, and points travel as plain bytes.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from tippedisk_verify import __version__
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.fingerprint import unlike
from tippedisk_verify.sweep.plan import here

__all__ = ["Cluster", "executor_at"]

# All of these together stay below a minute.
_CONNECT = 8.0  # s for a scheduler to say who it is, and once more for the client to be let in
_WORKERLESS = 20.0  # s that a cluster may be without workers
_ANSWER = 15.0  # s for the scheduler, or all workers, to answer a question
_TICK = 0.5  # s between two looks for the first worker
_NAMED = 3  # workers in a message
_LOGGERS = ("distributed", "distributed.client", "distributed.gc", "tornado.application", "asyncio")


class _Call:
    """Pickled, it is the call itself: loading it gives what the function returns, or raises what it raises.

    So a worker is sent a function that every Python has and bytes, and the scheduler, which reads what it hands on,
    needs no package.
    """

    def __init__(self, call: partial[Any]) -> None:
        self._call = call

    def __reduce__(self) -> tuple[Any, ...]:
        return self._call, ()


class Cluster(Executor):
    """The workers of a Dask scheduler, for functions of `plan`."""

    def __init__(self, client: Any, host: str) -> None:
        self._client, self._host = client, host
        # A worker that dies takes its points along; the scheduler gives them to another, three times at most.
        self._points = client.get_executor(pure=False, retries=3)
        self._trusted: set[str] = set()
        self._empty_since: float | None = None

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = self._points.submit(pickle.loads, pickle.dumps(_Call(partial(fn, *args, **kwargs))))
        return future

    def look(self) -> int:
        """How many workers there are. Raises Shortfall if the scheduler is gone, or a worker has other code or none."""
        workers = self._asked(lambda: self._client.scheduler.ncores())
        if workers:
            self._empty_since = None
        elif self._empty_since is None:
            self._empty_since = time.monotonic()
        elif time.monotonic() - self._empty_since > _WORKERLESS:
            raise Shortfall(
                f"the cluster at {self._host} has no worker: start some with 'dask worker tcp://{self._host}'"
            )
        new = sorted(set(workers) - self._trusted)
        if new:
            self._examine(new)
            self._trusted.update(new)
        return len(workers)

    def _examine(self, workers: list[str]) -> None:
        question = pickle.dumps(_Call(partial(here)))
        answers = self._asked(lambda: self._client._run(pickle.loads, question, workers=workers, on_error="return"))
        strangers = []
        for worker in workers:
            answer = answers.get(worker)
            if isinstance(answer, OSError):
                continue  # it has just left
            if not isinstance(answer, dict):
                strangers.append(f"{worker} has another or none ({str(answer)[:80] or type(answer).__name__})")
            elif difference := unlike(answer, here()):
                strangers.append(f"{worker} has {difference}")
        if strangers:
            more = f", and {len(strangers) - _NAMED} more" if len(strangers) > _NAMED else ""
            raise Shortfall(
                f"all workers need the tippedisk_verify {__version__} of this machine, with the same packages: "
                f"{', '.join(strangers[:_NAMED])}{more}"
            )

    def _asked(self, question: Callable[[], Any]) -> Any:
        try:
            return self._client.sync(question, callback_timeout=_ANSWER)
        except Exception as fault:
            reason = str(fault)[:80] or type(fault).__name__
            raise Shortfall(f"the cluster at {self._host} does not answer: {reason}") from None


@contextmanager
def executor_at(address: str) -> Iterator[Cluster]:
    """The executor of a Dask cluster, ``dask://HOST:PORT``.

    Raises InputError if there is no Dask scheduler, Shortfall without a worker that has this code.
    """
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise InputError("a Dask cluster needs distributed: pip install 'tippedisk-verify[cluster]'") from None
    host = address.removeprefix("dask://")
    with _quiet():
        try:
            with ThreadPoolExecutor(1) as beside:  # an event loop of its own, also in a notebook
                answer = beside.submit(asyncio.run, _identity(f"tcp://{host}")).result()
            if answer.get("type") != "Scheduler":
                raise ValueError(f"a {str(answer.get('type'))[:40]} answers")
            with warnings.catch_warnings(action="ignore"):  # of versions: the workers' are looked at
                client: Any = Client(f"tcp://{host}", timeout=_CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
        except Exception as fault:  # whatever else listens there may answer anything
            reason = str(fault)[:80] or type(fault).__name__
            if isinstance(fault, TimeoutError | MemoryError):
                reason = "no answer" if isinstance(fault, TimeoutError) else "what answers is something else"
            raise InputError(f"no Dask scheduler at {host[:80]}: {reason}") from None
        try:
            cluster = Cluster(client, host)
            while not cluster.look():
                time.sleep(_TICK)
            yield cluster
        except Shortfall:
            raise
        except KilledWorker:
            raise Shortfall(f"a point has ended several workers of {host} one after the other") from None
        except Exception:
            cluster.look()  # if it is the cluster's fault, this says so
            raise
        finally:
            with suppress(Exception):  # of a scheduler that is gone
                client.close(timeout=_CONNECT)


async def _identity(address: str) -> Any:
    from distributed import rpc

    async with rpc(address, timeout=_CONNECT) as server:  # type: ignore[no-untyped-call]
        return await asyncio.wait_for(server.identity(), _CONNECT)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Dask's own lines: what matters in them is said by the errors here."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
