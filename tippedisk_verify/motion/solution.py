"""The result of `Disk.integrate`: a motion in the form of SciPy's solutions, with half-widths."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import (
    MOST_STEPS,
    SECTION,
    SLIDING_REVERSAL,
    STATE_VARIATIONS,
    TURN,
    Engine,
    ErrorEstimate,
    Event,
    EventRecord,
    Request,
    Result,
    Status,
)
from tippedisk_verify.flow.error_estimate import CORRECTED_DIGITS, EXTENDED_DIGITS, PLAIN_DIGITS
from tippedisk_verify.flow.system import by_constants
from tippedisk_verify.model.arrays import doubles, half_widths, workable
from tippedisk_verify.model.decimals import at_place, decimal_magnitude, exact_decimals
from tippedisk_verify.model.exact import Exact, entries, exact, shown
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.model.precision import (
    DOUBLE,
    EXTENDED,
    Precision,
    bits,
    bits_for_digits,
    checked_digits,
    companion,
)
from tippedisk_verify.model.results import Printable, data_frame, with_widths
from tippedisk_verify.progress import progress_of

__all__ = ["EVENTS", "Derivative", "EvenTimes", "Solution", "integrated"]

_STATE = ("beta", "gamma", "v")
_SAMPLES = 201  # the number of times if none are given
_PLOTTED = 4001  # the number of times in a plot
_LATEST = 10**300  # s; doubles hold all times up to it
_SHORTEST = 1e-300  # s; in longer runs, even times differ as extended numbers
_LONG = 60  # s; shorter motions are finished before progress would be shown
_LARGEST_ANGLE = 100  # rad; gamma of a rotating disk reaches it in a minute, degrees at once
_CUT_DIGITS, _CUT_BITS = 50, 400  # of a time whose decimals never end, and of its enclosure
#: The variables of derivatives, by the names that callers give.
_VARIABLES: dict[str, tuple[str, ...]] = {
    "state": STATE_VARIATIONS,
    **{name: (name,) for name in ("omega", *SYMBOLS)},
}
#: The named events: each crossing is recorded, and the run goes on.
EVENTS = {
    name: replace(event, terminal=False)
    for name, event in (("section", SECTION), ("turn", TURN), ("surface", SLIDING_REVERSAL))
}


class Derivative(NamedTuple):
    """The derivative of a motion by one variable at fixed times, in SI units, with half-widths."""

    end: Any  #: (3,) of the end's beta, gamma [rad] and v [rad/s]
    end_uncertainty: Any  #: (3,)
    y: Any  #: (3, n) of the states, as in `Solution.y`
    uncertainty: Any  #: (3, n)


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Printable):
    """A motion, as `scipy.integrate.solve_ivp` returns it, with half-widths that hold the truth.

    - ``t`` (n,) [s] are the requested times that were reached, rounded once. ``times`` are the
      exact ones.
    - ``y`` (3, n) are the states at the exact times, with rows beta, gamma [rad] and v [rad/s].
    - ``uncertainty`` (3, n) are their half-widths, infinite where rounding decides how the run
      ends.
    - ``end`` is the end of the run. It lies before the final time if the disk lies flat or a
      terminal event ends the run, as ``status`` and ``message`` report.
    - ``events`` are the recorded crossings. Like ``end`` they have half-widths of their time and
      state.
    - ``by["mu"]`` is the derivative of the end and of the states by mu, a `Derivative`, if
      ``variations`` asked for it; likewise for omega, the other parameters, and the start's beta,
      gamma and v.
    - ``transition`` (3, 3) is the derivative of the end's state with respect to the start's, and
      ``by_omega`` (3,) [s] that with respect to the speed (rows as in ``y``). Both are taken at a
      fixed time, and are None unless ``variations`` asked for them.

    Up to 12 digits the numbers are doubles, up to 16 numpy.longdouble, and beyond that arrays of
    objects, heyoka's numbers: ``y.astype(float)`` rounds them to doubles.
    """

    disk: Parameters
    omega: object  #: [rad/s]
    t: Any
    y: Any
    uncertainty: Any
    status: Status
    end: EventRecord
    events: tuple[EventRecord, ...]
    transition: Any
    transition_uncertainty: Any
    by_omega: Any
    by_omega_uncertainty: Any
    by: Mapping[str, Derivative]
    engine: str
    precision: str
    times: Sequence[Exact]  #: the exact times that ``t`` rounds [s]
    note: str  #: a warning about the numbers, or an empty text
    _watched: tuple[str, ...]  #: the names of the requested events
    _start: Exact
    _final: Exact  #: the requested end of the run [s]
    _request: Request | None  #: None if the solution was loaded, as is the engine
    _engine: Engine | None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle or copy, without continuous output.

        The copy computes continuous output again, by a run that needs no events.
        """
        kept = {name: value for name, value in self.__dict__.items() if name != "_dense"}
        request = self._request and replace(self._request, events=(), times=None)
        return kept | {"_request": request}

    @property
    def success(self) -> bool:
        """True if the run ended as requested, or at the end of the model's domain."""
        return self.status.usable

    @property
    def message(self) -> str:
        """The end of the run in words, with any warning."""
        return f"{self.status.value}; {self.note}" if self.note else self.status.value

    @property
    def t_events(self) -> list[Any]:
        """The times (k,) [s] of the crossings of each requested event."""
        return [
            workable(numpy.array([record.time for record in self._of(name)]))
            for name in self._watched
        ]

    @property
    def y_events(self) -> list[Any]:
        """The states (k, 3) at the crossings of each requested event."""
        return [
            workable(numpy.array([record.state for record in self._of(name)]).reshape(-1, 3))
            for name in self._watched
        ]

    def _of(self, name: str) -> list[EventRecord]:
        return [record for record in self.events if record.name == name]

    @property
    def _run(self) -> tuple[Engine, Request]:
        if self._request is None or self._engine is None:
            raise InputError(
                "a loaded solution has its samples only: integrate again for other times"
            )
        return self._engine, self._request

    @cached_property
    def _dense(self) -> Any:
        engine, request = self._run
        result = engine(
            replace(request, dense=True, times=None, variations=(), error_estimate=False)
        )
        if result.dense is None:
            raise InputError(f"{self.engine} gives no continuous output")
        return result.dense

    def __call__(self, t: Any) -> Any:
        """Return the state (3,) at a time, or the states (3, n) at times (n,).

        They have the integrator's accuracy or the requested digits. The first call repeats the run
        with continuous output.

        Args:
            t: A time or times [s].

        Raises:
            InputError: A time lies outside the run, or the solution was loaded.
        """
        (engine, request), asked = self._run, entries(t)
        end = self._final if self.status is Status.REACHED else exact(self.end.time)
        _, times = _since(self._start, end, asked)
        since, length = DOUBLE.array(times), float(end - self._start)
        if (since * length < 0).any() or (abs(since) > abs(length)).any():
            first, last = sorted((float(self._start), float(end)))
            raise InputError(f"the solution is known from {first:.10g} s to {last:.10g} s")
        if request.digits > PLAIN_DIGITS:  # the error at each time is removed
            _, first_of, places = numpy.unique(abs(since), return_index=True, return_inverse=True)
            wanted = replace(request, times=[times[n] for n in first_of], events=(), variations=())
            states = engine(wanted).samples.T[:, places]
        else:
            states = self._dense(request.precision.array(times)).T
        states = workable(states)
        return states if numpy.ndim(t) else states[:, 0]

    def plot(self, axes: Any = None) -> Any:
        """Plot beta, gamma and v against the time, with the recorded events as dots.

        A loaded solution is plotted at its samples only.

        Args:
            axes: Three matplotlib axes; None for new ones, one below the other.

        Returns:
            The axes.
        """
        if axes is None:
            from matplotlib import pyplot

            _, axes = pyplot.subplots(3, sharex=True, layout="constrained")
        times, states = doubles(self.t), doubles(self.y)
        if self._request is not None and times.size:
            times = numpy.linspace(times[0], times[-1], _PLOTTED)
            states = doubles(self(times))
        moments = [float(event.time) for event in self.events]
        labels = ("β [rad]", "γ [rad]", "dβ/dt [rad/s]")
        for row, (axis, label) in enumerate(zip(axes, labels, strict=True)):
            axis.plot(times, states[row])
            axis.plot(moments, [float(event.state[row]) for event in self.events], ".")
            axis.set(ylabel=label)
        axes[-1].set(xlabel="t [s]")
        return axes

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the solution as JSON in which every number is exact; `tippedisk_verify.load` reads it.

        The file is described in `tippedisk_verify.model.saved`. Its keys are the attributes' names;
        ``t`` has the exact times. A loaded solution has its samples, events and derivatives, but no
        continuous output: ``solution(t)`` is refused.

        Args:
            path: The file.

        Returns:
            The path of the file written.

        Raises:
            InputError: The friction law is a user's own, a state is not finite, or the file cannot be
                written.
        """
        from tippedisk_verify.motion.saved import save_solution

        return save_solution(self, path)

    def to_dataframe(self) -> Any:
        """Return a pandas data frame of the samples, with the columns that `integrate --out` writes.

        They are ``t``, the rows of ``y`` as beta, gamma and v, and those of ``uncertainty`` as
        beta_uncertainty and so on.

        Raises:
            InputError: pandas is not installed.
        """
        widths = (f"{name}_uncertainty" for name in _STATE)
        names = ("t", *_STATE, *widths)
        return data_frame(dict(zip(names, (self.t, *self.y, *self.uncertainty), strict=True)))

    def to_dict(self) -> dict[str, Any]:
        """Return times and states with half-widths, the end, the events and the derivatives.

        The command line prints this data as JSON.
        """
        derivatives = (
            ("transition", self.transition, self.transition_uncertainty),
            ("by_omega", self.by_omega, self.by_omega_uncertainty),
        )
        return {
            "status": self.status.name.lower(),
            "message": self.message,
            "end": self._end_entries(),
            "t": [_decimal(time) for time in self.times],
            **dict(zip(_STATE, with_widths(self.y, self.uncertainty), strict=True)),
            "events": [event.to_dict() for event in self.events],
            **{
                name: with_widths(values, widths)
                for name, values, widths in derivatives
                if values is not None
            },
            "derivatives": {
                name: {
                    "end": with_widths(slope.end, slope.end_uncertainty),
                    **dict(zip(_STATE, with_widths(slope.y, slope.uncertainty), strict=True)),
                }
                for name, slope in self.by.items()
            },
        }

    def _end_entries(self) -> dict[str, Any]:
        """Return the end for JSON; the time is exact if the run reached it."""
        entries = {name: entry for name, entry in self.end.to_dict().items() if name != "name"}
        if self.status is Status.REACHED:
            entries["t"] = {"value": _decimal(self._final), "uncertainty": "0"}
        return entries


def integrated(
    parameters: Parameters,
    omega: object,
    state: Sequence[object],
    time: object,
    t_eval: Any,
    digits: int,
    events: Event | str | Sequence[Event | str],
    engine: Engine,
    variations: str | Sequence[str] = (),
    shifted: bool = False,
    max_steps: int = MOST_STEPS,
    progress: bool | None = None,
    half_widths: bool = True,
) -> Solution:
    """Integrate a motion; see `Disk.integrate`, which defines the arguments."""
    start, end = _span(time)
    measured = half_widths and engine.measures_error
    corrected = checked_digits(digits) <= CORRECTED_DIGITS if measured else False
    precision = DOUBLE if corrected or digits <= PLAIN_DIGITS else bits(bits_for_digits(digits + 8))
    asked: Sequence[Exact] | None = None
    times: Any = None
    if t_eval is not None:
        asked, times = _since(start, end, entries(t_eval))
    elif length := float(end - start):
        asked = EvenTimes(start, end, _SAMPLES)
        extended = companion(DOUBLE) == EXTENDED and digits <= EXTENDED_DIGITS
        quick = corrected and extended and abs(length) > _SHORTEST
        times = EvenTimes(exact(0), end - start, _SAMPLES)
        if quick:
            times = _rounded_even_times(end - start)
        elif precision == DOUBLE and not measured:
            times = times.rounded(DOUBLE)
    variables = [variable for name in _several(variations) for variable in _named(name, _VARIABLES)]
    slopes = by_constants(parameters)
    request = Request(
        parameters,
        omega,
        state,
        end - start,
        shifted=shifted,
        precision=precision,
        times=times,
        variations=tuple(
            dict.fromkeys(constant for variable in variables for constant in slopes[variable])
        ),
        events=tuple(
            event if isinstance(event, Event) else _named(event, EVENTS)
            for event in _several(events)
        ),
        error_estimate=measured,
        digits=digits if corrected else PLAIN_DIGITS,
        max_steps=max_steps,
    )
    with progress_of(progress=progress if abs(float(end - start)) > _LONG else False) as advance:
        advance("motion", 0)
        result = engine(request)
    if result.status is Status.FLAT and not result.time:
        angle = float(exact(state[0])) + math.pi / 2 * shifted
        raise InputError(f"beta lies between 0 and pi, where the disk stands, not at {angle:g}")
    return _solution(request, result, engine, start, end, asked, variables)


class EvenTimes(Sequence[Exact]):
    """Evenly spaced times [s] from a start to an end, both included.

    Each exact time is computed when it is accessed.

    Args:
        start: The first time [s].
        end: The last time [s].
        count: The number of times, at least 2.
    """

    def __init__(self, start: Exact, end: Exact, count: int) -> None:
        self._start, self._step, self._count = start, (end - start) * Fraction(1, count - 1), count

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> Exact: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Exact, ...]: ...
    def __getitem__(self, index: int | slice) -> Exact | tuple[Exact, ...]:
        numbers = range(self._count)[index]
        if isinstance(numbers, range):
            return tuple(self._start + self._step * number for number in numbers)
        return self._start + self._step * numbers

    def rounded(self, precision: Precision) -> Any:
        """Return the times (n,), each rounded once.

        Args:
            precision: The arithmetic.
        """
        if precision != DOUBLE or self._start.pi_multiple or self._step.pi_multiple:
            return precision.sequence(tuple(self))
        start, step = self._start.rational, self._step.rational
        denominator = math.lcm(start.denominator, step.denominator)
        first, more = (int(number * denominator) for number in (start, step))
        return numpy.array([(first + more * number) / denominator for number in range(self._count)])


def _rounded_even_times(length: Exact) -> Any:
    """Return the times since the start, rounded to the extended numbers of the error estimate."""
    return numpy.arange(_SAMPLES).astype(EXTENDED.type) * EXTENDED.number(length) / (_SAMPLES - 1)


def _note(request: Request) -> str:
    """Return a warning about the numbers, or an empty text.

    They may have no half-widths, or angles may have been given in degrees.
    """
    unmeasured = "" if request.error_estimate else "without half-widths"
    state, shifted = request.state, request.shifted
    beta, gamma = (abs(float(exact(angle))) for angle in state[:2])
    if beta <= math.tau and gamma <= _LARGEST_ANGLE:
        return unmeasured
    name, value = ("beta", state[0]) if beta > math.tau else ("gamma", state[1])
    degrees = f"angles are in radians, and {name}{'_bar' if shifted else ''} = {shown(value)} is many turns"
    return f"{degrees}; {unmeasured}" if unmeasured else degrees


def _decimal(time: Exact) -> str:
    """Return the exact time as a decimal, cut after fifty digits if it never ends."""
    if not time.pi_multiple:
        return exact_decimals(time.rational)[0]
    low, high = time.enclosed(_CUT_BITS)
    middle = (low + high) / 2
    return at_place(middle, decimal_magnitude(middle) - _CUT_DIGITS)[0] if middle else "0"


def _span(time: Any) -> tuple[Exact, Exact]:
    """Return the start and the end of the run [s] from a duration or a pair."""
    ends = time if isinstance(time, tuple | list) or getattr(time, "ndim", False) else (0, time)
    if len(ends) != 2:
        raise InputError(
            f"a time span is a duration or a pair (t0, t1), not {shown(time)}: "
            f"`t_eval` takes more times"
        )
    start, end = exact(ends[0]), exact(ends[1])
    if max(abs(start.rational), abs(end.rational)) > _LATEST:
        raise InputError(f"a run starts and ends within 1e300 s of 0, not at {shown(time)}")
    return start, end


def _several(names: Any) -> Any:
    return () if names is None else names if isinstance(names, tuple | list) else (names,)


def _named(name: object, names: dict[str, Any]) -> Any:
    if not isinstance(name, str) or name not in names:
        raise InputError(f"{shown(name)} is not one of {', '.join(names)}")
    return names[name]


def _since(start: Exact, end: Exact, times: Any) -> tuple[list[Exact], list[Exact]]:
    """Return the exact times, and the same times since the start.

    A time outside the run that equals one of its ends as a double means that end.
    """
    asked, length = list(map(exact, times)), float(end - start)
    for n, time in enumerate(asked):
        since, rounded = DOUBLE.number(time - start), DOUBLE.number(time)
        if since * length < 0 and rounded == float(start):
            asked[n] = start
        elif abs(since) > abs(length) and rounded == float(end):
            asked[n] = end
    return asked, [time - start for time in asked]


def _solution(
    request: Request,
    result: Result,
    engine: Engine,
    start: Exact,
    end: Exact,
    asked: Any,
    variables: Sequence[str],
) -> Solution:
    """Return the solution from an engine's result.

    It holds the samples that were reached, the events, the end and the derivatives.
    """
    precision = result.precision or request.precision
    error = result.error or ErrorEstimate(state=numpy.full(3, numpy.inf), time=numpy.inf)

    def widths(estimated: Any, values: Any) -> Any:
        return (
            numpy.full(numpy.shape(values), numpy.inf)
            if estimated is None
            else half_widths(estimated)
        )

    def moment(record: EventRecord) -> EventRecord:
        """Return the record with its time counted from time 0, not from the start."""
        record = replace(record, state=workable(record.state))
        if start == exact(0):
            return record
        time = precision.number(start + record.time)
        rounding = float(abs(time)) * float(precision.epsilon)
        return replace(record, time=time, time_uncertainty=record.time_uncertainty + rounding)

    events = result.events
    if error.events:
        estimated = zip(events, error.events, error.event_states, strict=True)
        events = tuple(
            replace(record, time_uncertainty=time, uncertainty=state)
            for record, time, state in estimated
        )
    last = moment(
        EventRecord(result.status.name.lower(), result.time, result.state, error.time, error.state)
    )
    if result.status is Status.REACHED:
        rounded = precision.number(end)
        last = replace(last, time=rounded, time_uncertainty=2 * abs(float(end - rounded)))
    if result.samples is None:
        times, samples, uncertainty = (
            precision.array([last.time]),
            result.state[None],
            error.state[None],
        )
        asked = [end if result.status is Status.REACHED else exact(last.time)]
    else:
        samples, uncertainty = result.samples, widths(error.samples, result.samples)
        if len(samples) < len(asked):
            asked = asked[: len(samples)]
        times = (
            asked.rounded(precision) if isinstance(asked, EvenTimes) else precision.sequence(asked)
        )
    by = _derivatives(request, result, variables)
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
        t=workable(times),
        y=workable(samples.T),
        uncertainty=half_widths(uncertainty.T),
        status=result.status,
        end=last,
        events=tuple(map(moment, events)),
        transition=transition,
        transition_uncertainty=transition_widths,
        by_omega=by_omega,
        by_omega_uncertainty=by_omega_widths,
        by=by,
        engine=engine.name,
        precision=precision.name,
        times=asked,
        note=_note(request),
        _watched=tuple(event.name for event in request.events),
        _start=start,
        _final=end,
        _request=request,
        _engine=engine,
    )


def _derivatives(
    request: Request, result: Result, variables: Sequence[str]
) -> dict[str, Derivative]:
    """Return the derivatives of a motion by some variables, by the chain rule.

    The request's variations are the field's constants that the variables need. The chain rule's
    factors are exact.
    """
    precision, error = result.precision or request.precision, result.error

    def chained(row: Mapping[Any, Fraction], values: Any, estimated: Any) -> tuple[Any, Any]:
        """Return the sum over the constants, and its half-widths, along the last axis."""
        widths = numpy.full(values.shape, numpy.inf) if estimated is None else estimated
        columns = [request.variations.index(name) for name in row]
        factors = list(row.values())
        terms = [
            values[..., n] * precision.number(x) for n, x in zip(columns, factors, strict=True)
        ]
        # A factor 1 and a single term are not rounded.
        roundings = [len(row) - (factor == 1) for factor in factors]
        width = sum(
            half_widths(widths[..., n]) * abs(float(x)) * (1 + k * 2.0**-50)
            + k * float(precision.epsilon) * doubles(abs(term))
            for n, x, term, k in zip(columns, factors, terms, roundings, strict=True)
        )
        return workable(sum(terms[1:], terms[0])), width

    found = {}
    if result.derivatives is not None:
        slopes = by_constants(request.parameters)
        for variable in variables:
            end = chained(slopes[variable], result.derivatives, error and error.variations)
            y, width = (numbers[:, None] for numbers in end)
            if result.sample_derivatives is not None:
                samples = result.sample_derivatives, error and error.sample_variations
                y, width = (numbers.T for numbers in chained(slopes[variable], *samples))
            found[variable] = Derivative(*end, y, width)
    return found
