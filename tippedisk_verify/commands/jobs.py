"""The options --jobs and --executor, and the processes that they ask for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.options import option_callback
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.interrupts import clean_up_on_ctrl_c
from tippedisk_verify.support.parallel import usable_cores

if TYPE_CHECKING:
    from concurrent.futures import Executor

__all__ = ["checked_executor", "checked_jobs", "jobs_option", "process_pool", "worker_executor"]

_MIN_OFFERED = 16  # processes that --jobs allows on any machine


def checked_jobs(jobs: int | None) -> int | None:
    """Check a number of processes against this machine's limit, and return it; None stays None.

    Raises:
        InputError: If it is out of range.
    """
    most = max(_MIN_OFFERED, 2 * usable_cores())
    if jobs is not None and not 1 <= jobs <= most:
        raise InputError(
            f"--jobs must lie between 1 and {most} on this machine, not {str(jobs)[:40]}"
        )
    return jobs


def checked_executor(executor: str) -> str:
    """Check the name of an executor, and return it.

    Raises:
        InputError: If it is not known.
    """
    if executor not in ("serial", "local") and not executor.startswith("dask://"):
        raise InputError(
            f"executor '{executor[:60]}' is not known: use serial, local or dask://HOST:PORT"
        )
    return executor


jobs_option = click.option(
    "--jobs",
    type=int,
    metavar="N",
    callback=option_callback(checked_jobs),
    help="Number of processes; the number of cores if not given.",
)


@contextmanager
def process_pool(jobs: int | None, *, needed: bool = True) -> Iterator[Executor | None]:
    """Yield a pool of new processes, or None if this process is enough.

    Ctrl-C reaches this process only, and the pool always ends with it.

    Args:
        jobs: The number of processes; None for the number of cores.
        needed: False to yield None in any case.

    Raises:
        InputError: If `jobs` is out of range.
    """
    workers = checked_jobs(jobs) or usable_cores()
    if workers == 1 or not needed:
        yield None
        return
    from tippedisk_verify.support.workers import ProcessPool, kill_workers

    with clean_up_on_ctrl_c(kill_workers), ProcessPool(workers) as pool:
        yield pool


@contextmanager
def worker_executor(executor: str, jobs: int | None) -> Iterator[Executor | None]:
    """Yield the executor that --executor names, or None for this process.

    Each call checks that its worker has the same code.

    Args:
        executor: serial, local or dask://HOST:PORT.
        jobs: The number of processes of a local executor.

    Raises:
        InputError: If no scheduler answers.
        AccuracyError: If the cluster fails, or a worker has other code.
    """
    from tippedisk_verify.support.workers import CodeCheckingExecutor, cluster

    if executor.startswith("dask://"):
        with cluster(executor) as workers:
            yield workers
    else:
        with process_pool(jobs, needed=executor == "local") as pool:
            yield pool and CodeCheckingExecutor(pool)
