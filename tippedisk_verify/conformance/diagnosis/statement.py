"""What is wrong with answers that fail: the one mistake that gives all, digits that a method loses, or where it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.cycles import cycle_causes
from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table, tables_of
from tippedisk_verify.conformance.diagnosis.integrators import integrator_errors
from tippedisk_verify.conformance.diagnosis.orbits import Flights, other_inputs
from tippedisk_verify.conformance.diagnosis.places import lost, where
from tippedisk_verify.conformance.diagnosis.readings import Readings
from tippedisk_verify.conformance.diagnosis.relations import related
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.specimen import specimen
from tippedisk_verify.conformance.diagnosis.trees import Cause
from tippedisk_verify.conformance.diagnosis.ways import ways
from tippedisk_verify.conformance.grading import LEVEL_NAMES, Grade
from tippedisk_verify.reference_values.store import Store

__all__ = ["Diagnosis", "diagnosed"]

_WORK = 40_000.0  # runs of a short formula, some eight seconds, for each rank of changes, and for solved numbers
_ORBITS = 6  # the first level whose answers are flown
_PROVED = 40  # right answers to a kind of questions, after which the functions behind them are beyond doubt
_SELDOM = 0.2  # of the answers to a quantity: a change of a formula makes more of them wrong
_MOST = 3  # causes that are named together
_Advance = Callable[[str, int], None]


@dataclass(frozen=True)
class Diagnosis:
    """What fails at one level for some parameter sets and friction laws, and why, where that can be told."""

    level: int
    sets: tuple[str, ...]
    frictions: tuple[str, ...]
    failed: tuple[Grade, ...]
    found: tuple[Cause, ...]  #: several if they cannot be told apart; () if none is known
    tried: int  #: how many of the failed ones the cause gives
    where: str = ""  #: if no cause is known: a condition that the failed answers satisfy and the right ones do not
    formulas: bool = True  #: whether they are tried at this level, or v_rate of level 1 is answered

    @property
    def causes(self) -> tuple[tuple[str, str], ...]:
        return tuple((cause.name, cause.says) for cause in self.found)

    @property
    def no_numbers(self) -> int:
        """How many of the failed ones are no finite number, which no mistake predicts."""
        return len(self.failed) - self.tried

    @property
    def few(self) -> int:
        """How many of the failed ones have too few digits only."""
        return sum(grade.verdict == "few-digits" for grade in self.failed)

    @property
    def status(self) -> str:
        return "explained" if self.found else "unexplained" if self.tried else "no-numbers"

    def says(self) -> str:
        both = len(self.frictions) > 1 or self.frictions == ("both",)
        laws = "both laws" if both else f"{self.frictions[0]} friction"
        text = f"level {self.level}, {LEVEL_NAMES[self.level]} ({' and '.join(self.sets)}, {laws}): "
        counts = (len(self.failed) - self.few, "wrong"), (self.few, "with too few digits only")
        text += ", ".join(f"{count} {how}" for count, how in counts if count)
        if self.no_numbers:
            text += f", {self.no_numbers} of them no finite number"
        if self.status == "unexplained":
            text += "; unexplained: no single mistake that is tried gives these answers"
            text += f"; they are wrong {self.where}" * bool(self.where)
            if self.formulas:
                text += "; two at once are not tried: mend what you know to be wrong, and ask again"
            else:
                text += "; formulas are tried at levels 1 to 5 only: answer v_rate of level 1 too"
        elif self.found:
            causes = " or ".join(cause.says for cause in self.found)
            tried = "the one answer tried" if self.tried == 1 else f"all {self.tried} answers tried"
            text += f"; likely cause: {causes} (explains {tried})"
        return text

    def to_dict(self) -> dict[str, Any]:
        names = ("name", "function", "before", "after")
        return {
            "level": self.level,
            "sets": list(self.sets),
            "frictions": list(self.frictions),
            "failed": len(self.failed),
            "too_few_digits": self.few,
            "no_numbers": self.no_numbers,
            "status": self.status,
            "causes": [{"cause": one.says, **{name: getattr(one, name) for name in names}} for one in self.found],
            "where": self.where,
            "tried_on": self.tried,
        }


def diagnosed(grades: Iterable[Grade], store: Store, advance: _Advance = lambda label, steps: None) -> list[Diagnosis]:
    """For each set and law the first level that fails; sets and laws that fail at the same level together.

    Digits that a method loses hide nothing: beside them the search goes on, at the same level and at later ones.
    ``advance`` is told what is being tried.
    """
    grades = list(grades)
    tables, failed = tables_of(grades, store), [grade for grade in grades if grade.failed]
    answered = {tuple(grade.id.split("/", 2)[:2]) for grade in grades}
    diagnoses: list[Diagnosis] = []
    undone = {key for grade in failed for key in _places(grade, answered)}
    while undone:
        level = min(grade.level for grade in failed if _places(grade, answered) & undone)
        mine = [grade for grade in failed if grade.level == level and _places(grade, answered) & undone]
        here = {key for grade in mine for key in _places(grade, answered)} & undone
        sets, laws = {name for name, _ in here}, {law for _, law in here}
        advance(f"level {level}", 1)
        undone -= here
        if level > 1 and _common(mine) and sets <= {name for old in diagnoses if old.level == 1 for name in old.sets}:
            continue  # wrong equations of one law, seen in what is common to both
        parts = (table for table in tables if table.level == level and table.friction in laws | {"both"})
        sheet = Sheet(tuple(parts)).where(partial(_rows, list(sets)))
        about = partial(Diagnosis, level, tuple(sorted(sets)), tuple(sorted(laws)))
        digits, causes = lost(sheet) if sheet.wrong.any() else None, list[Cause]()
        if digits is not None:
            ids = set(sheet.ids[digits[1]].tolist())
            touched = tuple(grade for grade in mine if grade.id in ids)
            diagnoses.append(about(touched, (Cause(digits[0], 0, "digits"),), len(touched)))
            failed = [grade for grade in failed if grade.id not in ids]
            tables = [table.without(np.isin(table.ids, list(ids))) for table in tables]
            undone |= {key for grade in failed for key in _places(grade, answered)} & here
            continue
        if sheet.wrong.any():
            causes = causes_of(sheet, _proved(tables, level), advance)
        place, numbers = "" if causes or not sheet.tables else where(sheet), set(sheet.ids[sheet.wrong].tolist())
        formulas = level < _ORBITS or any(g.id.endswith("/v_rate") and _places(g, answered) & here for g in grades)
        count = sum(grade.id in numbers for grade in mine)
        diagnoses.append(about(tuple(mine), tuple(causes), count, place, formulas))
    return diagnoses


def _places(grade: Grade, answered: set[tuple[str, ...]]) -> set[tuple[str, str]]:
    """The parameter set with each friction law of an answer; what is common to both goes with those answered."""
    name, friction, _ = grade.id.split("/", 2)
    laws = (friction,) if friction != "both" else ("linear", "smooth")
    return {(name, law) for law in laws if (name, law) in answered} or {(name, friction)}


def _rows(sets: list[str], table: Table) -> Array:
    return np.flatnonzero(np.isin(table.sets, sets))


def _common(grades: Iterable[Grade]) -> bool:
    return all(grade.id.split("/", 2)[1] == "both" for grade in grades)


def _proved(tables: Sequence[Table], level: int) -> frozenset[str]:
    """The specimen's functions behind kinds of questions of earlier levels that are answered right."""
    plain, faulty = specimen(), {table.kind for table in tables if table.wrong.any()}
    kinds = {table.kind for table in tables if table.level < level and len(table.names) >= _PROVED} - faulty
    return frozenset[str]().union(*(plain.calls[plain.starts(kind)] for kind in kinds))


