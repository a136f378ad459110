"""Answered cycles that are none at the asked speed: not closed, at another speed, or by other equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.cycle_slips import Said, answered, column, flight_of, known, made, solve
from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.halfmap import RINGS, Flight
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, changed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["orbits"]

_CLOSED, _SAME = 1e-6, 2e-8
_EARLY = "Newton's iteration for the cycle stopped too early (too loose a tolerance, few steps)"
_SPEEDS = "the cycles are right ones"
_UNNAMED = f"{_SPEEDS} at other speeds"
_CHANCE = 1e-3
_ORIGINS = (
    "Omega_h of the other law", "Omega_h", "Omega_crit", "30.07", "30.92", "Omega_h of another set",
    "Omega_crit of another set",
)  # fmt: skip


def _bad(table: Table) -> Array:
    return np.unique(table.rows[table.wrong])


def _spread(table: Table, rows: Array, results: Any) -> dict[str, Array]:
    """Results of some entries as those of all; NaN elsewhere."""
    found = {}
    for name, values in results.items():
        if name == "P":
            continue
        found[name] = np.full(len(table.entries), np.nan)
        found[name][rows] = values
    return found


def _all_of(flight: Flight) -> dict[str, Array]:
    """All that is asked of an orbit to the section, as if it closed."""
    here = made(flight) | {"period": flight.period, **dict(zip(flight.ring.start, flight.start, strict=True))}
    if flight.ring.parts == 2:
        return here | {"beta_max": np.pi / 2 - flight.instant(2, 0.0)[1][0]}
    low, high = flight.instant(1, 3 * np.pi / 2)[1], flight.instant(2, 0.0, -1)[1]
    return here | {"beta_bar_0": low[0] - np.pi / 2, "v_0": low[2], "beta_max": high[0] - np.pi / 2}


def orbits(sheet: Sheet) -> Said:
    """Answered states that are no cycle at the asked speed."""
    asked = [(table, _bad(table)) for table in sheet.tables]
    parts = [table.part(rows) if table.kind in RINGS and len(rows) else None for table, rows in asked]
    given: list[Any] = [part and answered(part, part.answer) for part in parts]
    moved = {name for part in parts if part for name in part.asked if (part.wrong & (part.stems == name)).any()}
    finite = all(one is None or np.isfinite([*one[0], one[1]]).all() for one in given)
    if not finite or len(moved) < 3 or not moved & {"period", "gamma_bar_0", "v_0", "beta_bar_top", "v_top"}:
        return

    def spread(results: list[Any]) -> list[Any]:
        return [result and _spread(*one, result) for result, one in zip(results, asked, strict=True)]

    flights = [part and flight_of(part, *one) for part, one in zip(parts, given, strict=True)]
    missed = np.concatenate([f.missed for f in flights if f], axis=1)
    results = spread([f and _all_of(f) for f in flights])
    if np.abs(missed[0]).max() < _CLOSED:
        text = f"{_EARLY}, or a guess was answered"
        yield (
            f"{text}: the answered states are no cycles, they come back off by up to {np.abs(missed[1:]).max():.1g}",
            results,
        )
    elif np.abs(missed[1:]).max() < _CLOSED:
        text = "gamma and v close, but beta = pi/2 is missed by up to"
        yield f"the time of return is not located within the step: {text} {np.abs(missed[0]).max():.1g} rad", results
    unnamed = []
    for source in (_speeds, _stopped, _others):
        for says, some in source(flights, parts):
            if says.startswith(_UNNAMED):
                unnamed.append((says, spread(some)))
            else:
                yield says, spread(some)
    yield from unnamed


def _stopped(flights: list[Any], parts: list[Any]) -> Said:
    """From where Newton's last step was taken: by period and beta_max, which are not of the state after it."""
    results: list[Any] = []
    steps, sizes = [], []
    for flight, part in zip(flights, parts, strict=True):
        deepest = column(part, "beta_max", part.answer) if flight else np.zeros(1)
        if not np.isfinite(deepest).all() or (flight and flight.ring.parts != 2):
            return
        f = flight
        last = 1.0
        for _ in range(5 if f else 0):
            low = f.instant(2, 0.0)[1]
            matrix = np.stack([f.change()[:, 0, :2], -f.change(0, low)[:, 0, :2]], axis=1)
            step = -solve(matrix, np.column_stack([f.missed[0], np.pi / 2 - low[0] - deepest])).T
            if not np.abs(step).max() < last:
                return
            last = float(np.abs(step).max()) + 1e-9
            f = replace(f, start=f.start + step)
            if np.abs(step).max() < 1e-9:
                break
        results.append(f and (f, _all_of(f)))
        if f:
            steps.append(solve(np.eye(2) - made(f)["P"], f.missed[1:].T).T)
            sizes.append(flight.start - f.start)
    step, size = np.concatenate(steps, axis=1), np.concatenate(sizes, axis=1)
    share = round(float((step * size).sum() / (step * step).sum()), 2)
    for one in filter(None, results):
        for name, value in zip(one[0].ring.start, one[0].start + share * steps.pop(0), strict=True):
            one[1][name] = value
    text = "" if share == 1 else f", taken {share:g} times"
    after = f"the answered states are those after its last step{text}, of up to {np.abs(size).max():.1g}"
    says = f"{_EARLY}: {after}, all else is of the states before it, which are no cycles"
    yield says, [one and one[1] for one in results]


