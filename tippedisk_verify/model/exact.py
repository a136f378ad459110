"""Exact inputs: what a value means before it meets an arithmetic.

A decimal string, a rational, a float or a high-precision number each stand for one real number, possibly plus a
rational multiple of pi (`Exact`). Floating-point numbers of every kind are taken apart into an integer mantissa and
a power of two, so nothing is lost on the way in.
"""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from tippedisk_verify.errors import InputError

__all__ = ["PI", "Approximate", "Exact", "exact", "fraction", "mantissa_exponent", "quotient", "shown", "whole"]

# A decimal exponent beyond this is a mistake, not a physical quantity, and would cost memory without bound.
_LARGEST_DECIMAL_EXPONENT = 10_000
# Python converts integers of up to 4300 decimal digits; nothing here needs more.
_LARGEST_TEXT = 4_000

_NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(
    rf"(?P<sign>[+-]?)(?:(?P<factor>{_NUMBER})?\*?(?P<pi>pi)|(?P<number>{_NUMBER}))(?:/(?P<divisor>\d+))?"
)


@dataclass(frozen=True, slots=True)
class Exact:
    """The real number ``rational + pi_multiple * pi``; what every input is before it meets a precision.

    Angles such as the section beta = pi/2 are written this way because pi/2 rounded to double is not the section.
    """

    rational: Fraction
    pi_multiple: Fraction = Fraction(0)

    def __add__(self, other: object) -> Exact:
        right = exact(other)
        return Exact(self.rational + right.rational, self.pi_multiple + right.pi_multiple)

    def __neg__(self) -> Exact:
        return Exact(-self.rational, -self.pi_multiple)

    def __sub__(self, other: object) -> Exact:
        return self + (-exact(other))

    def __mul__(self, factor: int | Fraction) -> Exact:
        return Exact(self.rational * factor, self.pi_multiple * factor)

    __radd__ = __add__
    __rmul__ = __mul__

    def enclosed(self, working_bits: int) -> tuple[Fraction, Fraction]:
        """Rational lower and upper bounds, at most ``|pi_multiple| * 2**(1 - working_bits)`` apart."""
        if not self.pi_multiple:
            return self.rational, self.rational
        low, high = _pi_bounds(working_bits)
        ends = (self.rational + self.pi_multiple * low, self.rational + self.pi_multiple * high)
        return min(ends), max(ends)

    def rounded(self, mantissa_bits: int) -> tuple[int, int]:
        """``(mantissa, exponent)`` of the nearest number with that many bits (ties to even)."""
        if not self.pi_multiple:
            return _round_fraction(self.rational, mantissa_bits)
        working = mantissa_bits + 64
        while True:  # Ziv's loop: pi is irrational, so the two ends round alike once there are enough bits
            low, high = (_round_fraction(end, mantissa_bits) for end in self.enclosed(working))
            if low == high:
                return low
            working *= 2

    def __float__(self) -> float:
        if not self.pi_multiple:
            return float(self.rational)
        mantissa, exponent = self.rounded(53)
        return math.ldexp(mantissa, exponent)


class Approximate:
    """A number with a half-width (`model.measured`). Wherever a number goes in, it stands for its value."""

    __slots__ = ()

    if TYPE_CHECKING:  # a dataclass would take these for the defaults of its fields

        @property
        def value(self) -> Fraction: ...

        @property
        def uncertainty(self) -> Fraction: ...


def exact(value: object) -> Exact:
    """The exact number that ``value`` stands for.

    Accepts int, float, Fraction, Decimal, numpy long double, mpmath mpf, heyoka real and real128, `Exact`, and
    strings: decimals (``"0.435"``, ``"1e-30"``), ratios (``"1/3"``) and sums with multiples of pi
    (``"pi/2 + 0.4"``, ``"-3*pi/2"``). A float means its exact binary value. A computed number means the rational at
    its middle, ``value``: the same one at every precision, and not the rounded decimals that are printed. Its
    half-width does not go in with it.

    Raises InputError for anything else, for infinities and NaN.
    """
    if isinstance(value, Exact):
        return value
    if isinstance(value, str):
        return _parse(value)
    if isinstance(value, bool):
        raise InputError(f"a number is needed, not {value}")
    if isinstance(value, int | Fraction):
        return Exact(Fraction(value))
    if isinstance(value, Decimal):
        return _parse(str(value))
    if isinstance(value, Approximate):
        return Exact(value.value)
    pair = mantissa_exponent(value)
    if pair is None:
        raise InputError(f"a finite number is needed, not {shown(value)}")
    mantissa, exponent = pair
    return Exact(Fraction(mantissa << exponent) if exponent >= 0 else Fraction(mantissa, 1 << -exponent))


def fraction(value: object) -> Fraction:
    """The rational number that ``value`` stands for. Raises InputError as `exact` does, and for multiples of pi."""
    number = exact(value)
    if number.pi_multiple:
        raise InputError(f"a number without a multiple of pi is needed, not {shown(value)}")
    return number.rational


