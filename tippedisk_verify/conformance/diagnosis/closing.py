"""Cycles whose state is wrong: what brings the answered state back to itself, where the right equations do not.

Half a period from (gamma_bar_0, v_0) and the symmetry are two equations. One number in the equations is solved for with
one of them on one cycle; the other, and all other cycles, have to bear it out.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, Field, field, half_map
from tippedisk_verify.conformance.diagnosis.scans import Lanes, changed_field, changes, lane_field, narrowed, plain
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.diagnosis.speeds import other_speeds, stopped_of
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["closing_of", "unclosed"]

_STATE = ("gamma_bar_0", "v_0")
_FINE = 1e-3  # s, of a step of RK4: it leaves some 1e-9
_COARSE = 4e-3  # where lanes are many, to find out which are worth more
_MANY = 200
_LEFT = 1e-8  # rad, rad/s; of a state that is brought back
_LONGEST = 1.5  # right periods, for half of one
_CLOSED = 0.05  # of what the right equations leave: what others may
_PERIOD = 1e-4  # relative
_TRIVIAL, _MOST = 1e-2, 2 * math.pi  # rad; less is the inverted equilibrium, not a cycle
_FASTEST = 20.0  # rad/s; of v_0
_NEAR = 1e-3  # relative: a period that is further off has another cause
_SMALL = 2e-4  # rad, rad/s: less than wrong equations leave
_SHORT = 1e-8  # relative
_QUARTERS = math.pi / 2


class _Answered:
    """The cycles of one law as they are answered: speeds, starts, and what the right equations leave of them."""

    def __init__(self, usable: Sequence[Grade], wrong: set[str], store: Store) -> None:
        answers: Mapping[str, Decimal] = {grade.id: as_decimal(grade.answer) for grade in usable}
        entries: dict[str, dict[str, Quantity]] = {}
        for grade in usable:
            entries.setdefault(grade.id.rsplit("/", 1)[0], {})[store[grade.id].name] = store[grade.id]
        whole = [
            here
            for here in entries.values()
            if set(_STATE) <= here.keys()
            and _MOST > abs(answers[here["gamma_bar_0"].id]) > _TRIVIAL
            and _FASTEST > -answers[here["v_0"].id] > 0
        ]
        self.first = whole[0]["v_0"] if whole else None
        self.entries = [here["v_0"].id.rsplit("/", 1)[0] for here in whole]
        self.omega = numpy.array([float(here["v_0"].inputs["Omega"]) for here in whole])
        gamma, v = (numpy.array([float(answers[here[name].id]) for here in whole]) for name in _STATE)
        self.start = numpy.stack([numpy.full(len(whole), _QUARTERS), _QUARTERS + gamma, v])
        self.period = numpy.array(
            [float(answers[here["period"].id]) if "period" in here else math.nan for here in whole]
        )
        self.longest = [_LONGEST * (here["period"].for_doubles if "period" in here else 10.0) for here in whole]
        self.wrong = numpy.array(
            [any(here[name].id in wrong for name in (*_STATE, "period") if name in here) for here in whole]
        )
        self.tried = frozenset(
            here[name].id for here in whole for name in (*_STATE, "period") if name in here and here[name].id in wrong
        )

    def left(self, f: Field) -> tuple[Array, Array]:
        """What half a period leaves of each cycle, and the period."""
        time, end = half_map(f, self.start, _FINE, _QUARTERS, max(self.longest))
        return numpy.stack([2 * _QUARTERS - end[1] - self.start[1], -end[2] - self.start[2]]), 2 * time

    def closed(self, f: Field, right: tuple[Array, Array]) -> bool:
        """Whether much less is left of the wrong cycles than by the right equations, and their periods are so, too."""
        (left, period), (most, other) = self.left(f), right
        size, bound = abs(left).max(axis=0), _CLOSED * abs(most).max(axis=0)
        late = abs(period - self.period) > numpy.fmax(_PERIOD * period, _CLOSED * abs(other - self.period))
        return bool((size <= numpy.where(self.wrong, bound, numpy.inf)).all()) and not late.any()


def _speeds(omega: Array) -> dict[str, Array]:
    found = {"Omega rounded to single precision": [struct.unpack("f", struct.pack("f", x))[0] for x in omega]}
    found |= {f"Omega rounded to {n} decimals": [round(x, n) for x in omega] for n in range(10)}
    found |= {f"Omega rounded to {n} significant digits": [float(f"{x:.{n}g}") for x in omega] for n in range(9, 14)}
    return {text: numpy.array(speeds) for text, speeds in found.items()}


def closing_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What closes the answered cycles: rounded speeds, one number in their equations, or an integrator's step."""
    here = _Answered(usable, wrong, store)
    if here.first is None or not here.wrong.any():
        return None
    set_name, friction = here.first.set, here.first.friction
    right = here.left(field(set_name, friction, here.omega))
    if not numpy.isfinite(right[0]).all() or abs(right[0][:, here.wrong]).max(axis=0).min() < _LEFT:
        return stopped_of(usable, wrong, store)
    lane = int(numpy.argmax(abs(right[0]).max(axis=0) * here.wrong))
    rounded = _speeds(here.omega)
    start = numpy.repeat(here.start[:, lane : lane + 1], len(rounded), axis=1)
    there = field(set_name, friction, numpy.array([speeds[lane] for speeds in rounded.values()]))
    _, end = half_map(there, start, _FINE, _QUARTERS, here.longest[lane])
    left = numpy.fmax(abs(2 * _QUARTERS - end[1] - start[1]), abs(end[2] + start[2]))
    likely = left <= _CLOSED * abs(right[0][:, lane]).max()
    for text, speeds in itertools.compress(rounded.items(), likely):
        if here.closed(field(set_name, friction, speeds), right):
            return ((("closing", f"{text} for the cycles"),), here.tried)
    if (found := other_speeds(usable, wrong, store) or stopped_of(usable, wrong, store)) is not None:
        return found
    texts = _numbers(here, right, set_name, friction)
    return (tuple(("closing", text) for text in texts), here.tried) if texts else None


