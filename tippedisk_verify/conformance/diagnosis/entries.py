"""The graded answers as arrays: entries of one kind and law, their inputs, answers and truths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np

from tippedisk_verify.conformance.grading import Grade, as_decimal, scale_of
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.decimals import arithmetic
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["LATER", "Answered", "Array", "Table", "tables_of"]

Array = np.ndarray[Any, Any]
# The factor by which a prediction must be closer to a wrong answer than the truth is.
_CLOSER = 10.0
#: Quantities that are explained after the others: derivatives of v', and what the orders leave
LATER = ("dv_rate", "residual")
_NO_NUMBER = ("no-truth", "not-a-number", "unreadable")


@dataclass(frozen=True, eq=False)
class Answered:
    """Answers and what they are graded by, as arrays of the same length."""

    answer: Array
    truth: Array
    allowed: Array  #: how far off an answer may be
    left: Array  #: whether it failed, and nothing explains it yet

    @np.errstate(all="ignore")
    def fitted(self, predicted: Array, allowed: Array | None = None) -> Array:
        """Return which answers a prediction gives: as close as is asked, and the wrong ones ten
        times closer than the truth.

        Args:
            predicted: The prediction of each answer.
            allowed: How far off it may be, if not as far as the answer.
        """
        allowed = self.allowed if allowed is None else allowed
        larger = np.abs(predicted) / np.maximum(np.abs(self.truth), allowed)
        away = np.abs(self.answer - predicted)
        closer = away * _CLOSER <= np.abs(self.answer - self.truth)
        close = away <= allowed * np.maximum(1.0, larger)
        return np.asarray(close & (~self.left | closer))


@dataclass(frozen=True, eq=False, kw_only=True)
class Table(Answered):
    """Entries of one kind and friction law.

    The arrays behind ``names`` have one element to an answer.
    """

    kind: str
    level: int
    friction: str
    entries: tuple[str, ...]  #: ``set/friction/kind/entry``
    #: Parameters and inputs by symbol, and words, as arrays over the entries
    given: Mapping[str, Any]
    names: Array  #: what each answer is to, such as ``h_3`` or ``beta@0.5``
    rows: Array  #: which entry it is to
    scale: Array  #: the size that digits are counted from

    @cached_property
    def stems(self) -> Array:
        """The quantities without their places: beta for ``beta@0.5``."""
        return np.array([placed(name, self.kind)[0] for name in self.names])

    @cached_property
    def places(self) -> list[dict[str, str]]:
        """The times, numbers and orders of the answers."""
        return [placed(name, self.kind)[1] for name in self.names]

    @cached_property
    def later(self) -> Array:
        """Which answers are to quantities that are explained after the others."""
        return np.array([name.startswith(LATER) for name in self.names])

    @cached_property
    def ids(self) -> list[str]:
        return [
            f"{self.entries[row]}/{name}" for row, name in zip(self.rows, self.names, strict=True)
        ]

    def picked(self, results: Mapping[str, Any]) -> Array:
        """Select the answered results, by entry; NaN for a missing one."""
        found = np.full(len(self.names), np.nan)
        for name in np.unique(self.names):
            values = np.real(results.get(name, np.nan)) + np.zeros(len(self.entries))
            found[self.names == name] = values[self.rows[self.names == name]]
        return found

    def column(self, name: str) -> Answered:
        """Return the answers to one quantity, one to an entry; NaN for a missing one, which is
        not left to explain.
        """
        here, arrays = self.names == name, []
        for array in (self.answer, self.truth, self.allowed, self.left):
            found = np.full(len(self.entries), np.nan)
            found[self.rows[here]] = array[here]
            arrays.append(found)
        answer, truth, allowed, left = arrays
        return Answered(answer, truth, allowed, left > 0)


@arithmetic()
def tables_of(grades: Iterable[Grade], store: Store) -> list[Table]:
    """The answers that are numbers, by kind and friction law; one pass over the sheet."""
    groups: dict[tuple[str, str], list[tuple[Quantity, Grade]]] = {}
    for grade in grades:
        if grade.verdict not in _NO_NUMBER and abs(as_decimal(grade.answer)) < Decimal("1e300"):
            quantity = store[grade.id]
            groups.setdefault((quantity.kind, quantity.friction), []).append((quantity, grade))
    return [_table(some, store) for some in groups.values()]


def _table(some: Sequence[tuple[Quantity, Grade]], store: Store) -> Table:
    first = {quantity.id.rsplit("/", 1)[0]: quantity for quantity, _ in reversed(some)}
    entries = tuple(dict.fromkeys(quantity.id.rsplit("/", 1)[0] for quantity, _ in some))
    inputs = [{**store.parameters[first[entry].set], **first[entry].inputs} for entry in entries]
    given: dict[str, Any] = {
        x: np.array([float(one.get(x, "nan")) for one in inputs]) for x in (*SYMBOLS, *_NUMBERS)
    }
    given |= {
        word: np.array([one.get(word, "") for one in inputs]) for word in ("equilibrium", "form")
    }
    cells = [
        (
            float(as_decimal(grade.answer)),
            float(Decimal(grade.truth)),
            float(scale_of(quantity, Decimal(grade.truth))),
            grade.needs,
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
        given=given,
        names=np.array([quantity.name for quantity, _ in some]),
        rows=rows,
        answer=answer,
        truth=truths,
        allowed=scale * 10.0**-needs,
        scale=scale,
        left=np.array([grade.failed for _, grade in some]),
    )


_NUMBERS = ("Omega", "beta", "gamma", "v")
