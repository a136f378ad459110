"""Grades as a gate: levels that must pass, expected failures, and changes between two sheets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from tippedisk_verify.conformance.grading import Grade, Tally
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.store import Store, is_optional
from tippedisk_verify.support.files import printable, read_text

__all__ = ["GradeChange", "badge", "expected_failures", "grade_changes", "shortcomings"]

_MAX_LIST_BYTES = 4_000_000  # bytes of a list of expected failures
_MIN_DIGIT_CHANGE = 1.0  # digits that count as a change
_MAX_DOUBLE_DIGITS = 14.0  # digits beyond which doubles differ by rounding alone
_COLOURS = {"passes": "#2e7d32", "partly": "#9a6700", "fails": "#b3261e"}


def expected_failures(path: Path, store: Store) -> frozenset[str]:
    """Return the ids of the questions that a file lists, one id or pattern to a line.

    ``*`` stands for any characters, and a ``#`` after a space begins a comment.

    Args:
        path: The file.
        store: The questions.

    Raises:
        InputError: If a line matches no question.
    """
    ids: set[str] = set()
    for line in read_text(path, _MAX_LIST_BYTES).splitlines():
        pattern = f" {line}".split(" #", 1)[0].strip()  # a crossing's number follows a # as well
        if not pattern:
            continue
        matching = {pattern} & store.keys() or {id_ for id_ in store if fnmatchcase(id_, pattern)}
        if not matching:
            raise InputError(f"{printable(path.name)}: no question is '{printable(pattern)[:80]}'")
        ids |= matching
    return frozenset(ids)


def shortcomings(
    levels: Sequence[Tally],
    grades: Sequence[Grade],
    required: Iterable[int] | None,
    expected: frozenset[str],
) -> list[str]:
    """Return the reasons why a sheet of answers does not pass, one sentence each; [] if it passes.

    A required level without an answer is a reason too. Optional questions do not count.

    Args:
        levels: The tallies of the levels.
        grades: The grades.
        required: The levels that must pass; None for those that were answered.
        expected: The ids of answers that may fail.
    """
    reasons = []
    required_levels = (
        [level.level for level in levels if level.answered] if required is None else list(required)
    )
    by_level = {level.level: level for level in levels}
    for number in required_levels:
        level = by_level.get(number)
        if level is None or not level.answered:
            reasons.append(f"level {number} is required, and was not answered")
            continue
        failed = [
            grade.id
            for grade in grades
            if grade.level == number
            and grade.failed
            and grade.id not in expected
            and not is_optional(grade.id)
        ]
        if failed:
            reasons.append(
                f"level {number}, {level.name}, fails at {len(failed)} of {level.answered}, such "
                f"as {failed[0]}"
            )
    return reasons


@dataclass(frozen=True)
class GradeChange:
    """The grades of a question in an earlier and a later sheet of answers, for comparison."""

    id: str
    old: Grade | None
    new: Grade | None

    @property
    def kind(self) -> str:
        """The kind of the change: broken, gone, mended, added, lost or gained; "" for no change.

        A broken answer passed before and fails now; a mended one is the reverse. Lost and gained
        answers have at least one digit less or more.
        """
        if self.old is None or self.new is None:
            return "added" if self.old is None else "gone"
        if self.old.failed != self.new.failed:
            return "mended" if self.old.failed else "broken"
        lost = _comparable_digits(self.old) - _comparable_digits(self.new)
        return (
            "lost" if lost >= _MIN_DIGIT_CHANGE else "gained" if lost <= -_MIN_DIGIT_CHANGE else ""
        )

    def to_dict(self) -> dict[str, Any]:
        return {
            "id": self.id,
            "change": self.kind,
            "old_digits": _digits_for_json(self.old),
            "new_digits": _digits_for_json(self.new),
        }


def _comparable_digits(grade: Grade) -> float:
    digits = grade.digits if math.isfinite(grade.digits) and grade.verdict != "no-truth" else 0.0
    return min(digits, _MAX_DOUBLE_DIGITS) if grade.reading == "doubles" else digits


def _digits_for_json(grade: Grade | None) -> float | None:
    return round(grade.digits, 1) if grade is not None and math.isfinite(grade.digits) else None


def grade_changes(old: Iterable[Grade], new: Iterable[Grade]) -> list[GradeChange]:
    """Return the questions whose grades changed between two sheets of answers, worst changes first.

    Optional answers do not count.

    Args:
        old: The grades of the earlier sheet.
        new: The grades of the later sheet.
    """
    before, after = {grade.id: grade for grade in old}, {grade.id: grade for grade in new}
    every = [
        GradeChange(id_, before.get(id_), after.get(id_))
        for id_ in dict.fromkeys((*before, *after))
        if not is_optional(id_)
    ]
    order = ("broken", "gone", "lost", "gained", "mended", "added")
    return sorted(
        (change for change in every if change.kind), key=lambda change: order.index(change.kind)
    )


def badge(levels: Sequence[Tally]) -> str:
    """Return a picture, as the text of an SVG file, with the levels up to which all answers agree.

    It shows *partial* if questions of these levels were left out.

    Args:
        levels: The tallies of the levels.
    """
    answered = [level for level in levels if level.answered]
    failing = next((level.level for level in answered if level.failed), math.inf)
    passed = [level for level in answered if level.level < failing]
    if passed:
        span = passed[-1].level - passed[0].level + 1
        whole = len(passed) == span and all(level.verdict == "agrees" for level in passed)
        ends = dict.fromkeys((str(passed[0].level), str(passed[-1].level)))
        noun, verb = ("levels", "agree") if len(ends) > 1 else ("level", "agrees")
        text = f"{noun} {'-'.join(ends)} {verb if whole else 'partial'}"
        colour = _COLOURS["passes" if whole and failing == math.inf else "partly"]
    else:
        text, colour = (
            f"fails at level {failing}" if answered else "not answered",
            _COLOURS["fails"],
        )
    left, right = 68, 12 + 7 * len(text)  # a letter is at most seven units wide at this size
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img" '
        f'aria-label="tippedisk: {text}"><title>tippedisk: {text}</title>'
        f'<rect width="{left}" height="20" fill="#444"/>'
        f'<rect x="{left}" width="{right}" height="20" fill="{colour}"/>'
        '<g fill="#fff" text-anchor="middle" font-family="Verdana, DejaVu Sans, sans-serif" font-size="11">'
        f'<text x="{left / 2:g}" y="14">tippedisk</text><text x="{left + right / 2:g}" y="14">{text}</text></g></svg>\n'
    )
