"""Angles counted from a multiple of a right angle, so that the equations of motion see an
equilibrium exactly.

At an equilibrium the angles are odd multiples of pi/2. No ball is exactly such a multiple, but
their sines and cosines are 0 and +-1. `QuarterTurnAngle(n, offset)` is the angle n pi/2 + offset.
`OPS` gives its sine and cosine from those of the offset, which is a ball, a series of balls, or
None for no offset. With None the results of `model.equations` for exact numbers are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from tippedisk_verify.model.equations import jacobian, vector_field
from tippedisk_verify.model.friction import Friction
from tippedisk_verify.model.parameters import Constants

__all__ = ["INVERTED", "NONINVERTED", "OPS", "QuarterTurnAngle", "linearization", "rates"]

#: The number of right angles in gamma; beta has one at both equilibria.
INVERTED, NONINVERTED = 1, -1


class QuarterTurnAngle(NamedTuple):
    """An angle near a multiple of pi/2: ``quarters`` * pi/2 + ``offset`` [rad]."""

    quarters: int
    offset: Any = None


class _QuarterTurnOps:
    """The sine and cosine of `QuarterTurnAngle` angles, in the form (``ops``) that
    `model.equations` needs.
    """

    @staticmethod
    def sin(angle: QuarterTurnAngle) -> Any:
        quarters = angle.quarters % 4
        if angle.offset is None:
            return (0, 1, 0, -1)[quarters]
        value = angle.offset.cos() if quarters % 2 else angle.offset.sin()
        return -value if quarters > 1 else value

    @staticmethod
    def cos(angle: QuarterTurnAngle) -> Any:
        return _QuarterTurnOps.sin(QuarterTurnAngle(angle.quarters + 1, angle.offset))


OPS = _QuarterTurnOps()


def rates(
    constants: Constants,
    omega: Any,
    around: int,
    offsets: Sequence[Any],
    friction: Friction = "linear",
    side: int | None = None,
) -> tuple[Any, Any, Any]:
    """Return the rates (beta', gamma', v') at a state given by its ``offsets`` from an equilibrium.

    The equilibrium is beta = pi/2, gamma = ``around`` * pi/2, v = 0.
    """
    beta, gamma, v = offsets
    return vector_field(OPS, constants, omega, friction, side)(
        QuarterTurnAngle(1, beta), QuarterTurnAngle(around, gamma), v
    )


def linearization(
    constants: Constants,
    omega: Any,
    around: int,
    friction: Friction = "linear",
    side: int | None = None,
) -> tuple[tuple[Any, ...], ...]:
    """Return the Jacobian of the equations of motion at an equilibrium.

    It is exact for rational constants and speed, and enclosed for balls. The equilibrium is beta =
    pi/2, gamma = ``around`` * pi/2, v = 0. ``side`` has the meaning of `model.equations.jacobian`.
    """
    return jacobian(OPS, constants, omega, friction, side)(
        QuarterTurnAngle(1), QuarterTurnAngle(around), 0
    )
