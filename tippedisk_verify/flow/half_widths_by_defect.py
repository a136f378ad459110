"""The half-widths of a motion in doubles: end, samples and events, from its defect.

Up to twelve digits a run stays as the integrator gives it. Its half-widths hold the error that its
defect has caused. Beyond twelve digits that error is added to the numbers, and half-widths hold the
remaining error. Both are derived in docs/error_of_a_run.md. Where an error is too large for this
method, or decides whether an event is met, runs in wider arithmetic decide
(`flow.half_widths_by_wider_run`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy

from tippedisk_verify.flow.contract import (
    CORRECTED_DIGITS,
    EXTENDED_DIGITS,
    FLAT,
    ErrorEstimate,
    Event,
    EventRecord,
    Request,
    Result,
    Status,
)
from tippedisk_verify.flow.defect import Defect
from tippedisk_verify.flow.start import SURFACE_ROUNDINGS, Start
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    DOUBLE_DIGITS,
    EXTENDED,
    QUADRUPLE,
    Precision,
    wider_precision,
)

__all__ = ["half_widths_from_defect"]


class _DefectMethod(NamedTuple):
    """A method of the error estimate: the arithmetic and the collocation nodes with which the
    defect is evaluated, up to a number of digits.
    """

    digits: int
    wide_precision: Precision
    nodes: int
    #: The nodes of a second evaluation, which measures the error of the first. 0 means that
    #: `_THREE_NODE_ERROR` bounds it.
    fewer_nodes: int


_METHODS = (
    _DefectMethod(DOUBLE_DIGITS, EXTENDED, 3, 0),
    _DefectMethod(DOUBLE_DIGITS, EXTENDED, 8, 5),
    _DefectMethod(EXTENDED_DIGITS, EXTENDED, 5, 3),
    _DefectMethod(20, QUADRUPLE, 10, 8),
    _DefectMethod(CORRECTED_DIGITS, QUADRUPLE, 18, 16),
)

# A half-width is this multiple of the error left in a result. The additional quarter covers errors
# that the estimate shares with the result.
_HALF_WIDTH_MARGIN = 1.25
# The error that three nodes may leave, in carried roundings. It is so small where the next three
# limits hold.
_THREE_NODE_ERROR = 1 / 16
# For three nodes: each rate of decay times the step is below this.
_THREE_NODE_MAX_DECAY = 7.0
# For three nodes: each rate of growth times the step is below this.
_THREE_NODE_MAX_GROWTH = 1.0
# For three nodes: the last terms of the step's polynomials are below this, as a fraction of the
# state.
_THREE_NODE_MAX_LAST_TERM = 2.0**-55
# The rate of decay times the step up to which two numbers of nodes differ by their errors. Where
# errors grow, the smaller number of nodes decides: over a step in which errors grow by e^5, five
# nodes are wrong by a thirtieth.
_MAX_DECAY = 64.0
# The error of evaluating the defect, in carried roundings of the wider arithmetic.
_EVALUATION_ERROR = 16
# The error [rad, rad/s] above which its square may exceed a hundredth of a rounding. The field's
# second derivatives are at most 1e5.
_MAX_FIRST_ORDER_ERROR = 1e-11
# The number of sweeps for the second order of an error. Each gains as many digits as the error has
# below 1.
_MAX_SWEEPS = 4
# The rounding of errors that are kept in doubles, as a fraction of an error. At least this part of
# a carried rounding is left.
_DOUBLE_ROUNDING = 2.0**-48
# The largest size of the collocation's matrices. Longer runs go to a wider arithmetic.
_MAX_MATRIX_BYTES = 2**29
# The number of Newton steps for a crossing. Two usually suffice, because the gradient has nine
# digits.
_CROSSING_NEWTON_STEPS = 8
# The change of the state in the differences for an event's gradient, near the square root of
# rounding.
_GRADIENT_STEP = 2.0**-20
# The time [s] after which an event's rate is evaluated again, to measure its change.
_RATE_INTERVAL = 1e-6
# An extremum of an event's function below this part of its size nearby may be a touch.
_POSSIBLE_TOUCH_SHARE = 1 / 8
# An extremum below this part is a touch: wider runs then decide whether it is a crossing.
_TOUCH_SHARE = 1 / 64
# The number of places between three nodes at which an event's function is evaluated.
_TOUCH_SAMPLES = 65
# The distance at which an extremum may lie from a place, as a fraction of the distance to its
# neighbour. The extra quarter allows for the error of the parabola.
_MAX_EXTREMUM_DISTANCE = 1.25
# As a fraction of a carried rounding or an error: a quantity below this is of the next order.
_NEGLIGIBLE_SHARE = 2.0**-10
# The error [rad, rad/s] from which no sweep is tried, because the first order is a poor guess.
_MAX_ERROR_FOR_SWEEPS = 2.0**-6


class UnresolvedSteps(ArithmeticError):
    """The error of a run whose steps are too long for the collocation nodes, or too many for the
    memory.
    """


class FirstOrderFails(ArithmeticError):
    """The error of a run for which a first-order estimate fails: its error is too large, or an
    event is too close to a mere touch.
    """


def half_widths_from_defect(request: Request, result: Result) -> Result | None:
    """Return the result of a run with half-widths, from the run's defect, accurate to the digits
    that the request asks for.

    Args:
        request: The run, in doubles.
        result: Its result, with the series of its steps.

    Returns:
        The result, in wider arithmetic beyond twelve digits. None where the defect does not
        suffice.
    """
    if not request.estimated_by_defect or not result.status.usable or not result.steps:
        return None
    for method in _METHODS:
        if request.digits <= method.digits and _has_arrays_of(method.wide_precision):
            try:
                refined = _refine(request, result, method)
            except UnresolvedSteps:
                continue
            except FirstOrderFails:
                return None
            if request.digits <= DOUBLE_DIGITS:
                return refined
            if _reaches_digits(request.digits, refined):
                return refined._replace(precision=method.wide_precision)
    return None


def _has_arrays_of(wide: Precision) -> bool:
    """Return True if this machine can compute with arrays of numbers of the precision ``wide``."""
    return wide in (wider_precision(DOUBLE), wider_precision(wider_precision(DOUBLE)))


def _reaches_digits(digits: int, result: Result) -> bool:
    """Return True if every half-width of a result is at most one unit in the last of ``digits``
    digits.

    The digits count from the number itself, or from 1 if it is smaller.
    """
    assert result.error is not None
    times = numpy.array([float(record.time) for record in result.events])
    pairs = [(result.state, result.error.state), (times, numpy.array(result.error.events))]
    if result.samples is not None:
        pairs.append((result.samples, result.error.samples))
    unit = 10.0 ** (1 - digits)
    return all(
        (widths <= unit * numpy.maximum(1, abs(values.astype(float)))).all()
        for values, widths in pairs
    )


def _refine(request: Request, result: Result, method: _DefectMethod) -> Result:
    run = _RunWithError(request, result, method)
    times = (
        numpy.empty(0) if request.times is None else method.wide_precision.as_array(request.times)
    )
    reached = times[abs(times.astype(float)) <= abs(result.time)]
    crossings = [run.crossing(record) for record in result.events]
    ended = result.status is not Status.REACHED
    last = crossings[-1].time if ended else run.wide_precision.array([request.duration])
    run.check_missed_events(last, result)
    order = abs(numpy.concatenate([crossing.time for crossing in crossings] + [last]))
    if (order[1:] < order[:-1]).any():
        raise FirstOrderFails
    values, widths = run.numbers(numpy.concatenate((reached, last)), result.state)
    if ended:  # the state moves on with the time of the event
        widths[:, -1] += crossings[-1].state_motion
    return result._replace(
        time=result.time if run.uncorrected else last[0],
        state=values[:, -1],
        samples=None if request.times is None else values[:, :-1].T,
        events=result.events
        if run.uncorrected
        else tuple(crossing.record for crossing in crossings),
        error=ErrorEstimate(
            state=widths[:, -1],
            time=crossings[-1].time_half_width if ended else 0.0,
            samples=None if request.times is None else widths[:, :-1].T,
            events=tuple(crossing.time_half_width for crossing in crossings),
            event_states=tuple(crossing.state_half_widths for crossing in crossings),
        ),
    )


class _CrossingWithError(NamedTuple):
    """A crossing of an event's surface by the true motion, corrected for the run's error."""

    record: EventRecord  #: in wide arithmetic
    time: Any  #: (1,) in wide arithmetic [s]
    time_half_width: float  #: [s] of the run's time, or beyond twelve digits of this time
    state_half_widths: Any  #: (3,) of the state, likewise
    state_motion: Any  #: (3,) the motion of the state within the half-width of the time


class _RunWithError:
    """A run in doubles with its estimated error, from the defect of its polynomials."""

    def __init__(self, request: Request, result: Result, method: _DefectMethod) -> None:
        self.wide_precision, self.uncorrected = (
            method.wide_precision,
            request.digits <= DOUBLE_DIGITS,
        )
        self._request = request
        self._start = start = Start.of(request, self.wide_precision)
        self._start_in_doubles = start._replace(
            constants=request.parameters.constants_in(DOUBLE), omega=float(start.omega)
        )
        if result.steps * (3 * method.nodes) ** 2 * 8 > _MAX_MATRIX_BYTES:
            raise UnresolvedSteps
        self._defect = Defect(request, result.series, self.wide_precision, method.nodes)
        if not self._steps_are_short(method.fewer_nodes):
            raise UnresolvedSteps
        self._defect.uncertainty_in_roundings = (
            _EVALUATION_ERROR * 2.0 ** (DOUBLE.bits - self.wide_precision.bits)
            + self._correct_to_second_order()
        )
        if method.fewer_nodes:
            self._defect.measure_collocation_error(
                Defect(request, result.series, self.wide_precision, method.fewer_nodes)
            )
        else:
            self._defect.uncertainty_in_roundings += _THREE_NODE_ERROR

    def _steps_are_short(self, fewer_nodes: int) -> bool:
        """Return True if the run's steps are short enough for the method that estimates its error.

        Args:
            fewer_nodes: The number of collocation nodes of a second evaluation, which measures the
                error of the first. 0 if only one evaluation is made; then stricter limits hold.
        """
        defect = self._defect
        if fewer_nodes:
            return (
                defect.max_rate_times_step < _MAX_DECAY
                and defect.max_growth_times_step < fewer_nodes
            )
        return (
            defect.max_rate_times_step < _THREE_NODE_MAX_DECAY
            and defect.max_growth_times_step < _THREE_NODE_MAX_GROWTH
            and defect.last_term < _THREE_NODE_MAX_LAST_TERM
        )

    def _correct_to_second_order(self) -> float:
        """Correct the estimated errors of the run to second order, by sweeps of deferred
        correction.

        Returns:
            A bound of the error that is left, in carried roundings.

        Raises:
            FirstOrderFails: If the errors are too large for the sweeps.
        """
        largest = float(abs(self._defect.errors).max())
        if not largest < _MAX_ERROR_FOR_SWEEPS:
            raise FirstOrderFails
        if self.wide_precision is EXTENDED and largest < _MAX_FIRST_ORDER_ERROR:
            return 0.0
        for _ in range(_MAX_SWEEPS):
            # Each sweep leaves the same share of its correction as the first correction was of the
            # error.
            change = self._defect.sweep()
            if change < _NEGLIGIBLE_SHARE:
                largest = float((abs(self._defect.errors[1:]) / self._defect.roundings[1:]).max())
                return HALF_WIDTH_FACTOR * max(
                    change * _NEGLIGIBLE_SHARE,
                    _DOUBLE_ROUNDING,
                    _DOUBLE_ROUNDING * largest,
                )
        raise FirstOrderFails

    def numbers(self, times: Any, at_end: Any) -> tuple[Any, Any]:
        """Return the run's states at given times and their half-widths, both (3, k).

        Up to twelve digits the states are those of the run in doubles. Beyond, their estimated
        errors are added.

        Args:
            times: (k,) times [s] in the wide arithmetic; the last one is the run's end.
            at_end: The last state of the run, which replaces the polynomial's up to twelve digits.
        """
        states, errors, uncertainty = self._defect.evaluate_at(times)
        # A time is rounded to the wide arithmetic.
        uncertainty = uncertainty + abs(self._defect.rates(states) * times).astype(float) * float(
            self.wide_precision.epsilon
        )
        values = states.astype(float) if self.uncorrected else states + errors
        if self.uncorrected:
            values[:, -1] = at_end
        return values, self._half_widths(
            values, (states - values).astype(float) + errors, uncertainty
        )

    def _half_widths(self, values: Any, errors: Any, uncertainty: Any) -> Any:
        """Return half-widths of the run's values, from their estimated errors and the uncertainty
        of these.

        Up to twelve digits both count. Beyond, the error has been added to the values, so only the
        uncertainty and the last rounding count.

        Args:
            values: The values.
            errors: Their estimated errors.
            uncertainty: The uncertainty of these errors.
        """
        if self.uncorrected:
            return _HALF_WIDTH_MARGIN * abs(errors) + uncertainty
        return uncertainty + abs(values).astype(float) * float(self.wide_precision.epsilon)

    def crossing(self, record: EventRecord) -> _CrossingWithError:
        """Compute where the true motion crosses an event's surface, with half-widths, from the
        crossing that the run has recorded.

        Raises:
            FirstOrderFails: If the crossing is nearly a mere touch.
        """
        event = next(event for event in (*self._request.events, FLAT) if event.name == record.name)
        first = time = self.wide_precision.array([record.time])
        for _ in range(_CROSSING_NEWTON_STEPS):
            computed, errors, uncertainty = self._defect.evaluate_at(time)
            states = computed + errors
            gradient, speed = self._gradient_and_rate(event, states)
            value = self._start.event_value(event, states[:, 0])
            change = value / self.wide_precision.number(speed)
            unknown = float(abs(gradient) @ uncertainty[:, 0]) / abs(speed) + abs(
                record.time
            ) * float(self.wide_precision.epsilon)
            time = time - change
            if abs(float(change)) <= _NEGLIGIBLE_SHARE * unknown:
                break
        else:
            raise FirstOrderFails
        moved = abs(float((time - first)[0]))
        rates = self._defect.rates(states)
        ahead = self._gradient_and_rate(
            event, states + rates * self.wide_precision.array([_RATE_INTERVAL])
        )[1]
        if not (moved + unknown) * abs(ahead - speed) / _RATE_INTERVAL < _NEGLIGIBLE_SHARE * abs(
            speed
        ):
            raise FirstOrderFails
        around = [
            self._start.event_value(event, (states + rates * self.wide_precision.array([w]))[:, 0])
            for w in (-unknown, unknown)
        ]
        if not float(around[0]) * float(around[1]) < 0 and all(map(float, around)):
            raise FirstOrderFails
        width = _HALF_WIDTH_MARGIN * moved + unknown if self.uncorrected else unknown
        moves = abs(rates[:, 0].astype(float)) * unknown
        off = (states - self.wide_precision.array(record.state)[:, None]).astype(float)
        widths = self._half_widths(states, off, uncertainty)[:, 0] + moves
        return _CrossingWithError(
            EventRecord(record.name, time[0], states[:, 0]), time, width, widths, moves
        )

    def _gradient_and_rate(self, event: Event, states: Any) -> tuple[Any, float]:
        """Return the gradient (3,) of an event's function and its rate in time, at a state (3, 1)
        of the motion.
        """
        gradient = self._gradient(event, states.astype(float))[:, 0]
        speed = float(gradient @ self._defect.rates(states)[:, 0].astype(float))
        if not speed:
            raise FirstOrderFails
        return gradient, speed

    def _gradient(self, event: Event, states: Any) -> Any:
        """Return the gradient (3, k) of an event's function at k states, by central differences."""
        moves = _GRADIENT_STEP * numpy.eye(3)[:, :, None]
        rows = [
            self._event_values_in_doubles(event, states + move)
            - self._event_values_in_doubles(event, states - move)
            for move in moves
        ]
        return numpy.stack(rows) / (2 * _GRADIENT_STEP)

    def _event_values_in_doubles(self, event: Event, states: Any) -> Any:
        """Return the values (k,) of an event's function at k states, in doubles."""
        return self._start_in_doubles.event_value(event, states) + numpy.zeros(states.shape[1])

    def check_missed_events(self, last: Any, result: Result) -> None:
        """Raise FirstOrderFails if the run's errors decide whether an event is met at all.

        An event is in doubt in two cases. Its function is no larger than its error at a node or at
        the ``last`` time, which has an error of its own. Or the function comes close to zero
        without a change of sign. The parabola through three nodes shows this; where it comes close
        to zero, more places between the nodes are evaluated.
        """
        times, *at_nodes = self._defect.evaluate_at_nodes()
        ends = numpy.concatenate((0 * last, last))
        at_ends = self._defect.evaluate_at(ends)
        states, errors, uncertainty = (
            numpy.concatenate((of[:, :1], inside, of[:, 1:]), axis=1)
            for of, inside in zip(at_ends, at_nodes, strict=True)
        )
        times = numpy.concatenate(([0.0], times, last.astype(float)))
        states, reach = (
            states.astype(float),
            abs(errors) + uncertainty,
        )
        rates = self._defect.rates(at_ends[0][:, 1:])
        reach[:, -1:] += abs(
            (rates * (last - self.wide_precision.number(result.time))).astype(float)
        )
        ending = None if result.status is Status.REACHED else result.events[-1].name
        for event in [*self._request.events, *([FLAT] if self._request.domain == "event" else [])]:
            values = self._event_values_in_doubles(event, states)
            lost = abs(values) <= HALF_WIDTH_FACTOR * (
                abs(self._gradient(event, states)) * reach
            ).sum(axis=0)
            # A start on the surface is no crossing
            first = int(lost[0] or abs(values[0]) <= SURFACE_ROUNDINGS * 2.0**-52)
            end = -1 if event.name == ending else None
            signs = numpy.sign(values[first:end])
            turns = numpy.diff(signs) * (1 if times[-1] >= 0 else -1) / 2
            turned = numpy.count_nonzero(turns * event.direction > 0 if event.direction else turns)
            named = sum(record.name == event.name for record in result.events) - (
                event.name == ending
            )
            if lost[1:end].any() or turned != named:
                raise FirstOrderFails
            for k in _possible_touches(times, values, _POSSIBLE_TOUCH_SHARE):
                inside = numpy.linspace(times[k - 1], times[k + 1], _TOUCH_SAMPLES)
                finer = self._event_values_in_doubles(
                    event,
                    self._defect.evaluate_at(inside.astype(self.wide_precision.number_type))[
                        0
                    ].astype(float),
                )
                if len(_possible_touches(inside, finer, _TOUCH_SHARE)):
                    raise FirstOrderFails


def _possible_touches(times: Any, values: Any, share: float) -> Any:
    """Return the indices in a sequence of values at which it may touch zero between the values
    without changing sign.

    Each such value and its two neighbours have one sign, and the parabola through them has its
    extremum nearby. The extremum lies below ``share`` of the larger neighbour.
    """
    before, middle, after = values[:-2], values[1:-1], values[2:]
    left, right = times[1:-1] - times[:-2], times[2:] - times[1:-1]
    rise, fall = (middle - before) / left, (after - middle) / right
    bend = (fall - rise) / (left + right)
    slope = rise + bend * left
    with numpy.errstate(divide="ignore", invalid="ignore"):
        to_turn = -slope / (2 * bend)
        turn = middle + to_turn * slope / 2
    among = (to_turn / left >= -_MAX_EXTREMUM_DISTANCE) & (
        to_turn / right <= _MAX_EXTREMUM_DISTANCE
    )
    near_zero = turn * numpy.sign(middle) < share * numpy.maximum(abs(before), abs(after))
    return numpy.flatnonzero((before * middle > 0) & (middle * after > 0) & among & near_zero) + 1
