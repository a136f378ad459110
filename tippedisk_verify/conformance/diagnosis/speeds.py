"""Right half orbits that are not what is asked for: cycles at other speeds, and orbits that do not close."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.cycles import numbers_of, pieces_of
from tippedisk_verify.conformance.diagnosis.flights import Array
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.diagnosis.shooting import (
    Family,
    HalfOrbits,
    closed_cycles,
    half_orbits,
    newton_step,
    solved_each,
)
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["answered_by", "other_speeds", "stopped_of"]

_FREE = 3  # cycles that must bear out a speed that was read off one of them
_NEAR = 0.05  # relative: how far v_0 and the period may be from those of the right cycle with the same gamma_bar_0
_SAME = 1e-7  # rad/s; what programs that close their cycles leave of a speed
_CLOSED = 1e-8
_TRIVIAL = 1e-2  # rad
_DECIMALS = 7
_SOME = 3  # cycles that are named
_START = ("gamma_bar_0", "v_0")
_SECTION = 1e-7  # s; of half a period
_PASSES = 6
_MOVES = 0.3
_GRIDS = {f"{m}e-{k} s": m * 10.0**-k for k in (2, 3) for m in (5, 4, 2.5, 2, 1)}
_FAR = 0.3  # rad, rad/s; further off Newton's method does not stop after a step
_FROM_STATE = (
    "it starts at the answered (gamma_bar_0, v_0), where Newton's iteration stops early or solves something else"
)
_FROM_GUESS = (
    "it starts at a guess{}, and (gamma_bar_0, v_0) are one step of Newton's method further, which stops early"
)
_PRINTED = {True: 30.07, False: 30.92}  # Omega_h and Omega_crit
_PLACES = {
    "Omega_h": "{set}/{law}/heteroclinic/point/omega_h", "Omega_crit": "{set}/linear/hopf/point/omega_crit",
    "Omega_h of the linear law": "{set}/linear/heteroclinic/point/omega_h",
    "Omega_h of the smooth law": "{set}/smooth/heteroclinic/point/omega_h",
    "Omega_h of the calibrated set": "calibrated/{law}/heteroclinic/point/omega_h",
    "Omega_crit of the calibrated set": "calibrated/linear/hopf/point/omega_crit",
}  # fmt: skip

Entries = Mapping[str, Mapping[str, Quantity]]  # by entry and quantity


def _entries(usable: Sequence[Grade], store: Store) -> dict[str, dict[str, Quantity]]:
    found: dict[str, dict[str, Quantity]] = {}
    for grade in usable:
        found.setdefault(grade.id.rsplit("/", 1)[0], {})[store[grade.id].name] = store[grade.id]
    return found


def answered_by(run: HalfOrbits) -> list[dict[str, float]]:
    """What is asked of cycles, of half orbits."""
    return [
        numbers_of(pieces)
        | {"period": float(2 * run.half[n]), "gamma_bar_0": float(run.gamma[n]), "v_0": float(run.v[n])}
        | {"beta_max": float(run.deepest[n])}
        for n, pieces in enumerate(pieces_of(run))
    ]


def _wrong_entries(usable: Sequence[Grade], wrong: set[str], store: Store, names: Sequence[str]) -> Entries:
    """The entries with wrong answers; none unless all have these quantities."""
    found = {
        entry: here
        for entry, here in _entries(usable, store).items()
        if not wrong.isdisjoint(quantity.id for quantity in here.values())
    }
    return found if all(set(names) <= here.keys() for here in found.values()) else {}


def _given(entries: Entries, given: Mapping[str, Decimal], name: str) -> Array:
    return numpy.array([float(given[here[name].id]) for here in entries.values()])


def _borne_out(
    here: Mapping[str, Quantity], numbers: Mapping[str, float], given: Mapping[str, Decimal], wrong: set[str]
) -> bool:
    return all(
        borne_out(given[quantity.id], numbers.get(name, math.nan), quantity, quantity.id in wrong) is not None
        for name, quantity in here.items()
    )


def other_speeds(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """At which speeds the cycles are the ones answered, in all quantities, where each is one at some speed.

    What is no cycle but the equilibrium, as at a speed beyond Omega_crit, is left out.
    """
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    entries = _wrong_entries(usable, wrong, store, ("period", *_START))
    entries = {entry: here for entry, here in entries.items() if abs(given[here["gamma_bar_0"].id]) > _TRIVIAL}
    if not entries:
        return None
    first = next(iter(entries.values()))["period"]
    period, gamma, v = (_given(entries, given, name) for name in ("period", *_START))
    family = Family(first.set, first.friction, store)
    if not family.known:
        return None
    near = family.speeds(gamma)
    half, _, likely = family(near)
    if not (abs(2 * half - period) < _NEAR * period).all() or not (abs(likely - v) < _NEAR * abs(v)).all():
        return None
    run = closed_cycles(first.set, first.friction, half, gamma, likely, near, of_amplitude=True)
    if not abs(run.left()).max() < _CLOSED:
        return None
    for here, numbers in zip(entries.values(), answered_by(run), strict=True):
        if not _borne_out(here, numbers, given, wrong):
            return None
    tried = wrong & {quantity.id for here in entries.values() for quantity in here.values()}
    return (("closing", _said(list(entries), first, run.omega, store)),), frozenset(tried)


def _said(entries: Sequence[str], first: Quantity, speeds: Array, store: Store) -> str:
    """What the speeds were made of, or some of them."""
    asked = [Decimal(store[f"{entry}/period"].inputs["Omega"]) for entry in entries]
    near = first.kind == "near-heteroclinic"
    places = {name: store.get(_PLACES[name].format(set=first.set, law=first.friction)) for name in _PLACES}
    base = places["Omega_h" if near else "Omega_crit"]
    said = "(gamma_bar_0, v_0) and all else are those of the right cycles"
    several = len(entries) >= _FREE
    if several and numpy.ptp(speeds) < _SAME:
        return f"{said} at one speed throughout, {numpy.median(speeds):.10g} rad/s"
    if base is not None:
        away = numpy.array([abs(float(speed - Decimal(base.values["decimals"][0]))) for speed in asked])
        what = "from Omega_h" if near else "from Omega_crit"
        known = {_PRINTED[near]: " (as the paper prints it)"}
        known |= {round(base.for_doubles, n): f" (rounded to {n} decimals)" for n in range(_DECIMALS)}
        known |= {value.for_doubles: f" (which is {name})" for name, value in places.items() if value is not None}
        for sign, text in ((1, "plus"), (-1, "minus")) if near else ((-1, "minus"), (1, "plus")):
            from_there = speeds - sign * away
            origin = float(numpy.median(from_there))
            name = next((name for value, name in known.items() if abs(value - origin) < _SAME), "")
            if numpy.ptp(from_there) < _SAME and (name or several):
                return f"{said} at {origin:.10g} rad/s{name} {text} the distance {what}"
        factors = abs(speeds - base.for_doubles) / away
        if several and numpy.ptp(factors) < _SAME * abs(factors).max():
            return f"{said} at {numpy.median(factors):.6g} times the distance {what}"
    some = [
        f"{speed:.8g} instead of {float(right):.8g} rad/s at {entry.rsplit('/', 1)[1]}"
        for entry, speed, right in list(zip(entries, speeds, asked, strict=True))[:_SOME]
    ]
    return f"{said} at other speeds, {', '.join(some)}{' and so on' * (len(entries) > _SOME)}"


def stopped_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """Cycles of Newton's method that stops early: all but the state is of a half orbit that does not close.

    It starts at the answered state or, where the last step is taken after it, one step before: period and beta_max
    tell where, all other answers have to bear it out.
    """
    entries = _wrong_entries(usable, wrong, store, ("period", "gamma_bar_0", "v_0", "beta_max"))
    rest = {id_ for id_ in wrong if not id_.endswith(_START)}
    if len(rest) < _FREE or not entries:
        return None
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    first = next(iter(entries.values()))["period"]
    omega = numpy.array([float(here["period"].inputs["Omega"]) for here in entries.values()])
    period, gamma, v, deepest = (_given(entries, given, name) for name in ("period", *_START, "beta_max"))
    run = half_orbits(first.set, first.friction, period / 2, gamma, v, omega)
    at_start = bool((abs(run.left()[0]) < _SECTION * abs(run.speed[0])).all())
    if not at_start and (abs(run.left()[1:]) < _SAME).all():
        return _unlocated(run, entries, given, wrong)
    for _ in range(0 if at_start else _PASSES):
        matrix = numpy.stack([run.change[0, 0, :2], run.shallower])
        right = numpy.stack([run.left()[0], run.deepest - deepest])
        step = solved_each(matrix, right)
        if not abs(step).max() < _FAR:
            return None
        if not (abs(numpy.stack(newton_step(run))) < _MOVES * abs(step).max()).all() and run.gamma is gamma:
            return None  # Newton's next step would not be much shorter than the last one
        run = half_orbits(first.set, first.friction, period / 2, run.gamma + step[0], run.v + step[1], omega)
        if abs(step).max() < _CLOSED:
            break
    add = newton_step(run)
    end = [gamma, v] if at_start else [run.gamma + add[0], run.v + add[1]]
    for n, (here, numbers) in enumerate(zip(entries.values(), answered_by(run), strict=True)):
        numbers |= {name: float(part[n]) for name, part in zip(_START, end, strict=True)}
        if not _borne_out(here, numbers, given, wrong):
            return None
    said = "period and all else are those of a half orbit, by the right equations, that does not close: "
    said += f"{_FROM_STATE}: {_left(run)}" if at_start else _FROM_GUESS.format(_decimals([*run.gamma, *run.v]))
    return (("stopped", said),), frozenset(wrong)


def _unlocated(run: HalfOrbits, entries: Entries, given: Mapping[str, Decimal], wrong: set[str]) -> Found | None:
    """Half orbits that close in gamma and v, but not on the section: the time of return is not located."""
    for here, numbers in zip(entries.values(), answered_by(run), strict=True):
        if not _borne_out(here, numbers, given, wrong):
            return None
    missed = run.left()[0]
    off = f"gamma and v close, but beta = pi/2 is missed by up to {abs(missed).max():.1g} rad"
    if len(missed) >= _FREE and numpy.ptp(missed) < _SAME:
        off += f", at beta = {math.pi / 2 - float(numpy.median(missed)):.6g} throughout"
    steps = (f"; it is in whole steps of {text}" for text, h in _GRIDS.items() if _whole(run.half / h))
    text = f"half the period is not the time of the crossing, which is not refined: {off}{next(steps, '')}"
    return (("stopped", text),), frozenset(wrong)


def _left(run: HalfOrbits) -> str:
    """How far the state after half a period is from the start's image, in gamma and in v."""
    said = []
    for name, left in zip(("gamma", "v"), run.left()[1:], strict=True):
        alike = len(left) >= _FREE and numpy.ptp(left) < _SAME
        size = f"{numpy.median(left):.3g} throughout" if alike else f"up to {abs(left).max():.1g}"
        said.append(f"{name} closes" if abs(left).max() < _SAME else f"{name} is left open by {size}")
    return " and ".join(said)


def _whole(numbers: Array) -> bool:
    return bool((abs(numbers - numpy.round(numbers)) < _SAME).all())


def _decimals(numbers: Sequence[float]) -> str:
    for n in range(_DECIMALS - 2):
        if all(abs(round(x, n) - x) < _CLOSED * 10 for x in numbers):
            return f" of {n} decimals"
    return ""
