"""The motion that `Disk.integrate` computes: the request to an engine, with its defaults and named
events, and the solution from the engine's result, with notes on units and half-widths.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import (
    BETA_EXTREME,
    CORRECTED_DIGITS,
    EXTENDED_DIGITS,
    MAX_STEPS,
    SECTION,
    SLIDING_REVERSAL,
    STATE_VARIATIONS,
    Engine,
    ErrorEstimate,
    Event,
    EventRecord,
    Request,
    Result,
    Status,
)
from tippedisk_verify.flow.system import constant_derivatives
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.motion.solution import Derivative, Solution
from tippedisk_verify.motion.times import EvenTimes, since_start, span_of
from tippedisk_verify.numbers.arrays import half_widths_in_doubles, numpy_safe, round_to_doubles
from tippedisk_verify.numbers.exact import as_list, exact, short_text
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    DOUBLE_DIGITS,
    EXTENDED,
    Precision,
    bits_for_digits,
    checked_digits,
    precision_of_bits,
    wider_precision,
)

__all__ = ["EVENTS", "MotionRequest"]

_SAMPLES = 201  # the number of times if none are given
_MIN_DURATION = 1e-300  # s; in longer runs, even times differ as extended numbers
_LONG_DURATION = 60  # s; shorter motions are finished before progress would be shown
_MAX_ANGLE = 100  # rad; gamma of a rotating disk reaches it in a minute, degrees at once
# The variables of derivatives, by the names that callers give.
_VARIABLES: dict[str, tuple[str, ...]] = {
    "state": STATE_VARIATIONS,
    **{name: (name,) for name in ("omega", *SYMBOLS)},
}
#: The named events: each crossing is recorded, and the run goes on.
EVENTS = {
    name: replace(event, terminal=False)
    for name, event in (("section", SECTION), ("turn", BETA_EXTREME), ("surface", SLIDING_REVERSAL))
}


class MotionRequest:
    """A motion to integrate: the request to an engine, and how its result becomes a `Solution`.

    `Disk.integrate` defines the arguments.

    Raises:
        InputError: If an argument cannot be used.
    """

    def __init__(
        self,
        parameters: Parameters,
        omega: object,
        state: Sequence[object],
        time: object,
        engine: Engine,
        *,
        t_eval: Any = None,
        digits: int = 12,
        rtol: object = None,
        events: Event | str | Sequence[Event | str] = (),
        variations: str | Sequence[str] = (),
        shifted: bool = False,
        max_steps: int = MAX_STEPS,
        half_widths: bool = True,
    ) -> None:
        digits = checked_digits(digits)
        if rtol is not None and digits > DOUBLE_DIGITS:
            raise InputError("rtol is the tolerance of doubles: give either rtol or digits")
        self.engine = engine
        self._start, self._end = start, end = span_of(time)
        measured = half_widths and engine.measures_error
        corrected = measured and digits <= CORRECTED_DIGITS
        precision = (
            DOUBLE
            if corrected or digits <= DOUBLE_DIGITS
            else precision_of_bits(bits_for_digits(digits + 8))
        )
        times: Any = None
        self._times: Any = None  # exact, from time 0
        if t_eval is not None:
            self._times, times = since_start(start, end, as_list(t_eval))
        elif length := float(end - start):
            self._times = EvenTimes(start, end, _SAMPLES)
            extended = wider_precision(DOUBLE) == EXTENDED and digits <= EXTENDED_DIGITS
            quick = corrected and extended and abs(length) > _MIN_DURATION
            times = EvenTimes(exact(0), end - start, _SAMPLES)
            if quick:  # in the extended numbers of the error estimate
                steps = numpy.arange(_SAMPLES).astype(EXTENDED.number_type)
                times = steps * EXTENDED.number(end - start) / (_SAMPLES - 1)
            elif precision == DOUBLE and not measured:
                times = times.rounded(DOUBLE)
        self._variables = [
            variable for name in _as_sequence(variations) for variable in _named(name, _VARIABLES)
        ]
        slopes = constant_derivatives(parameters) if self._variables else {}
        self.request = Request(
            parameters,
            omega,
            state,
            end - start,
            shifted=shifted,
            precision=precision,
            tolerance=None if rtol is None else float(exact(rtol)),
            times=times,
            variations=tuple(
                dict.fromkeys(
                    constant for variable in self._variables for constant in slopes[variable]
                )
            ),
            events=tuple(
                event if isinstance(event, Event) else _named(event, EVENTS)
                for event in _as_sequence(events)
            ),
            error_estimate=measured,
            digits=digits if corrected else DOUBLE_DIGITS,
            max_steps=max_steps,
        )

    @property
    def is_long(self) -> bool:
        """True if the motion may take long enough for progress to be shown."""
        return abs(float(self._end - self._start)) > _LONG_DURATION

    def solution(self, result: Result) -> Solution:
        """Convert the engine's result to a `Solution`: samples that were reached, events, end and
        derivatives.

        Raises:
            InputError: If the disk does not stand at the start.
        """
        request = self.request
        if result.status is Status.FLAT and not result.time:
            angle = float(exact(request.state[0])) + math.pi / 2 * request.shifted
            raise InputError(f"beta lies between 0 and pi, where the disk stands, not at {angle:g}")
        precision = result.precision or request.precision
        error = result.error or ErrorEstimate(state=numpy.full(3, numpy.inf), time=numpy.inf)
        events = result.events
        if error.events:
            estimated = zip(events, error.events, error.event_states, strict=True)
            events = tuple(
                replace(record, time_uncertainty=time, uncertainty=state)
                for record, time, state in estimated
            )
        end = self._since_zero(
            EventRecord(
                result.status.name.lower(), result.time, result.state, error.time, error.state
            ),
            precision,
        )
        if result.status is Status.REACHED:
            rounded = precision.number(self._end)
            end = replace(end, time=rounded, time_uncertainty=2 * abs(float(self._end - rounded)))
        if result.samples is None:
            asked: Any = [self._end if result.status is Status.REACHED else exact(end.time)]
            times = precision.array([end.time])
            samples, uncertainty = result.state[None], error.state[None]
        else:
            asked, samples = self._times, result.samples
            if len(samples) < len(asked):
                asked = asked[: len(samples)]
            times = (
                asked.rounded(precision)
                if isinstance(asked, EvenTimes)
                else precision.as_array(asked)
            )
            uncertainty = (
                numpy.full(samples.shape, numpy.inf) if error.samples is None else error.samples
            )
        by = _derivatives(request, result, self._variables)
        start_columns = [by[name] for name in STATE_VARIATIONS if name in by]
        transition, transition_widths = (
            numpy.column_stack(columns) if start_columns else None
            for columns in (
                [slope.end for slope in start_columns],
                [slope.end_uncertainty for slope in start_columns],
            )
        )
        by_omega, by_omega_widths, *_ = by.get("omega", (None, None))
        return Solution(
            disk=request.parameters,
            omega=request.omega,
            t=numpy_safe(times),
            y=numpy_safe(samples.T),
            uncertainty=half_widths_in_doubles(uncertainty.T),
            status=result.status,
            end=end,
            events=tuple(self._since_zero(record, precision) for record in events),
            transition=transition,
            transition_uncertainty=transition_widths,
            by_omega=by_omega,
            by_omega_uncertainty=by_omega_widths,
            by=by,
            engine=self.engine.name,
            precision=precision.name,
            times=asked,
            note=_note(request),
            _event_names=tuple(event.name for event in request.events),
            _start=self._start,
            _end_time=self._end,
            _request=request,
            _engine=self.engine,
        )

    def _since_zero(self, record: EventRecord, precision: Precision) -> EventRecord:
        """Return a copy of an event's record, with its time counted from time 0 in place of the
        start.
        """
        record = replace(record, state=numpy_safe(record.state))
        if self._start == exact(0):
            return record
        time = precision.number(self._start + record.time)
        rounding = float(abs(time)) * float(precision.epsilon)
        return replace(record, time=time, time_uncertainty=record.time_uncertainty + rounding)


def _note(request: Request) -> str:
    """Return a warning about a motion's numbers for its message, or an empty text.

    It warns of numbers without half-widths, and of angles that may have been given in degrees.
    """
    unmeasured = "" if request.error_estimate else "without half-widths"
    state, shifted = request.state, request.shifted
    beta, gamma = (abs(float(exact(angle))) for angle in state[:2])
    if beta <= math.tau and gamma <= _MAX_ANGLE:
        return unmeasured
    name, value = ("beta", state[0]) if beta > math.tau else ("gamma", state[1])
    degrees = f"angles are in radians, and {name}{'_bar' if shifted else ''} = {short_text(value)} is many turns"
    return f"{degrees}; {unmeasured}" if unmeasured else degrees


def _as_sequence(names: Any) -> Any:
    return () if names is None else names if isinstance(names, tuple | list) else (names,)


def _named(name: object, names: dict[str, Any]) -> Any:
    if not isinstance(name, str) or name not in names:
        raise InputError(f"{short_text(name)} is not one of {', '.join(names)}")
    return names[name]


def _derivatives(
    request: Request, result: Result, variables: Sequence[str]
) -> dict[str, Derivative]:
    """Return the derivatives of a motion with respect to some variables, by name.

    They follow by the chain rule. The request's variations are the field's constants that the
    variables need. The chain rule's factors are exact.
    """
    precision, error = result.precision or request.precision, result.error

    def chained(row: Mapping[Any, Fraction], values: Any, estimated: Any) -> tuple[Any, Any]:
        """Return the derivative of a motion with respect to one variable by the chain rule, and its
        half-widths.

        It is the sum over the constants, along the last axis, of ``values`` times the factors of
        ``row``.
        """
        widths = numpy.full(values.shape, numpy.inf) if estimated is None else estimated
        columns = [request.variations.index(name) for name in row]
        factors = list(row.values())
        terms = [
            values[..., n] * precision.number(x) for n, x in zip(columns, factors, strict=True)
        ]
        # A factor 1 and a single term are not rounded.
        roundings = [len(row) - (factor == 1) for factor in factors]
        width = sum(
            half_widths_in_doubles(widths[..., n]) * abs(float(x)) * (1 + k * 2.0**-50)
            + k * float(precision.epsilon) * round_to_doubles(abs(term))
            for n, x, term, k in zip(columns, factors, terms, roundings, strict=True)
        )
        return numpy_safe(sum(terms[1:], terms[0])), width

    found = {}
    if result.derivatives is not None:
        slopes = constant_derivatives(request.parameters)
        for variable in variables:
            end = chained(slopes[variable], result.derivatives, error and error.derivatives)
            y, width = (numbers[:, None] for numbers in end)
            if result.sample_derivatives is not None:
                samples = result.sample_derivatives, error and error.sample_derivatives
                y, width = (numbers.T for numbers in chained(slopes[variable], *samples))
            found[variable] = Derivative(*end, y, width)
    return found