def _numbers(here: _Answered, right: tuple[Array, Array], set_name: str, friction: str) -> list[str]:
    lane = int(numpy.argmax(abs(right[0]).max(axis=0) * here.wrong))
    start, omega, error = here.start[:, lane], float(here.omega[lane]), right[0][:, lane]

    def residual(lanes: Lanes) -> Array:
        f, starts = lane_field(lanes, set_name, friction, omega, start)
        _, end = half_map(f, starts, _COARSE if len(lanes) > _MANY else _FINE, _QUARTERS, here.longest[lane])
        return numpy.stack([2 * _QUARTERS - end[1] - start[1], -end[2] - start[2]])[:, :-1]

    found: dict[tuple[bool, bool], list[str]] = {}
    for change, rough in narrowed(residual, error, changes(set_name, starts=False)):
        term = change.kind == "term"
        short = (plain(rough), plain(rough) if term else _short(rough))
        for value in dict.fromkeys((*(one for one in short if one != rough), rough)):
            if not here.closed(changed_field(change, value, set_name, friction, here.omega), right):
                continue
            rank = term, value == rough  # a number of few digits says more than another
            # A coarse integrator's errors look like a term's odd factor; small ones look like any odd number.
            if rank != (True, True) and (rank == (False, False) or abs(error).max() > _SMALL):
                found.setdefault(rank, []).append(f"{change.make(value).cause} (in the cycles' equations)")
            break
    return found[min(found)] if found else []


def _short(value: float) -> float:
    """A number of at most six digits, where there is one that one in a hundred numbers has by chance."""
    short = (float(f"{value:.{digits}g}") for digits in range(1, 7))
    return next((x for x in short if abs(x - value) <= _SHORT * abs(value)), value)


def unclosed(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """Small errors that the equations do not explain: the answered state is not brought back to itself."""
    here = _Answered(usable, wrong, store)
    if here.first is None or not here.wrong.any():
        return None
    right, period = here.left(field(here.first.set, here.first.friction, here.omega))
    sizes = abs(right[:, here.wrong]).max(axis=0)
    if not (_LEFT < sizes.max() < _SMALL and (abs(period - here.period) < _NEAR * period).all()):
        return None
    text = (
        f"(gamma_bar_0, v_0) is not closed: the right equations bring it back only to {sizes.max():.1g}; Newton's "
        "iteration was not run until it had converged, or the integrator's tolerance or step is too coarse"
    )
    return (("unclosed", text),), here.tried
