"""Doing a sweep: points run on any `concurrent.futures.Executor`, and nothing that has been computed is lost.

Each row goes to a journal beside the output as soon as it is there, so that an interrupted sweep goes on where it
stopped and no point is computed twice. The journal says which code its rows come from, and so does each row that
another process sends: rows of other code are refused. The output is written once, whole, in the order of the points,
when all are there.
"""

from __future__ import annotations

import io
import itertools
import json
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from tippedisk_verify.checksums import digest
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.files import alone, write_bytes, write_csv
from tippedisk_verify.fingerprint import unlike
from tippedisk_verify.interrupts import undoing
from tippedisk_verify.sweep.answers import Compared
from tippedisk_verify.sweep.plan import Plan, computed, here

__all__ = ["swept"]

_LONGEST_LINE = 1_000_000  # bytes of a journal's line
_WAITING = 4  # points for each worker that are handed out ahead
_REVIVALS = 5  # of a pool whose processes died


def swept(
    plan: Plan,
    out: Path,
    *,
    pool: Callable[[], AbstractContextManager[Executor | None]],
    workers: int = 1,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> tuple[int, int]:
    """Run the plan and write ``out`` (.csv or .parquet); returns (points, those of them that have no numbers).

    ``pool`` makes the executor, anew if its processes died. What an interrupted run of the same plan left in the
    journal is taken up. Raises InputError for an unknown kind of file or a journal of another plan or other code,
    Shortfall where the executor fails or has other code.
    """
    if out.suffix.lower() not in (".csv", ".parquet"):
        raise InputError(f"'{out.name}' must end in .csv or .parquet")
    if out.suffix.lower() == ".parquet":
        _arrow()
    journal = out.with_name(f".{out.name}.journal")
    with alone(journal, f"another run is sweeping into {out}: wait for it, or give another --out"):
        points = list(plan.points())
        rows = _taken_up(journal, plan, points)

        def discard() -> None:
            if not rows:  # nothing is lost with it
                journal.unlink(missing_ok=True)

        advance("taken up", len(rows))
        try:
            with undoing(discard):
                return _swept(plan, out, journal, points, rows, pool, workers, advance)
        except BaseException:
            discard()
            raise


def _swept(
    plan: Plan,
    out: Path,
    journal: Path,
    points: Sequence[dict[str, str]],
    rows: dict[int, dict[str, str]],
    pool: Callable[[], AbstractContextManager[Executor | None]],
    workers: int,
    advance: Callable[[str, int], None],
) -> tuple[int, int]:
    with open(journal, "a", encoding="utf-8") as stream:
        if not stream.tell():
            stream.write(_head(plan).decode())

        def keep(index: int, row: dict[str, str]) -> None:
            rows[index] = row
            stream.write(_line(index, row))
            stream.flush()
            os.fsync(stream.fileno())
            advance(row["status"][:40], 1)

        def kept() -> str:
            return f"{len(rows)} of {len(points)} points are kept: run again to go on"

        for attempt in range(_REVIVALS + 1):
            missing = [index for index in range(len(points)) if index not in rows]
            try:
                with pool() as executor:
                    _run(plan, points, missing, executor, workers, keep)
                break
            except BrokenProcessPool:
                if attempt == _REVIVALS:
                    raise Shortfall(f"the processes died {_REVIVALS + 1} times; {kept()}") from None
            except Shortfall as fault:
                raise Shortfall(f"{fault}; {kept()}") from None
    _write(out, [rows[index] for index in range(len(points))])
    journal.unlink()
    return len(points), sum(row["status"] != "ok" for row in rows.values())


def _run(
    plan: Plan,
    points: Sequence[dict[str, str]],
    missing: Sequence[int],
    executor: Executor | None,
    workers: int,
    keep: Callable[[int, dict[str, str]], None],
) -> None:
    if executor is None:
        for index in missing:
            keep(index, computed(plan, points[index]))
        return
    ahead = iter(missing)
    waiting: dict[Future[Any], int] = {}
    with Compared(executor) as answers:
        try:
            while True:
                for index in itertools.islice(ahead, max(1, _WAITING * workers - len(waiting))):
                    waiting[answers.submit(computed, plan, points[index])] = index
                if not waiting:
                    return
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    keep(waiting[future], future.result())
                    del waiting[future]
        finally:
            for future, index in waiting.items():  # whatever has ended this
                if future.done() and not future.cancelled() and not future.exception():
                    keep(index, future.result())


def _taken_up(journal: Path, plan: Plan, points: Sequence[Mapping[str, str]]) -> dict[int, dict[str, str]]:
    """Rows that an interrupted run has left; cut off from the first line on whose checksum does not fit.

    That is the line that was being written when it ended. Raises InputError if the file does not begin as a journal of
    this plan and this code: it is another's.
    """
    if not journal.exists():
        return {}
    rows: dict[int, dict[str, str]] = {}
    with open(journal, "r+b") as stream:
        first, head = stream.readline(_LONGEST_LINE), _head(plan)
        if not head.startswith(first):
            raise InputError(f"{journal} {_belonging(first, plan)}")
        whole = len(first) if first == head else 0
        while whole and (kept := _kept(line := stream.readline(_LONGEST_LINE), len(points))):
            rows[kept[0]] = kept[1]
            whole += len(line)
        stream.truncate(whole)
    return rows


def _head(plan: Plan) -> bytes:
    return (json.dumps({"plan": plan.key, "origin": here()}) + "\n").encode()


def _belonging(first: bytes, plan: Plan) -> str:
    """What a journal that does not begin as it should belongs to, and what to do about it."""
    try:
        head = json.loads(first)
        if head["plan"] == plan.key and (difference := unlike(head["origin"], here())):
            return f"has rows from {difference}: go on with that, or remove the file to compute them anew"
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass
    return "belongs to another sweep: remove it, or give another --out"


def _line(index: int, row: Mapping[str, str]) -> str:
    return json.dumps({"point": index, "row": row, "checksum": digest([index, row])[:16]}) + "\n"


def _kept(line: bytes, count: int) -> tuple[int, dict[str, str]] | None:
    """The point and the row of a journal's line, if it is as `_line` wrote it."""
    try:
        entry = json.loads(line)
        index, row = entry["point"], entry["row"]
        good = line.endswith(b"\n") and entry["checksum"] == digest([index, row])[:16] and 0 <= index < count
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return (index, row) if good and isinstance(row, dict) else None


def _columns(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """All columns in order of appearance, the status before the numbers."""
    return list(dict.fromkeys(name for row in rows for name in row))


def _write(out: Path, rows: Sequence[Mapping[str, str]]) -> None:
    columns = _columns(rows)
    if out.suffix.lower() == ".csv":
        write_csv(out, columns, [[row.get(name, "") for name in columns] for row in rows])
        return
    arrow, parquet = _arrow()
    # Decimal strings, as everywhere: a double would lose digits.
    table = arrow.table({name: [row.get(name) for row in rows] for name in columns})
    stream = io.BytesIO()
    parquet.write_table(table, stream)
    write_bytes(out, stream.getvalue())


def _arrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("Parquet needs pyarrow: pip install 'tippedisk-verify[cluster]', or write .csv") from None
    return pyarrow, pyarrow.parquet
