"""The arithmetics of a computation: double, extended, quadruple, or any number of bits.

A `Precision` rounds an exact input once, correctly, and converts between heyoka's numbers and
mpmath's without loss. Only this file imports heyoka by name, when the first high-precision number
or the first integrator is needed.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.exact import (
    PI,
    Exact,
    checked_integer,
    exact,
    mantissa_exponent,
    plain_number,
    refuse_units_and_masks,
    short_text,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

__all__ = [
    "DOUBLE",
    "DOUBLE_DIGITS",
    "EXTENDED",
    "FUNCTION_NAMES",
    "QUADRUPLE",
    "Precision",
    "bits_for_digits",
    "checked_digits",
    "heyoka_types",
    "precision_named",
    "precision_of",
    "precision_of_bits",
    "wider_precision",
]

# Python converts integers of up to 4300 decimal digits. Guard digits stay below that limit too.
_MAX_DIGITS = 4_000
_MAX_BITS = 4_000_000
#: The significant digits that results in double have, unless the equations amplify rounding.
DOUBLE_DIGITS = 12
#: The functions of every namespace here. heyoka, math, NumPy and mpmath name them alike.
FUNCTION_NAMES = ("sin", "cos", "tan", "atan", "exp", "log", "sqrt", "sinh", "cosh", "tanh")


@dataclass(frozen=True)
class Precision:
    """An arithmetic to compute in: a kind of floating-point number and its bits.

    ``double`` has 53 bits (Python floats). ``extended`` has 64 bits (x87 long double, where the
    machine has it). ``quadruple`` has 113 bits. ``real`` is heyoka's MPFR numbers with any number
    of bits.

    Args:
        kind: One of these four names.
        bits: The bits of the mantissa.
    """

    kind: Literal["double", "extended", "quadruple", "real"]
    bits: int

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the kind and the bits, without the values computed from them."""
        return Precision, (self.kind, self.bits)

    @property
    def name(self) -> str:
        """The name of this arithmetic: ``double``, ``extended``, ``quadruple`` or, for example,
        ``real200``.
        """
        return f"real{self.bits}" if self.kind == "real" else self.kind

    @cached_property
    def epsilon(self) -> Fraction:
        """The distance from 1 to the next number in this precision, 2**(1 - bits)."""
        return Fraction(1, 1 << (self.bits - 1))

    @cached_property
    def digits(self) -> int:
        """The number of decimal digits that the mantissa of this precision holds."""
        return int((self.bits - 1) * math.log10(2))

    @cached_property
    def number_type(self) -> Any:
        """The scalar type of numbers in this precision: float, numpy.longdouble, heyoka.real128 or
        heyoka.real.
        """
        if self.kind == "double":
            return float
        if self.kind == "extended":
            import numpy

            return numpy.longdouble
        hy = heyoka_types()
        return hy.real128 if self.kind == "quadruple" else hy.real

    @cached_property
    def element_type(self) -> Any:
        """The data type of an array's elements in this precision: MPFR numbers are objects."""
        return object if self.kind == "real" else self.number_type

    @cached_property
    def ops(self) -> Any:
        """A namespace with sin, cos, exp, log, sqrt and others for scalars of this precision."""
        import numpy

        return (
            self._mpfr_functions()
            if self.kind == "real"
            else math
            if self.kind == "double"
            else numpy
        )

    def _mpfr_functions(self) -> Any:
        """Return a namespace of functions for heyoka's MPFR numbers, computed by mpmath.

        NumPy's functions would go through arrays, which leak memory. A result that is not a finite
        real number becomes NaN.
        """

        def function(name: str, value: Any) -> Any:
            zero = value - value
            if zero == 0:
                ctx = self.context
                result = getattr(ctx, name)(self.mpf(value))
                if isinstance(result, ctx.mpf) and ctx.isfinite(result):
                    return self.number(result)
            return zero / 0

        return SimpleNamespace(**{name: partial(function, name) for name in FUNCTION_NAMES})

    @property
    def context(self) -> Any:
        """An mpmath context of as many bits, private to this precision and to the thread.

        Computations raise their context's precision for a while, so two threads cannot share one.
        """
        return _THREAD_CONTEXTS.context(self.bits)

    @cached_property
    def pi(self) -> Any:
        """pi rounded once to this precision."""
        return self.number(PI)

    def number(self, value: object) -> Any:
        """Round ``value`` once, to nearest, to this precision.

        An extended or quadruple number below 1e-4932 has fewer bits and may be rounded once more.

        Args:
            value: A number or text that `exact` accepts.

        Returns:
            A number of this precision's `number_type`.

        Raises:
            InputError: If the value is not a finite number, or is too large for the type.
        """
        number = plain_number(value)
        if self.kind == "double":
            try:
                double = number if isinstance(number, float) else float(exact(number))
            except OverflowError:
                raise InputError(f"{short_text(value)} is too large for double precision") from None
            if not math.isfinite(double):
                raise InputError(f"a finite number is needed, not {double}")
            return double
        pair = None if isinstance(number, str | Decimal | Exact) else mantissa_exponent(number)
        if pair is not None and pair.mantissa.bit_length() <= self.bits:
            return self._from_mantissa(*pair)
        return self._from_mantissa(*exact(number).rounded(self.bits))

    def array(self, values: Sequence[object]) -> Any:
        """Return a sequence of numbers as a one-dimensional array of this precision, each rounded
        as `number` does.

        MPFR numbers are stored as objects.

        Args:
            values: (n,) numbers or texts that `exact` accepts.

        Raises:
            InputError: As for `number`, and for a text, which is not a list of numbers.
        """
        import numpy

        if isinstance(values, str | bytes):
            raise InputError(f"a list of numbers is needed, not the text '{short_text(values)}'")
        refuse_units_and_masks(values)
        return numpy.array([self.number(value) for value in values], dtype=self.element_type)

    def as_array(self, values: Any) -> Any:
        """Convert any sequence of numbers to an array of this precision, as `array` does.

        An array of this arithmetic is returned as it is, and one of doubles is converted exactly.

        Args:
            values: (n,) numbers or texts that `exact` accepts.

        Returns:
            An array (n,).

        Raises:
            InputError: As for `array`.
        """
        import numpy

        # In arrays of other classes, such as masked arrays, each element is checked.
        plain = type(values) is numpy.ndarray and self.kind != "real"
        if plain and (
            values.dtype in (self.number_type, float)
            or (self.kind == "double" and values.dtype.kind == "f")
        ):
            return values.astype(self.number_type, copy=False)
        return self.array(values)

    def copy_array(self, view: Any) -> Any:
        """Return a copy of an array whose memory heyoka will overwrite.

        MPFR numbers are copied into an array of objects, because heyoka does not free the memory of
        the elements of its own arrays (tests/stress/test_memory.py).

        Args:
            view: An array of numbers of this precision.

        Returns:
            An array of the same shape.
        """
        if self.kind != "real":
            return view.copy()
        import numpy

        return numpy.array(view.tolist(), dtype=object)

    def mpf(self, value: object) -> Any:
        """Convert a native number of this precision or a wider one to an mpmath number, exactly.

        Args:
            value: A floating-point number.

        Returns:
            A number of this precision's `context`.

        Raises:
            InputError: If the value is infinite, NaN, or not a floating-point number.
        """
        from mpmath.libmp import from_man_exp

        pair = mantissa_exponent(value)
        if pair is None:
            raise InputError(f"a finite number is needed, not {short_text(value)}")
        return self.context.make_mpf(from_man_exp(*pair))

    def _from_mantissa(self, mantissa: int, exponent: int) -> Any:
        size = mantissa.bit_length() + exponent
        if mantissa and self.kind != "real" and size > 16384:
            raise InputError(f"a number of about 2^{size} is too large for {self.name} precision")
        if self.kind == "extended":
            import numpy

            return numpy.ldexp(self.number_type(mantissa), exponent)
        if self.kind == "quadruple":
            # In two factors, so that the power itself neither overflows nor underflows.
            half = exponent // 2
            return (
                self.number_type(mantissa)
                * self.number_type(2) ** half
                * self.number_type(2) ** (exponent - half)
            )
        # The exponent, too, must be a number of these bits: heyoka reads a plain integer as one of
        # 64 bits. It is split in two, so that these bits hold each part.
        rest = exponent % (1 << 20)
        powers = (
            self.number_type(2, self.bits) ** self.number_type(power, self.bits)
            for power in (exponent - rest, rest)
        )
        return self.number_type(mantissa, self.bits) * next(powers) * next(powers)


