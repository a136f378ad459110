"""Derivatives by Omega that are difference quotients of cycles at two speeds: forward, backward or central, which step.

Short steps would lose digits: there the quotient is the mean of the derivative, of a polynomial through some values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.diagnosis.shooting import Family, closed_cycles
from tippedisk_verify.conformance.diagnosis.speeds import answered_by
from tippedisk_verify.conformance.grading import Grade, as_decimal, needed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["quotients_of"]

_OF = {"dperiod_domega": "period", "dgamma_bar_0_domega": "gamma_bar_0", "dv_0_domega": "v_0"}
_KINDS = {"forward": (0, 1), "backward": (-1, 0), "central": (-1, 1)}  # from where to where, in steps
_FREE = 3  # wrong answers that must bear out a round step
_SHORT = 1 / 6  # of the distance from where the family ends: seven nodes then leave some 1e-8 of the derivative
_NODES = numpy.cos(numpy.pi * (numpy.arange(7) + 0.5) / 7)
_LONG = 60.0  # times that; with a longer step a cycle ten times as far away would be wrong, too
_CLOSED = 1e-8
_TOLERANCE = 1e-10
_NOISE = 1e-9  # s, rad, rad/s; what programs in doubles leave of the difference of two cycles
_CLOSER = 0.1  # of the error: what may be left of it
_LAST = 2e-3  # rad/s below Omega_crit; cycles beyond are not looked for
_FIRST = 1e-8  # rad/s above Omega_h
_ABSOLUTE = {f"{m}e-{k} rad/s": (m * 10.0**-k, 0) for k in range(1, 9) for m in (1, 2, 5)}
_RELATIVE = {f"1e-{k} Omega": (10.0**-k, 1) for k in range(2, 10)}
_STEPS = _ABSOLUTE | _RELATIVE
_ALL = [(kind, step) for step in _STEPS for kind in _KINDS]

Cycle = dict[str, float]


class _Entry:
    """One cycle, and how far the family goes on from it."""

    def __init__(self, here: Mapping[str, Quantity], family: Family, omega_crit: float, store: Store) -> None:
        first = next(iter(here.values()))
        self.here, self.omega = here, float(first.inputs["Omega"])
        self.right = {name: store[first.id.replace(f"/{first.name}", f"/{name}")].for_doubles for name in _OF.values()}
        self.low, self.high = family.omega_h - self.omega, omega_crit - self.omega
        self.short = _SHORT * min(-self.low, self.high)

    def step(self, name: str) -> float:
        size, power = _STEPS[name]
        return size * self.omega**power

    def places(self, kinds: Sequence[tuple[str, str]], longest: float = math.inf) -> Iterator[float]:
        """How far from here cycles have to be known for these quotients, of no longer steps than that."""
        if any(self.step(name) <= self.short for _, name in kinds):
            yield from (self.short * _NODES).tolist()
        for kind, name in kinds:
            step = self.step(name)
            if self.short < step < longest:
                yield from (
                    end * step for end in _KINDS[kind] if end and self.low + _FIRST < end * step < self.high - _LAST
                )

    def quotient(self, kind: str, name: str, derivative: str, cycles: Mapping[float, Cycle]) -> float:
        begin, end = (part * self.step(name) for part in _KINDS[kind])
        if max(-begin, end) > self.short:
            what = _OF[derivative]
            first, last = (cycles.get(at, {}).get(what, math.nan) if at else self.right[what] for at in (begin, end))
            return (last - first) / (end - begin)
        nodes = numpy.array([cycles[at][derivative] for at in (self.short * _NODES).tolist() if at in cycles])
        if len(nodes) < len(_NODES):
            return math.nan
        mean = numpy.polynomial.Polynomial.fit(_NODES, nodes, len(_NODES) - 1).integ()
        return float((mean(end / self.short) - mean(begin / self.short)) * self.short / (end - begin))


def quotients_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """The differences that wrong derivatives are, all else being right."""
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    first = store[usable[0].id]
    family = Family(first.set, first.friction, store)
    hopf = store.get(f"{first.set}/linear/hopf/point/omega_crit")
    if hopf is None or not family.known or not wrong <= {id_ for id_ in given if id_.rsplit("/", 1)[1] in _OF}:
        return None
    asked: dict[str, dict[str, Quantity]] = {}
    for grade in usable:
        if store[grade.id].name in _OF:
            asked.setdefault(grade.id.rsplit("/", 1)[0], {})[store[grade.id].name] = store[grade.id]
    entries = [_Entry(here, family, hopf.for_doubles, store) for here in asked.values()]
    names = [name for name in _OF if any(id_.endswith(f"/{name}") for id_ in wrong)]
    bad = {grade.id: grade for grade in usable if grade.id in wrong}
    least: dict[str, _Entry] = {}  # where the error is least, the cycles are farthest from where the family ends
    for name in names:
        off = {id_: grade.digits for id_, grade in bad.items() if id_.endswith(f"/{name}")}
        id_ = max(off, key=off.__getitem__)
        least[name] = next(entry for entry in entries if name in entry.here and entry.here[name].id == id_)
    cycles = _cycles({entry: entry.places(_ALL, _LONG * entry.short) for entry in least.values()}, first, family)
    likely = [
        kind for kind in _ALL if any(_fits(entry, kind, name, cycles, given, wrong) for name, entry in least.items())
    ]
    cycles = _cycles({entry: entry.places(likely) for entry in entries}, first, family) if likely else {}
    fitting = {
        kind: [
            name
            for name in names
            if all(_fits(entry, kind, name, cycles, given, wrong) for entry in entries if name in entry.here)
        ]
        for kind in likely
    }
    said = []
    while names:
        kind = max(fitting, key=lambda kind: len(set(fitting[kind]) & set(names)), default=None)
        mine = [name for name in names if kind is not None and name in fitting[kind]]
        if kind is None or sum(id_.endswith(tuple(mine)) for id_ in wrong if mine) < _FREE:
            return None
        said.append(f"{', '.join(mine)}: {kind[0]} differences by Omega with a step of {kind[1]}")
        names = [name for name in names if name not in mine]
    return (("differences", "; ".join(said)),), frozenset(wrong)


def _fits(
    entry: _Entry, kind: tuple[str, str], name: str, cycles: Mapping[_Entry, Mapping[float, Cycle]],
    given: Mapping[str, Decimal], wrong: set[str],
) -> bool:  # fmt: skip
    quantity = entry.here[name]
    expected = entry.quotient(*kind, name, cycles[entry])
    if math.isnan(expected):
        return quantity.id not in wrong
    off, error = (abs(float(given[quantity.id]) - x) for x in (expected, quantity.for_doubles))
    noise = max(10 ** -needed(quantity) * abs(expected), _NOISE / (entry.step(kind[1])))
    return off < noise and (quantity.id not in wrong or off < _CLOSER * error)


def _cycles(
    places: Mapping[_Entry, Iterator[float]], first: Quantity, family: Family
) -> dict[_Entry, dict[float, Cycle]]:
    """The cycles that far from these entries; those that are not found are missing."""
    lanes = [(entry, at) for entry, several in places.items() for at in dict.fromkeys(several)]
    omega: Array = numpy.array([entry.omega + at for entry, at in lanes])
    half, gamma, v = family(omega)
    run = closed_cycles(first.set, first.friction, half, gamma, v, omega, tolerance=_TOLERANCE)
    closed = abs(run.left()).max(axis=0) < _CLOSED
    found: dict[_Entry, dict[float, Cycle]] = {entry: {} for entry in places}
    for (entry, at), cycle, good in zip(lanes, answered_by(run), closed, strict=True):
        if good:
            found[entry][at] = cycle
    return found
