"""Real roots of polynomials with rational coefficients, and square roots.

Each root is enclosed by a change of sign.

A polynomial is the list of its coefficients, ascending. Roots are searched on a grid of decimals.
There the polynomial has integer coefficients and integer arguments, so all arithmetic is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import bits_for_digits, precision_of_bits

__all__ = ["real_roots", "square_root"]


def real_roots(polynomial: Sequence[Fraction], digits: int) -> list[Measured]:
    """Return the real roots of a polynomial, ascending.

    Each root other than zero has a half-width of at most 10**-digits of its size. The root of a
    linear polynomial and roots that are decimals of ``digits`` digits are exact. Two cases may be
    missed: two roots closer together than 10**-digits of the smallest root, and a double root that
    is not such a decimal.

    Args:
        polynomial: The coefficients, ascending.
        digits: Significant digits of the smallest root.
    """
    while polynomial and not polynomial[-1]:
        polynomial = polynomial[:-1]
    if len(polynomial) < 3:
        return (
            [Measured(-polynomial[0] / polynomial[1], Fraction(0))] if len(polynomial) == 2 else []
        )
    # Cauchy's bounds: every root but zero lies between these two sizes.
    first = next(abs(coefficient) for coefficient in polynomial if coefficient)
    largest = max(map(abs, polynomial))
    smallest_root, largest_root = first / (first + largest), 1 + largest / abs(polynomial[-1])
    grid = 10 ** (digits - decimal_magnitude(smallest_root))
    unit = math.lcm(*(coefficient.denominator for coefficient in polynomial))
    scaled = [int(coefficient * unit) for coefficient in polynomial]
    integers = [number * grid**power for power, number in enumerate(reversed(scaled))][::-1]
    cells = _isolate_roots(integers, math.ceil(largest_root * grid))
    return [
        Measured(Fraction(low + high, 2 * grid), Fraction(high - low, 2 * grid))
        for low, high in cells
    ]


def _isolate_roots(polynomial: list[int], bound: int) -> list[tuple[int, int]]:
    """Isolate the real roots of a polynomial: return a pair of neighbouring integers for each root,
    ascending.

    The root lies between the two. An integer root is returned twice, as (n, n). The search covers
    ``-bound`` to ``bound``.
    """
    if len(polynomial) == 1:
        return []
    # Between the roots of the derivative the polynomial is monotonic.
    turns = _isolate_roots(_derivative(polynomial), bound)
    cells = [turn for turn in turns if not _value_at(polynomial, turn[0])]
    for low, high in pairwise([-bound, *(end for turn in turns for end in turn), bound]):
        if _value_at(polynomial, low) * _value_at(polynomial, high) < 0:
            cells.append(_narrow_to_unit_interval(polynomial, low, high))
    return sorted(cells)


def _narrow_to_unit_interval(polynomial: list[int], low: int, high: int) -> tuple[int, int]:
    """Return the pair of neighbouring integers between which the only root between two integers
    lies.

    An integer root n is returned as (n, n).
    """
    rising, slope = _value_at(polynomial, high) > 0, _derivative(polynomial)
    while high - low > 1:
        middle, width, size = (low + high) // 2, high - low, min(abs(low), abs(high))
        value, steepness = _value_at(polynomial, middle), _value_at(slope, middle)
        if not value:
            return middle, middle
        # Newton's step squares the relative width; signs decide
        if width << 20 < size and steepness:
            guess, reach = middle - value // steepness, (width**2 << 8) // size + 1
            below, above = guess - reach, guess + reach
            if (
                low < below < above < high
                and _value_at(polynomial, below) * _value_at(polynomial, above) < 0
            ):
                low, high = below, above
                continue
        low, high = (low, middle) if (value > 0) == rising else (middle, high)
    return low, high


def _derivative(polynomial: Sequence[Any]) -> list[Any]:
    """Return the coefficients of the polynomial's derivative."""
    return [power * coefficient for power, coefficient in enumerate(polynomial)][1:]


def _value_at(polynomial: Sequence[Any], x: Any) -> Any:
    """Return the polynomial's value at ``x``."""
    total = 0
    for coefficient in reversed(polynomial):
        total = total * x + coefficient
    return total


def square_root(square: Measured | Fraction, digits: int) -> Measured:
    """Return the square root of a positive number, rounded to ``digits`` digits.

    Args:
        square: A positive number.
        digits: The digits of the root.
    """
    number = square if isinstance(square, Measured) else Measured(square, Fraction(0))
    precision = precision_of_bits(bits_for_digits(digits))
    root = fraction(precision.context.sqrt(rational_in_context(precision.context, number.value)))
    # Two roundings, and twice the effect of the half-width, which is small against the number.
    return Measured(root, 2 * root * precision.epsilon + number.uncertainty / root)
