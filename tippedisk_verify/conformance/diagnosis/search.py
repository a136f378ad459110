"""The search: which one change of the right program gives the answers that were given.

Only statements are changed that move every quantity with wrong answers and none that is right throughout. A change is
tried on a few entries, then on all. The simplest changes of all right ways of writing the program come first.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, all_changed
from tippedisk_verify.conformance.diagnosis.operators import (
    Change,
    Place,
    changes,
    places,
    shown,
    statements,
    throughout,
)
from tippedisk_verify.conformance.diagnosis.specimen import HERE, Program, Specimen, specimen
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Cause", "Search"]

_STIRRED = (1e-3, 0.3)  # relative changes of a statement's values
_MOVED = 3.0  # times what is allowed
_MOSTLY = 0.3  # of the largest share of wrong answers that a quantity has
_SOLVED = 1.0  # digits beyond what is asked that a number which was solved for must have
_ALLOWED_GAIN = 1e-3
_TURNS = 60  # of a loop, which take as long as the shortest formula
_FREE = ast.Name("_free", ast.Load())
_FEW = 4  # entries with wrong answers, and as many without, that each change is tried on first


@dataclass(frozen=True)
class Cause:
    """A change that gives all answers."""

    says: str
    rank: float
    name: str = ""
    function: str = ""  #: of the specimen that is changed
    before: str = ""  #: its line as it is
    after: str = ""  #: and as it would be
    program: Program | None = None

    @property
    def where(self) -> str:
        return self.says.partition(": ")[0]


@dataclass(frozen=True)
class Suspect:
    """A statement, or one element of it, that moves what is wrong."""

    function: str
    place: Place  #: of its value
    label: str  #: what it computes
    also: int  #: how many of the quantities without a wrong answer it moves

    @property
    def where(self) -> str:
        known = self.function in ("equations", "derivatives")
        return self.label if known else f"{self.label or 'the result'} ({self.function})"

    def cause(self, spot: Place, change: Change, program: Program) -> Cause:
        """What is said of a change in this statement."""
        says, lines = f"in {self.where}: {spot.says(change)}", spot.lines(change.node)
        return Cause(says, change.rank, change.operator, self.function, *lines, program)


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
        self.work += sum(1 + program.right.turns(table) / _TURNS for table in sheet.tables)
        return program.answers(sheet)

    def suspects(self, right: Specimen) -> list[Suspect]:
        """The statements of a way that may be wrong; of what is not its own only what its own functions call."""
        base = self.run(Program(right), self.few)
        known = self.few.fitted(base) | self.few.wrong
        own = self.own(right)
        mine = own | frozenset().union(*(right.calls[name] for name in own)) if right.way else frozenset(right.calls)
        found = []
        for name in right.reach(self.few):
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
        stirred = _fixed(place.replaced(_fixed(ast.Call(ast.Name("_stirred", ast.Load()), [place.node], []))))
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
        self.work += 1  # for making it
        return all(sheet.fits(self.run(program, sheet)) for sheet in (self.tiny, self.few, self.sheet))

    def causes(self, rights: Sequence[Specimen], ranks: Sequence[int]) -> list[Cause]:
        """The changes of these ranks that give all answers."""
        found: dict[str, Cause] = {}
        for right in rights:
            if found or self.late():
                break
            suspects = self.suspects_of(right)
            for suspect in suspects:
                place = suspect.place
                program = Program(right, {suspect.function: place.replaced(HERE)})
                for spot, change in candidates(suspect, ranks):
                    if self.late():
                        break
                    program.computes(spot.within(place, change.node))
                    if self.fits(program):
                        whole = Program(right, {suspect.function: spot.replaced(change.node)})
                        cause = suspect.cause(spot, change, whole)
                        found.setdefault(cause.says, cause)
            for name in dict.fromkeys(suspect.function for suspect in suspects) if 1 in ranks else ():
                function = right.functions.get(name)
                if function is None:
                    continue
                for phrase, tree in throughout(function, scope(function)):
                    program = Program(right, {name: _fixed(tree)})
                    if not self.late() and self.fits(program):
                        says = f"in {name}: {phrase}"
                        found.setdefault(says, Cause(says, 1, "throughout", name, program=program))
        return list(found.values())

    def inputs(self, ranks: Sequence[int]) -> list[Cause]:
        """The known changes of inputs that give all answers."""
        right = Program(specimen())
        stages = (self.tiny, self.few, self.sheet)
        return [
            Cause(one.says, one.rank, one.name)
            for one in INPUTS
            if one.rank in ranks and all(sheet.fits(right.answers(all_changed(sheet, one.change))) for sheet in stages)
        ]

    def solved(self, rights: Sequence[Specimen]) -> list[Cause]:
        """One free factor at one place, solved for; the inputs first, then results before what they are made of."""
        found = list(self._solved_inputs())
        for right in rights:
            for suspect in () if found else reversed(self.suspects_of(right)):
                place = suspect.place
                program = Program(right, {suspect.function: place.replaced(HERE)})
                for spot in (place, *places(place.function, place.node, place.path)):
                    if found or isinstance(spot.node, ast.Constant | ast.Starred) or self.late():
                        break
                    program.computes(spot.within(place, _fixed(ast.BinOp(_FREE, ast.Mult(), spot.node))))
                    number = self.number(partial(self._with_free, program))
                    if number is not None:
                        says = f"in {suspect.where}: {plain(number)} times {shown(spot.node)}"
                        new = ast.BinOp(ast.Constant(number), ast.Mult(), spot.node)
                        found.append(Cause(says, 4, "factor", suspect.function, *spot.lines(new)))
        return found

    def _with_free(self, program: Program, number: float, sheet: Sheet) -> Array:
        program.space[_FREE.id] = number
        return self.run(program, sheet)

    def _solved_inputs(self) -> Iterator[Cause]:
        right = Program(specimen())
        for name in (*SYMBOLS, "Omega", "beta", "gamma", "v"):
            for text, by in (("", np.multiply), ("shifted by ", np.add)):
                if text and name in SYMBOLS:
                    continue

                answers = partial(_with_input, right, name, by)
                number = self.number(answers)
                if number is None:
                    continue
                place = (*SYMBOLS, name).index(name)
                known = {float(table.p[place][0]) for table in self.sheet.tables if place < len(SYMBOLS)}
                if len(known) == 1:
                    value = known.pop()
                    says = f"{name} = {value * number:.9g} instead of {value:.9g}"
                else:
                    says = f"{name} {text or 'times '}{plain(number - 1 if text else number)}"
                yield Cause(says, 4, f"{name}-value")

    def number(self, answers: Callable[[float, Sheet], Array]) -> float | None:
        """The number with which all answers are given, two digits better than asked; by the secant method."""
        tiny = self.tiny
        with np.errstate(all="ignore"):
            start, other = answers(1.0, tiny), answers(1.001, tiny)
            gain = np.where(tiny.wrong & np.isfinite(other - start), np.abs(other - start) / tiny.allowed, 0)
            cell = int(np.argmax(gain))
            if not gain[cell] > 1e3 * _ALLOWED_GAIN:
                return None
            wanted = tiny.answer[cell]
            x, y, before, value_before = 1.001, other[cell], 1.0, start[cell]
            for _ in range(25):
                if y == value_before or not np.isfinite(y):
                    return None
                x, before, value_before = x + (wanted - y) * (x - before) / (y - value_before), x, y
                if abs(x) > 1e6:
                    return None
                y = answers(x, tiny)[cell]
                if abs(y - wanted) <= 1e-4 * tiny.allowed[cell] or x == before:
                    break
        return x if all(sheet.fits(answers(x, sheet), _SOLVED) for sheet in (tiny, self.few, self.sheet)) else None

    def suspects_of(self, right: Specimen) -> list[Suspect]:
        """Those of a way; of a way that changes nothing in reach there are none but the specimen's."""
        kept: dict[str, list[Suspect]] = self.__dict__.setdefault("_suspects", {})
        if right.way not in kept:
            kept[right.way] = self.suspects(right) if self.own(right) or not right.way else []
        if self.clean:
            return [suspect for suspect in kept[right.way] if not suspect.also]
        unclean = sorted((suspect for suspect in kept[right.way] if suspect.also), key=lambda suspect: suspect.also)
        return [suspect for suspect in unclean if suspect.also <= unclean[0].also + 1]


