"""What is wrong with answers that fail: the one mistake that gives all of them, or nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tippedisk_verify.conformance.engine.cycles import cycle_causes
from tippedisk_verify.conformance.engine.entries import Sheet, Table, tables_of
from tippedisk_verify.conformance.engine.orbits import orbit_causes
from tippedisk_verify.conformance.engine.relations import related
from tippedisk_verify.conformance.engine.search import Cause, Search
from tippedisk_verify.conformance.engine.specimen import specimen
from tippedisk_verify.conformance.engine.ways import ways
from tippedisk_verify.conformance.grading import LEVEL_NAMES, Grade
from tippedisk_verify.reference_values.store import Store

__all__ = ["Diagnosis", "diagnosed"]

_SECONDS = 8.0  # of the processor for changes of formulas, and as many for numbers that are solved for
_ORBITS = 6  # the first level whose answers are flown
_PROVED = 40  # right answers to a kind of questions, after which the functions behind them are beyond doubt
_MOST = 3  # causes that are named together


@dataclass(frozen=True)
class Diagnosis:
    """The first level that fails for some parameter sets and friction laws, and why, where that can be told."""

    level: int
    sets: tuple[str, ...]
    frictions: tuple[str, ...]
    failed: frozenset[str]  #: ids
    found: tuple[Cause, ...]  #: several if they cannot be told apart; () if none is known
    tried: int  #: how many of the failed ones the cause gives
    no_numbers: int  #: how many of the failed ones are no finite number, which no mistake predicts
    where: str = ""  #: if no cause is known: a condition that the wrong answers satisfy and the right ones do not

    @property
    def causes(self) -> tuple[tuple[str, str], ...]:
        return tuple((cause.name, cause.says) for cause in self.found)

    def says(self) -> str:
        both = len(self.frictions) > 1 or self.frictions == ("both",)
        laws = "both laws" if both else f"{self.frictions[0]} friction"
        where = f"level {self.level}, {LEVEL_NAMES[self.level]} ({' and '.join(self.sets)}, {laws}): "
        where += f"{len(self.failed)} wrong"
        if self.no_numbers:
            where += f", {self.no_numbers} of them no finite number"
        if self.no_numbers == len(self.failed):
            return where
        if not self.found:
            text = f"{where}; unexplained: no single mistake that is tried gives these answers"
            return text + f"; they are wrong where {self.where}, and only there" * bool(self.where)
        causes = " or ".join(cause.says for cause in self.found)
        return f"{where}; likely cause: {causes} (gives all {self.tried} of them that it was tried on)"


def diagnosed(
    grades: Iterable[Grade], store: Store, advance: Callable[[str, int], None] = lambda label, steps: None
) -> list[Diagnosis]:
    """For each set and law the first level that fails; sets and laws that fail at the same level together."""
    grades = list(grades)
    tables = tables_of(grades, store)
    first: dict[tuple[str, str], int] = {}
    for grade in grades:
        if grade.failed:
            set_name, friction = _place(grade)
            for law in ("linear", "smooth") if friction == "both" else (friction,):
                first[set_name, law] = min(grade.level, first.get((set_name, law), 99))
    diagnoses = []
    for level in sorted(set(first.values())):
        here = [key for key, at in first.items() if at == level]
        diagnoses.append(_diagnosis(level, here, tables, grades, advance))
    return diagnoses


def _diagnosis(
    level: int, here: Sequence[tuple[str, str]], tables: Sequence[Table], grades: Sequence[Grade], advance: Any
) -> Diagnosis:
    laws = {law for _, law in here} | {"both"}
    sets = {name for name, _ in here}
    parts = [table for table in tables if table.level == level and table.friction in laws]
    sheet = Sheet(tuple(parts)).where(lambda table: np.flatnonzero(np.isin(table.sets, list(sets))))
    places = {(name, law) for name in sets for law in laws}
    failed = [grade for grade in grades if grade.failed and grade.level == level and _place(grade) in places]
    faulty = {table.kind for table in tables if table.wrong.any()}
    earlier = [table for table in tables if table.level < level and len(table.names) >= _PROVED]
    passed = {table.kind for table in earlier} - faulty
    found = causes_of(sheet, passed, advance) if sheet.tables and sheet.wrong.any() else []
    wrong = int(sheet.wrong.sum()) if sheet.tables else 0
    return Diagnosis(
        level, tuple(sorted(sets)), tuple(sorted({law for _, law in here})), frozenset(grade.id for grade in failed),
        tuple(found if len(found) <= _MOST else found[:1]), wrong, len(failed) - wrong,
    )  # fmt: skip


def _place(grade: Grade) -> tuple[str, str]:
    """The parameter set and the friction law of what was asked."""
    set_name, friction, _ = grade.id.split("/", 2)
    return set_name, friction


def causes_of(sheet: Sheet, passed: Iterable[str], advance: Callable[[str, int], None]) -> list[Cause]:
    """From what is simple to say to what is less so; ``passed`` are kinds of questions that are answered right."""
    plain = specimen()
    known = frozenset[str]().union(*(plain.calls[plain.starts(kind)] for kind in passed))
    search = Search(sheet, advance, known)
    search.allow(_SECONDS)
    if sheet.level >= _ORBITS:
        outputs = [Cause(one.says, one.rank, name=one.name) for one in related(sheet)]
        return _simplest(outputs or (orbit_causes if sheet.level == _ORBITS else cycle_causes)(search))
    simple = search.inputs((0,)) or search.causes(ways(), (0,)) or search.inputs((1,))
    outputs = [Cause(one.says, one.rank, name=one.name) for one in related(sheet)]
    if simple or outputs:
        return _simplest(simple or outputs)
    found = search.causes(ways(), (1,)) or search.inputs((2,)) + search.causes(ways(), (2,))
    found = found or search.inputs((3,)) + search.causes(ways(), (3,))
    if not found:
        search.allow(_SECONDS)
        found = search.solved(ways())
    return _simplest(found)


def _simplest(found: list[Cause]) -> list[Cause]:
    """Those of the lowest rank, the shortest first; of a statement's many equivalent changes the shortest alone."""
    if not found:
        return []
    found = sorted(found, key=lambda cause: (cause.rank, len(cause.says)))
    found = [cause for cause in found if cause.rank == found[0].rank]
    places: dict[str, Cause] = {}
    for cause in found:
        places.setdefault(cause.before or cause.says, cause)
    return list(places.values())
