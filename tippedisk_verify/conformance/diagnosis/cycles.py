"""What is wrong with cycles: states that are none at the asked speed, and what was made of the return to the section.

Everything is flown and derived by the client's own functions. A cycle goes from its section to a return with the state
(x, v), after half a period for limit cycles and a whole one for rotating ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Results, Sheet, Table
from tippedisk_verify.conformance.diagnosis.saddles import column, connections, known_speeds, of
from tippedisk_verify.conformance.diagnosis.search import Search, all_changes
from tippedisk_verify.conformance.diagnosis.specimen import Specimen, specimen
from tippedisk_verify.conformance.diagnosis.trees import Cause

__all__ = ["cycle_causes"]

Said = Iterator[tuple[str, Sequence[Results]]]  #: what is said, and what it predicts of each table; the rest is right
_INDEX = {"limit-cycle": 0, "near-heteroclinic": 0, "rotating-cycle": 1}  # of the section in the client
_CLOSED = 1e-6
_SAME = (2e-8, 1e-9)  # rad/s, of speeds: what digits leave, and next to Omega_h
_LARGEST = 10.0  # s, rad or rad/s, of what may be the state and time of a return
_CHANCE = 1e-3
_LATE = 0.04  # s; what is missed by more is no turning point
_EARLY = "Newton's iteration for the cycle stopped too early (too loose a tolerance, few steps)"
_ORIGINS = ("Omega_h of the other law", "Omega_h", "Omega_crit", "30.07", "30.92")

#: The client with right cycles given: where they return, or only their states, so that the flight may be changed.
_KIND = """
def {kind}(p, smooth, given, asked):
    return cycle_derivatives(p, given["Omega"], smooth, {index}, returned(p, smooth, given, {index}))
"""
_KINDS = "".join(_KIND.format(kind=kind.replace("-", "_"), index=index) for kind, index in _INDEX.items())
_FLOWN = """
def returned(p, smooth, given, index):
    return section_return(variational_flow, p, given["Omega"], smooth, index, given["x"], given["v"], FLIGHT_STEP)[3]
"""
_GIVEN = """
def returned(p, smooth, given, index):
    return given["end"].T
"""


@dataclass(frozen=True, eq=False)
class Flight:
    """Orbits of some entries from the section, for as long as their return is said to take."""

    table: Table
    Omega: Array
    smooth: bool
    start: Array  #: x and v
    time: Array

    @property
    def index(self) -> int:
        return _INDEX[self.table.kind]

    @property
    def inputs(self) -> tuple[Any, ...]:
        return self.table.p, self.Omega, self.smooth

    @cached_property
    def end(self) -> Array:
        """The state with its variations after that time."""
        step = of("FLIGHT_STEP") / (2 if self.smooth and self.table.kind == "near-heteroclinic" else 1)
        count = int(np.ceil(np.max(self.time) / step))
        state = of("section_state")(self.Omega, self.index, *self.start)
        for _ in range(count):
            state = of("flight_step")(of("variational_flow"), *self.inputs, state, self.time / count)
        return np.asarray(state)

    @property
    def missed(self) -> Array:
        """How far the end is from the section, and its image from the start."""
        image = (2 * self.index - 1) * (self.end[[1 - self.index, 2]] - [[np.pi / 2], [0]])
        section = self.end[self.index] - np.pi / 2 - 2 * np.pi * self.index
        return np.array([section, *(image - self.start)])

    @property
    def change(self) -> Array:
        """How that changes with x, v and Omega, but for x and v of the start, by entry."""
        rows = self.end[3:12].reshape(3, 3, -1)[[self.index, 1 - self.index, 2]]
        return np.moveaxis(rows * np.array([1, *[2 * self.index - 1] * 2])[:, None, None], 2, 0)

    def turning_point(self) -> Array:
        """The state with its variations where v first vanishes."""
        start = of("section_state")(self.Omega, self.index, *self.start)
        return np.asarray(of("fly_to")(of("variational_flow"), *self.inputs, start, lambda s: s[2])[1])

    def answers(self) -> dict[str, Array]:
        """All that is asked of these orbits, as if they closed; the extremes are those after the start's image."""
        parts, *names = of("SECTIONS")[self.index]
        start = of("section_state")(self.Omega, self.index, *self.start)[:3]
        image = np.pi * np.array([[[1], [1], [0]], [[0], [2], [0]]][self.index]) + (2 * self.index - 1) * start
        found: dict[str, Array] = {"period": parts * self.time, **dict(zip(names, self.start, strict=True))}
        found |= of("cycle_derivatives")(*self.inputs, self.index, self.end)
        found |= of("cycle_extremes")(*self.inputs, self.index, image)
        return found


