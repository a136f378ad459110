"""Faults planted in `kernel.lanes` and what it is made of, one at a time: the attacks notice each of them.

A fault is a piece of the module's text, which must occur exactly once, what replaces it, and the attack that is to
notice. A mutant that fails in another way than by a false ball counts as noticed as well: it cannot prove anything.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest

from tests.proofs.cases import executed
from tests.proofs.lane_attacks import ATTACKS
from tippedisk_verify.proofs.kernel import doubles, lane_series, lanes

SOURCES = {module: Path(module.__file__).read_text(encoding="utf-8") for module in (lanes, doubles, lane_series)}


class Fault(NamedTuple):
    name: str
    old: str
    new: str
    attack: str


FAULTS = [
    Fault("radii are rounded down", "_UP = 1 + 16 * _U", "_UP = 1 - 16 * _U", "binary"),
    Fault("radii are rounded to nearest", "_UP = 1 + 16 * _U", "_UP = 1.0", "binary"),
    Fault("no term for underflow", "_TINY = 2.0**-1000", "_TINY = 0.0", "binary"),
    Fault("a term for underflow that is itself too small", "_TINY = 2.0**-1000", "_TINY = 2.0**-1080", "binary"),
    Fault("a forgotten ulp: no midpoint's rounding", "    radius += rounding\n", "", "binary"),
    Fault("half the midpoint's rounding", "    rounding *= _U\n", "    rounding *= _U / 2\n", "binary"),
    Fault("NaN passes for a radius", "np.fmin(radius", "np.minimum(radius", "strange_operands"),
    Fault("a difference's radii are subtracted", "self._mid - b._mid, self._rad + b._rad",
          "self._mid - b._mid, np.abs(self._rad - b._rad)", "binary"),
    Fault("a sum forgets one radius", "self._mid + b._mid, self._rad + b._rad", "self._mid + b._mid, self._rad + 0",
          "binary"),
    Fault("an operand's sign is lost", "return (-self).__add__(other)", "return self.__sub__(other)", "unary"),
    Fault("the product's cross term is missing", "        upper += b._rad\n", "", "binary"),
    Fault("the product takes the first midpoint for its ball", "        radius += self._rad * upper\n", "", "binary"),
    Fault("the product's radius takes the sign of a midpoint", "radius = np.abs(self._mid) * b._rad",
          "radius = self._mid * b._rad", "binary"),
    Fault("the square forgets the radius squared", "        radius += self._rad\n        radius *= self._rad\n",
          "        radius *= self._rad\n", "unary"),
    Fault("the square takes its slope once", "        radius += radius\n", "", "unary"),
    Fault("scaling keeps the factor's sign in the radius", "self._rad * abs(factor)", "self._rad * factor", "unary"),
    Fault("integers beyond 2^53 count as floats", "_EXACT_INTEGERS = 2**53", "_EXACT_INTEGERS = 2**90", "unary"),
    Fault("subnormal factors count as ordinary ones", "_NORMAL <= abs(value) < np.inf", "abs(value) < np.inf",
          "factors"),
    Fault("a divisor may hold zero", "~(distance > 0)", "distance == 0", "binary"),
    Fault("the quotient takes the divisor's midpoint for its ball", "        distance -= b._rad\n", "", "binary"),
    Fault("the quotient forgets the divisor's radius", "        radius *= b._rad / distance + _TINY\n",
          "        radius *= _TINY\n", "binary"),
    Fault("the quotient forgets the dividend's radius", "        radius += self._rad / distance\n", "", "binary"),
    Fault("division by a number keeps its sign in the radius", "self._rad / abs(factor)", "self._rad / factor",
          "unary"),
    Fault("pi ends after its second part", "_HALF_PI_B) - n * _HALF_PI_C", "_HALF_PI_B)", "sines"),
    Fault("pi is a double", "float.fromhex(\"0x1.0b4611a6p-34\")",
          "float.fromhex(\"0x1.0b4611a6p-34\") * (1 + 2.0**-20)",
          "sines"),
    Fault("the sine's remainder is dropped with two of its terms", "for i in range(7, -1, -1)",
          "for i in range(5, -1, -1)",
          "sines"),
    Fault("the cosine's remainder is dropped with two of its terms", "for i in range(8, -1, -1)",
          "for i in range(6, -1, -1)", "sines"),
    Fault("the cosine's rounding is dropped", "turned + 2.5 * _U\n", "turned\n", "sines"),
    Fault("angles are reduced wherever they are", "_WIDEST_ANGLE = 2.0**18", "_WIDEST_ANGLE = 2.0**40", "sines"),
    Fault("the sine's curvature is dropped", "slope * r + 0.5 * r * r", "slope * r", "sines"),
    Fault("sine and cosine exchange their slopes", "np.abs(sine) + sine_error, np.abs(cosine) + cosine_error",
          "np.abs(cosine) + cosine_error, np.abs(sine) + sine_error", "sines"),
    Fault("a quadrant has the wrong sign", "np.where(j >= 2, -value, value)", "np.where(j > 2, -value, value)",
          "sines"),
    Fault("quadrants are counted from one", "self._turned(1)", "self._turned(3)", "sines"),
    Fault("the union forgets a radius", "np.abs(b._mid - middle) + b._rad", "np.abs(b._mid - middle)", "predicates"),
    Fault("the union is the first ball", "np.maximum(reach, np.abs(b._mid - middle) + b._rad)", "reach", "predicates"),
    Fault("what is shared ends too early", "np.nextafter(x._mid + x._rad, np.inf)", "x._mid", "predicates"),
    Fault("what is shared begins too late", "np.nextafter(x._mid - x._rad, -np.inf)", "x._mid", "predicates"),
    Fault("what is shared with an infinite ball is finite", "(low <= high) & other.is_finite()", "low <= high",
          "strange_operands"),
    Fault("what touches zero is positive", "(self._mid > self._rad)", "(self._mid >= self._rad)", "predicates"),
    Fault("a positive midpoint is a positive ball", "(self._mid > self._rad)", "(self._mid > 0)", "predicates"),
    Fault("negative is reversed", "-self._mid > self._rad", "self._mid > self._rad", "predicates"),
    Fault("inside is reversed", "(reach < b._rad)", "(reach > b._rad)", "predicates"),
    Fault("inside looks at the midpoint only", "        reach += self._rad\n", "", "predicates"),
    Fault("an infinite ball has an interior", "(reach < b._rad) & b.is_finite()", "(reach < b._rad)",
          "strange_operands"),
    Fault("the convolution's sum is not rounded", "(self._length + 0.5) * _U", "0", "convolutions"),
    Fault("the convolution's gamma is that of one term", "(self._length + 0.5) * _U", "0.1 * _U", "convolutions"),
    Fault("the convolution's radius is rounded down", "1 + (4 * k + 32) * _U", "1 - (4 * k + 32) * _U", "convolutions"),
    Fault("the convolution's radius misses its cross terms", "        np.add(size, rad, out=upper)\n",
          "        upper[:] = size\n", "convolutions"),
    Fault("the convolution takes one factor's midpoints for its balls", "\"pkn,pkn->n\", a[1:3], b[2:4]",
          "\"pkn,pkn->n\", a[1:2], b[2:3]", "convolutions"),
    Fault("the convolution is a scalar product", "other._rows[:, :k][:, ::-1]", "other._rows[:, :k]", "convolutions"),
    Fault("the convolution weighs with signs", "np.abs(mid, out=size)", "size[:] = mid", "convolutions"),
    Fault("what comes in is rounded to nearest", "if Fraction(nearest) >= value else", "if True else", "conversions"),
    Fault("what comes in has no rounding", "_upward(abs(centre - Fraction(mid)) + spread)", "_upward(spread)",
          "conversions"),
    Fault("a ball's radius is lost on the way in", "else midpoint_and_radius(value.rad())[0]", "else Fraction(0)",
          "conversions"),
    Fault("subnormal midpoints come in", "        m[small] = 0.0\n", "        r[small] = 0.0\n", "binary"),
    Fault("a negative radius comes in", "(np.isfinite(m) & (r >= 0))", "np.isfinite(m)", "strange_operands"),
    Fault("the middle of an infinite ball is a number", "np.where(self._rad < np.inf, self._mid, np.nan)", "self._mid",
          "strange_operands"),
]  # fmt: skip


def factors(module: ModuleType, count: int) -> None:
    """Whatever a processor makes of subnormal numbers, none is used as an exact factor."""
    assert module._exact_float(2.0**-1074) is None
    assert module._exact_float(2.0**-1022) == 2.0**-1022


OWN = {"factors": factors}


def mutant(old: str, new: str) -> ModuleType:
    """A copy of `lanes`, with copies of what belongs to it; the fault is planted in the one that has its text."""
    assert sum(source.count(old) for source in SOURCES.values()) == 1, old
    copies = {original: executed(source.replace(old, new)) for original, source in SOURCES.items()}
    copies[lanes].sine_and_cosine = copies[doubles].sine_and_cosine
    copies[lanes].outward = copies[doubles].outward
    for name in ("made", "rounded"):
        setattr(copies[lane_series], name, getattr(copies[lanes], name))
    copies[lanes].LaneSeries = copies[lane_series].LaneSeries
    return copies[lanes]


def noticed(fault: Fault, count: int) -> bool:
    attack = ATTACKS.get(fault.attack) or OWN[fault.attack]
    faulty = mutant(fault.old, fault.new)
    try:
        with np.errstate(all="ignore"):
            attack(faulty, count)
    except (AssertionError, ValueError):
        return True
    return False


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_is_noticed(fault) -> None:
    assert noticed(fault, 4000)


def test_the_text_as_it_is_passes() -> None:
    for attack in {fault.attack for fault in FAULTS}:
        (ATTACKS.get(attack) or OWN[attack])(mutant("_TINY = 2.0**-1000", "_TINY = 2.0**-1000"), 500)
