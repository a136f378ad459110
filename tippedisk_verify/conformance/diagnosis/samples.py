"""Which instants samples are of: other times than asked, points of a grid, or straight lines between such points.

The right orbits are known at all times. On each of them the answers to the same time have the same fault, and so a
shift of time, or the distance of the points of a grid, is sought that explains the samples of all orbits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, Orbits
from tippedisk_verify.conformance.diagnosis.scans import plain
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["samples_of"]

_STATE = ("beta", "gamma", "v")
_LEAST = 2  # orbits, and times
_HUGE = 1e3  # rad, rad/s; no right state is that far off
_FARTHEST = 0.25  # s, of a shift
_SHIFTS = 1001
_PASSES = 20  # of the Gauss-Newton method
_LEFT = 0.05  # of the errors: what a guess may leave before it is held against each answer
_FINEST = 1e-3  # s; straight lines between nearer points leave the digits that are asked for
_WIDEST = 0.5  # s
_PHASES = 20.0  # values of the distance tried while the last sample's place in its interval goes round once
_BEST = 10  # distances that are tried on the answers themselves
_CRUDELY = 0.5  # of the errors: what second derivatives may leave of a straight line's
_TIMES = 5  # that a distance is narrowed
_PARTS = 8
_TINY = 1e-6  # s, for derivatives
_CURVED = 1e-3  # s, for second differences
_ROUGHLY = 0.1  # of a grid's distance: how far times may be off its points before it is refined
_NEARLY = 1e-6  # s, of a grid's points
_ALIKE = 1e-7  # s, of times
_COARSE = 2e-3  # s; far times are looked for at such distances before they are polished
_SPACINGS = tuple(f * 10.0**-k for k in (1, 2, 3, 4) for f in (5.0, 4.0, 2.5, 2.0, 1.0))  # s, of the points of a grid


@dataclass(frozen=True)
class _Samples:
    """All whole states that were answered: rows beta, gamma and v."""

    asked: list[list[Quantity]]
    orbit: Array  #: which
    times: Array
    given: Array
    right: Array
    orbits: Orbits
    ended: bool  #: whether all answers to the last time are right, where a grid may end whatever its distance

    @property
    def errors(self) -> Array:
        return self.given - self.right


def samples_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What the samples of all orbits are, where they are right states of other times, or lie between such."""
    if not any("@" in id_ for id_ in wrong):
        return None
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    samples = _samples([store[id_] for id_ in answers if "@" in id_], answers, wrong, store)
    if samples is None or not abs(samples.errors).max() < _HUGE:
        return None
    text = _other_times(samples, answers, wrong) or _straight(samples, answers, wrong)
    if text:
        return (("samples", text),), frozenset(id_ for id_ in wrong if "@" in id_)
    found = _far_times(samples, answers, wrong) or _one_part(samples, answers, wrong)
    return ((("samples", found[0]),), found[1]) if found else None


def _samples(
    here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store
) -> _Samples | None:
    states: dict[tuple[str, float], dict[str, Quantity]] = {}
    for quantity in here:
        name, time = quantity.name.split("@")
        states.setdefault((quantity.id.rsplit("/", 1)[0], float(time)), {})[name] = quantity
    whole = {place: [three[name] for name in _STATE] for place, three in states.items() if len(three) == len(_STATE)}
    entries = list(dict.fromkeys(entry for entry, _ in whole))
    if len(entries) < _LEAST or len({time for _, time in whole}) < _LEAST:
        return None
    asked, end = list(whole.values()), max(time for _, time in whole)
    return _Samples(
        asked,
        numpy.array([entries.index(entry) for entry, _ in whole]),
        numpy.array([time for _, time in whole]),
        numpy.array([[float(answers[quantity.id]) for quantity in three] for three in asked]).T,
        numpy.array([[quantity.for_doubles for quantity in three] for three in asked]).T,
        Orbits([store[f"{entry}/beta@{min(time for e, time in whole if e == entry):g}"] for entry in entries], store),
        not any(q.id in wrong for (_, time), three in whole.items() for q in three if time == end),
    )