def quotient(ctx: Any, value: Fraction) -> Any:
    """A rational in an mpmath context, one division of integers."""
    return ctx.mpf(value.numerator) / value.denominator


def whole(value: object, least: int, most: int) -> int | None:
    """The integer that a number of Python's or NumPy's is, if it lies between these two; None for all else."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return None
    return number if least <= number <= most and not isinstance(value, bool) else None


def shown(value: object) -> str:
    """The beginning of a value as text, for messages."""
    try:
        return f"{value!s:.40}"
    except ValueError:  # Python writes no integers of more than 4300 digits
        return "a number of thousands of digits"


@lru_cache(maxsize=1024)
def _parse(text: str) -> Exact:
    shown = text.strip()[:60]
    complaint = f"'{shown}' is not a finite decimal number such as 30.4, 1e-3, 1/3 or pi/2+0.4"
    if len(text) > _LARGEST_TEXT:
        raise InputError(f"'{shown}...' is longer than {_LARGEST_TEXT} characters")
    stripped = re.sub(r"\s+", "", text)
    if not stripped or re.search(r"[\d.]\s+[\d.]", text):
        raise InputError(complaint)
    total = Exact(Fraction(0))
    position = 0
    while position < len(stripped):
        term = _TERM.match(stripped, position)
        if term is None or (position and not term["sign"]):
            raise InputError(complaint)
        size = _decimal_fraction(term["number"] or term["factor"] or "1", shown)
        if term["divisor"]:
            if not int(term["divisor"]):
                raise InputError(f"'{shown}' divides by zero")
            size /= int(term["divisor"])
        if term["sign"] == "-":
            size = -size
        total += Exact(Fraction(0), size) if term["pi"] else Exact(size)
        position = term.end()
    return total


def _decimal_fraction(text: str, shown: str) -> Fraction:
    exponent = re.split("[eE]", text)[1:]
    if exponent and (len(exponent[0]) > 8 or abs(int(exponent[0])) > _LARGEST_DECIMAL_EXPONENT):
        raise InputError(f"'{shown}' has a decimal exponent beyond {_LARGEST_DECIMAL_EXPONENT}")
    return Fraction(text)


@lru_cache(maxsize=64)
def _pi_bounds(working_bits: int) -> tuple[Fraction, Fraction]:
    from mpmath.libmp import pi_fixed

    scaled = int(pi_fixed(working_bits + 8)) >> 8
    # The guard bits of pi_fixed leave its last kept bit uncertain by at most one.
    return Fraction(scaled - 1, 1 << working_bits), Fraction(scaled + 2, 1 << working_bits)


def _round_fraction(value: Fraction, mantissa_bits: int) -> tuple[int, int]:
    """Nearest ``mantissa * 2**exponent``, ties to even; the mantissa is odd or zero, so the pair is unique."""
    from mpmath.libmp import from_rational, round_nearest

    sign, mantissa, exponent, _ = from_rational(value.numerator, value.denominator, mantissa_bits, round_nearest)
    return (-int(mantissa) if sign else int(mantissa)), exponent


PI = Exact(Fraction(0), Fraction(1))


def mantissa_exponent(value: Any) -> tuple[int, int] | None:
    """Integers with ``value = mantissa * 2**exponent`` exactly; None for infinities and NaN."""
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        numerator, denominator = value.as_integer_ratio()
        return numerator, 1 - denominator.bit_length()
    if isinstance(value, int):
        return int(value), 0
    parts = getattr(value, "_mpf_", None)
    if parts is not None:
        sign, mantissa, exponent, _ = parts
        if not mantissa and exponent:
            return None
        return (-int(mantissa) if sign else int(mantissa)), int(exponent)
    kind = type(value).__name__
    if kind == "longdouble":
        import numpy

        if not numpy.isfinite(value):
            return None
        mantissa, exponent = numpy.frexp(value)
        return int(numpy.ldexp(mantissa, 64)), int(exponent) - 64
    if kind in ("real", "real128"):
        return _heyoka_mantissa(value, getattr(value, "prec", 113))
    if getattr(value, "shape", None) == () and getattr(value, "dtype", "object") != "object":
        return mantissa_exponent(value.item())  # numpy's other scalars
    raise InputError(f"a number is needed, not an object of type {kind}")


def _heyoka_mantissa(value: Any, precision_bits: int) -> tuple[int, int] | None:
    if value != value or value - value != 0:
        return None
    if value == 0:
        return 0, 0
    size = abs(float(value))
    # A shift by too much is harmless (the integer only gets zero bits at its end), by too little would lose bits.
    if 1e-290 < size < 1e290:
        magnitude = math.frexp(size)[1]
    else:
        import numpy

        magnitude = math.ceil(float(numpy.log2(abs(value)))) + 1
    shift = precision_bits + 2 - magnitude
    half = shift // 2  # two factors: neither power leaves the exponent range
    two = type(value)(2, precision_bits) if hasattr(value, "prec") else type(value)(2)
    return int(value * two**half * two ** (shift - half)), -shift
