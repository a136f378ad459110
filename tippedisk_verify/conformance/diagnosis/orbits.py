"""Orbits: what is asked of them and where it stands, and right ones of other inputs or of the other law."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, all_changed
from tippedisk_verify.conformance.diagnosis.specimen import Program, of, specimen
from tippedisk_verify.conformance.diagnosis.trees import Cause
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["CROSSING", "EXACT", "ROUND", "STATE", "Flights", "Rates", "State", "other_inputs"]

State = tuple[float, float, float]
Rates = Callable[[float, float, float], State]
STATE = ("beta", "gamma", "v")
CROSSING = ("crossing_time", "crossing_gamma", "crossing_v")
EXACT = 1e-7  # s, of times that are read exactly
#: [s] of steps
ROUND: list[float] = sorted((f * 10.0**-k for k in range(1, 6) for f in (5, 4, 2.5, 2, 1.25, 1)), reverse=True)
_SCALAR: dict[str, Any] = {"sin": math.sin, "cos": math.cos, "abs": abs}
_LAWS = (
    ("the orbits of the smooth law follow the linear law", {"smooth": "linear"}),
    ("the orbits of the linear law follow the smooth law", {"linear": "smooth"}),
    ("the orbits follow the other friction law", {"smooth": "linear", "linear": "smooth"}),
)
_ILL = 0.25  # of the answers that rounding may change: from next to an unstable equilibrium it decides where orbits go
_LONGEST = 4.0  # s, of the flights that changed inputs are tried on
_CLOSER = 5.0  # times, that an orbit comes to a wrong sample


@cache
def _equations() -> Any:
    return Program(specimen(), **_SCALAR).space["equations"]


@dataclass(eq=False)
class Flights:
    """The entries of a sheet of orbits, numbered, and where their answers stand."""

    sheet: Sheet

    def __post_init__(self) -> None:
        tables = self.sheet.tables
        self.spots = [(table, row) for table in tables for row in range(len(table.entries))]
        first = np.cumsum([0, *(len(table.entries) for table in tables)])
        self.entry = np.concatenate([table.rows + first[n] for n, table in enumerate(tables)])
        self.stem = np.concatenate([table.stems for table in tables])
        places = (placed(name)[1] for table in tables for name in table.names)
        self.place = np.array([float(one.get("t", one.get("n", "nan"))) for one in places])

    def start(self, k: int) -> State:
        table, row = self.spots[k]
        beta, gamma, v = (float(table.given[name][row]) for name in STATE)
        return beta, gamma, v

    def rates(self, k: int) -> Rates:
        table, row = self.spots[k]
        p, Omega = tuple(float(one[row]) for one in table.p), float(table.given["Omega"][row])
        return lambda beta, gamma, v: (v, *_equations()(p, Omega, table.smooth, beta, gamma, v)[6:8])

    def sample(self, k: int, time: float) -> list[int]:
        """Where the answers to (beta, gamma, v) at a time stand; nothing if one is missing."""
        here = (self.entry == k) & (np.abs(self.place - time) < EXACT)
        cells = [np.flatnonzero(here & (self.stem == stem)) for stem in STATE]
        return [int(cell[0]) for cell in cells] if all(map(len, cells)) else []


def _flown(variants: Sequence[Table], rows: Sequence[int], end: float) -> Array:
    """(beta, gamma, v) at a time, by tables of one law and rows."""
    p = tuple(np.array([one.p[n][rows] for one in variants], dtype=float).ravel() for n in range(len(SYMBOLS)))
    Omega, *start = (np.array([one.given[x][rows] for one in variants], float).ravel() for x in ("Omega", *STATE))
    state, steps = np.array(start), max(1, math.ceil(end / of("FLIGHT_STEP")))
    with np.errstate(all="ignore"):
        for _ in range(steps):
            state = of("flight_step")(of("flow"), p, Omega, variants[0].smooth, state, end / steps)
    return np.asarray(state.reshape(3, len(variants), len(rows)))


def _first_samples(flights: Flights, variants: Sequence[Sheet]) -> Array:
    """Which variants of the sheet give the first wrong samples of each table; none where there are no such samples."""
    sheet, good = flights.sheet, np.ones(len(variants), dtype=bool)
    for n, table in enumerate(sheet.tables):
        mine = sheet.wrong & np.isin(flights.stem, STATE)
        mine &= np.array([flights.spots[k][0] is table for k in flights.entry])
        end = float(flights.place[mine].min(initial=math.inf))
        entries = [k for k in np.unique(flights.entry[mine & (flights.place == end)]) if flights.sample(k, end)][:2]
        rows = [flights.spots[k][1] for k in entries]
        for smooth in (False, True) if entries and end < _LONGEST else ():
            chosen = [k for k, one in enumerate(variants) if one.tables[n].smooth == smooth]
            if chosen:
                cells = np.array([flights.sample(k, end) for k in entries]).T[:, None]
                states = _flown([variants[k].tables[n] for k in chosen], rows, end)
                off, grown = np.abs(states - sheet.answer[cells]), np.maximum(1, np.abs(states / sheet.truth[cells]))
                near = (off * _CLOSER <= np.abs(sheet.answer - sheet.truth)[cells]) | ~sheet.wrong[cells]
                good[chosen] &= ((off <= 3 * sheet.allowed[cells] * grown) & near).all(axis=(0, 2))
    return good & (not good.all())


def other_inputs(flights: Flights) -> list[Cause]:
    """Right orbits of other inputs, or of another law, than those that were asked for."""
    sheet = flights.sheet
    variants = [
        (Cause(says, 1, "law"), Sheet(tuple(replace(t, friction=to.get(t.friction, t.friction)) for t in sheet.tables)))
        for says, to in _LAWS
    ]
    for one in INPUTS:
        cause = Cause(f"the orbits are those of other inputs: {one.says}", one.rank, "inputs")
        variants.append((cause, all_changed(sheet, one.change)))
    likely = _first_samples(flights, [variant for _, variant in variants])
    found: list[Cause] = []
    tried: set[tuple[bytes, ...]] = set()
    for cause, variant in sorted((variants[k] for k in np.flatnonzero(likely)), key=lambda pair: pair[0].rank):
        given = (np.array([*t.p, *map(t.given.get, ("Omega", *STATE))]).tobytes() for t in variant.tables)
        key = tuple(given) + tuple(t.friction.encode() for t in variant.tables)
        if key not in tried and not (found and cause.rank > found[0].rank):
            tried.add(key)
            if sheet.fitted(Program(specimen()).answers(variant)).mean() >= 1 - _ILL:
                found.append(cause)
    return found
