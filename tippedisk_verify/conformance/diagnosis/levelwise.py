"""The diagnosis of a sheet level by level: mistakes found at one level are known at the next.

At each level, wrong answers that follow from known mistakes are explained first. Then relations
that explain the whole level are tried, then changes of the equations, then other relations. What a
step explains is marked in the tables.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import product

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import Change
from tippedisk_verify.conformance.diagnosis.level_diagnosis import Diagnosis
from tippedisk_verify.conformance.diagnosis.quantities import (
    MISTAKEN_PREDICTIONS,
    PREDICTIONS,
    predicted_answers,
    regression_problems,
    values_at_entries,
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
from tippedisk_verify.conformance.diagnosis.step_methods import recognise_step_method
from tippedisk_verify.conformance.diagnosis.tables import EXPLAINED_LAST, Array, Table
from tippedisk_verify.conformance.grading import Grade
from tippedisk_verify.reference_values.store import Store

__all__ = ["SheetDiagnosis"]

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
_LAW_ORDER = ("both", "linear", "smooth")
# Kinds that are explained completely, or not at all
_ALL_OR_NOTHING_KINDS = ("equilibrium", "slow-manifold")
PosedProblems = Sequence[tuple[Table, RegressionProblem]]
#: Changes of the equations, each with the friction laws that have it
ChangesByLaw = dict[Change, frozenset[str]]
#: The changes under one friction law, and all changes from which they were taken
ChangeChoice = tuple[list[Change], ChangesByLaw]


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
        self.tables = sorted(
            tables, key=lambda table: (table.level, _LAW_ORDER.index(table.friction))
        )
        levels = {table.level for table in tables}
        self.truths = {one.id: one.for_doubles for one in store.values() if one.level in levels}
        self.advance, self.search = advance, Search(_MAX_CHANGES_EVALUATED)
        self.changes: ChangesByLaw = {}
        self.causes: list[tuple[str, str]] = []  #: of the level that is diagnosed

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
        wrong, earlier, self.causes = _count_unexplained(tables), dict(self.changes), []
        self.find_consequences(tables)
        follows = wrong - _count_unexplained(tables)
        with self.all_or_nothing(tables, whole=True):
            self.find_relations(tables)
        for last in (False, True):  # the quantities that are explained last
            deferred = [table.unexplained & (table.explained_last != last) for table in tables]
            for table, mask in zip(tables, deferred, strict=True):
                table.unexplained[mask] = False
            self.explain(tables)
            for table, mask in zip(tables, deferred, strict=True):
                table.unexplained[mask] = True
            self.find_consequences(tables)
            self.find_lost_digits(tables if level <= _LAST_FORMULA_LEVEL else ())
        if level == _LAST_FORMULA_LEVEL + 1 and not self.changes:
            sentences = [recognise_step_method(table) for table in tables]
            self.causes += [("method", sentence) for sentence in sentences if sentence]
        new_mistakes = [
            ("equations", self.change_sentence(change, tables))
            for change in self.changes
            if change not in earlier
        ]
        failed = tuple(grade for grade in grades if grade.failed and grade.level == level)
        return Diagnosis(
            level,
            failed,
            causes=(*new_mistakes, *dict.fromkeys(self.causes)),
            follows=follows,
            unexplained=_count_unexplained(tables),
            no_numbers=len(failed) - wrong,
            where="; ".join(
                condition_phrase(table, values_at_entries(table)["gamma_y"])
                for table in tables
                if table.unexplained.any()
            ),
            may_follow=bool(earlier) and level > 1,
        )

    def explain(self, tables: Sequence[Table]) -> None:
        """Look for mistakes that explain a level's wrong answers: changes of the equations, then
        simple relations to right values.

        The changes and causes found are kept on this object. The answers that they explain are
        marked.

        Args:
            tables: The tables of the level.
        """
        searched_together = [tables] if tables and tables[0].level == 1 else [[t] for t in tables]
        for group in searched_together:
            with self.all_or_nothing(group):
                self.search_equations(group)
        for reconstructed in (False, True) if self.changes else (False,):
            with self.all_or_nothing(tables):
                self.find_relations(tables, reconstructed)

    @contextmanager
    def all_or_nothing(self, tables: Sequence[Table], whole: bool = False) -> Iterator[None]:
        """Undo what the body of a with statement found if it explained only a part of answers that
        belong together.

        Some answers belong together: either all of them are explained, or none. If any of them is
        still unexplained at the end, the changes, the causes and the marks are restored.

        Args:
            tables: The tables that the body may explain.
            whole: True if all their answers belong together; False if only those to the kinds in
                ``_ALL_OR_NOTHING_KINDS`` do.
        """
        changes, causes = dict(self.changes), list(self.causes)
        before = [table.unexplained.copy() for table in tables]
        yield
        if any(
            table.unexplained.any()
            for table in tables
            if whole or table.kind in _ALL_OR_NOTHING_KINDS
        ):
            self.changes, self.causes = changes, causes
            for table, left in zip(tables, before, strict=True):
                table.unexplained[:] = left

    # ---- programs with changes
    def known_change_sets(self, law: str) -> list[list[Change]]:
        """Return the sets of known mistakes (changes of the equations) that a program may have
        under a friction law, as lists.

        They are the changes known under this law, all known changes, and none, in this order. Equal
        lists occur once.
        """
        sets = [self.known_changes(law), list(self.changes), []]
        return [one for n, one in enumerate(sets) if one not in sets[:n]]

    def known_changes(self, law: str) -> list[Change]:
        """Return the known mistakes under a friction law, as changes of the equations."""
        return _changes_under_law(self.changes, law)

    def find_consequences(self, tables: Sequence[Table]) -> None:
        """Mark as explained the wrong answers in tables that follow from the mistakes known so far.

        A quantity is marked if a program with the mistakes gives all of its unexplained answers.
        """
        for table in tables if self.changes else ():
            tolerance = table.allowed * (
                _SLOW_MANIFOLD_FACTOR if table.kind == "slow-manifold" else 1.0
            )
            for change_set, function in product(
                self.known_change_sets(table.friction), PREDICTIONS.get(table.kind, ())
            ):
                if table.unexplained.any():
                    fits = table.agrees_with(
                        predicted_answers(table, change_set, function), tolerance
                    )
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
        posed = self.posed_problems(tables) if _count_unexplained(tables) else []
        for n in range(len(posed)):
            table, problem = posed[n]
            mine = table.unexplained & (table.names == problem.name)
            is_inverse = (
                problem.name not in table.names
                and table.unexplained.any()
                and problem.unexplained.any()
            )
            if mine.any() or is_inverse:
                self.advance(f"level {table.level}, {problem.name}", 1)
                table.unexplained[mine] = not self.adopt_changes(table, problem, posed)
                if table.kind == "slow-manifold":  # each order is computed from the lower ones
                    posed = self.posed_problems(tables)
        self.find_consequences(tables)

    def posed_problems(self, tables: Sequence[Table]) -> list[tuple[Table, RegressionProblem]]:
        """Return the quantities of tables whose answers can be searched for mistakes in the
        equations, as pairs of a table and a problem.

        A problem uses the known changes of the table's friction law, except at level 1, where it
        uses none.
        """
        pairs = []
        for table in tables:
            if table.kind in PREDICTIONS:
                known = self.known_changes(table.friction) if table.level > 1 else ()
                pairs += [(table, problem) for problem in regression_problems(table, known)]
        return pairs

    def adopt_changes(self, table: Table, problem: RegressionProblem, posed: PosedProblems) -> bool:
        """Find the fewest mistakes in the equations that give the answers to a quantity, and keep
        them as known.

        Known changes are tried first. Changes found for a derivative are kept as a cause only.

        Args:
            table: The table with the quantity.
            problem: The answers to the quantity, and its definition.
            posed: All tables and problems of the search. The definitions behind quantities that a
                program gives already stay as they are.

        Returns:
            True if there are such changes.
        """
        law, is_derivative = table.friction, problem.name.startswith("dv")
        if is_derivative or table.kind == "slow-manifold":  # orders share their definitions
            posed = []
        posed = [pair for pair in posed if not pair[1].name.startswith(EXPLAINED_LAST)]
        known, *other_sets = self.known_change_sets(law)
        choices = [(known, self.changes), *self.equivalent_choices(law, problem, posed)]
        choices += [(others, self.changes) for others in other_sets if others or table.level > 1]
        programs = [
            (
                program_with_changes(law, change_set, problem.inputs),
                self.names_behind_given_answers(law, change_set, posed),
            )
            for change_set, _ in choices
        ]
        max_effort = 4 if table.level == 1 and not is_derivative else 2
        fitting = [n for n, (program, _) in enumerate(programs) if problem.fits(program)]
        found = [(n, ()) for n in fitting[:1]] or self.search(problem, programs, max_effort)
        if not found:
            return False
        index, new = min(
            found, key=lambda pair: likelihood_sort_key((*choices[pair[0]][0], *pair[1]))
        )
        known, self.changes = choices[index]
        if is_derivative and new:
            sentence = " and ".join(change.sentence for change in new)
            sentence = f"{problem.name} is the derivative of other equations: {sentence}"
            self.causes.append(("equations", sentence))
            return True
        for change in (*known, *new):
            self.changes[change] = self.changes.get(change, frozenset()) | {law}
        return True

    def names_behind_given_answers(
        self, law: str, change_set: Sequence[Change], posed: PosedProblems
    ) -> frozenset[str]:
        """Return the names of the definitions that need no change: those from which a program with
        some mistakes computes quantities as they were answered.

        Args:
            law: The friction law of the program.
            change_set: The changes of the equations that the program has.
            posed: Tables and problems. Those under the other friction law are left out.
        """
        names = frozenset[str]()
        for table, problem in posed:
            program = program_with_changes(law, change_set, problem.inputs)
            if table.friction in ("both", law) and problem.fits(program):
                names |= program.inputs_of(problem.definition)
        return names

    @np.errstate(all="ignore")
    def equivalent_choices(
        self, law: str, problem: RegressionProblem, posed: PosedProblems
    ) -> list[ChangeChoice]:
        """Return other choices of the known mistakes that explain the same answers.

        In each choice, one known change is replaced by a change that had the same effect on the
        quantity for which it was found. The replacement has another effect on the quantity of
        ``problem``.

        Args:
            law: The friction law.
            problem: The quantity whose answers are not yet explained.
            posed: All tables and problems. A choice gives all answers that the known changes give.

        Returns:
            The choices, each as the changes under the law and all changes by their laws.
        """
        known = self.known_changes(law)
        explained = [pair for pair in posed if _fits(self.changes, *pair)]
        values = [program_with_changes(law, known, problem.inputs)[problem.definition]]
        choices = []
        for change in known if posed else ():
            for other in change.equivalent[:_MAX_EQUIVALENT_CHANGES]:
                rest = tuple(one for one in (change, *change.equivalent) if one != other)
                replaced = {change: replace(other, equivalent=rest)}
                changes = {replaced.get(one, one): laws for one, laws in self.changes.items()}
                change_set = _changes_under_law(changes, law)
                value = program_with_changes(law, change_set, problem.inputs)[problem.definition]
                is_new = not any(
                    np.allclose(value, earlier, rtol=_ROUNDING_TOLERANCE, atol=0)
                    for earlier in values
                )
                if is_new and all(_fits(changes, *pair) for pair in explained):
                    values.append(value)
                    choices.append((change_set, changes))
        return choices

    # ---- digits and relations
    def find_lost_digits(self, tables: Sequence[Table]) -> None:
        """Mark as explained the quantities whose answers lack only their last digits.

        They are compared with a program that has all mistakes found so far. Their relative errors
        are small, and too many of their answers fail. The number of right digits becomes a cause.

        Args:
            tables: The tables of a level.
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
        for (digits, why), names in sorted(lost.items()):
            self.causes.append(
                ("digits", f"some {digits} digits of {', '.join(sorted(names))} are right: {why}")
            )

    def expected(self, table: Table) -> Array:
        """Return the answers to a table's questions that follow from the mistakes found so far.

        Where these mistakes predict no value, the truth is returned.
        """
        if table.kind not in PREDICTIONS:
            return table.truth
        predicted = predicted_answers(table, self.known_changes(table.friction))
        return np.where(np.isfinite(predicted), predicted, table.truth)

    def find_relations(self, tables: Sequence[Table], reconstructed: bool = False) -> None:
        """Mark as explained the quantities whose wrong answers have a simple relation to right
        values, such as the wrong sign.

        Each relation found becomes a cause. A relation of many quantities comes before one of few.

        Args:
            tables: The tables of a level.
            reconstructed: True to take the values that follow from the mistakes found so far for
                the right ones.
        """
        groups: dict[str, list[Relation]] = {}
        wrong_tables = [table for table in tables if table.unexplained.any()]
        changes = [
            self.known_changes(table.friction) if reconstructed else () for table in wrong_tables
        ]
        if reconstructed:
            wrong_tables = [replace(table, truth=self.expected(table)) for table in wrong_tables]
        truths = dict(self.truths)
        for table in wrong_tables:
            truths.update(zip(table.ids, table.truth.tolist(), strict=True))
        for table, known in zip(wrong_tables, changes, strict=True):
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
            self.causes.append(
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

    def change_sentence(self, change: Change, tables: Sequence[Table]) -> str:
        """Return a sentence that describes a change of the equations, the likely mistake.

        A friction law is added if the change is known under this law only, although the tables ask
        for other laws too.

        Args:
            change: A known change.
            tables: The tables of the level.
        """
        (*_, law), every = self.changes[change], {table.friction for table in tables} - {"both"}
        only = len(self.changes[change]) == 1 and {law} < every
        return change.sentence + (f", under the {law} law" if only else "")


def _changes_under_law(changes: ChangesByLaw, law: str) -> list[Change]:
    """Return the changes of the equations that are known under a friction law or under
    both laws.
    """
    return [change for change, laws in changes.items() if laws & {law, "both"}]


def _fits(changes: ChangesByLaw, table: Table, problem: RegressionProblem) -> bool:
    """Return True if a program with some mistakes gives all answers to a quantity.

    Args:
        changes: The changes of the equations by their friction laws. Those of the table's law
            are used.
        table: The table with the quantity.
        problem: The answers to the quantity, and its definition.
    """
    law = table.friction
    return problem.fits(program_with_changes(law, _changes_under_law(changes, law), problem.inputs))


def _count_unexplained(tables: Iterable[Table]) -> int:
    """Return the number of wrong answers in tables that are unexplained."""
    return sum(int(table.unexplained.sum()) for table in tables)
