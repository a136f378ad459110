"""Asking a program question by question: what it answers, how long it takes, and what it does beside answering."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from statistics import median
from typing import Any

from tippedisk_verify.conformance.dialogue import Program
from tippedisk_verify.conformance.grading import Grade, graded
from tippedisk_verify.conformance.sheet import Answers, Row, answer_line, collected, question_row
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["Interview"]


class Interview:
    """A conversation with a program about the questions asked; everything that it said that counts."""

    def __init__(self, program: Program, store: Store, reading: str | None = None) -> None:
        self.program = program
        self.rows: list[Row] = []  #: its answers to the questions, in its order
        self.grades: list[Grade] = []
        self.start_up: float | None = None  #: [s] until the first answer
        self.broke_off = ""  #: why not all questions were asked
        self._store, self._reading = store, reading
        self._asked: set[str] = set()
        self._counted: set[str] = set()
        self._open: dict[str, None] = {}
        self._got: list[Row] = []
        self._noted: dict[str, tuple[int, str]] = {}  # what it said beside: how often, and the first
        self._times: list[tuple[Quantity, int, float]] = []  # one question of an entry, its answers, seconds
        self._end = ""

    def exchange(self, questions: Iterable[Mapping[str, str]]) -> tuple[list[Row], float]:
        """The answers to questions that are asked at once, and the seconds until the last; fewer if it breaks off."""
        self._got = []
        if self.broke_off:
            return [], math.nan
        rows = list(questions)
        self._open = dict.fromkeys(row["id"] for row in rows)
        self._asked |= self._open.keys()
        begin = time.perf_counter()
        self.broke_off = self.program.ask("".join(json.dumps(row) + "\n" for row in rows), self._open, self._take)
        seconds = time.perf_counter() - begin
        if self.broke_off:
            before = len(self._got)
            self.program.finish(self._take)
            if len(self._got) > before:
                self.broke_off += "; answers came when its input had ended: it must flush its output after each line"
        return self._got, seconds

    def conduct(self, asked: Sequence[Quantity], first: Quantity, advance: Callable[[str, int], None]) -> None:
        """Ask all; ``first`` is asked before, by itself, and its answer counts only if it is one of them.

        Raises InputError for a program that breaks off before it has answered anything.
        """
        self._counted = {quantity.id for quantity in asked}
        opening, _ = self.exchange([question_row(self._store, first)])
        if not opening:
            said = self.program.errors()
            raise InputError(self.broke_off + (f": {said[-1]}" if said else ""))
        self.start_up = time.perf_counter() - self.program.begun
        failed = 0
        for _, group in groupby(asked, key=lambda quantity: quantity.id.rsplit("/", 1)[0]):
            questions = {quantity.id: quantity for quantity in group}
            mine = [row for row in opening if row[0] in questions]
            got, seconds = self.exchange(
                question_row(self._store, one) for one in questions.values() if one.id != first.id
            )
            if (given := sum(bool(row[2]) for row in got)) and not self.broke_off:
                self._times.append((next(iter(questions.values())), given, seconds))
            grades = graded(collected([*mine, *got], self._store, self._reading, Answers()), questions)
            self.grades += grades
            failed += sum(grade.failed for grade in grades)
            level = next(iter(questions.values())).level
            advance(f"level {level}: {len(self.grades)} graded, {failed} of them fail", len(questions))
            if self.broke_off:
                break

    def finish(self) -> None:
        """End the program's input, which should end it."""
        if not self.broke_off:
            self._end = self.program.finish(self._take)

    def answers(self) -> Answers:
        """All answers to the reference questions, those of a program that has broken off included."""
        return collected(self.rows, self._store, self._reading, Answers())

    def sheet(self) -> str:
        """The answers as a sheet that `conformance grade` reads, one to a line."""
        return "".join(json.dumps({"id": row[0], "from": row[1], "answer": row[2]}) + "\n" for row in self.rows)

    def times(self) -> list[dict[str, Any]]:
        """Seconds by level and kind, in the order asked.

        An entry is what the questions whose ids differ only in their last part are about: a state, a trajectory, a
        cycle. Those with no other answer than null do not count.
        """
        kinds: dict[tuple[int, str], list[tuple[Quantity, int, float]]] = {}
        for one in self._times:
            kinds.setdefault((one[0].level, one[0].kind), []).append(one)
        return [
            {
                "level": level,
                "kind": kind,
                "answered": sum(answered for _, answered, _ in ones),
                "entries": len(ones),
                "total": math.fsum(seconds for *_, seconds in ones),
                "median": median(seconds for *_, seconds in ones),
                "largest": max(seconds for *_, seconds in ones),
                "longest": max(ones, key=lambda one: one[2])[0].id.rsplit("/", 1)[0],
            }
            for (level, kind), ones in kinds.items()
        ]

    def remarks(self) -> list[str]:
        """What the program did beside answering."""
        said = [self.broke_off or self._end]
        said += [f"{what}: {count}, the first {first}" for what, (count, first) in self._noted.items()]
        return [one for one in said if one]

    def _take(self, line: str) -> None:
        row = answer_line(line)
        if row is None:
            if line.strip():
                self._note("lines that are no answer", repr(printable(line.strip()[:80])))
        elif row[0] in self._open:
            del self._open[row[0]]
            self._got.append(row)
            if row[0] in self._counted:
                self.rows.append(row)
        elif row[0] in self._asked:
            self._note("second answers, of which the first counts", printable(row[0][:120]))
        else:
            self._note("answers to what was not asked", printable(row[0][:120]))

    def _note(self, what: str, which: str) -> None:
        count, first = self._noted.get(what, (0, which))
        self._noted[what] = count + 1, first
