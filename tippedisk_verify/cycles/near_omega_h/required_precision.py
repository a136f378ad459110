"""The arithmetic that a cycle needs at a distance from Omega_h."""

from __future__ import annotations

import math
from fractions import Fraction

from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_logarithm
from tippedisk_verify.numbers.precision import (
    QUADRUPLE,
    Precision,
    bits_for_digits,
    precision_of_bits,
)
from tippedisk_verify.theory.equilibria import equilibrium

__all__ = ["precision_near_omega_h"]


def precision_near_omega_h(
    parameters: Parameters, omega_h: Fraction, above: Fraction, digits: int
) -> Precision:
    """Return the arithmetic in which a cycle next to Omega_h must be computed to keep its digits.

    Rounding grows over a passage like 1 / above. It must be small against the state's distance from
    the saddle. That distance is of the order of ``above`` to the power lambda_u / (lambda_u -
    lambda_s).

    Args:
        parameters: The disk and its friction law.
        omega_h: Omega_h [rad/s].
        above: Omega - Omega_h [rad/s].
        digits: The digits that must be left.
    """
    unstable, slow, _ = (
        float(value.re) for value in equilibrium(parameters, omega_h, "noninverted").eigenvalues
    )
    power = 1 + unstable / (unstable - slow)
    needed = bits_for_digits(
        digits + 4 + math.ceil(power * max(0.0, -decimal_logarithm(abs(above))))
    )
    return QUADRUPLE if needed <= QUADRUPLE.bits else precision_of_bits(needed)
