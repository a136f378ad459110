"""How far a run is off, by the same run in wider arithmetic: for what its defect does not tell (`flow.error_estimate`).

That is for numbers beyond doubles, for derivatives, and where errors are not in proportion to roundings any more.

    half-width = DISTANCES |q - q_wide| + ulp(q)

Where those two have parted, the wider run must agree with one that is wider still. Derived in docs/error_budgets.md.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.flow.contract import Engine, ErrorEstimate, Request, Result, Status
from tippedisk_verify.model.arrays import doubles, half_widths
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.measured import DISTANCES
from tippedisk_verify.model.precision import DOUBLE, Precision, companion

__all__ = ["compared"]

#: The tolerance of the wider run, in units of its arithmetic's round-off. heyoka's is absolute for states below 1, and
#: truncation of small states would otherwise stand far above their rounding.
_TIGHTER = Fraction(1, 2**12)
#: The least half-width, in units of the last place: the number's own rounding.
_LAST_PLACE = 1
#: Angles [rad] and relative velocities that differ by more are no longer moved in proportion to a rounding.
_IN_PROPORTION = 2.0**-6
#: Roundings of the start that its rates [rad/s, rad/s^2] must exceed for its motion to have events.
_MOVES = 2**20


def compared(engine: Engine, request: Request, result: Result) -> Result:
    """The result with half-widths, by runs with at least 48 bits more. Infinite where rounding decides what happens."""

    def checked(wider: Precision, most_steps: int) -> Result:
        tolerance = wider.epsilon * _TIGHTER
        return engine(
            replace(
                request, error_estimate=False, dense=False, precision=wider, tolerance=tolerance, max_steps=most_steps
            )
        )

    wider = companion(companion(DOUBLE)) if request.precision == DOUBLE else companion(request.precision)
    check = checked(wider, request.max_steps)
    agreed = not _parted(result, check) and _moves(request, wider)
    if not agreed and request.precision == DOUBLE and result.status.usable:
        # Where rounding has grown out of proportion a wider run may be as wrong, unless a third one agrees with it.
        before, wider = check, companion(wider)
        # It has a higher order, so fewer steps, unless it diverges itself.
        check = checked(wider, min(request.max_steps, 2 * result.steps))
        agreed = not _parted(before, check) and _moves(request, wider)
    error = _half_widths(request.precision, wider, result, check) if agreed else _undecided()
    return result._replace(error=error, built=result.built + check.built)


def _half_widths(precision: Precision, wider: Precision, result: Result, check: Result) -> ErrorEstimate:
    """Of all numbers of a result, by those of the wider run; infinite where the runs do not end alike."""
    if result.status is Status.NON_FINITE or not _alike(result, check):
        return _undecided()
    ulp = wider.array([_LAST_PLACE * precision.epsilon])  # an array: numpy would lose the digits of an MPFR number

    def widths(values: Any, truths: Any) -> Any:
        exact = wider.array(values.ravel().tolist()).reshape(values.shape)
        bound = abs(exact - truths) * DISTANCES + abs(exact) * ulp
        return doubles(bound) if precision.kind == "double" else bound

    def time_width(mine: Any, theirs: Any) -> float:
        return float(half_widths(widths(precision.array([mine]), wider.array([theirs])))[0])

    def of_all(name: str) -> Any:
        values = getattr(result, name)
        return None if values is None else widths(values, getattr(check, name))

    crossings = list(zip(result.events, check.events, strict=True))
    return ErrorEstimate(
        state=of_all("state"),
        time=0.0 if result.status is Status.REACHED else time_width(result.time, check.time),
        samples=of_all("samples"),
        events=tuple(time_width(one.time, other.time) for one, other in crossings),
        event_states=tuple(widths(one.state, other.state) for one, other in crossings),
        variations=of_all("derivatives"),
    )


def _undecided() -> ErrorEstimate:
    return ErrorEstimate(state=numpy.full(3, math.inf), time=math.inf)


def _moves(request: Request, wider: Precision) -> bool:
    """Whether the start moves faster than a rounding of it would: else its events are those of that rounding."""
    if not request.events:
        return True
    ops = shifted(wider.ops) if request.shifted else wider.ops
    flow = field(ops, request.parameters.at(wider), wider.number(request.omega), request.friction)
    fastest = max(abs(rate) for rate in flow(*map(wider.number, request.state)))
    return bool(fastest > wider.number(_MOVES * wider.epsilon))


def _parted(one: Result, other: Result) -> bool:
    """Whether two runs that end alike lie so far apart that rounding's effect on them is no longer in proportion."""
    if not _alike(one, other):
        return False
    for mine, theirs in ((one.state, other.state), (one.samples, other.samples)):
        if mine is not None and len(mine):
            values = doubles(mine)
            distance, size = abs(doubles(theirs) - values), 1 + abs(values)
            if (distance[..., :2] > _IN_PROPORTION).any() or (distance[..., 2] > _IN_PROPORTION * size[..., 2]).any():
                return True
    return False


def _alike(result: Result, other: Result) -> bool:
    """Whether two runs ended in the same way, with the same events and as many samples."""
    lengths = [None if run.samples is None else len(run.samples) for run in (result, other)]
    names = [[record.name for record in run.events] for run in (result, other)]
    return result.status is other.status and names[0] == names[1] and lengths[0] == lengths[1]