def _with_input(right: Program, name: str, by: Any, number: float, sheet: Sheet) -> Array:
    """The right program's answers with one input times a number, or that much more than one larger."""
    share = number - 1 if by is np.add else number
    changed = all_changed(sheet, lambda values: {name: by(values[name], share)} if name in values else {})
    return right.answers(changed)


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


def _orders(table: Table, more: int) -> Table:
    """Of a series the orders up to the first wrong one, and ``more``: what follows is wrong by it, and dear."""
    orders = np.array([int(placed(name)[1].get("order", 0)) for name in table.names])
    return table.without(orders > min(orders[table.wrong], default=99) + more)


def plain(number: float) -> str:
    """A number as one says it: a fraction where it is one."""
    fraction = Fraction(number).limit_denominator(24)
    if fraction and abs(number / float(fraction) - 1) < 1e-8:
        return str(fraction)
    return f"{number:.6g}"


def values(function: Any, statement: Any, path: Any) -> Iterator[tuple[Place, str]]:
    """The values that a statement computes, each with what it is called: of a tuple or dictionary each element."""
    value = getattr(statement, "value", None)
    if value is None:
        for name in ("iter", "test"):
            if hasattr(statement, name):
                yield Place(function, statement, (*path, (statement, name, None))), name
        return
    if isinstance(statement, ast.Assign):
        label = ", ".join(map(shown, statement.targets))
    elif isinstance(statement, ast.AugAssign):
        label = shown(statement.target)
    else:
        label = ""
    whole = Place(function, statement, (*path, (statement, "value", None)))
    if isinstance(statement, ast.Expr) and isinstance(value, ast.Call):
        for index in range(len(value.args)):
            yield Place(function, statement, (*whole.path, (value, "args", index))), shown(value.func)
        return
    if isinstance(value, ast.Dict):
        for index, key in enumerate(value.keys):
            yield Place(function, statement, (*whole.path, (value, "values", index))), shown(key).strip("'")
    elif (
        isinstance(value, ast.Tuple)
        and isinstance(statement, ast.Assign)
        and isinstance(statement.targets[0], ast.Tuple)
    ):
        for index, target in enumerate(statement.targets[0].elts):
            yield Place(function, statement, (*whole.path, (value, "elts", index))), shown(target)
    else:
        if isinstance(value, ast.Tuple) and isinstance(statement, ast.Return):
            for index, element in enumerate(value.elts):
                yield Place(function, statement, (*whole.path, (value, "elts", index))), shown(element)
        yield whole, label


