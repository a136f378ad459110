"""Real roots of polynomials with rational coefficients, each enclosed by a change of sign; square roots.

A polynomial is the list of its coefficients, ascending. The roots are looked for on a grid of decimals, where the
polynomial is one of integers with integer arguments: all arithmetic is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.exact import fraction, quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import bits, bits_for_digits

__all__ = ["real_roots", "square_root"]


def real_roots(polynomial: Sequence[Fraction], digits: int) -> list[Measured]:
    """The real roots, ascending, each but zero with a half-width of at most 10**-digits of its size.

    Exact are the root of a linear polynomial, and decimals of so many digits. Two roots that are closer to one another
    than 10**-digits of the smallest may be missed, and so is a double one that is no such decimal.
    """
    while polynomial and not polynomial[-1]:
        polynomial = polynomial[:-1]
    if len(polynomial) < 3:
        return [Measured(-polynomial[0] / polynomial[1], Fraction(0))] if len(polynomial) == 2 else []
    # Cauchy's bounds: no root is larger than the one, none but zero smaller than the other.
    first, largest = next(abs(one) for one in polynomial if one), max(map(abs, polynomial))
    smallest_root, largest_root = first / (first + largest), 1 + largest / abs(polynomial[-1])
    grid = 10 ** (digits - decimal_magnitude(smallest_root))
    unit = math.lcm(*(one.denominator for one in polynomial))
    integers = [int(one * unit) * grid**power for power, one in enumerate(reversed(polynomial))][::-1]
    cells = _cells(integers, math.ceil(largest_root * grid))
    return [Measured(Fraction(low + high, 2 * grid), Fraction(high - low, 2 * grid)) for low, high in cells]


def _cells(polynomial: list[int], bound: int) -> list[tuple[int, int]]:
    """Neighbouring integers with a root between them, or one twice that is a root; up to ``bound`` on both sides."""
    if len(polynomial) == 1:
        return []
    # Between the roots of the derivative the polynomial is monotonic.
    turns = _cells(_derivative(polynomial), bound)
    cells = [turn for turn in turns if not _value_at(polynomial, turn[0])]
    for low, high in pairwise([-bound, *(end for turn in turns for end in turn), bound]):
        if _value_at(polynomial, low) * _value_at(polynomial, high) < 0:
            cells.append(_cell(polynomial, low, high))
    return sorted(cells)


def _cell(polynomial: list[int], low: int, high: int) -> tuple[int, int]:
    """The same of the one root between two integers at which the signs differ."""
    rising, slope = _value_at(polynomial, high) > 0, _derivative(polynomial)
    while high - low > 1:
        middle, width, size = (low + high) // 2, high - low, min(abs(low), abs(high))
        value, steepness = _value_at(polynomial, middle), _value_at(slope, middle)
        if not value:
            return middle, middle
        if width << 20 < size and steepness:  # Newton's step squares the relative width; signs decide
            guess, reach = middle - value // steepness, (width**2 << 8) // size + 1
            below, above = guess - reach, guess + reach
            if low < below < above < high and _value_at(polynomial, below) * _value_at(polynomial, above) < 0:
                low, high = below, above
                continue
        low, high = (low, middle) if (value > 0) == rising else (middle, high)
    return low, high


def _derivative(polynomial: Sequence[Any]) -> list[Any]:
    """The polynomial's derivative."""
    return [power * coefficient for power, coefficient in enumerate(polynomial)][1:]


def _value_at(polynomial: Sequence[Any], x: Any) -> Any:
    """The polynomial's value."""
    total = 0
    for coefficient in reversed(polynomial):
        total = total * x + coefficient
    return total


def square_root(square: Measured | Fraction, digits: int) -> Measured:
    """The root of a positive number, rounded to so many digits."""
    number = square if isinstance(square, Measured) else Measured(square, Fraction(0))
    precision = bits(bits_for_digits(digits))
    root = fraction(precision.context.sqrt(quotient(precision.context, number.value)))
    # Two roundings, and twice what the half-width makes of the root where it is small against the number.
    return Measured(root, 2 * root * precision.epsilon + number.uncertainty / root)
