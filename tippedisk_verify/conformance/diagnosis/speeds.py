"""Right cycles at other speeds than those that are asked for: which ones, and what the speeds were made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.cycles import numbers_of, pieces_of
from tippedisk_verify.conformance.diagnosis.flights import Array
from tippedisk_verify.conformance.diagnosis.shapes import borne_out
from tippedisk_verify.conformance.diagnosis.shooting import Family, HalfOrbits, closed_cycles
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["answered_by", "entries_of", "other_speeds"]

_FREE = 3  # cycles that must bear out a speed that was read off one of them
_NEAR = 0.05  # relative: how far v_0 and the period may be from those of the right cycle with the same gamma_bar_0
_SAME = 1e-7  # rad/s; what programs that close their cycles leave of a speed
_CLOSED = 1e-8
_DECIMALS = 7
_SOME = 3  # cycles that are named
_PRINTED = {True: 30.07, False: 30.92}  # Omega_h and Omega_crit
_PLACES = {
    "Omega_h": "{set}/{law}/heteroclinic/point/omega_h", "Omega_crit": "{set}/linear/hopf/point/omega_crit",
    "Omega_h of the linear law": "{set}/linear/heteroclinic/point/omega_h",
    "Omega_h of the smooth law": "{set}/smooth/heteroclinic/point/omega_h",
    "Omega_h of the calibrated set": "calibrated/{law}/heteroclinic/point/omega_h",
    "Omega_crit of the calibrated set": "calibrated/linear/hopf/point/omega_crit",
}  # fmt: skip


def entries_of(usable: Sequence[Grade], store: Store) -> dict[str, dict[str, Quantity]]:
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


def other_speeds(usable: Sequence[Grade], wrong: set[str], store: Store) -> str | None:
    """At which speeds the cycles are the ones answered, in all quantities, where each is one at some speed."""
    entries = {
        entry: here
        for entry, here in entries_of(usable, store).items()
        if {"gamma_bar_0", "v_0", "period"} <= here.keys() and not wrong.isdisjoint(q.id for q in here.values())
    }
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    if not wrong <= {quantity.id for here in entries.values() for quantity in here.values()}:
        return None
    first = next(iter(entries.values()))["period"]
    period, gamma, v = (
        numpy.array([float(given[here[name].id]) for here in entries.values()])
        for name in ("period", "gamma_bar_0", "v_0")
    )
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
        for name, quantity in here.items():
            if borne_out(given[quantity.id], numbers.get(name, math.nan), quantity, quantity.id in wrong) is None:
                return None
    return _said(list(entries), first, run.omega, store)


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
        away = numpy.array([float(speed - Decimal(base.values["decimals"][0])) for speed in asked])
        what = "from Omega_h" if near else "from Omega_crit"
        known = {_PRINTED[near]: " (as the paper prints it)"}
        known |= {round(base.for_doubles, n): f" (rounded to {n} decimals)" for n in range(_DECIMALS)}
        known |= {value.for_doubles: f" (which is {name})" for name, value in places.items() if value is not None}
        for sign, text in ((1, "plus"), (-1, "minus")):
            from_there = speeds - sign * away
            origin = float(numpy.median(from_there))
            name = next((name for value, name in known.items() if abs(value - origin) < _SAME), "")
            if numpy.ptp(from_there) < _SAME and (name or several):
                return f"{said} at {origin:.10g} rad/s{name} {text} the distance {what}"
        factors = (speeds - base.for_doubles) / away
        if several and numpy.ptp(factors) < _SAME * abs(factors).max():
            return f"{said} at {numpy.median(factors):.6g} times the distance {what}"
    some = [
        f"{speed:.8g} instead of {float(right):.8g} rad/s at {entry.rsplit('/', 1)[1]}"
        for entry, speed, right in list(zip(entries, speeds, asked, strict=True))[:_SOME]
    ]
    return f"{said} at other speeds, {', '.join(some)}{' and so on' * (len(entries) > _SOME)}"
