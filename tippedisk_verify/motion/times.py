"""Exact times of a motion: evenly spaced ones, and spans and times as callers give them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.decimals import decimal_magnitude, exact_decimals, round_to_place
from tippedisk_verify.numbers.exact import Exact, exact, short_text
from tippedisk_verify.numbers.precision import DOUBLE, Precision

__all__ = ["EvenTimes", "decimal_time", "since_start", "span_of"]

_MAX_TIME = 10**300  # s; doubles hold all times up to it
_EXACT = 2**53  # doubles hold all smaller integers, so that their quotient is rounded once
_CUT_DIGITS, _CUT_BITS = 50, 400  # of a time whose decimals never end, and of its enclosure


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

    def __getitem__(self, index: Any) -> Any:
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
            return precision.as_array(tuple(self))
        start, step = self._start.rational, self._step.rational
        denominator = math.lcm(start.denominator, step.denominator)
        first, more = (int(number * denominator) for number in (start, step))
        if max(abs(first), abs(first + more * (self._count - 1)), denominator) < _EXACT:
            return (first + more * numpy.arange(self._count)) / denominator
        return numpy.array([(first + more * number) / denominator for number in range(self._count)])


def decimal_time(time: Exact) -> str:
    """Return an exact time as a decimal, cut after fifty digits if it never ends."""
    if not time.pi_multiple:
        return exact_decimals(time.rational)[0]
    low, high = time.bounds(_CUT_BITS)
    middle = (low + high) / 2
    return round_to_place(middle, decimal_magnitude(middle) - _CUT_DIGITS)[0] if middle else "0"


def span_of(time: Any) -> tuple[Exact, Exact]:
    """Convert a duration or a pair of times to the exact start and end of a run [s].

    Raises:
        InputError: If ``time`` is neither, or does not lie within 1e300 s of 0.
    """
    ends = time if isinstance(time, tuple | list) or getattr(time, "ndim", False) else (0, time)
    if len(ends) != 2:
        raise InputError(
            f"a time span is a duration or a pair (t0, t1), not {short_text(time)}: "
            f"`t_eval` takes more times"
        )
    start, end = exact(ends[0]), exact(ends[1])
    if max(abs(start.rational), abs(end.rational)) > _MAX_TIME:
        raise InputError(f"a run starts and ends within 1e300 s of 0, not at {short_text(time)}")
    return start, end


def since_start(start: Exact, end: Exact, times: Any) -> tuple[list[Exact], list[Exact]]:
    """Return the times as exact numbers, and the same times counted from the start.

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
