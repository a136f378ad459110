"""Numbers that are intervals: Arb's balls (midpoint, radius), exact inputs into them, results out of them, predicates.

Each operation of python-flint's `arb` returns a ball that holds the result for every choice of points in its operands'
balls (Johansson 2017, *Arb: efficient arbitrary-precision midpoint-radius interval arithmetic*). That and the
correctness of Python's integers is what every proof in this room assumes of software.

Each predicate here says "proved" only by a strict comparison that holds for all points of a ball; Arb's comparisons
are of that kind and False for NaN, and what is not finite is refused.

Where a ball becomes a point here: `measured` takes a ball's midpoint and radius, both exactly, as rationals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from flint import arb, ctx, fmpq

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters

__all__ = [
    "arb",
    "ball",
    "ball_constants",
    "hull",
    "inside",
    "measured",
    "negative",
    "positive",
    "working_precision",
]

_FEWEST_BITS, _MOST_BITS = 24, 1_000_000


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Arb's working precision within the block; what it was is restored. Raises InputError outside 24 … 1,000,000."""
    if not _FEWEST_BITS <= bits <= _MOST_BITS:
        raise InputError(f"a working precision of {bits} bits is not offered: use {_FEWEST_BITS} to {_MOST_BITS}")
    before = ctx.prec
    ctx.prec = bits
    try:
        yield
    finally:
        ctx.prec = before


def ball(value: object) -> Any:
    """A ball that holds the exact number ``value`` stands for (see `model.exact.exact`), at the working precision.

    A ball passes unchanged. Raises InputError for what is no finite number.
    """
    if isinstance(value, arb):
        return value
    number = exact(value)
    result = _rational(number.rational)
    return result + arb.pi() * _rational(number.pi_multiple) if number.pi_multiple else result


def _rational(value: Fraction) -> Any:
    return arb(fmpq(value.numerator, value.denominator))


def hull(low: object, high: object) -> Any:
    """The smallest ball found that holds both numbers (or balls) and what lies between them."""
    return ball(low).union(ball(high))


def ball_constants(parameters: Parameters | Mapping[str, Any]) -> Constants:
    """The field's constants as balls: of exact parameters, or of a mapping r, e, m, A, B, g, mu, epsilon of balls.

    Quotients and Bbar = B - m e^2 are formed on balls, so for a box of parameters they hold all that the box gives.
    """
    if isinstance(parameters, Parameters):
        return Constants(*(_rational(value) for value in parameters.rational()))
    r, e, m, A, B, g, mu, epsilon = (ball(parameters[name]) for name in ("r", "e", "m", "A", "B", "g", "mu", "epsilon"))
    Bbar = B - m * (e * e)
    traction = mu * g
    # Bbar / m = B / m - e^2 names the mass once: no wider than it must be.
    return Constants(r, e, m, A, B, Bbar, g, mu, epsilon, A / m, B / m - e * e, traction / epsilon, traction)


def positive(x: Any) -> bool:
    """Whether every number of the ball is greater than zero; False for NaN and for infinite balls."""
    return bool(x.is_finite() and x > 0)


def negative(x: Any) -> bool:
    """Whether every number of the ball is less than zero; False for NaN and for infinite balls."""
    return bool(x.is_finite() and x < 0)


def inside(x: Any, y: Any) -> bool:
    """Whether the ball ``x`` lies in the interior of the ball ``y``; False if either is not finite."""
    return bool(x.is_finite() and y.is_finite() and y.contains_interior(x))


def measured(x: Any) -> Measured:
    """The ball as exact midpoint and radius. Raises InputError if it is not finite: such a ball says nothing."""
    if not x.is_finite():
        raise InputError("an infinite ball has no value")
    return Measured(_point(x.mid()), _point(x.rad()))


def _point(x: Any) -> Fraction:
    mantissa, exponent = x.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)