def _explain(
    samples: _Samples, expected: Array, answers: Mapping[str, Decimal], wrong: set[str], some: Array | None = None
) -> bool:
    """Whether each of the answers, or some of them, is as expected."""
    some = numpy.ones(len(samples.times), dtype=bool) if some is None else some
    left = numpy.linalg.norm((samples.given - expected)[:, some])
    if not left < _LEFT * numpy.linalg.norm(samples.errors[:, some]):
        return False
    return all(
        borne_out(answers[samples.asked[n][row].id], expected[row, n], samples.asked[n][row],
                  samples.asked[n][row].id in wrong) is not None
        for n in numpy.flatnonzero(some).tolist()
        for row in range(len(_STATE))
    )  # fmt: skip


def _wrong_among(samples: _Samples, wrong: set[str], some: Array) -> frozenset[str]:
    return frozenset(q.id for n in numpy.flatnonzero(some) for q in samples.asked[n] if q.id in wrong)


def _far_times(samples: _Samples, answers: Mapping[str, Decimal], wrong: set[str]) -> tuple[str, frozenset[str]] | None:
    """Right states at a multiple of the time asked for, as far as right orbits are known."""
    first, end = samples.times.min(), samples.times.max()
    early = samples.times == first
    taken = numpy.linspace(0, end, round(end / _COARSE) + 1)
    squares = ((samples.orbits.at(samples.orbit[early][:, None], taken) - samples.given[:, early, None]) ** 2).sum(
        axis=0
    )
    best = taken[numpy.nan_to_num(squares, nan=math.inf).sum(axis=0).argmin()] - first
    group = numpy.where(early, 0, 1)
    factor = plain(1 + float(_polished(samples, numpy.full(len(early), best), group)[early][0]) / first)
    some = samples.times * factor <= end
    if factor <= 0 or abs(factor - 1) < _COARSE or some.sum() < _LEAST * early.sum():
        return None
    if not _explain(samples, samples.orbits.at(samples.orbit, factor * samples.times), answers, wrong, some):
        return None
    return f"samples are taken at {factor:.9g} times the time asked for", _wrong_among(samples, wrong, some)


def _one_part(samples: _Samples, answers: Mapping[str, Decimal], wrong: set[str]) -> tuple[str, frozenset[str]] | None:
    """One part of the states is of another instant than the others, or a difference quotient."""
    bad = [any(three[row].id in wrong for three in samples.asked) for row in range(len(_STATE))]
    some = samples.times < samples.times.max()  # where the run ends there may be no next point
    if sum(bad) != 1 or not some.any():
        return None
    row, times = bad.index(True), samples.times

    def at(by: float) -> Array:
        return samples.orbits.at(samples.orbit, times + by)

    shift = 0.0
    for _ in range(_PASSES):
        state = at(shift)[row]
        rate = (at(shift + _CURVED)[row] - state) / _CURVED
        off = samples.given[row] - state
        shift += float(numpy.nansum((rate * off)[some]) / max(numpy.nansum((rate**2)[some]), 1e-300))
    shift = plain(shift)
    late = f"{abs(shift):.6g} s {'after' if shift > 0 else 'before'} the others"
    found = [(f"{_STATE[row]} of samples is that {late}; the others are right", at(shift)[row])]
    for h in _SPACINGS if row == len(_STATE) - 1 else ():
        beta = {by: at(by * h)[0] for by in (-1, 0, 1)}
        for word, one, two in (("forward", 1, 0), ("backward", 0, -1), ("central", 1, -1)):
            text = f"v of samples is a {word} difference of beta over {h * (one - two):.6g} s"
            found.append((text, (beta[one] - beta[two]) / (h * (one - two))))

    def left(one: tuple[str, Array]) -> float:
        return float(numpy.linalg.norm(numpy.nan_to_num(one[1] - samples.given[row], nan=_HUGE)[some]))

    text, values = min(found, key=left)
    expected = samples.right.copy()
    expected[row] = values
    if not 0 < abs(shift) < _FARTHEST or not _explain(samples, expected, answers, wrong, some):
        return None
    return text, _wrong_among(samples, wrong, some)


