"""Numbers of cycles that are read along the right ones, at another instant or of something else; and closed laws.

The right cycles are flown once. Each quantity's wrong answers are held against what is found on them: the state at
named instants, times between these, means, integrals of parts of the divergence, laws that hold next to the Hopf point.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import ALTERNATIVES, CORRECT, Alternative, spelled
from tippedisk_verify.conformance.diagnosis.flights import RK4, Array, field
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.grading import Grade, as_decimal, needed
from tippedisk_verify.reference_values.store import Quantity, Store
from tippedisk_verify.theory.harmonic_balance import amplitude_squared, delta

__all__ = ["along_of"]

_FREE = 3  # wrong answers that must bear out what is said
_LEAST_DIGITS = 3.0  # that a question must need for this
_START = ("gamma_bar_0", "v_0")
_PASSES = 8
_NEAR, _TINY = 0.05, 1e-9  # s from the section
_STEPS = 2000  # of half a period; RK4 leaves some 1e-12
_STEP = 1e-40  # imaginary
_QUARTER = math.pi / 2
_NAMES = ("gamma_bar_0", "v_0", "beta_max", "period", "log_multiplier_slow", "log_multiplier_fast", "dperiod_domega")
_TIMES = {"": 1.0, "twice ": 2.0, "half of ": 0.5, "four times ": 4.0, "minus ": -1.0}
_PARTS = {"beta_max": 0, "gamma_bar_0": 1, "v_0": 2}  #: of the state
_SAID = ("the deflection", "gamma_bar", "v")
_SAMPLES = (5, 10, 20, 25, 40, 50, 100, 125, 200, 250, 500, 1000)  # to half a period
_GRIDS = {f"{m}e-{k} s": m * 10.0**-k for k in (2, 3, 4) for m in (1, 2, 2.5, 4, 5)}
_TERMS = {"h 2": "h's term 2", "h 3": "h's term 3", "h 5": "h's term 5", "v_rate friction": "the friction"}
_ON_GRID = 1e-9  # s

_RIGHT = Alternative("", "")
Candidates = Iterator[tuple[str, Array]]


class _Cycles:
    """The right cycles that are asked for: states at equal times over half a period, from the section on."""

    def __init__(self, entries: Sequence[str], store: Store) -> None:
        self.first, self.entries, self.store = store[f"{entries[0]}/period"], entries, store
        set_name, self.law = self.first.set, self.first.friction
        self.model = Model(Alternative("", ""), set_name, self.law)
        self.omega = numpy.array([float(store[f"{entry}/period"].inputs["Omega"]) for entry in entries])
        self.half = self.right("period") / 2
        self.f = field(set_name, self.law, self.omega)
        y = numpy.stack([_QUARTER + 0 * self.half, _QUARTER + self.right("gamma_bar_0"), self.right("v_0")])
        states = [y]
        for _ in range(_STEPS):
            states.append(RK4(self.f, states[-1], self.half / _STEPS))
        self.states = numpy.stack(states)  #: by time, part and cycle

    def right(self, name: str) -> Array:
        return numpy.array([self.store[f"{entry}/{name}"].for_doubles for entry in self.entries])

    def at(self, times: Array) -> Array:
        """(the deflection, gamma_bar, v), by RK4 from the time before; the symmetry gives the other halves."""
        turns = numpy.floor(times / self.half)
        rest = times - turns * self.half
        step = numpy.clip((rest / self.half * _STEPS).astype(int), 0, _STEPS)
        lanes = numpy.arange(len(self.half))
        y = RK4(self.f, self.states[step, :, lanes].T, rest - step * self.half / _STEPS)
        side = (-1.0) ** turns
        return numpy.stack([side * (_QUARTER - y[0]), side * (y[1] - _QUARTER), side * y[2]])

    def root(self, part: Callable[[Array], Array]) -> Array:
        """The first time in half a period at which a function of the state changes its sign; NaN if none."""
        values = numpy.array([part(y) for y in self.states[1:-1]])
        change = numpy.diff(numpy.sign(values), axis=0) != 0
        lanes = numpy.arange(len(self.half))
        at = numpy.argmax(change, axis=0)
        low, h = at + 1.0, self.half / _STEPS
        x0, x1 = low * h, (low + 1) * h
        f0, f1 = values[at, lanes], values[numpy.minimum(at + 1, len(values) - 1), lanes]
        for _ in range(8):  # secants
            with numpy.errstate(all="ignore"):
                x2 = numpy.where(f1 == f0, x1, x1 - f1 * (x1 - x0) / (f1 - f0))
            y = self.at(x2)
            x0, f0, x1, f1 = x1, f1, x2, part(numpy.stack([_QUARTER - y[0], _QUARTER + y[1], y[2]]))
        return numpy.where(change.any(axis=0), x1, numpy.nan)

    def rates(self, y: Array) -> dict[str, Array]:
        return spelled(CORRECT, numpy, self.model.p, self.omega, y, self.law)

    def slopes(
        self, law: str, held: str = "", other: Alternative = _RIGHT, place: tuple[int, float] | None = None
    ) -> Array:
        """dv'/dv at all times, by cycle: with one term held, by a mistaken model, or with a part of the state fixed."""
        y = numpy.moveaxis(self.states.astype(complex), 1, 0).copy()
        if place is not None:
            y[place[0]] = place[1]
        p = self.model.p if other is _RIGHT else Model(other, self.first.set, self.law).p
        spelling = replace(other.spelling, held=held)
        side = numpy.where(spelled(spelling, numpy, p, self.omega, y.real, law)["gamma_y"] >= 0, 1.0, -1.0)
        y[2] += 1j * _STEP
        return numpy.asarray(spelled(spelling, numpy, p, self.omega, y, law, side)["v_rate"].imag / _STEP)