def causes_of(sheet: Sheet, passed: frozenset[str], advance: _Advance) -> list[Cause]:
    """From what is simple to say to what is less so; ``passed`` are functions that are beyond doubt."""
    search = Search(sheet, advance, passed)
    shares = (sheet.wrong[sheet.stems == stem].mean() for stem in np.unique(sheet.stems[sheet.wrong]))
    if sheet.level < _ORBITS and max(shares) < _SELDOM:
        return _named(related(sheet))
    if sheet.level >= _ORBITS:
        return _named(related(sheet) or (_orbit_causes(sheet) if sheet.level == _ORBITS else cycle_causes(search)))
    outputs = related(sheet)
    search.allow(_WORK)
    found = search.inputs((0,)) or [one for one in outputs if one.rank <= 1]
    found = found or search.causes(ways(), (0,)) or search.inputs((1,)) or outputs
    for ranks, clean in (((1,), True), ((0,), False), ((1,), False), ((2, 3), True)):
        search.allow(_WORK)
        search.clean = clean
        found = found or (search.inputs(ranks) if 1 not in ranks and clean else []) + search.causes(ways(), ranks)
    search.allow(_WORK)
    return _named(found or ([] if passed else search.solved()))


def _orbit_causes(sheet: Sheet) -> list[Cause]:
    """Wrong readings of right orbits, right ones of other inputs, and the errors of integrators."""
    return Readings(sheet).causes() or other_inputs(Flights(sheet)) or integrator_errors(Flights(sheet))


def _named(found: list[Cause]) -> list[Cause]:
    """Those of the lowest rank, of a statement's equivalent changes one; of many what they have in common."""
    lowest = [cause for cause in found if cause.rank == min(one.rank for one in found)]
    places: dict[tuple[str, str], Cause] = {}
    for cause in sorted(lowest, key=lambda cause: ("missing" not in cause.says, len(cause.says))):
        places.setdefault((cause.where, cause.before or cause.says), cause)
    named = list(places.values())
    if len(named) <= _MOST:
        return named
    if not named[0].function:
        return [replace(named[0], says=f"{named[0].says}, or one of {len(named) - 1} relations as simple")]
    common = " or ".join(dict.fromkeys(cause.where.removeprefix("in ") for cause in named[:_MOST]))
    common += " or elsewhere" * (len({cause.where for cause in named}) > _MOST)
    return [replace(named[0], says=f"in {common}: one of {len(named)} changes that give the same answers")]