# ------------------------------------------------------------------------------------------ other times
def _other_times(samples: _Samples, answers: Mapping[str, Decimal], wrong: set[str]) -> str | None:
    """Right states of other times: a shift for each time asked, the same on all orbits, or one for each sample."""
    shifts = numpy.linspace(-_FARTHEST, _FARTHEST, _SHIFTS)
    at = samples.orbits.at(samples.orbit[:, None], samples.times[:, None] + shifts)
    squares = ((at - samples.given[:, :, None]) ** 2).sum(axis=0)
    squares[~numpy.isfinite(squares)] = math.inf
    times, which = numpy.unique(samples.times, return_inverse=True)
    together = numpy.zeros((len(times), _SHIFTS))
    numpy.add.at(together, which, squares)
    shift = _polished(samples, shifts[together.argmin(axis=1)][which], which)
    if _explain(samples, samples.orbits.at(samples.orbit, samples.times + shift), answers, wrong):
        by = numpy.array([shift[which == n][0] for n in range(len(times))])
        count = len(times) - samples.ended
        for text, taken in _laws(times[:count], by[:count]) if count >= _LEAST else ():
            instants = numpy.append(taken, times[count:])[which]
            if _explain(samples, samples.orbits.at(samples.orbit, instants), answers, wrong):
                return text
        return f"samples are states of other times than asked, on all orbits {by.min():.3g} s to {by.max():.3g} s later"
    shift = _polished(samples, shifts[squares.argmin(axis=1)], numpy.arange(len(shift)))
    if not _explain(samples, samples.orbits.at(samples.orbit, samples.times + shift), answers, wrong):
        return None
    if not _lasting(samples, abs(shift)):
        return None
    step = "last" if shift.max() < _ALIKE else "next" if shift.min() > -_ALIKE else "nearest"
    return (
        f"samples are states at the {step} of the steps that the integrator took, another time than asked: "
        f"{shift.min():.2g} s to {shift.max():.2g} s off"
    )


def _polished(samples: _Samples, shift: Array, group: Array) -> Array:
    """Shifts at which the samples of each group are nearest to their orbits."""
    for _ in range(_PASSES):
        time = samples.times + shift
        state, ahead = samples.orbits.at(samples.orbit, time), samples.orbits.at(samples.orbit, time + _CURVED)
        rate = (ahead - state) / _CURVED
        parts = numpy.nan_to_num(numpy.stack([(rate * (samples.given - state)).sum(axis=0), (rate**2).sum(axis=0)]))
        along, size = (numpy.bincount(group, part) for part in parts)
        shift = shift + (along / numpy.maximum(size, 1e-300))[group]
    return shift


def _laws(times: Array, by: Array) -> list[tuple[str, Array]]:
    """Simple laws of the times that samples were taken at, the shifts being ``by``; with these times."""
    found: list[tuple[str, Array]] = []
    late, factor = plain(float(numpy.median(by))), plain(1 + float((by * times).sum() / (times**2).sum()))
    if late:
        word = "late" if late > 0 else "early"
        found.append((f"samples are taken {abs(late):.6g} s too {word}", times + late))
    if factor != 1:
        found.append((f"samples are taken at {factor:.9g} times the time asked for", times * factor))
    slope, first = numpy.polyfit(times, by, 1)
    slope, first = plain(1 + float(slope)), plain(float(first))
    text = f"samples are taken at {slope:.9g} times the time asked for, and {abs(first):.6g} s too "
    found.append((text + ("late" if first > 0 else "early"), times * slope + first))
    taken = times + by
    inverse = _inverses(times)
    cycles = taken * inverse[:, None]
    off = abs(cycles - numpy.round(cycles)).max(axis=1)
    for u in numpy.sort(inverse[[n for n in _minima(off) if off[n] < _ROUGHLY]]):
        n = numpy.round(taken * u)
        h = _short(float((n * taken).sum() / (n * n).sum()), times)
        place = times / h
        for word, taking in (("nearest", numpy.round), ("last", _floor), ("next", _ceiling)):
            if (taking(place) == n).all():
                found.append((f"samples are states at the {word} point of a grid of {h:.6g} s", h * n))
    return found


def _short(h: float, times: Array) -> float:
    """A grid's distance with few digits, if that moves no point."""
    short = plain(h)
    return short if abs(short / h - 1) * times.max() < _NEARLY else h


def _floor(x: Array) -> Array:
    return numpy.asarray(numpy.floor(x + _ALIKE))


def _ceiling(x: Array) -> Array:
    return numpy.asarray(numpy.ceil(x - _ALIKE))


def _inverses(times: Array) -> Array:
    """The reciprocals of the distances of a grid's points, so dense that none is missed, widest first."""
    return numpy.arange(1 / _WIDEST, 1 / _FINEST, 1 / (_PHASES * times.max()))


def _lasting(samples: _Samples, sizes: Array) -> bool:
    """Whether faults do not grow on the way, as an orbit's errors do."""
    early = samples.times <= numpy.median(samples.times)
    first, rest = numpy.median(sizes[early]), numpy.median(sizes[~early])
    return bool(_ALIKE < rest / 4 < first < 4 * rest)


