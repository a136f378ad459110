"""One changed number in the equations that orbits or cycles are computed with, searched for over a wide range.

Each lane of one flight has another value of one parameter, speed or start, or another factor on one term. Where a
lane's end passes the answered one, the range is narrowed. What is found so has a few digits and is a guess: the
diagnosis solves for the number with a better integrator, and tries it on other orbits.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.factors import changed_term, moved, parameter, scaled, solved, term_names
from tippedisk_verify.conformance.diagnosis.flights import Array, Field, field, flown
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.grading import Grade
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["Change", "Lanes", "changed_field", "changes", "lane_field", "narrowed", "orbit_values", "plain"]

_STATE = ("beta", "gamma", "v")
_PARAMETERS = ("mu", "epsilon", "g", "e", "r", "m", "A", "B")
_FACTORS = sorted(
    {sign * 10 ** (k / 2) for k in range(-4, 5) for sign in (-1, 1)}
    | {0.0, 0.2, 0.5, 0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.5, 2.0, 5.0}
)
_RATES = sorted({sign * 10 ** (k / 2) for k in range(-12, 1) for sign in (-1, 1)} | {0.0})  # 1/s
_DRIFTING = ("Omega", "mu", "epsilon", "g")
_SHIFTS = sorted({sign * 10 ** (k / 2) for k in range(-8, 2) for sign in (-1, 1)} | {0.0})
_STEP = 2e-3  # s; friction decays at some 130 1/s, and what RK4 leaves is taken off
_ORBITS = 4  # whose first wrong samples a number has to give
_LATEST = 2.0  # s, of the sample that is solved for
_FOLLOWS = 0.1  # of an error: what a number that was read off one orbit may leave on others
_POLISHED = 1e-2  # relative: how far flights with long steps may be off
_PARTS = 8  # that a range is narrowed to one of
_TIMES = 4
_DIGITS = 6
_NEAR = 1e-6  # relative: how well a flight tells a number
_HUGE = 1e100  # an end that blew up
_HOPEFUL = 0.5  # of an error: what a change may leave whose range has been narrowed once
_FITS = 0.02  # of an error: what a change that explains it may leave, all its parts counted


@dataclass(frozen=True)
class Change:
    """One number that may be another: which, and the mistaken model that has a value of it."""

    kind: str  #: parameter, term, speed, start, drift or decay
    name: str
    make: Callable[[float], Alternative]
    grid: Sequence[float]


def changes(set_name: str, starts: bool) -> list[Change]:
    """Of parameters, the speed and each term; of the start of an orbit as well, and what changes on the way."""
    values = vars(Model(Alternative("", ""), set_name, "linear").p)
    found = [
        Change("parameter", name, partial(parameter, name, values[name]), [c * values[name] for c in _FACTORS])
        for name in _PARAMETERS
    ]
    found.append(Change("speed", "Omega", partial(scaled, "Omega"), _FACTORS))
    if starts:
        found.append(Change("start-scale", "v", partial(scaled, "v"), _FACTORS))
        found += [Change("start", name, partial(moved, name, 1), _SHIFTS) for name in _STATE]
        found += [Change("drift", name, partial(_drift, name), _RATES) for name in _DRIFTING]
        found += [Change("decay", name, partial(_decay, name), _RATES) for name in _DRIFTING]
    return found + [Change("term", name, partial(changed_term, name, set_name), _FACTORS) for name in term_names()]


def _drift(name: str, rate: float) -> Alternative:
    cause = f"{name} {'grows' if rate > 0 else 'falls'} along orbits, by {abs(rate):.6g} of its first value a second"
    return Alternative(f"{name}-drift", cause, drift=(name, lambda t: 1 + rate * t))


def _decay(name: str, rate: float) -> Alternative:
    cause = f"{name} {'grows' if rate > 0 else 'decays'} along orbits, by {abs(rate):.6g} of its value a second"
    return Alternative(f"{name}-decay", cause, drift=(name, lambda t: math.exp(rate * t)))


Lanes = Sequence[tuple[Change, float]]


def lane_field(lanes: Lanes, set_name: str, friction: str, omega: float, start: Any) -> tuple[Field, Array]:
    """The field and the starts of these lanes; the last lane is the right one."""
    count = len(lanes) + 1
    parameters: dict[str, Array] = {}
    factors: dict[str, Array] = {}
    drifts: dict[str, Array] = {}
    decays: dict[str, Array] = {}
    values = vars(Model(Alternative("", ""), set_name, friction).p)
    speeds, starts = numpy.full(count, omega), numpy.repeat(numpy.array(start)[:, None], count, axis=1)
    for lane, (change, value) in enumerate(lanes):
        if change.kind == "parameter":
            parameters.setdefault(change.name, numpy.full(count, values[change.name]))[lane] = value
        elif change.kind == "term":
            factors.setdefault(change.name, numpy.ones(count))[lane] = value
        elif change.kind in ("drift", "decay"):
            (drifts if change.kind == "drift" else decays).setdefault(change.name, numpy.zeros(count))[lane] = value
        elif change.kind == "speed":
            speeds[lane] *= value
        elif change.kind == "start-scale":
            starts[_STATE.index(change.name), lane] *= value
        else:
            starts[_STATE.index(change.name), lane] += value
    none = numpy.zeros(count)
    changing = {name: partial(_factor, drifts.get(name, none), decays.get(name, none)) for name in {**drifts, **decays}}
    starts = numpy.vstack([starts, none]) if changing else starts
    return field(set_name, friction, speeds, parameters, factors, changing), starts


def _factor(drift: Array, decay: Array, t: Array) -> Array:
    return numpy.asarray((1 + drift * t) * numpy.exp(decay * t))


def changed_field(change: Change, value: float, set_name: str, friction: str, speeds: Array) -> Field:
    """The field with this number throughout, at several speeds."""
    if change.kind == "speed":
        return field(set_name, friction, value * speeds)
    if change.kind == "parameter":
        return field(set_name, friction, speeds, {change.name: value})
    return field(set_name, friction, speeds, factors={change.name: value})


def narrowed(
    residual: Callable[[Lanes], Array], error: Array, asked: Sequence[Change]
) -> Iterator[tuple[Change, float]]:
    """Values for which all rows of ``residual`` vanish, nearly, where that of the largest ``error`` changes sign."""
    row = int(numpy.argmax(abs(error)))
    ranges = [(change, list(change.grid)) for change in asked]
    for bound in (math.inf, *[_HOPEFUL] * (_TIMES - 1), _FITS):
        found, at = residual([(change, value) for change, grid in ranges for value in grid]), 0
        narrower: list[tuple[Change, list[float]]] = []
        for change, grid in ranges:
            here = found[:, at : at + len(grid)]
            at += len(grid)
            for n, (a, b) in enumerate(itertools.pairwise(here[row])):
                if not (abs(a) < _HUGE and abs(b) < _HUGE and a * b <= 0):
                    continue
                share = a / (a - b) if a != b else 0.5
                left = here[:, n] + share * (here[:, n + 1] - here[:, n])
                if not abs(left).max() <= bound * abs(error).max():
                    continue
                if bound == _FITS:
                    yield change, float(grid[n] + share * (grid[n + 1] - grid[n]))
                narrower.append((change, numpy.linspace(grid[n], grid[n + 1], _PARTS + 1).tolist()))
        ranges = narrower


def plain(value: float) -> float:
    """A number of few digits where one is as near as these flights tell."""
    for digits in range(1, _DIGITS):
        if abs((short := float(f"{value:.{digits}g}")) - value) <= _NEAR * max(abs(value), _NEAR):
            return short
    return value


def orbit_values(
    usable: Sequence[Grade], wrong: set[str], answers: Mapping[str, Decimal], store: Store
) -> tuple[list[Alternative], list[Alternative]]:
    """Alternatives with another value of one parameter, speed or start; and with another factor on one term.

    They give the answers to the first samples of some orbits.
    """
    by_time: dict[str, dict[float, list[Quantity]]] = {}
    for quantity in (store[grade.id] for grade in usable if "@" in grade.id):
        place = placed(quantity.name)[1]
        times = by_time.setdefault(quantity.id.rsplit("/", 1)[0], {})
        times.setdefault(float(place["t"]), []).append(quantity)
    firsts = []
    for times in by_time.values():
        bad = [time for time, here in times.items() if not wrong.isdisjoint(quantity.id for quantity in here)]
        firsts.append((min(bad, default=math.inf), times[min(bad, default=min(times))]))
    firsts.sort(key=lambda first: first[0])
    samples = [sample for _, sample in firsts[:_ORBITS]]
    if not samples or firsts[0][0] > _LATEST:
        return [], []
    found: tuple[list[Alternative], list[Alternative]] = [], []
    one = next(quantity for quantity in samples[0] if quantity.id in wrong)
    candidates = list(narrowed(*_residual(samples[0], answers), changes(one.set, starts=True)))
    for sample in samples[1:]:
        residual, error = _residual(sample, answers)
        left = abs(residual(candidates)).max(axis=0) if candidates else numpy.zeros(0)
        size = max(abs(error).max(), _NEAR)
        candidates = [found for found, rest in zip(candidates, left, strict=True) if rest <= _FOLLOWS * size]
    for change, value in candidates:
        near = _POLISHED * max(abs(value), sorted(map(abs, change.grid))[len(change.grid) // 2])
        for root in solved(change.make, one, answers, store, [value - near, value, value + near]):
            found[change.kind == "term"].append(change.make(plain(root)))
    return found


def _residual(sample: Sequence[Quantity], answers: Mapping[str, Decimal]) -> tuple[Callable[[Lanes], Array], Array]:
    """How far lanes are from the answers to one sample, some of beta, gamma and v; and the answers' errors."""
    first = sample[0]
    rows = [_STATE.index(quantity.name.split("@")[0]) for quantity in sample]
    start, omega = [float(first.inputs[name]) for name in _STATE], float(first.inputs["Omega"])
    error = numpy.array([float(answers[quantity.id]) - quantity.for_doubles for quantity in sample])
    time = float(first.name.split("@")[1])

    def residual(lanes: Lanes) -> Array:
        f, starts = lane_field(lanes, first.set, first.friction, omega, start)
        ends = flown(f, starts, time, round(time / _STEP))[rows]
        left: Array = ends[:, :-1] - ends[:, -1:] - error[:, None]
        return left

    return residual, error
