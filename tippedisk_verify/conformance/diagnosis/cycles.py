"""What is wrong with cycles: states that are none at the asked speed, and what was made of the return to the section.

Everything is flown and derived by the client's own functions. A cycle goes from its section to a return with the state
(x, v), after half a period for limit cycles and a whole one for rotating ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Results, Sheet, Table
from tippedisk_verify.conformance.diagnosis.inputs import INPUTS, known_speeds
from tippedisk_verify.conformance.diagnosis.search import Search, all_changes
from tippedisk_verify.conformance.diagnosis.specimen import Specimen, of, specimen
from tippedisk_verify.conformance.diagnosis.trees import Cause, Suspect, statements, values

__all__ = ["cycle_causes"]

Said = Iterator[tuple[str, Sequence[Results]]]  #: what is said, and what it predicts of each table; the rest is right
_INDEX = {"limit-cycle": 0, "near-heteroclinic": 0, "rotating-cycle": 1}  # of the section in the client
_CLOSED = 1e-6
_SAME = (2e-8, 1e-9)  # rad/s, of speeds: what digits leave, and next to Omega_h
_CHANCE = 1e-3  # that speeds are by accident what a rule makes of them
_LARGEST = 10.0  # s, rad or rad/s, of what may be the state and time of a return
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

    @property
    def begin(self) -> Array:
        """The state with its variations on the section."""
        return np.asarray(of("section_state")(self.Omega, self.index, *self.start))

    @cached_property
    def end(self) -> Array:
        """The state with its variations after that time."""
        step = of("FLIGHT_STEP") / (2 if self.smooth and self.table.kind == "near-heteroclinic" else 1)
        count = int(np.ceil(np.max(self.time) / step))
        state = self.begin
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
        return np.asarray(of("fly_to")(of("variational_flow"), *self.inputs, self.begin, lambda s: s[2])[1])

    def answers(self) -> dict[str, Array]:
        """All that is asked of these orbits, as if they closed."""
        found = of("cycle_answers")(*self.inputs, self.index, self.time, *self.start, self.end)
        # The extremes are those after the start's image, which the end is not where they do not close.
        image = np.pi * np.array([[[1], [1], [0]], [[0], [2], [0]]][self.index]) + (2 * self.index - 1) * self.begin[:3]
        return {**found, **of("cycle_extremes")(*self.inputs, self.index, image)}


def _flight(table: Table, values: Array) -> Flight:
    """From the states and periods among answers or truths."""
    parts, *names = of("SECTIONS")[_INDEX[table.kind]]
    start = np.array([table.column(name, values) for name in names])
    return Flight(table, table.given["Omega"], table.smooth, start, table.column("period", values) / parts)


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
            some = sheet if way is not _orbits else sheet.where(lambda table: table.rows[table.wrong])
            with suppress(np.linalg.LinAlgError):  # where answers are no states of a disk
                for says, results in way(some):
                    if _fits(some, results):
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
    fly = partial(of("fly_to"), of("flow"))
    at = [fly(*f.inputs, f.begin[:3], lambda s: s[1] - np.pi / 2, -1) for f in flights]
    yield "beta_max is taken where gamma = pi/2, not where v = 0", [{"beta_max": np.pi / 2 - s[0]} for _, s in at]
    given = [table.column("beta_max", table.answer) for table in sheet.tables]
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
    flights = [_flight(table, table.answer) for table in sheet.tables]
    moved = {"period", "gamma_bar_0", "v_0", "beta_bar_top", "v_top"} & _wrong(sheet)
    states = np.concatenate([[*f.start, f.time] for f in flights], axis=1)
    if len(_wrong(sheet)) < 3 or not moved or not (np.abs(states) < _LARGEST).all():
        return
    missed = np.concatenate([f.missed for f in flights], axis=1)
    if np.abs(missed[0]).max() < _CLOSED:
        off = f"the answered states are no cycles, they come back off by up to {np.abs(missed[1:]).max():.1g}"
        yield f"{_EARLY}, or a guess was answered: {off}", [f.answers() for f in flights]
    elif np.abs(missed[1:]).max() < _CLOSED:
        off = f"gamma and v close, but beta = pi/2 is missed by up to {np.abs(missed[0]).max():.1g} rad"
        yield f"the time of return is not located within the step: {off}", [f.answers() for f in flights]
    swapped = [replace(f, smooth=not f.smooth) for f in flights]
    if all(np.abs(f.missed).max() < _CLOSED for f in swapped):
        law = "smooth" if swapped[0].smooth else "linear"
        yield f"the cycles are those of the {law} friction law", [f.answers() for f in swapped]
    yield from chain(_speeds(flights), _stopped(flights))


def _stopped(flights: Sequence[Flight]) -> Said:
    """The states are those after Newton's last step, all else of those before it, which period and beta_max tell."""
    results, steps, sizes = [], [], []
    for flight in flights:
        deepest, f = flight.table.column("beta_max", flight.table.answer), flight
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
        slope, right = (table.column(one, table.truth) for one in (f"d{name}_domega", name))
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
    """What was done to the speeds, where a known change of inputs tells it."""
    tables = [f.table for f in flights]
    asked = np.concatenate([table.given["Omega"] for table in tables])
    speeds = np.concatenate([f.Omega for f in flights])
    shift, near = speeds - asked, tables[0].level > 8
    origin = "Omega_h" if near else "Omega_crit"
    base = np.concatenate([known_speeds(table, origin) for table in tables])
    left, says = np.minimum(_SAME[near], 0.02 * np.abs(shift)), "the cycles are right ones at Omega"
    rules: dict[str, Array] = {}
    for one in INPUTS:
        if one.says.startswith("Omega "):
            with suppress(KeyError):  # those that take other inputs
                rules[one.says.removeprefix("Omega")] = one.change({"Omega": asked})["Omega"]
                moved = asked - base + one.change({"Omega": base})["Omega"]
                rules[f" counted from {one.says.replace('Omega', origin)}"] = moved
    for text in _ORIGINS:
        there = np.concatenate([known_speeds(table, text) for table in tables])
        rules[f" counted from {text} in place of {origin}"] = asked - base + there
    for text, there in rules.items():
        if (left / np.abs(shift)).prod() < _CHANCE and (np.abs(there - speeds) <= left).all():
            return says + text
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
    function: Any = flown.functions["variational_flow"]
    found = (Suspect("variational_flow", *value, 0) for one in statements(function) for value in values(function, *one))
    suspects = (one for one in found if one.label.startswith(("delta", "(dv_rate")))
    for suspect, spot, change, program in all_changes(flown, suspects, (0,)):
        program.space["FLIGHT_STEP"] = 2 * step
        if first.fits(program.answers(first), -1.0):
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


