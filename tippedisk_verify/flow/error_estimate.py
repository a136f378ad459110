"""How far a run is off, by the same run in a wider arithmetic."""

from __future__ import annotations

import math
from typing import Any

from tippedisk_verify.flow.contract import ErrorEstimate, Result, Status
from tippedisk_verify.model.precision import Precision

__all__ = ["compared"]


def compared(precision: Precision, wider: Precision, result: Result, check: Result, shift: bool) -> ErrorEstimate:
    """Half-widths from the distance to a run with at least 11 more bits.

    The wider run's own error is about 2^-11 or less of the first one's. An eighth of the largest distance leaves it a
    factor of 256, also where one component's distance is small by chance; an ulp of each value is the least claimed.
    An event's time has no neighbours to lean on: it borrows an eighth of the state's distance over the state's speed.
    """
    import numpy

    # An array of one: numpy would make one of a number, and lose its digits' memory if it is MPFR's.
    ulp = wider.array([precision.epsilon])

    def widths(values: Any, truths: Any) -> Any:
        exact = _widened(values, wider)
        away = abs(exact - truths)
        rows = away if away.ndim > 1 else away[None, :]
        largest = numpy.array([max(row, default=0) for row in rows], dtype=rows.dtype)
        bound = away + (largest[:, None] if away.ndim > 1 else largest) / 8 + abs(exact) * ulp
        return bound.astype(float) if precision.kind == "double" else bound

    def time_width(mine: Any, theirs: Any, state: Any, truth: Any) -> float:
        own = float(widths(precision.array([mine]), wider.array([theirs]))[0])
        turning = (numpy.sin if shift else numpy.cos)(float(state[0]))
        speed = max(abs(float(state[2])), abs(float(turning)), 1e-300)
        return own + float(max(abs(_widened(state, wider) - truth))) / 8 / speed

    names = [[record.name for record in run.events] for run in (result, check)]
    unlike = result.status is not check.status or names[0] != names[1]
    if unlike or (result.samples is not None and len(result.samples) != len(check.samples)):
        return ErrorEstimate(state=numpy.full(3, math.inf), time=math.inf)
    ended = result.status is not Status.REACHED
    return ErrorEstimate(
        state=widths(result.state, check.state),
        time=time_width(result.time, check.time, result.state, check.state) if ended else 0.0,
        samples=None if result.samples is None else widths(result.samples, check.samples),
        events=tuple(
            time_width(mine.time, theirs.time, mine.state, theirs.state)
            for mine, theirs in zip(result.events, check.events, strict=True)
        ),
        variations=None if result.derivatives is None else widths(result.derivatives, check.derivatives),
    )


def _widened(values: Any, wider: Precision) -> Any:
    """An array in a wider arithmetic, exactly."""
    import numpy

    if wider.kind == "extended":
        return values.astype(numpy.longdouble)
    return wider.array(values.ravel().tolist()).reshape(values.shape)