def _flight(table: Table, values: Array) -> Flight:
    """From the states and periods among answers or truths."""
    parts, *names = of("SECTIONS")[_INDEX[table.kind]]
    start = np.array([column(table, name, values) for name in names])
    return Flight(table, table.given["Omega"], table.smooth, start, column(table, "period", values) / parts)


def _wrong(sheet: Sheet) -> set[str]:
    return {stem.split(" ")[1] for stem in sheet.stems[sheet.wrong]}


def cycle_causes(search: Search) -> list[Cause]:
    """The first of the mechanisms that gives all answers."""
    tables = (table for table in search.sheet.tables if table.kind != "rotation-fold" or table.wrong.any())
    sheet, also = Sheet(tuple(tables)), ""
    plain = all(table.kind in _INDEX for table in sheet.tables)
    if plain and (count := sum(int(_resting(table).sum()) for table in sheet.tables)):
        sheet = sheet.where(lambda table: np.flatnonzero(~_resting(table)))
        also = f"the cycles of {count} speed{'s' * (count > 1)} are the equilibrium: a shooting that fell onto it"
        if not sheet.wrong.any():
            return [Cause(also, 1, name="cycle")]
    with np.errstate(all="ignore"):
        for way in (connections,) if sheet.level == 8 else (_instants, _orbits) if plain else ():
            with suppress(np.linalg.LinAlgError):  # where answers are no states of a disk
                for says, results in way(sheet):
                    if _fits(sheet, results):
                        return [Cause(says + f"; {also}" * bool(also), 1, name="cycle")]
        return _slips(search, sheet) if plain and not also else []


def _resting(table: Table) -> Array:
    """Which entries' answers are the equilibrium."""
    mine, right = (_flight(table, values).start for values in (table.answer, table.truth))
    return np.asarray((np.abs(mine) < 1e-3 * np.abs(right)).all(axis=0))


def _fits(sheet: Sheet, results: Sequence[Results]) -> bool:
    picked = np.concatenate([table.picked(one) for table, one in zip(sheet.tables, results, strict=True)])
    return sheet.fits(np.where(np.isnan(picked), sheet.truth, picked))


def _instants(sheet: Sheet) -> Said:
    """Another instant of the right cycle for beta_max."""
    if _wrong(sheet) != {"beta_max"} or sheet.level == 10:
        return
    flights = [_flight(table, table.truth) for table in sheet.tables]
    at = [
        of("fly_to")(
            of("flow"), *f.inputs, of("section_state")(f.Omega, 0, *f.start)[:3], lambda s: s[1] - np.pi / 2, -1
        )
        for f in flights
    ]
    yield "beta_max is taken where gamma = pi/2, not where v = 0", [{"beta_max": np.pi / 2 - s[0]} for _, s in at]
    given = [column(table, "beta_max", table.answer) for table in sheet.tables]
    turns = [f.turning_point()[:3] for f in flights]
    short = [np.pi / 2 - turn[0] - one for turn, one in zip(turns, given, strict=True)]
    # beta is a parabola there, whose second derivative is v'.
    late = [np.sqrt(2 * one / of("flow")(*f.inputs, s)[2]) for f, s, one in zip(flights, turns, short, strict=True)]
    longest = max(float(np.nanmax(one)) for one in late)
    if np.concatenate(short).min() > -1e-9 and longest < _LATE and sheet.wrong.sum() > 3:
        text = f"beta_max is that of another instant, up to {1e3 * longest:.1g} ms from the turning point"
        yield f"{text}: that is not refined (the output's rows), or wrongly", [{"beta_max": one} for one in given]


