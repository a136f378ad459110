"""What happens to states on the way: at the start, whenever an integration is started anew, or throughout.

The defects say when: after the start alone, after each second, everywhere.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.flights import Array, field, flown
from tippedisk_verify.conformance.diagnosis.pairs import Pairs, pairs_of
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.scans import plain
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Store
from tippedisk_verify.theory.slow_manifold import slow_manifold

__all__ = ["restarts_of"]

_PARTS = (2, 5, 10, 20, 25, 50, 100, 250, 500)  # of the time between samples
_SAME = 1e-6  # rad/s; how well v lies on a manifold
_PASSES = 4  # of Newton's method
_TINY = 1e-6  # rad/s, of a difference quotient
_FAR = 1.0  # rad/s
_ALIKE = 0.1  # of a shift of time: how far that of half of the restarts may be off
_FINE = 1e-3  # s, of a step
_FEW = 8  # pairs
_SOME = 0.6  # of them, which rounding the other way may not spoil
_MOSTLY = 0.9  # of the pairs that begin at a time have a defect, where states are changed at that time
_SHORT = {0: "h_0, on the critical manifold", 1: "h_0 + epsilon h_1, on the slow manifold to first order"}
Change = Callable[[Array], Array]


def restarts_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What is done to states at certain times, if that leads from each answered sample to the next."""
    samples = frozenset(id_ for id_ in wrong if "@" in id_)
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    pairs = pairs_of([store[id_] for id_ in answers], answers) if samples else None
    text = _reduced(pairs) or _changed(pairs) or _speeds(pairs) if pairs is not None else None
    return ((("restart", text),), samples) if text else None


def _manifold(pairs: Pairs, order: int) -> Callable[[Array], Array]:
    """v on the slow manifold to this order."""
    constants = Model(Alternative("", ""), pairs.here.set, pairs.here.friction).constants()
    return lambda y: numpy.asarray(slow_manifold(numpy, constants, pairs.speeds, y[0], y[1], order))


def _reduced(pairs: Pairs) -> str | None:
    """Orbits on a manifold, where v is a function of the angles."""
    for order, text in _SHORT.items():
        v = _manifold(pairs, order)

        def reduced(y: Array, v: Callable[[Array], Array] = v) -> Array:
            rate = v(y)
            return numpy.stack([rate, -pairs.speeds * numpy.cos(y[0]), numpy.zeros_like(rate)])

        made = flown(reduced, pairs.starts, pairs.between, round(pairs.between / _FINE))
        if pairs.explained(made, rows=2):
            on = numpy.median(abs(v(pairs.ends) - pairs.ends[2])) < _SAME
            what = "" if on else "; the v that is answered does not enter"
            return f"the reduced equations are integrated: beta' = {text}{what}"
    return None


def _speeds(pairs: Pairs) -> str | None:
    """Each orbit has another constant speed than the one asked for; and by which rule, if one is known."""
    asked, which = numpy.unique(pairs.speeds, return_inverse=True)
    speeds = asked.copy()

    def ends(speeds: Array) -> Array:
        f = field(pairs.here.set, pairs.here.friction, speeds[which])
        return flown(f, pairs.starts, pairs.between, round(pairs.between / _FINE))

    for _ in range(_PASSES):
        made = ends(speeds)
        slope = (ends(speeds + _TINY) - made) / _TINY
        along, square = (
            numpy.bincount(which, numpy.nan_to_num(part).sum(axis=0))
            for part in (slope * (pairs.ends - made), slope * slope)
        )
        speeds = speeds + along / numpy.maximum(square, _TINY)
        if not abs(speeds - asked).max() < _FAR:
            return None
    if not pairs.explained(ends(speeds)):
        return None
    off = speeds - asked
    for unit, turn in (("", 1.0), (" in turns per minute", 30 / math.pi), (" in turns per second", 0.5 / math.pi)):
        for decimals in range(7):
            given = numpy.round(asked * turn, decimals) / turn
            if abs(given - speeds).max() < _SAME and abs(given - asked).max() > _SAME:
                return f"Omega rounded to {decimals} decimals{unit} at the start"
    if min(numpy.ptp(off), numpy.ptp(off / asked)) < _SAME:  # one number, which is looked for elsewhere
        return None
    return f"orbits are those of other speeds than asked, by {off.min():.3g} to {off.max():.3g} rad/s"


