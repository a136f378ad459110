"""Exact inputs: the real number that a value means before any rounding.

A decimal string, a rational, a float or a high-precision number stands for one real number,
possibly plus a rational multiple of pi (`Exact`). Floating-point numbers of every kind are split
into an integer mantissa and a power of two, so no input loses digits.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard, TypeVar

from tippedisk_verify.errors import InputError

__all__ = [
    "PI",
    "Approximate",
    "BinaryFloat",
    "Exact",
    "as_list",
    "checked_integer",
    "exact",
    "fraction",
    "is_one_of",
    "mantissa_exponent",
    "parse_long_fraction",
    "plain_number",
    "rational_in_context",
    "refuse_units_and_masks",
    "short_text",
]

Name = TypeVar("Name", bound=str)

# A larger decimal exponent is a mistake, and would cost memory without bound.
_MAX_DECIMAL_EXPONENT = 10_000
# The same for powers of two; even the widest arithmetic needs far less.
_MAX_BINARY_EXPONENT = 100_000_000
# Python converts integers of up to 4300 decimal digits; nothing here needs more.
_MAX_TEXT = 4_000
# Attributes by which the numbers of packages for physical units are recognised.
_UNIT_ATTRIBUTES = ("unit", "units", "dimensionality", "dimensions")
_HAS_UNIT = "'{}' has a unit: give it in rad/s, rad, s or other SI units, without a unit"

_NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(
    rf"(?P<sign>[+-]?)(?:(?P<factor>{_NUMBER})?\*?(?P<pi>pi)|(?P<number>{_NUMBER}))(?:/(?P<divisor>\d+))?"
)


@dataclass(frozen=True, slots=True)
class Exact:
    """The real number ``rational + pi_multiple * pi``: the exact form of every input.

    Angles such as the section beta = pi/2 need the multiple, because pi/2 rounded to double is not
    the section.
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

    def bounds(self, working_bits: int) -> tuple[Fraction, Fraction]:
        """Return rational lower and upper bounds of this exact number, which may contain a multiple
        of pi.

        They are at most ``|pi_multiple| * 2**(1 - working_bits)`` apart.

        Args:
            working_bits: The bits of pi after the binary point.
        """
        if not self.pi_multiple:
            return self.rational, self.rational
        low, high = _pi_bounds(working_bits)
        ends = (self.rational + self.pi_multiple * low, self.rational + self.pi_multiple * high)
        return min(ends), max(ends)

    def rounded(self, mantissa_bits: int) -> tuple[int, int]:
        """Return this exact number rounded to a floating-point number of so many bits, as
        ``(mantissa, exponent)``.

        Ties go to the even mantissa.

        Args:
            mantissa_bits: The bits of the mantissa.
        """
        if not self.pi_multiple:
            return _round_fraction(self.rational, mantissa_bits)
        return _round_with_pi(self, mantissa_bits)

    def __float__(self) -> float:
        if not self.pi_multiple:
            return float(self.rational)
        mantissa, exponent = self.rounded(53)
        return math.ldexp(mantissa, exponent)


class Approximate:
    """The base class of numbers with a half-width (`numbers.measured`); as an input such a number
    means its value.
    """

    __slots__ = ()

    if TYPE_CHECKING:  # a dataclass would take these for the defaults of its fields

        @property
        def value(self) -> Fraction: ...

        @property
        def uncertainty(self) -> Fraction: ...


class BinaryFloat(NamedTuple):
    """An exact floating-point number, ``mantissa * 2**exponent``, both integers."""

    mantissa: int
    exponent: int


