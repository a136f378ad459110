"""The diagnosis of a sheet level by level: mistakes found at one level are known at the next.

At each level, wrong answers that follow from known mistakes are explained first. Then relations
that explain the whole level are tried, then changes of the equations, then other relations. What a
step explains is marked in the tables.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import Change
from tippedisk_verify.conformance.diagnosis.quantities import (
    MISTAKEN_PREDICTIONS,
    PREDICTIONS,
    predicted_answers,
    regression_problems,
)
from tippedisk_verify.conformance.diagnosis.regression import (
    RegressionProblem,
    Search,
    likelihood_sort_key,
    program_with_changes,
)
from tippedisk_verify.conformance.diagnosis.relations import (
    Relation,
    condition_phrase,
    relation_sentence,
    relations_of,
)
from tippedisk_verify.conformance.diagnosis.tables import Array, Table
from tippedisk_verify.conformance.diagnosis.terms import EquationValues
from tippedisk_verify.conformance.grading import LEVEL_NAMES, Grade
from tippedisk_verify.reference_values.store import Store, is_optional

__all__ = ["Diagnosis", "SheetDiagnosis"]

# Changes that may be evaluated for a sheet, which takes about two seconds
_MAX_CHANGES_EVALUATED = 25_000
# A quantity only lacks its last digits if the median and the maximum of its relative errors are
# below the first two numbers, and the share of its answers that fail is above the third.
_LOST_MEDIAN, _LOST_MOST, _LOST_SHARE = 1e-5, 1e-2, 0.3
_FULL_PRECISION = 1e-15  # relative error up to which no digit is lost
# The factor on the allowed error of a program on the slow manifold. It differentiates five times,
# and the right equations alone use up half of the allowed error.
_SLOW_MANIFOLD_FACTOR = 10.0
# Changes with the same effect on one quantity that are tried on the other quantities
_MAX_EQUIVALENT_CHANGES = 12
_ROUNDING_TOLERANCE = 1e-9  # relative difference of values that are equal but for rounding
_LAST_FORMULA_LEVEL = 5  # the last level without an integrator
# The friction laws of a program that answers the questions for a law, by that law
_LAWS = {
    "both": frozenset({"linear", "smooth"}),
    "linear": frozenset({"linear"}),
    "smooth": frozenset({"smooth"}),
}
Causes = list[tuple[str, str]]  #: causes of wrong answers, each as its sort and its sentence
#: Changes of the equations, each with the friction laws that have it
ChangesByLaw = dict[Change, frozenset[str]]


@dataclass(frozen=True)
class Diagnosis:
    """The failed answers to the questions of one level, with their causes as far as
    they are known.
    """

    level: int
    failed: tuple[Grade, ...]
    #: The causes, which act together, each as its sort and its sentence; () if none is known
    causes: tuple[tuple[str, str], ...]
    #: The number of failed answers that follow from mistakes named at earlier levels
    follows: int
    unexplained: int
    no_numbers: int  #: the number of failed answers that are not finite; no mistake predicts them
    where: str = ""  #: the unexplained answers, by quantity and condition
    #: True if unexplained answers may follow from mistakes named at earlier levels
    may_follow: bool = False

    def _parts_of_ids(self, place: int) -> list[str]:
        """Return the parameter sets (place 0) or the friction laws (1) of the failed answers."""
        return sorted({grade.id.split("/")[place] for grade in self.failed})

    @property
    def too_few_digits(self) -> int:
        """The number of failed answers that are right but have too few digits."""
        return sum(grade.verdict == "few-digits" for grade in self.failed)

    @property
    def status(self) -> str:
        """One word: explained, partly, unexplained, follows or may-follow from earlier levels, or
        no-numbers.
        """
        if self.unexplained:
            return (
                "partly"
                if self.causes or self.follows
                else "may-follow"
                if self.may_follow
                else "unexplained"
            )
        return "explained" if self.causes else "follows" if self.follows else "no-numbers"

    def summary(self) -> str:
        """Return the diagnosis of one level in one line of text: the failures, their causes, and
        what is unexplained.
        """
        sets, frictions = self._parts_of_ids(0), self._parts_of_ids(1)
        laws = f"{frictions[0]} friction" if frictions in (["linear"], ["smooth"]) else "both laws"
        text = f"level {self.level}, {LEVEL_NAMES[self.level]} ({' and '.join(sets)}, {laws}): "
        counts = (
            (len(self.failed) - self.too_few_digits, "wrong"),
            (self.too_few_digits, "with too few digits only"),
        )
        text += ", ".join(f"{count} {how}" for count, how in counts if count)
        if any(is_optional(grade.id) for grade in self.failed):
            text += " (with optional answers)"
        if self.no_numbers:
            text += f", {self.no_numbers} of them not finite"
        if len(self.causes) > 1:
            text += "; likely causes, together: " + "; ".join(
                f"({n}) {sentence}" for n, (_, sentence) in enumerate(self.causes, 1)
            )
        elif self.causes:
            text += f"; likely cause: {self.causes[0][1]}"
        if self.follows:
            text += f"; {self.follows} follow from what is named at earlier levels"
        if self.unexplained and self.may_follow:
            text += f"; {self.unexplained} unexplained that may follow from what is named at earlier levels"
        elif self.unexplained:
            text += f"; {self.unexplained} unexplained" + (f" ({self.where})" if self.where else "")
        return text

    def to_dict(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "sets": self._parts_of_ids(0),
            "frictions": self._parts_of_ids(1),
            "failed": len(self.failed),
            "too_few_digits": self.too_few_digits,
            "no_numbers": self.no_numbers,
            "status": self.status,
            "causes": [{"name": name, "cause": sentence} for name, sentence in self.causes],
            "follows": self.follows,
            "unexplained": self.unexplained,
            "where": self.where,
        }


class SheetDiagnosis:
    """The diagnosis of one sheet of answers: the mistakes found so far, and the answers that they
    explain.

    Args:
        tables: The graded answers. Their masks ``unexplained`` of unexplained answers are changed
            in place.
        store: The questions with their truths.
        advance: A function that is called with a label and a number of steps.
    """

    def __init__(
        self, tables: Sequence[Table], store: Store, advance: Callable[[str, int], None]
    ) -> None:
        self.tables = sorted(tables, key=lambda table: (table.level, table.friction))
        levels = {table.level for table in tables}
        self.truths = {one.id: one.for_doubles for one in store.values() if one.level in levels}
        self.advance, self.search = advance, Search(_MAX_CHANGES_EVALUATED)
        self.changes: ChangesByLaw = {}

    def diagnose_level(self, level: int, grades: Sequence[Grade]) -> Diagnosis:
        """Diagnose the wrong answers of one level, and keep the mistakes found for the later
        levels.

        The program that gave the answers is assumed to have the mistakes that were named at earlier
        levels.

        Args:
            level: The level.
            grades: The grades of the sheet, of all levels.
        """
        tables = [table for table in self.tables if table.level == level]
        wrong, earlier = _count_unexplained(tables), dict(self.changes)
        self.find_consequences(tables)
        follows = wrong - _count_unexplained(tables)
        trial = [replace(table, unexplained=table.unexplained.copy()) for table in tables]
        causes = self.find_relations(trial)
        if not _count_unexplained(trial):
            tables = trial
        else:
            self.search_equations(tables)
            causes = self.find_relations(tables)
            causes += self.find_lost_digits(tables if level <= _LAST_FORMULA_LEVEL else ())
        is_asked_for_both = _LAWS["both"] <= {table.friction for table in tables}
        new_mistakes = [
            (
                "equations",
                change.sentence
                + (f", under the {min(laws)} law" if is_asked_for_both and len(laws) == 1 else ""),
            )
            for change, laws in self.changes.items()
            if change not in earlier
        ]
        failed = tuple(grade for grade in grades if grade.failed and grade.level == level)
        return Diagnosis(
            level,
            failed,
            causes=(*new_mistakes, *causes),
            follows=follows,
            unexplained=_count_unexplained(tables),
            no_numbers=len(failed) - wrong,
            where="; ".join(condition_phrase(table) for table in tables if table.unexplained.any()),
            may_follow=bool(earlier) and level > 1,
        )

    # ---- programs with changes
    def find_consequences(self, tables: Sequence[Table]) -> None:
        """Mark as explained the wrong answers in tables that follow from the mistakes known so far.

        A quantity is marked if a program with the mistakes gives all of its unexplained answers.
        """
        for table in tables if self.changes else ():
            tolerance = table.allowed * (
                _SLOW_MANIFOLD_FACTOR if table.kind == "slow-manifold" else 1.0
            )
            known = _changes_under_law(self.changes, table.friction)
            for function in PREDICTIONS.get(table.kind, ()):
                fits = table.agrees_with(predicted_answers(table, known, function), tolerance)
                for quantity in np.unique(table.quantity_names[table.unexplained]):
                    mine = table.unexplained & (table.quantity_names == quantity)
                    table.unexplained[mine] = not fits[mine].all()

    # ---- changes of the equations
    def search_equations(self, tables: Sequence[Table]) -> None:
        """Search for mistakes in the equations that explain wrong answers, one quantity at a time.

        The order is that of the equations. The changes found are kept on this object. The answers
        that they give are marked as explained.

        Args:
            tables: The tables of the answers.
        """
        posed = self.posed_problems(tables)
        for n in range(len(posed)):
            problem, table = posed[n], posed[n].table
            if problem.unexplained.any():
                self.advance(f"level {table.level}, {problem.name}", 1)
                if self.adopt_changes(problem, posed):
                    table.unexplained[table.names == problem.name] = False
                if table.kind == "slow-manifold":  # each order is computed from the lower ones
                    posed = self.posed_problems(tables)
        self.find_consequences(tables)

    def posed_problems(self, tables: Sequence[Table]) -> list[RegressionProblem]:
        """Return the quantities of tables whose answers can be searched for mistakes in the
        equations, each as a problem that uses the known changes of the table's friction law.
        """
        return [
            problem
            for table in tables
            for problem in regression_problems(
                table, _changes_under_law(self.changes, table.friction)
            )
        ]

    def adopt_changes(self, problem: RegressionProblem, posed: Sequence[RegressionProblem]) -> bool:
        """Find the fewest mistakes in the equations that give the answers to a quantity, and keep
        them as known.

        Known changes are tried first.

        Args:
            problem: The answers to the quantity, and its definition.
            posed: All problems of the search. The definitions behind quantities that a program
                gives already stay as they are.

        Returns:
            True if there are such changes.
        """
        table = problem.table
        if table.kind == "slow-manifold":  # orders share their definitions
            posed = []
        choices = [self.changes, *self.equivalent_choices(problem, posed)]
        choices += [{}] if self.changes and table.level > 1 else []
        programs = [
            (
                _program(problem, changes),
                _names_behind_given_answers(posed, changes, table.friction),
            )
            for changes in choices
        ]
        max_effort = 4 if table.level == 1 else 2
        fitting = [n for n, (program, _) in enumerate(programs) if problem.fits(program)]
        found = [(n, ()) for n in fitting[:1]] or self.search(problem, programs, max_effort)
        if not found:
            return False
        known = [_changes_under_law(changes, table.friction) for changes in choices]
        index, new = min(found, key=lambda pair: likelihood_sort_key((*known[pair[0]], *pair[1])))
        self.changes = choices[index] or self.changes
        for change in (*known[index], *new):
            self.changes[change] = self.changes.get(change, frozenset()) | _LAWS[table.friction]
        return True

    @np.errstate(all="ignore")
    def equivalent_choices(
        self, problem: RegressionProblem, posed: Sequence[RegressionProblem]
    ) -> list[ChangesByLaw]:
        """Return other choices of the known mistakes that explain the same answers.

        In each choice, one known change is replaced by a change that had the same effect on the
        quantity for which it was found. The replacement has another effect on the quantity of
        ``problem``.

        Args:
            problem: The quantity whose answers are not yet explained.
            posed: All problems. A choice gives all answers that the known changes give.
        """
        explained = [one for one in posed if one.fits(_program(one, self.changes))]
        values = [_program(problem, self.changes)[problem.definition]]
        choices = []
        known = _changes_under_law(self.changes, problem.table.friction)
        for change in known if posed else ():
            for other in change.equivalent[:_MAX_EQUIVALENT_CHANGES]:
                rest = tuple(one for one in (change, *change.equivalent) if one != other)
                replaced = {change: replace(other, equivalent=rest)}
                changes = {replaced.get(one, one): laws for one, laws in self.changes.items()}
                value = _program(problem, changes)[problem.definition]
                is_new = not any(
                    np.allclose(value, earlier, rtol=_ROUNDING_TOLERANCE, atol=0)
                    for earlier in values
                )
                if is_new and all(one.fits(_program(one, changes)) for one in explained):
                    values.append(value)
                    choices.append(changes)
        return choices

    # ---- digits and relations
    def find_lost_digits(self, tables: Sequence[Table]) -> Causes:
        """Mark as explained the quantities whose answers lack only their last digits.

        They are compared with a program that has all mistakes found so far. Their relative errors
        are small, and too many of their answers fail.

        Args:
            tables: The tables of a level.

        Returns:
            The numbers of right digits, as causes.
        """
        lost: dict[tuple[int, str], list[str]] = {}
        for table in (table for table in tables if table.unexplained.any()):
            expected = self.expected(table)
            size = np.abs(table.answer - expected) / np.maximum(np.abs(expected), table.scale)
            law = f" ({table.friction} law)" if table.friction != "both" else ""
            for quantity in np.unique(table.quantity_names[table.unexplained]):
                mine = table.quantity_names == quantity
                middle, share = float(np.median(size[mine])), table.unexplained[mine].mean()
                loses = _FULL_PRECISION < middle < _LOST_MEDIAN and size[mine].max() < _LOST_MOST
                if loses and share > _LOST_SHARE:
                    why = (
                        "the digits that difference quotients leave"
                        if quantity.startswith("dv")
                        else "too few"
                    )
                    lost.setdefault((int(-np.log10(middle)), why), []).append(f"{quantity}{law}")
                    table.unexplained[mine] = False
        return [
            ("digits", f"some {digits} digits of {', '.join(sorted(names))} are right: {why}")
            for (digits, why), names in sorted(lost.items())
        ]

    def expected(self, table: Table) -> Array:
        """Return the answers to a table's questions that follow from the mistakes found so far.

        Where these mistakes predict no value, the truth is returned.
        """
        known = _changes_under_law(self.changes, table.friction)
        if not known or table.kind not in PREDICTIONS:
            return table.truth
        predicted = predicted_answers(table, known)
        return np.where(np.isfinite(predicted), predicted, table.truth)

    def find_relations(self, tables: Sequence[Table]) -> Causes:
        """Mark as explained the quantities whose wrong answers have a simple relation to right
        values, such as the wrong sign.

        The values that follow from the mistakes found so far are taken for the right ones. A
        relation of many quantities comes before one of few.

        Args:
            tables: The tables of a level.

        Returns:
            The relations, as causes.
        """
        wrong_tables = [
            replace(table, truth=self.expected(table))
            for table in tables
            if table.unexplained.any()
        ]
        truths, groups, causes = dict(self.truths), dict[str, list[Relation]](), Causes()
        for table in wrong_tables:
            truths.update(zip(table.ids, table.truth.tolist(), strict=True))
        for table in wrong_tables:
            known = _changes_under_law(self.changes, table.friction)
            variants = {
                sentence: predicted_answers(table, known, function)
                for sentence, function in MISTAKEN_PREDICTIONS.get(table.kind, {}).items()
            }
            for relation in relations_of(table, truths, variants):
                groups.setdefault(relation.sentence, []).append(relation)
        all_quantities = {
            (table.friction, quantity)
            for table in tables
            for quantity in np.unique(table.quantity_names)
        }
        for group in sorted(
            groups.values(),
            key=lambda group: (-len(group), min(relation.rank for relation in group)),
        ):
            sentence = group[0].sentence
            new = [
                relation for relation in group if relation.table.unexplained[relation.answers].all()
            ]
            if not new or (len(new) < 2 and re.search(r"order|\^n|n!", sentence)):
                continue  # one order alone proves nothing
            causes.append(
                (
                    "relation",
                    relation_sentence(
                        sentence,
                        {(relation.table.friction, relation.quantity) for relation in new},
                        all_quantities,
                    ),
                )
            )
            for relation in new:
                relation.table.unexplained[relation.answers] = False
        return causes


def _changes_under_law(changes: ChangesByLaw, law: str) -> list[Change]:
    """Return the changes of the equations that are known under a friction law. Questions for both
    laws are answered with the linear one.
    """
    law = "smooth" if law == "smooth" else "linear"
    return [change for change, laws in changes.items() if law in laws]


def _program(problem: RegressionProblem, changes: ChangesByLaw) -> EquationValues:
    """Return a program with some mistakes, with the inputs of a problem and under its law."""
    law = problem.table.friction
    return program_with_changes(law, _changes_under_law(changes, law), problem.inputs)


def _names_behind_given_answers(
    posed: Iterable[RegressionProblem], changes: ChangesByLaw, law: str
) -> frozenset[str]:
    """Return the names of the definitions that need no change: those from which a program with
    some mistakes computes quantities as they were answered.

    Args:
        posed: The quantities. Those under the other friction law are left out.
        changes: The changes of the equations that the program has.
        law: The friction law of the program.
    """
    programs = [
        (one, _program(one, changes)) for one in posed if one.table.friction in ("both", law)
    ]
    return frozenset[str]().union(
        *(program.inputs_of(one.definition) for one, program in programs if one.fits(program))
    )


def _count_unexplained(tables: Iterable[Table]) -> int:
    """Return the number of wrong answers in tables that are unexplained."""
    return sum(int(table.unexplained.sum()) for table in tables)