# ------------------------------------------------------------------------------------------ states
def _orbits(sheet: Sheet) -> Said:
    """Answered states that are no cycle at the asked speed, or one by other equations."""
    asked = [np.unique(table.rows[table.wrong]) for table in sheet.tables]
    flights = [_flight(one := t.part(rows), one.answer) for t, rows in zip(sheet.tables, asked, strict=True)]
    moved = {"period", "gamma_bar_0", "v_0", "beta_bar_top", "v_top"} & _wrong(sheet)
    states = np.concatenate([[*f.start, f.time] for f in flights], axis=1)
    if len(_wrong(sheet)) < 3 or not moved or not (np.abs(states) < _LARGEST).all():
        return

    def spread(results: Sequence[Results]) -> list[Results]:
        """Of some entries to all; NaN elsewhere."""
        found: list[Results] = []
        for table, rows, result in zip(sheet.tables, asked, results, strict=True):
            found.append({name: np.full(len(table.entries), np.nan) for name in result})
            for name, values in result.items():
                found[-1][name][rows] = values
        return found

    missed = np.concatenate([f.missed for f in flights], axis=1)
    here = spread([f.answers() for f in flights])
    if np.abs(missed[0]).max() < _CLOSED:
        off = f"they come back off by up to {np.abs(missed[1:]).max():.1g}"
        yield f"{_EARLY}, or a guess was answered: the answered states are no cycles, {off}", here
    elif np.abs(missed[1:]).max() < _CLOSED:
        text = "gamma and v close, but beta = pi/2 is missed by up to"
        yield f"the time of return is not located within the step: {text} {np.abs(missed[0]).max():.1g} rad", here
    swapped = [replace(f, smooth=not f.smooth) for f in flights]
    if all(np.abs(f.missed).max() < _CLOSED for f in swapped):
        law = "smooth" if swapped[0].smooth else "linear"
        yield f"the cycles are those of the {law} friction law", spread([f.answers() for f in swapped])
    for says, some in chain(_speeds(flights), _stopped(flights)):
        yield says, spread(some)


def _stopped(flights: Sequence[Flight]) -> Said:
    """The states are those after Newton's last step, all else of those before it, which period and beta_max tell."""
    results, steps, sizes = [], [], []
    for flight in flights:
        deepest, f = column(flight.table, "beta_max", flight.table.answer), flight
        if flight.index or not np.isfinite(deepest).all():
            return
        for _ in range(5):
            low = f.turning_point()
            matrix = np.stack([f.change[:, 0, :2], -low[3:12].reshape(3, 3, -1)[0, :2].T], axis=1)
            off = np.column_stack([f.missed[0], np.pi / 2 - low[0] - deepest])
            step = -np.linalg.solve(matrix, off[:, :, None])[:, :, 0].T
            f = replace(f, start=f.start + step)
            if not 1e-9 < np.abs(step).max() < 1:
                break
        derivative = of("return_derivative")(*f.inputs, f.index, f.end)[1][:, :, :2]
        steps.append(np.linalg.solve(np.eye(2) - derivative, f.missed[1:].T[:, :, None])[:, :, 0].T)
        sizes.append(flight.start - f.start)
        results.append(f.answers())
    step, size = np.concatenate(steps, axis=1), np.concatenate(sizes, axis=1)
    share = round(float((step * size).sum() / (step * step).sum()), 2)
    for flight, result, move, by in zip(flights, results, steps, sizes, strict=True):
        result |= dict(zip(of("SECTIONS")[0][1:], flight.start - by + share * move, strict=True))
    text = f"{_EARLY}: the answered states are those after its last step" + f", taken {share:g} times" * (share != 1)
    text += f", of up to {np.abs(size).max():.1g}"
    yield f"{text}, all else is of the states before it, which are no cycles", results


def _speeds(flights: Sequence[Flight]) -> Said:
    """The speeds at which the answered states are cycles, if there are such; by the Gauss-Newton method."""
    found = []
    for flight in flights:
        table, name = flight.table, of("SECTIONS")[flight.index][1]
        slope, right = (column(table, one, table.truth) for one in (f"d{name}_domega", name))
        f = replace(flight, Omega=flight.Omega + np.clip(np.nan_to_num((flight.start[0] - right) / slope), -0.3, 0.3))
        last = 2.0
        for _ in range(8):
            by = f.change[:, :, 2].T
            step = -(by * f.missed).sum(axis=0) / (by * by).sum(axis=0)
            if not np.abs(step).max() < last:
                return
            last = float(np.abs(step).max()) + 1e-9
            f = replace(f, Omega=f.Omega + step)
            if np.abs(step).max() < 1e-11:
                break
        if not np.abs(f.missed).max() < _CLOSED:
            return
        found.append(f)
    yield _rule(found), [f.answers() for f in found]


