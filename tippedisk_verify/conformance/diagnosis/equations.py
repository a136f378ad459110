"""A mistake in the equations that orbits follow, which a program may have once more than level 1 asks for.

A change of the rates along the right orbit, carried to a sample by the orbit's variations, is the change of the sample
to first order. So all changes are tried at the price of their rates; those that come nearest are flown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.conformance.diagnosis.flights import STATE, Flights, right
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.specimen import HERE, Program, specimen
from tippedisk_verify.conformance.diagnosis.suspects import Cause, Suspect, candidates, values
from tippedisk_verify.conformance.diagnosis.trees import statements

__all__ = ["Equations"]

_ENTRIES, _NODES = 3, 8
_NUDGE = 1e-6
_NEAR = 0.7  # of an error that the first order may be off, where the change is large
_FLOWN = 60  # changes that are flown
_CLOSE = 3.0  # times what is allowed
_CLOSER = 5.0  # times, that a flown sample comes to a wrong one


@dataclass(eq=False)
class Equations:
    search: Search
    flights: Flights

    @cached_property
    def table(self) -> Table:
        return max(self.flights.tables, key=lambda table: int(table.wrong.sum()))

    @cached_property
    def probes(self) -> tuple[list[int], float]:
        """Orbits whose first sample is wrong, the least first, and the time of that."""
        flights, sheet = self.flights, self.search.sheet
        time = float(np.min(flights.place[np.isin(flights.stem, STATE)], initial=np.inf))
        n, errors = list(flights.tables).index(self.table), {}
        for k, spot in enumerate(flights.spots):
            cells = flights.sample(k, time) if spot[0] == n else []
            if cells and sheet.wrong[cells].any():
                errors[k] = float(np.abs(sheet.answer - sheet.truth)[cells].max())
        return sorted(errors, key=errors.__getitem__)[:_ENTRIES], time

    def flown(self, space: Any, states: Array, rows: Any, durations: Array) -> Array:
        """Where states of some of the table's entries are after so many seconds each."""
        p, Omega = tuple(one[rows] for one in self.table.p), self.table.given["Omega"][rows]
        steps = max(1, int(np.ceil(durations.max() / space["FLIGHT_STEP"])))
        with np.errstate(all="ignore"):
            for _ in range(steps):
                states = space["flight_step"](space["flow"], p, Omega, self.table.smooth, states, durations / steps)
        return np.asarray(states)

    def causes(self) -> list[Cause]:
        entries, time = self.probes
        if not entries:
            return []
        sheet, space, count = self.search.sheet, right(), len(entries)
        rows = [self.flights.spots[k][1] for k in entries]
        cells = np.array([self.flights.sample(k, time) for k in entries]).T
        error = (sheet.answer - sheet.truth)[cells]
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        times = time * (nodes + 1) / 2
        along = np.concatenate([self.flights.orbit(k).at(times) for k in entries], axis=1)
        many, left = np.repeat(rows, _NODES), np.tile(time - times, count)
        ends = [self.flown(space, along + nudge, many, left) for nudge in self._nudges()]
        carried = np.array([(end - ends[0]) / _NUDGE for end in ends[1:]]) * np.tile(weights * time / 2, count)
        given = (tuple(one[many] for one in self.table.p), self.table.given["Omega"][many], self.table.smooth, *along)
        rates = np.array(space["equations"](*given)[6:8])
        tried: list[tuple[float, int, Suspect, Any, Any]] = []
        with np.errstate(all="ignore"):
            for suspect, spot, change, program in _changes():
                try:
                    found = np.array(program.space["equations"](*given)[6:8], dtype=float).reshape(rates.shape)
                except Exception:  # what a change does to a program is its own affair
                    continue
                moved = (carried * (found - rates)[:, None]).sum(axis=0).reshape(3, count, _NODES).sum(axis=2)
                off = np.linalg.norm(moved - error, axis=0) / np.linalg.norm(error, axis=0)
                if np.median(off) < _NEAR:
                    tried.append((float(np.median(off)), len(tried), suspect, spot, change))
        causes = []
        for _, _, suspect, spot, change in sorted(tried)[:_FLOWN]:
            program = Program(specimen(), {suspect.function: spot.replaced(change.node)})
            start = np.array([self.table.given[name][rows] for name in STATE])
            end = self.flown(program.space, start, rows, np.full(count, time))
            off, near = np.abs(end - sheet.answer[cells]), np.abs(error)
            if ((off <= _CLOSE * sheet.allowed[cells]) & ((off * _CLOSER <= near) | ~sheet.wrong[cells])).all():
                causes.append(suspect.cause(spot, change, program))
        return causes

    def _nudges(self) -> Iterator[Array]:
        yield np.zeros((3, 1))
        for k in (1, 2):
            yield _NUDGE * np.eye(3)[:, [k]]


def _changes() -> Iterator[Any]:
    """All changes of the equations, each with a program that makes it until the next one is asked for."""
    function = specimen().functions["equations"]
    for statement, path in statements(function):
        for place, label in values(function, statement, path):
            suspect = Suspect("equations", place, label, 0)
            program = Program(specimen(), {"equations": place.replaced(HERE)})
            for spot, change in candidates(suspect, (0, 1)):
                program.computes(spot.within(place, change.node))
                yield suspect, spot, change, program
