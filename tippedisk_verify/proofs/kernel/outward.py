"""Numbers and Arb's balls as midpoints and radii in double precision, rounded outward by exact rational arithmetic."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from tippedisk_verify.proofs.kernel.balls import arb, midpoint_and_radius

__all__ = ["outward"]

_NORMAL = 2.0**-1022  # the smallest number that is not subnormal


def outward(value: Any) -> tuple[float, float]:
    """A midpoint and a radius that hold a number or one of arb's balls.

    The radius is infinite if the number is too large; neither is subnormal.
    """
    if isinstance(value, arb):
        if not (value.is_finite() and abs(value) < arb(2) ** 1023):
            return 0.0, np.inf
        # Exponents may be beyond all reason; what is smaller than any normal number becomes a radius.
        small = arb(2) ** -1022
        centre = Fraction(0) if abs(value.mid()) < small else midpoint_and_radius(value.mid())[0]
        rad = Fraction(_NORMAL) if value.rad() < small and not value.is_exact() else midpoint_and_radius(value.rad())[0]
        spread = rad if centre or value.mid() == 0 else rad + Fraction(_NORMAL)
    elif isinstance(value, float):
        return value, 0.0
    else:
        centre, spread = Fraction(value), Fraction(0)
    try:
        mid = float(centre)  # correctly rounded by Python; any float would do
        return mid, _upward(abs(centre - Fraction(mid)) + spread)
    except OverflowError:
        return 0.0, np.inf


def _upward(value: Fraction) -> float:
    if 0 < value < _NORMAL:
        return _NORMAL
    nearest = float(value)
    return nearest if Fraction(nearest) >= value else float(np.nextafter(nearest, np.inf))
