"""What the kernel's balls say, as the package's numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.proofs.kernel.balls import midpoint_and_radius

__all__ = ["WIDER", "measured", "widened"]

WIDER = 1 + Fraction(1, 2**20)  #: what another version of Arb or another processor may need


def measured(x: Any) -> Measured:
    """The ball as exact midpoint and radius. Raises InputError if it is not finite: such a ball says nothing."""
    if not x.is_finite():
        raise InputError("an infinite ball has no value")
    return Measured(*midpoint_and_radius(x))


def widened(number: Measured) -> Measured:
    """With a half-width larger by 2^-20 of it, so that another version of Arb or another processor shows it too."""
    return Measured(number.value, number.uncertainty * WIDER)
