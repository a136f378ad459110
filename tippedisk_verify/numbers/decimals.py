"""Exact numbers as decimals with their rounding error, and a context for decimals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from decimal import (
    MAX_EMAX,
    MIN_EMIN,
    ROUND_DOWN,
    ROUND_HALF_EVEN,
    Context,
    Decimal,
    DivisionByZero,
    InvalidOperation,
    Overflow,
    localcontext,
)
from fractions import Fraction
from functools import cache

__all__ = [
    "decimal_arithmetic",
    "decimal_magnitude",
    "exact_decimals",
    "exact_text",
    "round_down",
    "round_to_place",
    "round_up",
]


@cache
def _context(digits: int, rounding: str) -> Context:
    """Return a context of the `decimal` module with a number of digits and a rounding mode, in
    which every setting is explicit.

    An omitted setting would come from `decimal.DefaultContext`, which any program can change. The
    exponents have the widest range, so that no number met here overflows.
    """
    traps = [InvalidOperation, DivisionByZero, Overflow]
    return Context(
        digits, rounding, Emin=MIN_EMIN, Emax=MAX_EMAX, capitals=1, clamp=0, flags=[], traps=traps
    )


_ONE_DIGIT_DOWN = _context(1, ROUND_DOWN)


@contextmanager
def decimal_arithmetic(digits: int = 140, rounding: str = ROUND_HALF_EVEN) -> Iterator[None]:
    """Return a context manager, also a decorator, in which decimals have ``digits`` digits.

    All decimal arithmetic of the package runs in it. The caller's context is neither read nor
    changed.

    Args:
        digits: The number of digits. The default exceeds the 102 digits of Omega_h.
        rounding: A rounding mode of `decimal`.
    """
    with localcontext(_context(digits, rounding)):
        yield


def exact_text(value: Fraction) -> str:
    """Return the exact text of a rational number: a decimal, or a ratio if the decimals
    never end.
    """
    text, cut = exact_decimals(value)
    return text if cut == "0" else f"{Decimal(value.numerator)}/{Decimal(value.denominator)}"


def round_up(value: Fraction) -> str:
    """Return the least decimal of two significant digits that is at least ``value`` > 0."""
    return round_to_place(value, decimal_magnitude(value) - 1, math.ceil)[0]


def round_down(value: Fraction) -> str:
    """Return the greatest decimal of two significant digits that is at most ``value`` > 0."""
    return round_to_place(value, decimal_magnitude(value) - 1, math.floor)[0]


def decimal_magnitude(value: Fraction) -> int:
    """Return the integer k with 10**k <= |value| < 10**(k+1), for a value other than zero."""
    return _ONE_DIGIT_DOWN.divide(Decimal(value.numerator), Decimal(value.denominator)).adjusted()


def decimal_logarithm(value: Fraction) -> float:
    """Return log10 of a positive number, which may be outside the range of doubles.

    Args:
        value: The number.
    """
    return math.log10(value.numerator) - math.log10(value.denominator)


def exact_decimals(value: Fraction) -> tuple[str, str]:
    """Return a number as a decimal, and the half-width of its rounding.

    The half-width is "0" if the decimal is exact. A repeating decimal is cut after fifty digits.

    Args:
        value: The number.
    """
    places = value.denominator.bit_length()
    # A repeating decimal: fifty digits and the half-width of the cut
    if 10**places % value.denominator:
        text, cut = round_to_place(value, decimal_magnitude(value) - 50)
        return text, round_up(cut)
    while places and not value.numerator * 10 ** (places - 1) % value.denominator:
        places -= 1
    return round_to_place(value, -places)[0], "0"


def round_to_place(
    value: Fraction, place: int, rounding: Callable[[Fraction], int] = round
) -> tuple[str, Fraction]:
    """Round ``value`` to a multiple of ``10**place`` and return it with the change.

    Args:
        value: The number.
        place: The decimal place.
        rounding: The function that rounds to an integer.

    Returns:
        The decimal as a text, in scientific notation above 10^6 and below 10^-5, and the absolute
        change by the rounding.
    """
    unit = Fraction(10) ** place
    steps = rounding(value / unit)
    change = abs(value - steps * unit)
    # Unlike str and int, Decimal has no limit of 4300 digits.
    number = Decimal(f"{Decimal(steps)}e{place if steps else min(place, 0)}")
    if not steps or Decimal("1e-5") <= number.copy_abs() <= 10**6:
        return f"{number:f}", change
    mantissa, exponent = f"{number:e}".split("e")
    if not place:  # an integer: its last zeros carry no accuracy
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}e{int(exponent)}", change