def along_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What explains the wrong quantities of cycles, each by itself."""
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    groups: dict[str, list[Quantity]] = {}
    for grade in usable:
        if needed(store[grade.id]) >= _LEAST_DIGITS:
            groups.setdefault(store[grade.id].name, []).append(store[grade.id])
    names = [name for name, here in groups.items() if any(quantity.id in wrong for quantity in here)]
    if not names or not set(names) <= set(_NAMES):
        return None
    said: dict[str, list[str]] = {}
    tried: set[str] = set()
    if set(names) == set(_START) and (text := _off_section([groups[name] for name in _START], given, wrong, store)):
        return (("along", text),), frozenset(wrong & {quantity.id for name in names for quantity in groups[name]})
    for name in names:
        here = groups[name]
        bad = {quantity.id for quantity in here} & wrong
        cycles = _Cycles([quantity.id.rsplit("/", 1)[0] for quantity in here], store)
        for text, expected in _candidates(name, cycles, here, given, wrong) if len(bad) >= _FREE else ():
            if _fits(here, expected, given, wrong):
                said.setdefault(text, []).append(name)
                tried |= bad
                break
        else:
            return None
    return (("along", "; ".join(f"{', '.join(names)}: {text}" for text, names in said.items())),), frozenset(tried)


def _fits(here: Sequence[Quantity], expected: Array, given: Mapping[str, Decimal], wrong: set[str]) -> bool:
    return all(
        borne_out(given[quantity.id], float(x), quantity, quantity.id in wrong) is not None
        for quantity, x in zip(here, expected, strict=True)
    )


def _off_section(
    here: Sequence[Sequence[Quantity]], given: Mapping[str, Decimal], wrong: set[str], store: Store
) -> str | None:
    """States of the right cycles at instants near the section, another one for each: v tells it, gamma bears it out."""
    entries = [quantity.id.rsplit("/", 1)[0] for quantity in here[0]]
    if entries != [quantity.id.rsplit("/", 1)[0] for quantity in here[1]]:
        return None
    if min(sum(quantity.id in wrong for quantity in some) for some in here) < _FREE:
        return None
    cycles = _Cycles(entries, store)
    v = numpy.array([float(given[quantity.id]) for quantity in here[1]])
    times = 0 * v
    for _ in range(_PASSES):
        y = cycles.at(times)
        rates = cycles.rates(numpy.stack([_QUARTER - y[0], _QUARTER + y[1], y[2]]))
        times = numpy.clip(times - (y[2] - v) / rates["v_rate"], -_NEAR, _NEAR)
    _, gamma, moved = cycles.at(times)
    if not (abs(times) < _NEAR).all() or not _fits(here[0], gamma, given, wrong):
        return None
    if not _fits(here[1], moved, given, wrong):
        return None
    side = "after" if (times > -_TINY).all() else "before" if (times < _TINY).all() else "from"
    most = f"{1e3 * abs(times).max():.2g} ms {side} the section"
    return f"gamma_bar_0, v_0: states of the right cycles up to {most}, not on it"


def _candidates(
    name: str, cycles: _Cycles, here: Sequence[Quantity], given: Mapping[str, Decimal], wrong: set[str]
) -> Candidates:
    answers = numpy.array([float(given[quantity.id]) for quantity in here])
    bad = numpy.array([quantity.id in wrong for quantity in here])
    found = _laws(name, cycles)
    if name == "v_0":
        found = itertools.chain(found, _differences(cycles))
    if name in _PARTS:
        found = itertools.chain(found, _states(cycles), _timed(name, cycles, answers, bad))
    if name == "period":
        found = itertools.chain(found, _intervals(cycles, answers))
    if name == "log_multiplier_fast":
        found = _integrals(cycles, answers, bad)
    yield from found


# ------------------------------------------------------------------------------------------ instants
def _instants(cycles: _Cycles) -> dict[str, Array]:
    found = {
        "at the turning point, v = 0,": cycles.root(lambda y: y[2]),
        "where gamma = pi/2": cycles.root(lambda y: y[1] - _QUARTER),
        "where v is largest, v' = 0,": cycles.root(lambda y: cycles.rates(y)["v_rate"]),
        "where gamma_y changes its sign": cycles.root(lambda y: cycles.rates(y)["gamma_y"]),
    }
    shares = {"a quarter": 4, "an eighth": 8, "a sixth": 6, "a third": 3}
    return found | {f"{text} of a period after the section": 2 * cycles.half / n for text, n in shares.items()}


def _states(cycles: _Cycles) -> Candidates:
    for text, times in _instants(cycles).items():
        if numpy.isfinite(times).all():
            for what, values in zip(_SAID, cycles.at(times), strict=True):
                for times_, number in _TIMES.items():
                    yield f"{times_}{what} {text} is taken", number * values
    for what, part, offset in (("deflection", 0, _QUARTER), ("gamma_bar", 1, _QUARTER), ("v", 2, 0.0)):
        y = abs(cycles.states[:-1, part] - offset)
        waves = numpy.exp(1j * math.pi * numpy.arange(_STEPS) / _STEPS)[:, None] * (cycles.states[:-1, part] - offset)
        for text, values in (
            ("the mean modulus", y.mean(axis=0)), ("the largest modulus", y.max(axis=0)),
            ("the root of the mean square", (y * y).mean(axis=0) ** 0.5),
            ("sqrt 2 times the root of the mean square", (2 * y * y).mean(axis=0) ** 0.5),
            ("the amplitude of the first harmonic", 2 * abs(waves.mean(axis=0))),
        ):  # fmt: skip
            yield from ((f"{times}{text} of {what} is taken", n * values) for times, n in _TIMES.items())


def _differences(cycles: _Cycles) -> Candidates:
    """v_0 by differences of beta."""
    for text, h in _GRIDS.items():
        ahead, back = (-cycles.at(numpy.full_like(cycles.half, x))[0] for x in (h, -h))
        yield f"the difference of beta over one step of {text} ahead is taken", ahead / h
        yield f"the difference of beta over one step of {text} back is taken", -back / h
        yield f"the central difference of beta over {text} on both sides is taken", (ahead - back) / (2 * h)


def _timed(name: str, cycles: _Cycles, answers: Array, bad: Array) -> Candidates:
    """At one time after the section or before it, or one share of the period: read off one answer."""
    part = _PARTS[name]
    lane = int(numpy.argmax(bad * abs(answers - cycles.right(name))))
    moved = (_QUARTER - cycles.states[:, 0], cycles.states[:, 1] - _QUARTER, cycles.states[:, 2])[part][:, lane]
    for at in numpy.flatnonzero(numpy.diff(numpy.sign(moved - answers[lane]))).tolist():
        low, high = (numpy.full(len(answers), n * cycles.half[lane] / _STEPS) for n in (at, at + 1))
        rising = moved[at] < answers[lane]
        for _ in range(60):
            middle = (low + high) / 2
            value = _one(cycles, middle, lane)[part]
            low, high = (middle, high) if (value < answers[lane]) == rising else (low, middle)
        time, half = float(low[0]), float(cycles.half[lane])
        for text, times in (
            (f"{1e3 * time:.6g} ms after the section", low),
            (f"{1e3 * (half - time):.6g} ms before the next section", cycles.half - (half - time)),
            (f"{time / half / 2:.6g} of a period after the section", low / half * cycles.half),
        ):
            if (times > 0).all():
                yield f"{_SAID[part]} {text} is taken", cycles.at(times)[part]


def _one(cycles: _Cycles, times: Array, lane: int) -> list[float]:
    return [float(x[lane]) for x in cycles.at(times)]


def _intervals(cycles: _Cycles, answers: Array) -> Candidates:
    """Times between instants, times of crossing at a grid's steps, or on a straight line between them."""
    instants = {"the section": 0 * cycles.half, "the next section": cycles.half} | {
        text.removeprefix("where ").removeprefix("at ").rstrip(","): times
        for text, times in _instants(cycles).items()
        if "period" not in text
    }
    for (one, begin), (other, end) in itertools.combinations(instants.items(), 2):
        for text, number in ("twice ", 2.0), ("four times ", 4.0), ("", 1.0):
            yield f"{text}the time between {one} and {other} is taken", number * abs(end - begin)
    for text, h in _GRIDS.items():
        before = numpy.floor(cycles.half / h) * h
        yield f"the crossing is not located: the last step of {text} before it is taken", 2 * before
        yield f"the crossing is not located: the first step of {text} after it is taken", 2 * before + 2 * h
        low, high = (_QUARTER - cycles.at(t)[0] for t in (before, before + h))
        line = before + h * (_QUARTER - low) / (high - low)
        yield f"the crossing is located on a straight line over a step of {text}", 2 * line
    for text, h in _GRIDS.items():
        if h >= _GRIDS["1e-3 s"] and (abs(answers - numpy.round(answers / h) * h) < _ON_GRID).all():
            yield f"counted in whole steps of {text}, the crossing is not located", answers