def plain_number(value: object) -> Exact | BinaryFloat | Decimal | float | str:
    """Convert an object of any kind to the real number that it stands for. This is the only place
    that decides what a number is.

    Every speed, state, time, parameter and answer passes through it. An object is first checked for
    a unit, a mask and the like, then unwrapped, and its content is checked in turn.

    - A text (str) is returned as it is: the caller reads it.
    - A float of Python's or NumPy's in double precision is a float, a Decimal a Decimal.
    - Other floating-point numbers become `BinaryFloat`: those of NumPy, mpmath, gmpy2, heyoka,
      python-flint and SymPy. Their infinities and NaN become a float.
    - Integers and rationals of every kind become `Exact`: objects with ``__index__``, or with a
      numerator and a denominator.
    - A number with a half-width of this package means its value, exactly.
    - An array of one element, of any shape, means that element; so does a scalar of JAX, PyTorch,
      xarray, pandas or PyArrow.

    Args:
        value: Any object.

    Raises:
        InputError: If the object is anything else, or qualifies its number. Such objects are truth
            values, masked elements, quantities with a unit, complex numbers and balls with a
            radius. Constants such as mpmath's pi, whose value depends on the precision, are refused
            too.
    """
    kind = type(value)
    if kind in (float, str, Decimal, Exact, BinaryFloat):
        return value  # type: ignore[return-value]
    if kind in (int, Fraction):
        return Exact(Fraction(value))  # type: ignore[call-overload]
    if isinstance(value, Approximate):
        return Exact(value.value)
    refuse_units_and_masks(value)
    if isinstance(value, bool | complex | None):
        raise InputError(f"a real number is needed, not {short_text(value)}")
    for base in (str, float, Decimal):
        if isinstance(value, base):
            return base(value)
    found = _binary_float(value)
    return _unwrapped(value) if found is None else found


def refuse_units_and_masks(value: Any) -> None:
    """Raise InputError for a quantity with a unit, a masked value, or an array with such elements.

    Args:
        value: Any object.

    Raises:
        InputError: If the value is such an object.
    """
    if not _may_have_unit_or_mask(type(value)):  # type: ignore[arg-type]
        return
    if any(hasattr(value, name) for name in _UNIT_ATTRIBUTES):
        raise InputError(_HAS_UNIT.format(short_text(value)))
    mask = getattr(value, "mask", False)  # in pandas a method
    if not callable(mask) and getattr(mask, "any", lambda: mask)():
        raise InputError("a number is needed, not a masked one")


@lru_cache(maxsize=256)
def _may_have_unit_or_mask(kind: type) -> bool:
    """Return True if objects of a class can have a unit or a mask.

    The class has such attributes, or its objects have attributes of their own.
    """
    own = any("__dict__" in vars(base) for base in kind.__mro__)
    return own or any(hasattr(kind, name) for name in (*_UNIT_ATTRIBUTES, "mask", "__getattr__"))


def _binary_float(value: Any) -> BinaryFloat | float | None:
    """Convert a float of NumPy, heyoka, mpmath or a similar package to mantissa and exponent.

    Returns NaN if it is not finite, and None for any other object. Raises InputError for a ball
    with a nonzero radius.
    """
    kind = type(value).__name__
    if kind in ("real", "real128"):
        return _heyoka_mantissa(value, getattr(value, "prec", 113))
    if kind == "longdouble":
        import numpy

        if not numpy.isfinite(value):
            return math.nan
        mantissa, exponent = numpy.frexp(value)
        return BinaryFloat(int(numpy.ldexp(mantissa, 64)), int(exponent) - 64)
    if hasattr(value, "rad") and value.rad() != 0:
        raise InputError(f"a number is needed, not the ball {short_text(value)}: give its midpoint")
    parts = None if callable(value) else getattr(value, "_mpf_", None)
    if parts is None:
        return None
    sign, mantissa, exponent, _ = parts
    if not mantissa and exponent:
        return math.nan
    return BinaryFloat(-int(mantissa) if sign else int(mantissa), int(exponent))


def _unwrapped(value: Any) -> Exact | BinaryFloat | Decimal | float | str:
    """Return the content of an array of one element or of another package's scalar.

    Other objects are read as integers or as ratios of integers.
    """
    unknown = InputError(f"a real number is needed, not an object of type {type(value).__name__}")
    if callable(value):
        raise unknown
    if hasattr(value, "item") and hasattr(value, "shape"):
        if getattr(value.dtype, "kind", "") in ("m", "M"):  # NumPy's time spans and dates
            raise InputError(_HAS_UNIT.format(short_text(value)))
        if (count := math.prod(value.shape)) != 1:
            raise InputError(f"one number is needed, not an array of {count}")
        return plain_number(value.item())
    if hasattr(value, "as_py"):
        return plain_number(value.as_py())
    try:
        if hasattr(value, "__index__"):
            return Exact(Fraction(operator.index(value)))
        if hasattr(value, "numerator"):
            return Exact(
                Fraction(operator.index(value.numerator), operator.index(value.denominator))
            )
        return Exact(Fraction(*map(int, value.as_integer_ratio())))
    except (ValueError, OverflowError):  # raised by a number that is infinite or NaN
        return math.nan
    except (TypeError, AttributeError):
        raise unknown from None


