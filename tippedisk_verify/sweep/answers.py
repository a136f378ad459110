"""Answers of other processes: taken if they come from the code that this process has, given up if a cluster is gone."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from functools import partial
from threading import Event, Lock, Thread
from typing import Any

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.fingerprint import origin, unlike
from tippedisk_verify.sweep.cluster import Cluster

__all__ = ["Compared"]

_PATIENCE = 10.0  # s between two looks at whether a cluster is still there


class Compared(Executor):
    """An executor whose every answer is compared: a function of other code than here fails with Shortfall.

    So does what waits for a cluster that is gone. Its end leaves the executor as it is.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._waiting: set[Future[Any]] = set()
        self._ending, self._over = Lock(), Event()
        if isinstance(executor, Cluster):
            Thread(target=self._look_after, args=(executor,), daemon=True).start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        mine: Future[Any] = Future()
        here = origin(fn.__module__)  # before anything can change
        theirs = self._executor.submit(_told, fn, *args, **kwargs)
        self._waiting.add(mine)
        mine.add_done_callback(self._waiting.discard)
        mine.add_done_callback(lambda _: theirs.cancel())  # what is done stays as it is
        theirs.add_done_callback(partial(self._pass_on, mine, here))
        return mine

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._over.set()

    def _pass_on(self, mine: Future[Any], here: dict[str, str], theirs: Future[Any]) -> None:
        try:
            where, other, value = theirs.result()
            if difference := unlike(other, here):
                raise Shortfall(f"an answer came from {where}, which has {difference}: it is not used")
        except CancelledError:
            gone = "what was under way was cancelled: its scheduler is gone, or was started anew"
            self._end(mine, partial(mine.set_exception, Shortfall(gone)))
        except BaseException as fault:  # whatever the function raised there
            self._end(mine, partial(mine.set_exception, fault))
        else:
            self._end(mine, partial(mine.set_result, value))

    def _end(self, mine: Future[Any], how: Callable[[], None]) -> None:
        with self._ending:
            if not mine.done():
                how()

    def _look_after(self, cluster: Cluster) -> None:
        while not self._over.wait(_PATIENCE):
            try:
                cluster.look()
            except Shortfall as fault:
                for mine in tuple(self._waiting):
                    self._end(mine, partial(mine.set_exception, fault))


def _told(fn: Callable[..., Any], *args: Any, **kwargs: Any) -> tuple[str, dict[str, str], Any]:
    """Which process this is, where its numbers come from, and what the function returns here."""
    return f"process {os.getpid()} on {platform.node()}", origin(fn.__module__), fn(*args, **kwargs)