# ------------------------------------------------------------------------------------------ straight lines
def _straight(samples: _Samples, answers: Mapping[str, Decimal], wrong: set[str]) -> str | None:
    """Straight lines between the points of a grid, whose distance the errors tell, or between uneven points."""
    around = [samples.orbits.at(samples.orbit, samples.times + shift) for shift in (-_CURVED, 0.0, _CURVED)]
    second = numpy.nan_to_num((around[0] - 2 * around[1] + around[2]) / _CURVED**2)
    along, size = (second * samples.errors).sum(axis=0), numpy.maximum((second**2).sum(axis=0), 1e-300)
    half = along / size  # of the product of the distances from both points
    if numpy.linalg.norm(samples.errors - half * second) > _CRUDELY * numpy.linalg.norm(samples.errors):
        return None
    times, which = numpy.unique(samples.times, return_inverse=True)
    inverse = _inverses(times)
    phase = times * inverse[:, None] % 1
    common, weights = numpy.bincount(which, along) / numpy.bincount(which, size), numpy.bincount(which, size)
    weights[-1] *= not samples.ended
    off = (phase * (1 - phase) / 2 / inverse[:, None] ** 2 - common) ** 2 @ weights
    for u in inverse[_minima(off)[:_BEST]]:
        h, width = 1 / u, inverse[1] - inverse[0]
        for _ in range(_TIMES):
            near = 1 / (1 / h + width * numpy.linspace(-1, 1, 2 * _PARTS + 1))
            h, width = min(near, key=lambda h: _left(samples, _on_grid(samples, h))), width / _PARTS
        if _explain(samples, _on_grid(samples, h := _short(float(h), times)), answers, wrong):
            return f"samples are interpolated linearly between points {h:.6g} s apart"
    before, after = _brackets(samples, numpy.sqrt(2 * numpy.maximum(half, 0.0)))
    if not _explain(samples, _on_line(samples, before, after), answers, wrong) or not _lasting(samples, half):
        return None
    if min(half) > max(half) / 2:  # no points, a mean
        return None
    apart = 2 * math.sqrt(2 * max(half))
    return (
        "samples are interpolated linearly between the integrator's own steps, or points of an odd grid, "
        f"{apart:.2g} s or more apart"
    )


def _minima(values: Array) -> Array:
    """Where a value is less than its neighbours, by size."""
    inner = numpy.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    return numpy.asarray(inner[numpy.argsort(values[inner], kind="stable")])


def _left(samples: _Samples, expected: Array) -> float:
    return float(numpy.linalg.norm(numpy.nan_to_num(samples.given - expected, nan=1.0)))


def _on_grid(samples: _Samples, h: float) -> Array:
    before = samples.times - h * _floor(samples.times / h)
    on_line = _on_line(samples, before, h - before)
    return numpy.where(samples.ended & (samples.times == samples.times.max()), samples.right, on_line)


def _on_line(samples: _Samples, before: Array, after: Array) -> Array:
    """What a straight line has between two right states, so long before and after the times asked for."""
    ends = [samples.orbits.at(samples.orbit, samples.times + by) for by in (-before, after)]
    states: Array = (after * ends[0] + before * ends[1]) / numpy.maximum(before + after, 1e-300)
    return numpy.where(before + after > 0, states, samples.right)


def _brackets(samples: _Samples, first: Array) -> tuple[Array, Array]:
    """The times before and after at which a straight line's ends lie, by the Levenberg-Marquardt method."""
    ends = numpy.stack([first, first])
    for _ in range(_PASSES):
        here = _on_line(samples, *ends)
        slopes = numpy.stack([_on_line(samples, *(ends + _TINY * unit[:, None])) - here for unit in numpy.eye(2)])
        slopes = numpy.nan_to_num(slopes / _TINY)
        matrix = numpy.einsum("isn,jsn->nij", slopes, slopes)
        matrix += 1e-9 * (numpy.trace(matrix, axis1=1, axis2=2) + 1e-300)[:, None, None] * numpy.eye(2)
        wanted = numpy.einsum("isn,sn->ni", slopes, numpy.nan_to_num(samples.given - here))
        ends = numpy.clip(ends + numpy.linalg.solve(matrix, wanted[:, :, None])[:, :, 0].T, 0.0, _WIDEST)
    return ends[0], ends[1]
