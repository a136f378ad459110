"""What is wrong with answers that fail: mistakes by name, what follows from them, and what nothing explains."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import re
from itertools import product

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import LINEAR, SMOOTH, Change, changes, system
from tippedisk_verify.conformance.diagnosis.entries import Array, Table, fitted, tables_of
from tippedisk_verify.conformance.diagnosis.levels import PREDICTED, base_of, problems
from tippedisk_verify.conformance.diagnosis.orbits import method, motions
from tippedisk_verify.conformance.diagnosis.regression import Problem, Search, made
from tippedisk_verify.conformance.diagnosis.relations import related, where
from tippedisk_verify.conformance.diagnosis.terms import Values
from tippedisk_verify.conformance.grading import LEVEL_NAMES, Grade
from tippedisk_verify.reference_values.store import Store

__all__ = ["Cause", "Diagnosis", "diagnosed"]

_BUDGET = 25_000  # changes evaluated for a sheet, some two seconds
_LOST = (1e-5, 1e-2, 0.3)  # of the size: what a method may lose, in the median and at most; share of wrong answers
_SAFETY = 10.0  # times: how much larger the errors of a mended program may be than those of the right one
_ALIKE = 12  # changes with the same effect on a quantity that are tried on the others
_PLAIN = 3.9  # rank of the relations that come before changes of equations, at levels 2 to 4
_WHOLE = 3  # quantities with the same relation, before changes are looked for
_FORMULAS = 5  # the last level without an integrator
_LAWS = ("both", "linear", "smooth")
_Advance = Callable[[str, int], None]


@dataclass(frozen=True)
class Cause:
    """A mistake by name: a change of the equations, a relation to right answers, other inputs, lost digits, a method."""

    name: str
    says: str


@dataclass(frozen=True)
class Diagnosis:
    """What fails at one level, and why, where that can be told."""

    level: int
    sets: tuple[str, ...]
    frictions: tuple[str, ...]
    failed: tuple[Grade, ...]
    found: tuple[Cause, ...]  #: all of them together; () if none is known
    follows: int  #: how many of the failed ones follow from mistakes that are named at earlier levels
    unexplained: int
    no_numbers: int  #: how many of the failed ones are no finite number, which no mistake predicts
    where: str = ""  #: which of the failed ones are unexplained

    @property
    def causes(self) -> tuple[tuple[str, str], ...]:
        return tuple((cause.name, cause.says) for cause in self.found)

    @property
    def few(self) -> int:
        """How many of the failed ones have too few digits only."""
        return sum(grade.verdict == "few-digits" for grade in self.failed)

    @property
    def status(self) -> str:
        if self.unexplained:
            return "partly" if self.found or self.follows else "unexplained"
        return "explained" if self.found else "follows" if self.follows else "no-numbers"

    def says(self) -> str:
        both = len(self.frictions) > 1 or self.frictions == ("both",)
        laws = "both laws" if both else f"{self.frictions[0]} friction"
        text = f"level {self.level}, {LEVEL_NAMES[self.level]} ({' and '.join(self.sets)}, {laws}): "
        counts = (len(self.failed) - self.few, "wrong"), (self.few, "with too few digits only")
        text += ", ".join(f"{count} {how}" for count, how in counts if count)
        if self.no_numbers:
            text += f", {self.no_numbers} of them no finite number"
        if len(self.found) > 1:
            text += "; likely causes, together: " + "; ".join(f"({n}) {one.says}" for n, one in enumerate(self.found, 1))
        elif self.found:
            text += f"; likely cause: {self.found[0].says}"
        if self.follows:
            text += f"; {self.follows} follow from what is named at earlier levels"
        if self.unexplained:
            text += f"; {self.unexplained} unexplained" + f" ({self.where})" * bool(self.where)
        return text

    def to_dict(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "sets": list(self.sets),
            "frictions": list(self.frictions),
            "failed": len(self.failed),
            "too_few_digits": self.few,
            "no_numbers": self.no_numbers,
            "status": self.status,
            "causes": [{"name": one.name, "cause": one.says} for one in self.found],
            "follows": self.follows,
            "unexplained": self.unexplained,
            "where": self.where,
        }


Posed = tuple[Table, Problem]


class _Sheet:
    """The diagnosis of one sheet: what is certain so far, and which wrong answers it explains."""

    def __init__(self, tables: Sequence[Table], advance: _Advance) -> None:
        self.tables = sorted(tables, key=lambda table: (table.level, _LAWS.index(table.friction)))
        self.truths = {id_: x for table in tables for id_, x in zip(table.ids, table.truth.tolist(), strict=True)}
        self.advance, self.search = advance, Search(_BUDGET)
        self.changes: dict[Change, set[str]] = {}  #: of the equations, by the friction laws that have them
        self.levels: dict[Change, int] = {}
        self.errors: dict[Table, Array] = {}
        self.causes: list[Cause] = []  #: of this level, other than changes

    def program(self, law: str, some: Iterable[Change]) -> dict[str, Any]:
        """The definitions under a law with some changes; those of derivatives are made last."""
        some, definitions = list(some), SMOOTH if law == "smooth" else LINEAR
        late = [one for one in some if one.places[0][0].startswith("d")]
        early = made(Values(definitions, {}), (one for one in some if one not in late))
        return dict(made(Values(system(early.definitions), {}), late).definitions) if some else dict(definitions)

    def candidates(self, law: str) -> list[list[Change]]:
        """The changes that answers may come with: those of their law, all, those of level 1, none."""
        own = [change for change, laws in self.changes.items() if laws & {law, "both"}]
        first = [change for change in self.changes if self.levels.get(change, 1) == 1]
        some = [own, list(self.changes), first, []]
        return [one for n, one in enumerate(some) if one not in some[:n]]

    def programs(self, law: str) -> list[dict[str, Any]]:
        """The programs with these changes, the likeliest first."""
        return [self.program(law, some) for some in self.candidates(law)]

    def add(self, some: Iterable[Change], table: Table) -> None:
        """Make changes certain for the law of a table."""
        for one in list(some):
            self.changes.setdefault(one, set()).add(table.friction)
            self.levels.setdefault(one, table.level)

    def given(self, table: Table, definitions: dict[str, Any], plain: bool = True) -> str:
        """Take out the quantities that a program gives, or with ``plain`` false all by one thing that is said."""
        for says, predict in PREDICTED.get(table.kind, {}).items():
            if table.left.any() and plain != bool(says.strip()):
                with np.errstate(all="ignore"):
                    room = table.allowed + self.own_errors(table)
                    predicted = table.picked(predict(base_of(definitions, table)))
                    fits = fitted(table.answer, table.truth, room, table.left, predicted)
                if not plain and fits.all():
                    table.left[:] = False
                    return says
                for stem in np.unique(table.stems[table.left]) if plain else ():
                    mine = table.left & (table.stems == stem)
                    table.left[mine] = not fits[mine].all()
        return ""

    def own_errors(self, table: Table) -> Array:
        """The errors of what the right program predicts of the slow manifold, which is differentiated many times."""
        if table.kind != "slow-manifold":
            return 0.0 * table.truth
        if table not in self.errors:
            right = table.picked(PREDICTED[table.kind][""](base_of(LINEAR, table)))
            size = np.nan_to_num(np.abs(right - table.truth) / table.scale)
            largest = {name: size[table.names == name].max() for name in np.unique(table.names)}
            self.errors[table] = _SAFETY * np.array([largest[name] for name in table.names]) * table.scale
        return self.errors[table]

    def equations(self, tables: Sequence[Table]) -> None:
        """Look for changes of the equations of motion behind the answers of level 1, in the order of the equations."""
        posed = [(table, problem) for table in tables for problem in problems(table, LINEAR)]
        values = [(table, problem) for table, problem in posed if not problem.name.startswith("dv")]
        for table in tables:
            self.everywhere(table, values)
        self.searched(values, values)
        self.pruned(values)
        self.lost(tables)
        self.relations(tables, mended=bool(self.changes))
        self.searched([pair for pair in posed if pair not in values], posed)

    def searched(self, some: Sequence[Posed], posed: Sequence[Posed]) -> None:
        """Look for changes behind each of some quantities; ``posed`` are all that are answered."""
        for table, problem in some:
            mine = table.left & (table.names == problem.name)
            if not (mine.any() or problem.name not in table.names and problem.wrong.any()):
                continue
            self.advance(f"level {table.level}, {problem.name}", 1)
            found = self.explained(table, problem, posed)
            if found is not None:
                self.add(found, table)
                table.left[mine] = False

    def explained(self, table: Table, problem: Problem, posed: Sequence[Posed]) -> list[Change] | None:
        """Return the changes that give the answers to a quantity, or None; those that are known already come first."""
        bases = [(some, Values(self.program(table.friction, some), problem.given)) for some in self.candidates(table.friction)]
        for some, base in bases:
            if problem.fits(base):
                return some
        right = self.right(table, posed)
        for deep, (some, base) in product((False, True)[: 2 if table.level == 1 else 1], bases):
            if found := self.search(problem, base, deep, right):
                return [*some, *(self.best(change, table, posed) for change in found)]
        return None

    def right(self, table: Table, posed: Sequence[Posed]) -> frozenset[str]:
        """The definitions behind right answers under a table's law."""
        definitions = self.programs(table.friction)[0]
        own = (problem for other, problem in posed if other.friction in ("both", table.friction) and not problem.wrong.any())
        return frozenset[str]().union(*(Values(definitions, problem.given).behind(problem.definition) for problem in own))

    def pruned(self, posed: Sequence[Posed]) -> None:
        """Drop changes without which the others, or one of the same effect in place of another, give the same answers."""
        fitting = [self.fits(self.changes, *pair) for pair in posed]
        for change in list(self.changes):
            for one in (change, *change.others[:_ALIKE]):
                some = {one if other is change else other: laws for other, laws in self.changes.items()}
                for dropped in (other for other in list(some) if other is not one or one is change):
                    rest = {other: laws for other, laws in some.items() if other is not dropped}
                    if change in self.changes and all(self.fits(rest, *pair) for pair, fits in zip(posed, fitting, strict=True) if fits):
                        self.changes, self.levels[one] = rest, self.levels[change]

    def fits(self, some: Mapping[Change, set[str]], table: Table, problem: Problem) -> bool:
        """Return True if the program with some changes gives the answers to a quantity."""
        own = (change for change, laws in some.items() if laws & {table.friction, "both"})
        return problem.fits(made(Values(SMOOTH if table.friction == "smooth" else LINEAR, problem.given), own))

    def regressed(self, table: Table) -> None:
        """Look for changes of the equations behind the quantities of a table of levels 2 to 5."""
        known, before = list(self.changes), table.left.copy()
        posed = [(table, problem) for problem in problems(table, self.programs(table.friction)[0])] if table.left.any() else []
        self.everywhere(table, posed)
        self.searched(posed, posed)
        for definitions in self.programs(table.friction) if posed else ():
            self.given(table, definitions)
        if posed and table.left.any():
            alone = table.kind == "slow-manifold" and before.sum() - table.left.sum() <= (table.names == posed[0][1].name).sum()
            if table.kind == "equilibrium" or alone:  # one part alone proves nothing
                self.changes = {change: laws for change, laws in self.changes.items() if change in known}
                table.left[:] = before
            elif table.kind == "slow-manifold":
                self.regressed(table)  # the next order

    def best(self, change: Change, table: Table, posed: Sequence[Posed]) -> Change:
        """Of a change and those with the same effect on one quantity the one that explains most of the others."""

        def score(one: Change) -> int:
            program = self.program(table.friction, [*self.changes, one])
            if table.level == 1:
                own = (problem for other, problem in posed if other.friction in ("both", table.friction))
                return sum(problem.fits(Values(program, problem.given)) for problem in own)
            tried = replace(table, left=table.left.copy())
            self.given(tried, program)
            return -int(tried.left.sum())

        alike = () if table.kind == "slow-manifold" else change.others[:_ALIKE]  # whose prediction takes long
        return max((change, *alike), key=score) if alike else change

    def everywhere(self, table: Table, posed: Sequence[Posed]) -> None:
        """Make changes of a symbol or of an input that explain several quantities at once."""
        right, wrong = self.right(table, posed), [problem for own, problem in posed if own is table and problem.wrong.any()]
        while len(wrong) > 1:
            program = self.programs(table.friction)[0]
            left = [(problem, Values(program, problem.given)) for problem in wrong]
            left = [(problem, values) for problem, values in left if not problem.fits(values)]
            counts: dict[Change, int] = {}
            for problem, values in left if len(left) > 1 else ():
                for change in changes(values, values.behind(problem.definition) - right):
                    if change.pieces[0][1] is None and change.rank <= 2 and problem.fits(values.changed(change.pieces)):
                        counts[change] = counts.get(change, 0) + 1
            best = max(counts, key=lambda change: (counts[change], -change.rank, -len(change.says)), default=None)
            if best is None or counts[best] < 2:
                return
            self.add([best], table)

    def lost(self, tables: Sequence[Table]) -> None:
        """Take out quantities that a program gives up to the digits that a method loses."""
        lost: dict[int, set[str]] = {}
        for table in (table for table in tables if table.level <= _FORMULAS and table.left.any()):
            self.given(table, self.programs(table.friction)[0])
            expected = self.expected(table)
            size = np.abs(table.answer - expected) / np.maximum(np.abs(expected), table.scale)
            for stem in np.unique(table.stems[table.left]):
                mine = table.stems == stem
                if np.median(size[mine]) < _LOST[0] and size[mine].max() < _LOST[1] and table.left[mine].mean() > _LOST[2]:
                    law = f" ({table.friction} law)" if table.friction != "both" else ""
                    if table.kind != "slow-manifold" or not self.changes:
                        lost.setdefault(int(-np.log10(np.median(size[mine]) + 1e-16)), set()).add(f"{stem}{law}")
                    table.left[mine] = False
        for digits, names in sorted(lost.items()):
            way = "the digits that difference quotients leave" if all(name.startswith("d") for name in names) else "too few"
            self.causes.append(Cause("digits", f"some {digits} digits of {', '.join(sorted(names))} are right: {way}"))

    def expected(self, table: Table) -> Array:
        """What the mended program gives, or the truth where it gives nothing."""
        with np.errstate(all="ignore"):
            predicted = table.picked(PREDICTED[table.kind][""](base_of(self.programs(table.friction)[0], table)))
        return np.where(np.isfinite(predicted), predicted, table.truth)

    def relations(self, tables: Sequence[Table], mended: bool = False, whole: bool = False) -> None:
        """Take out quantities whose answers are related to right ones, or to those of the mended program.

        A relation of many quantities comes before one of few. Eigenvalues belong together: all are explained, or none.

        Args:
            tables: The tables of a level.
            mended: Take the values of the mended program for right.
            whole: Only if relations explain all that is wrong.
        """
        truths, some = dict(self.truths), [table for table in tables if table.left.any()]
        if mended:
            some = [replace(table, truth=self.expected(table)) for table in some if table.kind in PREDICTED]
            truths |= {id_: x for table in some for id_, x in zip(table.ids, table.truth.tolist(), strict=True)}
        with np.errstate(all="ignore"):
            found = [(rank, says, table, stem, mine) for table in some for rank, says, stem, mine in related(table, truths)]
        groups: dict[str, list[tuple[float, str, Table, str, Array]]] = {}
        for one in found:
            groups.setdefault(one[1], []).append(one)
        before, causes = [(table, table.left.copy()) for table in tables], list(self.causes)
        for says, group in sorted(groups.items(), key=lambda item: (-len(item[1]), min(one[0] for one in item[1]))):
            new = [one for one in group if one[2].left[one[4]].all()]
            if len(new) < 2 and re.search(r"order|\^n|n!", says):
                continue  # one order alone proves nothing
            if new:
                total = {(table.friction, stem) for table in tables for stem in np.unique(table.stems)}
                self.causes.append(Cause("relation", _said(says, [(one[2].friction, one[3]) for one in new], total)))
            for one in new:
                one[2].left[one[4]] = False
        if any((whole or table.kind == "equilibrium") and table.left.any() for table in tables):
            self.causes = causes
            for table, left in before:
                table.left[:] = left

    def level(self, level: int, grades: Sequence[Grade]) -> Diagnosis:
        """Diagnose one level; mistakes that are named at earlier ones are made in the program."""
        tables = [table for table in self.tables if table.level == level]
        numbers, old, self.causes = sum(int(table.left.sum()) for table in tables), len(self.changes), []
        for table in tables if old else ():
            for definitions in self.programs(table.friction)[:-1]:
                self.given(table, definitions) if level <= _FORMULAS else motions(table, definitions)
        follows = numbers - sum(int(table.left.sum()) for table in tables)
        if level > 1:
            self.relations(tables, whole=True)
        for table in tables:
            says = self.given(table, self.programs(table.friction)[0], plain=False)
            self.causes += [Cause("inputs", says)] if says else []
        if level == 1:
            self.equations(tables)
        for table in tables if 1 < level <= _FORMULAS else ():
            self.regressed(table)
        if level > 1:
            self.relations(tables)
        self.lost(tables if level <= _FORMULAS else ())
        if len(self.changes):
            self.relations(tables, mended=True)
        for table in tables if level == _FORMULAS + 1 else ():
            says = method(table, self.programs(table.friction)[0])
            self.causes += [Cause("method", says)] if says else []
        named = [Cause("equations", self.text(one)) for one in list(self.changes)[old:]]
        failed = tuple(grade for grade in grades if grade.failed and grade.level == level)
        sets, laws = (tuple(sorted({grade.id.split("/")[n] for grade in failed})) for n in (0, 1))
        places = [where(table, base_of(LINEAR, table)["gamma_y"]) for table in tables if table.left.any()]
        unexplained, causes = sum(int(table.left.sum()) for table in tables), (*named, *dict.fromkeys(self.causes))
        return Diagnosis(level, sets, laws, failed, causes, follows, unexplained, len(failed) - numbers, "; ".join(places))

    def text(self, change: Change) -> str:
        """A change in words, with its friction law where the other one does not have it."""
        laws = self.changes[change] - {"both"}
        every = {table.friction for table in self.tables if table.level == self.levels[change]} - {"both"}
        return f"{change.says}, under the {min(laws)} law" if len(laws) == 1 and laws != every and "both" not in self.changes[change] else change.says


def _said(says: str, stems: Sequence[tuple[str, str]], total: set[tuple[str, str]]) -> str:
    """A relation of some quantities, in words."""
    names, laws = sorted({name for _, name in stems}), {law for law, _ in stems}
    whole = set(stems) == total and len(stems) >= _WHOLE
    text = "all answers" if whole else ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
    said = says.replace("{q}", text)
    if len(names) > 1 or whole:
        said = said.replace(f"{text} is ", f"{text} are ").replace(f"{text} has ", f"{text} have ").replace(f"{text} counts ", f"{text} count ")
    others = {(law, name) for law, name in total if name in names} - set(stems)
    return f"{said}, under the {min(laws)} law" if others and len(laws) == 1 else said


def diagnosed(grades: Iterable[Grade], store: Store, advance: _Advance = lambda label, steps: None) -> list[Diagnosis]:
    """A diagnosis for each level that fails, in order. ``advance`` is told what is being tried."""
    grades = list(grades)
    levels = sorted({grade.level for grade in grades if grade.failed})
    sheet = _Sheet(tables_of(grades, store) if levels else [], advance)
    return [sheet.level(level, grades) for level in levels]
