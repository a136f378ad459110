"""What answers that are no orbit's samples or crossings say of the right orbit: which event, which times, which rate.

The right state at any time is a short flight from the stored sample before it. Where a function of it is the same at
all answered times, that function is the event.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import CORRECT, Alternative, spelled
from tippedisk_verify.conformance.diagnosis.flights import Array, states_at
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["events_of"]

_ALIKE = 1e-6  # of states and times
_LEVEL = 1e-4  # of an event's function, as a program locates events in time
_LEAST = 4  # answers that have the same
_CRUDE = 0.005  # s; a smaller error is that of a crude location, which is looked for elsewhere


def events_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """Crossings and flat times of right orbits that are another event's, or numbered otherwise."""
    if any("@" in id_ for id_ in wrong):
        return None
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    here = [store[id_] for id_ in answers if store[id_].name.startswith("crossing_time#")]
    bad = [quantity for quantity in here if quantity.id in wrong]
    if not bad:
        return _flat([store[id_] for id_ in wrong if store[id_].name == "flat_time"], wrong, answers, store)
    text = _section(bad, answers, store) or _left_out(here, answers, store)
    return ((("event", text),), frozenset(wrong)) if text else None


def _functions(states: Array, parts: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    beta, gamma, v = states
    yield "gamma = {}, modulo 2 pi", numpy.mod(gamma, 2 * math.pi)
    yield "gamma = {}, modulo pi", numpy.mod(gamma, math.pi)
    yield "v = {}", v
    yield "beta = {}", beta
    yield "gamma_y = {}", parts["gamma_y"]
    yield "v' = {}", parts["v_rate"]


def _section(bad: Sequence[Quantity], answers: Mapping[str, Decimal], store: Store) -> str | None:
    """The function that has the same value at all answered crossings; gamma and v, if answered, are those there."""
    times = numpy.array([float(answers[quantity.id]) for quantity in bad])
    states = states_at(bad, times, store)
    known = numpy.isfinite(states[0])
    if known.sum() < _LEAST:
        return None
    for row, name in ((1, "crossing_gamma"), (2, "crossing_v")):
        for lane in numpy.flatnonzero(known).tolist():
            said = answers.get(bad[lane].id.replace("crossing_time", name))
            if said is not None and abs(float(said) - states[row, lane]) > 100 * _ALIKE:
                return None
    model = Model(Alternative("", ""), bad[0].set, bad[0].friction)
    speeds = numpy.array([float(quantity.inputs["Omega"]) for quantity in bad])
    parts = spelled(CORRECT, numpy, model.p, speeds, states, model.friction)
    for text, values in _functions(states, parts):
        value = float(numpy.median(values[known]))
        if abs(values[known] - value).max() < _LEVEL and not (text[0] == "b" and abs(value - math.pi / 2) < _LEVEL):
            return f"crossings are those of {text.format(_number(value))} on the right orbits, not of beta = pi/2"
    return None


def _number(value: float) -> str:
    for name, number in (("pi/2", math.pi / 2), ("3 pi/2", 1.5 * math.pi), ("pi", math.pi), ("0", 0.0)):
        if abs(value - number) < _LEVEL:
            return name
    return f"{value:.6g}"


def _left_out(here: Sequence[Quantity], answers: Mapping[str, Decimal], store: Store) -> str | None:
    """The time before which crossings are not counted: the same on all orbits."""
    latest, earliest, shifted = 0.0, math.inf, False
    for entry in {quantity.id.rsplit("/", 1)[0] for quantity in here}:
        right = {int(q.name.split("#")[1]): q.for_doubles for q in store.matching(f"{entry}/crossing_time#")}
        given = {int(q.name.split("#")[1]): float(answers[q.id]) for q in here if q.id.startswith(entry + "/")}
        by = next((k for k in range(len(right)) if abs(right.get(1 + k, math.inf) - given.get(1, 0.0)) < _ALIKE), None)
        if by is None or any(abs(right.get(n + by, time) - time) > 1e-3 for n, time in given.items()):
            return None
        shifted = shifted or by > 0
        latest, earliest = max(latest, right.get(by, 0.0)), min(earliest, right[1 + by])
    if not (shifted and latest < earliest < math.inf):
        return None
    return (
        f"the first crossings are left out: those up to {latest:.3g} s; the ones from {earliest:.3g} s on are counted"
    )


def _flat(bad: Sequence[Quantity], wrong: set[str], answers: Mapping[str, Decimal], store: Store) -> Found | None:
    """At the answered flat_time the right orbit is not flat yet."""
    if not bad or len(bad) < len(wrong):
        return None
    sines = numpy.sin(states_at(bad, numpy.array([float(answers[quantity.id]) for quantity in bad]), store)[0])
    late = [abs(float(answers[quantity.id]) - quantity.for_doubles) for quantity in bad]
    if not (abs(sines) > _ALIKE).all() or min(late) < _CRUDE:
        return None
    angles = " and ".join(f"{x:.2g}" for x in sines)
    text = f"flat_time is not where sin beta vanishes: on the right orbit it is {angles} there; a threshold, or a step"
    return (("event", text),), frozenset(wrong)
