"""Many draws in every arithmetic, in parallel, with a table of what was found.

    python -m tests.stress.honesty.study FOLDER --draws 600 --jobs 2

computes draws 0 to 599 of a row in each arithmetic and prints the table. What has been computed stays in FOLDER, and
the same command goes on where an earlier one was stopped. ``--table`` only prints what is there.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import statistics
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TextIO

from tests.stress.honesty.arithmetics import ARITHMETICS, DEFAULT, Arithmetic, arithmetic_named
from tests.stress.honesty.kinds import BY_SCIPY, CLOSED, IN_LANES, KINDS, ROWS, Draw, Row, drawn, kind_of
from tippedisk_verify.model.precision import heyoka_module
from tippedisk_verify.provenance import key

__all__ = ["Line", "computed", "lines", "main", "table"]

_ROOM = 2**32  # bytes for compiled code: what all arithmetics need would push each other out of the usual room
_AHEAD = 4  # tasks waiting for each process
_DRAWS_A_PROCESS = 400  # its integrators take some megabytes each: then a fresh one goes on
_CLAIMS = (
    "tippedisk_verify.flow.taylor",
    "tippedisk_verify.orbits.continuation",
    "tippedisk_verify.orbits.heteroclinic",
    "tippedisk_verify.orbits.near_connection",
    "tippedisk_verify.orbits.branch_interpolant",
)


@dataclass(frozen=True)
class Line:
    """A draw in one arithmetic, as it is kept."""

    row: Row
    seed: int
    index: int
    arithmetic: str
    kind: str
    outcome: str
    reason: str | None
    asked: str
    numbers: tuple[tuple[str, float, float, float, bool], ...]  #: name, claimed, distance, ratio, holds
    seconds: float

    @classmethod
    def of(cls, draw: Draw, row: Row, seed: int, seconds: float) -> Line:
        numbers = tuple((n.name, n.claimed, n.distance, n.ratio, n.holds) for n in draw.numbers)
        about = (draw.kind, draw.outcome, draw.reason, draw.asked)
        return cls(row, seed, draw.index, draw.arithmetic, *about, numbers, round(seconds, 2))

    @property
    def violations(self) -> tuple[tuple[str, float, float, float, bool], ...]:
        return tuple(number for number in self.numbers if not number[4])


# ------------------------------------------------------------------------------------------------ computing
def _applies(arithmetic: Arithmetic, kind: str) -> bool:
    """Whether the arithmetic could change what is claimed."""
    if arithmetic is DEFAULT:
        return True
    if kind in BY_SCIPY:
        return bool(arithmetic.environment)
    return kind not in CLOSED and (kind in IN_LANES or not arithmetic.lanes_only)


def _prepared(folder: str) -> None:
    """A process of the study: compiled code has a folder of its own."""
    store = heyoka_module().llvm_state
    Path(folder).mkdir(parents=True, exist_ok=True)
    store.set_diskcache_path(folder)
    store.set_diskcache_limit(_ROOM)


def _task(row: Row, seed: int, index: int, names: Sequence[str]) -> list[Line]:
    """A draw in several arithmetics; the truth is found once."""
    found = []
    for name in names:
        begin = time.process_time()
        draw = drawn(seed, index, arithmetic_named(name), row)
        found.append(Line.of(draw, row, seed, time.process_time() - begin))
    return found


def computed(
    folder: Path, wanted: Iterable[tuple[Row, int, int, str]], jobs: int, done: set[tuple[Row, int, int, str]]
) -> Iterator[list[Line]]:
    """Draws (row, seed, index, arithmetic) that are not among those done, as they are ready."""
    groups: dict[tuple[tuple[str, str], ...], dict[tuple[Row, int, int], list[str]]] = {}
    for row, seed, index, name in wanted:
        arithmetic = arithmetic_named(name)
        if (row, seed, index, name) not in done and _applies(arithmetic, kind_of(index, row)):
            group = groups.setdefault(tuple(sorted(arithmetic.environment.items())), {})
            group.setdefault((row, seed, index), []).append(name)
    for environment, tasks in groups.items():
        before = dict(os.environ)
        os.environ.update(environment)  # what a spawned process starts with
        try:
            yield from _spread(folder, list(tasks.items()), jobs)
        finally:
            os.environ.clear()
            os.environ.update(before)


def _spread(folder: Path, tasks: list[tuple[tuple[Row, int, int], list[str]]], jobs: int) -> Iterator[list[Line]]:
    pool = ProcessPoolExecutor(
        jobs,
        get_context("spawn"),
        initializer=_prepared,
        initargs=(str(folder / "compiled"),),
        max_tasks_per_child=_DRAWS_A_PROCESS,
    )
    waiting: set[Future[list[Line]]] = set()
    try:
        for place, names in tasks:
            waiting.add(pool.submit(_task, *place, names))
            if len(waiting) >= _AHEAD * jobs:
                ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in ready)
        while waiting:
            ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            yield from (future.result() for future in ready)
    finally:
        if waiting:  # stopped on the way: nobody waits for what they are at
            for process in list(pool._processes.values()):
                process.terminate()
        pool.shutdown(cancel_futures=True)


def _code() -> str:
    """What the claims come from."""
    return key({})


# ------------------------------------------------------------------------------------------------ what was found
def lines(journal: Path) -> list[Line]:
    """What has been computed; a last line that was cut off is left out."""
    found = []
    if journal.exists():
        for text in journal.read_text(encoding="utf-8").splitlines():
            try:
                entry = json.loads(text)
            except json.JSONDecodeError:
                continue
            if "code" not in entry:
                entry["numbers"] = tuple(tuple(number) for number in entry["numbers"])
                found.append(Line(**entry))
    return found


def table(found: Sequence[Line]) -> Iterator[str]:
    """By arithmetic and kind: numbers compared, violations, refusals, and ratios of claimed to true."""
    groups: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in found:
        groups[line.arithmetic, line.kind].append(line)
    head = f"{'arithmetic':16s} {'kind':28s} {'draws':>6s} {'refused':>7s} {'numbers':>8s} {'violated':>8s}"
    yield f"{head} {'1 %':>8s} {'median':>8s} {'99 %':>9s}"
    for arithmetic in ARITHMETICS:
        for kind in KINDS:
            if group := groups.get((arithmetic.name, kind)):
                yield _row(arithmetic.name, kind, group)
        if whole := [line for line in found if line.arithmetic == arithmetic.name]:
            yield _row(arithmetic.name, "all kinds", whole)
            yield ""


def _row(arithmetic: str, kind: str, group: Sequence[Line]) -> str:
    ratios = sorted(number[3] for line in group for number in line.numbers)
    refused = sum(line.outcome == "refused" for line in group)
    violated = sum(len(line.violations) for line in group)
    low, middle, high = (_quantile(ratios, share) for share in (0.01, 0.5, 0.99))
    head = f"{arithmetic:16s} {kind:28s} {len(group):6d} {refused:7d} {len(ratios):8d} {violated:8d}"
    return f"{head} {low:8.3g} {middle:8.3g} {high:9.3g}"


def _quantile(ratios: Sequence[float], share: float) -> float:
    return ratios[min(int(share * len(ratios)), len(ratios) - 1)] if ratios else math.nan


def _violation(line: Line) -> str:
    numbers = "; ".join(f"{name}: claimed {width:.3g}, off by {away:.3g}" for name, width, away, *_ in line.violations)
    place = f"drawn({line.seed}, {line.index}, arithmetic_named({line.arithmetic!r}), row={line.row!r})"
    return f"{line.arithmetic} | {line.kind} | {place} | {line.reason or numbers} | {line.asked}"


# ------------------------------------------------------------------------------------------------ the command
def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.stress.honesty.study", description=__doc__)
    parser.add_argument("folder", type=Path, help="where results are kept")
    parser.add_argument("--draws", type=int, default=600, help="draws of each row in each arithmetic")
    parser.add_argument("--first", type=int, default=0, help="index of the first one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--row", action="append", choices=list(ROWS), help="by default far")
    parser.add_argument(
        "--arithmetic", action="append", choices=[one.name for one in ARITHMETICS], help="by default all"
    )
    parser.add_argument("--kind", action="append", choices=KINDS, help="by default all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--table", action="store_true", help="print the table of what is there, and compute nothing")
    chosen = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # to be stopped like this is to be stopped by Ctrl-C
    try:
        return _studied(chosen)
    except KeyboardInterrupt:
        print("stopped: the same command goes on from here", file=sys.stderr)
        return 130


def _studied(chosen: argparse.Namespace) -> int:
    journal = chosen.folder / "draws.jsonl"
    chosen.folder.mkdir(parents=True, exist_ok=True)
    if not chosen.table:
        names = chosen.arithmetic or [one.name for one in ARITHMETICS]
        wanted = [
            (row, chosen.seed, index, name)
            for index in range(chosen.first, chosen.first + chosen.draws)
            for row in chosen.row or ["far"]
            for name in names
            if not chosen.kind or kind_of(index, row) in chosen.kind
        ]
        if (refusal := _run(chosen.folder, journal, wanted, chosen.jobs)) is not None:
            print(refusal, file=sys.stderr)
            return 2
    found = lines(journal)
    violated = [line for line in found if line.outcome == "violated"]
    for text in (*table(found), *map(_violation, violated)):
        print(text)
    ratios = [number[3] for line in found for number in line.numbers]
    middle = statistics.median(ratios) if ratios else math.nan
    outcomes = dict(Counter(line.outcome for line in found))
    print(f"{len(found)} draws {outcomes}, {len(ratios)} numbers, median of claimed over true {middle:.3g}")
    return 1 if violated else 0


def _run(folder: Path, journal: Path, wanted: list[tuple[Row, int, int, str]], jobs: int) -> str | None:
    """Compute what is wanted and not there; what to say if the folder holds results of other code."""
    code = _code()
    if journal.exists():
        with open(journal, encoding="utf-8") as text:
            if json.loads(text.readline()).get("code") != code:
                return f"{journal} holds results of other code or of another machine: name another folder"
    else:
        journal.write_text(json.dumps({"code": code}) + "\n", encoding="utf-8")
    done = {(line.row, line.seed, line.index, line.arithmetic) for line in lines(journal)}
    begin, count, violated = time.monotonic(), 0, 0
    _prepared(str(folder / "compiled"))  # processes that begin a new file of compiled code at once stop one another
    with open(journal, "a", encoding="utf-8") as kept:
        _ended(journal, kept)
        for ready in computed(folder, wanted, jobs, done):
            for line in ready:
                kept.write(json.dumps(line.__dict__) + "\n")
                count += 1
                if line.outcome == "violated":
                    violated += 1
                    print(_violation(line), file=sys.stderr, flush=True)
            kept.flush()
            if sys.stderr.isatty():
                print(
                    f"\r{count} draws, {violated} violated, {time.monotonic() - begin:.0f} s", end="", file=sys.stderr
                )
    return None


def _ended(journal: Path, kept: TextIO) -> None:
    """A line that was cut off is ended, so that the next one stands by itself."""
    if not journal.read_bytes().endswith(b"\n"):
        kept.write("\n")


if __name__ == "__main__":
    sys.exit(main())
