"""Results: a value with the half-width that holds the truth, the factor from a distance to a half-width, arithmetic.

What is printed, compared and combined still holds the truth.
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
from tippedisk_verify.model.decimals import arithmetic, at_place, decimal_magnitude, exact_decimals, rounded_up
from tippedisk_verify.model.exact import Approximate, fraction, quotient, shown

__all__ = ["DISTANCES", "Bounded", "HalfWidth", "Measured"]

#: A half-width in units of the distance to a sharper run. It holds the truth if that run is at most half as wrong:
#: |q - true| <= |q - sharp| + |sharp - true| <= |q - sharp| + |q - true| / 2.
DISTANCES = 2

_LARGEST_POWER = 1000  # that is taken by multiplication
_LARGEST_EXPONENT = 100_000  # beyond it an exponential is a mistake, and would cost memory without bound
_SPARE_BITS = 8  # that mpmath's last place, which is right to one or two units, is not relied upon


def _of_two(act: Callable[[Bounded, Measured], Measured]) -> Callable[[Bounded, object], Measured]:
    """An operation with whatever is a number."""

    def operation(self: Bounded, other: object) -> Measured:
        theirs = _operand(other)
        return NotImplemented if theirs is None else act(self, theirs)

    return operation


class Bounded(Approximate):
    """Whatever has a value and the absolute half-width that is claimed to hold the true value: it behaves as a number.

    Sums, differences, products, quotients, powers, `abs`, `round` to decimals and the functions sqrt, log, log10, exp,
    sin, cos and tan, as methods or as NumPy's, hold whatever the true values in the half-widths give; numbers without
    one are exact. Each half-width counts as independent, so x - x is zero with twice the half-width. What has no room
    for a half-width leaves it behind: float(), `mpf` and `numpy.asarray` take the value.

    Two numbers are equal if their values and half-widths are; one without a half-width equals any number of its value.
    A comparison by size that the half-widths leave open raises AccuracyError, and so does `int`, `round` to an integer,
    `math.floor`, `math.ceil` or `math.trunc` where they leave open which integer it is. Raises ZeroDivisionError where
    the divisor may be zero, InputError where a function is not defined for all that the number may be.

    >>> print(Measured.of(2, "1e-9") ** 2)
    4.00000000000 ± 4.1e-9
    """

    __slots__ = ()

    def __float__(self) -> float:
        """The double nearest to the value."""
        return float(self.value)

    def mpf(self) -> Any:
        """The value as an mpmath number, to the precision that mpmath has at the time."""
        import mpmath

        return quotient(mpmath.mp, self.value)

    @arithmetic()
    def __format__(self, spec: str) -> str:
        """The value as ``spec`` says, such as '.10g'; places beyond its decimals are zeros. Else as ``str``.

        Without a number of places, 'g', 'e', 'f' and '%' give those of a float.
        """
        if not spec:
            return str(self)
        if spec[-1] in "gGeEfF%" and "." not in spec:
            return format(float(self), spec)
        return format(Decimal(Measured(self.value, self.uncertainty).decimals()[0]) if self.value else 0.0, spec)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        """The double nearest to the value, without dimensions; the half-width stays behind.

        An array of objects has the number itself.
        """
        import numpy

        if dtype is None or numpy.dtype(dtype) != object:
            return numpy.array(float(self), dtype=dtype)
        array = numpy.empty((), object)
        array[()] = self
        return array

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """NumPy's functions, element by element: what they give are objects that keep their half-widths."""
        import numpy

        if function in (numpy.isfinite, numpy.isinf, numpy.isnan):
            return function(numpy.asarray(inputs[0], dtype=float))

        def exactly(operand: Any) -> Any:
            if isinstance(operand, Bounded):
                return numpy.asarray(operand, object)
            # NumPy makes no other objects of these, so that they would ask here again.
            extended = getattr(operand, "dtype", None) == numpy.longdouble
            return numpy.frompyfunc(fraction, 1, 1)(operand) if extended else operand

        try:
            return getattr(function, method)(*map(exactly, inputs), **options)
        except (TypeError, AttributeError) as fault:
            offered = f"sqrt, exp, log, log10, sin, cos and tan, not {function.__name__}"
            raise TypeError(f"of numbers with half-widths NumPy has {offered}: float(x) has none") from fault

    def _ends(self) -> tuple[Fraction, Fraction]:
        """The least and the greatest that the true value may be."""
        return self.value - self.uncertainty, self.value + self.uncertainty

    def _compared(self, compare: Callable[[Fraction, int], bool], other: object) -> bool:
        """A comparison, if it comes out alike wherever in their half-widths the true values lie."""
        theirs = _operand(other)
        if theirs is None:
            return NotImplemented  # type: ignore[no-any-return]
        difference = self - theirs if self is not theirs else Measured(Fraction(0), Fraction(0))
        low, high = (compare(end, 0) for end in difference._ends())
        if low != high:
            raise AccuracyError(
                f"{self} and {theirs} cannot be told apart: ask for more digits, or compare the values by float(), as"
                " sorted(xs, key=float) does"
            )
        return low

    def __eq__(self, other: object) -> bool:
        try:
            theirs = _operand(other)
        except InputError:  # infinite, or not a number
            return False
        if theirs is None:
            return NotImplemented
        return (self.value, self.uncertainty) == (theirs.value, theirs.uncertainty)

    def __hash__(self) -> int:
        return hash((self.value, self.uncertainty) if self.uncertainty else self.value)

    __lt__ = partialmethod(_compared, operator.lt)
    __le__ = partialmethod(_compared, operator.le)
    __gt__ = partialmethod(_compared, operator.gt)
    __ge__ = partialmethod(_compared, operator.ge)

    def _integer(self, rounding: Callable[[Fraction], int]) -> int:
        """The integer that a number is rounded to, if it is the same wherever in the half-width the true value lies."""
        low, high = map(rounding, self._ends())
        if low != high:
            raise AccuracyError(
                f"{self} may be rounded to {shown(low)} or to {shown(high)}: ask for more digits, or round float(x)"
            )
        return low

    __int__ = __trunc__ = partialmethod(_integer, math.trunc)
    __floor__ = partialmethod(_integer, math.floor)
    __ceil__ = partialmethod(_integer, math.ceil)

    def __round__(self, digits: int | None = None) -> Any:
        """To so many decimals, with what the rounding changes added to the half-width; to an integer without them."""
        if digits is None:
            return self._integer(round)
        rounded = round(self.value, digits)
        return Measured(rounded, self.uncertainty + abs(rounded - self.value))

    def __neg__(self) -> Measured:
        return Measured(-self.value, self.uncertainty)

    def __abs__(self) -> Measured:
        return Measured(abs(self.value), self.uncertainty)

    @_of_two
    def __add__(self, other: Measured) -> Measured:
        return Measured(self.value + other.value, self.uncertainty + other.uncertainty)

    @_of_two
    def __mul__(self, other: Measured) -> Measured:
        mine, its = self.uncertainty, other.uncertainty
        width = abs(self.value) * its + abs(other.value) * mine + mine * its
        return Measured(self.value * other.value, width)

    __radd__, __rmul__ = __add__, __mul__
    __sub__ = _of_two(lambda mine, other: mine + -other)
    __rsub__ = _of_two(lambda mine, other: other + -mine)
    __truediv__ = _of_two(lambda mine, other: mine * other._inverse())
    __rtruediv__ = _of_two(lambda mine, other: other * mine._inverse())

    def _inverse(self) -> Measured:
        least = abs(self.value) - self.uncertainty
        if least <= 0:
            raise ZeroDivisionError(f"{self} may be zero")
        return Measured(1 / self.value, self.uncertainty / (abs(self.value) * least))

    @_of_two
    def __pow__(self, other: Measured) -> Measured:
        """Of any number for an integer up to 1000, otherwise of a positive one."""
        power = other.value
        if other.uncertainty or power.denominator > 1 or abs(power) > _LARGEST_POWER:
            return (self.log() * other).exp()
        base, size = self if power >= 0 else self._inverse(), abs(int(power))
        # Beyond the value a power changes by more than towards it, or to the other side.
        return Measured(base.value**size, max(map(abs, base._ends())) ** size - abs(base.value) ** size)

    def __rpow__(self, other: object) -> Measured:
        theirs = _operand(other)
        if theirs and isinstance(other, float):  # Python 3.11 makes one of a Fraction before it asks here
            theirs = Measured(theirs.value, abs(theirs.value) / 2**53 + Fraction(1, 2**1075))
        return NotImplemented if theirs is None else theirs**self

    def _of(self, name: str) -> Measured:
        """A function of the number, as accurately as its half-width deserves: to 50 digits if it is exact."""
        low, high = self._ends()
        if {"sqrt": low < 0, "log": low <= 0}.get(name):
            raise InputError(
                f"{name} of {self} is not defined, for that may be {'' if low < 0 else 'zero or '}negative"
            )
        if name == "exp" and max(-low, high) > _LARGEST_EXPONENT:
            raise InputError(f"exp of {self} may lie beyond 1e±43000")
        bits, before = 128, Fraction(0)
        while True:
            least, most = _enclosure(name, low, high, bits)
            middle, width = (least + most) / 2, (most - least) / 2
            settled = self.uncertainty and abs(before - width) <= width / 1000
            if settled or width <= abs(middle) / 10**50:
                return Measured(middle, width)
            bits, before = 2 * bits, width

    sqrt = partialmethod(_of, "sqrt")
    log = partialmethod(_of, "log")
    exp = partialmethod(_of, "exp")
    sin = partialmethod(_of, "sin")
    cos = partialmethod(_of, "cos")

    def tan(self) -> Measured:
        return self.sin() / self.cos()

    def log10(self) -> Measured:
        return self.log() / Measured(Fraction(10), Fraction(0)).log()


