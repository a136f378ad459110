"""From each answered sample to the next one: what a program does to states, on all orbits at once.

The right equations, started in each answered state, miss the next one by a defect. A mistake is told if it leads from
every answered state to the next; errors on the way before do not matter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.flights import Array, Field, field, flown
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["STATE", "Pairs", "pairs_of"]

STATE = ("beta", "gamma", "v")
_FINE = 1e-3  # s, of steps of RK4 that leave some 1e-10
_FLOOR = 1e-6  # rad, rad/s; smaller defects are those of tolerances that are fine enough
_LEFT = 1e-3  # of a defect: what an explanation may leave
_MOSTLY = 0.95  # of all pairs have to be explained: where states are rounded, one may be rounded the other way
_LEAST = 8  # pairs


@dataclass(frozen=True)
class Pairs:
    """Answered states and the next ones, rows beta, gamma and v; the first are the starts that were asked for."""

    here: Quantity  #: one of the samples
    starts: Array
    ends: Array
    times: Array  #: s, of the starts
    speeds: Array
    between: float  #: s
    missed: Array  #: ends minus those of the right equations

    @property
    def field(self) -> Field:
        return field(self.here.set, self.here.friction, self.speeds)

    @property
    def moved(self) -> Array:
        """Which have a defect."""
        return numpy.asarray(self.size > _FLOOR)

    @property
    def size(self) -> Array:
        return numpy.asarray(numpy.linalg.norm(self.missed, axis=0))

    def some(self, which: Array) -> Pairs:
        return Pairs(
            self.here, self.starts[:, which], self.ends[:, which], self.times[which], self.speeds[which], self.between,
            self.missed[:, which],
        )  # fmt: skip

    def on(self, starts: Array, time: float) -> Array:
        """Where the right equations lead from other starts."""
        return flown(self.field, starts, time, max(1, round(time / _FINE)))

    def explained(self, made: Array, rows: int = 3, mostly: float = _MOSTLY) -> bool:
        """Whether these ends are the answered ones, by far better than the right ones are; of beta, gamma and v."""
        size = numpy.linalg.norm(self.missed[:rows], axis=0)
        moved = size > _FLOOR
        off = numpy.nan_to_num(numpy.linalg.norm((made - self.ends)[:rows], axis=0), nan=math.inf)
        fine = off <= _LEFT * numpy.maximum(size, numpy.median(size[moved]) if moved.any() else _FLOOR)
        return bool(moved.sum() >= _LEAST and fine.mean() >= mostly)


def pairs_of(here: Sequence[Quantity], answers: Mapping[str, Decimal]) -> Pairs | None:
    """The pairs in these answers, some of them samples; None if there are few."""
    states: dict[tuple[str, float], dict[str, Quantity]] = {}
    for quantity in here:
        name, mark, text = quantity.name.partition("@")
        if mark:
            states.setdefault((quantity.id.rsplit("/", 1)[0], float(text)), {})[name] = quantity
    whole = {place: three for place, three in states.items() if len(three) == len(STATE)}
    between = min((time for _, time in whole), default=math.nan)
    begun, ended, places = list[list[float]](), list[list[float]](), list[tuple[str, float]]()
    for (entry, time), three in whole.items():
        before = whole.get((entry, round(time - between, 9)))
        if before is None and time != between:
            continue
        begun.append([float(three["beta"].inputs[n] if before is None else answers[before[n].id]) for n in STATE])
        ended.append([float(answers[three[n].id]) for n in STATE])
        places.append((entry, time))
    if len(places) < _LEAST:
        return None
    first = whole[places[0]]["beta"]
    starts, ends = numpy.array(begun).T, numpy.array(ended).T
    speeds = numpy.array([float(whole[place]["beta"].inputs["Omega"]) for place in places])
    right = flown(field(first.set, first.friction, speeds), starts, between, round(between / _FINE))
    times = numpy.array([time - between for _, time in places])
    return Pairs(first, starts, ends, times, speeds, between, numpy.nan_to_num(ends - right, nan=1e9, posinf=1e9))