# ------------------------------------------------------------------------------------------ laws
def _laws(name: str, cycles: _Cycles) -> Candidates:
    """What harmonic balance and the Hopf point give; the consistent law first."""
    point = {
        quantity.name: quantity.for_doubles for quantity in cycles.store.matching(f"{cycles.first.set}/linear/hopf/")
    }
    c = cycles.model.constants()
    for form in ("consistent", "printed"):
        square = numpy.array([amplitude_squared(c, omega**2, form) for omega in cycles.omega])
        with numpy.errstate(all="ignore"):
            frequency = numpy.sqrt(cycles.omega**2 * c.e / (c.r + c.e) + delta(c, cycles.omega, form) * square)
            yield from _harmonic(name, cycles, f"the {form} one-harmonic law's", numpy.sqrt(square), frequency)
    if not point:
        return
    away, critical = point["omega_crit"] - cycles.omega, 2 * math.pi / point["period"]
    with numpy.errstate(all="ignore"):
        size = numpy.sqrt(point["amplitude_squared_slope"] * away)
    period = point["period"] - point["period_slope"] * away
    yield from _harmonic(name, cycles, "the law next to Omega_crit, its", size, 2 * math.pi / period)
    yield from _harmonic(name, cycles, "the Hopf point's", size, critical + 0 * size)
    if name == "dperiod_domega":
        yield "the slope at Omega_crit is taken", point["period_slope"] + 0 * away
    if name == "log_multiplier_slow":
        for text, time in (("T", 2 * cycles.half), ("T_crit", point["period"] + 0 * away)):
            yield (
                f"the law next to Omega_crit, -2 Re(lambda) {text}, is taken",
                2 * point["transversality"] * away * time,
            )


