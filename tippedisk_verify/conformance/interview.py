"""The interview of a program: its answers, its run times, and remarks on whatever else it does."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from statistics import median
from typing import Any

from tippedisk_verify.conformance.grading import Grade, grade_answers
from tippedisk_verify.conformance.sheet import (
    Answers,
    Row,
    collect_answers,
    parse_answer_line,
    question_row,
)
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.store import ReferenceValue, Store
from tippedisk_verify.support.dialogue import Program
from tippedisk_verify.support.files import printable

__all__ = ["Interview"]


class Interview:
    """A conversation with a program: the questions asked, and every answer that counts.

    Args:
        program: The running program.
        store: The questions with their truths.
        reading: The inputs of answers that do not name them, decimals or doubles.
    """

    def __init__(self, program: Program, store: Store, reading: str | None = None) -> None:
        self.program = program
        self.answer_rows: list[Row] = []  #: its answers to the questions, in its order
        self.grades: list[Grade] = []
        self.start_up: float | None = None  #: [s] until the first answer
        self.break_off_reason = ""  #: why not all questions were asked
        self._store, self._reading = store, reading
        self._asked_ids: set[str] = set()
        self._counted_ids: set[str] = set()
        self._unanswered_ids: dict[str, None] = {}
        self._received: list[Row] = []
        # Other output by what it is: how often, and the first
        self._other_output: dict[str, tuple[int, str]] = {}
        self._timings: list[
            tuple[ReferenceValue, int, float]
        ] = []  # question, answers, seconds, by entry
        self._abnormal_end = ""

    def ask(self, questions: Iterable[Mapping[str, str]]) -> tuple[list[Row], float]:
        """Ask the program several questions together, and wait for its answers.

        Args:
            questions: The questions, each by columns.

        Returns:
            The answers, fewer if the program breaks off, and the seconds until the last one.
        """
        self._received = []
        if self.break_off_reason:
            return [], math.nan
        rows = list(questions)
        self._unanswered_ids = dict.fromkeys(row["id"] for row in rows)
        self._asked_ids |= self._unanswered_ids.keys()
        begin = time.perf_counter()
        self.break_off_reason = self.program.ask(
            "".join(json.dumps(row) + "\n" for row in rows),
            self._unanswered_ids,
            self._receive_line,
        )
        seconds = time.perf_counter() - begin
        if self.break_off_reason:
            before = len(self._received)
            self.program.finish(self._receive_line)
            if len(self._received) > before:
                late = "; answers came when its input had ended: it must flush its output after each line"
                self.break_off_reason += late
        return self._received, seconds

    def ask_all(
        self,
        asked_questions: Sequence[ReferenceValue],
        first: ReferenceValue,
        advance: Callable[[str, int], None],
    ) -> None:
        """Ask the program all questions in turn, grade the answers, and keep grades and times on
        this object.

        Args:
            asked_questions: The questions.
            first: The question that is asked before them, alone, to time the start-up. Its answer
                counts only if it is one of them.
            advance: A function that is called with the progress in words and the number of new
                questions.

        Raises:
            InputError: If the program breaks off before it has answered anything.
        """
        self._counted_ids = {quantity.id for quantity in asked_questions}
        first_answers, _ = self.ask([question_row(self._store, first)])
        if not first_answers:
            raise InputError(self.program.end_reason(self.break_off_reason))
        self.start_up = time.perf_counter() - self.program.begun
        failed = 0
        for _, group in groupby(
            asked_questions, key=lambda quantity: quantity.id.rsplit("/", 1)[0]
        ):
            questions = {quantity.id: quantity for quantity in group}
            mine = [row for row in first_answers if row[0] in questions]
            got, seconds = self.ask(
                question_row(self._store, question)
                for question in questions.values()
                if question.id != first.id
            )
            if (answered := sum(bool(row[2]) for row in got)) and not self.break_off_reason:
                self._timings.append((next(iter(questions.values())), answered, seconds))
            answers = collect_answers([*mine, *got], self._store, self._reading, Answers())
            grades = grade_answers(
                answers, {id_: self._store[id_] for id_ in questions if id_ in answers.by_id}
            )
            self.grades += grades
            failed += sum(grade.failed for grade in grades)
            level = next(iter(questions.values())).level
            advance(
                f"level {level}: {len(self.grades)} graded, {failed} of them fail", len(questions)
            )
            if self.break_off_reason:
                break

    def finish(self) -> None:
        """Close the program's input, so that it ends, and keep a remark on an abnormal end."""
        if not self.break_off_reason:
            self._abnormal_end = self.program.finish(self._receive_line)

    def answers(self) -> Answers:
        """Return all answers that the program has given so far to the questions that count, even if
        it broke off.
        """
        return collect_answers(self.answer_rows, self._store, self._reading, Answers())

    def answers_as_json_lines(self) -> str:
        """Return the program's answers as lines of JSON, as `conformance grade` reads them.

        Each line is an object with the keys id, from and answer.
        """
        return "".join(
            json.dumps({"id": row[0], "from": row[1], "answer": row[2]}) + "\n"
            for row in self.answer_rows
        )

    def times(self) -> list[dict[str, Any]]:
        """Return the program's run times [s] by level and kind, in the order of the questions.

        The questions about one state, trajectory or cycle are one entry. Their ids differ only in
        the last part. An entry without an answer other than null does not count.
        """
        kinds: dict[tuple[int, str], list[tuple[ReferenceValue, int, float]]] = {}
        for timing in self._timings:
            kinds.setdefault((timing[0].level, timing[0].kind), []).append(timing)
        return [
            {
                "level": level,
                "kind": kind,
                "answered": sum(answered for _, answered, _ in timings),
                "entries": len(timings),
                "total": math.fsum(seconds for *_, seconds in timings),
                "median": median(seconds for *_, seconds in timings),
                "largest": max(seconds for *_, seconds in timings),
                "longest": max(timings, key=lambda timing: timing[2])[0].id.rsplit("/", 1)[0],
            }
            for (level, kind), timings in kinds.items()
        ]

    def remarks(self) -> list[str]:
        """Return remarks on what the program did apart from answering, such as other lines that it
        wrote.
        """
        remarks = [self.break_off_reason or self._abnormal_end]
        remarks += [
            f"{what}: {count}, the first {first}"
            for what, (count, first) in self._other_output.items()
        ]
        return [remark for remark in remarks if remark]

    def _receive_line(self, line: str) -> None:
        row = parse_answer_line(line)
        if row is None:
            if line.strip():
                self._note_other_output(
                    "lines that are not answers", repr(printable(line.strip()[:80]))
                )
        elif row[0] in self._unanswered_ids:
            del self._unanswered_ids[row[0]]
            self._received.append(row)
            if row[0] in self._counted_ids:
                self.answer_rows.append(row)
        elif row[0] in self._asked_ids:
            self._note_other_output("second answers, which do not count", printable(row[0][:120]))
        else:
            self._note_other_output(
                "answers to questions that were not asked", printable(row[0][:120])
            )

    def _note_other_output(self, what: str, which: str) -> None:
        count, first = self._other_output.get(what, (0, which))
        self._other_output[what] = count + 1, first