def _speeds(flights: list[Any], parts: list[Any]) -> Said:
    """The speeds at which the answered states are cycles, if there are such."""
    found: list[Any] = []
    for flight, part in zip(flights, parts, strict=True):
        if not flight:
            found.append(None)
            continue
        slope = column(part, f"d{flight.ring.start[0]}_domega", part.truth)
        first = column(part, flight.ring.start[0], part.truth)
        f = replace(flight, Omega=flight.Omega + np.clip(np.nan_to_num((flight.start[0] - first) / slope), -0.3, 0.3))
        last = 2.0
        for _ in range(8):
            change, ring = f.change(), f.ring
            by = np.column_stack([change[:, ring.axis, 2], ring.sign * change[:, list(ring.kept), 2]])
            step = -(by * f.missed.T).sum(axis=1) / (by * by).sum(axis=1)
            if not np.abs(step).max() < last:
                return
            last = float(np.abs(step).max()) + 1e-9
            f = replace(f, Omega=f.Omega + step)
            if np.abs(step).max() < 1e-11:
                break
        if not np.abs(f.missed).max() < _CLOSED:
            return
        found.append(f)
    tables = [(part, f.Omega) for part, f in zip(parts, found, strict=True) if f]
    yield f"{_SPEEDS} {_rule(tables)}", [f and _all_of(f) for f in found]


def _rule(tables: list[tuple[Table, Array]]) -> str:
    """What was done to the speeds."""
    asked = np.concatenate([table.given["Omega"] for table, _ in tables])
    speeds = np.concatenate([one for _, one in tables])
    shift, level = speeds - asked, tables[0][0].level
    origin = "Omega_h" if level > 8 else "Omega_crit"
    base = np.concatenate([known(table, origin) for table, _ in tables])
    within = _SAME if level < 9 else 1e-9
    left = np.minimum(within, 0.02 * np.abs(shift))

    def same(other: Any) -> bool:
        return bool((np.abs(other - speeds) <= left).all())

    for digits in range(9):
        size = 10.0**digits
        for text, done in (("rounded", np.round), ("cut off", np.floor), ("rounded up", np.ceil)):
            chance = np.minimum(1, 2 * left * size)
            if chance.prod() < _CHANCE and same(done(asked * size) / size):
                return f"at Omega {text} to {digits} decimals"
            if chance.min() < _CHANCE and same(asked - base + done(base * size) / size):
                return f"at Omega counted from {origin} {text} to {digits} decimals"
    if same(asked.astype(np.float32).astype(float)):
        return "at Omega in single precision"
    for text in _ORIGINS:
        other = np.concatenate([known(table, text) for table, _ in tables])
        if text != origin and same(asked - base + other):
            return f"at Omega counted from {text} in place of {origin}"
    if len(shift) > 2 and np.ptp(speeds) < within:
        return f"at one speed throughout, {np.median(speeds):.9g}"
    if len(shift) > 2 and np.ptp(shift) < within:
        near = next((f", about as if counted from {x} in place of {origin}" for x in (30.92, 30.07)
                     if np.abs(x - base - shift).max() < 0.002), "")  # fmt: skip
        return f"at Omega {np.median(shift):+.6g} (as if counted from another {origin}{near})"
    share = (speeds - base) / (asked - base)
    if len(shift) > 2 and np.ptp(share) < 1e-5 * np.abs(share).max():
        return f"at {np.median(share):.6g} times the distance from {origin}"
    some = ", ".join(f"{new:+.4g} from {old:.8g}" for new, old in list(zip(shift, asked, strict=True))[:3])
    return f"at other speeds, {some}{' and so on' * (len(speeds) > 3)}, or of parameters with which they are such"


