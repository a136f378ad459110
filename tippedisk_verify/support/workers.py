"""The processes that compute: new ones on this machine, or the workers of a Dask cluster.

Dask watches its workers itself and gives the work of a lost one to another. Two things remain to be
done here:

- A port on which another server listens must be recognised: Dask's client would wait for it.
- Calls are sent as plain bytes. A worker without the package dies when Dask sends it a function of
  the package; with bytes it can report that the package is missing.
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
from tippedisk_verify.support.interrupts import children_without_ctrl_c, postpone_ctrl_c
from tippedisk_verify.support.provenance import code_version

__all__ = ["CodeCheckingExecutor", "ProcessPool", "cluster", "kill_workers"]

_QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"  # an entry of PYTHONWARNINGS
_SCHEDULER_TIMEOUT = 15.0  # s to wait for a scheduler's answer, and for a first worker


class ProcessPool(ProcessPoolExecutor):
    """A pool of new processes.

    They are not forked, because compiled code and threads of the parent must not be copied. They
    never receive Ctrl-C, and end with their parent, even if it is killed.
    """

    def __init__(self, count: int) -> None:
        # Python's resource tracker removes the semaphores of an interrupted pool; hide its warning.
        if _QUIET not in (filters := os.environ.get("PYTHONWARNINGS", "")):
            os.environ["PYTHONWARNINGS"] = f"{filters},{_QUIET}" if filters else _QUIET
        # Semaphores are made first and then registered with a process that outlives this one. An
        # interrupt in between would leave them behind.
        with postpone_ctrl_c(), children_without_ctrl_c():
            super().__init__(count, mp_context=get_context("spawn"), initializer=_end_with_parent)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call, without letting Ctrl-C interrupt the start of a process."""
        with (
            postpone_ctrl_c(),
            children_without_ctrl_c(),
        ):  # a process whose start is cut short prints a traceback
            return super().submit(fn, *args, **kwargs)

    def __exit__(self, *fault: object) -> None:
        if fault[0] is not None:
            kill_workers()  # their results are no longer needed
        self.shutdown(wait=True, cancel_futures=True)


def kill_workers() -> None:
    """Kill every process that this one has started through multiprocessing."""
    for worker in active_children():
        worker.kill()


def _end_with_parent() -> None:
    def watch() -> None:
        if (parent := parent_process()) is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class CodeCheckingExecutor(Executor):
    """An executor that checks the code of its workers: a call raises AccuracyError in a process
    that has different code.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call to a worker process that first checks that the worker has the same code."""
        return self._executor.submit(
            pickle.loads, pickle.dumps(_Call(partial(fn, *args, **kwargs)))
        )


@dataclass(frozen=True)
class _Call:
    """A call whose pickle executes it: loading gives the function's result, or raises its error."""

    call: Callable[[], Any]

    def __reduce__(self) -> tuple[Any, ...]:
        return _checked, (code_version(), self.call)


def _checked(version: str, call: Callable[[], Any]) -> Any:
    if (own_version := code_version()) != version:
        where = f"process {os.getpid()} on {platform.node()}"
        raise AccuracyError(
            f"all workers need the same code, but {where} has {own_version} instead of {version}"
        )
    return call()


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Connect to the Dask scheduler at ``dask://HOST:PORT``, and yield an executor of its workers.

    Raises:
        InputError: If no scheduler answers there, or Dask is not installed.
        AccuracyError: If it has no worker, or goes away, or a worker lacks this package.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise InputError("a Dask cluster needs distributed: pip install '.[cluster]'") from None
    host, before = address.removeprefix("dask://"), logging.root.manager.disable
    logging.disable()  # the errors raised here replace Dask's own messages
    try:
        try:
            asyncio.run(_refuse_others(f"tcp://{host}"))
            with warnings.catch_warnings(action="ignore"):  # about versions, which each call checks
                client: Any = Client(
                    f"tcp://{host}", timeout=_SCHEDULER_TIMEOUT, set_as_default=False
                )  # type: ignore[no-untyped-call]
        except Exception:  # another server may answer anything
            raise InputError(
                f"no Dask scheduler answers at {host[:80]}: give the address that it printed"
            ) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=_SCHEDULER_TIMEOUT)
            except TimeoutError:
                raise AccuracyError(
                    f"{host} has no worker: start some with 'dask worker tcp://{host}'"
                ) from None
            yield CodeCheckingExecutor(client.get_executor(pure=False))
    except (CancelledError, KilledWorker, ImportError, AttributeError) as fault:
        reason = (
            "its scheduler is gone, or was started anew"
            if isinstance(fault, CancelledError)
            else fault
        )
        raise AccuracyError(f"the cluster at {host} failed: {reason}") from None
    finally:
        logging.disable(before)


async def _refuse_others(address: str) -> None:
    from distributed import rpc

    async with asyncio.timeout(_SCHEDULER_TIMEOUT), rpc(address) as server:  # type: ignore[no-untyped-call]
        if (await server.identity())["type"] != "Scheduler":
            raise ValueError
