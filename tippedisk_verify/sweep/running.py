"""The execution of a sweep on any `concurrent.futures.Executor`.

Each row is written to a journal next to the output as soon as it is computed. An interrupted sweep
continues where it stopped, and no point is computed twice. The journal's first line identifies the
plan and the code that computed the rows. The output is written when all rows exist, in the order of
the points.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager
from itertools import islice
from pathlib import Path

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.support.files import file_lock, write_table
from tippedisk_verify.support.interrupts import clean_up_on_ctrl_c
from tippedisk_verify.support.provenance import code_version
from tippedisk_verify.sweep.plan import SweepPlan, run_analysis

__all__ = ["run_sweep"]

_MAX_LINE = 1_000_000  # bytes of a line of the journal
# The number of points submitted at a time, so that a long sweep does not fill the memory
_MAX_QUEUED_POINTS = 256
Row = dict[str, str]
ExecutorFactory = Callable[[], AbstractContextManager[Executor | None]]


def run_sweep(
    plan: SweepPlan,
    out: Path,
    workers: ExecutorFactory,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> tuple[int, int]:
    """Run a parameter sweep and write its table to a file.

    Args:
        plan: The sweep.
        out: The output file, .csv or .parquet. The rows of an interrupted run of the same plan are
            reused.
        workers: A function that makes the executor, called again if its processes die. None as the
            executor means this process.
        advance: A function that is called with a label and a number of points.

    Returns:
        The number of points, and the number of them without results.

    Raises:
        InputError: If the journal belongs to another plan or to other code.
        AccuracyError: If the executor fails, or its workers have other code.
    """
    journal = out.with_name(f".{out.name}.journal")
    with file_lock(
        journal, f"another run is sweeping into {out}: wait for it, or give another --out"
    ):
        rows = _read_journal(journal, plan)
        advance("resumed", len(rows))

        def discard() -> None:
            if not rows:  # nothing is lost with it
                journal.unlink(missing_ok=True)

        try:
            with clean_up_on_ctrl_c(discard):
                for row in _compute_rows(plan, journal, rows, workers):
                    advance(row["status"][:40], 1)
        finally:
            discard()
        write_table(out, [rows[index] for index in range(len(plan))])
        journal.unlink()
    return len(rows), sum(row["status"] != "ok" for row in rows.values())


def _compute_rows(
    plan: SweepPlan, journal: Path, rows: dict[int, Row], workers: ExecutorFactory
) -> Iterator[Row]:
    """Compute the missing rows of a sweep's table, and yield each one after it has been written to
    the journal and added to ``rows``.

    The executor is made again if its processes die. Raises AccuracyError if that yields no row, or
    its workers have other code.
    """
    with open(journal, "ab") as stream:
        if not stream.tell():
            stream.write(_journal_header(plan))

        def keep(index: int, row: Row) -> Row:
            rows[index] = row
            stream.write(_journal_line(index, row))
            stream.flush()
            return row

        while (before := len(rows)) < len(plan):
            missing = (
                (index, point) for index, point in enumerate(plan.points()) if index not in rows
            )
            try:
                with workers() as executor:
                    yield from (keep(index, row) for index, row in _run(plan, missing, executor))
            except (BrokenExecutor, AccuracyError) as fault:
                if isinstance(fault, AccuracyError) or len(rows) == before:
                    kept = f"{len(rows)} of {len(plan)} points are kept: run again to go on"
                    raise AccuracyError(f"{fault}; {kept}") from None


def _run(
    plan: SweepPlan, missing: Iterator[tuple[int, Row]], executor: Executor | None
) -> Iterator[tuple[int, Row]]:
    """Compute the missing points of a sweep, and yield the index and the row of each as soon as it
    is computed.
    """
    asked = plan.analysis, plan.disk, plan.digits
    if executor is None:
        yield from ((index, run_analysis(*asked, point)) for index, point in missing)
        return
    waiting: dict[Future[Row], int] = {}
    while True:
        for index, point in islice(missing, _MAX_QUEUED_POINTS - len(waiting)):
            waiting[executor.submit(run_analysis, *asked, point)] = index
        if not waiting:
            return
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            yield waiting.pop(future), future.result()


# ------------------------------------------------------------------------------------------- files
def _journal_header(plan: SweepPlan) -> bytes:
    return json.dumps({"plan": plan.key, "code": code_version()}).encode() + b"\n"


def _journal_line(index: int, row: Mapping[str, str]) -> bytes:
    checksum = zlib.crc32(json.dumps([index, row]).encode())
    return json.dumps({"point": index, "row": row, "checksum": checksum}).encode() + b"\n"


def _read_journal(journal: Path, plan: SweepPlan) -> dict[int, Row]:
    """Read the journal of an interrupted sweep, and return its rows by index.

    The file is truncated at the first line that `_journal_line` did not write.

    Raises:
        InputError: If the first line does not match this plan and this code.
    """
    rows: dict[int, Row] = {}
    with open(journal, "r+b") as stream:
        first, head = stream.readline(_MAX_LINE), _journal_header(plan)
        if not head.startswith(first):
            same_plan = first.partition(b",")[0] == head.partition(b",")[0]
            whose = "other code, named in its first line" if same_plan else "another sweep"
            raise InputError(
                f"{journal} has rows of {whose}: go on with that, remove the file, or "
                f"give another --out"
            )
        whole = len(first) if first == head else 0
        for line in iter(lambda: stream.readline(_MAX_LINE), b"") if whole else ():
            try:
                entry = json.loads(line)
                index, row = entry["point"], entry["row"]
                if line != _journal_line(index, row):
                    break
            except (ValueError, KeyError, TypeError, RecursionError):
                break
            rows[index] = row
            whole += len(line)
        stream.truncate(whole)
    return rows