def _changed(pairs: Pairs) -> str | None:
    moved = pairs.moved
    often = {float(t): moved[pairs.times == t].mean() > _MOSTLY for t in numpy.unique(pairs.times)}
    some = [t for t, bad in often.items() if bad]
    if not some or any(moved[pairs.times == t].any() for t, bad in often.items() if not bad):
        return None
    if some == [0.0]:
        first = pairs.some(pairs.times == 0)
        for text, change in (*_velocities(first), *_begun(first)):  # what is rounded is sought among the known mistakes
            if first.explained(first.on(change(first.starts), pairs.between)):
                return f"orbits start in another state than asked: {text}"
        return None
    later = [t for t in some if t]
    period = later[0] if len(later) == 1 else min(b - a for a, b in itertools.pairwise(later))
    if any(often[t] != (t in later) for t in often if t) or any(t % period for t in later):
        return None
    here = pairs.some(moved & (pairs.times > 0))
    for text, change in (*_changes(here), *_lost(here)):
        if here.explained(here.on(change(here.starts), pairs.between)):
            return f"the integration starts anew every {period:g} s, and each time {text}"
    return _often(pairs) if period <= pairs.between else None


def _often(pairs: Pairs) -> str | None:
    """Changes between samples, on a few pairs all at once before they are tried on all."""
    few = pairs.some(numpy.flatnonzero(pairs.moved)[:: max(1, int(pairs.moved.sum()) // _FEW)])
    for parts in _PARTS:
        length = pairs.between / parts
        changes = [*_changes(few)]
        lanes = numpy.repeat(few.starts[:, None], len(changes), axis=1)
        for _ in range(parts):
            lanes = numpy.stack([change(lanes[:, n]) for n, (_, change) in enumerate(changes)], axis=1)
            lanes = few.on(lanes, length)
        for n, (_, change) in enumerate(changes):
            if not any(few.explained(y, mostly=_SOME) for y in (lanes[:, n], change(lanes[:, n]))):
                continue
            text, change = [*_changes(pairs)][n]
            y = pairs.starts
            for _ in range(parts):
                y = pairs.on(change(y), length)
            if pairs.explained(y) or pairs.explained(change(y)):
                return f"the integration starts anew every {length:g} s, and each time {text}"
    return None


def _changes(pairs: Pairs) -> Iterator[tuple[str, Change]]:
    for n in range(1, 8):
        yield f"the state is rounded to {n} decimals", lambda y, n=n: numpy.round(y, n)  # type: ignore[misc]
    for n in range(2, 9):
        yield f"the state is rounded to {n} significant digits", lambda y, n=n: _digits(y, n)  # type: ignore[misc]
    yield "the state is rounded to single precision", lambda y: y.astype(numpy.float32).astype(float)
    yield from _velocities(pairs)


def _velocities(pairs: Pairs) -> Iterator[tuple[str, Change]]:
    yield "v is set to 0", lambda y: numpy.stack([y[0], y[1], 0 * y[2]])
    yield "v has lost its sign", lambda y: numpy.stack([y[0], y[1], abs(y[2])])
    for order, text in _SHORT.items():
        v = _manifold(pairs, order)
        yield f"v is set to {text}", lambda y, v=v: numpy.stack([y[0], y[1], v(y)])  # type: ignore[misc]


def _digits(y: Array, digits: int) -> Array:
    scale = 10.0 ** (digits - 1 - numpy.floor(numpy.log10(numpy.maximum(abs(y), 1e-300))))
    return numpy.asarray(numpy.round(y * scale) / scale)


def _begun(pairs: Pairs) -> Iterator[tuple[str, Change]]:
    """A first step that is taken twice, or by Euler's method."""
    for h in (f * 10.0**-k for k in (1, 2, 3, 4) for f in (1.0, 2.0, 5.0)):
        yield f"that after a step of Euler's method of {h:g} s", lambda y, h=h: y + h * pairs.field(y)  # type: ignore[misc]


def _lost(pairs: Pairs) -> Iterator[tuple[str, Change]]:
    """The same shift of time for all."""
    rate = pairs.field(pairs.ends)
    by = (pairs.missed * rate).sum(axis=0) / (rate**2).sum(axis=0)
    shift = plain(float(numpy.median(by)))
    if numpy.median(abs(by - shift)) > _ALIKE * abs(shift) or not math.isfinite(shift) or abs(shift) > pairs.between:
        return
    text = f"{abs(shift):g} s {'are skipped' if shift > 0 else 'pass twice'}"
    yield text, lambda y: flown(pairs.field, y, shift, max(1, math.ceil(abs(shift) / _FINE)))
