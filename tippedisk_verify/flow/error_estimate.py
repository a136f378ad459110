"""How far a run in doubles is off, and its numbers without that, from the defect of its series.

Up to twelve digits a run stays as the integrator gives it, and half-widths hold the error that its defect has led to.
Beyond, that error is added, and half-widths hold what is left of it. Both are derived in docs/error_of_a_run.md. Where
an error is too large for that, or decides whether an event is met, runs in wider arithmetic tell (`flow.comparison`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy

from tippedisk_verify.flow.contract import FLAT, ErrorEstimate, Event, EventRecord, Request, Result, Status
from tippedisk_verify.flow.defect import Defect
from tippedisk_verify.flow.start import ROUNDINGS
from tippedisk_verify.model.equations import shifted
from tippedisk_verify.model.measured import DISTANCES
from tippedisk_verify.model.precision import DOUBLE, EXTENDED, QUADRUPLE, Precision, companion

__all__ = ["CORRECTED_DIGITS", "EXTENDED_DIGITS", "PLAIN_DIGITS", "from_defect"]

#: Digits up to which a run in doubles is left as it is.
PLAIN_DIGITS = 12


class _Method(NamedTuple):
    """How the defect is evaluated and carried for so many digits."""

    digits: int
    wide: Precision
    nodes: int
    fewer: int  #: nodes of the second time, for what the number of nodes leaves out; 0: `_THREE_NODES` says that


_METHODS = (
    _Method(PLAIN_DIGITS, EXTENDED, 3, 0),
    _Method(PLAIN_DIGITS, EXTENDED, 8, 5),
    _Method(16, EXTENDED, 5, 3),
    _Method(20, QUADRUPLE, 10, 8),
    _Method(25, QUADRUPLE, 18, 16),
)
#: Digits up to which a run in doubles is enough, its error added.
CORRECTED_DIGITS = _METHODS[-1].digits
#: Digits up to which extended numbers carry the estimate, where the machine has them; else doubles take their place.
EXTENDED_DIGITS = max(method.digits for method in _METHODS if method.wide is EXTENDED)
#: A quarter more than the error that is left in a result, for whatever the estimate has in common with it.
_QUARTER_MORE = 1.25
#: What three nodes leave out, in carried roundings, where they are enough: each rate times the step is below this, what
#: grows does so by less than this, and the last terms of the polynomials are below this, in parts of the state.
_THREE_NODES = 1 / 16
_SHORT, _STEADY, _LAST_TERM = 7.0, 1.0, 2.0**-55
#: Rates times steps up to which two numbers of nodes differ by what they are off, where errors decay. Where they grow
#: it is the smaller number of nodes: five of them follow growth by e^5 to a thirtieth.
_LONG = 64.0
#: What the evaluation of the defect leaves, in carried roundings of the wider arithmetic.
_EVALUATION = 16
#: Errors [rad, rad/s] from which on their squares may be more than a hundredth of a rounding, for second derivatives of
#: the field of up to 1e5.
_SQUARES = 1e-11
_MOST_SWEEPS = 4
_DOUBLES = 2.0**-48  #: of an error, and at least of a carried rounding: what errors in doubles leave
_MOST_BYTES = 2**29  #: of the collocation's matrices
_NEWTON_STEPS = 8  #: for a crossing: two do as a rule, because each has the gradient to nine digits
_DIFFERENCE = 2.0**-20  #: of the state, for an event's gradient
_AHEAD = 1e-6  #: s, for how an event's rate changes
_NEARLY, _TOUCHED = 1 / 8, 1 / 64  #: of an event's function nearby: what may be a touch, and what is one
_FINER = 65  #: places between three nodes
_BESIDE = 1.25  #: of the distance to a neighbour: a parabola is a little off
_SMALL = 2.0**-10  #: of a carried rounding, or of an error: what is of the next order
_LARGE = 2.0**-6  #: [rad, rad/s] an error for which no sweep is tried


class Unresolved(ArithmeticError):
    """The steps are too long for the nodes, or too many."""


class NotInProportion(ArithmeticError):
    """The error is too large, or an event too close to a mere touch, for a first-order estimate."""


def from_defect(request: Request, result: Result) -> Result | None:
    """The result with half-widths, and to as many digits as the request has; None where the defect cannot tell."""
    if not request.estimated_by_defect or not result.status.usable or not result.steps:
        return None
    for method in _METHODS:
        if request.digits <= method.digits and _has(method.wide):
            try:
                refined = _refined(request, result, method)
            except Unresolved:
                continue
            except NotInProportion:
                return None
            if request.digits <= PLAIN_DIGITS:
                return refined
            if _reached(request.digits, refined):
                return refined._replace(precision=method.wide)
    return None


def _has(wide: Precision) -> bool:
    """Whether this machine computes with arrays of these numbers."""
    return wide in (companion(DOUBLE), companion(companion(DOUBLE)))


def _reached(digits: int, result: Result) -> bool:
    """Whether every half-width is at most a unit in the last of these digits, of the number or of 1."""
    assert result.error is not None
    times = numpy.array([float(record.time) for record in result.events])
    pairs = [(result.state, result.error.state), (times, numpy.array(result.error.events))]
    if result.samples is not None:
        pairs.append((result.samples, result.error.samples))
    unit = 10.0 ** (1 - digits)
    return all((widths <= unit * numpy.maximum(1, abs(values.astype(float)))).all() for values, widths in pairs)


def _refined(request: Request, result: Result, method: _Method) -> Result:
    run = _Run(request, result, method)
    times = numpy.empty(0) if request.times is None else method.wide.sequence(request.times)
    reached = times[abs(times.astype(float)) <= abs(result.time)]
    crossings = [run.crossing(record) for record in result.events]
    ended = result.status is not Status.REACHED
    last = crossings[-1].time if ended else run.wide.array([request.duration])
    run.check_missed(last, result)
    order = abs(numpy.concatenate([crossing.time for crossing in crossings] + [last]))
    if (order[1:] < order[:-1]).any():
        raise NotInProportion
    values, widths = run.numbers(numpy.concatenate((reached, last)), result.state)
    if ended:  # the state moves on with the time of the event
        widths[:, -1] += crossings[-1].moves
    return result._replace(
        time=result.time if run.uncorrected else last[0],
        state=values[:, -1],
        samples=None if request.times is None else values[:, :-1].T,
        events=result.events if run.uncorrected else tuple(crossing.record for crossing in crossings),
        error=ErrorEstimate(
            state=widths[:, -1],
            time=crossings[-1].width if ended else 0.0,
            samples=None if request.times is None else widths[:, :-1].T,
            events=tuple(crossing.width for crossing in crossings),
            event_states=tuple(crossing.widths for crossing in crossings),
        ),
    )


class _Crossing(NamedTuple):
    """Where the true motion crosses the surface of an event."""

    record: EventRecord  #: in wide arithmetic
    time: Any  #: (1,) in wide arithmetic [s]
    width: float  #: of the time that the run has, or of this one beyond twelve digits [s]
    widths: Any  #: (3,) of the state, likewise
    moves: Any  #: (3,) by how much the state moves in the half-width of the time


class _Run:
    """One run with the error that its defect has led to."""

    def __init__(self, request: Request, result: Result, method: _Method) -> None:
        self.wide, self.uncorrected = method.wide, request.digits <= PLAIN_DIGITS
        self._request = request
        self._ops = shifted(numpy) if request.shifted else numpy
        self._constants, self._omega = request.parameters.at(self.wide), self.wide.number(request.omega)
        if result.steps * (3 * method.nodes) ** 2 * 8 > _MOST_BYTES:
            raise Unresolved
        self._defect = Defect(request, result.series, self.wide, method.nodes)
        if not self._resolved(method.fewer):
            raise Unresolved
        #: What the errors may be off, in carried roundings.
        self._share = _EVALUATION * 2.0 ** (DOUBLE.bits - self.wide.bits) + self._swept()
        if method.fewer:
            self._defect.compare(Defect(request, result.series, self.wide, method.fewer))
        else:
            self._share += _THREE_NODES

    def _resolved(self, fewer: int) -> bool:
        """Whether the steps are short enough for the nodes, and for what is said of their number to hold."""
        defect = self._defect
        if fewer:
            return defect.fastest < _LONG and defect.growing < fewer
        return defect.fastest < _SHORT and defect.growing < _STEADY and defect.last_term < _LAST_TERM

    def _swept(self) -> float:
        """Correct the errors by what is of second order, and say what may be left, in carried roundings."""
        largest = float(abs(self._defect.errors).max())
        if not largest < _LARGE:
            raise NotInProportion
        if self.wide is EXTENDED and largest < _SQUARES:
            return 0.0
        for _ in range(_MOST_SWEEPS):
            # Each sweep leaves as much of its correction as the first one was of the error.
            change = self._defect.sweep()
            if change < _SMALL:
                largest = float((abs(self._defect.errors[1:]) / self._defect.roundings[1:]).max())
                return DISTANCES * max(change * _SMALL, _DOUBLES, _DOUBLES * largest)
        raise NotInProportion

    def numbers(self, times: Any, at_end: Any) -> tuple[Any, Any]:
        """The states (3, k) at these times, of which the last is where the result has ``at_end``, and half-widths."""
        places, errors, left = self._at(times)
        # A time is rounded to the wide arithmetic.
        left = left + abs(self._defect.rates(places) * times).astype(float) * float(self.wide.epsilon)
        values = places.astype(float) if self.uncorrected else places + errors
        if self.uncorrected:
            values[:, -1] = at_end
        return values, self._half_widths(values, (places - values).astype(float) + errors, left)

    def _half_widths(self, values: Any, off: Any, left: Any) -> Any:
        """Of values that are ``off`` by so much and a rest that is ``left``; beyond twelve digits only by that."""
        if self.uncorrected:
            return _QUARTER_MORE * abs(off) + left
        return left + abs(values).astype(float) * float(self.wide.epsilon)

    def _at(self, times: Any) -> tuple[Any, Any, Any]:
        """Polynomials, errors, and what the errors may be off, (3, k) at wide times (k,)."""
        places, errors, roundings, nodes = self._defect.at(times)
        return places, errors, self._left(roundings, nodes)

    def _left(self, roundings: Any, nodes: Any) -> Any:
        return self._share * roundings + DISTANCES * nodes

    def crossing(self, record: EventRecord) -> _Crossing:
        """A recorded crossing of the true motion. Raises NotInProportion for what is nearly a mere touch."""
        event = next(event for event in (*self._request.events, FLAT) if event.name == record.name)
        first = time = self.wide.array([record.time])
        for _ in range(_NEWTON_STEPS):
            places, errors, left = self._at(time)
            states = places + errors
            gradient, speed = self._rates(event, states)
            change = self._value(event, states) / self.wide.number(speed)
            unknown = float(abs(gradient) @ left[:, 0]) / abs(speed) + abs(record.time) * float(self.wide.epsilon)
            time = time - change
            if abs(float(change)) <= _SMALL * unknown:
                break
        else:
            raise NotInProportion
        moved = abs(float((time - first)[0]))
        rates = self._defect.rates(states)
        ahead = self._rates(event, states + rates * self.wide.array([_AHEAD]))[1]
        if not (moved + unknown) * abs(ahead - speed) / _AHEAD < _SMALL * abs(speed):
            raise NotInProportion
        around = [self._value(event, states + rates * self.wide.array([w])) for w in (-unknown, unknown)]
        if not float(around[0]) * float(around[1]) < 0 and all(map(float, around)):
            raise NotInProportion
        width = _QUARTER_MORE * moved + unknown if self.uncorrected else unknown
        moves = abs(rates[:, 0].astype(float)) * unknown
        off = (states - self.wide.array(record.state)[:, None]).astype(float)
        widths = self._half_widths(states, off, left)[:, 0] + moves
        return _Crossing(EventRecord(record.name, time[0], states[:, 0]), time, width, widths, moves)

    def _value(self, event: Event, states: Any) -> Any:
        """An event's function at a wide state (3, 1)."""
        return event.function(self._ops, self._constants, self._omega, *states[:, 0])

    def _rates(self, event: Event, states: Any) -> tuple[Any, float]:
        """The gradient (3,) of an event's function at a wide state (3, 1), and how fast it changes along the motion."""
        gradient = self._gradient(event, states.astype(float))[:, 0]
        speed = float(gradient @ self._defect.rates(states)[:, 0].astype(float))
        if not speed:
            raise NotInProportion
        return gradient, speed

    def _gradient(self, event: Event, states: Any) -> Any:
        """(3, k), by central differences."""
        moves = _DIFFERENCE * numpy.eye(3)[:, :, None]
        rows = [self._in_doubles(event, states + move) - self._in_doubles(event, states - move) for move in moves]
        return numpy.stack(rows) / (2 * _DIFFERENCE)

    def _in_doubles(self, event: Event, states: Any) -> Any:
        """(k,) an event's function in doubles."""
        constants, omega = self._request.parameters.at(DOUBLE), float(self._omega)
        return event.function(self._ops, constants, omega, *states) + numpy.zeros(states.shape[1])

    def check_missed(self, last: Any, result: Result) -> None:
        """Raises NotInProportion where errors decide whether an event is met at all.

        That is where its function is no larger than its error, at a node or at the ``last`` time, which has an error of
        its own, or comes close to zero without changing its sign. The parabola through three nodes tells, and where
        that is close to zero, one through more.
        """
        times, *at_nodes = self._defect.at_nodes()
        start = 0 * last
        at_start, at_end = self._defect.at(start), self._defect.at(last)
        states, errors, roundings, nodes = (
            numpy.concatenate(parts, axis=1) for parts in zip(at_start, at_nodes, at_end, strict=True)
        )
        times = numpy.concatenate((start.astype(float), times, last.astype(float)))
        states, reach = states.astype(float), abs(errors) + self._left(roundings, nodes)
        reach[:, -1:] += abs((self._defect.rates(at_end[0]) * (last - self.wide.number(result.time))).astype(float))
        ending = None if result.status is Status.REACHED else result.events[-1].name
        for event in [*self._request.events, *([FLAT] if self._request.domain == "event" else [])]:
            values = self._in_doubles(event, states)
            lost = abs(values) <= DISTANCES * (abs(self._gradient(event, states)) * reach).sum(axis=0)
            first = int(lost[0] or abs(values[0]) <= ROUNDINGS * 2.0**-52)  # a start on the surface is no crossing
            end = -1 if event.name == ending else None
            signs = numpy.sign(values[first:end])
            turns = numpy.diff(signs) * (1 if times[-1] >= 0 else -1) / 2
            turned = numpy.count_nonzero(turns * event.direction > 0 if event.direction else turns)
            named = sum(record.name == event.name for record in result.events) - (event.name == ending)
            if lost[1:end].any() or turned != named:
                raise NotInProportion
            for k in _touching(times, values, _NEARLY):
                inside = numpy.linspace(times[k - 1], times[k + 1], _FINER)
                finer = self._in_doubles(event, self._defect.at(inside.astype(self.wide.type))[0].astype(float))
                if len(_touching(inside, finer, _TOUCHED)):
                    raise NotInProportion


def _touching(times: Any, values: Any, share: float) -> Any:
    """Where the parabola through three neighbours of one sign turns back next to zero, by a share of the largest."""
    before, middle, after = values[:-2], values[1:-1], values[2:]
    left, right = times[1:-1] - times[:-2], times[2:] - times[1:-1]
    rise, fall = (middle - before) / left, (after - middle) / right
    bend = (fall - rise) / (left + right)
    slope = rise + bend * left
    with numpy.errstate(divide="ignore", invalid="ignore"):
        to_turn = -slope / (2 * bend)
        turn = middle + to_turn * slope / 2
    among = (to_turn / left >= -_BESIDE) & (to_turn / right <= _BESIDE)
    near_zero = turn * numpy.sign(middle) < share * numpy.maximum(abs(before), abs(after))
    return numpy.flatnonzero((before * middle > 0) & (middle * after > 0) & among & near_zero) + 1
