"""The graded answers as tables: the answers of one kind under one friction law, as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
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

    The arrays in ``inputs`` have one element to an entry. All other arrays and lists but
    ``entries`` have one element to an answer.
    """

    kind: str
    level: int
    friction: str
    entries: tuple[str, ...]  #: ``set/friction/kind/entry``
    #: Parameters and inputs by symbol, and the words ``equilibrium`` and ``form``, which the
    #: numbers ``side`` and ``consistent`` stand for in equations
    inputs: Mapping[str, Any]
    ids: list[str]
    names: Array  #: the quantity with its place, such as ``h_3`` or ``beta@0.5``
    quantity_names: Array  #: the quantity without its place, such as beta for ``beta@0.5``
    order: Array  #: the order on the slow manifold; NaN for other kinds
    rows: Array  #: the index of the answer's entry in ``entries``
    scale: Array  #: the size relative to which digits are counted

    def matched_values(self, results: Mapping[str, Any]) -> Array:
        """Return the computed value for each answer of this table; NaN where there is none.

        Args:
            results: The computed values by the names of the quantities, one value to an entry.
        """
        columns = {
            name: np.real(results.get(name, np.nan)) + np.zeros(len(self.entries))
            for name in np.unique(self.names)
        }
        return np.array(
            [columns[name][row] for name, row in zip(self.names, self.rows, strict=True)]
        )

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
    first, names = some[0][0], np.array([quantity.name for quantity, _ in some])
    questions = {quantity.id.rsplit("/", 1)[0]: quantity for quantity, _ in some}
    entries = tuple(questions)
    texts = [{**store.parameters[one.set], **one.inputs} for one in questions.values()]
    inputs: dict[str, Any] = {
        x: np.array([float(one.get(x, "nan")) for one in texts])
        for x in (*SYMBOLS, *_NUMERIC_INPUTS)
    }
    for word in ("equilibrium", "form"):
        inputs[word] = np.array([one.get(word, "") for one in texts])
    inputs["side"] = np.where(inputs["equilibrium"] == "noninverted", -1.0, 1.0)
    inputs["consistent"] = (inputs["form"] == "consistent") * 1.0
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
    plain_names, places = zip(*(split_name(name, first.kind) for name in names), strict=True)
    return Table(
        kind=first.kind,
        level=first.level,
        friction=first.friction,
        entries=entries,
        inputs=inputs,
        ids=[quantity.id for quantity, _ in some],
        names=names,
        quantity_names=np.array(plain_names),
        order=np.array([float(place.get("order", "nan")) for place in places]),
        rows=np.array([entries.index(quantity.id.rsplit("/", 1)[0]) for quantity, _ in some]),
        answer=answer,
        truth=truths,
        allowed=scale * 10.0**-needs,
        scale=scale,
        unexplained=np.array([grade.failed for _, grade in some]),
    )


_NUMERIC_INPUTS = ("Omega", *STATE_NAMES)
