"""Orbits: other inputs behind them, other times on them, and the errors of integrators.

What a mutation of a formula cannot say of them. Right orbits are known at all times, and those of changed inputs too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.conformance.diagnosis.flights import STATE, Flights, State, right
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, changed
from tippedisk_verify.conformance.diagnosis.integrators import Integrators
from tippedisk_verify.conformance.diagnosis.readings import Readings
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.suspects import Cause
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["orbit_causes"]

_LAWS: tuple[tuple[str, Callable[[bool], bool]], ...] = (
    ("", lambda smooth: smooth),
    ("the orbits of the smooth law follow the linear law", lambda smooth: False),
    ("the orbits of the linear law follow the smooth law", lambda smooth: True),
    ("the orbits follow the other friction law", lambda smooth: not smooth),
)
_START = "the orbits are those of other inputs: "
_ILL = 0.25  # of the answers, that rounding may change
_NUDGE = 1e-13  # rad
_MOST = 20  # orbits that are read to the end
_LONGEST = 4.0  # s, of the flights that changed inputs are tried on
_CLOSER = 5.0  # times, that an orbit comes to a wrong sample
_GIVEN = ("Omega", *STATE)


@dataclass(eq=False)
class Inputs:
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
        """A known change of the inputs, another law, or both."""
        sheet, tables, count = self.search.sheet, self.with_firsts(), len(INPUTS) + 1
        left = set(range(len(_LAWS) * count))
        for n, table in enumerate(tables):
            entries, end = self.probes(n)
            if not entries or end > _LONGEST:
                continue
            variants = [self.changed(table, one) for one in range(count)]
            new = [m for m, one in enumerate(variants) if m == 0 or one is not table]
            cells = np.array([self.flights.sample(k, end) for k in entries]).T[:, None]
            for smooth in {law(table.smooth) for _, law in _LAWS}:
                states = np.repeat(self.flown(smooth, [table], entries, end), count, axis=1)
                states[:, new] = self.flown(smooth, [variants[m] for m in new], entries, end)
                off = np.abs(states - sheet.answer[cells])
                grown = np.maximum(1, np.abs(states / sheet.truth[cells]))
                near = off * _CLOSER <= np.abs(sheet.answer - sheet.truth)[cells]
                good = ((off <= 3 * sheet.allowed[cells] * grown) & (near | ~sheet.wrong[cells])).all(axis=(0, 2))
                left -= {o for o in left if _LAWS[o // count][1](table.smooth) == smooth and not good[o % count]}
        if len(left) == len(_LAWS) * count:
            return []
        found: list[Cause] = []
        tried: set[tuple[Any, ...]] = set()
        ranks = [0, *(one.rank for one in INPUTS)]
        for o in sorted(left, key=lambda o: (ranks[o % count] + (o >= count), o)):
            (says, law), one, rank = _LAWS[o // count], o % count, ranks[o % count] + (o >= count)
            others = [self.changed(table, one) for table in tables]
            key = (
                *(law(t.smooth) for t in tables),
                *(np.array([*t.p, *map(t.given.get, _GIVEN)]).tobytes() for t in others),
            )
            if key in tried or len(tried) > _MOST or (found and rank > found[0].rank):
                continue
            tried.add(key)
            if self.confirmed(others, law):
                change = f"{_START}{INPUTS[one - 1].says}" if one else ""
                found.append(Cause(f"{says}{', and ' * bool(says and change)}{change}", rank, name="inputs"))
        return found

    def with_firsts(self) -> list[Table]:
        """With the speed of the first entry of all that has the same start."""
        firsts: dict[State, float] = {}
        for k in range(len(self.flights.spots)):
            firsts.setdefault(self.flights.inputs(k)[3], self.flights.inputs(k)[1])
        speeds = np.array([firsts[self.flights.inputs(k)[3]] for k in range(len(self.flights.spots))])
        of = np.array([n for n, _ in self.flights.spots])
        tables = enumerate(self.flights.tables)
        return [replace(table, given={**table.given, "first_Omega": speeds[of == n]}) for n, table in tables]

    def changed(self, table: Table, one: int) -> Table:
        """By an input's number in the table, from 1 on."""
        try:
            return changed(table, INPUTS[one - 1].change) if one else table
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


def orbit_causes(search: Search) -> list[Cause]:
    """What explains wrong orbits, and is no mistake in a formula."""
    flights = Flights(search.sheet.tables, [table.smooth for table in search.sheet.tables])
    inputs = Inputs(search, flights)
    readings, integrators = Readings(search, flights), Integrators(search, flights)
    return readings.causes() or inputs.causes() or integrators.causes()
