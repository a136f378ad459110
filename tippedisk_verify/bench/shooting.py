"""The period solve that is raced: Newton's iteration on half a period, the same for every integrator.

Unknown are gamma_bar and v at beta = pi/2 and half the period. By the point symmetry the flow over half a period
changes the sign of the shifted state. No event is located, so that an integrator needs nothing but its flow and the
variational equations to take part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

__all__ = ["Flight", "period_by_newton"]

#: (gamma_bar, v, duration) -> the shifted state after it, and its derivatives by gamma_bar and v, row by row
Flight = Callable[[Any, Any, Any], tuple[Sequence[Any], Sequence[Sequence[Any]]]]
_MOST_STEPS = 12


def period_by_newton(flight: Flight, rates: Any, guess: Sequence[Any], tolerance: float) -> tuple[Any, Any, Any]:
    """(gamma_bar, v, T) from a guess (gamma_bar, v, half of T), in the arithmetic of the guess.

    ``rates`` is the field in shifted angles. The last step squares the error, so it stops after one that is below the
    root of ``tolerance``, with a factor of ten to spare. Raises ArithmeticError if it does not come to that.
    """
    gamma_bar, v, half = guess
    limit = math.sqrt(tolerance) / 10
    for _ in range(_MOST_STEPS):
        end, slopes = flight(gamma_bar, v, half)
        matrix = [[*slopes[row], rate] for row, rate in enumerate(rates(*end))]
        matrix[1][0] = matrix[1][0] + 1
        matrix[2][1] = matrix[2][1] + 1
        step = _solved(matrix, [-end[0], -end[1] - gamma_bar, -end[2] - v])
        gamma_bar, v, half = gamma_bar + step[0], v + step[1], half + step[2]
        if max(abs(float(part)) for part in step) < limit:
            return gamma_bar, v, half + half
    raise ArithmeticError(f"Newton's iteration has not converged after {_MOST_STEPS} steps")


def _solved(matrix: Sequence[Sequence[Any]], right: Sequence[Any]) -> list[Any]:
    """Three equations by Cramer's rule: in any arithmetic, and faster than numpy for doubles."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    first, second, third = e * i - f * h, f * g - d * i, d * h - e * g
    x, y, z = right
    determinant = a * first + b * second + c * third
    return [
        (x * first + y * (c * h - b * i) + z * (b * f - c * e)) / determinant,
        (x * second + y * (a * i - c * g) + z * (c * d - a * f)) / determinant,
        (x * third + y * (b * g - a * h) + z * (a * e - b * d)) / determinant,
    ]
