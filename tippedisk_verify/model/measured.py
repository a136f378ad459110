"""Results: a value with the half-width that holds the truth, the factor from a distance to a half-width, arithmetic.

What is printed, compared and combined still holds the truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.exact import exact, fraction, quotient, shown

__all__ = ["DISTANCES", "Bounded", "Measured", "decimal_magnitude", "exact_text", "rounded_down", "rounded_up"]

#: A half-width in units of the distance to a sharper run. It holds the truth if that run is at most half as wrong:
#: |q - true| <= |q - sharp| + |sharp - true| <= |q - sharp| + |q - true| / 2.
DISTANCES = 2


class Bounded:
    """Whatever has a value and the absolute half-width that is claimed to hold the true value: it behaves as a number.

    float() and `mpf` take its value. Sums, differences, products and quotients hold whatever the true values in the
    half-widths give; numbers without one are exact. Each half-width counts as independent, so x - x is zero with twice
    the half-width. A comparison that the half-widths leave open raises Shortfall.
    """

    __slots__ = ()

    if TYPE_CHECKING:  # a dataclass would take these for the defaults of its fields

        @property
        def value(self) -> Fraction: ...

        @property
        def uncertainty(self) -> Fraction: ...

    def __float__(self) -> float:
        """The double nearest to the value."""
        return float(self.value)

    def mpf(self) -> Any:
        """The value as an mpmath number, to the precision that mpmath has at the time."""
        import mpmath

        return quotient(mpmath.mp, self.value)

    def __lt__(self, other: object) -> bool:
        return self._below(other, lambda difference: difference < 0)

    def __le__(self, other: object) -> bool:
        return self._below(other, lambda difference: difference <= 0)

    def __gt__(self, other: object) -> bool:
        return self._below(other, lambda difference: difference > 0)

    def __ge__(self, other: object) -> bool:
        return self._below(other, lambda difference: difference >= 0)

    def _below(self, other: object, answer: Callable[[Fraction], bool]) -> bool:
        """A comparison, if it comes out alike wherever in their half-widths the true values lie."""
        if (theirs := _operand(other)) is None:
            return NotImplemented  # type: ignore[no-any-return]
        difference: Measured = self - theirs
        low, high = (difference.value + sign * difference.uncertainty for sign in (-1, 1))
        if answer(low) != answer(high):
            raise Shortfall(
                f"{self} and {theirs} cannot be told apart: ask for more digits, or compare the values by float()"
            )
        return answer(low)

    def __neg__(self) -> Measured:
        return Measured(-self.value, self.uncertainty)

    def __abs__(self) -> Measured:
        return Measured(abs(self.value), self.uncertainty)

    def __add__(self, other: object) -> Measured:
        if (theirs := _operand(other)) is None:
            return NotImplemented
        return Measured(self.value + theirs.value, self.uncertainty + theirs.uncertainty)

    __radd__ = __add__

    def __sub__(self, other: object) -> Measured:
        return NotImplemented if (theirs := _operand(other)) is None else self + -theirs

    def __rsub__(self, other: object) -> Measured:
        return NotImplemented if (theirs := _operand(other)) is None else theirs + -self

    def __mul__(self, other: object) -> Measured:
        if (theirs := _operand(other)) is None:
            return NotImplemented
        mine, its = self.uncertainty, theirs.uncertainty
        width = abs(self.value) * its + abs(theirs.value) * mine + mine * its
        return Measured(self.value * theirs.value, width)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Measured:
        return NotImplemented if (theirs := _operand(other)) is None else self * theirs._inverse()

    def __rtruediv__(self, other: object) -> Measured:
        return NotImplemented if (theirs := _operand(other)) is None else theirs * self._inverse()

    def _inverse(self) -> Measured:
        least = abs(self.value) - self.uncertainty
        if least <= 0:
            raise ZeroDivisionError(f"{self} may be zero")
        return Measured(1 / self.value, self.uncertainty / (abs(self.value) * least))


@dataclass(frozen=True, slots=True, repr=False)
class Measured(Bounded):
    """A value and its half-width, both exact rationals; what computations return.

    `json` and ``str`` print decimals. What they print still holds the truth: the rounding of the printed value is added
    to the printed half-width, which itself is rounded up. Equality is that of value and half-width.
    """

    value: Fraction
    uncertainty: Fraction

    @classmethod
    def of(cls, value: object, uncertainty: object) -> Measured:
        """From numbers of any kind, or decimals as texts. Raises InputError if the half-width is negative."""
        number, width = (_rational(part) for part in (value, uncertainty))
        if width < 0:
            raise InputError("an uncertainty cannot be negative")
        return cls(number, width)

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

    def __format__(self, spec: str) -> str:
        """The value as ``spec`` says, such as '.10g'; places beyond its decimals are zeros. Else as ``str``."""
        if not spec:
            return str(self)
        return format(Decimal(self.decimals()[0]) if self.value else 0.0, spec)

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

    def __repr__(self) -> str:
        return f"Measured({self})"


def _rational(value: object) -> Fraction:
    if not isinstance(value, str | Decimal):
        return fraction(value)
    number = exact(value)
    if number.pi_multiple:
        raise InputError(f"a decimal is needed, not {shown(value)}")
    return number.rational


def _operand(other: object) -> Measured | None:
    """The other side of an operation: a number with a half-width, or one of any other kind, which is exact."""
    if isinstance(other, Bounded):
        return other if isinstance(other, Measured) else Measured(other.value, other.uncertainty)
    if isinstance(other, str | None):
        return None
    try:
        return Measured(_rational(other), Fraction(0))
    except InputError:
        if isinstance(other, float | Decimal):  # infinite, or not a number
            raise
        return None


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
    """``steps * 10**place`` as a decimal string, in scientific notation above 10^6 and below 10^-5."""
    if not steps:
        place = min(place, 0)
    digits = str(Decimal(abs(steps)))  # unlike str(int), without a limit of 4300 digits
    sign = "-" if steps < 0 else ""
    magnitude = len(digits) - 1 + place
    if steps and (magnitude < -5 or magnitude > 6 or (magnitude == 6 and digits.strip("0") != "1")):
        if place == 0:  # a whole number: its last zeros are only written out
            digits = digits.rstrip("0")
        mantissa = digits[0] + ("." + digits[1:] if len(digits) > 1 else "")
        return f"{sign}{mantissa}e{magnitude}"
    if place >= 0:
        return sign + digits + "0" * place
    digits = digits.rjust(1 - place, "0")
    return f"{sign}{digits[:place]}.{digits[place:]}"
