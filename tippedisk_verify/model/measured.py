"""Results: a value with the half-width that holds the truth, and decimals that keep the promise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import fraction

__all__ = ["DISTANCES", "Measured", "decimal_magnitude", "exact_text", "rounded_down", "rounded_up"]

#: Of the distance to a sharper run, for a half-width. They hold as soon as that run is half as wrong: it follows from
#: |q - true| <= |q - sharp| + |sharp - true| <= |q - sharp| + |q - true| / 2.
DISTANCES = 2


@dataclass(frozen=True, slots=True)
class Measured:
    """A value and the absolute half-width that is claimed to hold the true value.

    Both are exact rationals; `json` and ``str`` print decimals. What they print still holds the truth: the rounding
    of the printed value is added to the printed half-width, which itself is rounded up.
    """

    value: Fraction
    uncertainty: Fraction

    @classmethod
    def of(cls, value: object, uncertainty: object) -> Measured:
        """From any numbers that `exact` takes (without pi). Raises InputError if the half-width is negative."""
        width = fraction(uncertainty)
        if width < 0:
            raise InputError("an uncertainty cannot be negative")
        return cls(fraction(value), width)

    @classmethod
    def compared(cls, value: object, sharper: object, epsilon: Fraction) -> Measured:
        """A value with the half-width that its distance to a run with more digits gives.

        The half-width is twice that distance (`DISTANCES`), and an ulp (``epsilon`` relative) of the value is the least
        that can be claimed.
        """
        mine = fraction(value)
        return cls(mine, abs(mine - fraction(sharper)) * DISTANCES + abs(mine) * epsilon)

    def holds(self, truth: object) -> bool:
        """Whether ``truth`` lies within the half-width."""
        return abs(fraction(truth) - self.value) <= self.uncertainty

    def contains(self, other: Measured) -> bool:
        """Whether all that ``other`` may stand for lies within the half-width."""
        return abs(other.value - self.value) + other.uncertainty <= self.uncertainty

    def __float__(self) -> float:
        return float(self.value)

    def decimals(self) -> tuple[str, str]:
        """``(value, uncertainty)`` as decimal strings."""
        if not self.uncertainty:
            return _exact_decimals(self.value)
        # Two digits beyond the leading digit of the half-width: the rounding adds at most 5 % to it.
        place = decimal_magnitude(self.uncertainty) - 2
        unit = Fraction(10) ** place
        steps = round(self.value / unit)
        return _decimal_text(steps, place), rounded_up(self.uncertainty + abs(self.value - steps * unit))

    def json(self) -> dict[str, str]:
        """``{"value": "<decimal>", "uncertainty": "<decimal>"}``."""
        value, uncertainty = self.decimals()
        return {"value": value, "uncertainty": uncertainty}

    def __str__(self) -> str:
        value, uncertainty = self.decimals()
        return f"{value} ± {uncertainty}"


def exact_text(value: Fraction) -> str:
    """The number itself as text: a decimal, or a ratio of integers if no decimal ends."""
    text, cut = _exact_decimals(value)
    return text if cut == "0" else f"{Decimal(value.numerator)}/{Decimal(value.denominator)}"


def rounded_up(value: Fraction) -> str:
    """The least decimal of two significant digits that is not smaller than a positive ``value``."""
    place = decimal_magnitude(value) - 1
    return _decimal_text(math.ceil(value / Fraction(10) ** place), place)


def rounded_down(value: Fraction) -> str:
    """The greatest decimal of two significant digits that is not larger than a positive ``value``."""
    place = decimal_magnitude(value) - 1
    return _decimal_text(math.floor(value / Fraction(10) ** place), place)


def decimal_magnitude(value: Fraction) -> int:
    """The integer k with 10**k <= |value| < 10**(k+1), for a value that is not zero."""
    size = abs(value)
    guess = math.floor((size.numerator.bit_length() - size.denominator.bit_length()) * math.log10(2))
    while Fraction(10) ** guess > size:
        guess -= 1
    while Fraction(10) ** (guess + 1) <= size:
        guess += 1
    return guess


def _exact_decimals(value: Fraction) -> tuple[str, str]:
    denominator, twos, fives = value.denominator, 0, 0
    while denominator % 2 == 0:
        denominator, twos = denominator // 2, twos + 1
    while denominator % 5 == 0:
        denominator, fives = denominator // 5, fives + 1
    if denominator == 1:
        place = -max(twos, fives)
        return _decimal_text(int(value / Fraction(10) ** place), place), "0"
    place = decimal_magnitude(value) - 50  # a repeating decimal: fifty digits and the half-width of the cut
    unit = Fraction(10) ** place
    steps = round(value / unit)
    return _decimal_text(steps, place), rounded_up(abs(value - steps * unit))


def _decimal_text(steps: int, place: int) -> str:
    """``steps * 10**place`` as a decimal string, in scientific notation only where it is far from 1."""
    digits = str(Decimal(abs(steps)))  # unlike str(int), without a limit of 4300 digits
    sign = "-" if steps < 0 else ""
    magnitude = len(digits) - 1 + place
    if steps and (magnitude < -5 or (place > 0 and magnitude > 15)):
        mantissa = digits[0] + ("." + digits[1:] if len(digits) > 1 else "")
        return f"{sign}{mantissa}e{magnitude}"
    if place >= 0:
        return sign + digits + "0" * place
    digits = digits.rjust(1 - place, "0")
    return f"{sign}{digits[:place]}.{digits[place:]}"
