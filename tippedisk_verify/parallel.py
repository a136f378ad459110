"""Work that may go to other processes, and the cores that there are for it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, as_completed
from typing import Any, TypeVar

__all__ = ["as_done", "map_of", "usable_cores"]

Job = TypeVar("Job")
Answer = TypeVar("Answer")


def as_done(
    function: Callable[[Job], Answer], jobs: Iterable[Job], executor: Executor | None
) -> Iterator[tuple[Job, Answer]]:
    """Each job with its answer: in order in this process if there is no executor, else as they are done.

    An executor is given each job as soon as ``jobs`` has it.
    """
    if executor is None:
        yield from ((job, function(job)) for job in jobs)
        return
    waiting = {executor.submit(function, job): job for job in jobs}
    yield from ((waiting[future], future.result()) for future in as_completed(waiting))


def map_of(executor: Executor | None) -> Callable[..., Iterable[Any]]:
    """Return the executor's map, or this process's own if there is no executor."""
    return map if executor is None else executor.map


def usable_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
