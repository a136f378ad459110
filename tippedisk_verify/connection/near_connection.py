"""Limit cycles so close to Omega_h that doubles see nothing of them: at Omega_h + D, with D down to 1e-100 and below.

Omega_h itself must be known to more digits than D has zeros; the manifolds' splitting provides it. The family followed
in its period predicts the cycle, and shooting in an arithmetic chosen from D corrects it.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from tippedisk_verify.connection.limit_of_cycles import PeriodContinuation, resolving
from tippedisk_verify.cycles.error_budget import cycle_in
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.cycles.shooting import limit_cycle, shoot_beside_saddle
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters

__all__ = ["DOUBLE_SHOOTS", "cycle_near"]

DOUBLE_SHOOTS = Fraction(1, 10**5)  # rad/s; closer, shooting in double does not settle reliably


def cycle_near(
    parameters: Parameters,
    omega: Fraction,
    omega_h: Fraction,
    engine: Engine,
    *,
    digits: int = 12,
) -> LimitCycle:
    """The limit cycle at exactly ``omega`` [rad/s], next to ``omega_h``: their distance needs some digits.

    It lies above, or below where the saddle value is positive.

    Raises NoSuchCycleError where none is found, Shortfall if the digits are not reached.
    """
    above = omega - omega_h
    if abs(above) > DOUBLE_SHOOTS:
        guess = PeriodContinuation(parameters, engine).nearest(above)
        return limit_cycle(parameters, omega, engine, digits=digits, guess=guess)
    precision = resolving(parameters, omega_h, above, digits + 4)
    return_map = ReturnMap(LIBRATING, parameters, omega, engine, precision)
    # Until the distance from the saddle has six digits or more.
    fixed_point = shoot_beside_saddle(
        return_map, _predicted(parameters, above, engine), lambda point: (precision.pi - point[0], -point[1])
    )
    return cycle_in(fixed_point, precision)


def _predicted(parameters: Parameters, above: Fraction, engine: Engine) -> Sequence[Any]:
    """(gamma_bar_0, v_0) near the cycle, by the family followed down to about the square root of ``above``."""
    descent = PeriodContinuation(parameters, engine)
    if abs(above) >= abs(descent.above):
        return descent.nearest(above)
    while 100 * descent.change >= abs(above):
        descent.further(4 * abs(above))
    precision = resolving(parameters, descent.law.omega_h, above, 20)
    _, guess = descent.law.at(above, descent.here, precision)
    return guess[:2]