# ------------------------------------------------------------------------------------------ the connection
_VALUES = ("lambda_u", "lambda_s", "lambda_ss")
_PLACES = ("Omega_h of the other law", "Omega_crit", "30.07", "30.92", "the fold of the rotating cycles")


def _eigenvalues(table: Table, Omega: Array, side: int = -1) -> dict[str, Array]:
    known = np.isfinite(Omega)
    values = of("sorted_eigenvalues")(of("linearisation")(table.p, np.where(known, Omega, 1.0), side)).real
    return dict(zip(_VALUES, np.where(known[:, None], values, np.nan).T, strict=True))


def connections(sheet: Sheet) -> Said:
    """Omega_h, and the eigenvalues at it or elsewhere."""
    tables = sheet.tables
    answers = [table.column("omega_h", table.answer) for table in tables]
    right = [known_speeds(table, "Omega_h") for table in tables]
    values = [_eigenvalues(table, one) for table, one in zip(tables, right, strict=True)]

    def at(speeds: Sequence[Array]) -> list[dict[str, Array]]:
        """With the eigenvalues at these speeds."""
        pairs = zip(tables, speeds, strict=True)
        return [_eigenvalues(table, one) | {"omega_h": one} for table, one in pairs]

    numbers = np.unique(np.round(np.concatenate(answers), 9))
    if numbers.size == 1 and numbers[0] == np.round(numbers[0], 3):
        paper = "the published value, or " * bool(numbers[0] == 30.07)
        text = f"omega_h is {numbers[0]:g}, {paper}an end of the interval that is searched: that does not hold Omega_h,"
        text += " or the orbits are judged wrongly (criterion, time, start)"
        yield f"{text}, with the eigenvalues at that speed", at(answers)
    named = {f"{name} in its place": [known_speeds(table, name) for table in tables] for name in _PLACES}
    for k in range(1, 7):
        named[f"rounded to {k} decimals, or by a scan with steps of 1e-{k}"] = [np.round(one, k) for one in right]
    for text, speeds in named.items():
        yield f"omega_h: {text}, with the eigenvalues at that speed", at(speeds)
        yield f"omega_h: {text}, with the right eigenvalues", [{"omega_h": one} for one in speeds]
        there = [_eigenvalues(table, one) for table, one in zip(tables, speeds, strict=True)]
        yield f"the saddle's eigenvalues are not at Omega_h but at {text.removesuffix(' in its place')}", there
    both = [_eigenvalues(table, one, 1) for table, one in zip(tables, right, strict=True)]
    yield "the eigenvalues are those of the other equilibrium, inverted spinning (real parts)", both
    trace = [{"lambda_ss": sum(one.values())} for one in values]
    yield "lambda_ss is the trace, d(v')/dv at the saddle", trace
    for name, less in (("e/(r - e)", 1), ("e/r", 0)):
        r_e = [table.p[:2] for table in tables]
        rolling = [one * np.sqrt(e / (r - less * e)) for (r, e), one in zip(r_e, right, strict=True)]
        text = f"lambda_u and lambda_s are +-Omega sqrt({name}), of order zero"
        yield text, [{"lambda_u": one, "lambda_s": -one} for one in rolling]
    if all(np.isfinite(one).all() for one in answers):
        off = np.concatenate(answers) - np.concatenate(right)
        if len(off) > 1 and np.ptp(off) < 1e-7:
            text = "another speed (the fold of the rotating cycles is some 0.04 below), or a shifted result"
            yield f"omega_h is off by {off[0]:+.4g} under both laws: {text}, with the eigenvalues there", at(answers)
        size = " and ".join(f"{one:+.2g} ({table.friction})" for one, table in zip(off, tables, strict=False))
        text = "the eigenvalues are those at the answered speed, so the search for Omega_h is wrong"
        how = "it ended too early, or its bracket, its start at the saddle or its criterion is coarse or wrong"
        yield f"omega_h is off by {size}, and {text}: {how}", at(answers)
