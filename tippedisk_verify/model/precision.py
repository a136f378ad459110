"""What a number is here.

Inputs are exact: a decimal string, a rational, a float or a high-precision number each stand for one real number,
possibly plus a rational multiple of pi (`Exact`). A `Precision` says in which arithmetic a computation runs and
rounds an exact input once, correctly, on its way in. On the way out a `Measured` pairs a value with the half-width
that holds the truth, and prints no digit that the half-width does not justify.

Conversions between heyoka's numbers and mpmath's go through integer mantissas, so they lose nothing.
"""

from __future__ import annotations

import math
import re
import signal
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Literal

from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import ModuleType

__all__ = [
    "DOUBLE",
    "EXTENDED",
    "PI",
    "QUADRUPLE",
    "Exact",
    "Measured",
    "Precision",
    "bits",
    "bits_for_digits",
    "companion",
    "exact",
    "fraction",
    "heyoka_module",
    "precision_named",
]

# A decimal exponent beyond this is a mistake, not a physical quantity, and would cost memory without bound.
_LARGEST_DECIMAL_EXPONENT = 10_000
# Python converts integers of up to 4300 decimal digits; nothing here needs more.
_LARGEST_TEXT = 4_000
_MOST_DIGITS = 4_000
_MOST_BITS = 4_000_000

_NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(
    rf"(?P<sign>[+-]?)(?:(?P<factor>{_NUMBER})?\*?(?P<pi>pi)|(?P<number>{_NUMBER}))(?:/(?P<divisor>\d+))?"
)


# ----------------------------------------------------------------------------------------------- exact inputs
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
        return DOUBLE.number(self)  # type: ignore[no-any-return]


