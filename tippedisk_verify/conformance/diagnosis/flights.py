"""Right orbits at all times, and what is asked of them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.conformance.diagnosis.specimen import Program, specimen
from tippedisk_verify.conformance.sheet import placed

__all__ = [
    "CROSSING",
    "EARLY",
    "EXACT",
    "ROUND",
    "ROW",
    "STATE",
    "Flights",
    "Orbit",
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
ROUND = sorted((f * 10.0**-k for k in range(1, 6) for f in (5, 4, 2.5, 2, 1.25, 1)), reverse=True)  # s, of steps
_TOLERANCE = 1e-11
_END = 25.0  # s
_SCALAR: dict[str, Any] = {"sin": math.sin, "cos": math.cos, "abs": abs}
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
    changes: Mapping[str, Any] = field(default_factory=dict)  #: of the specimen's functions

    def __post_init__(self) -> None:
        self.space, self.scalar = right(), right(True)
        if self.changes:
            self.space = Program(specimen(), self.changes).space
            self.scalar = Program(specimen(), self.changes, **_SCALAR).space
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


def short(number: float, near: float = 2e-8) -> float:
    """A number with few digits, if it is nearly one."""
    rounded = (float(f"{number:.{digits}g}") for digits in range(1, 9))
    return next((one for one in rounded if abs(one - number) < near * max(1.0, abs(number))), number)
