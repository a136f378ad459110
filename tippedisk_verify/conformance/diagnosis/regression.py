"""Regression: the smallest set of changes of the equations that leaves only rounding of the answers
to a quantity.

An identity such as M a - F = 0, with the answers a to v', is linear in changes of most terms. So
the effects of single changes add up, and a set of two or three of them is found as numbers with a
given sum. Where two changes multiply, the likeliest one is made in the program and the others are
sought again. The changes found are made in the program, evaluated, and compared with all answers. A
set of changes is accepted only if the wrong answers carry enough digits of evidence for so many.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, islice
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import Change, changes
from tippedisk_verify.conformance.diagnosis.entries import Answered, Array
from tippedisk_verify.conformance.diagnosis.terms import Term, Values, parsed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["Problem", "Search", "likelihood", "with_changes"]

_SAMPLES = 40  # wrong answers on which changes are tried; all others confirm
_RIGHT_SAMPLES = 8  # right ones beside them
_SAME = 1e-9  # relative difference of sums that are equal but for rounding
_NOTHING = 1e-2  # of the allowed error; smaller changes do not count
_DIRECTION = 0.15  # squared cosine to the residual that a change needs to be made first
_HIGHEST_RANKS = {1: 9, 2: 2, 3: 1}  # of so many changes at once
_FIRSTS = 12  # changes that are made first, where changes multiply
# Digits that answers must tell to bear out changes: in all, and for each change
_ASSUMED = (2.0, 3.0)
_CROWDED = 20_000  # sets with nearly the same sum: effects too small to tell them apart
_TYPED = 6  # digits of a number that somebody types in
_SOLVED = 4  # changes that answers must bear out for such a number
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

    @cached_property
    def sample(self) -> Array:
        """The rows on which changes are tried, most of them of wrong answers."""
        picked = []
        for mask, most in ((self.left, _SAMPLES), (~self.left, _RIGHT_SAMPLES)):
            rows = np.flatnonzero(mask)
            picked.append(rows[:: max(1, len(rows) // most)][:most])
        return np.sort(np.concatenate(picked))

    @cached_property
    @np.errstate(all="ignore")
    def most(self) -> int:
        """The number of changes that the answers bear out; each takes digits, and a row."""
        digits = np.log10(np.abs(self.answer - self.truth) / self.allowed)[self.left]
        _, first = np.unique([f"{x:.8e}" for x in self.answer[self.left]], return_index=True)
        evidence = np.clip(np.nan_to_num(digits[first]), 0, 8).sum()
        return min(int((evidence - _ASSUMED[0]) / _ASSUMED[1]), len(self.sample))


def likelihood(some: Iterable[Change]) -> list[int]:
    """Return the sort key of sets of changes, the likeliest first."""
    return [sum(parts) for parts in zip(*(change.order for change in some), strict=True)]


def with_changes(values: Values, some: Iterable[Change]) -> Values:
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
        that it needs; one for each program that needs no more.

        Args:
            problem: The answers to one quantity.
            programs: Definitions that may be changed, with the problem's inputs, and the names of
                those that right answers come from and that stay; the likeliest first.
            efforts: 1 looks for single changes, 2 for two, 3 for three, 4 for changes that
                multiply; the lower ones come first.
        """
        effects = [
            self.effects(problem, program, right)
            for program, right in programs
            if self.left > 0 and problem.most > 0
        ]
        for effort in range(1, efforts + 1):
            found = [
                (index, some)
                for index, of in enumerate(effects)
                for some in islice(filter(of.fits, self.proposed(of, effort)), 1)
            ]
            if found:
                return found
        return []

    def effects(self, problem: Problem, program: Values, right: frozenset[str]) -> _Effects:
        found = _Effects(problem, program, right)
        self.left -= len(found.changes)
        return found

    def proposed(self, of: _Effects, effort: int) -> Iterator[Set]:
        """Yield sets of changes that may give the answers."""
        if effort in _HIGHEST_RANKS:
            yield from of.sums(effort, _HIGHEST_RANKS[effort])
            yield from of.solved() if effort == 2 else ()
        elif self.left > 0:
            for first in of.firsts():
                after = self.effects(of.problem, of.program.changed(first.pieces), of.right)
                for size, highest in ((1, 2), (2, 1)):
                    for rest in after.sums(size, highest):
                        yield (first, *rest)


class _Effects:
    """The effects of all single changes on the residual, in units of what is allowed."""

    def __init__(self, problem: Problem, program: Values, right: frozenset[str]) -> None:
        self.problem, self.program, self.right = problem, program, right
        self.identity, rows = parsed(problem.identity), problem.sample
        given = {name: x[rows] if np.ndim(x) else x for name, x in program.given.items()}
        answer, allowed = problem.answer[rows], problem.allowed[rows]
        self.values = values = program.at(**given, answer=answer)
        moved = program.at(**given, answer=answer + allowed)
        self.unit = unit = np.abs(self.total(moved) - self.total(values))
        self.residual = self.total(values) / unit
        self.names = values.total(self.identity)[1] - {"answer"} - right
        # The weights of a sum over the rows that tells effects apart
        self.weights = np.random.default_rng(5).normal(size=len(rows)) / len(rows)
        groups: dict[str, tuple[Array, list[Change]]] = {}
        for change in sorted(changes(values, self.names), key=lambda change: change.order):
            effect = self.total(values.changed(change.pieces)) / unit - self.residual
            if np.isfinite(effect).all() and np.abs(effect).max() > _NOTHING:
                mark = f"{effect @ self.weights:.8e}"
                groups.setdefault(mark, (effect, []))[1].append(change)
        # The likeliest of the changes with the same effect
        self.changes = [replace(first, others=tuple(more)) for _, (first, *more) in groups.values()]
        self.effects = np.array([effect for effect, _ in groups.values()]).reshape(-1, len(rows))

    def fits(self, some: Set) -> bool:
        """Return True if the answers bear out so many changes, and come from them."""
        return len(some) <= self.problem.most and self.problem.fits(
            with_changes(self.program, some)
        )

    def total(self, values: Values) -> Array:
        """Return the sum that vanishes for right answers."""
        return np.real(values.total(self.identity)[0] + 0 * values.given["answer"])

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
        marks = self.effects[likely] @ self.weights
        target = -float(self.residual @ self.weights)
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

    def solved(self) -> Iterator[Set]:
        """For each parameter, find by the secant method a single wrong value that would explain the
        answers, and yield it as a change.
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
            if np.isfinite(x) and self.problem.most >= _SOLVED:
                text = f"{x:.{_TYPED}g}"
                piece = (name, None, (Term(float(text), ()),))
                yield (Change((piece,), f"the inputs: {name} = {text}", 3),)

    def firsts(self) -> list[Change]:
        """The changes whose effects are nearly parallel to the residual, the most effective first."""
        size = (self.effects**2).sum(axis=1) * float(self.residual @ self.residual)
        along = np.nan_to_num((self.effects @ self.residual) ** 2 / size)
        pairs = zip(-along, self.changes, strict=True)
        likely = [pair for pair in pairs if pair[0] < -_DIRECTION and pair[1].rank < 2]
        return [change for _, change in sorted(likely, key=lambda pair: pair[0])[:_FIRSTS]]
