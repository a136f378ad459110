"""The search: which one change of the right program gives the answers that were given.

Only statements are changed that move every quantity with wrong answers and none that is right throughout. A change is
tried on a few entries, then on all. The simplest changes of all right ways of writing the program come first.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, all_changed
from tippedisk_verify.conformance.diagnosis.operators import changes
from tippedisk_verify.conformance.diagnosis.specimen import HERE, Program, Specimen, specimen
from tippedisk_verify.conformance.diagnosis.trees import (
    Cause,
    Change,
    Place,
    Suspect,
    fixed,
    places,
    scope,
    statements,
    terms,
    values,
)
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Search", "all_changes"]

_STIRRED = (1e-3, 0.3)  # relative changes of a statement's values
_MOVED = 3.0  # times what is allowed
_MOSTLY = 0.3  # of the largest share of wrong answers that a quantity has
_SOLVED = 1.0  # digits beyond what is asked that a number which was solved for must have
_TURNS = 25  # of a loop, which take as long as the shortest formula
_SHARE = 0.4  # of the work, that one way of writing the program may take
_FEW = 4  # entries with wrong answers, and as many without, that each change is tried on first


class _Stir:
    """Changes the numbers that pass through it, each by another share."""

    def __init__(self, share: float) -> None:
        self.share = share
        self.draws = np.random.default_rng(7)
        self.touched = False

    def __call__(self, value: Any) -> Any:
        if isinstance(value, tuple | list):
            return type(value)(self(part) for part in value)
        if isinstance(value, Mapping):
            return {name: self(part) for name, part in value.items()}
        array = np.asarray(value)
        if array.dtype.kind not in "fc":
            return value
        self.touched = True
        shape = array.shape if self.share > _STIRRED[0] else ()  # a slight change leaves directions as they are
        stirred = array * (1 + self.share * self.draws.uniform(0.5, 1, shape))
        return stirred + self.share * (np.abs(array) == 0) if array.ndim else stirred


def all_changes(
    right: Specimen, suspects: Iterable[Suspect], ranks: Sequence[int]
) -> Iterator[tuple[Suspect, Place, Change, Program]]:
    """All changes of some statements, each with a program that makes it until the next one is asked for."""
    for suspect in suspects:
        place = suspect.place
        program = Program(right, {suspect.function: place.replaced(HERE)})
        for spot in (place, *places(place.function, place.node, place.path)):
            for change in changes(spot, scope(place.function), spot is place):
                if change.rank in ranks:
                    program.computes(spot.within(place, fixed(change.node)))
                    yield suspect, spot, change, program


@dataclass
class Search:
    """For one sheet."""

    sheet: Sheet
    advance: Callable[[str, int], None] = lambda label, steps: None
    passed: frozenset[str] = frozenset()  #: functions of the specimen that right answers of earlier levels come from
    work: float = 0.0  #: done so far, in runs of the shortest formula
    limit: float = math.inf
    clean: bool = True  #: whether statements are changed that move nothing that is right, or the others

    @cached_property
    def few(self) -> Sheet:
        few = self.sheet.some(_FEW)
        return Sheet(tuple(_orders(table, 1) for table in few.tables))

    @cached_property
    def tiny(self) -> Sheet:
        """The least that tells most changes: few entries of one table, and of a series its first wrong order."""
        table = max(self.few.tables, key=lambda table: len(set(table.stems[table.wrong])))
        rows = list(dict.fromkeys(table.rows[table.wrong].tolist()))[:3]
        return Sheet((_orders(table.part(rows), 0),))

    @cached_property
    def right_stems(self) -> set[str]:
        """Quantities without a wrong answer."""
        return set(self.sheet.stems[~self.sheet.wrong]) - self.wrong_stems

    @cached_property
    def wrong_stems(self) -> set[str]:
        return set(self.sheet.stems[self.sheet.wrong])

    @cached_property
    def mostly_wrong(self) -> set[str]:
        """Of the quantities with wrong answers those with many: a few may be wrong by an exchange of eigenvalues."""
        shares = {stem: float(self.sheet.wrong[self.sheet.stems == stem].mean()) for stem in self.wrong_stems}
        return {stem for stem, share in shares.items() if share >= _MOSTLY * max(shares.values())}

    def late(self) -> bool:
        """Whether the work is done that `allow` gave; never a matter of time, which depends on the machine."""
        return self.work > self.limit

    def allow(self, work: float) -> None:
        self.limit = self.work + work

    def run(self, program: Program, sheet: Sheet) -> Array:
        for table in sheet.tables:
            self.work += 1 + program.right.effort(table) / _TURNS
        return program.answers(sheet)

    def suspects(self, right: Specimen) -> list[Suspect]:
        """The statements of a way that may be wrong; of what is not its own only what its own functions call."""
        base = self.run(Program(right), self.few)
        known = self.few.fitted(base) | self.few.wrong
        own = self.own(right)
        mine = own | frozenset().union(*(right.calls[name] for name in own)) if right.way else frozenset(right.calls)
        found = []
        for name in reversed(right.reach(self.few)):  # what is for one quantity before what is for many
            if name not in mine or (name in self.passed and name not in own):
                continue
            function: Any = right.functions.get(name) or right.constants[name]
            for statement, path in statements(function):
                for place, label in values(function, statement, path):
                    moves = [self._moves(right, name, part, base, known) for part in terms(place)]
                    if min(moves) < math.inf:
                        found.append(Suspect(name, place, label, int(min(moves))))
        return found

    def own(self, right: Specimen) -> frozenset[str]:
        """What a way has otherwise, of the functions that the answers come from."""
        plain = specimen().functions
        return frozenset(n for n in right.reach(self.sheet) if plain.get(n) is not right.functions.get(n))

    def _moves(self, right: Specimen, name: str, place: Place, base: Array, known: Array) -> float:
        """How many right quantities slightly another value there moves; infinite if not all that is wrong may move."""
        stirred = fixed(place.replaced(fixed(ast.Call(ast.Name("_stirred", ast.Load()), [place.node], []))))
        moved: set[str] = set()
        program, also = Program(right, {name: stirred}), 0
        for share in _STIRRED:
            program.space["_stirred"] = stir = _Stir(share)
            answers = self.run(program, self.few)
            if not stir.touched:
                return 0 if isinstance(place.statement, ast.For | ast.If | ast.Assign | ast.AugAssign) else math.inf
            with np.errstate(all="ignore"):
                away = ~(np.abs(answers - base) <= _MOVED * self.few.allowed) & known
            moved |= set(self.few.stems[away])
            also = also if share != _STIRRED[0] else len(moved & self.right_stems)
        return also if self.mostly_wrong & set(self.few.stems) <= moved else math.inf

    def fits(self, program: Program) -> bool:
        self.work += 2  # for making it
        return all(sheet.fits(self.run(program, sheet)) for sheet in (self.tiny, self.few, self.sheet))

    def causes(self, rights: Sequence[Specimen], ranks: Sequence[int]) -> list[Cause]:
        """The changes of these ranks that give all answers."""
        found: dict[str, Cause] = {}
        begin, end = self.work, self.limit
        for right in rights:
            if found or self.work > end:
                break
            self.limit = min(end, self.work + _SHARE * (end - begin))
            for suspect, spot, change, program in all_changes(right, self.suspects_of(right), ranks):
                if self.late():
                    break
                if self.fits(program):
                    whole = Program(right, {suspect.function: spot.replaced(change.node)})
                    cause = suspect.cause(spot, change, whole)
                    found.setdefault(cause.says, cause)
        self.limit = end
        return list(found.values())

    def inputs(self, ranks: Sequence[int]) -> list[Cause]:
        """The known changes of inputs that give all answers."""
        right = Program(specimen())
        stages = (self.tiny, self.few, self.sheet)
        return [
            Cause(one.says, one.rank, "inputs")
            for one in INPUTS
            if one.rank in ranks and all(sheet.fits(right.answers(all_changed(sheet, one.change))) for sheet in stages)
        ]

    def solved(self) -> list[Cause]:
        """One parameter with another value, with which all answers are given."""
        right, found = Program(specimen()), []
        for place, name in enumerate(SYMBOLS):
            number = self.number(partial(_with_share, right, name))
            known = {float(table.p[place][0]) for table in self.sheet.tables}
            if number is not None and len(known) == 1:
                value = known.pop()
                found.append(Cause(f"{name} = {value * number:.9g} instead of {value:.9g}", 4, f"{name}-value"))
        return found

    def number(self, answers: Callable[[float, Sheet], Array]) -> float | None:
        """The number with which all answers are given, better than asked; from a wrong one by the secant method."""
        from scipy.optimize import newton

        tiny = self.tiny
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            slope = answers(1.001, tiny) - answers(1.0, tiny)
            cell = int(np.argmax(np.nan_to_num(np.abs(slope) / tiny.allowed * tiny.wrong)))
            off = lambda x: answers(x, tiny)[cell] - tiny.answer[cell]  # noqa: E731
            x = float(newton(off, 1.0, x1=1.001, tol=1e-300, rtol=1e-15, maxiter=25, disp=False))
            return x if all(sheet.fits(answers(x, sheet), _SOLVED) for sheet in (tiny, self.few, self.sheet)) else None

    def suspects_of(self, right: Specimen) -> list[Suspect]:
        """Those of a way; of a way that changes nothing in reach there are none but the specimen's."""
        kept: dict[str, list[Suspect]] = self.__dict__.setdefault("_suspects", {})
        if right.way not in kept:
            new = self.own(right) - self.passed
            kept[right.way] = self.suspects(right) if new or not right.way else []
        if self.clean:
            return [suspect for suspect in kept[right.way] if not suspect.also]
        return sorted((suspect for suspect in kept[right.way] if suspect.also), key=lambda suspect: suspect.also)


def _with_share(right: Program, name: str, share: float, sheet: Sheet) -> Array:
    """The right program's answers with one parameter times a number."""
    return right.answers(all_changed(sheet, lambda values: {name: values[name] * share}))


def _orders(table: Table, more: int) -> Table:
    """Of a series the orders up to the first wrong one, and ``more``: what follows is wrong by it, and dear."""
    orders = np.array([int(placed(name)[1].get("order", 0)) for name in table.names])
    return table.without(orders > min(orders[table.wrong], default=99) + more)
