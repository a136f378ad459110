"""How right orbits are read wrongly: other times, rows of a grid, other events, other counts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array
from tippedisk_verify.conformance.diagnosis.orbits import (
    CROSSING,
    EARLY,
    EXACT,
    ROUND,
    ROW,
    STATE,
    Flights,
    Value,
    short,
    tilt,
)
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.trees import Cause

__all__ = ["Readings"]

_FAR = 0.25  # s, of a shift
_ALIKE = 1e-4  # how far apart the values are at which crossings may have been taken
_FEW = 4  # wrong answers, to which a prediction has to come closer
_ROWS = ROUND[:-7]  # s, from 0.5 s to 0.1 ms
_ODD = [1e-3 * k for k in range(3, 500)]
_PAUSES = (0.02, 0.03, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0, 1.5, 2.0)
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


def after_pause(pause: float) -> Callable[[Array, Array], Array]:
    def kept(times: Array, rises: Array) -> Array:
        found: list[int] = []
        for n, t in enumerate(times):
            if t > EARLY and (not found or t - times[found[-1]] > pause):
                found.append(n)
        return np.array(found, dtype=int)

    return kept


def past(value: Value, c: float) -> Value:
    """What vanishes where a function of the state comes to a value."""
    return lambda state: np.asarray(value(state) - c)


_COUNTS: dict[str, Callable[[Array, Array], Array]] = {
    "": lambda t, up: t > EARLY,
    "only those with rising beta": lambda t, up: (t > EARLY) & up,
    "only those with falling beta": lambda t, up: (t > EARLY) & ~up,
    "those of the first 0.01 s too": lambda t, up: t >= 0,
    "each counted twice": lambda t, up: np.repeat(np.flatnonzero(t > EARLY), 2),
    **{f"none of those within about {x:g} s of the one before": after_pause(x) for x in _PAUSES},
}


@dataclass(eq=False)
class Readings:
    """Wrong readings of right orbits, each explaining one part of the answers."""

    search: Search
    flights: Flights

    def causes(self) -> list[Cause]:
        parts = ((STATE, self.samples), (CROSSING, self.crossings), (("flat_time",), self.flat))
        texts: list[str] = []
        for stems, reading in parts:
            if (part := self.wrong(stems)).any() and all(texts):
                texts.append(reading(part))
        return [Cause("; ".join(texts), 1, name="reading")] if all(texts) else []

    def given(self, predicted: Array, part: Array, digits: float = 1.0) -> bool:
        """Whether a prediction gives a part of the answers, better than asked, as what is read exactly does."""
        few = int((part & self.search.sheet.wrong).sum()) < _FEW
        tried = part & ~(np.isnan(predicted) & (self.flights.place >= self.flights.place[part].max()))
        return bool(tried.any() and self.search.sheet.fitted(predicted, digits + few)[tried].all())

    def wrong(self, stems: Sequence[str]) -> Array:
        """The answers to those of these quantities that have wrong ones."""
        here = np.isin(self.flights.stem, stems)
        return here & np.isin(self.flights.stem, self.flights.stem[here & self.search.sheet.wrong])

    def entries(self, part: Array) -> list[int]:
        """Those with most wrong answers first."""
        order = np.argsort(-np.bincount(self.flights.entry, part & self.search.sheet.wrong), kind="stable")
        return [k for k in order.tolist() if part[self.flights.entry == k].any()]

    # -- samples
    def samples(self, part: Array) -> str:
        """Those of a time that is off by the same for all, as a row's number would make it."""
        probe = part & (self.flights.entry == self.entries(part)[0])
        shift = self.shift(probe)
        for chosen in (probe, part):
            predicted, times = np.full(len(part), np.nan), self.flights.place[chosen] + shift
            past = times > self.flights.place[chosen].max() + EXACT  # where the orbits may end
            predicted[chosen] = np.where(past, np.nan, self.at(times, chosen))
            if not shift or not self.given(predicted, chosen):
                return ""
        late, stems = "early" if shift < 0 else "late", sorted(set(self.flights.stem[part]))
        says = f"those of a time {abs(shift):.6g} s too {late} (a row {late}, if rows are so far apart)"
        return f"samples{f' of {stems[0]}' * (len(stems) == 1)} are {says}"

    def at(self, times: Array, chosen: Array) -> Array:
        which = [STATE.index(stem) for stem in self.flights.stem[chosen].tolist()]
        return np.asarray(np.choose(which, self.flights.at(times, chosen)))

    def shift(self, chosen: Array) -> float:
        """By how much the times are off at which the right orbit comes nearest to these samples."""

        def off(by: float) -> Array:
            states = self.at(self.flights.place[chosen] + by, chosen)
            return np.asarray(np.nan_to_num(states - self.search.sheet.answer[chosen], nan=10.0))

        by = min(np.linspace(-_FAR, _FAR, 251).tolist(), key=lambda by: np.minimum(np.abs(off(by)), 10.0).sum())
        for _ in range(8):
            slope = (off(by + 1e-6) - off(by - 1e-6)) / 2e-6
            by -= float(np.clip(slope @ off(by) / max(float(slope @ slope), 1e-300), -0.01, 0.01))
        return short(by)

    # -- crossings
    def crossings(self, part: Array) -> str:
        return self.other_events(part) or self.not_located(part)

    def other_events(self, part: Array) -> str:
        """Crossings of something else, or counted otherwise."""
        whole = np.isin(self.flights.stem, CROSSING) if len(set(self.flights.stem[part])) > 1 else part
        entries = self.entries(whole)
        for (event, value), (count, chosen) in itertools.product(self.sections(entries[0]), _COUNTS.items()):
            for some in (entries[:1], entries) if event or count else ():
                found = np.full(len(part), np.nan)
                for k in some:
                    orbit = self.flights.orbit(k)
                    times = orbit.events(value)[1]
                    times = np.append([0.0] * int(abs(value(orbit.at([0.0]))[0]) < 1e-12), times)
                    times = times[chosen(times, value(orbit.at(times + ROW)) > value(orbit.at(times)))]
                    self.flights.enter(found, k, (times, *orbit.at(times)[1:]))
                if not self.given(found, whole & np.isin(self.flights.entry, some), 0.0 if event else 1.0):
                    break
            else:
                if event or count:
                    both = f"{event}{', and ' * bool(event and count)}{count}"
                    return f"crossings are {both}, not all crossings of beta = pi/2 after the first 0.01 s"
        return ""

    def sections(self, k: int) -> Iterator[tuple[str, Value]]:
        """beta = pi/2, and what has the same value on the right orbit at all answered times."""
        yield "", tilt
        here = (self.flights.entry == k) & (self.flights.stem == "crossing_time")
        states = self.flights.orbit(k).at(self.search.sheet.answer[here])
        for name, value in _VALUES.items() if here.sum() > 2 else ():
            if np.ptp(found := value(states)) < _ALIKE:
                c = float(np.median(found))
                near = {f"{n:g} pi/2": n * math.pi / 2 for n in range(-2, 4)}
                near |= {f"{round(c, n):g}": round(c, n) for n in range(5)} | {f"{c:.8g}": c}
                shown = next(text for text, one in near.items() if abs(one - c) < _ALIKE / 10)
                if name != "beta" or shown != "1 pi/2":
                    yield f"those of {name} = {shown}", past(value, near[shown])

    def not_located(self, part: Array) -> str:
        """Crossings at rows of a grid, or by straight lines between them."""
        stems = [stem for stem in CROSSING if stem in self.flights.stem[part]]
        for h in (*_ROWS, *_ODD):
            kept = {stem: set(range(len(_TAKEN))) for stem in stems}
            for k in self.entries(part):
                options = self.options(k, h)
                for n, stem in enumerate(CROSSING):
                    cells = part & (self.flights.entry == k) & (self.flights.stem == stem)
                    for option in tuple(kept.get(stem, ())) if cells.any() else ():
                        found = np.full(len(part), np.nan)
                        self.flights.enter(found, k, [options[option][n]], [stem])
                        if not self.given(found, cells):
                            kept[stem].remove(option)
                if not all(kept.values()):
                    break
            else:
                common = set.intersection(*kept.values())
                taken = {stem: min(common) if common else min(kept[stem]) for stem in stems}
                words: dict[str, list[str]] = {}
                for stem in stems:
                    words.setdefault(_TAKEN[taken[stem]], []).append(stem)
                texts = [f"{' and '.join(names)}: {word}" for word, names in words.items() if word != "right"]
                return f"crossings are not located, on a grid of {1000 * h:.6g} ms: {', '.join(texts)}"
        return ""

    def options(self, k: int, h: float) -> list[tuple[Array, ...]]:
        """Times, gamma and v of crossings between two rows in the ways of ``_TAKEN``."""
        orbit = self.flights.orbit(k)
        before, time = orbit.events(tilt, h)
        some = (time > EARLY) & (time < self.flights.lies(k))
        before, time, after = before[some], time[some], before[some] + h
        right = (time, *orbit.at(time)[1:])
        one, two = orbit.at(before), orbit.at(after)
        share = tilt(one) / (one[0] - two[0])
        line = (before + share * h, *(one + share * (two - one))[1:])
        return [(before, *one[1:]), (after, *two[1:]), (before + h / 2, *((one + two) / 2)[1:]), line, right]

    # -- lying flat
    def flat(self, part: Array) -> str:
        entries, answers = self.flights.entry[part].tolist(), self.search.sheet.answer[part]
        found = []
        for name, value in list(_VALUES.items())[3:]:
            states = [self.flights.orbit(k).at(t) for k, t in zip(entries, answers, strict=True)]
            c = short(float(value(states[0])), _ALIKE / 100)
            known = len(entries) > 1 or c in _THRESHOLDS
            if 1e-6 < c < 1 and known and all(abs(value(state) - c) < _ALIKE / 10 for state in states):
                found.append((len(f"{c:.6g}"), f"flat_time is when {name} = {c:.6g}, not 0"))
        if found:
            return min(found)[1]
        for c, (name, value) in itertools.product(_THRESHOLDS, list(_VALUES.items())[3:]):
            ends = np.array([self.flights.lies(k, past(value, c)) for k in entries])
            for word, to in (("before", np.floor), ("after", np.ceil)):
                if grids := [h for h in _ROWS if np.all(np.abs(h * to(ends / h) - answers) < EXACT)]:
                    listed = " or ".join(f"{1000 * h:.6g}" for h in grids[:3])
                    below = f"{name} comes below {c:g}" if c else "the disk lies flat"
                    return f"flat_time is not located: it is the row {word} on a grid of {listed} ms, where {below}"
        return ""