def as_list(values: object) -> list[Any]:
    """Return the entries of a list or an array; a single number or text is the only entry.

    Args:
        values: A list, an array, a number or a text.

    Raises:
        InputError: If the array has a unit or masked elements, as in `refuse_units_and_masks`.
    """
    refuse_units_and_masks(values)
    single = (
        isinstance(values, str | bytes)
        or getattr(values, "shape", None) == ()
        or not isinstance(values, Iterable)
    )
    return [values] if single else list(values)  # type: ignore[call-overload]


def exact(value: object) -> Exact:
    """Return the exact number that a number or text means.

    A number of any kind (`plain_number`) is accepted. Texts are decimals (``"0.435"``,
    ``"1e-30"``), ratios (``"1/3"``) and sums with multiples of pi (``"pi/2 + 0.4"``,
    ``"-3*pi/2"``). A float means its exact binary value. A computed number means its midpoint
    ``value``, an exact rational: the same one at every precision, and not the rounded decimals that
    are printed. Its half-width is dropped.

    Args:
        value: A number of any kind, or a text.

    Raises:
        InputError: If the value is infinite, NaN, or not a number.
    """
    number = plain_number(value)
    if isinstance(number, Exact):
        return number
    if isinstance(number, str | Decimal):
        return _parse(str(number))
    pair = mantissa_exponent(number)
    if pair is None or abs(pair.exponent) > _MAX_BINARY_EXPONENT:
        raise InputError(f"a finite number is needed, not {short_text(value)}")
    mantissa, exponent = pair
    return Exact(
        Fraction(mantissa << exponent) if exponent >= 0 else Fraction(mantissa, 1 << -exponent)
    )


def fraction(value: object) -> Fraction:
    """Convert a number or text to the exact rational number that it means.

    Args:
        value: A number of any kind, or a text.

    Raises:
        InputError: As for `exact`, and for a multiple of pi.
    """
    number = exact(value)
    if number.pi_multiple:
        raise InputError(f"a number without a multiple of pi is needed, not {short_text(value)}")
    return number.rational


def parse_long_fraction(text: str) -> Fraction:
    """Return the number of a decimal or a ratio of any length, as `decimals.exact_text` writes it.

    Args:
        text: The decimal or the ratio.

    Raises:
        InputError: If a decimal exponent is too large.
        ArithmeticError: If the text is not such a number.
        ValueError: Likewise; which of the two depends on the text.
    """
    parts = [_decimal_fraction(part, part[:60]) for part in text.split("/")]
    numerator, denominator = parts if len(parts) > 1 else (*parts, Fraction(1))
    return numerator / denominator


def rational_in_context(ctx: Any, value: Fraction) -> Any:
    """Convert a rational number to a number of an mpmath context, by one division of integers.

    Args:
        ctx: The mpmath context.
        value: The rational.
    """
    return ctx.mpf(value.numerator) / value.denominator


def checked_integer(value: object, least: int, most: int, complaint: str) -> int:
    """Check an integer of any kind and return it as an int.

    Args:
        value: An object of any type.
        least, most: The bounds, both included.
        complaint: The message of the error, with {} in place of the value.

    Raises:
        InputError: If ``value`` is not an integer within the bounds.
    """
    with suppress(InputError):
        number = plain_number(value)
        if (
            isinstance(number, Exact)
            and not number.pi_multiple
            and number.rational.denominator == 1
            and least <= number.rational <= most
        ):
            return int(number.rational)
    raise InputError(complaint.format(short_text(value)))


def is_one_of(value: object, names: Iterable[Name]) -> TypeGuard[Name]:
    """Return True if a value is one of some texts.

    A value that is no text, such as a list or an array, is not compared with them.

    Args:
        value: Any object.
        names: The texts.
    """
    return isinstance(value, str) and value in tuple(names)


def short_text(value: object) -> str:
    """Return a value as text for a message: its first forty characters, on one line."""
    try:
        # `python -bb` refuses str() of these
        text = repr(value) if isinstance(value, bytes | bytearray) else str(value)
    except Exception:
        return f"an object of type {type(value).__name__}"
    return " ".join(text.split())[:40] if len(text) <= _MAX_TEXT else text[:40]


