"""The asymptotic law of the librating cycles' period above Omega_h."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.omega_h_digits import FIRST_DIGITS
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.near_omega_h.cycles_by_passages import (
    global_maps,
    passages_exist,
    with_half_widths,
)
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import EXTENDED

__all__ = ["PeriodLaw", "period_law"]


class PeriodLaw(NamedTuple):
    """The asymptotic law of the librating cycles' period at a distance D above Omega_h.

    It is T = slope log(D) + constant + coefficient D^exponent + ...
    """

    slope: Measured  #: -2 / lambda_u [s]
    constant: Measured  #: [s], with D in rad/s
    coefficient: Measured  #: [s], with D in rad/s
    #: -lambda_s / lambda_u - 1; the powers that are left out begin with its double
    exponent: Measured

    def at(self, distance: Fraction) -> tuple[Measured, Measured, Measured]:
        """Return the period T [s] that the law gives at a distance from Omega_h: by one, two and
        three of its terms.

        Args:
            distance: The distance above Omega_h [rad/s].
        """
        size = Measured(distance, Fraction(0))
        first = self.slope * size.log()
        return (
            first,
            first + self.constant,
            first + self.constant + self.coefficient * size**self.exponent,
        )


@ignore_numpy_errors()
def period_law(parameters: Parameters, engine: Engine) -> PeriodLaw:
    """Return the asymptotic law of the librating cycles' period above Omega_h, from the maps
    between the saddles.

    The maps give sigma = -s (u / u_1)^nu, with u and s where the unstable manifold arrives. With u
    = a D + b sigma the third term is the first power of sigma in -log(u).

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.

    Raises:
        NoSuchCycleError: If the saddle value is not negative, or the machine has no numbers of 64
            bits.
        NoConnectionError: If there is no connection.
        AccuracyError: If the flights fail.
    """
    guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    omega_h = splitting_zero(parameters, guess, engine, FIRST_DIGITS).omega_h.value
    if not passages_exist(parameters, engine, omega_h):
        raise NoSuchCycleError(
            "the law of the period with its corrections needs a negative saddle value and 64 bits"
        )
    rows = []
    for global_map in global_maps(parameters, omega_h, engine):
        unstable, slow, _ = global_map.arriving.chart_at(EXTENDED.number(0)).eigenvalues
        (by_omega, by_sigma), s = global_map.leading_coefficients
        nu, scale = -slow / unstable, global_map.u_1 / -by_omega
        constant = 2 * (EXTENDED.number(global_map.duration) + numpy.log(scale) / unstable)
        coefficient = 2 * by_sigma * s / (unstable * by_omega * scale**nu)
        rows.append(
            {
                "slope": -2 / unstable,
                "constant": constant,
                "coefficient": coefficient,
                "exponent": nu - 1,
            }
        )
    return PeriodLaw(**with_half_widths(rows[0], rows[1:], Fraction(0)))
