"""Carrying out the main job: each claim and each figure is a task, kept by what it depends on, done on many cores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from typing import Any, Literal

from tippedisk_verify.audit.catalogue import GROUPS, claims_drawn_in, group_of, selected
from tippedisk_verify.audit.claims import Audit, examined
from tippedisk_verify.cache import Cache
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.provenance import DRAWING, fingerprint

__all__ = ["AuditJob", "AuditRecords", "Task", "compute", "key", "run", "tasks_for"]

_FEW = 4  # tasks up to which starting processes costs more than it saves
_TICK = 0.2  # s between two looks at what is at hand


@dataclass(frozen=True)
class AuditJob:
    """What is audited."""

    parameters: Parameters
    digits: int
    claims: tuple[str, ...]


@dataclass(frozen=True)
class Task:
    """One claim, one figure, or the formulas of all claims."""

    kind: Literal["claim", "figure", "formulas"]
    name: str


@dataclass(frozen=True)
class AuditRecords:
    """What came of the tasks: plain data each, and which of them were kept from before."""

    records: dict[Task, Any]
    kept: frozenset[Task]


def tasks_for(order: AuditJob, *, figures: bool) -> tuple[Task, ...]:
    """The claims, and the figures that go with them if they are wanted."""
    tasks = [Task("claim", name) for name in order.claims]
    if figures:
        from tippedisk_verify.figures.catalogue import exhibits_for

        tasks += [Task("figure", exhibit.name) for exhibit in exhibits_for(order.claims)]
        tasks.append(Task("formulas", "formulas"))
    return tuple(tasks)


def key(order: AuditJob, task: Task) -> str:
    """Names the task's result by all that it depends on."""
    inputs: dict[str, Any] = {
        "task": asdict(task),
        "parameters": {
            item.name: str(getattr(order.parameters, item.name)) for item in fields(Parameters) if item.init
        },
        "digits": order.digits,
    }
    if task.kind == "claim":
        return fingerprint(inputs)
    if task.kind == "formulas":
        return fingerprint({"latex": _formulas(order)}, DRAWING)
    packages = (*DRAWING, *_exhibit(task.name).packages)
    return fingerprint(inputs | {"claims": _of_figure(order, task.name)}, packages)


def _formulas(order: AuditJob) -> list[str]:
    return [claim.formula for claim in selected(order.claims) if claim.formula]


def _of_figure(order: AuditJob, name: str) -> list[str]:
    return [claim for claim in order.claims if claim in claims_drawn_in(name)]


def _exhibit(name: str) -> Any:
    from tippedisk_verify.figures.catalogue import EXHIBITS

    return next(exhibit for exhibit in EXHIBITS if exhibit.name == name)


@lru_cache(maxsize=1)
def _audit(parameters: Parameters, name: str, digits: int) -> Audit:
    """What this process's tasks share: connections, families and panels are computed once in it.

    Equal disks may differ by name.
    """
    from tippedisk_verify.flow.taylor import Taylor

    # Loops: what is compiled here is run a few times only, and unrolled code takes longer to compile than these runs.
    return Audit(parameters, Taylor(compact=True), digits)


def compute(order: AuditJob, task: Task) -> Any:
    """The task's result as plain data."""
    if task.kind == "formulas":
        from tippedisk_verify.figures.formula import formulas_drawn

        return formulas_drawn(_formulas(order))
    audit = _audit(order.parameters, order.parameters.name, order.digits)
    if task.kind == "claim":
        (claim,) = selected([task.name])
        return examined(audit, claim).record()
    from tippedisk_verify.figures.exhibit import drawn

    return drawn(_exhibit(task.name), audit, _of_figure(order, task.name))


def run(
    order: AuditJob,
    tasks: Sequence[Task],
    cache: Cache,
    pool: Callable[[int], AbstractContextManager[Executor | None]],
    advance: Callable[[str, int], None],
) -> AuditRecords:
    """Every task's result. ``pool`` makes an executor for so many tasks at once, or None for this process alone."""
    records: dict[Task, Any] = {}
    keys = {task: key(order, task) for task in tasks}
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
    alone = [task for task in ahead if task.kind == "figure" and _exhibit(task.name).alone]
    heavy = [task for task in ahead if task not in alone and not _light(task)]
    light = [task for task in ahead if _light(task)]
    if len(heavy) <= _FEW:
        _here(order, [*light, *heavy, *alone], keep, advance)
    else:
        heavy.sort(key=_cost, reverse=True)  # what is started last should be short
        with pool(len(heavy)) as executor:
            if executor is None:
                _here(order, [*light, *heavy, *alone], keep, advance)
            else:
                _there(order, heavy, light, executor, keep, advance)
                # What measures run times has the machine to itself.
                _there(order, alone, [], executor, keep, advance)
    if ahead:
        cache.tidy()
    return AuditRecords(records, kept)


def _light(task: Task) -> bool:
    """Closed forms: done before a process has started."""
    return task.kind == "claim" and group_of(task.name) == next(iter(GROUPS))


def _cost(task: Task) -> float:
    if task.kind == "formulas":
        return 0.0
    return float(selected([task.name])[0].cost if task.kind == "claim" else _exhibit(task.name).cost)


def _here(
    order: AuditJob, tasks: Sequence[Task], keep: Callable[[Task, Any], None], advance: Callable[[str, int], None]
) -> None:
    for task in tasks:
        advance(task.name, 0)
        keep(task, compute(order, task))
        advance(task.name, 1)


def _there(
    order: AuditJob,
    heavy: Sequence[Task],
    light: Sequence[Task],
    executor: Executor,
    keep: Callable[[Task, Any], None],
    advance: Callable[[str, int], None],
) -> None:
    """The heavy tasks on the executor, the light ones here meanwhile."""
    waiting: dict[Future[Any], Task] = {}
    try:
        waiting |= {executor.submit(compute, order, task): task for task in heavy}
        _here(order, light, keep, advance)
        while waiting:
            advance(", ".join(task.name for future, task in waiting.items() if future.running())[:40], 0)
            finished, _ = wait(waiting, timeout=_TICK, return_when=FIRST_COMPLETED)
            for future in finished:
                record = future.result()
                task = waiting.pop(future)
                keep(task, record)
                advance(task.name, 1)
    except BrokenExecutor:  # a process was killed, for want of memory perhaps: what is left is done here
        done_here = set(waiting.values())
        _here(order, [task for task in heavy if task in done_here], keep, advance)