DOUBLE = Precision("double", 53)
EXTENDED = Precision("extended", 64)
QUADRUPLE = Precision("quadruple", 113)


def precision_of_bits(count: int) -> Precision:
    """Return the arithmetic of MPFR numbers with ``count`` bits.

    Args:
        count: The number of bits.

    Raises:
        InputError: If ``count`` is not an integer from 24 to 4,000,000.
    """
    complaint = f"a precision of {{}} bits is not offered: use 24 to {_MAX_BITS}"
    return Precision("real", checked_integer(count, 24, _MAX_BITS, complaint))


def precision_named(name: str) -> Precision:
    """Return the arithmetic with a given name.

    Args:
        name: The name, such as ``double`` or ``real200``.

    Raises:
        ValueError: If there is no such arithmetic.
    """
    named = {precision.name: precision for precision in (DOUBLE, EXTENDED, QUADRUPLE)}
    return named.get(name) or precision_of_bits(int(name.removeprefix("real")))


def precision_of(number: Any) -> Precision:
    """Return the arithmetic to which a floating-point number belongs.

    Args:
        number: A number as `Precision.number` returns it.
    """
    kinds = {"longdouble": EXTENDED, "real128": QUADRUPLE}
    return (
        precision_of_bits(number.prec)
        if hasattr(number, "prec")
        else kinds.get(type(number).__name__, DOUBLE)
    )