class HalfWidth(Fraction):
    """A half-width: a rational that is formatted like a number, rounded up so that it still holds."""

    __slots__ = ()

    def __format__(self, spec: str) -> str:
        with arithmetic(50, ROUND_UP):
            return format(Decimal(self.numerator) / Decimal(self.denominator), spec)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Measured(Bounded):
    """A value and its half-width, both exact rationals; what computations return.

    Both may be given as numbers of any kind, or as decimals in texts. Raises InputError for what is none, and for a
    negative half-width.

    `to_dict` and ``str`` print decimals. What they print still holds the truth: the rounding of the printed value is
    added to the printed half-width, which itself is rounded up.
    """

    value: Fraction
    uncertainty: Fraction

    def __post_init__(self) -> None:
        width = HalfWidth(fraction(self.uncertainty))
        if width < 0:
            raise InputError("an uncertainty cannot be negative")
        object.__setattr__(self, "value", fraction(self.value))
        object.__setattr__(self, "uncertainty", width)

    @classmethod
    def of(cls, value: object, uncertainty: object) -> Measured:
        """As the constructor, with types for what is given."""
        return cls(value, uncertainty)  # type: ignore[arg-type]

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

    def decimals(self) -> tuple[str, str]:
        """``(value, uncertainty)`` as decimal strings."""
        if not self.uncertainty:
            return exact_decimals(self.value)
        # Two digits beyond the leading digit of the half-width: the rounding adds at most 5 % to it.
        text, change = at_place(self.value, decimal_magnitude(self.uncertainty) - 2)
        return text, rounded_up(self.uncertainty + change)

    def to_dict(self) -> dict[str, str]:
        """``{"value": "<decimal>", "uncertainty": "<decimal>"}``."""
        value, uncertainty = self.decimals()
        return {"value": value, "uncertainty": uncertainty}

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        rows = (f"<tr><th>{name}</th><td>{text}</td></tr>" for name, text in self.to_dict().items())
        return f"<table>{''.join(rows)}</table>"

    def __str__(self) -> str:
        return " ± ".join(self.decimals())

    def __repr__(self) -> str:
        return f"Measured({self})"


