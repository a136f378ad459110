"""A number with its half-width: its arithmetic, comparison, and the digits that are printed.

The half-width still holds the truth after numbers are printed, compared or combined.
`HALF_WIDTH_FACTOR` is the factor from a distance between two runs to a half-width.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_UP, Decimal
from fractions import Fraction
from functools import partialmethod
from typing import Any

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.numbers.decimals import (
    decimal_arithmetic,
    decimal_magnitude,
    exact_decimals,
    round_to_place,
    round_up,
)
from tippedisk_verify.numbers.exact import Approximate, fraction, rational_in_context, short_text
from tippedisk_verify.numbers.precision import DOUBLE_DIGITS

__all__ = ["HALF_WIDTH_FACTOR", "Bounded", "HalfWidth", "Measured"]

#: A half-width in units of the distance to a more accurate run. It holds the truth if the error of
#: that run is at most half as large:
#: |q - true| <= |q - accurate| + |accurate - true| <= |q - accurate| + |q - true| / 2.
HALF_WIDTH_FACTOR = 2

_MAX_POWER = 1000  # the largest power that is computed by multiplication
_MAX_EXPONENT = 100_000  # a larger one is a mistake, and would cost memory without bound
_SPARE_BITS = 8  # mpmath's last place is right to one or two units, so this many bits are not used


def _operator_method(
    act: Callable[[Bounded, Measured], Measured],
) -> Callable[[Bounded, object], Measured]:
    """Make a method of two numbers with half-widths accept any number as its second operand.

    The returned method converts that operand to a `Measured` and applies ``act``. It returns
    NotImplemented if the operand is not a number.
    """

    def operation(self: Bounded, other: object) -> Measured:
        operand = _operand(other)
        return NotImplemented if operand is None else act(self, operand)

    return operation


class Bounded(Approximate):
    """A value and the absolute half-width that holds the true value; it behaves as a number.

    **Arithmetic.** Sums, differences, products, quotients, powers, `abs` and `round` to decimals
    have half-widths that hold every possible result. So do the functions sqrt, log, log10, exp,
    sin, cos and tan, as methods or as NumPy's. Numbers without a half-width are exact. Each
    half-width counts as independent, so x - x is zero with twice the half-width. Conversions to
    other types, float(), `mpf` and `numpy.asarray`, take the value and drop the half-width.

    **Comparison.** Two numbers are equal if their values and half-widths are. A number without a
    half-width equals any number of the same value.

    Raises:
        AccuracyError: If the half-widths leave undecided a comparison by size, or the integer of
            `int`, `round`, `math.floor`, `math.ceil` or `math.trunc`.
        ZeroDivisionError: If the divisor may be zero.
        InputError: If a function is not defined for every value that the number may have.

    >>> print(Measured.of(2, "1e-9") ** 2)
    4.00000000000 ± 4.1e-9
    """

    __slots__ = ()

    def __float__(self) -> float:
        """Return the double nearest to the value."""
        return float(self.value)

    def mpf(self) -> Any:
        """Return the value as an mpmath number, rounded to mpmath's current precision."""
        import mpmath

        return rational_in_context(mpmath.mp, self.value)

    @decimal_arithmetic()
    def __format__(self, spec: str) -> str:
        """Return the value formatted by ``spec``, such as '.10g'; without one, as ``str``.

        Places beyond the value's decimals are zeros. Without a number of places, 'g', 'e', 'f' and
        '%' have those of a float.
        """
        if not spec:
            return str(self)
        if spec[-1] in "gGeEfF%" and "." not in spec:
            return format(float(self), spec)
        return format(
            Decimal(Measured(self.value, self.uncertainty).decimals()[0]) if self.value else 0.0,
            spec,
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        """Return the value as a NumPy array of no dimensions, rounded to a double.

        The half-width is dropped. An array of objects holds the number itself.
        """
        import numpy

        if dtype is None or numpy.dtype(dtype) != object:
            return numpy.array(float(self), dtype=dtype)
        array = numpy.empty((), object)
        array[()] = self
        return array

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply a NumPy function element by element; the results are objects with half-widths."""
        import numpy

        if function in (numpy.isfinite, numpy.isinf, numpy.isnan):
            return function(numpy.asarray(inputs[0], dtype=float))

        def exactly(operand: Any) -> Any:
            if isinstance(operand, Bounded):
                return numpy.asarray(operand, object)
            # NumPy leaves long doubles as they are when it converts to objects, and would call this
            # method again.
            extended = getattr(operand, "dtype", None) == numpy.longdouble
            return numpy.frompyfunc(fraction, 1, 1)(operand) if extended else operand

        try:
            return getattr(function, method)(*map(exactly, inputs), **options)
        except (TypeError, AttributeError) as fault:
            offered = f"sqrt, exp, log, log10, sin, cos and tan, not {function.__name__}"
            raise TypeError(
                f"numbers with half-widths support {offered}: use float(x) instead"
            ) from fault

    def _ends(self) -> tuple[Fraction, Fraction]:
        """Return the least and the greatest true value that the half-width allows."""
        return self.value - self.uncertainty, self.value + self.uncertainty

    def _ordered(self, compare: Callable[[Fraction, int], bool], other: object) -> bool:
        """Compare with another number, if the result is the same for all true values that the
        half-widths allow.

        Returns NotImplemented if the other operand is not a number.

        Raises:
            AccuracyError: If the half-widths leave the comparison undecided.
        """
        operand = _operand(other)
        if operand is None:
            return NotImplemented  # type: ignore[no-any-return]
        difference = self - operand if self is not operand else Measured(Fraction(0), Fraction(0))
        low, high = (compare(end, 0) for end in difference._ends())
        if low != high:
            raise AccuracyError(
                f"{self} and {operand} cannot be distinguished: ask for more digits, or compare the"
                " values by float(), as sorted(xs, key=float) does"
            )
        return low

    def __eq__(self, other: object) -> bool:
        try:
            operand = _operand(other)
        except InputError:  # infinite, or not a number
            return False
        if operand is None:
            return NotImplemented
        return (self.value, self.uncertainty) == (operand.value, operand.uncertainty)

    def __hash__(self) -> int:
        return hash((self.value, self.uncertainty) if self.uncertainty else self.value)

    __lt__ = partialmethod(_ordered, operator.lt)
    __le__ = partialmethod(_ordered, operator.le)
    __gt__ = partialmethod(_ordered, operator.gt)
    __ge__ = partialmethod(_ordered, operator.ge)

    def _integer(self, rounding: Callable[[Fraction], int]) -> int:
        """Round to an integer, if the result is the same for all true values that the half-width
        allows.

        Raises:
            AccuracyError: If the half-width leaves the integer undecided.
        """
        low, high = map(rounding, self._ends())
        if low != high:
            raise AccuracyError(
                f"{self} may be rounded to {short_text(low)} or to {short_text(high)}: ask for more digits, "
                f"or round float(x)"
            )
        return low

    __int__ = __trunc__ = partialmethod(_integer, math.trunc)
    __floor__ = partialmethod(_integer, math.floor)
    __ceil__ = partialmethod(_integer, math.ceil)

    def __round__(self, digits: int | None = None) -> Any:
        """Round the number to ``digits`` decimals, or to an integer without them.

        The change by rounding to decimals is added to the half-width.
        """
        if digits is None:
            return self._integer(round)
        rounded = round(self.value, digits)
        return Measured(rounded, self.uncertainty + abs(rounded - self.value))

    def __neg__(self) -> Measured:
        return Measured(-self.value, self.uncertainty)

    def __abs__(self) -> Measured:
        return Measured(abs(self.value), self.uncertainty)

    @_operator_method
    def __add__(self, other: Measured) -> Measured:
        return Measured(self.value + other.value, self.uncertainty + other.uncertainty)

    @_operator_method
    def __mul__(self, other: Measured) -> Measured:
        product = self.uncertainty * other.uncertainty
        width = abs(self.value) * other.uncertainty + abs(other.value) * self.uncertainty + product
        return Measured(self.value * other.value, width)

    __radd__, __rmul__ = __add__, __mul__
    __sub__ = _operator_method(lambda self, other: self + -other)
    __rsub__ = _operator_method(lambda self, other: other + -self)
    __truediv__ = _operator_method(lambda self, other: self * other._inverse())
    __rtruediv__ = _operator_method(lambda self, other: other * self._inverse())

    def _inverse(self) -> Measured:
        least = abs(self.value) - self.uncertainty
        if least <= 0:
            raise ZeroDivisionError(f"{self} may be zero")
        return Measured(1 / self.value, self.uncertainty / (abs(self.value) * least))

    @_operator_method
    def __pow__(self, other: Measured) -> Measured:
        """Return this number raised to a power, with a half-width.

        The number must be positive unless the exponent is an exact integer from -1000 to 1000.
        """
        power = other.value
        if other.uncertainty or power.denominator > 1 or abs(power) > _MAX_POWER:
            return (self.log() * other).exp()
        base, size = self if power >= 0 else self._inverse(), abs(int(power))
        # A power changes most at the end that lies farthest from zero.
        return Measured(
            base.value**size, max(map(abs, base._ends())) ** size - abs(base.value) ** size
        )

    def __rpow__(self, other: object) -> Measured:
        operand = _operand(other)
        # Python 3.11 converts a Fraction to a float before calling this method.
        if operand and isinstance(other, float):
            operand = Measured(operand.value, abs(operand.value) / 2**53 + Fraction(1, 2**1075))
        return NotImplemented if operand is None else operand**self

    def _function_value(self, name: str) -> Measured:
        """Return a function of this number with a half-width: sqrt, log, exp, sin or cos, as
        ``name`` tells.

        The result is as accurate as the half-width allows. For an exact number it has fifty digits.
        """
        low, high = self._ends()
        if {"sqrt": low < 0, "log": low <= 0}.get(name):
            raise InputError(
                f"{name} of {self} is not defined: the number may be "
                f"{'' if low < 0 else 'zero or '}negative"
            )
        if name == "exp" and max(-low, high) > _MAX_EXPONENT:
            raise InputError(f"exp of {self} may lie beyond 1e±43000")
        bits, before = 128, Fraction(0)
        while True:
            least, most = _enclosure(name, low, high, bits)
            middle, width = (least + most) / 2, (most - least) / 2
            settled = self.uncertainty and abs(before - width) <= width / 1000
            if settled or width <= abs(middle) / 10**50:
                return Measured(middle, width)
            bits, before = 2 * bits, width

    sqrt = partialmethod(_function_value, "sqrt")
    log = partialmethod(_function_value, "log")
    exp = partialmethod(_function_value, "exp")
    sin = partialmethod(_function_value, "sin")
    cos = partialmethod(_function_value, "cos")

    def tan(self) -> Measured:
        """Return the tangent of this number, with a half-width.

        Raises:
            ZeroDivisionError: If the cosine may be zero.
        """
        return self.sin() / self.cos()

    def log10(self) -> Measured:
        """Return the decimal logarithm of this number, with a half-width.

        Raises:
            InputError: If the number may be zero or negative.
        """
        return self.log() / Measured(Fraction(10), Fraction(0)).log()


class HalfWidth(Fraction):
    """A half-width as a rational number whose formatted text is rounded up, so that it still holds.

    A number whose error was not measured has one beyond `_UNMEASURED`, which is shown as infinite.
    """

    __slots__ = ()

    def __format__(self, spec: str) -> str:
        if self >= _UNMEASURED:
            return "infinite"
        with decimal_arithmetic(50, ROUND_UP):
            return format(Decimal(self.numerator) / Decimal(self.denominator), spec)


# A half-width that stands for none, and the bound beyond which sums and products with such a
# number stay. Exponentials end at 1e43000, far below it.
_INFINITE, _UNMEASURED = HalfWidth(1 << 400_000), HalfWidth(1 << 330_000)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Measured(Bounded):
    """A value and its half-width, both exact rationals: the type of computed results.

    `to_dict` and ``str`` print decimals that still hold the truth. The rounding of the printed
    value is added to the printed half-width, which is rounded up.

    Args:
        value: A number of any kind, or a decimal as text.
        uncertainty: The half-width, likewise.

    Raises:
        InputError: If an argument is not a number, or the half-width is negative.
    """

    value: Fraction
    uncertainty: Fraction

    def __post_init__(self) -> None:
        width = self.uncertainty
        if width is not _INFINITE:
            width = HalfWidth(fraction(width))
            if width < 0:
                raise InputError("an uncertainty cannot be negative")
        object.__setattr__(self, "value", fraction(self.value))
        object.__setattr__(self, "uncertainty", width)

    @classmethod
    def of(cls, value: object, uncertainty: object) -> Measured:
        """Return a new number with a half-width, from arguments of any type.

        Args:
            value: A number of any kind, or a decimal as text.
            uncertainty: The half-width, likewise.

        Raises:
            InputError: If an argument is not a number, or the half-width is negative.
        """
        return cls(value, uncertainty)  # type: ignore[arg-type]

    @classmethod
    def without_half_width(cls, value: object, digits: int = DOUBLE_DIGITS) -> Measured:
        """Return a number whose error was not measured.

        It is shown without a half-width, or with an infinite one. A comparison with it by size
        raises AccuracyError.

        Args:
            value: The number.
            digits: The significant digits asked for. Beyond doubles, the value is rounded to three
                digits more.
        """
        exact_value = fraction(value)
        if exact_value and digits > DOUBLE_DIGITS:
            exact_value = Fraction(
                round_to_place(exact_value, decimal_magnitude(exact_value) - digits - 2)[0]
            )
        return cls(exact_value, _INFINITE)

    @classmethod
    def compared(cls, value: object, accurate: object, epsilon: Fraction) -> Measured:
        """Return a value with a half-width from its distance to a run with more digits.

        The half-width is twice that distance (`HALF_WIDTH_FACTOR`) plus one ulp of the value.

        Args:
            value: The value of the run.
            accurate: The same value of the run with more digits.
            epsilon: The relative size of an ulp.
        """
        own = fraction(value)
        return cls(own, abs(own - fraction(accurate)) * HALF_WIDTH_FACTOR + abs(own) * epsilon)

    @property
    def is_measured(self) -> bool:
        """True if the number has a half-width, because its error was measured."""
        return self.uncertainty < _UNMEASURED

    def holds(self, truth: object) -> bool:
        """Return True if a true value lies within this number's half-width.

        Args:
            truth: A number of any kind.
        """
        return abs(fraction(truth) - self.value) <= self.uncertainty

    def contains(self, other: Measured) -> bool:
        """Return True if every value that ``other`` may have lies within this number's half-width.

        Args:
            other: Another number with a half-width.
        """
        return abs(other.value - self.value) + other.uncertainty <= self.uncertainty

    def decimals(self) -> tuple[str, str]:
        """Return value and half-width as decimal texts, ``(value, uncertainty)``.

        They still hold the true value: the half-width includes the rounding of the value. It is
        "infinite" if the error was not measured.
        """
        if not self.uncertainty:
            return exact_decimals(self.value)
        if not self.is_measured:
            double = float(self.value)
            return repr(double) if double == self.value else exact_decimals(self.value)[
                0
            ], "infinite"
        # Two digits beyond the leading digit of the half-width: the rounding adds at most 5 % to
        # it.
        text, change = round_to_place(self.value, decimal_magnitude(self.uncertainty) - 2)
        return text, round_up(self.uncertainty + change)

    def to_dict(self) -> dict[str, str | None]:
        """Return value and half-width as decimal texts, ``{"value": "<decimal>", "uncertainty":
        "<decimal>"}``.

        The uncertainty of a number whose error was not measured is None, null in JSON.
        """
        value, uncertainty = self.decimals()
        return {"value": value, "uncertainty": uncertainty if self.is_measured else None}

    def _repr_html_(self) -> str:
        """Return the value and the half-width as an HTML table for notebooks."""
        rows = (
            f"<tr><th>{name}</th><td>{text or 'not measured'}</td></tr>"
            for name, text in self.to_dict().items()
        )
        return f"<table>{''.join(rows)}</table>"

    def __str__(self) -> str:
        value, width = self.decimals()
        return f"{value} ± {width}" if self.is_measured else f"{value} (no half-width)"

    def __repr__(self) -> str:
        return f"Measured({self})"


def _operand(other: object) -> Measured | None:
    """Convert the second operand of an operation to a `Measured`; return None if it is not a
    number.

    A number without a half-width is exact. Raises InputError for a float or Decimal that is not
    finite.
    """
    if isinstance(other, Bounded):
        return other if isinstance(other, Measured) else Measured(other.value, other.uncertainty)
    # NumPy handles arrays, element by element.
    if isinstance(other, str | None) or getattr(other, "ndim", None):
        return None
    try:
        return Measured(fraction(other), Fraction(0))
    except InputError:
        if isinstance(other, float | Decimal):  # infinite, or not a number
            raise
        return None


def _enclosure(name: str, low: Fraction, high: Fraction, bits: int) -> tuple[Fraction, Fraction]:
    """Return a lower and an upper bound of a function's values over the interval from ``low`` to
    ``high``.

    The function, sqrt, log, exp, sin or cos, is evaluated in mpmath's interval arithmetic.
    """
    from mpmath import libmp

    ends = (
        libmp.from_rational(end.numerator, end.denominator, bits, rounding)
        for end, rounding in ((low, libmp.round_floor), (high, libmp.round_ceiling))
    )
    bounds = getattr(libmp, f"mpi_{name}")(tuple(ends), bits)
    least, most = (Fraction(*map(int, libmp.to_rational(bound))) for bound in bounds)
    spare = Fraction(1, 2 ** (bits - _SPARE_BITS))
    return least - abs(least) * spare, most + abs(most) * spare
