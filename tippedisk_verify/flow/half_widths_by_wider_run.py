"""The half-widths of a motion from a second run in wider arithmetic, where its defect does not
suffice.

This serves numbers beyond doubles, derivatives, and errors that are no longer proportional to
roundings (see `flow.half_widths_by_defect`). The half-width of a number q is

    half-width = HALF_WIDTH_FACTOR |q - q_wide| + ulp(q)

Where the two runs have parted, the wider run must agree with one that is wider still. The formula
is derived in docs/error_budgets.md.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.flow.contract import Engine, ErrorEstimate, Request, Result, Status
from tippedisk_verify.flow.start import Start
from tippedisk_verify.numbers.arrays import half_widths_in_doubles, round_to_doubles
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR
from tippedisk_verify.numbers.precision import DOUBLE, Precision, wider_precision

__all__ = ["half_widths_from_wider_run"]

# The tolerance of the wider run, in units of its arithmetic's round-off. heyoka's tolerance is
# absolute for states below 1, and the truncation of small states would otherwise far exceed their
# rounding.
_WIDER_TOLERANCE = Fraction(1, 2**12)
# The least half-width, in units of the last place: the number's own rounding.
_LAST_PLACE = 1
# The largest difference of angles [rad] and relative velocities that is still proportional to a
# rounding.
_MAX_PROPORTIONAL_DISTANCE = 2.0**-6
# The rates [rad/s, rad/s^2] of a start must exceed this many of its roundings for its motion to
# have events.
_MIN_RATE_IN_ROUNDINGS = 2**20


def half_widths_from_wider_run(engine: Engine, request: Request, result: Result) -> Result:
    """Return the result of a run with half-widths, measured by runs of the same request in a wider
    arithmetic of at least 48 bits more.

    The half-widths are infinite where rounding decides the outcome.

    Args:
        engine: The engine of the wider runs.
        request: The run.
        result: Its result.
    """

    def run_in(wider: Precision, most_steps: int) -> Result:
        return engine(
            replace(
                request,
                error_estimate=False,
                dense=False,
                precision=wider,
                tolerance=wider.epsilon * _WIDER_TOLERANCE,
                max_steps=most_steps,
            )
        )

    wider = (
        wider_precision(wider_precision(DOUBLE))
        if request.precision == DOUBLE
        else wider_precision(request.precision)
    )
    check = run_in(wider, request.max_steps)
    agreed = not _end_far_apart(result, check) and _starts_moving(request, wider)
    if not agreed and request.precision == DOUBLE and result.status.usable:
        # Where rounding has grown out of proportion, a wider run may be just as wrong. A third run
        # must agree with it.
        before, wider = check, wider_precision(wider)
        # It has a higher order and so needs fewer steps, unless it diverges itself.
        check = run_in(wider, min(request.max_steps, 2 * result.steps))
        agreed = not _end_far_apart(before, check) and _starts_moving(request, wider)
    error = _half_widths(request.precision, wider, result, check) if agreed else _infinite_widths()
    return result._replace(error=error, built=result.built + check.built)


def _half_widths(
    precision: Precision, wider: Precision, result: Result, check: Result
) -> ErrorEstimate:
    """Return the half-widths of all numbers of a run's result, by comparison with a run in wider
    arithmetic.

    They are infinite where the runs do not end alike.
    """
    if result.status is Status.NON_FINITE or not _end_alike(result, check):
        return _infinite_widths()
    # An array: numpy would lose the digits of an MPFR number
    ulp = wider.array([_LAST_PLACE * precision.epsilon])

    def widths(values: Any, truths: Any) -> Any:
        exact = wider.array(values.ravel().tolist()).reshape(values.shape)
        bound = abs(exact - truths) * HALF_WIDTH_FACTOR + abs(exact) * ulp
        return round_to_doubles(bound) if precision.kind == "double" else bound

    def time_width(time: Any, wider_time: Any) -> float:
        return float(
            half_widths_in_doubles(widths(precision.array([time]), wider.array([wider_time])))[0]
        )

    def of_all(name: str) -> Any:
        values = getattr(result, name)
        return None if values is None else widths(values, getattr(check, name))

    crossings = list(zip(result.events, check.events, strict=True))
    return ErrorEstimate(
        state=of_all("state"),
        time=0.0 if result.status is Status.REACHED else time_width(result.time, check.time),
        samples=of_all("samples"),
        events=tuple(time_width(event.time, check.time) for event, check in crossings),
        event_states=tuple(widths(event.state, check.state) for event, check in crossings),
        derivatives=of_all("derivatives"),
        sample_derivatives=of_all("sample_derivatives"),
    )


def _infinite_widths() -> ErrorEstimate:
    return ErrorEstimate(state=numpy.full(3, math.inf), time=math.inf)


def _starts_moving(request: Request, wider: Precision) -> bool:
    """Return True if a run has no events, or if its start moves: the rates there are far larger
    than their rounding.

    The events of a slower start would be artefacts of rounding.
    """
    if not request.events:
        return True
    start = Start.of(request, wider)
    fastest = max(map(abs, start.rates(start.state)))
    return bool(fastest > wider.number(_MIN_RATE_IN_ROUNDINGS * wider.epsilon))


def _end_far_apart(first: Result, second: Result) -> bool:
    """Return True if two runs of the same motion end alike but lie far apart.

    The effect of rounding is then no longer proportional to it.
    """
    if not _end_alike(first, second):
        return False
    for states, others in ((first.state, second.state), (first.samples, second.samples)):
        if states is not None and len(states):
            values = round_to_doubles(states)
            distance, size = abs(round_to_doubles(others) - values), 1 + abs(values)
            if (distance[..., :2] > _MAX_PROPORTIONAL_DISTANCE).any() or (
                distance[..., 2] > _MAX_PROPORTIONAL_DISTANCE * size[..., 2]
            ).any():
                return True
    return False


def _end_alike(result: Result, other: Result) -> bool:
    """Return True if two runs ended in the same way, with the same events and as many samples."""
    lengths = [None if run.samples is None else len(run.samples) for run in (result, other)]
    names = [[record.name for record in run.events] for run in (result, other)]
    return result.status is other.status and names[0] == names[1] and lengths[0] == lengths[1]
