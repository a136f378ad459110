"""Regression: the smallest set of changes that gives the answers to a quantity, up to rounding.

An identity is a sum that vanishes for right answers, such as M a - F with the answers a to v'. Its
value for the given answers is the *residual*. The *effect* of a change is by how much the residual
changes with it. The identity is linear in changes of most terms, so effects add up. A set of two
or three changes is found as numbers with a given sum.

Where two changes multiply, a likely change is made in the program first, and the others are
searched again. Each set found is made in the program, and the values are compared with all
answers. A set is accepted only if the wrong answers have enough digits of evidence for its size.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, combinations, islice
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import LINEAR, SMOOTH, Change, changes
from tippedisk_verify.conformance.diagnosis.tables import Array, ComparedAnswers, Table
from tippedisk_verify.conformance.diagnosis.terms import EquationValues, Term
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["RegressionProblem", "Search", "likelihood_sort_key", "program_with_changes"]

_SAMPLES = 40  # wrong answers on which changes are tried; all answers must confirm them
_RIGHT_SAMPLES = 8  # right answers on which changes are tried
_ROUNDING_TOLERANCE = 1e-9  # relative difference of sums that are equal but for rounding
_NEGLIGIBLE_SHARE = 1e-2  # of the allowed error; smaller changes do not count
# Least squared cosine between the residual and the effect of a first change
_MIN_SQUARED_COSINE = 0.15
_HIGHEST_RANKS = {1: 9, 2: 2, 3: 1}  # highest rank of a change, by the number of changes in a set
_MAX_FIRST_CHANGES = 12  # changes that are made first, where changes multiply
# Digits of evidence that a set of changes needs: once, and for each change
_EVIDENCE_ONCE, _EVIDENCE_PER_CHANGE = 2.0, 3.0
_MAX_SIMILAR_SETS = 20_000  # sets with nearly the same sum: effects too small to tell them apart
_TYPED_DIGITS = 6  # digits of a number that somebody types in
# Changes for which there must be evidence before such a number is proposed
_MIN_EVIDENCE_FOR_TYPED_NUMBER = 4
ChangeSet = tuple[Change, ...]


@dataclass(frozen=True, eq=False)
class RegressionProblem(ComparedAnswers):
    """The answers to one quantity, with its definition and an identity that right
    answers satisfy.
    """

    table: Table
    name: str
    definition: str
    identity: str  #: a sum that vanishes for right answers, which it contains as ``answer``
    inputs: Mapping[str, Any]

    @np.errstate(all="ignore")
    def fits(self, values: EquationValues) -> bool:
        """Return True if a program with mistakes would give all these answers to the quantity.

        Wrong answers must be ten times closer to its values than to the truth.

        Args:
            values: The program with the inputs of these answers.
        """
        return bool(self.agrees_with(np.real(values[self.definition]) + 0 * self.answer).all())

    @cached_property
    def sample(self) -> Array:
        """The indices of the answers with which possible mistakes are tried: at most 40 wrong and 8
        right ones.
        """
        wrong, right = np.flatnonzero(self.unexplained), np.flatnonzero(~self.unexplained)
        sampled_rows = [
            rows[:: max(1, len(rows) // most)][:most]
            for rows, most in ((wrong, _SAMPLES), (right, _RIGHT_SAMPLES))
        ]
        return np.sort(np.concatenate(sampled_rows))

    @cached_property
    @np.errstate(all="ignore")
    def max_changes(self) -> int:
        """The largest number of mistakes that the wrong answers are enough evidence for.

        Evidence is counted in digits of the error, and equal answers count once. The number is
        never larger than that of the answers in ``sample``.
        """
        digits = np.log10(np.abs(self.answer - self.truth) / self.allowed)[self.unexplained]
        _, first = np.unique([f"{x:.8e}" for x in self.answer[self.unexplained]], return_index=True)
        evidence = np.clip(np.nan_to_num(digits[first]), 0, 8).sum()
        return min(int((evidence - _EVIDENCE_ONCE) / _EVIDENCE_PER_CHANGE), len(self.sample))


def likelihood_sort_key(change_set: Iterable[Change]) -> list[int]:
    """Return a key by which sets of changes are sorted: the likelier a set of mistakes, the lower
    its key.

    Args:
        change_set: The changes of the set.
    """
    return [sum(parts) for parts in zip(*(change.sort_key for change in change_set), strict=True)]


def with_changes(values: EquationValues, change_set: Iterable[Change]) -> EquationValues:
    """Return the equations of a program after several changes have been made in them, one after
    another.

    Args:
        values: The program to be changed; it stays as it is.
        change_set: The changes.
    """
    return values.with_substitutions(
        [part for change in change_set for part in change.substitutions]
    )


def program_with_changes(
    law: str, change_set: Iterable[Change], inputs: Mapping[str, Any]
) -> EquationValues:
    """Return the equations of a program with mistakes, ready for evaluation.

    They are the right equations under a friction law, in which some changes have been made.

    Args:
        law: The friction law; the linear law unless it is "smooth".
        change_set: The changes.
        inputs: Values by name, each in place of the definition of that name.
    """
    right = EquationValues(SMOOTH if law == "smooth" else LINEAR, {"pi": np.pi})
    return with_changes(right.with_inputs(**inputs), change_set)


class Search:
    """The search for the fewest changes of the equations that give the wrong answers to a quantity.

    The number of changes that it evaluates for a sheet is limited, so that it always ends in time.

    Args:
        budget: The number of changes that may be evaluated.
    """

    def __init__(self, budget: int) -> None:
        self.remaining_changes = budget  #: changes that may still be evaluated

    @np.errstate(all="ignore")
    def __call__(
        self,
        problem: RegressionProblem,
        programs: Sequence[tuple[EquationValues, frozenset[str]]],
        max_effort: int,
    ) -> list[tuple[int, ChangeSet]]:
        """Return the smallest sets of changes that give all answers to a quantity.

        Args:
            problem: The answers to the quantity, and its definition.
            programs: Programs with the problem's inputs, the likeliest first. Each comes with the
                names of the definitions behind right answers, which are not changed.
            max_effort: The highest effort: 1, 2 and 3 search for as many changes, 4 for changes
                that multiply. A higher effort is made only if the lower ones find nothing.

        Returns:
            Pairs of a program's index and a set, at most one to a program; [] if nothing is sets.
        """
        effects_by_program = [
            self.evaluate_effects(problem, program, unchanged_names)
            for program, unchanged_names in programs
            if self.remaining_changes > 0 and problem.max_changes > 0
        ]
        for effort in range(1, max_effort + 1):
            sets = [
                (index, some)
                for index, effects in enumerate(effects_by_program)
                for some in islice(filter(effects.fits, self.proposed_sets(effects, effort)), 1)
            ]
            if sets:
                return sets
        return []

    def evaluate_effects(
        self, problem: RegressionProblem, program: EquationValues, unchanged_names: frozenset[str]
    ) -> _Effects:
        effects = _Effects(problem, program, unchanged_names)
        self.remaining_changes -= len(effects.changes)
        return effects

    def proposed_sets(self, effects: _Effects, effort: int) -> Iterator[ChangeSet]:
        """Yield sets of changes that may give the wrong answers to a quantity: their effects cancel
        the residual.

        Args:
            effects: The effects of all single changes.
            effort: The number of changes in a set, 1 to 3. 4 tries sets whose effects do not simply
                add up.
        """
        if effort in _HIGHEST_RANKS:
            yield from effects.cancelling_sets(effort, _HIGHEST_RANKS[effort])
            yield from effects.solved_parameters() if effort == 2 else ()
        elif self.remaining_changes > 0:
            for first in effects.first_changes():
                after = self.evaluate_effects(
                    effects.problem,
                    effects.program.with_substitutions(first.substitutions),
                    effects.unchanged_names,
                )
                for rest in chain(after.cancelling_sets(1, 2), after.cancelling_sets(2, 1)):
                    yield (first, *rest)


class _Effects:
    """The effects of all single changes of the equations on the residual of the answers to a
    quantity.

    They are in units of the allowed error.

    Args:
        problem: The answers to a quantity, and its identity.
        program: The program that is changed.
        unchanged_names: The names of definitions that are not changed.
    """

    def __init__(
        self, problem: RegressionProblem, program: EquationValues, unchanged_names: frozenset[str]
    ) -> None:
        self.problem, self.program, self.unchanged_names = problem, program, unchanged_names
        self.identity, rows = f"({problem.identity})", problem.sample
        given = {name: x[rows] if np.ndim(x) else x for name, x in program.inputs.items()}
        answer, allowed = problem.answer[rows], problem.allowed[rows]
        self.values = values = program.at_inputs(**given, answer=answer)
        self.allowed_residual = allowed_residual = np.abs(
            self.identity_value(program.at_inputs(**given, answer=answer + allowed))
            - self.identity_value(values)
        )
        self.residual = self.identity_value(values) / allowed_residual
        self.names = values.inputs_of(self.identity) - {"answer", self.identity} - unchanged_names
        # Random weights: effects are compared by their weighted sums over the sample
        self.weights = np.random.default_rng(5).normal(size=len(rows)) / len(rows)
        groups: dict[str, tuple[Array, list[Change]]] = {}
        for change in sorted(changes(values, self.names), key=lambda change: change.sort_key):
            effect = (
                self.identity_value(values.with_substitutions(change.substitutions))
                / allowed_residual
                - self.residual
            )
            if np.isfinite(effect).all() and np.abs(effect).max() > _NEGLIGIBLE_SHARE:
                groups.setdefault(f"{effect @ self.weights:.8e}", (effect, []))[1].append(change)
        # The likeliest change of each effect, which keeps the others
        self.changes = [
            replace(first, equivalent=tuple(more)) for _, (first, *more) in groups.values()
        ]
        self.effects = np.array([effect for effect, _ in groups.values()]).reshape(-1, len(rows))

    def fits(self, change_set: ChangeSet) -> bool:
        """Return True if a program with a set of changes gives all answers to the quantity, and
        these are enough evidence for so large a set.
        """
        return len(change_set) <= self.problem.max_changes and self.problem.fits(
            with_changes(self.program, change_set)
        )

    def identity_value(self, values: EquationValues) -> Array:
        """Return the value of the quantity's identity for each answer of the sample; it is 0 for an
        answer that the program gives.

        Args:
            values: The program with the inputs and the answers of the sample.
        """
        return np.real(values[self.identity] + 0 * values.inputs["answer"])

    def cancelling_sets(self, size: int, highest: int) -> Iterator[ChangeSet]:
        """Yield the sets of changes whose effects on the answers' residual cancel it, the likeliest
        first.

        Nothing is yielded if too many sets have nearly the right sum.

        Args:
            size: The number of changes in a set.
            highest: The highest rank of a change.
        """
        likely = [n for n, change in enumerate(self.changes) if change.rank <= highest]
        if len(likely) < size:
            return
        # All changes of a set but the last, and the weighted sum that the last must have
        weighted_effects = self.effects[likely] @ self.weights
        target = -float(self.residual @ self.weights)
        groups = np.array(list(combinations(range(len(likely)), size - 1)), dtype=int)
        missing_effect = target - weighted_effects[groups].sum(axis=1)
        tolerance = (
            _ROUNDING_TOLERANCE * (abs(target) + np.abs(weighted_effects[groups]).sum(axis=1)) + 4.0
        )
        order = np.argsort(weighted_effects)
        low = np.searchsorted(weighted_effects[order], missing_effect - tolerance)
        high = np.searchsorted(weighted_effects[order], missing_effect + tolerance, side="right")
        if (high - low).sum() > _MAX_SIMILAR_SETS:
            return
        members = {
            tuple(sorted({*groups[group].tolist(), last}))
            for group in np.flatnonzero(high > low).tolist()
            for last in order[low[group] : high[group]].tolist()
        }
        sets = [tuple(likely[n] for n in one) for one in sorted(members) if len(one) == size]
        cancelling = [[self.changes[n] for n in one] for one in sets if self.cancels_residual(one)]
        yield from map(tuple, sorted(cancelling, key=likelihood_sort_key))

    def cancels_residual(self, members: tuple[int, ...]) -> bool:
        """Return True if the effects of changes add up to minus the residual, except for rounding.

        It is False if two of the changes concern the same term.

        Args:
            members: The indices of the changes.
        """
        chosen = self.effects[list(members)]
        tolerance = 2.0 + 1e-11 * (np.abs(self.residual) + np.abs(chosen).sum(axis=0))
        places = [
            substitution[:2] for n in members for substitution in self.changes[n].substitutions
        ]
        remainder = np.abs(self.residual + chosen.sum(axis=0))
        return len(set(places)) == len(places) and bool((remainder <= tolerance).all())

    def solved_parameters(self) -> Iterator[ChangeSet]:
        """Yield possible mistakes in the inputs: for each parameter, a wrong value that cancels the
        largest residual of the answers.

        The value is found by the secant method, and rounded to six digits.
        """
        row = int(np.argmax(np.abs(self.residual)))
        for name in (one for one in SYMBOLS if one in self.names):
            old = float(np.ravel(self.values.inputs[name])[0])
            last, off, x = old, self.residual[row] * self.allowed_residual[row], 1.001 * old
            for _ in range(15):
                now = self.identity_value(
                    self.values.with_substitutions([(name, None, (Term(x, ()),))])
                )[row]
                if now == off or not np.isfinite(now):
                    break
                last, off, x = x, now, float(x - now * (x - last) / (now - off))
            if np.isfinite(x) and self.problem.max_changes >= _MIN_EVIDENCE_FOR_TYPED_NUMBER:
                text = f"{x:.{_TYPED_DIGITS}g}"
                substitution = (name, None, (Term(float(text), ()),))
                yield (Change((substitution,), f"the inputs: {name} = {text}", 3),)

    def first_changes(self) -> list[Change]:
        """Return up to twelve likely changes whose effects are nearly parallel to the answers'
        residual.
        """
        size = (self.effects**2).sum(axis=1) * float(self.residual @ self.residual)
        along = np.nan_to_num((self.effects @ self.residual) ** 2 / size)
        order = [n for n in np.argsort(-along, kind="stable") if along[n] > _MIN_SQUARED_COSINE]
        return [self.changes[n] for n in order if self.changes[n].rank < 2][:_MAX_FIRST_CHANGES]
