"""Arb's balls (midpoint, radius): conversions to and from exact numbers, and predicates.

Each operation of python-flint's `arb` returns a ball that holds the result for every choice of
points in its operands' balls (Johansson 2017, *Arb: efficient arbitrary-precision midpoint-radius
interval arithmetic*). Every proof of the kernel assumes this of its software, and that Python's
integers are correct.

Each predicate is True only by a strict comparison that holds for all points of a ball. Arb's
comparisons are of that kind and False for NaN, and infinite balls are refused.

Python-flint has one context for the whole process. Only the context managers of this module change
it. They hold a lock meanwhile, so proofs in several threads take turns. Another thread that uses
python-flint directly may still change the context in the middle of a proof. Another precision makes
balls wider or narrower, never wrong. A shorter series is noticed: python-flint reads a coefficient
that was cut off as an exact zero, and `coefficient` refuses it.

Where a ball becomes a point: `midpoint_and_radius` returns a ball's midpoint and radius exactly,
as rationals.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from flint import acb_series, arb, arb_series, ctx, fmpq

__all__ = [
    "BallOps",
    "DisturbedError",
    "Unproved",
    "arb",
    "around_zero",
    "ball",
    "coefficient",
    "converted_like",
    "inside",
    "intersection",
    "is_ball_array",
    "magnitude_estimate",
    "midpoint_and_radius",
    "negative",
    "positive",
    "range_of",
    "require",
    "series_length",
    "truncated_for_derivatives",
    "working_bits",
    "working_precision",
]

# Held while python-flint's context is changed; the thread that holds it may take it again.
_CONTEXT_LOCK = threading.RLock()
_MIN_BITS, _MAX_BITS = 24, 1_000_000


class Unproved(Exception):
    """Raised if an inequality that a proof needs could not be shown; the message names it."""


class DisturbedError(ArithmeticError):
    """Raised if something else in this process has changed a setting that the arithmetic
    relies on.
    """


def require(verified: object, message: str) -> None:
    """Raise Unproved, with the message ``message``, unless ``verified`` is True."""
    if verified is not True:
        raise Unproved(message)


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Set Arb's working precision [bits] within a with block, and restore it afterwards.

    Another thread's block begins when this one has ended. Raises ValueError outside 24 … 1,000,000.
    """
    if not _MIN_BITS <= bits <= _MAX_BITS:
        raise ValueError(
            f"a working precision of {bits} bits is not offered: use {_MIN_BITS} to {_MAX_BITS}"
        )
    with _CONTEXT_LOCK:
        before, ctx.prec = ctx.prec, bits
        try:
            yield
        finally:
            ctx.prec = before


@contextmanager
def series_length(length: int) -> Iterator[None]:
    """Let Arb's power series keep ``length`` coefficients within a with block, and restore the old
    length.

    Another thread's block begins when this one has ended.
    """
    with _CONTEXT_LOCK:
        before, ctx.cap = ctx.cap, length
        try:
            yield
        finally:
            ctx.cap = before


def working_bits() -> int:
    """Return Arb's current working precision [bits]."""
    return int(ctx.prec)


def coefficient(series: Any, power: int) -> Any:
    """Return the coefficient of a ``power`` in a power series of Arb's; a number counts as a
    constant series.

    Raises DisturbedError for a coefficient beyond the series' length, which python-flint would read
    as an exact zero.
    """
    if not isinstance(series, arb_series | acb_series):
        return arb(0) if power else series
    if power >= series.prec:
        raise DisturbedError(
            f"a series was cut off before its coefficient {power}: something else in this process "
            f"has changed "
            "python-flint's series length (ctx.cap); run the proof again without it"
        )
    return series[power]


class BallOps:
    """The sine and cosine (``ops``) that `vector_field` uses for balls and for series of balls."""

    @staticmethod
    def sin(angle: Any) -> Any:
        return angle.sin()

    @staticmethod
    def cos(angle: Any) -> Any:
        return angle.cos()


