"""How right orbits are read wrongly: other times, rows of a grid, other events, other counts."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array
from tippedisk_verify.conformance.diagnosis.orbits import CROSSING, EXACT, ROUND, STATE, Flights
from tippedisk_verify.conformance.diagnosis.trees import Cause

__all__ = ["Readings"]

Value = Callable[[Array], Array]  #: of states
_ROW = 1e-3  # s, between the rows of an orbit
_EARLY = 0.01  # s, in which crossings do not count
_TOLERANCE = 1e-11
_END = 25.0  # s
_BEYOND = 0.6  # s, that orbits go on after what is asked
_FAR = 0.25  # s, of a shift
_ALIKE = 1e-4  # how far apart the values are at which crossings may have been taken
_FEW = 4  # wrong answers, to which a prediction has to come closer
_STEPS = ROUND[:-7]  # s, from 0.5 s to 0.1 ms
_ODD = [1e-3 * k for k in range(3, 500)]
#: What may be made of a crossing between two rows; all but the last are wrong.
_TAKEN = (
    "of the row before",
    "of the row after",
    "the mean of both rows",
    "on the straight line between rows",
    "right",
)
_VALUES: dict[str, Value] = {
    "beta": lambda s: s[0], "gamma": lambda s: s[1], "v": lambda s: s[2], "sin(beta)": lambda s: np.sin(s[0]),
    "the angle between disk and ground": lambda s: np.minimum(s[0], np.pi - s[0]),
}  # fmt: skip
_THRESHOLDS = (0.0, 0.1, 0.05, 0.01, 0.02, 0.2, 0.001, 1e-4)


def _tilt(state: Array) -> Array:
    return np.asarray(state[0] - np.pi / 2)


def _past(value: Value, c: float) -> Value:
    """What vanishes where a function of the state comes to a value."""
    return lambda state: np.asarray(value(state) - c)


def _after_pause(pause: float) -> Callable[[Array, Array], Array]:
    def kept(times: Array, rises: Array) -> Array:
        found: list[int] = []
        for n, t in enumerate(times):
            if t > _EARLY and (not found or t - times[found[-1]] > pause):
                found.append(n)
        return np.array(found, dtype=int)

    return kept


_COUNTS: dict[str, Callable[[Array, Array], Array]] = {
    "": lambda t, up: t > _EARLY,
    "only those with rising beta": lambda t, up: (t > _EARLY) & up,
    "only those with falling beta": lambda t, up: (t > _EARLY) & ~up,
    "those of the first 0.01 s too": lambda t, up: t >= 0,
    "each counted twice": lambda t, up: np.repeat(np.flatnonzero(t > _EARLY), 2),
    **{
        f"none of those within about {x:g} s of the one before": _after_pause(x)
        for x in (0.02, 0.03, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0, 1.5, 2.0)
    },
}


@dataclass(frozen=True, eq=False)
class Orbit:
    """States and rates at rows, with cubic polynomials between them."""

    states: Array
    rates: Array

    def at(self, times: Any) -> Array:
        place, last = np.asarray(times, dtype=float) / _ROW, self.states.shape[1] - 1
        outside = ~((place >= -1e-6) & (place <= last + 1e-6))
        row = np.clip(np.where(outside, 0, place).astype(int), 0, last - 1)
        s, a, b = place - row, self.states[:, row], self.states[:, row + 1]
        da, db = _ROW * self.rates[:, row], _ROW * self.rates[:, row + 1]
        found = a + s * (da + s * (3 * (b - a) - 2 * da - db + s * (2 * (a - b) + da + db)))
        return np.where(outside, np.nan, found)

    def events(self, value: Value, step: float = _ROW) -> tuple[Array, Array]:
        """Where a function of the state changes its sign between rows so far apart: these rows, and when."""
        rows = np.arange(int(_ROW * (self.states.shape[1] - 1) / step + 1e-6) + 1) * step
        values = value(self.at(rows))
        k = np.flatnonzero((values[:-1] * values[1:] < 0) | ((values[1:] == 0) & (values[:-1] != 0)))
        low, high = rows[k], rows[k + 1]
        for _ in range(45):
            middle = (low + high) / 2
            below = value(self.at(middle)) * values[k] > 0
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return rows[k], (low + high) / 2

    def lies(self, value: Value = lambda state: np.sin(state[0])) -> float:
        """When the disk lies flat, or nearly so; infinite if it never does."""
        times = self.events(value)[1]
        return float(times[0]) if len(times) else math.inf


@dataclass(eq=False)
class Readings(Flights):
    """Wrong readings of right orbits, each explaining one part of the answers; an orbit is flown when it is wanted."""

    flown: dict[int, Orbit] = field(default_factory=dict)

    def causes(self) -> list[Cause]:
        parts = ((STATE, self.samples), (CROSSING, self.crossings), (("flat_time",), self.flat))
        texts: list[str] = []
        for stems, reading in parts:
            wrong = np.unique(self.stem[np.isin(self.stem, stems) & self.sheet.wrong])
            if len(wrong) and all(texts):
                texts.append(reading(np.isin(self.stem, wrong)))
        return [Cause("; ".join(texts), 1, name="reading")] if all(texts) else []

    def orbit(self, k: int) -> Orbit:
        if k not in self.flown:
            from scipy.integrate import odeint

            rates, here = self.rates(k), self.entry == k
            latest = np.where(np.isin(self.stem, STATE), self.place, 0)
            timed = np.isin(self.stem, ("crossing_time", "flat_time"))
            latest = np.where(timed, np.fmax(self.sheet.truth, np.clip(self.sheet.answer, 0, _END)), latest)
            times = np.arange(int((latest[here].max(initial=0) + _BEYOND) / _ROW) + 1) * _ROW
            tight: dict[str, Any] = {"rtol": _TOLERANCE, "atol": _TOLERANCE, "mxstep": 20000, "tfirst": True}
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                states = odeint(lambda t, y: rates(*y.tolist()), self.start(k), times, **tight)
            self.flown[k] = Orbit(states.T, np.array([rates(*state) for state in states.tolist()]).T)
        return self.flown[k]

    def given(self, predicted: Array, part: Array, digits: float = 1.0) -> bool:
        """Whether a prediction gives a part of the answers, better than asked, as what is read exactly does."""
        few = int((part & self.sheet.wrong).sum()) < _FEW
        tried = part & ~(np.isnan(predicted) & (self.place >= self.place[part].max()))
        return bool(tried.any() and self.sheet.fitted(predicted, digits + few)[tried].all())

    def entries(self, part: Array) -> list[int]:
        """Those with most wrong answers first."""
        order = np.argsort(-np.bincount(self.entry, part & self.sheet.wrong), kind="stable")
        return [k for k in order.tolist() if part[self.entry == k].any()]

    def enter(self, found: Array, k: int, crossings: Sequence[Array], stems: Sequence[str] = CROSSING) -> None:
        """Enter crossings in their order."""
        for stem, values in zip(stems, crossings, strict=True):
            cells = np.flatnonzero((self.entry == k) & (self.stem == stem))
            number = self.place[cells].astype(int) - 1
            known = (number >= 0) & (number < len(values))
            found[cells[known]] = values[number[known]]

    # -- samples
    def samples(self, part: Array) -> str:
        """Those of a time that is off by the same for all, as a row's number would make it."""
        probe = part & (self.entry == self.entries(part)[0])
        shift = self.shift(probe)
        for chosen in (probe, part):
            predicted, times = np.full(len(part), np.nan), self.place[chosen] + shift
            past = times > self.place[chosen].max() + EXACT  # where the orbits may end
            predicted[chosen] = np.where(past, np.nan, self.at(times, chosen))
            if not shift or not self.given(predicted, chosen):
                return ""
        late, stems = "early" if shift < 0 else "late", sorted(set(self.stem[part]))
        says = f"those of a time {abs(shift):.6g} s too {late} (a row {late}, if rows are so far apart)"
        return f"samples{f' of {stems[0]}' * (len(stems) == 1)} are {says}"

    def at(self, times: Array, chosen: Array) -> Array:
        """What is asked by some answers, at other times."""
        entry, which = self.entry[chosen], np.array([STATE.index(stem) for stem in self.stem[chosen]])
        found = np.full(len(times), np.nan)
        for k in np.unique(entry):
            found[entry == k] = np.choose(which[entry == k], self.orbit(k).at(times[entry == k]))
        return found

    def shift(self, chosen: Array) -> float:
        """By how much the times are off at which the right orbit comes nearest to these samples."""

        def off(by: float) -> Array:
            states = self.at(self.place[chosen] + by, chosen)
            return np.asarray(np.nan_to_num(states - self.sheet.answer[chosen], nan=10.0))

        by = min(np.linspace(-_FAR, _FAR, 251).tolist(), key=lambda by: np.minimum(np.abs(off(by)), 10.0).sum())
        for _ in range(8):
            slope = (off(by + 1e-6) - off(by - 1e-6)) / 2e-6
            by -= float(np.clip(slope @ off(by) / max(float(slope @ slope), 1e-300), -0.01, 0.01))
        return _short(by)

    # -- crossings
    def crossings(self, part: Array) -> str:
        return self.other_events(part) or self.not_located(part)

    def other_events(self, part: Array) -> str:
        """Crossings of something else, or counted otherwise."""
        whole = np.isin(self.stem, CROSSING) if len(set(self.stem[part])) > 1 else part
        entries = self.entries(whole)
        for (event, value), (count, chosen) in itertools.product(self.sections(entries[0]), _COUNTS.items()):
            for some in (entries[:1], entries) if event or count else ():
                found = np.full(len(part), np.nan)
                for k in some:
                    orbit = self.orbit(k)
                    times = orbit.events(value)[1]
                    times = np.append([0.0] * int(abs(value(orbit.at([0.0]))[0]) < 1e-12), times)
                    times = times[chosen(times, value(orbit.at(times + _ROW)) > value(orbit.at(times)))]
                    self.enter(found, k, (times, *orbit.at(times)[1:]))
                if not self.given(found, whole & np.isin(self.entry, some), 0.0 if event else 1.0):
                    break
            else:
                if event or count:
                    both = f"{event}{', and ' * bool(event and count)}{count}"
                    return f"crossings are {both}, not all crossings of beta = pi/2 after the first 0.01 s"
        return ""

    def sections(self, k: int) -> Iterator[tuple[str, Value]]:
        """beta = pi/2, and what has the same value on the right orbit at all answered times."""
        yield "", _tilt
        here = (self.entry == k) & (self.stem == "crossing_time")
        states = self.orbit(k).at(self.sheet.answer[here])
        for name, value in _VALUES.items() if here.sum() > 2 else ():
            if np.ptp(found := value(states)) < _ALIKE:
                c = float(np.median(found))
                near = {f"{n:g} pi/2": n * math.pi / 2 for n in range(-2, 4)}
                near |= {f"{round(c, n):g}": round(c, n) for n in range(5)} | {f"{c:.8g}": c}
                shown = next(text for text, one in near.items() if abs(one - c) < _ALIKE / 10)
                if name != "beta" or shown != "1 pi/2":
                    yield f"those of {name} = {shown}", _past(value, near[shown])

    def not_located(self, part: Array) -> str:
        """Crossings at rows of a grid, or by straight lines between them."""
        stems = [stem for stem in CROSSING if stem in self.stem[part]]
        for h in (*_STEPS, *_ODD):
            kept = {stem: set(range(len(_TAKEN))) for stem in stems}
            for k in self.entries(part):
                options = self.options(k, h)
                for n, stem in enumerate(CROSSING):
                    cells = part & (self.entry == k) & (self.stem == stem)
                    for option in tuple(kept.get(stem, ())) if cells.any() else ():
                        found = np.full(len(part), np.nan)
                        self.enter(found, k, [options[option][n]], [stem])
                        if not self.given(found, cells):
                            kept[stem].remove(option)
                if not all(kept.values()):
                    break
            else:
                common = set.intersection(*kept.values())
                taken = {stem: _TAKEN[min(common or kept[stem])] for stem in stems}
                words = dict.fromkeys(word for word in taken.values() if word != "right")
                texts = [f"{' and '.join(one for one in stems if taken[one] == word)}: {word}" for word in words]
                return f"crossings are not located, on a grid of {1000 * h:.6g} ms: {', '.join(texts)}"
        return ""

    def options(self, k: int, h: float) -> list[tuple[Array, ...]]:
        """Times, gamma and v of crossings between two rows in the ways of ``_TAKEN``."""
        orbit = self.orbit(k)
        before, time = orbit.events(_tilt, h)
        some = (time > _EARLY) & (time < orbit.lies())
        before, time, after = before[some], time[some], before[some] + h
        right = (time, *orbit.at(time)[1:])
        one, two = orbit.at(before), orbit.at(after)
        share = _tilt(one) / (one[0] - two[0])
        line = (before + share * h, *(one + share * (two - one))[1:])
        return [(before, *one[1:]), (after, *two[1:]), (before + h / 2, *((one + two) / 2)[1:]), line, right]

    # -- lying flat
    def flat(self, part: Array) -> str:
        orbits, answers = [self.orbit(k) for k in self.entry[part]], self.sheet.answer[part]
        found = []
        for name, value in list(_VALUES.items())[3:]:
            states = [orbit.at(t) for orbit, t in zip(orbits, answers, strict=True)]
            c = _short(float(value(states[0])), _ALIKE / 100)
            known = len(orbits) > 1 or c in _THRESHOLDS
            if 1e-6 < c < 1 and known and all(abs(value(state) - c) < _ALIKE / 10 for state in states):
                found.append((len(f"{c:.6g}"), f"flat_time is when {name} = {c:.6g}, not 0"))
        if found:
            return min(found)[1]
        for c, (name, value) in itertools.product(_THRESHOLDS, list(_VALUES.items())[3:]):
            ends = np.array([orbit.lies(_past(value, c)) for orbit in orbits])
            for word, to in (("before", np.floor), ("after", np.ceil)):
                if grids := [h for h in _STEPS if np.all(np.abs(h * to(ends / h) - answers) < EXACT)]:
                    listed = " or ".join(f"{1000 * h:.6g}" for h in grids[:3])
                    below = f"{name} comes below {c:g}" if c else "the disk lies flat"
                    return f"flat_time is not located: it is the row {word} on a grid of {listed} ms, where {below}"
        return ""


def _short(number: float, near: float = 2e-8) -> float:
    """A number with few digits, if it is nearly one."""
    rounded = (float(f"{number:.{digits}g}") for digits in range(1, 9))
    return next((one for one in rounded if abs(one - number) < near * max(1.0, abs(number))), number)