def bits_for_digits(digits: int) -> int:
    """Return the number of bits that hold ``digits`` decimal digits, guard digits included.

    Args:
        digits: The number of decimal digits.

    Raises:
        InputError: If `precision_of_bits` does not offer an arithmetic of that size.
    """
    if not 1 <= digits <= _MAX_BITS / math.log2(10) - 1:
        raise InputError(f"an arithmetic of {short_text(digits)} digits is not offered")
    return max(24, math.ceil(digits * math.log2(10)) + 1)


def checked_digits(digits: object) -> int:
    """Check a number of decimal digits and return it as an int.

    Args:
        digits: An integer of any kind.

    Raises:
        InputError: If ``digits`` is not an integer from 1 to 4000.
    """
    kind = (
        "the text "
        if isinstance(digits, str)
        else "the float "
        if isinstance(digits, float)
        else ""
    )
    complaint = f"digits are a whole number from 1 to {_MAX_DIGITS}, not {kind}{{}}"
    return checked_integer(digits, 1, _MAX_DIGITS, complaint)


def wider_precision(precision: Precision) -> Precision:
    """Return the cheapest arithmetic of this machine with at least 11 bits more than ``precision``.

    A run repeated in it shows the rounding and truncation errors of the first run to two or three
    digits.

    Args:
        precision: The arithmetic of the first run.
    """
    if precision.kind == "double" and _has_extended():
        return EXTENDED
    if precision.kind in ("double", "extended"):
        return QUADRUPLE if hasattr(heyoka_types(), "real128") else precision_of_bits(128)
    return precision_of_bits(precision.bits + 64)


@lru_cache(maxsize=1)
def _has_extended() -> bool:
    import numpy

    return bool(numpy.finfo(numpy.longdouble).nmant == 63)


def heyoka_types() -> ModuleType:
    """Import and return heyoka, for its types of numbers; for compiling, use `flow.jit`.

    Raises:
        ImportError: If heyoka cannot be imported.
    """
    try:
        import heyoka
    except ImportError as fault:
        raise type(fault)(
            f"heyoka, the integrator ({fault}); its wheels are for Linux on x86_64 and "
            f"aarch64, glibc 2.28 or newer"
        ) from fault
    return heyoka  # type: ignore[no-any-return]


class _ThreadContexts(threading.local):
    """The mpmath contexts that each thread keeps, by their bits."""

    def __init__(self) -> None:
        self.context = lru_cache(maxsize=256)(_context)


def _context(precision_bits: int) -> Any:
    import mpmath

    context = mpmath.MPContext()
    context.prec = precision_bits
    return context


_THREAD_CONTEXTS = _ThreadContexts()
