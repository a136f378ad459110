"""What is graded, as arrays: entries of one kind and law, their inputs, and the answers beside the truths."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np

from tippedisk_verify.conformance.grading import Grade, as_decimal, scale_of
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.decimals import arithmetic
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["Array", "Entry", "Results", "Sheet", "Table", "tables_of"]

Array = np.ndarray[Any, Any]
Results = Mapping[str, Any]  #: by a quantity's name, one value to an entry
_CLOSER = 10.0  # times: a prediction has to come so much closer to a wrong answer than the truth does


@dataclass(frozen=True)
class Entry:
    """All that is asked about one state, trajectory or cycle, with what was answered."""

    id: str  #: ``set/friction/kind/entry``
    quantities: tuple[Quantity, ...]
    grades: tuple[Grade, ...]

    @property
    def inputs(self) -> Mapping[str, str]:
        return self.quantities[0].inputs


@dataclass(frozen=True, eq=False)
class Table:
    """Entries of one kind and friction law. The arrays behind ``names`` have one element to an answer."""

    kind: str
    level: int
    friction: str
    entries: tuple[Entry, ...]
    p: tuple[Array, ...]  #: the parameters, one array over the entries for each
    given: Mapping[str, Array]  #: the other inputs
    names: tuple[str, ...]  #: what each answer is to, such as ``h_3`` or ``beta@0.5``
    rows: Array  #: which entry it is to
    answer: Array
    truth: Array
    allowed: Array  #: how far off it may be
    wrong: Array  #: whether it failed

    @property
    def smooth(self) -> bool:
        return self.friction == "smooth"

    @cached_property
    def asked(self) -> frozenset[str]:
        return frozenset(self.names)

    @cached_property
    def stems(self) -> Array:
        """The quantities without their places: beta for ``beta@0.5``."""
        return np.array([placed(name)[0] for name in self.names])

    @cached_property
    def ids(self) -> Array:
        return np.array([f"{self.entries[row].id}/{name}" for row, name in zip(self.rows, self.names, strict=True)])

    @cached_property
    def sets(self) -> Array:
        return np.array([entry.quantities[0].set for entry in self.entries])

    def picked(self, results: Results) -> Array:
        """Of results by entry those that were answered; NaN for what is missing."""
        missing = np.full(len(self.entries), np.nan)
        columns: dict[str, Any] = {}
        for name in self.asked:
            try:
                columns[name] = np.broadcast_to(np.asarray(results.get(name, missing)).real, missing.shape)
            except (ValueError, TypeError):
                columns[name] = missing
        return np.array([columns[name][row] for name, row in zip(self.names, self.rows, strict=True)], dtype=float)

    def column(self, name: str, values: Array) -> Array:
        """Of answers or truths those of a quantity, by entry."""
        found = np.full(len(self.entries), np.nan)
        here = np.array(self.names) == name
        found[self.rows[here]] = values[here]
        return found

    def with_inputs(self, p: Sequence[Array], given: Mapping[str, Array]) -> Table:
        return replace(self, p=tuple(p), given=dict(given))

    def part(self, rows: Iterable[int]) -> Table:
        """The same with some of the entries."""
        chosen = np.array(sorted(set(rows)), dtype=int)
        place = np.full(len(self.entries), -1)
        place[chosen] = np.arange(len(chosen))
        kept = place[self.rows] >= 0
        return replace(
            self,
            entries=tuple(self.entries[row] for row in chosen),
            p=tuple(parameter[chosen] for parameter in self.p),
            given={name: values[chosen] for name, values in self.given.items()},
            **self._kept(kept, place),
        )

    def without(self, dropped: Array) -> Table:
        """The same without some of the answers."""
        return replace(self, **self._kept(~dropped, np.arange(len(self.entries))))

    def _kept(self, kept: Array, place: Array) -> dict[str, Any]:
        return {
            "names": tuple(name for name, stays in zip(self.names, kept, strict=True) if stays),
            "rows": place[self.rows[kept]],
            **{name: getattr(self, name)[kept] for name in ("answer", "truth", "allowed", "wrong")},
        }


def _joined(name: str) -> cached_property[Array]:
    """What the tables of a sheet have by this name, one after the other."""
    empty = np.zeros(0, dtype=bool)
    return cached_property(lambda sheet: np.concatenate([getattr(t, name) for t in sheet.tables] or [empty]))


@dataclass(frozen=True, eq=False)
class Sheet:
    """The tables of one level whose answers one mistake has to explain."""

    tables: tuple[Table, ...]

    answer, truth, allowed, wrong, ids = map(_joined, ("answer", "truth", "allowed", "wrong", "ids"))

    @cached_property
    def stems(self) -> Array:
        return np.concatenate([[f"{table.friction} {stem}" for stem in table.stems] for table in self.tables])

    @property
    def level(self) -> int:
        return self.tables[0].level

    def fitted(self, predicted: Array, digits: float = 0.0) -> Array:
        """Which answers a prediction gives: as close as its question asks, and ten times closer than the truth."""
        with np.errstate(all="ignore"):
            away = np.abs(self.answer - predicted)
            grown = np.maximum(1.0, np.abs(predicted) / np.maximum(np.abs(self.truth), self.allowed))
            close = away <= self.allowed * grown * 10.0**-digits
            fitted: Array = close & (~self.wrong | (away * _CLOSER <= np.abs(self.answer - self.truth)))
        return fitted

    def fits(self, predicted: Array, digits: float = 0.0) -> bool:
        return bool(self.wrong.any() and self.fitted(predicted, digits).all())

    def some(self, few: int) -> Sheet:
        """Some entries with wrong answers and some without; each wrong quantity is among them."""
        tables = []
        for table in self.tables:
            bad = list(dict.fromkeys(table.rows[table.wrong].tolist()))
            wanted: list[int] = []
            for stem in dict.fromkeys(table.stems[table.wrong].tolist()):
                wanted += table.rows[table.wrong & (table.stems == stem)].tolist()[:1]
            spread = bad[:: max(1, len(bad) // few)][:few]
            good = [row for row in range(len(table.entries)) if row not in set(bad)]
            spread += good[:: max(1, len(good) // few)][: few if bad else 1]
            tables.append(table.part([*wanted[:few], *spread]))
        return Sheet(tuple(tables))

    def where(self, kept: Callable[[Table], Iterable[int]]) -> Sheet:
        parts = (table.part(kept(table)) for table in self.tables)
        return Sheet(tuple(part for part in parts if len(part.names)))


def tables_of(grades: Iterable[Grade], store: Store) -> list[Table]:
    """The answers that are numbers, by kind and friction law; one pass over the sheet."""
    entries: dict[str, list[Grade]] = {}
    for grade in grades:
        entries.setdefault(grade.id.rsplit("/", 1)[0], []).append(grade)
    groups: dict[tuple[str, str], list[Entry]] = {}
    for id_, here in entries.items():
        quantities = tuple(store[grade.id] for grade in here)
        entry = Entry(id_, quantities, tuple(here))
        groups.setdefault((quantities[0].kind, quantities[0].friction), []).append(entry)
    tables = [_table(kind, friction, here, store) for (kind, friction), here in groups.items()]
    return [table for table in tables if len(table.names)]


def _table(kind: str, friction: str, entries: Sequence[Entry], store: Store) -> Table:
    decimals = [store.parameters[entry.quantities[0].set] for entry in entries]
    p = tuple(np.array([float(one[symbol]) for one in decimals]) for symbol in SYMBOLS)
    given: dict[str, Array] = {}
    for name in ("Omega", "beta", "gamma", "v"):
        if all(name in entry.inputs for entry in entries):
            given[name] = np.array([float(entry.inputs[name]) for entry in entries])
    for name in ("equilibrium", "form"):
        given[name] = np.array([entry.inputs.get(name, "") for entry in entries])
    names: list[str] = []
    cells: list[tuple[float, ...]] = []
    with arithmetic():
        for row, entry in enumerate(entries):
            for quantity, grade in zip(entry.quantities, entry.grades, strict=True):
                if grade.verdict in ("no-truth", "not-a-number", "unreadable"):
                    continue
                answer, truth = as_decimal(grade.answer), Decimal(grade.truth)
                if abs(answer.adjusted()) > 300 and answer:
                    continue
                allowed = float(scale_of(quantity, truth)) * 10.0**-grade.needs
                names.append(quantity.name)
                cells.append((row, float(answer), float(truth), allowed, grade.failed))
    rows, answer_, truth_, allowed_, wrong = np.array(cells, dtype=float).reshape(-1, 5).T
    level = entries[0].quantities[0].level
    return Table(
        kind, level, friction, tuple(entries), p, given, tuple(names),
        rows.astype(int), answer_, truth_, allowed_, wrong.astype(bool),
    )  # fmt: skip
