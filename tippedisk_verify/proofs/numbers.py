"""The kernel's balls as the package's numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.proofs.kernel.balls import midpoint_and_radius

__all__ = ["WIDER", "measured", "widened"]

#: The margin that another version of Arb or another processor may need
WIDER = 1 + Fraction(1, 2**20)


def measured(x: Any) -> Measured:
    """Return the ball as exact midpoint and radius. Raises InputError if it is not finite."""
    if not x.is_finite():
        raise InputError("an infinite ball has no value")
    return Measured(*midpoint_and_radius(x))


def widened(number: Measured) -> Measured:
    """Widen the half-width by 2^-20 of it, so that other versions of Arb and processors confirm it
    too.
    """
    return Measured(number.value, number.uncertainty * WIDER)
