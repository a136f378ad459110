"""Exact numbers as decimals, with what their rounding changes, and the context of all decimal arithmetic here."""

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
    "arithmetic",
    "at_place",
    "decimal_magnitude",
    "exact_decimals",
    "exact_text",
    "rounded_down",
    "rounded_up",
]


@cache
def _context(digits: int, rounding: str) -> Context:
    """A context with every setting stated: what is left out comes from `decimal.DefaultContext`, which anybody can set.

    The exponents have the widest range, so that no number met here overflows.
    """
    traps = [InvalidOperation, DivisionByZero, Overflow]
    return Context(digits, rounding, Emin=MIN_EMIN, Emax=MAX_EMAX, capitals=1, clamp=0, flags=[], traps=traps)


_TRUNCATED = _context(1, ROUND_DOWN)


@contextmanager
def arithmetic(digits: int = 140, rounding: str = ROUND_HALF_EVEN) -> Iterator[None]:
    """Compute with decimals of so many digits; Omega_h has 102. Also a decorator.

    All arithmetic with decimals happens in it. The caller's context is neither read nor changed.
    """
    with localcontext(_context(digits, rounding)):
        yield


def exact_text(value: Fraction) -> str:
    """The number itself as text: a decimal, or a ratio of integers if no decimal ends."""
    text, cut = exact_decimals(value)
    return text if cut == "0" else f"{Decimal(value.numerator)}/{Decimal(value.denominator)}"


def rounded_up(value: Fraction) -> str:
    """The least decimal of two significant digits that is not smaller than a positive ``value``."""
    return at_place(value, decimal_magnitude(value) - 1, math.ceil)[0]


def rounded_down(value: Fraction) -> str:
    """The greatest decimal of two significant digits that is not larger than a positive ``value``."""
    return at_place(value, decimal_magnitude(value) - 1, math.floor)[0]


def decimal_magnitude(value: Fraction) -> int:
    """The integer k with 10**k <= |value| < 10**(k+1), for a value that is not zero."""
    return _TRUNCATED.divide(Decimal(value.numerator), Decimal(value.denominator)).adjusted()


def exact_decimals(value: Fraction) -> tuple[str, str]:
    """The number, and the half-width of what it leaves out: zero if it is a decimal."""
    places = value.denominator.bit_length()
    if 10**places % value.denominator:  # a repeating decimal: fifty digits and the half-width of the cut
        text, cut = at_place(value, decimal_magnitude(value) - 50)
        return text, rounded_up(cut)
    while places and not value.numerator * 10 ** (places - 1) % value.denominator:
        places -= 1
    return at_place(value, -places)[0], "0"


def at_place(value: Fraction, place: int, rounding: Callable[[Fraction], int] = round) -> tuple[str, Fraction]:
    """``value`` rounded to a multiple of ``10**place``, and by how much that changes it.

    As a decimal string, in scientific notation above 10^6 and below 10^-5.
    """
    unit = Fraction(10) ** place
    steps = rounding(value / unit)
    change = abs(value - steps * unit)
    # Unlike str and int, Decimal has no limit of 4300 digits.
    number = Decimal(f"{Decimal(steps)}e{place if steps else min(place, 0)}")
    if not steps or Decimal("1e-5") <= number.copy_abs() <= 10**6:
        return f"{number:f}", change
    mantissa, exponent = f"{number:e}".split("e")
    if not place:  # a whole number: its last zeros are only written out
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}e{int(exponent)}", change
