"""How far a run is off: the distance to a wider run, and what the wider run itself may be off.

The budget of every number q of a run, derived in docs/error_budgets.md:

    half-width = DISTANCES |q - q_wide| + share * spread + ulp(q)

The distance is the error itself, but for that of the wider run. Where that is truncation, it is a small part of the
distance, because the wider run's tolerance is so much tighter; twice the distance leaves it a half. Where it is
rounding, inputs' and parameters' included, the distance says nothing of it: that may be small by chance. What one
rounding of each kind does to q is therefore measured: by the spread of a few twins, the same run with the last bits of
its inputs and of each step moved. The wider run makes the same roundings, smaller by the ratio of the two arithmetics.

All of this takes for granted that a rounding's effect is in proportion to it. Where runs have parted (`parted`), it no
longer is: then the wider run must agree with one that is wider still.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.flow.contract import ErrorEstimate, Result, Status
from tippedisk_verify.model.measured import DISTANCES
from tippedisk_verify.model.precision import Precision

__all__ = ["TWINS", "budgeted", "parted", "twins_needed", "undecided"]

#: The spread of so many and the run itself is less than a 64th of their standard deviation once in a million times.
TWINS = 3
#: The wider run's error, in units of the spread brought to its arithmetic: four standard deviations of an error
#: whose twins lie within a 64th of one.
_WIDER_SHARE = 256
#: With so many bits more the wider run's error is nothing: a distance that is smaller by chance is less likely than a
#: fault of the machine. Half of the bits are left for events that are only touched, whose times go with the root.
_FAR_WIDER = 48
#: The least half-width, in units of the last place: the number's own rounding.
_LAST_PLACE = 1
#: Angles [rad] and relative velocities that differ by more are no longer moved in proportion to a rounding.
_IN_PROPORTION = 2.0**-6


def twins_needed(precision: Precision, wider: Precision) -> int:
    """How many twins the budget asks for."""
    return TWINS if wider.bits - precision.bits < _FAR_WIDER else 0


def budgeted(
    precision: Precision, wider: Precision, result: Result, check: Result, twins: Sequence[Result]
) -> ErrorEstimate:
    """Half-widths of all numbers of ``result``, by the same run ``check`` in a wider arithmetic and by its twins.

    Infinite where the runs do not end alike: rounding decides what happens. A twin that ends unlike the other two is
    left out; at least one must be like them, if there are any.
    """
    alike = [twin for twin in twins if _alike(result, twin)]
    if result.status is Status.NON_FINITE or not _alike(result, check) or (twins and not alike):
        return undecided()
    ulp = wider.array([_LAST_PLACE * precision.epsilon])  # an array: numpy would lose the digits of an MPFR number
    share = _WIDER_SHARE * 2.0 ** (precision.bits - wider.bits)

    def widths(values: Any, truths: Any, others: Sequence[Any]) -> Any:
        exact = _widened(values, wider)
        bound = abs(exact - truths) * DISTANCES + abs(exact) * ulp
        if others:
            known = numpy.stack((values, *others))
            bound = bound + share * (known.max(axis=0) - known.min(axis=0))
        return bound.astype(float) if precision.kind == "double" else bound

    def time_width(mine: Any, theirs: Any, others: Sequence[Any]) -> float:
        each = [precision.array([time]) for time in others]
        return float(widths(precision.array([mine]), wider.array([theirs]), each)[0])

    def of_all(name: str) -> Any:
        values = getattr(result, name)
        return None if values is None else widths(values, getattr(check, name), [getattr(t, name) for t in alike])

    return ErrorEstimate(
        state=of_all("state"),
        time=0.0
        if result.status is Status.REACHED
        else time_width(result.time, check.time, [twin.time for twin in alike]),
        samples=of_all("samples"),
        events=tuple(
            time_width(mine.time, theirs.time, [other.time for other in others])
            for mine, theirs, *others in zip(result.events, check.events, *(twin.events for twin in alike), strict=True)
        ),
        variations=of_all("derivatives"),
    )


def undecided() -> ErrorEstimate:
    """What is said where rounding decides what happens."""
    return ErrorEstimate(state=numpy.full(3, math.inf), time=math.inf)


def parted(one: Result, other: Result) -> bool:
    """Whether two runs that end alike lie so far apart that rounding's effect on them is no longer in proportion."""
    if not _alike(one, other):
        return False
    for mine, theirs in ((one.state, other.state), (one.samples, other.samples)):
        if mine is not None and len(mine):
            known = mine.astype(float)
            away, size = abs(theirs.astype(float) - known), 1 + abs(known)
            if (away[..., :2] > _IN_PROPORTION).any() or (away[..., 2] > _IN_PROPORTION * size[..., 2]).any():
                return True
    return False


def _alike(result: Result, other: Result) -> bool:
    """Whether two runs ended in the same way, with the same events and as many samples."""
    lengths = [None if run.samples is None else len(run.samples) for run in (result, other)]
    names = [[record.name for record in run.events] for run in (result, other)]
    return result.status is other.status and names[0] == names[1] and lengths[0] == lengths[1]


def _widened(values: Any, wider: Precision) -> Any:
    """An array in a wider arithmetic, exactly."""
    if wider.kind == "extended":
        return values.astype(numpy.longdouble)
    return wider.array(values.ravel().tolist()).reshape(values.shape)