def _others(flights: list[Any], parts: list[Any]) -> Said:
    """Other equations by which the answered states are cycles: the other law, changed inputs, one parameter."""
    swapped = [f and replace(f, smooth=not f.smooth) for f in flights]
    if all(np.abs(f.missed).max() < _CLOSED for f in swapped if f):
        law = "smooth" if next(f for f in swapped if f).smooth else "linear"
        yield f"the cycles are those of the {law} friction law", [f and _all_of(f) for f in swapped]
    flight, part = max(((f, p) for f, p in zip(flights, parts, strict=True) if f), key=lambda one: one[0].Omega.size)
    middle = int(np.argmin(np.abs(flight.time - 0.55)))  # neither near the Hopf point nor near the saddles
    tables = [changed(part, one.change) for one in INPUTS]
    columns = [
        tuple(np.array([t.p[k][middle] for t in tables]) for k in range(8)),
        np.array([t.given["Omega"][middle] for t in tables]),
    ]
    tile = np.ones(len(tables))
    probe = replace(flight, p=columns[0], Omega=columns[1], start=flight.start[:, [middle]] * tile,
                    time=flight.time[middle] * tile, variants=0)  # fmt: skip
    near = min(_CLOSED, 1e-2 * float(np.abs(flight.missed[:, middle]).max()))
    for k in np.flatnonzero(np.abs(probe.missed).max(axis=0) < near)[:3]:
        others = [p and changed(p, INPUTS[k].change) for p in parts]
        yield (
            f"the cycles are those with {INPUTS[k].says}",
            [f and _all_of(replace(f, p=t.p, Omega=t.given["Omega"])) for f, t in zip(flights, others, strict=True)],
        )
    factor, tile = np.ones(8), np.ones(16)
    for _ in range(8):
        both = np.concatenate([factor, factor * (1 + 1e-6)])
        p = tuple(one[middle] * np.where(np.arange(16) % 8 == k, both, 1) for k, one in enumerate(flight.p))
        probe = replace(
            probe,
            p=p,
            Omega=flight.Omega[middle] * tile,
            start=flight.start[:, [middle]] * tile,
            time=flight.time[middle] * tile,
        )
        now, by = probe.missed[:, :8], (probe.missed[:, 8:] - probe.missed[:, :8]) / (1e-6 * factor)
        factor = factor - np.clip((by * now).sum(axis=0) / (by * by).sum(axis=0), -0.3, 0.3)
    for k in np.flatnonzero((np.abs(now).max(axis=0) < near) & (np.abs(factor - 1) > 1e-4))[:3]:
        made = [f and replace(f, p=tuple(x * (factor[k] if j == k else 1) for j, x in enumerate(f.p))) for f in flights]
        right = float(flight.p[k][middle])
        says = f"the cycles are those with {SYMBOLS[k]} = {factor[k] * right:.7g} in place of {right:.7g}"
        yield says, [f and _all_of(f) for f in made]
