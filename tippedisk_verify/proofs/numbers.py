"""The kernel's balls as the package's numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.proofs.kernel.balls import midpoint_and_radius

__all__ = ["WIDENING_FACTOR", "ball_to_measured", "widened"]

#: The factor on half-widths: a margin for other versions of Arb and other processors
WIDENING_FACTOR = 1 + Fraction(1, 2**20)


def ball_to_measured(x: Any) -> Measured:
    """Convert a ball to a `Measured` number: its exact midpoint and radius.

    Raises InputError if the ball is not finite.
    """
    if not x.is_finite():
        raise InputError("an infinite ball has no value")
    return Measured(*midpoint_and_radius(x))


def widened(number: Measured) -> Measured:
    """Return the number with its half-width multiplied by 1 + 2^-20.

    Other versions of Arb and other processors then confirm it too.
    """
    return Measured(number.value, number.uncertainty * WIDENING_FACTOR)