def terms(place: Place) -> Iterator[Place]:
    """An expression and the terms of its sum: a mistake in one of them may leave what follows from another as it is."""
    yield place
    if isinstance(place.node, ast.BinOp) and isinstance(place.node.op, ast.Add | ast.Sub):
        for side in ("left", "right"):
            yield from terms(Place(place.function, place.statement, (*place.path, (place.node, side, None))))


@lru_cache(maxsize=64)
def scope(function: Any) -> list[str]:
    """The names that a function knows."""
    own = [node.arg for node in ast.walk(function) if isinstance(node, ast.arg)]
    own += [node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return list(dict.fromkeys(own))


def candidates(suspect: Suspect, ranks: Sequence[int]) -> Iterator[tuple[Place, Change]]:
    """What may be changed in a statement, and how."""
    place = suspect.place
    names = scope(place.function)
    for spot in (place, *places(place.function, place.node, place.path)):
        for change in changes(spot, names, spot is place):
            if change.rank in ranks:
                _fixed(change.node)
                yield spot, change


def _fixed(node: Any) -> Any:
    """With line numbers where nodes are new; below old ones there are none."""
    if isinstance(node, ast.expr | ast.stmt | ast.keyword) and not hasattr(node, "lineno"):
        node.lineno = node.end_lineno = 1
        node.col_offset = node.end_col_offset = 0
        for child in ast.iter_child_nodes(node):
            _fixed(child)
    return node
