"""Numbers as doubles rounded outwards, and sine and cosine with proved error bounds, for ball
arrays.

Numbers and Arb's balls become midpoints and radii by exact rational arithmetic. Sine and cosine are
computed from IEEE sums and products alone.

u = 2^-53 and t are those of `ball_array`. It assumes that sums, differences and products of float64
arrays are rounded to nearest, up to an absolute error t of at most 2^-1022 where they underflow.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import arb, midpoint_and_radius

__all__ = ["SMALLEST_NORMAL", "UNIT_ROUNDOFF", "Array", "outward_rounded", "sine_and_cosine"]

Array = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-53  #: u
SMALLEST_NORMAL = 2.0**-1022  #: the smallest number that is not subnormal
# pi/2 = A + B + C + rest: A and B are multiples of 2^-32 and 2^-65 with at most 33 bits, B < 2^-33,
# C < 2^-67 and |rest| < 2^-119. So n A and n B are exact for |n| < 2^19.
_HALF_PI_A = float.fromhex("0x1.921fb544p+0")
_HALF_PI_B = float.fromhex("0x1.0b4611a6p-34")
_HALF_PI_C = float.fromhex("0x1.3198a2e037073p-69")
_MAX_ANGLE = 2.0**18
_MAX_REDUCED_ANGLE = 0.8
# Taylor coefficients in y^2, from the last to the first: of (sin(y) - y) / y^3, and of
# (cos(y) - 1) / y^2.
_SINE_COEFFICIENTS = tuple((-1) ** (i + 1) / math.factorial(2 * i + 3) for i in range(7, -1, -1))
_COSINE_COEFFICIENTS = tuple((-1) ** (i + 1) / math.factorial(2 * i + 2) for i in range(8, -1, -1))


def sine_and_cosine(x: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Compute sine and cosine of doubles reduced by quarter turns, with proved error bounds.

    Returns five arrays: the integers n, sin(x - n pi/2) and the bound of its error, cos(x - n pi/2)
    and the bound of its error. For |x| > 2^18 they are NaN. Below, u = 2^-53, t is the absolute
    error of an underflow, and A + B + C is nearly pi/2.

    *Reduction.* y = ((x - n A) - n B) - n C. Any integer n with |n| < 2^19 is right if |y| <= 0.8,
    which is tested. The three differences, from the last to the first, are then at most 0.8, 0.8 +
    2^-47 and 0.8 + 2^-13. Each errs by u times that. The rounding of n C, n times the rest and t
    come to less than 2^-99. So y errs by less than 2.5 u, and not at all if n = 0. This changes
    sine and cosine by no more.

    *Polynomials.* Let z = y^2 <= 0.64, rounded. Horner's rule for c_0 + c_1 z + … has rounded the
    term c_i z^i at most 3 i + 2 times (i for z, i products, i + 1 sums, the coefficient). So the
    error is at most the sum of (3 i + 2) u |c_i| z^i, but for terms in u^2. A test does these sums
    in exact rationals, those terms included.

    *Sine.* p = -1/6 + z/120 - …: (2/6 + 5 * 0.64/120 + 8 * 0.41/5040 + …) u < 0.37 u. z p errs by z
    (0.37 + 2/6) u, y (z p) by |y| z (0.37 + 3/6) u < 0.56 u |y|, and the sum with y by u |y| more.
    The remainder |y|^19 / 19! is below 0.002 u |y|. Together less than 2 u |y|.

    *Cosine.* p = -1/2 + z/24 - …, where -1/2 is exact: (1/2 + 5 * 0.64/24 + 8 * 0.41/720 + …) u <
    0.65 u. z p errs by 0.64 * 0.65 u + 2 * 0.32 u < 1.1 u, the sum with 1 by u more. The remainder
    |y|^20 / 20! is below 0.0001 u. Together less than 2.5 u.

    The errors t are not multiplied by anything above 1, and the operation adds 2^-1000 for them.
    """
    x = np.where(np.abs(x) <= _MAX_ANGLE, x, np.nan)
    n = np.rint(x * (2 / 3.141592653589793))
    y = ((x - n * _HALF_PI_A) - n * _HALF_PI_B) - n * _HALF_PI_C
    y[~(np.abs(y) <= _MAX_REDUCED_ANGLE)] = np.nan
    reduction_error = np.where(n == 0, 0.0, 2.5 * UNIT_ROUNDOFF)
    z = y * y
    p = np.full_like(z, _SINE_COEFFICIENTS[0])
    for c in _SINE_COEFFICIENTS[1:]:
        p *= z
        p += c
    sine = y + y * (z * p)
    p = np.full_like(z, _COSINE_COEFFICIENTS[0])
    for c in _COSINE_COEFFICIENTS[1:]:
        p *= z
        p += c
    return (
        n,
        sine,
        np.abs(y) * (2 * UNIT_ROUNDOFF) + reduction_error,
        1 + z * p,
        reduction_error + 2.5 * UNIT_ROUNDOFF,
    )


def outward_rounded(value: Any) -> tuple[float, float]:
    """Convert a number or one of Arb's balls to a ball in doubles that holds it: return midpoint
    and radius.

    The radius is infinite if the number is too large. Neither result is subnormal.
    """
    if isinstance(value, arb):
        if not (value.is_finite() and abs(value) < arb(2) ** 1023):
            return 0.0, np.inf
        # Exponents may be extreme. A number smaller than any normal one becomes a radius.
        small = arb(2) ** -1022
        centre = Fraction(0) if abs(value.mid()) < small else midpoint_and_radius(value.mid())[0]
        rad = (
            Fraction(SMALLEST_NORMAL)
            if value.rad() < small and not value.is_exact()
            else midpoint_and_radius(value.rad())[0]
        )
        spread = rad if centre or value.mid() == 0 else rad + Fraction(SMALLEST_NORMAL)
    elif isinstance(value, float):
        return value, 0.0
    else:
        centre, spread = Fraction(value), Fraction(0)
    try:
        mid = float(centre)  # correctly rounded by Python; any float would do
        return mid, _rounded_up(abs(centre - Fraction(mid)) + spread)
    except OverflowError:
        return 0.0, np.inf


def _rounded_up(value: Fraction) -> float:
    if 0 < value < SMALLEST_NORMAL:
        return SMALLEST_NORMAL
    nearest = float(value)
    return nearest if Fraction(nearest) >= value else float(np.nextafter(nearest, np.inf))