def ball(value: Any) -> Any:
    """Return a ball that holds an exact number, at the working precision.

    The number is an integer, a Fraction, a float, a decimal or a ratio as text, or a sum of a
    rational and a multiple of pi (``rational``, ``pi_multiple``). An object with a ``value`` of
    these kinds will do. A ball of any arithmetic is returned unchanged. Raises ValueError if
    ``value`` is not a number, OverflowError if it is infinite.
    """
    if hasattr(value, "mid"):
        return value
    if hasattr(value, "pi_multiple"):
        return _rational(value.rational) + (
            arb.pi() * _rational(value.pi_multiple) if value.pi_multiple else 0
        )
    return _rational(Fraction(getattr(value, "value", value)))


def _rational(value: Fraction) -> Any:
    return arb(fmpq(value.numerator, value.denominator))


def positive(x: Any) -> Any:
    """Return True if every number of the ball is positive; False for NaN and for infinite balls."""
    return x.positive() if is_ball_array(x) else bool(x.is_finite() and x > 0)


def negative(x: Any) -> Any:
    """Return True if every number of the ball is negative; False for NaN and for infinite balls."""
    return x.negative() if is_ball_array(x) else bool(x.is_finite() and x < 0)


def inside(x: Any, y: Any) -> Any:
    """Return True if the ball ``x`` lies in the interior of ``y``.

    Returns False if either is not finite.
    """
    if is_ball_array(x):
        return x.inside(y)
    return bool(x.is_finite() and y.is_finite() and y.contains_interior(x))


def magnitude_estimate(x: Any) -> Any:
    """Return a float near the largest absolute value in the ball ``x``, to guide choices in a
    proof.

    It is no proved bound. For an array of balls the result is an array of floats.
    """
    return x.abs_upper().midpoints if is_ball_array(x) else float(x.abs_upper())


def converted_like(sample: Any, value: object) -> Any:
    """Convert a number or ball to a ball in the arithmetic of ``sample``.

    An object of the type of ``sample`` is returned unchanged.
    """
    if type(value) is type(sample):
        return value
    return sample.converted_like(value) if hasattr(sample, "converted_like") else ball(value)


def range_of(x: Any) -> Any:
    """Return a ball that holds all values of a `jets.Jet`; return anything else unchanged."""
    return x.range() if hasattr(x, "coefficients") else x


def truncated_for_derivatives(x: Any) -> Any:
    """Return a jet ``x`` with its degree reduced to `jets.DERIVATIVE_DEGREE`, enough for
    derivatives.

    The result still encloses the same functions. Anything else is returned unchanged.
    """
    return x.truncated_for_derivatives() if hasattr(x, "coefficients") else x


def around_zero(radius: Any) -> Any:
    """Return a ball about 0 that reaches at least ``radius``, a number or ball that is not
    negative.
    """
    return radius.around_zero() if is_ball_array(radius) else arb(0, radius)


def intersection(x: Any, y: Any) -> Any:
    """Return a ball that holds the intersection of ``x`` with the finite ball ``y``.

    Returns ``y`` if ``x`` is not finite, and NaN if the two do not meet.
    """
    if not x.is_finite():
        return y
    return x.intersection(y) if x.overlaps(y) else arb.nan()


def is_ball_array(x: object) -> bool:
    """Return True if ``x`` is a `ball_array.BallArray`, for which predicates answer
    ball by ball.
    """
    return hasattr(x, "midpoints")


def midpoint_and_radius(x: Any) -> tuple[Fraction, Fraction]:
    """Return the exact midpoint and radius of a ball. Raises ValueError if it is not finite."""
    if not x.is_finite():
        raise ValueError("an infinite ball has no value")
    return _point(x.mid()), _point(x.rad())


def _point(x: Any) -> Fraction:
    mantissa, exponent = x.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)
