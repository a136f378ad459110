"""Grades as a gate: levels that must pass, failures that are expected, and what changed between two sheets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from tippedisk_verify.conformance.grading import Grade, Tally
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable, read_text
from tippedisk_verify.reference_values.store import Store

__all__ = ["Change", "badge", "changes", "expected_failures", "shortcomings"]

_LARGEST = 4_000_000  # bytes of a list of expected failures
_LOST = 1.0  # digits
_ROUNDING = 14.0  # digits beyond which doubles differ by rounding alone
_COLOURS = {"passes": "#2e7d32", "partly": "#9a6700", "fails": "#b3261e"}


def expected_failures(path: Path, store: Store) -> frozenset[str]:
    """The ids that a file lists, one to a line; ``*`` is for any characters, and a ``#`` after a space for a comment.

    Raises InputError for a line that no question matches: it would hide nothing, or be a slip.
    """
    ids: set[str] = set()
    for line in read_text(path, _LARGEST).splitlines():
        pattern = f" {line}".split(" #", 1)[0].strip()  # a crossing's number follows a # as well
        if not pattern:
            continue
        matching = {pattern} & store.keys() or {id_ for id_ in store if fnmatchcase(id_, pattern)}
        if not matching:
            raise InputError(f"{printable(path.name)}: no question is '{printable(pattern)[:80]}'")
        ids |= matching
    return frozenset(ids)


def shortcomings(
    levels: Sequence[Tally], grades: Sequence[Grade], required: Iterable[int] | None, expected: frozenset[str]
) -> list[str]:
    """What keeps a sheet from passing: at the levels required (those answered if None), beside expected failures."""
    said = []
    wanted = [level.level for level in levels if level.answered] if required is None else list(required)
    by_level = {level.level: level for level in levels}
    for number in wanted:
        level = by_level.get(number)
        if level is None or not level.answered:
            said.append(f"level {number} is required, and was not answered")
            continue
        failed = [grade.id for grade in grades if grade.level == number and grade.failed and grade.id not in expected]
        if failed:
            said.append(
                f"level {number}, {level.name}, fails at {len(failed)} of {level.answered}, such as {failed[0]}"
            )
    return said


@dataclass(frozen=True)
class Change:
    """An answer that differs between two sheets in digits."""

    id: str
    old: Grade | None
    new: Grade | None

    @property
    def kind(self) -> str:
        """Broken (passed, and does not now), gone, mended, added, lost or gained; "" for none of them."""
        if self.old is None or self.new is None:
            return "added" if self.old is None else "gone"
        if self.old.failed != self.new.failed:
            return "mended" if self.old.failed else "broken"
        lost = _counted(self.old) - _counted(self.new)
        return "lost" if lost >= _LOST else "gained" if lost <= -_LOST else ""

    def to_dict(self) -> dict[str, Any]:
        return {"id": self.id, "change": self.kind, "old_digits": _shown(self.old), "new_digits": _shown(self.new)}


def _counted(grade: Grade) -> float:
    digits = grade.digits if math.isfinite(grade.digits) and grade.verdict != "no-truth" else 0.0
    return min(digits, _ROUNDING) if grade.reading == "doubles" else digits


def _shown(grade: Grade | None) -> float | None:
    return round(grade.digits, 1) if grade is not None and math.isfinite(grade.digits) else None


def changes(old: Iterable[Grade], new: Iterable[Grade]) -> list[Change]:
    """What changed between two sheets, worst first."""
    before, after = {grade.id: grade for grade in old}, {grade.id: grade for grade in new}
    every = [Change(id_, before.get(id_), after.get(id_)) for id_ in dict.fromkeys((*before, *after))]
    order = ("broken", "gone", "lost", "gained", "mended", "added")
    return sorted((change for change in every if change.kind), key=lambda change: order.index(change.kind))


def badge(levels: Sequence[Tally]) -> str:
    """An SVG picture that says up to which level all answers agree; *partial* if questions of these were left out."""
    answered = [level for level in levels if level.answered]
    failing = next((level.level for level in answered if level.failed), math.inf)
    passed = [level for level in answered if level.level < failing]
    if passed:
        span = passed[-1].level - passed[0].level + 1
        whole = len(passed) == span and all(level.verdict == "agrees" for level in passed)
        ends = dict.fromkeys((str(passed[0].level), str(passed[-1].level)))
        many = len(ends) > 1
        said = f"level{'s' * many} {'-'.join(ends)} {'partial' if not whole else 'agree' if many else 'agrees'}"
        colour = _COLOURS["passes" if whole and failing == math.inf else "partly"]
    else:
        said, colour = f"fails at level {failing}" if answered else "not answered", _COLOURS["fails"]
    left, right = 68, 12 + 7 * len(said)  # a letter is seven units wide at this size, or less
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img" '
        f'aria-label="tippedisk: {said}"><title>tippedisk: {said}</title>'
        f'<rect width="{left}" height="20" fill="#444"/>'
        f'<rect x="{left}" width="{right}" height="20" fill="{colour}"/>'
        '<g fill="#fff" text-anchor="middle" font-family="Verdana, DejaVu Sans, sans-serif" font-size="11">'
        f'<text x="{left / 2:g}" y="14">tippedisk</text><text x="{left + right / 2:g}" y="14">{said}</text></g></svg>\n'
    )
