"""Regression: the smallest set of changes of the equations that leaves only rounding of the answers
to a quantity.

An identity such as M a - F = 0, with the answers a to v', is linear in changes of most terms. So
the effects of single changes add up, and a set of two or three of them is found as numbers with a
given sum. Where two changes multiply, the likeliest one is made in the program and the others are
sought again. What is found is made in the program, evaluated, and held against all answers; nothing
is claimed for answers that tell less than the changes assume.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import Change, changes
from tippedisk_verify.conformance.diagnosis.entries import Array, fitted
from tippedisk_verify.conformance.diagnosis.terms import IMAGINARY_STEP, Term, Values, parsed, shown
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Problem", "Search", "made"]

_SAMPLES = 40  # rows on which changes are tried; all others confirm
_SAME = 1e-9  # relative difference of sums that are equal but for rounding
_NOTHING = 1e-2  # of the allowed error; smaller changes do not count
_DIRECTION = 0.15  # squared cosine to the residual that a change needs to be made first
_FIRSTS = 24  # changes that are made first, where changes multiply
# Digits that answers must tell to bear out changes: in all, and for each change
_ASSUMED = (2.0, 3.0)
_CROWDED = 20_000  # sets with nearly the same sum: effects too small to tell them apart
_TYPED = 6  # digits of a number that somebody types in
Set = tuple[Change, ...]


@dataclass(eq=False)
class Problem:
    """The answers to one quantity, and the definition that predicts them."""

    name: str
    definition: str
    answer: Array
    truth: Array
    allowed: Array
    wrong: Array
    identity: str  #: the sum that vanishes for right answers, in which ``answer`` stands for them
    given: Mapping[str, Any]
    #: V', where the answers are its derivatives by an input with an imaginary step
    rate: Array | None = None

    def fits(self, values: Values) -> bool:
        """Return True if the definitions give all answers, and the wrong ones much better than
        the truth does.
        """
        with np.errstate(all="ignore"):
            predicted = np.real(values[self.definition]) + 0 * self.answer
            if self.rate is not None:  # of M v' - force = 0, for any answered v'
                slopes = np.imag(values["force"]) - np.imag(values["M"]) * self.rate
                predicted = slopes / IMAGINARY_STEP / np.real(values["M"])
        return bool(fitted(self.answer, self.truth, self.allowed, self.wrong, predicted).all())

    def sample(self) -> Array:
        """Return the rows on which changes are tried, most of them of wrong answers."""
        wrong, right = np.flatnonzero(self.wrong), np.flatnonzero(~self.wrong)
        wrong = wrong[:: max(1, len(wrong) // _SAMPLES)][:_SAMPLES]
        right = right[:: max(1, len(self.wrong) // 8)][:8]
        return np.sort(np.concatenate((wrong, right)))

    def evidence(self) -> float:
        """Digits that an exact prediction explains, of answers that differ."""
        with np.errstate(all="ignore"):
            told = np.log10(np.abs(self.answer - self.truth) / self.allowed)[self.wrong]
        _, first = np.unique([f"{x:.8e}" for x in self.answer[self.wrong]], return_index=True)
        return float(np.clip(np.nan_to_num(told[first]), 0, 8).sum())


def made(values: Values, some: Iterable[Change]) -> Values:
    """The values after several changes, one after the other."""
    for change in some:
        values = values.changed(change.pieces)
    return values


class Search:
    """The search for the fewest changes; what it may evaluate for a sheet is bounded, so that time
    does not depend on luck.
    """

    def __init__(self, budget: int) -> None:
        self.left = budget  #: changes that may still be evaluated

    @np.errstate(all="ignore")
    def __call__(
        self, problem: Problem, programs: Sequence[Values], efforts: int, right: frozenset[str]
    ) -> tuple[int, Set] | None:
        """Return the index of the program that needs the fewest changes to give all answers, and
        these changes; None if no changes do.

        Args:
            problem: The answers to one quantity.
            programs: Definitions that may be changed, with the problem's inputs, the likeliest
                first.
            efforts: 1 looks for single changes, 2 for two, 3 for three, 4 for changes that
                multiply; the lower ones come first.
            right: Definitions that right answers to other quantities come from.
        """
        evidence, rows = problem.evidence(), problem.sample()
        columns: list[_Columns] = []

        def columns_of(values: Values) -> _Columns:
            found = _Columns(problem, values, rows, right)
            self.left -= len(found.changes)
            return found

        def confirmed(sets: Iterable[Set], start: Values, assumed: int = 0) -> Set | None:
            """Return the first set that gives all answers, if these tell more than the set and
            some changes before it assume.
            """
            for changes_ in sets:
                count = len(changes_) + assumed
                told = evidence > _ASSUMED[0] + _ASSUMED[1] * count and len(rows) >= count
                if told and problem.fits(made(start, changes_)):
                    return changes_
            return None

        for effort in range(1, efforts + 1):
            for index, program in enumerate(programs):
                if index == len(columns) and self.left > 0 and evidence > sum(_ASSUMED):
                    columns.append(columns_of(program))
                if index == len(columns):
                    break
                here = columns[index]
                found: Set | None = None
                if effort == 1:
                    found = confirmed(here.sums(1, 9), program)
                elif effort == 2:
                    found = confirmed(here.sums(2, 2), program) or confirmed(
                        here.solved(), program, 3
                    )
                elif effort == 3:
                    found = confirmed(here.sums(3, 1), program)
                for first in here.firsts() if effort == 4 else ():
                    start = program.changed(first.pieces)
                    after = columns_of(start)
                    rest = confirmed(after.sums(1, 2), start, 1) or confirmed(
                        after.sums(2, 1), start, 1
                    )
                    if rest:
                        found = _merged(first, rest, program)
                    if rest or self.left <= 0:
                        break
                if found:
                    return index, found
        return None


def _merged(first: Change, rest: Set, base: Values) -> Set:
    """Return a change and those after it. Two changes of the same term become one, with the
    result of both in its sentence.
    """
    merged = []
    for change in rest:
        name, index, new = change.pieces[0]
        if index is not None and (name, index) in first.places:
            change = Change(
                change.pieces,
                f"in {name}: {shown(new)} for {shown((base.terms(name)[index],))}",
                change.rank,
            )
        merged.append(change)
    hidden = all(any(place in change.places for change in rest) for place in first.places)
    return tuple(merged) if hidden else (first, *merged)


class _Columns:
    """The effects of all single changes on the residual, in units of what is allowed."""

    def __init__(self, problem: Problem, base: Values, rows: Array, right: frozenset[str]) -> None:
        given = {name: x[rows] if np.ndim(x) else x for name, x in base.given.items()}
        rate = None if problem.rate is None else problem.rate[rows]
        self.differentiated = rate is not None
        answers = (
            x if rate is None else rate + IMAGINARY_STEP * 1j * x
            for x in (problem.answer[rows], (problem.answer + problem.allowed)[rows])
        )
        self.values, unit = (
            Values(base.definitions, {**given, "answer": answer}) for answer in answers
        )
        self.identity = parsed(problem.identity)
        residual = self._of(self.values)
        self.unit = np.abs(self._of(unit) - residual)
        self.residual = residual / self.unit
        behind = (self.values.behind(name) for term in self.identity for name, _ in term.factors)
        self.names = frozenset[str]().union(*behind) - {"answer"} - right
        pairs = [
            (one, (self._of(self.values.changed(one.pieces)) - residual) / self.unit)
            for one in changes(self.values, self.names)
        ]
        pairs = [
            (one, x) for one, x in pairs if np.isfinite(x).all() and np.abs(x).max() > _NOTHING
        ]
        draws = np.random.default_rng(5).uniform(0.5, 1.5, (len(rows), 2)) / len(rows)
        self.signs = draws * np.where(np.arange(len(rows)) % 2, -1, 1)[:, None]
        # Changes with the same effect, the likeliest first
        groups: dict[str, list[tuple[Change, Array]]] = {}
        for one, x in sorted(pairs, key=lambda pair: pair[0].order):
            groups.setdefault("{:.8e} {:.8e}".format(*(x @ self.signs)), []).append((one, x))
        self.changes = [
            replace(some[0][0], others=tuple(one for one, _ in some[1:]))
            for some in groups.values()
        ]
        self.effects = np.array([some[0][1] for some in groups.values()]).reshape(-1, len(rows))

    def _of(self, values: Values) -> Array:
        total = values.total(self.identity)[0] + 0 * self.values.given["answer"]
        return np.asarray(
            np.imag(total) / IMAGINARY_STEP if self.differentiated else np.real(total)
        )

    def sums(self, size: int, highest: int) -> Iterator[Set]:
        """Sets of changes whose effects cancel the residual, the likeliest first."""
        some = [n for n, change in enumerate(self.changes) if change.rank <= highest]
        effects = self.effects[some]
        marks, target = effects @ self.signs[:, 0], -float(self.residual @ self.signs[:, 0])
        order = np.argsort(marks)
        count = np.arange(len(some))
        groups = {1: count[:0].reshape(1, 0), 2: count[:, None]}.get(size)
        if groups is None:
            groups = np.stack(np.triu_indices(len(some), 1), axis=1)
        total = target - marks[groups].sum(axis=1)
        room = _SAME * (abs(target) + np.abs(marks[groups]).sum(axis=1)) + 4.0
        low = np.searchsorted(marks[order], total - room)
        high = np.searchsorted(marks[order], total + room, side="right")
        if (high - low).sum() > _CROWDED:
            return
        near = (
            {*groups[g].tolist(), place}
            for g in np.flatnonzero(high > low)
            for place in order[low[g] : high[g]].tolist()
        )
        sets = []
        for members in {tuple(sorted(one)) for one in near if len(one) == size}:
            chosen = effects[list(members)]
            found = tuple(self.changes[some[n]] for n in members)
            places = [place for change in found for place in change.places]
            room = 2.0 + 1e-11 * (np.abs(self.residual) + np.abs(chosen).sum(axis=0))
            if (np.abs(self.residual + chosen.sum(axis=0)) <= room).all() and len(
                set(places)
            ) == len(places):
                sets.append(found)
        yield from sorted(
            sets,
            key=lambda one: [
                sum(parts) for parts in zip(*(change.order for change in one), strict=True)
            ],
        )

    def solved(self) -> Iterator[Set]:
        """One parameter with another value, the same for all, that is solved for by the
        secant method.
        """
        row = int(np.argmax(np.abs(self.residual)))
        for name in (one for one in SYMBOLS if one in self.names):
            old = float(np.ravel(self.values.given[name])[0])
            x, last, off = 1.001 * old, old, self.residual[row] * self.unit[row]
            for _ in range(15):
                now = self._of(self.values.changed([(name, None, (Term(float(x), ()),))]))[row]
                if now == off or not np.isfinite(now):
                    break
                x, last, off = x - now * (x - last) / (now - off), x, now
            value = float(f"{x:.{_TYPED}g}")
            if np.isfinite(value) and value != old:
                says = f"the inputs: {name} = {value:g}"
                yield (Change(((name, None, (Term(value, ()),)),), says, 3),)

    def firsts(self) -> list[Change]:
        """The changes whose effects point along the residual, those first that leave least of
        it.
        """
        size = (self.effects**2).sum(axis=1) * float(self.residual @ self.residual)
        along = np.nan_to_num((self.effects @ self.residual) ** 2 / size)
        likely = [
            n
            for n in np.argsort(-along, kind="stable").tolist()
            if along[n] > _DIRECTION and self.changes[n].rank < 2
        ]
        return [self.changes[n] for n in likely[:_FIRSTS]]
