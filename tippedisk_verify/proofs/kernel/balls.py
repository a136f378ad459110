"""Numbers that are intervals: Arb's balls (midpoint, radius), exact inputs into them, results out of them, predicates.

Each operation of python-flint's `arb` returns a ball that holds the result for every choice of points in its operands'
balls (Johansson 2017, *Arb: efficient arbitrary-precision midpoint-radius interval arithmetic*). That and the
correctness of Python's integers is what every proof in this room assumes of software.

Each predicate here says "proved" only by a strict comparison that holds for all points of a ball; Arb's comparisons
are of that kind and False for NaN, and what is not finite is refused.

Python-flint has one context for the whole process. The context managers here are the only places that change it, and
they hold a lock while it is changed, so proofs in several threads take turns. A thread that uses python-flint by itself
may still change the context in the middle of a proof. Another precision makes balls wider, never wrong. A shorter
series is noticed: python-flint reads a coefficient that was cut off as an exact zero, and `coefficient` refuses it.

Where a ball becomes a point here: `midpoint_and_radius` takes a ball's midpoint and radius, both exactly, as rationals.
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
    "alike",
    "arb",
    "around_zero",
    "ball",
    "ball_constants",
    "coefficient",
    "inside",
    "midpoint_and_radius",
    "need",
    "negative",
    "positive",
    "rough",
    "series_length",
    "shared",
    "side_by_side",
    "upper",
    "whole",
    "working_bits",
    "working_precision",
]

#: Held while python-flint's context is changed; the thread that holds it may take it again.
_CONTEXT = threading.RLock()
_FEWEST_BITS, _MOST_BITS = 24, 1_000_000


class Unproved(Exception):
    """What was to be shown is not shown; the message says which line fails."""


class DisturbedError(ArithmeticError):
    """Something else in this process has changed what the arithmetic relies on."""


def need(shown: object, what: str) -> None:
    """Raise Unproved unless ``shown`` is True."""
    if shown is not True:
        raise Unproved(what)


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Arb's working precision within the block; what it was is restored. Raises ValueError outside 24 … 1,000,000.

    Another thread's block begins when this one has ended.
    """
    if not _FEWEST_BITS <= bits <= _MOST_BITS:
        raise ValueError(f"a working precision of {bits} bits is not offered: use {_FEWEST_BITS} to {_MOST_BITS}")
    with _CONTEXT:
        before, ctx.prec = ctx.prec, bits
        try:
            yield
        finally:
            ctx.prec = before


@contextmanager
def series_length(length: int) -> Iterator[None]:
    """Arb's series keep ``length`` coefficients within the block; what it was is restored.

    Another thread's block begins when this one has ended.
    """
    with _CONTEXT:
        before, ctx.cap = ctx.cap, length
        try:
            yield
        finally:
            ctx.cap = before


def working_bits() -> int:
    """Arb's working precision at present."""
    return int(ctx.prec)


def coefficient(series: Any, power: int) -> Any:
    """A coefficient of a series; a number counts as a constant series.

    Raises DisturbedError for a coefficient beyond the series' length, which python-flint would read as an exact zero.
    """
    if not isinstance(series, arb_series | acb_series):
        return arb(0) if power else series
    if power >= series.prec:
        raise DisturbedError(
            f"a series was cut off before its coefficient {power}: something else in this process has changed "
            "python-flint's series length (ctx.cap); run the proof again without it"
        )
    return series[power]


class BallOps:
    """The ``ops`` of `field` for balls and for series of them."""

    @staticmethod
    def sin(angle: Any) -> Any:
        return angle.sin()

    @staticmethod
    def cos(angle: Any) -> Any:
        return angle.cos()


def ball(value: Any) -> Any:
    """A ball that holds the exact number ``value`` stands for, at the working precision.

    It is an integer, a Fraction, a float, a decimal or a ratio as text; a sum of a rational and a multiple of pi
    (``rational``, ``pi_multiple``); or what has a ``value`` of these kinds. A ball of any arithmetic passes unchanged.
    Raises ValueError
    for what is no number, OverflowError for an infinite one.
    """
    if hasattr(value, "mid"):
        return value
    if hasattr(value, "pi_multiple"):
        return _rational(value.rational) + (arb.pi() * _rational(value.pi_multiple) if value.pi_multiple else 0)
    return _rational(Fraction(getattr(value, "value", value)))


def _rational(value: Fraction) -> Any:
    return arb(fmpq(value.numerator, value.denominator))


def ball_constants(parameters: Any) -> Any:
    """The field's constants as balls that hold the exact ones of ``parameters``, at the working precision."""
    exact = parameters.rational()
    return type(exact)(*map(_rational, exact))


def positive(x: Any) -> Any:
    """Whether every number of the ball is greater than zero; False for NaN and for infinite balls."""
    return x.positive() if side_by_side(x) else bool(x.is_finite() and x > 0)


def negative(x: Any) -> Any:
    """Whether every number of the ball is less than zero; False for NaN and for infinite balls."""
    return x.negative() if side_by_side(x) else bool(x.is_finite() and x < 0)


def inside(x: Any, y: Any) -> Any:
    """Whether the ball ``x`` lies in the interior of the ball ``y``; False if either is not finite."""
    if side_by_side(x):
        return x.inside(y)
    return bool(x.is_finite() and y.is_finite() and y.contains_interior(x))


def upper(x: Any) -> Any:
    """Return a float near the largest absolute value in the ball, or an array of them: for choices, not for proofs."""
    return x.abs_upper().midpoints if side_by_side(x) else float(x.abs_upper())


def alike(sample: Any, value: object) -> Any:
    """A number, or a ball, as a ball in the arithmetic of ``sample``."""
    if type(value) is type(sample):
        return value
    return sample.alike(value) if hasattr(sample, "alike") else ball(value)


def whole(x: Any) -> Any:
    """A ball that holds all values of a `jets.Jet`; anything else passes."""
    return x.range() if hasattr(x, "c") else x


def rough(x: Any) -> Any:
    """A jet of the lower degree that derivatives have, which holds the same functions; anything else passes."""
    return x.rough() if hasattr(x, "c") else x


def around_zero(radius: Any) -> Any:
    """A ball about 0 that reaches ``radius``, a number or ball that is not negative, or further."""
    return radius.around_zero() if side_by_side(radius) else arb(0, radius)


def shared(x: Any, y: Any) -> Any:
    """A ball that holds what the balls ``x`` and ``y``, which is finite, share; not finite where they share nothing."""
    if not x.is_finite():
        return y
    return x.intersection(y) if x.overlaps(y) else arb.nan()


def side_by_side(x: object) -> bool:
    """Whether these are `ball_array.BallArray`, of which everything here is answered ball by ball."""
    return hasattr(x, "midpoints")


def midpoint_and_radius(x: Any) -> tuple[Fraction, Fraction]:
    """Both exactly. Raises ValueError if the ball is not finite: such a ball says nothing."""
    if not x.is_finite():
        raise ValueError("an infinite ball has no value")
    return _point(x.mid()), _point(x.rad())


def _point(x: Any) -> Fraction:
    mantissa, exponent = x.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)