def exact(value: object) -> Exact:
    """The exact number that ``value`` stands for.

    Accepts int, float, Fraction, Decimal, numpy long double, mpmath mpf, heyoka real and real128, `Exact`, and
    strings: decimals (``"0.435"``, ``"1e-30"``), ratios (``"1/3"``) and sums with multiples of pi
    (``"pi/2 + 0.4"``, ``"-3*pi/2"``). A float means its exact binary value.

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
    return Exact(fraction(value))


def fraction(value: object) -> Fraction:
    """The exact value of one finite floating-point number of any kind, as a Fraction. Raises InputError otherwise."""
    if isinstance(value, int | Fraction):
        return Fraction(value)
    man_exp = _mantissa_exponent(value)
    if man_exp is None:
        raise InputError(f"a finite number is needed, not {value!s:.60}")
    mantissa, exponent = man_exp
    return Fraction(mantissa << exponent) if exponent >= 0 else Fraction(mantissa, 1 << -exponent)


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
    numerator, denominator = abs(value.numerator), value.denominator
    if not numerator:
        return 0, 0
    exponent = numerator.bit_length() - denominator.bit_length() - mantissa_bits
    if exponent >= 0:
        mantissa, rest = divmod(numerator, denominator << exponent)
        whole = denominator << exponent
    else:
        mantissa, rest = divmod(numerator << -exponent, denominator)
        whole = denominator
    # The quotient has mantissa_bits or one bit more; bring it to mantissa_bits, keeping what was cut off.
    extra = mantissa.bit_length() - mantissa_bits
    if extra > 0:
        rest += whole * (mantissa & ((1 << extra) - 1))
        whole <<= extra
        mantissa >>= extra
        exponent += extra
    if 2 * rest > whole or (2 * rest == whole and mantissa & 1):
        mantissa += 1
    shift = (mantissa & -mantissa).bit_length() - 1
    mantissa >>= shift
    return (-mantissa if value < 0 else mantissa), exponent + shift


# ------------------------------------------------------------------------------------------------- precisions
@dataclass(frozen=True, slots=False)
class Precision:
    """An arithmetic to compute in.

    ``double`` (53 bits, Python floats), ``extended`` (64 bits, x87 long double, where the machine has it),
    ``quadruple`` (113 bits) or ``real`` (heyoka's MPFR numbers with any number of bits).
    """

    kind: Literal["double", "extended", "quadruple", "real"]
    bits: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "_hash", hash((self.kind, self.bits)))

    def __hash__(self) -> int:  # looked up once per integration, so computed once
        return self._hash  # type: ignore[attr-defined,no-any-return]

    @property
    def name(self) -> str:
        """``double``, ``extended``, ``quadruple`` or ``real200``."""
        return f"real{self.bits}" if self.kind == "real" else self.kind

    @cached_property
    def epsilon(self) -> Fraction:
        """Distance from 1 to the next number, 2**(1 - bits)."""
        return Fraction(1, 1 << (self.bits - 1))

    @cached_property
    def digits(self) -> int:
        """Decimal digits that the mantissa holds."""
        return int((self.bits - 1) * math.log10(2))

    @cached_property
    def type(self) -> Any:
        """The scalar type: float, numpy.longdouble, heyoka.real128 or heyoka.real."""
        if self.kind == "double":
            return float
        if self.kind == "extended":
            import numpy

            return numpy.longdouble
        hy = heyoka_module()
        return hy.real128 if self.kind == "quadruple" else hy.real

    @cached_property
    def ops(self) -> ModuleType:
        """Namespace with sin and cos for scalars of this precision."""
        import numpy

        return math if self.kind == "double" else numpy

    @cached_property
    def _lowest(self) -> int:
        """Numbers below 2**(this - 1) are subnormal."""
        return {"double": -1021, "extended": -16381, "quadruple": -16381}.get(self.kind, -(1 << 62))

    @cached_property
    def context(self) -> Any:
        """An mpmath context of the same number of bits, private to this precision."""
        return _context(self.bits)

    @cached_property
    def pi(self) -> Any:
        """pi rounded once to this precision."""
        return self.number(PI)

    def number(self, value: object) -> Any:
        """``value`` (anything that `exact` takes) rounded once, to nearest, to this precision.

        Raises InputError if it is not a finite number, or too large for the type.
        """
        if self.kind == "double" and isinstance(value, float):
            if not math.isfinite(value):
                raise InputError(f"a finite number is needed, not {value}")
            return float(value)
        pair = None if isinstance(value, str | int | Fraction | Decimal | Exact) else _mantissa_exponent(value)
        if pair is None or pair[0].bit_length() > self.bits or pair[0].bit_length() + pair[1] < self._lowest:
            number = exact(value)
            pair = number.rounded(self.bits)
            if pair[0].bit_length() + pair[1] < self._lowest and not number.pi_multiple:
                # Subnormal: whole multiples of the smallest number, rounded once and from the exact value.
                unit = self._lowest - self.bits
                pair = round(number.rational * (1 << -unit)), unit
        return self._from_mantissa(*pair)

    def array(self, values: Sequence[object]) -> Any:
        """A one-dimensional numpy array of `number` of each value."""
        import numpy

        return numpy.array([self.number(value) for value in values], dtype=self.type)

    def mpf(self, value: object) -> Any:
        """The same number as an mpmath mpf, exactly (a native number of this precision or wider)."""
        from mpmath.libmp import from_man_exp

        pair = _mantissa_exponent(value)
        if pair is None:
            raise InputError(f"a finite number is needed, not {value!s:.60}")
        return self.context.make_mpf(from_man_exp(*pair))

    def solve(self, matrix: Any, right: Any) -> Any:
        """Solution of a small dense linear system: numpy in double, mpmath above (numpy has no LAPACK there)."""
        import numpy

        if self.kind == "double":
            return numpy.linalg.solve(matrix, right)
        ctx = self.context
        solution = ctx.lu_solve(
            ctx.matrix([[self.mpf(entry) for entry in row] for row in matrix]),
            ctx.matrix([self.mpf(entry) for entry in right]),
        )
        return numpy.array([self.number(entry) for entry in solution], dtype=self.type)

    def eigenvalues(self, matrix: Any) -> list[Any]:
        """Eigenvalues of a small dense matrix: Python complex in double, mpmath mpc above."""
        import numpy

        if self.kind == "double":
            return [complex(value) for value in numpy.linalg.eigvals(matrix)]
        ctx = self.context
        entries = ctx.matrix([[self.mpf(entry) for entry in row] for row in matrix])
        return [ctx.mpc(value) for value in ctx.eig(entries, left=False, right=False)]

    def _from_mantissa(self, mantissa: int, exponent: int) -> Any:
        size = mantissa.bit_length() + exponent
        if mantissa and ((self.kind == "double" and size > 1024) or (self.kind != "real" and size > 16384)):
            raise InputError(f"a number of about 2^{size} is too large for {self.name} precision")
        if self.kind == "double":
            return math.ldexp(mantissa, exponent)
        if self.kind == "extended":
            import numpy

            return numpy.ldexp(self.type(mantissa), exponent)
        if self.kind == "quadruple":
            # In two factors, so that the power itself neither overflows nor underflows.
            half = exponent // 2
            return self.type(mantissa) * self.type(2) ** half * self.type(2) ** (exponent - half)
        # The exponent too as a number of these bits: heyoka would take a plain integer for one of 64.
        return self.type(mantissa, self.bits) * self.type(2, self.bits) ** self.type(exponent, self.bits)


DOUBLE = Precision("double", 53)
EXTENDED = Precision("extended", 64)
QUADRUPLE = Precision("quadruple", 113)
PI = Exact(Fraction(0), Fraction(1))


def bits(count: int) -> Precision:
    """Arithmetic with ``count`` bits (MPFR). Raises InputError outside 24 … 4,000,000."""
    if not 24 <= count <= _MOST_BITS:
        raise InputError(f"a precision of {count} bits is not offered: use 24 to {_MOST_BITS}")
    return Precision("real", count)


def bits_for_digits(digits: int) -> int:
    """Bits that hold ``digits`` decimal digits. Raises InputError below 1 or beyond what `bits` offers."""
    if not 1 <= digits <= _MOST_DIGITS:
        raise InputError(f"{digits} digits are not offered: ask for 1 to {_MOST_DIGITS}")
    return max(24, math.ceil(digits * math.log2(10)) + 1)


def precision_named(name: str) -> Precision:
    """``double``, ``extended``, ``quadruple`` or a number of bits as text. Raises InputError for anything else."""
    named = {"double": DOUBLE, "extended": EXTENDED, "quadruple": QUADRUPLE}
    if name in named:
        return named[name]
    digits = name.removeprefix("real")
    if digits.isascii() and digits.isdigit() and len(digits) < 10:
        return bits(int(digits))
    raise InputError(f"precision '{name[:40]}' is not known: use double, extended, quadruple or a number of bits")


def companion(precision: Precision) -> Precision:
    """The cheapest arithmetic that this machine has with at least 11 bits more than ``precision``.

    A run repeated in it shows the rounding and truncation errors of the first one to two or three digits.
    """
    if precision.kind == "double" and _has_extended():
        return EXTENDED
    if precision.kind in ("double", "extended"):
        return QUADRUPLE if hasattr(heyoka_module(), "real128") else bits(128)
    return bits(precision.bits + 64)


@lru_cache(maxsize=1)
def _has_extended() -> bool:
    import numpy

    return bool(numpy.finfo(numpy.longdouble).nmant == 63)


# -------------------------------------------------------------------------------------------- exact conversions
@lru_cache(maxsize=1)
def heyoka_module() -> ModuleType:
    """heyoka, with the memory handler without which arrays of its MPFR numbers leak."""
    with _interrupts_deferred():
        import heyoka

        heyoka.install_custom_numpy_mem_handler()
    return heyoka  # type: ignore[no-any-return]


@contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """Hold Ctrl-C back: half-imported extension modules swallow it or break. Only the main thread gets it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed = False

    def remember(number: int, frame: object) -> None:
        nonlocal pressed
        pressed = True

    before = signal.signal(signal.SIGINT, remember)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


@lru_cache(maxsize=256)
def _context(precision_bits: int) -> Any:
    import mpmath

    context = mpmath.MPContext()
    context.prec = precision_bits
    return context


def _mantissa_exponent(value: Any) -> tuple[int, int] | None:
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
        part, exponent = numpy.frexp(value)
        return int(numpy.ldexp(part, 64)), int(exponent) - 64
    if kind in ("real", "real128"):
        return _heyoka_mantissa(value, getattr(value, "prec", 113))
    if getattr(value, "shape", None) == () and getattr(value, "dtype", "object") != "object":
        return _mantissa_exponent(value.item())  # numpy's other scalars
    raise InputError(f"a number is needed, not an object of type {kind}")


def _heyoka_mantissa(value: Any, precision_bits: int) -> tuple[int, int] | None:
    if value != value or value - value != 0:
        return None
    if value == 0:
        return 0, 0
    near = abs(float(value))
    # A shift by too much is harmless (the integer only gets zero bits at its end), by too little would lose bits.
    if 1e-290 < near < 1e290:
        magnitude = math.frexp(near)[1]
    else:
        import numpy

        magnitude = math.ceil(float(numpy.log2(abs(value)))) + 1
    shift = precision_bits + 2 - magnitude
    half = shift // 2  # two factors: neither power leaves the exponent range
    two = type(value)(2, precision_bits) if hasattr(value, "prec") else type(value)(2)
    return int(value * two**half * two ** (shift - half)), -shift


# ---------------------------------------------------------------------------------------------------- results
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

    def holds(self, truth: object) -> bool:
        """Whether ``truth`` lies within the half-width."""
        return abs(fraction(truth) - self.value) <= self.uncertainty

    def __float__(self) -> float:
        return float(self.value)

    def decimals(self) -> tuple[str, str]:
        """``(value, uncertainty)`` as decimal strings."""
        if not self.uncertainty:
            return _exact_decimals(self.value)
        # Two digits beyond the leading digit of the half-width: the rounding adds at most 5 % to it.
        place = _decimal_magnitude(self.uncertainty) - 2
        unit = Fraction(10) ** place
        steps = round(self.value / unit)
        return _decimal_text(steps, place), _rounded_up(self.uncertainty + abs(self.value - steps * unit))

    def json(self) -> dict[str, str]:
        """``{"value": "<decimal>", "uncertainty": "<decimal>"}``."""
        value, uncertainty = self.decimals()
        return {"value": value, "uncertainty": uncertainty}

    def __str__(self) -> str:
        value, uncertainty = self.decimals()
        return f"{value} ± {uncertainty}"


def _exact_decimals(value: Fraction) -> tuple[str, str]:
    denominator, twos, fives = value.denominator, 0, 0
    while denominator % 2 == 0:
        denominator, twos = denominator // 2, twos + 1
    while denominator % 5 == 0:
        denominator, fives = denominator // 5, fives + 1
    if denominator == 1:
        place = -max(twos, fives)
        return _decimal_text(int(value / Fraction(10) ** place), place), "0"
    place = _decimal_magnitude(value) - 50  # a repeating decimal: fifty digits and the half-width of the cut
    unit = Fraction(10) ** place
    steps = round(value / unit)
    return _decimal_text(steps, place), _rounded_up(abs(value - steps * unit))


def _decimal_magnitude(value: Fraction) -> int:
    """The integer k with 10**k <= |value| < 10**(k+1)."""
    size = abs(value)
    guess = math.floor((size.numerator.bit_length() - size.denominator.bit_length()) * math.log10(2))
    while Fraction(10) ** guess > size:
        guess -= 1
    while Fraction(10) ** (guess + 1) <= size:
        guess += 1
    return guess


def _rounded_up(value: Fraction) -> str:
    """Two significant digits, never smaller than ``value``."""
    place = _decimal_magnitude(value) - 1
    steps = math.ceil(value / Fraction(10) ** place)
    return _decimal_text(steps, place)


def _decimal_text(steps: int, place: int) -> str:
    """``steps * 10**place`` as a decimal string, in scientific notation only where it is far from 1."""
    digits = str(abs(steps))
    sign = "-" if steps < 0 else ""
    magnitude = len(digits) - 1 + place
    if steps and (magnitude < -5 or (place > 0 and magnitude > 15)):
        mantissa = digits[0] + ("." + digits[1:] if len(digits) > 1 else "")
        return f"{sign}{mantissa}e{magnitude}"
    if place >= 0:
        return sign + digits + "0" * place
    digits = digits.rjust(1 - place, "0")
    return f"{sign}{digits[:place]}.{digits[place:]}"
