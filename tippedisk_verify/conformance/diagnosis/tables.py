"""The graded answers as tables: the answers of one kind under one friction law, as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np

from tippedisk_verify.conformance.answer_number import as_decimal
from tippedisk_verify.conformance.grading import Grade
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.decimals import decimal_arithmetic
from tippedisk_verify.reference_values.grading_rules import scale_of, split_name
from tippedisk_verify.reference_values.store import ReferenceValue, Store

__all__ = ["Array", "ComparedAnswers", "Table", "tables_of"]

Array = np.ndarray[Any, Any]
# A prediction must be closer to a wrong answer than the truth is by this factor.
_PREDICTION_FACTOR = 10.0
_VERDICTS_WITHOUT_NUMBER = ("no-truth", "not-a-number", "unreadable")


@dataclass(frozen=True, eq=False)
class ComparedAnswers:
    """Answers together with the truth and the error that is allowed, as arrays of the
    same length.
    """

    answer: Array
    truth: Array
    allowed: Array  #: the largest error that an answer may have
    unexplained: Array  #: mask of the answers that failed and are unexplained

    @np.errstate(all="ignore")
    def agrees_with(self, predicted: Array, allowed: Array | None = None) -> Array:
        """Return the mask of the answers that a prediction gives.

        A prediction gives an answer if the two differ by no more than is allowed. To a wrong,
        unexplained answer it must also be ten times closer than the truth is.

        Args:
            predicted: The prediction of each answer.
            allowed: The error allowed of each prediction; by default that allowed of the answers.
        """
        allowed = self.allowed if allowed is None else allowed
        larger = np.abs(predicted) / np.maximum(np.abs(self.truth), allowed)
        away = np.abs(self.answer - predicted)
        closer = away * _PREDICTION_FACTOR <= np.abs(self.answer - self.truth)
        close = away <= allowed * np.maximum(1.0, larger)
        return np.asarray(close & (~self.unexplained | closer))


@dataclass(frozen=True, eq=False, kw_only=True)
class Table(ComparedAnswers):
    """The answers of a sheet to the questions of one kind under one friction law, with their
    truths.

    ``answer``, ``truth``, ``allowed``, ``unexplained``, ``names``, ``rows`` and ``scale`` have one
    element to an answer. The arrays in ``inputs`` have one element to an entry.
    """

    kind: str
    level: int
    friction: str
    entries: tuple[str, ...]  #: ``set/friction/kind/entry``
    #: Parameters and inputs by symbol, and the words ``equilibrium`` and ``form``
    inputs: Mapping[str, Any]
    names: Array  #: the quantity with its place, such as ``h_3`` or ``beta@0.5``
    rows: Array  #: the index of the answer's entry in ``entries``
    scale: Array  #: the size relative to which digits are counted

    @cached_property
    def quantity_names(self) -> Array:
        """The plain name of the quantity of each answer, such as beta for ``beta@0.5``."""
        return np.array([split_name(name, self.kind)[0] for name in self.names])

    @cached_property
    def places(self) -> list[dict[str, str]]:
        """The place of each answer, as its quantity's name contains it: a time, the number of a
        crossing, or an order, by words.
        """
        return [split_name(name, self.kind)[1] for name in self.names]

    @cached_property
    def ids(self) -> list[str]:
        return [
            f"{self.entries[row]}/{name}" for row, name in zip(self.rows, self.names, strict=True)
        ]

    def matched_values(self, results: Mapping[str, Any]) -> Array:
        """Return the computed value for each answer of this table; NaN where there is none.

        Args:
            results: The computed values by the names of the quantities, one value to an entry.
        """
        values_of_answers = np.full(len(self.names), np.nan)
        for name in np.unique(self.names):
            values = np.real(results.get(name, np.nan)) + np.zeros(len(self.entries))
            values_of_answers[self.names == name] = values[self.rows[self.names == name]]
        return values_of_answers

    def column(self, name: str) -> ComparedAnswers:
        """Return the answers to one quantity, one element to an entry.

        Entries without an answer have NaN, and count as explained.

        Args:
            name: The name of the quantity with its place, such as ``beta@0.5``.
        """
        selected, arrays = self.names == name, []
        for array in (self.answer, self.truth, self.allowed, self.unexplained):
            by_entry = np.full(len(self.entries), np.nan)
            by_entry[self.rows[selected]] = array[selected]
            arrays.append(by_entry)
        answer, truth, allowed, unexplained = arrays
        return ComparedAnswers(answer, truth, allowed, unexplained > 0)


@decimal_arithmetic()
def tables_of(grades: Iterable[Grade], store: Store) -> list[Table]:
    """Return the tables of a sheet, one for each kind and friction law.

    Answers that are not finite numbers, or are larger than 1e300, are left out.

    Args:
        grades: The grades of the sheet.
        store: The questions with their inputs.
    """
    groups: dict[tuple[str, str], list[tuple[ReferenceValue, Grade]]] = {}
    for grade in grades:
        if grade.verdict not in _VERDICTS_WITHOUT_NUMBER and abs(
            as_decimal(grade.answer)
        ) < Decimal("1e300"):
            quantity = store[grade.id]
            groups.setdefault((quantity.kind, quantity.friction), []).append((quantity, grade))
    return [_table(some, store) for some in groups.values()]


def _table(some: Sequence[tuple[ReferenceValue, Grade]], store: Store) -> Table:
    first = {quantity.id.rsplit("/", 1)[0]: quantity for quantity, _ in reversed(some)}
    entries = tuple(dict.fromkeys(quantity.id.rsplit("/", 1)[0] for quantity, _ in some))
    inputs = [{**store.parameters[first[entry].set], **first[entry].inputs} for entry in entries]
    inputs_by_symbol: dict[str, Any] = {
        x: np.array([float(one.get(x, "nan")) for one in inputs])
        for x in (*SYMBOLS, *_NUMERIC_INPUTS)
    }
    inputs_by_symbol |= {
        word: np.array([one.get(word, "") for one in inputs]) for word in ("equilibrium", "form")
    }
    cells = [
        (
            float(as_decimal(grade.answer)),
            float(Decimal(grade.truth)),
            float(scale_of(quantity, Decimal(grade.truth))),
            grade.required_digits,
        )
        for quantity, grade in some
    ]
    answer, truths, scale, needs = np.array(cells).reshape(-1, 4).T
    rows = np.array([entries.index(quantity.id.rsplit("/", 1)[0]) for quantity, _ in some])
    return Table(
        kind=some[0][0].kind,
        level=some[0][0].level,
        friction=some[0][0].friction,
        entries=entries,
        inputs=inputs_by_symbol,
        names=np.array([quantity.name for quantity, _ in some]),
        rows=rows,
        answer=answer,
        truth=truths,
        allowed=scale * 10.0**-needs,
        scale=scale,
        unexplained=np.array([grade.failed for _, grade in some]),
    )


_NUMERIC_INPUTS = ("Omega", *STATE_NAMES)