def _rule(flights: Sequence[Flight]) -> str:
    """What was done to the speeds."""
    tables = [f.table for f in flights]
    asked = np.concatenate([table.given["Omega"] for table in tables])
    speeds = np.concatenate([f.Omega for f in flights])
    shift, near = speeds - asked, tables[0].level > 8
    origin = "Omega_h" if near else "Omega_crit"
    base = np.concatenate([known_speeds(table, origin) for table in tables])
    left = np.minimum(_SAME[near], 0.02 * np.abs(shift))
    says = "the cycles are right ones at Omega"

    def same(other: Any) -> bool:
        return bool((np.abs(other - speeds) <= left).all())

    for digits in range(9):
        size = 10.0**digits
        for text, done in (("rounded", np.round), ("cut off", np.floor), ("rounded up", np.ceil)):
            chance = np.minimum(1, 2 * left * size)
            if chance.prod() < _CHANCE and same(done(asked * size) / size):
                return f"{says} {text} to {digits} decimals"
            if chance.min() < _CHANCE and same(asked - base + done(base * size) / size):
                return f"{says} counted from {origin} {text} to {digits} decimals"
    if same(asked.astype(np.float32).astype(float)):
        return f"{says} in single precision"
    for text in _ORIGINS:
        if text != origin and same(asked - base + np.concatenate([known_speeds(table, text) for table in tables])):
            return f"{says} counted from {text} in place of {origin}"
    if len(shift) > 2 and np.ptp(shift) < _SAME[near]:
        about = (x for x in (30.92, 30.07) if np.abs(x - base - shift).max() < 0.002)
        which = next((f", about as if counted from {x} in place of {origin}" for x in about), "")
        return f"{says} {np.median(shift):+.6g} (as if counted from another {origin}{which})"
    some = ", ".join(f"{new:+.4g} from {old:.8g}" for new, old in list(zip(shift, asked, strict=True))[:3])
    some += " and so on" * (len(speeds) > 3)
    return f"the cycles are right ones at other speeds, {some}, or of parameters with which they are such"


# ------------------------------------------------------------------------------------------ multipliers and slopes
def _ways() -> tuple[Specimen, Specimen]:
    """With the state's own rates apart from those of its variations, which may be at another law."""
    client = specimen()
    together, apart = "[v, -Omega * cos(beta), v_rate]", "flow(p, Omega, smooth, state[:3])"
    flown = _FLOWN + client.text("variational_flow").replace(together, apart)
    return client.patched("known returns", _KINDS + _GIVEN), client.patched("known states", _KINDS + flown)


def _slips(search: Search, sheet: Sheet) -> list[Cause]:
    """What is made of the right cycles' return: changes of the client after the return, then on the way there."""
    asked = {"multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"}
    asked |= {f"d{name}_domega" for name in ("period", "gamma_bar_0", "v_0", "beta_bar_top", "v_top")}
    if not _wrong(sheet) <= asked:
        return []
    if lost := _lost(sheet):
        return [Cause(lost, 1, name="cycle")]
    tables = []
    for table in sheet.tables:
        f = _flight(table, table.truth)
        given = {**table.given, "x": f.start[0], "v": f.start[1], "end": f.end.T, "time": f.time}
        tables.append(replace(table, given=given).without(~np.isin(table.names, list(asked))))
    known, flown = _ways()
    rest = frozenset((*specimen().functions, *known.constants)) - {"cycle_derivatives", "return_derivative"}
    inner = Search(Sheet(tuple(tables)), search.advance, rest)
    found: list[Cause] = []
    for rank in (0, 1, 2):
        found = found or inner.causes((known,), (rank,))
    return found if found or sheet.level == 9 else _variations(flown, inner)  # flights near a saddle are long


def _variations(flown: Specimen, search: Search) -> list[Cause]:
    """A change of the variational equations, which is flown with long steps along the shortest cycle first."""
    table = search.tiny.tables[0]
    first = Sheet((table.part([int(np.argmin(table.given["time"]))]),))
    step = of("FLIGHT_STEP")
    for suspect, spot, change, program in all_changes(flown, "variational_flow", (0,)):
        program.space["FLIGHT_STEP"] = 2 * step
        if suspect.label.startswith(("delta", "(dv_rate")) and first.fits(program.answers(first), -1.0):
            program.space["FLIGHT_STEP"] = step
            if search.fits(program):
                return [suspect.cause(spot, change, program)]
    return []


def _lost(sheet: Sheet) -> str:
    """The smaller eigenvalue, which doubles do not hold."""
    tiny, fast = "multiplier_slow", "log_multiplier_fast"
    answers = {name: sheet.answer[np.char.endswith(sheet.stems, f" {name}")] for name in (tiny, fast)}
    if tiny in _wrong(sheet) and (np.abs(answers[tiny]) < 1e-9).all():
        return f"{tiny} is tiny: the smaller eigenvalue, or what rounding leaves of it, for the larger"
    logarithms = answers[fast] / (1 if sheet.level == 10 else 2)
    if _wrong(sheet) == {fast} and ((logarithms < -26) & (logarithms > -46)).all():
        text = f"{fast} is made of the matrix's smaller eigenvalue, which is lost to rounding"
        return f"{text}, not of the divergence's integral"
    return ""
