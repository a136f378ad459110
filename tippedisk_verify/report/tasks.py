"""The execution of the main job: each claim and each figure is a task.

Results are stored under a hash of everything they depend on, and tasks run on several cores.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from typing import Any, Literal

from tippedisk_verify.audit.claim_catalogue import GROUPS, claims_drawn_in, group_of, select_claims
from tippedisk_verify.audit.claims import Audit, examine_claim
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.support.cache import Cache
from tippedisk_verify.support.provenance import DRAWING, fingerprint

__all__ = ["AuditJob", "Task", "run_task", "run_tasks", "task_key", "tasks_for"]

_MAX_TASKS_HERE = 4  # for so few heavy tasks, starting processes costs more than it saves
_PROGRESS_INTERVAL = 0.2  # s between two updates of the progress


@dataclass(frozen=True)
class AuditJob:
    """The description of an audit: the disk, the digits and the names of the claims."""

    parameters: Parameters
    digits: int
    claims: tuple[str, ...]


@dataclass(frozen=True)
class Task:
    """A part of an audit that is computed and stored alone: one claim, one figure, or the formulas
    of all claims.
    """

    kind: Literal["claim", "figure", "formulas"]
    name: str


def tasks_for(job: AuditJob, *, figures: bool) -> tuple[Task, ...]:
    """Return the tasks of an audit, one for each claim, figure and formula.

    Args:
        job: The audit.
        figures: True to include the figures of the audit's claims, and the formulas.
    """
    tasks = [Task("claim", name) for name in job.claims]
    if figures:
        from tippedisk_verify.figures.exhibit_catalogue import exhibits_for

        tasks += [Task("figure", exhibit.name) for exhibit in exhibits_for(job.claims)]
        tasks.append(Task("formulas", "formulas"))
    return tuple(tasks)


def task_key(job: AuditJob, task: Task) -> str:
    """Return the cache key of a task: a hash of everything that its result depends on."""
    inputs: dict[str, Any] = {
        "task": asdict(task),
        "parameters": {
            item.name: str(getattr(job.parameters, item.name))
            for item in fields(Parameters)
            if item.init
        },
        "digits": job.digits,
    }
    if task.kind == "claim":
        return fingerprint(inputs)
    if task.kind == "formulas":
        return fingerprint({"latex": _formulas(job)}, DRAWING)
    packages = (*DRAWING, *_exhibit(task.name).packages)
    return fingerprint(inputs | {"claims": _figure_claims(job, task.name)}, packages)


def _formulas(job: AuditJob) -> list[str]:
    return [claim.formula for claim in select_claims(job.claims) if claim.formula]


def _figure_claims(job: AuditJob, name: str) -> list[str]:
    return [claim for claim in job.claims if claim in claims_drawn_in(name)]


def _exhibit(name: str) -> Any:
    from tippedisk_verify.figures.exhibit_catalogue import EXHIBITS

    return next(exhibit for exhibit in EXHIBITS if exhibit.name == name)


@lru_cache(maxsize=1)
def _audit(parameters: Parameters, name: str, digits: int) -> Audit:
    """Return the `Audit` object that all tasks of this process share, which computes claims.

    It computes connections, families and panels once. ``name`` is part of the cache's key, because
    equal disks may have different names.
    """
    from tippedisk_verify.flow.taylor import Taylor

    # Compact code (loops): each compiled function runs only a few times here, and unrolled code
    # would take longer to compile than these runs.
    return Audit(parameters, Taylor(compact=True), digits)


def run_task(job: AuditJob, task: Task) -> Any:
    """Compute one task of an audit and return its result as plain data."""
    if task.kind == "formulas":
        from tippedisk_verify.figures.formula import draw_formulas

        return draw_formulas(_formulas(job))
    audit = _audit(job.parameters, job.parameters.name, job.digits)
    if task.kind == "claim":
        (claim,) = select_claims([task.name])
        return examine_claim(audit, claim).record()
    from tippedisk_verify.figures.exhibit import draw_exhibit

    return draw_exhibit(_exhibit(task.name), audit, _figure_claims(job, task.name))


def run_tasks(
    job: AuditJob,
    tasks: Sequence[Task],
    cache: Cache,
    pool: Callable[[int], AbstractContextManager[Executor | None]],
    advance: Callable[[str, int], None],
) -> tuple[dict[Task, Any], frozenset[Task]]:
    """Compute all tasks of an audit, or reuse their earlier results.

    Args:
        job: The audit.
        tasks: The tasks.
        cache: The store of earlier results.
        pool: A function that makes an executor for a number of tasks, or None to use this process
            alone.
        advance: A function that is called with a label and a number of finished tasks.

    Returns:
        The results of all tasks as plain data, and the tasks whose results were reused.
    """
    records: dict[Task, Any] = {}
    keys = {task: task_key(job, task) for task in tasks}
    for task in tasks:
        record = cache.get(keys[task])
        if record is not None:
            records[task] = record
            advance(task.name, 1)
    kept = frozenset(records)

    def keep(task: Task, record: Any) -> None:
        records[task] = record
        cache.put(keys[task], record)

    ahead = [task for task in tasks if task not in records]
    alone = [task for task in ahead if task.kind == "figure" and _exhibit(task.name).runs_alone]
    heavy = [task for task in ahead if task not in alone and not _is_cheap(task)]
    light = [task for task in ahead if _is_cheap(task)]
    with pool(len(heavy)) if len(heavy) > _MAX_TASKS_HERE else nullcontext() as executor:
        if executor is None:
            _compute_in_this_process(job, [*light, *heavy, *alone], keep, advance)
        else:
            # The tasks started last are short.
            by_cost = sorted(heavy, key=_cost, reverse=True)
            _compute_on_executor(job, by_cost, light, executor, keep, advance)
            # Measurements of run time must not share the machine with other tasks.
            _compute_on_executor(job, alone, [], executor, keep, advance)
    if ahead:
        cache.remove_unused()
    return records, kept


def _is_cheap(task: Task) -> bool:
    """Return True if a task is a claim with closed forms, which takes less time than starting a
    process.
    """
    return task.kind == "claim" and group_of(task.name) == next(iter(GROUPS))


def _cost(task: Task) -> float:
    if task.kind == "formulas":
        return 0.0
    return float(
        select_claims([task.name])[0].cost if task.kind == "claim" else _exhibit(task.name).cost
    )


def _compute_in_this_process(
    job: AuditJob,
    tasks: Sequence[Task],
    keep: Callable[[Task, Any], None],
    advance: Callable[[str, int], None],
) -> None:
    for task in tasks:
        advance(task.name, 0)
        keep(task, run_task(job, task))
        advance(task.name, 1)


def _compute_on_executor(
    job: AuditJob,
    heavy: Sequence[Task],
    light: Sequence[Task],
    executor: Executor,
    keep: Callable[[Task, Any], None],
    advance: Callable[[str, int], None],
) -> None:
    """Compute the heavy tasks of an audit on the executor, and meanwhile the light ones in this
    process.

    Each result goes to ``keep``. Tasks of a broken executor are computed here.
    """
    waiting: dict[Future[Any], Task] = {}
    try:
        waiting |= {executor.submit(run_task, job, task): task for task in heavy}
        _compute_in_this_process(job, light, keep, advance)
        while waiting:
            advance(
                ", ".join(task.name for future, task in waiting.items() if future.running())[:40], 0
            )
            finished, _ = wait(waiting, timeout=_PROGRESS_INTERVAL, return_when=FIRST_COMPLETED)
            for future in finished:
                record = future.result()
                task = waiting.pop(future)
                keep(task, record)
                advance(task.name, 1)
    except BrokenExecutor:  # a process was killed, perhaps for lack of memory: do the rest here
        done_here = set(waiting.values())
        _compute_in_this_process(job, [task for task in heavy if task in done_here], keep, advance)
