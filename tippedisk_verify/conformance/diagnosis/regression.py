"""Regression: the smallest set of changes of the equations that leaves only rounding of the answers
to a quantity.

An identity such as M a - F = 0, with the answers a to v', is linear in changes of most terms. So
the effects of single changes add up, and a set of two or three of them is found as numbers with a
given sum. Where two changes multiply, the likeliest one is made in the program and the others are
sought again. The changes found are made in the program, evaluated, and compared with all answers. A
set of changes is accepted only if the answers are more digits of evidence than the set needs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import Change, changes
from tippedisk_verify.conformance.diagnosis.entries import Answered, Array
from tippedisk_verify.conformance.diagnosis.terms import Term, Values, parsed, shown
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Problem", "Search", "likelihood", "made"]

_SAMPLES = 40  # rows on which changes are tried; all others confirm
_SAME = 1e-9  # relative difference of sums that are equal but for rounding
_NOTHING = 1e-2  # of the allowed error; smaller changes do not count
_DIRECTION = 0.15  # squared cosine to the residual that a change needs to be made first
_CHEAP = 2  # effort up to which all programs are tried
_FIRSTS = 24  # changes that are made first, where changes multiply
# Digits that answers must tell to bear out changes: in all, and for each change
_ASSUMED = (2.0, 3.0)
_CROWDED = 20_000  # sets with nearly the same sum: effects too small to tell them apart
_TYPED = 6  # digits of a number that somebody types in
Set = tuple[Change, ...]


@dataclass(frozen=True, eq=False)
class Problem(Answered):
    """The answers to one quantity, and the definition that predicts them."""

    name: str
    definition: str
    identity: str  #: the sum that vanishes for right answers, in which ``answer`` stands for them
    given: Mapping[str, Any]

    @np.errstate(all="ignore")
    def fits(self, values: Values) -> bool:
        """Return True if the definitions give all answers, and the wrong ones much better than
        the truth does.
        """
        return bool(self.fitted(np.real(values[self.definition]) + 0 * self.answer).all())

    def sample(self) -> Array:
        """Return the rows on which changes are tried, most of them of wrong answers."""
        wrong, right = np.flatnonzero(self.left), np.flatnonzero(~self.left)
        wrong = wrong[:: max(1, len(wrong) // _SAMPLES)][:_SAMPLES]
        right = right[:: max(1, len(self.left) // 8)][:8]
        return np.sort(np.concatenate((wrong, right)))

    @np.errstate(all="ignore")
    def evidence(self) -> float:
        """Return the digits that an exact prediction explains, of answers that differ."""
        digits = np.log10(np.abs(self.answer - self.truth) / self.allowed)[self.left]
        _, first = np.unique([f"{x:.8e}" for x in self.answer[self.left]], return_index=True)
        return float(np.clip(np.nan_to_num(digits[first]), 0, 8).sum())


def likelihood(some: Iterable[Change]) -> list[int]:
    """Return the sort key of sets of changes, the likeliest first."""
    return [sum(parts) for parts in zip(*(change.order for change in some), strict=True)]


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
        self, problem: Problem, programs: Sequence[tuple[Values, frozenset[str]]], efforts: int
    ) -> list[tuple[int, Set]]:
        """Return the fewest changes that give all answers: the index of a program, and the changes
        that it needs; more than one where one or two changes of other programs do as well.

        Args:
            problem: The answers to one quantity.
            programs: Definitions that may be changed, with the problem's inputs, and the names of
                those that right answers come from and that stay; the likeliest first.
            efforts: 1 looks for single changes, 2 for two, 3 for three, 4 for changes that
                multiply; the lower ones come first.
        """
        evidence, rows = problem.evidence(), problem.sample()
        effects: list[_Effects] = []
        found: list[tuple[int, Set]] = []
        for effort, (index, (program, right)) in product(
            range(1, efforts + 1), enumerate(programs)
        ):
            if found and (index == 0 or effort > _CHEAP):
                break
            if index == len(effects) and self.left > 0 and evidence > sum(_ASSUMED):
                effects.append(self.effects(problem, program, rows, right))
            for assumed, some in self.proposed(effects[index], effort) if effects[index:] else ():
                told = evidence > _ASSUMED[0] + _ASSUMED[1] * assumed and len(rows) >= assumed
                if told and problem.fits(made(program, some)):
                    found.append((index, some))
                    break
        return found

    def effects(
        self, problem: Problem, program: Values, rows: Array, right: frozenset[str]
    ) -> _Effects:
        found = _Effects(problem, program, rows, right)
        self.left -= len(found.changes)
        return found

    def proposed(self, of: _Effects, effort: int) -> Iterator[tuple[int, Set]]:
        """Yield sets of changes, with the number of changes that answers have to bear out."""
        highest_ranks = {1: 9, 2: 2, 3: 1}
        for some in of.sums(effort, highest_ranks[effort]) if effort in highest_ranks else ():
            yield effort, some
        for solved in of.solved() if effort == 2 else ():
            yield 4, (solved,)
        firsts = of.firsts() if effort == 4 else []
        after: dict[Change, _Effects] = {}
        for sizes_and_ranks in (((1, 0),), ((1, 2), (2, 1))):  # all of the likeliest ones first
            for first in firsts:
                if first not in after and self.left > 0:
                    start = of.program.changed(first.pieces)
                    after[first] = self.effects(of.problem, start, of.rows, of.right)
                for size, highest in sizes_and_ranks if first in after else ():
                    for rest in after[first].sums(size, highest):
                        yield size + 1, _merged(first, rest, of.program)


def _merged(first: Change, rest: Set, base: Values) -> Set:
    """Return a change and those after it. Two changes of the same term become one, with the
    result of both in its sentence.
    """
    merged = []
    for change in rest:
        name, index, new = change.pieces[0]
        if index is not None and (name, index) in first.places:
            says = f"in {name}: {shown(new)} for {shown((base.terms(name)[index],))}"
            change = Change(change.pieces, says, change.rank)
        merged.append(change)
    over = {place for change in rest for place in change.places}
    return tuple(merged) if over >= set(first.places) else (first, *merged)


class _Effects:
    """The effects of all single changes on the residual, in units of what is allowed."""

    def __init__(
        self, problem: Problem, program: Values, rows: Array, right: frozenset[str]
    ) -> None:
        self.problem, self.program, self.rows, self.right = problem, program, rows, right
        self.identity = parsed(problem.identity)
        given = {name: x[rows] if np.ndim(x) else x for name, x in program.given.items()}
        answer, allowed = problem.answer[rows], problem.allowed[rows]
        self.values = program.at(**given, answer=answer)
        moved = program.at(**given, answer=answer + allowed)
        residual = self.total(self.values)
        self.unit = np.abs(self.total(moved) - residual)
        self.residual = residual / self.unit
        behind = (self.values.behind(name) for term in self.identity for name, _ in term.factors)
        self.names = frozenset[str]().union(*behind) - {"answer"} - right
        # The weights of a sum over the rows that tells effects apart
        self.weights = np.random.default_rng(5).uniform(0.5, 1.5, (len(rows), 2)) / len(rows)
        self.weights[1::2] *= -1
        # Changes with the same effect, the likeliest first
        groups: dict[str, list[Change]] = {}
        effects: dict[str, Array] = {}
        for change in sorted(changes(self.values, self.names), key=lambda change: change.order):
            effect = self.total(self.values.changed(change.pieces)) / self.unit - self.residual
            if np.isfinite(effect).all() and np.abs(effect).max() > _NOTHING:
                mark = "{:.8e} {:.8e}".format(*(effect @ self.weights))
                groups.setdefault(mark, []).append(change)
                effects.setdefault(mark, effect)
        self.changes = [replace(first, others=tuple(more)) for first, *more in groups.values()]
        self.effects = np.array(list(effects.values())).reshape(-1, len(rows))

    def total(self, values: Values) -> Array:
        """Return the sum that vanishes for right answers."""
        return np.real(values.total(self.identity)[0] + 0 * self.values.given["answer"])

    def sums(self, size: int, highest: int) -> Iterator[Set]:
        """Yield sets of changes whose effects cancel the residual, the likeliest first.

        Args:
            size: The number of changes.
            highest: The highest rank of a change.
        """
        likely = [n for n, change in enumerate(self.changes) if change.rank <= highest]
        if len(likely) < size:
            return
        # All changes but the last one, and the sum that the last one has to have
        marks = self.effects[likely] @ self.weights[:, 0]
        target = -float(self.residual @ self.weights[:, 0])
        groups = np.array(list(combinations(range(len(likely)), size - 1)), dtype=int)
        missing = target - marks[groups].sum(axis=1)
        room = _SAME * (abs(target) + np.abs(marks[groups]).sum(axis=1)) + 4.0
        order = np.argsort(marks)
        low = np.searchsorted(marks[order], missing - room)
        high = np.searchsorted(marks[order], missing + room, side="right")
        if (high - low).sum() > _CROWDED:
            return
        sets: dict[tuple[int, ...], Set] = {}
        for group in np.flatnonzero(high > low).tolist():
            for last in order[low[group] : high[group]].tolist():
                members = tuple(likely[n] for n in sorted({*groups[group].tolist(), last}))
                if len(members) == size and self.cancel(members):
                    sets[members] = tuple(self.changes[n] for n in members)
        yield from sorted(sets.values(), key=likelihood)

    def cancel(self, members: tuple[int, ...]) -> bool:
        """Return True if changes of different terms leave only rounding of the residual."""
        chosen = self.effects[list(members)]
        room = 2.0 + 1e-11 * (np.abs(self.residual) + np.abs(chosen).sum(axis=0))
        places = [place for n in members for place in self.changes[n].places]
        left = np.abs(self.residual + chosen.sum(axis=0))
        return len(set(places)) == len(places) and bool((left <= room).all())

    def solved(self) -> Iterator[Change]:
        """Yield one parameter with another value, the same for all, that is solved for by the
        secant method.
        """
        row = int(np.argmax(np.abs(self.residual)))
        for name in (one for one in SYMBOLS if one in self.names):
            old = float(np.ravel(self.values.given[name])[0])
            last, off, x = old, self.residual[row] * self.unit[row], 1.001 * old
            for _ in range(15):
                now = self.total(self.values.changed([(name, None, (Term(x, ()),))]))[row]
                if now == off or not np.isfinite(now):
                    break
                last, off, x = x, now, float(x - now * (x - last) / (now - off))
            value = float(f"{x:.{_TYPED}g}")
            if np.isfinite(value) and value != old:
                piece = (name, None, (Term(value, ()),))
                yield Change((piece,), f"the inputs: {name} = {value:g}", 3)

    def firsts(self) -> list[Change]:
        """The changes whose effects point along the residual, those first that leave least of
        it.
        """
        size = (self.effects**2).sum(axis=1) * float(self.residual @ self.residual)
        along = np.nan_to_num((self.effects @ self.residual) ** 2 / size)
        pairs = zip(-along, self.changes, strict=True)
        likely = [pair for pair in pairs if pair[0] < -_DIRECTION and pair[1].rank < 2]
        return [change for _, change in sorted(likely, key=lambda pair: pair[0])[:_FIRSTS]]