@lru_cache(maxsize=1024)
def _parse(text: str) -> Exact:
    shown = text.strip()[:60]
    complaint = f"'{shown}' is not a finite decimal number such as 30.4, 1e-3, 1/3 or pi/2+0.4"
    if len(text) > _MAX_TEXT:
        raise InputError(f"'{shown}...' is longer than {_MAX_TEXT} characters")
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
            if not (divisor := Fraction(Decimal(term["divisor"]))):
                raise InputError(f"'{shown}' divides by zero")
            size /= divisor
        if term["sign"] == "-":
            size = -size
        total += Exact(Fraction(0), size) if term["pi"] else Exact(size)
        position = term.end()
    return total


def _decimal_fraction(text: str, shown: str) -> Fraction:
    exponent = re.split("[eE]", text)[1:]
    if exponent and (len(exponent[0]) > 8 or abs(int(exponent[0])) > _MAX_DECIMAL_EXPONENT):
        raise InputError(f"'{shown}' has a decimal exponent beyond {_MAX_DECIMAL_EXPONENT}")
    # Unlike Fraction(text), without a limit of digits that a program may set
    return Fraction(Decimal(text))


@lru_cache(maxsize=64)
def _pi_bounds(working_bits: int) -> tuple[Fraction, Fraction]:
    from mpmath.libmp import pi_fixed

    scaled = int(pi_fixed(working_bits + 8)) >> 8
    # The guard bits of pi_fixed leave its last kept bit uncertain by at most one.
    return Fraction(scaled - 1, 1 << working_bits), Fraction(scaled + 2, 1 << working_bits)


@lru_cache(maxsize=256)
def _round_with_pi(number: Exact, mantissa_bits: int) -> tuple[int, int]:
    """Round an exact number with a multiple of pi to so many bits, and return mantissa and
    exponent.
    """
    working = mantissa_bits + 64
    # Ziv's loop: pi is irrational, so the two ends round alike once there are enough bits
    while True:
        low, high = (_round_fraction(end, mantissa_bits) for end in number.bounds(working))
        if low == high:
            return low
        working *= 2


def _round_fraction(value: Fraction, mantissa_bits: int) -> tuple[int, int]:
    """Round a rational number to a floating-point number ``mantissa * 2**exponent`` of so many
    bits, and return both integers.

    Ties go to even. The mantissa is odd or zero, so the pair is unique.
    """
    from mpmath.libmp import from_rational, round_nearest

    sign, mantissa, exponent, _ = from_rational(
        value.numerator, value.denominator, mantissa_bits, round_nearest
    )
    return (-int(mantissa) if sign else int(mantissa)), exponent


PI = Exact(Fraction(0), Fraction(1))


def mantissa_exponent(value: object) -> BinaryFloat | None:
    """Return a floating-point number as integers, exactly; None for infinities and NaN.

    The result satisfies ``value = mantissa * 2**exponent``.

    Args:
        value: A floating-point number of any kind.

    Raises:
        InputError: If ``value`` is not a floating-point number.
    """
    number = plain_number(value)
    if isinstance(number, float):
        if not math.isfinite(number):
            return None
        numerator, denominator = number.as_integer_ratio()
        return BinaryFloat(numerator, 1 - denominator.bit_length())
    if isinstance(number, BinaryFloat):
        return number
    raise InputError(f"a floating-point number is needed, not {short_text(value)}")


def _heyoka_mantissa(value: Any, precision_bits: int) -> BinaryFloat | float:
    if value != value or value - value != 0:
        return math.nan
    if value == 0:
        return BinaryFloat(0, 0)
    size = abs(float(value))
    # A shift that is too large only adds zero bits at the end; one that is too small loses bits.
    if 1e-290 < size < 1e290:
        magnitude = math.frexp(size)[1]
    else:
        import numpy

        magnitude = math.ceil(float(numpy.log2(abs(value)))) + 1
    shift = precision_bits + 2 - magnitude
    half = shift // 2  # two factors: neither power leaves the exponent range
    two = type(value)(2, precision_bits) if hasattr(value, "prec") else type(value)(2)
    return BinaryFloat(int(value * two**half * two ** (shift - half)), -shift)
