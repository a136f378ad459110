"""The mistakes behind wrong answers, several at once if a program has several.

`diagnose` takes the grades of a sheet and returns a `Diagnosis` for each level that has failures.

A mistake in an equation changes the terms of the equation. The answers to an equation such as
M a - F = 0 are linear in such changes. The diagnosis looks for the fewest changes of the right
equations that give the wrong answers.

The way from a sheet to its diagnoses:

1. `tables` puts the graded answers into arrays, one table for each kind and friction law.
2. `levelwise` goes through the levels, easiest first, and keeps the mistakes that it finds. At each
   level it applies the following steps, and separates mistakes from their consequences. The result
   is a `Diagnosis`: the causes, and how many answers remain unexplained.
3. `quantities` defines the quantities of levels 1 to 5, and computes the answers that a program
   with known mistakes would give.
4. `regression` finds the fewest changes that give the answers to a quantity. `dictionary` has the
   right equations, and what people write in place of their parts. `terms` evaluates equations that
   are written as sums of products.
5. `relations` predicts wrong answers from right ones: a factor, a sign, another question's value.

A *table* has the answers to the questions of one kind under one friction law. Its *entries* are
the states, equilibria or cycles that the questions are about. A *quantity* is what is asked about
each entry. A *change* puts something else in the place of a term or of a definition. A *program*
is the right equations with some changes. A program *gives* answers if it computes the same values,
up to rounding. Wrong answers are *explained* if a cause is named that predicts them. Until then
they are unexplained. The *reconstructed* program is the right equations with all changes that have
been named so far.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from tippedisk_verify.conformance.diagnosis.levelwise import Diagnosis, SheetDiagnosis
from tippedisk_verify.conformance.diagnosis.tables import tables_of
from tippedisk_verify.conformance.grading import Grade
from tippedisk_verify.reference_values.store import Store

__all__ = ["Diagnosis", "diagnose"]


def diagnose(
    grades: Iterable[Grade],
    store: Store,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> list[Diagnosis]:
    """Return a diagnosis for each level with failed answers, in the order of the levels.

    Args:
        grades: The grades of a sheet.
        store: The questions with their truths.
        advance: A function that is called with a label and a number of steps.
    """
    grades = list(grades)
    levels = sorted({grade.level for grade in grades if grade.failed})
    sheet = SheetDiagnosis(tables_of(grades, store) if levels else [], store, advance)
    return [sheet.diagnose_level(level, grades) for level in levels]