def _operand(other: object) -> Measured | None:
    """The other side of an operation: a number with a half-width, or one of any other kind, which is exact."""
    if isinstance(other, Bounded):
        return other if isinstance(other, Measured) else Measured(other.value, other.uncertainty)
    if isinstance(other, str | None) or getattr(other, "ndim", None):  # an array is for NumPy, element by element
        return None
    try:
        return Measured(fraction(other), Fraction(0))
    except InputError:
        if isinstance(other, float | Decimal):  # infinite, or not a number
            raise
        return None


def _enclosure(name: str, low: Fraction, high: Fraction, bits: int) -> tuple[Fraction, Fraction]:
    """Bounds of sqrt, log, exp, sin or cos between two rationals, by mpmath's interval arithmetic."""
    from mpmath import libmp

    ends = (
        libmp.from_rational(end.numerator, end.denominator, bits, rounding)
        for end, rounding in ((low, libmp.round_floor), (high, libmp.round_ceiling))
    )
    bounds = getattr(libmp, f"mpi_{name}")(tuple(ends), bits)
    least, most = (Fraction(*map(int, libmp.to_rational(bound))) for bound in bounds)
    spare = Fraction(1, 2 ** (bits - _SPARE_BITS))
    return least - abs(least) * spare, most + abs(most) * spare
