"""Running jobs in this process or in others, and the number of usable cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, as_completed
from typing import Any, TypeVar

__all__ = ["map_of", "results_as_completed", "usable_cores"]

Job = TypeVar("Job")
Answer = TypeVar("Answer")


def results_as_completed(
    function: Callable[[Job], Answer], jobs: Iterable[Job], executor: Executor | None
) -> Iterator[tuple[Job, Answer]]:
    """Apply a function to jobs, in this process or on an executor, and yield each job with its
    answer.

    Without an executor the jobs run in order in this process. With one, each pair comes as soon as
    it is done, and jobs are submitted as fast as ``jobs`` yields them.

    Args:
        function: The function of a job.
        jobs: The jobs.
        executor: The executor, or None for this process.
    """
    if executor is None:
        yield from ((job, function(job)) for job in jobs)
        return
    waiting = {executor.submit(function, job): job for job in jobs}
    yield from ((waiting[future], future.result()) for future in as_completed(waiting))


def map_of(executor: Executor | None) -> Callable[..., Iterable[Any]]:
    """Return the executor's ``map``, or Python's own if there is no executor.

    Args:
        executor: The executor, or None.
    """
    return map if executor is None else executor.map


def usable_cores() -> int:
    """Return the number of cores on which this process may run."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
