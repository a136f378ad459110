"""Who computes: fresh processes of this machine, or the workers of a Dask cluster.

Dask watches over its workers itself: what a lost one had is given to another. Two things are left to do here. A port
where something else listens is told from a scheduler, for which Dask's client would wait on. And calls travel as plain
bytes, because a worker without the package ends when Dask sends it a function of it; so it says that it has none.
"""

from __future__ import annotations

import asyncio
import logging
import os
import pickle
import platform
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import active_children, get_context, parent_process
from typing import Any

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.interrupts import deaf_children, unbroken
from tippedisk_verify.provenance import code_version

__all__ = ["Checked", "Pool", "cluster", "kill_workers"]

_QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"
_PATIENCE = 15.0  # s for a scheduler to answer, and for a first worker


class Pool(ProcessPoolExecutor):
    """Fresh processes: what their parent has compiled, and its threads, are not for forking.

    They never receive Ctrl-C, and end when their parent is gone, even if it was killed.
    """

    def __init__(self, count: int) -> None:
        # Python's resource tracker removes the semaphores that an interrupted pool leaves; it need not say so.
        if _QUIET not in (others := os.environ.get("PYTHONWARNINGS", "")):
            os.environ["PYTHONWARNINGS"] = f"{others},{_QUIET}" if others else _QUIET
        # They are made first and registered afterwards, with a process that must outlive this one.
        with unbroken(), deaf_children():
            super().__init__(count, mp_context=get_context("spawn"), initializer=_end_with_parent)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        with unbroken(), deaf_children():  # it may start a process, which prints a traceback if its orders break off
            return super().submit(fn, *args, **kwargs)

    def __exit__(self, *fault: object) -> None:
        if fault[0] is not None:
            kill_workers()  # what is under way is of no use any more
        self.shutdown(wait=True, cancel_futures=True)


def kill_workers() -> None:
    """End every process that this one has started through multiprocessing."""
    for worker in active_children():
        worker.kill()


def _end_with_parent() -> None:
    def watch() -> None:
        if (parent := parent_process()) is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class Checked(Executor):
    """An executor that calls functions where the code is that of this process; elsewhere they raise AccuracyError."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._executor.submit(pickle.loads, pickle.dumps(_Call(partial(fn, *args, **kwargs))))


@dataclass(frozen=True)
class _Call:
    """Pickled, it is the call itself: loading it gives what the function returns, or raises what it raises."""

    call: Callable[[], Any]

    def __reduce__(self) -> tuple[Any, ...]:
        return _checked, (code_version(), self.call)


def _checked(version: str, call: Callable[[], Any]) -> Any:
    if (mine := code_version()) != version:
        where = f"process {os.getpid()} on {platform.node()}"
        raise AccuracyError(f"all workers need the same code, but {where} has {mine} instead of {version}")
    return call()


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of the Dask scheduler at ``dask://HOST:PORT``.

    Raises InputError if there is none, AccuracyError if it has no worker, goes away, or a worker is without this
    package.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise InputError("a Dask cluster needs distributed: pip install '.[cluster]'") from None
    host, before = address.removeprefix("dask://"), logging.root.manager.disable
    logging.disable()  # what matters of Dask's own lines is said by the errors here
    try:
        try:
            asyncio.run(_refuse_others(f"tcp://{host}"))
            with warnings.catch_warnings(action="ignore"):  # of versions: each call looks at those that matter
                client: Any = Client(f"tcp://{host}", timeout=_PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
        except Exception:  # what else listens there may answer anything
            raise InputError(f"no Dask scheduler answers at {host[:80]}: give the address that it printed") from None
        with client:
            try:
                client.wait_for_workers(1, timeout=_PATIENCE)
            except TimeoutError:
                raise AccuracyError(f"{host} has no worker: start some with 'dask worker tcp://{host}'") from None
            yield Checked(client.get_executor(pure=False))
    except (CancelledError, KilledWorker, ImportError, AttributeError) as fault:
        reason = "its scheduler is gone, or was started anew" if isinstance(fault, CancelledError) else fault
        raise AccuracyError(f"the cluster at {host} failed: {reason}") from None
    finally:
        logging.disable(before)


async def _refuse_others(address: str) -> None:
    from distributed import rpc

    async with asyncio.timeout(_PATIENCE), rpc(address) as server:  # type: ignore[no-untyped-call]
        if (await server.identity())["type"] != "Scheduler":
            raise ValueError
