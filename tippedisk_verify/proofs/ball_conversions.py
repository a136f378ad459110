"""The package's numbers and disks in the kernel's balls, and back."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.proofs.kernel.balls import ball, midpoint_and_radius
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField
from tippedisk_verify.proofs.kernel.sliding import field_for_friction

__all__ = ["WIDENING_FACTOR", "ball_constants", "ball_to_measured", "field_for_disk", "widened"]

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


def ball_constants(parameters: Parameters) -> Constants:
    """Return a disk's constants as balls that hold the exact values, at the working precision."""
    exact = parameters.rational_constants()
    return type(exact)(*map(ball, exact))


def field_for_disk(parameters: Any, omega: Any) -> EnclosedField:
    """Return the vector field on balls, as an `EnclosedField`, for a disk and its friction law.

    All numbers are enclosed at the working precision. ``omega`` [rad/s] is the speed.
    """
    return field_for_friction(parameters.friction, ball_constants(parameters), omega)
