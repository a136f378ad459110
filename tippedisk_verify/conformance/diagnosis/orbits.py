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
from tippedisk_verify.conformance.diagnosis.flights import Array, Orbits, states_at
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["events_of"]

_ALIKE = 1e-6  # of states and times
_LEVEL = 1e-4  # of an event's function, as a program locates events in time
_LEAST = 4  # answers that have the same
_NEAR = 1e-4  # s, between an answered crossing and a right one
_FEW = 2  # conditions that tell the same crossings
_GRIDS = tuple(f * 10.0**-k for k in (4, 3, 2) for f in (1.0, 2.0, 2.5, 4.0, 5.0))  # s
_CRUDE = 0.005  # s; a smaller error is that of a crude location, which is looked for elsewhere


def events_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """Crossings and flat times of right orbits that are another event's, or numbered otherwise."""
    if any("@" in id_ for id_ in wrong):
        return None
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    here = [store[id_] for id_ in answers if store[id_].name.startswith("crossing_time#")]
    bad = [quantity for quantity in here if quantity.id in wrong]
    if (text := _located(here, wrong, answers, store)) is not None:
        return (("event", text),), frozenset(wrong)
    if not bad:
        return _flat([store[id_] for id_ in wrong if store[id_].name == "flat_time"], wrong, answers, store)
    text = _section(bad, answers, store) or _left_out(here, answers, store) or _chosen(here, answers, store)
    return ((("event", text),), frozenset(wrong)) if text else None


def _functions(states: Array, parts: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    beta, gamma, v = states
    yield "gamma = {}", gamma
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


def _chosen(here: Sequence[Quantity], answers: Mapping[str, Decimal], store: Store) -> str | None:
    """What tells the crossings that are counted from those that are not, or that each is counted twice."""
    found: dict[str, tuple[list[float], list[float]]] = {}  # by what is held against a threshold: left out, counted
    twice = True
    for entry in dict.fromkeys(quantity.id.rsplit("/", 1)[0] for quantity in here):
        given = {int(q.name.split("#")[1]): float(answers[q.id]) for q in here if q.id.startswith(entry + "/")}
        right = sorted(store.matching(f"{entry}/crossing_time#"), key=lambda q: q.for_doubles)
        times = [q.for_doubles for q in right]
        place = {n: min(range(len(times)), key=lambda k: abs(times[k] - time)) for n, time in given.items()}
        if any(abs(times[place[n]] - time) > _NEAR for n, time in given.items()):
            return None
        twice = twice and all(k == (n - 1) // 2 for n, k in place.items())
        kept, before = set(place.values()), -math.inf
        if sorted(given) != list(range(1, len(given) + 1)):
            return None
        for k in range(max(kept, default=-1) + 1):
            gamma, v = (
                store[f"{entry}/{name}#{right[k].name.split('#')[1]}"].for_doubles
                for name in ("crossing_gamma", "crossing_v")
            )
            told = {
                "abs(v)": abs(v), "v": v, "sin gamma": math.sin(gamma), "cos gamma": math.cos(gamma), "gamma": gamma,
                "the time since the last one that was counted, in s,": times[k] - before,
                "the time since the one before, in s,": times[k] - (times[k - 1] if k else -math.inf),
            }  # fmt: skip
            for name, value in told.items():
                found.setdefault(name, ([], []))[k in kept].append(value)
            before = times[k] if k in kept else before
    if twice:
        return "each crossing is counted twice"
    texts = []
    for name, (out, counted) in found.items():
        if min(len(out), len(counted)) < _LEAST:
            continue
        if max(out) < min(counted):
            texts.append(f"{name} is less than a number between {max(out):.4g} and {min(counted):.4g}")
        elif min(out) > max(counted):
            texts.append(f"{name} is more than a number between {max(counted):.4g} and {min(out):.4g}")
    return f"crossings are left out where {', or '.join(texts)}" if 0 < len(texts) <= _FEW else None


def _located(here: Sequence[Quantity], wrong: set[str], answers: Mapping[str, Decimal], store: Store) -> str | None:
    """On which grid crossings are located: at its points, or on straight lines between them."""
    entries = list(dict.fromkeys(quantity.id.rsplit("/", 1)[0] for quantity in here))
    if len(here) < _LEAST or any("crossing_" not in id_ for id_ in wrong):
        return None
    names = ("crossing_time", "crossing_gamma", "crossing_v")
    rows = [[q.id.replace("crossing_time", name) for q in here] for name in names]
    if any(id_ not in answers for row in rows for id_ in row):
        return None
    orbits, orbit = (
        Orbits([store[f"{entry}/beta@0.5"] for entry in entries], store),
        numpy.array([entries.index(q.id.rsplit("/", 1)[0]) for q in here]),
    )
    given = [numpy.array([float(answers[id_]) for id_ in row]) for row in rows]
    right = [numpy.array([store[id_].for_doubles for id_ in row]) for row in rows]
    bad = [name for name, row in zip(names, rows, strict=True) if not wrong.isdisjoint(row)]
    if not bad or abs(given[0] - right[0]).max() > max(_GRIDS):
        return None
    for h in _GRIDS:
        first = h * numpy.floor(right[0] / h)
        y, z = orbits.at(orbit, first), orbits.at(orbit, first + h)
        share = (math.pi / 2 - y[0]) / (z[0] - y[0])
        late = right[0] - first > h / 2
        ways = {
            "at the point before": numpy.zeros_like(first), "at the point after": numpy.ones_like(first),
            "at the nearest point in time": late * 1.0, "at the nearest point in beta": (share > 0.5) * 1.0,
            "on the straight line": share,
        }  # fmt: skip
        made: dict[str, Array] = {}
        for word, by in ways.items():
            made[word] = numpy.stack([first + h * by, *(y + by * (z - y))[1:]])
        made["a difference of beta over the step"] = numpy.stack([first, y[1], (z[0] - y[0]) / h])
        said: dict[str, list[str]] = {}
        for row, name in enumerate(names):
            if name in bad:
                fits = (word for word, x in made.items() if abs(x[row] - given[row]).max() < _ALIKE)
                said.setdefault(next(fits, ""), []).append(name)
        if "" not in said:
            how = "; ".join(f"{' and '.join(some)} {word}" for word, some in said.items())
            if "crossing_time" not in bad:
                what = f"{' and '.join(bad)}: of another instant than the crossing, whose time is right"
            else:
                what = "crossings are located crudely, by straight lines or at steps"
            return f"{what}: on a grid of {h:g} s, {how}"
    return None


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
