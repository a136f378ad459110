"""Which single slip is in the equations that orbits are computed with, where the right-hand side is answered right.

Each slip in the formulas as they are written down moves one sample by about as much as it is off, or it does not: a
flight with long steps tells. What is left leads from every answered sample to the next one, or is dropped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, flown
from tippedisk_verify.conformance.diagnosis.pairs import STATE, Pairs, pairs_of
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.diagnosis.slipped import simplest, with_meanings
from tippedisk_verify.conformance.diagnosis.slips import Names, Slip, Written
from tippedisk_verify.conformance.diagnosis.written import REAL, set_parameters, states
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Store

__all__ = ["copy_of"]

_STEP = 0.01  # s; friction decays at some 130 1/s, and what RK4 leaves is taken off
_ROUGHLY = 0.05  # of a defect: what such a flight may leave
_HUGE = 1e3  # rad, rad/s; a flight beyond has blown up
_SHORT = 1e-3  # s, for flights that blow up
_ALIKE = 1e-9  # relative: slips with the same rates are one
_STEPS = 250  # slips between two words to the progress bar
_PLACES = ((1.1, 0.7, -0.8), (1.9, -2.2, 1.3), (1.4, 2.9, 0.4))  # to tell slips apart
_ARRAYS: Names = REAL | {"sin": numpy.sin, "cos": numpy.cos, "sqrt": numpy.sqrt, "abs": abs, "max": numpy.maximum}
_FAILS = (ArithmeticError, ValueError, TypeError, LookupError, NameError, AttributeError)


def copy_of(
    usable: Sequence[Grade], wrong: set[str], store: Store, advance: Callable[[str, int], None]
) -> Found | None:
    """The simplest slips in the equations that lead from each answered sample to the next."""
    samples = frozenset(id_ for id_ in wrong if "@" in id_)
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    pairs = pairs_of([store[id_] for id_ in answers], answers) if samples else None
    if pairs is None or not pairs.moved.any():
        return None
    fits: list[tuple[float, int, int, str]] = []
    for formula in states(pairs.here.friction)[:2]:  # without the derivatives
        written = Written(formula.source, formula.groups)
        for slip in _near(written, formula.only, pairs, advance):
            with numpy.errstate(all="ignore"):
                made = _ends(written, slip, pairs)
            if made is not None and pairs.explained(made):
                off = numpy.linalg.norm(made - pairs.ends, axis=0) / numpy.maximum(pairs.size, numpy.median(pairs.size))
                fits.append((-math.log10(max(float(numpy.median(off)), 1e-9)), slip.rank, slip.place, slip.says()))
        if fits:
            break
    texts = [with_meanings(text) for text in simplest(fits)]
    said = tuple(("copy", f"{text} (in the orbits' equations: those of level 1 are right)") for text in texts)
    return (said, samples) if said else None


def _near(written: Written, only: Sequence[str], pairs: Pairs, advance: Callable[[str, int], None]) -> Iterator[Slip]:
    """The slips that move some samples by about their defects."""
    order = numpy.argsort(pairs.size)
    flights = [_flight(written, pairs, int(order[len(order) * part // 4])) for part in (2, 3, 1)]
    rates = partial(_rates, written, REAL | set_parameters(pairs.here.set) | _at(float(pairs.speeds[0])))
    right = _signature(rates, None)
    for n, slip in enumerate(written.slips(only)):
        if n % _STEPS == 0:
            advance("level 6: slips in the orbits' equations", 1)
        try:
            mine = _signature(rates, slip)
            if all(abs(x - y) <= _ALIKE * abs(y) for x, y in zip(mine, right, strict=True)):
                continue
            if all(flight(slip) <= _ROUGHLY for flight in flights):
                yield slip
        except _FAILS:
            continue


def _at(speed: Any) -> Names:
    return {"Omega": speed, "given_Omega": speed}


def _rates(written: Written, names: Names, slip: Slip | None, y: Sequence[float]) -> tuple[float, float, float]:
    found = written.run(names | dict(zip(STATE, y, strict=True)), slip)
    return y[2], found["gamma_rate"], found["v_rate"]


def _flight(written: Written, pairs: Pairs, lane: int) -> Callable[[Slip], float]:
    """What a slip leaves of one pair's defect, of its size."""
    start, missed, speed = pairs.starts[:, lane].tolist(), pairs.missed[:, lane], float(pairs.speeds[lane])
    rates = partial(_rates, written, REAL | set_parameters(pairs.here.set) | _at(speed))

    def end(slip: Slip | None, count: int) -> Array:
        y, h = start, pairs.between / count
        for _ in range(count):
            a = rates(slip, y)
            b = rates(slip, [x + h / 2 * k for x, k in zip(y, a, strict=True)])
            c = rates(slip, [x + h / 2 * k for x, k in zip(y, b, strict=True)])
            d = rates(slip, [x + h * k for x, k in zip(y, c, strict=True)])
            y = [x + h / 6 * (p + 2 * q + 2 * r + s) for x, p, q, r, s in zip(y, a, b, c, d, strict=True)]
            if not abs(y[2]) < _HUGE:
                break
        return numpy.array(y)

    right = {count: end(None, count) for count in (round(pairs.between / _STEP), round(pairs.between / _SHORT))}

    def left(slip: Slip) -> float:
        for count, ends in right.items():
            moved = end(slip, count) - ends
            if abs(moved).max() < _HUGE:
                return float(numpy.linalg.norm(moved - missed) / numpy.linalg.norm(missed))
        return math.inf

    return left


def _signature(rates: Callable[..., tuple[float, float, float]], slip: Slip | None) -> list[float]:
    return [rate for place in _PLACES for rate in rates(slip, place)]


def _ends(written: Written, slip: Slip, pairs: Pairs) -> Array | None:
    names = _ARRAYS | set_parameters(pairs.here.set) | _at(pairs.speeds)

    def field(y: Array) -> Array:
        found: dict[str, Any] = written.run(names | dict(zip(STATE, y, strict=True)), slip)
        return numpy.stack(numpy.broadcast_arrays(y[2], found["gamma_rate"], found["v_rate"]))

    try:
        return flown(field, pairs.starts, pairs.between, round(pairs.between / _SHORT))
    except _FAILS:
        return None
