"""Orbits: the right ones at all times, what is asked of them, and those of other inputs or of the other law."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, Input, changed
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.specimen import Program, specimen
from tippedisk_verify.conformance.diagnosis.trees import Cause
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = [
    "CROSSING",
    "EARLY",
    "EXACT",
    "ROUND",
    "ROW",
    "STATE",
    "Flights",
    "Orbit",
    "OtherInputs",
    "Rates",
    "State",
    "Value",
    "right",
    "short",
    "tilt",
]

State = tuple[float, float, float]
Rates = Callable[[float, float, float], State]
Value = Callable[[Array], Array]  #: of states
STATE = ("beta", "gamma", "v")
CROSSING = ("crossing_time", "crossing_gamma", "crossing_v")
ROW = 1e-3  # s, between the rows of an orbit
EARLY = 0.01  # s, in which crossings do not count
EXACT = 1e-7  # s, of times that are read exactly
#: [s] of steps
ROUND: list[float] = sorted((f * 10.0**-k for k in range(1, 6) for f in (5, 4, 2.5, 2, 1.25, 1)), reverse=True)
_TOLERANCE = 1e-11
_END = 25.0  # s
_SCALAR: dict[str, Any] = {"sin": math.sin, "cos": math.cos, "abs": abs}
_LAWS: tuple[tuple[str, Callable[[bool], bool]], ...] = (
    ("the orbits of the smooth law follow the linear law", lambda smooth: False),
    ("the orbits of the linear law follow the smooth law", lambda smooth: True),
    ("the orbits follow the other friction law", lambda smooth: not smooth),
)
_ILL = 0.25  # of the answers, that rounding may change
_NUDGE = 1e-13  # rad
_MOST = 20  # orbits that are read to the end
_LONGEST = 4.0  # s, of the flights that changed inputs are tried on
_CLOSER = 5.0  # times, that an orbit comes to a wrong sample
_GIVEN = ("Omega", *STATE)
_BEYOND = 0.6  # s, that orbits go on after what is asked


@dataclass(frozen=True, eq=False)
class Orbit:
    """States and rates at rows, with cubic polynomials between them."""

    states: Array
    rates: Array

    def at(self, times: Any) -> Array:
        place, last = np.asarray(times, dtype=float) / ROW, self.states.shape[1] - 1
        outside = ~((place >= -1e-6) & (place <= last + 1e-6))
        row = np.clip(np.where(outside, 0, place).astype(int), 0, last - 1)
        s, a, b = place - row, self.states[:, row], self.states[:, row + 1]
        da, db = ROW * self.rates[:, row], ROW * self.rates[:, row + 1]
        found = a + s * (da + s * (3 * (b - a) - 2 * da - db + s * (2 * (a - b) + da + db)))
        return np.where(outside, np.nan, found)

    def events(self, value: Value, step: float = ROW) -> tuple[Array, Array]:
        """Where a function of the state changes its sign between rows so far apart: these rows, and when."""
        rows = np.arange(int(ROW * (self.states.shape[1] - 1) / step + 1e-6) + 1) * step
        values = value(self.at(rows))
        k = np.flatnonzero((values[:-1] * values[1:] < 0) | ((values[1:] == 0) & (values[:-1] != 0)))
        low, high = rows[k], rows[k + 1]
        for _ in range(45):
            middle = (low + high) / 2
            below = value(self.at(middle)) * values[k] > 0
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return rows[k], (low + high) / 2


def tilt(state: Array) -> Array:
    return np.asarray(state[0] - np.pi / 2)


@cache
def right(scalar: bool = False) -> Mapping[str, Any]:
    return Program(specimen(), **(_SCALAR if scalar else {})).space


@dataclass(eq=False)
class Flights:
    """The orbits of all entries of some tables, each flown when it is wanted, and where their answers stand."""

    tables: Sequence[Table]
    laws: Sequence[bool]
    flown: dict[int, Orbit] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.space, self.scalar = right(), right(True)
        self.spots = [(n, row) for n, table in enumerate(self.tables) for row in range(len(table.entries))]
        first = np.cumsum([0, *(len(table.entries) for table in self.tables)])
        self.entry = np.concatenate([table.rows + first[n] for n, table in enumerate(self.tables)])
        self.stem = np.concatenate([table.stems for table in self.tables])
        places = (placed(name)[1] for table in self.tables for name in table.names)
        self.place = np.array([float(one.get("t", one.get("n", "nan"))) for one in places])
        self.latest = np.concatenate([np.fmax(table.truth, np.clip(table.answer, 0, _END)) for table in self.tables])

    def inputs(self, k: int) -> tuple[tuple[float, ...], float, bool, State]:
        n, row = self.spots[k]
        beta, gamma, v, Omega = (float(self.tables[n].given[name][row]) for name in (*STATE, "Omega"))
        return tuple(float(one[row]) for one in self.tables[n].p), Omega, self.laws[n], (beta, gamma, v)

    def rates(self, k: int) -> Rates:
        (p, Omega, smooth, _), equations = self.inputs(k), self.scalar["equations"]
        return lambda beta, gamma, v: (v, *equations(p, Omega, smooth, beta, gamma, v)[6:8])

    def orbit(self, k: int) -> Orbit:
        if k not in self.flown:
            from scipy.integrate import odeint

            p, Omega, smooth, start = self.inputs(k)
            rates, here = self.rates(k), self.entry == k
            asked = np.where(np.isin(self.stem, STATE), self.place, 0)
            asked = np.where(np.isin(self.stem, ("crossing_time", "flat_time")), self.latest, asked)
            times = np.arange(int((asked[here].max(initial=0) + _BEYOND) / ROW) + 1) * ROW
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                tight = {"rtol": _TOLERANCE, "atol": _TOLERANCE, "mxstep": 20000}
                try:
                    states = odeint(lambda t, y: rates(*y.tolist()), start, times, tfirst=True, **tight).T
                except (ArithmeticError, ValueError):  # of inputs that make no orbit
                    states = np.full((3, len(times)), np.nan)
                self.flown[k] = Orbit(states, self.space["flow"](p, Omega, smooth, states))
        return self.flown[k]

    def at(self, times: Array, chosen: Array) -> Array:
        """States at a time for each of some answers, from the orbits of their entries."""
        states = np.full((3, len(times)), np.nan)
        for k in np.unique(self.entry[chosen]):
            here = self.entry[chosen] == k
            states[:, here] = self.orbit(k).at(times[here])
        return states

    def lies(self, k: int, value: Value = lambda state: np.sin(state[0])) -> float:
        times = self.orbit(k).events(value)[1]
        return float(times[0]) if len(times) else math.inf

    def crossings(self, k: int) -> Array:
        times = self.orbit(k).events(tilt)[1]
        return np.asarray(times[(times > EARLY) & (times < self.lies(k))])

    def read(self, entries: Sequence[int]) -> Array:
        """The answers to all questions of some entries, read rightly."""
        found = np.full(len(self.entry), np.nan)
        for k in entries:
            here, times = self.entry == k, self.crossings(k)
            self.enter(found, k, (times, *self.orbit(k).at(times)[1:]))
            for stem, values in zip(STATE, self.orbit(k).at(self.place[here]), strict=True):
                found[here] = np.where(self.stem[here] == stem, values, found[here])
            found[here & (self.stem == "flat_time")] = self.lies(k)
        return found

    def enter(self, found: Array, k: int, crossings: Sequence[Array], stems: Sequence[str] = CROSSING) -> None:
        """Enter crossings in their order."""
        for stem, values in zip(stems, crossings, strict=True):
            cells = np.flatnonzero((self.entry == k) & (self.stem == stem))
            number = self.place[cells].astype(int) - 1
            known = (number >= 0) & (number < len(values))
            found[cells[known]] = values[number[known]]

    def sample(self, k: int, time: float) -> list[int]:
        """Where the answers to (beta, gamma, v) at a time stand; nothing if one is missing."""
        here = (self.entry == k) & (np.abs(self.place - time) < EXACT)
        cells = [np.flatnonzero(here & (self.stem == stem)) for stem in STATE]
        return [int(cell[0]) for cell in cells] if all(map(len, cells)) else []


@dataclass(eq=False)
class OtherInputs:
    """Right orbits of other inputs than those that were asked for."""

    search: Search
    flights: Flights

    def probes(self, n: int) -> tuple[list[int], float]:
        """The entries of a table whose samples are wrong first, and when."""
        flights = self.flights
        wrong = self.search.sheet.wrong & np.isin(flights.stem, STATE)
        mine = wrong & np.array([flights.spots[k][0] == n for k in flights.entry])
        time = float(flights.place[mine].min(initial=math.inf))
        whole = [k for k in np.unique(flights.entry[mine & (flights.place == time)]) if flights.sample(k, time)]
        return [int(k) for k in whole[:2]], time

    def flown(self, smooth: bool, variants: Sequence[Table], entries: Sequence[int], end: float) -> Array:
        """(beta, gamma, v) at a time, by changed tables and entries."""
        rows, space = [self.flights.spots[k][1] for k in entries], right()
        p = tuple(np.array([one.p[n][rows] for one in variants], dtype=float).ravel() for n in range(len(SYMBOLS)))
        Omega, *start = (np.array([one.given[name][rows] for one in variants], float).ravel() for name in _GIVEN)
        state, steps = np.array(start), max(1, math.ceil(end / space["FLIGHT_STEP"]))
        with np.errstate(all="ignore"):
            for _ in range(steps):
                state = space["flight_step"](space["flow"], p, Omega, smooth, state, end / steps)
        return np.asarray(state.reshape(3, len(variants), len(rows)))

    def causes(self) -> list[Cause]:
        """Another law, or a known change of the inputs."""
        tables = self.flights.tables
        for says, law in _LAWS:
            if self.confirmed(tables, law):
                return [Cause(says, 1, name="law")]
        found: list[Cause] = []
        tried: set[tuple[bytes, ...]] = set()
        for one in sorted(self.likely(), key=lambda one: one.rank):
            others = [self.changed(table, one) for table in tables]
            key = tuple(np.array([*t.p, *map(t.given.get, _GIVEN)]).tobytes() for t in others)
            if key in tried or len(tried) > _MOST or (found and one.rank > found[0].rank):
                continue
            tried.add(key)
            if self.confirmed(others, bool):
                found.append(Cause(f"the orbits are those of other inputs: {one.says}", one.rank, name="inputs"))
        return found

    def likely(self) -> list[Input]:
        """The changes of inputs that give the first wrong samples."""
        sheet, good = self.search.sheet, np.ones(len(INPUTS), dtype=bool)
        for n, table in enumerate(self.flights.tables):
            entries, end = self.probes(n)
            if entries and end < _LONGEST:
                cells = np.array([self.flights.sample(k, end) for k in entries]).T[:, None]
                states = self.flown(table.smooth, [self.changed(table, one) for one in INPUTS], entries, end)
                off = np.abs(states - sheet.answer[cells])
                grown = np.maximum(1, np.abs(states / sheet.truth[cells]))
                near = (off * _CLOSER <= np.abs(sheet.answer - sheet.truth)[cells]) | ~sheet.wrong[cells]
                good &= ((off <= 3 * sheet.allowed[cells] * grown) & near).all(axis=(0, 2))
        # Where no sample is whole, nothing was tried.
        return [] if good.all() else [one for one, fits in zip(INPUTS, good, strict=True) if fits]

    def changed(self, table: Table, one: Input) -> Table:
        try:
            return changed(table, one.change)
        except Exception:  # a change that these inputs do not bear
            return table

    def confirmed(self, tables: Sequence[Table], law: Callable[[bool], bool]) -> bool:
        """Whether right readings of these orbits give all answers: those to one entry, to three, to all."""
        flights = Flights(tables, [law(table.smooth) for table in tables])
        sheet = self.search.sheet
        order = np.argsort(-np.bincount(flights.entry, sheet.wrong), kind="stable").tolist()
        for entries in (order[:1], order[:3], order):
            predicted = flights.read(entries)
            ends = np.array([flights.lies(k) if k in entries else math.inf for k in range(len(flights.spots))])
            late = np.isin(flights.stem, STATE) & (flights.place > ends[flights.entry])  # after the disk lies flat
            missed = np.isin(flights.entry, entries) & ~late & ~sheet.fitted(predicted)
            if missed.mean() > _ILL:
                return False
            if missed.any():  # from next to an unstable equilibrium orbits go where rounding sends them
                nudged = [replace(one, given={**one.given, "beta": one.given["beta"] + _NUDGE}) for one in tables]
                other = Flights(nudged, flights.laws).read(np.unique(flights.entry[missed]).tolist())
                with np.errstate(all="ignore"):
                    loose = np.abs(other - predicted) > sheet.allowed
                lost = np.isnan(predicted) & np.isin(flights.entry, flights.entry[loose])
                if (missed & ~loose & ~lost).any():
                    return False
        return True


def short(number: float, near: float = 2e-8) -> float:
    """A number with few digits, if it is nearly one."""
    rounded = (float(f"{number:.{digits}g}") for digits in range(1, 9))
    return next((one for one in rounded if abs(one - number) < near * max(1.0, abs(number))), number)