def _harmonic(name: str, cycles: _Cycles, text: str, size: Array, frequency: Array) -> Candidates:
    if name == "period":
        yield f"{text} period 2 pi/omega is taken", 2 * math.pi / frequency
    elif name == "beta_max":
        yield from ((f"{times}{text} amplitude is taken", n * size) for times, n in _TIMES.items())
    elif name == "gamma_bar_0":
        yield f"{text} amplitude of gamma_bar, C Omega/omega, is taken", size * cycles.omega / frequency
    elif name == "v_0":
        yield f"{text} amplitude of v, C omega, is taken", -size * frequency


# ------------------------------------------------------------------------------------------ the divergence
def _integrals(cycles: _Cycles, answers: Array, bad: Array) -> Candidates:
    """Integrals of something else than dv'/dv, or by sums; the slow logarithm is taken off, or not."""
    slow, h = cycles.right("log_multiplier_slow"), 2 * cycles.half / _STEPS  # both halves
    weights = numpy.ones((_STEPS + 1, 1))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0

    def whole(values: Array) -> Array:
        return numpy.asarray((weights * values).sum(axis=0) * h / 3)

    def said(text: str, total: Array) -> Candidates:
        yield text, total - slow
        yield f"{text}, and multiplier_slow itself is taken off, not its logarithm", total - numpy.exp(slow)
        yield f"{text} (over half a period)", total / 2 - slow
        yield f"{text}, and log_multiplier_slow is not taken off", total
        yield f"{text}, and log_multiplier_slow is added, not taken off", total + slow

    slopes = cycles.slopes(cycles.law)
    right = whole(slopes)
    terms = {text: slopes - cycles.slopes(cycles.law, held) for held, text in _TERMS.items()}
    other = "linear" if cycles.law == "smooth" else "smooth"
    friction = terms["the friction"]
    others = cycles.slopes(other) - cycles.slopes(other, "v_rate friction")
    parts = [cycles.rates(y) for y in cycles.states]
    mass, drift = (numpy.array([one[name] for one in parts]) for name in ("M", "gamma_rate"))
    what = "the divergence's integral"
    yield "the divergence's integral less multiplier_slow, not its logarithm, is taken", right - numpy.exp(slow)
    yield from said(f"{what} is that of the friction alone: h's dv'/dv is missing", whole(friction))
    yield from said(f"{what} is that of the {other} law's friction alone: h's dv'/dv is missing", whole(others))
    yield from said(f"{what} is that of the {other} friction law", right + whole(others - friction))
    yield from said(f"{what} has no factor 1/M", whole(slopes * mass))
    for text, one in (("Bbar", cycles.model.p.Bbar), ("A", cycles.model.p.A), ("M at the section", mass[0])):
        yield from said(f"{what} has {text} in place of M", whole(slopes * mass / one))
    sine = cycles.omega * numpy.sin(cycles.states[:, 0])
    for text, extra in (("dgamma'/dbeta", sine), ("gamma'", drift)):
        yield from said(f"{what} has {text} added, which is no diagonal entry", right + whole(extra))
    yield from said(f"{what} is that of the modulus of dv'/dv", whole(abs(slopes)))
    yield from said(f"{what} has the wrong sign", -right)
    for n, (at, value) in enumerate((("beta = pi/2", _QUARTER), ("gamma = pi/2", _QUARTER), ("v = 0", 0.0))):
        yield from said(f"{what} is taken at {at} throughout", whole(cycles.slopes(cycles.law, place=(n, value))))
    for count in _SAMPLES:
        some = slopes[:: _STEPS // count]
        once, ends = some.sum(axis=0) - (some[0] + some[-1]) / 2, (some[0] + some[-1]) / 2
        step = 2 * cycles.half / (2 * count)
        yield from said(f"{what} is a sum over {2 * count} steps to a period", 2 * once * step)
        for several, total in (("a period", 2 * once + ends), ("half a period", 2 * (once + ends))):
            number = f"{2 * count} steps to a period, both ends of {several}"
            yield from said(f"{what} is a sum over {number}: one sample too many", total * step)
            samples = (2 if several == "a period" else 1) * count + 1
            text = f"{what} is the mean of {samples} samples, both ends of {several}, times the period"
            share = 1 if several == "a period" else 2
            yield from said(text, total / share / samples * 2 * cycles.half)
    lane = int(numpy.argmax(bad))
    for text, term in terms.items():
        part = whole(term)
        factor = float(1 + (answers[lane] + slow[lane] - right[lane]) / part[lane])
        for value in (round(factor, 2), factor):
            words = {0.0: "lacks", -1.0: "has the wrong sign of", 2.0: "has twice", 0.5: "has half of"}
            yield f"{what} {words.get(value, f'has {value:.6g} times')} {text}", right + (value - 1) * part - slow
    for one in ALTERNATIVES:
        if one.of_the_model and (one.parameters is not None or one.spelling != CORRECT):
            yield from said(f"{what} alone: {one.cause}", whole(cycles.slopes(cycles.law, other=one)))
