"""What a double sees close to Omega_h, and the laws that hold there.

Cycles of growing period are solved in quadruple precision, which resolves them down to Omega_h + 1e-13; then the same
speeds, rounded to doubles, are shot at in double. A rounding of Omega alone moves T by 2 / (lambda_u D) roundings, so
each digit of D costs a digit of T, until the answer is noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tippedisk_verify.connection.heteroclinic import Heteroclinic, heteroclinic
from tippedisk_verify.cycles.period_continuation import cycle_at_half_period, lengthened
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.cycles.shooting import limit_cycle, shoot
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, QUADRUPLE
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["Sight", "limit_of_powers", "near_omega_h"]

_DIGITS = 28
_FITTED = 6  # cycles, the closest ones, that the law's constant is taken from
_LONGEST = 10.2  # s; Omega_h + 1e-13 for the named sets, the last that quadruple precision resolves well


@dataclass(frozen=True)
class Sight:
    """One cycle close to Omega_h: what it is, and what double precision makes of it."""

    distance: float  #: D = Omega - Omega_h [rad/s]
    period: float  #: T [s]
    remainder: float  #: T + (2 / lambda_u) log(D) - c, with D in rad/s [s]
    period_error: float | None  #: |T in double - T| [s]; None where double finds no cycle
    state_error: float | None  #: of pi - gamma_bar_0, relative
    expected_error: float  #: what rounding Omega to a double does to T at most [s]


def limit_of_powers(points: Sequence[tuple[float, float]], power: float) -> float:
    """The limit at x = 0 of y(x) = c + c_1 x^p + c_2 x^(2p) + ..., by as many terms as there are points (x, y)."""
    import numpy

    x, y = numpy.array(points).T
    # In units of the farthest point, so that the columns are of one size.
    columns = numpy.vander((x / x[0]) ** power, increasing=True)
    return float(numpy.linalg.solve(columns, y)[0])


def near_omega_h(parameters: Parameters, engine: Engine) -> tuple[Heteroclinic, float, list[Sight]]:
    """The connection, the constant c [s] of the period's law, and cycles from mid-branch down to Omega_h + 1e-13.

    The law is T = c - (2 / lambda_u) log(D) + O(D^p), p = |lambda_s| / lambda_u - 1, with D in rad/s. Raises
    NoSuchCycleError or Shortfall where the family cannot be followed.
    """
    connection = heteroclinic(parameters, engine, digits=_DIGITS)
    omega_h = connection.omega_h.value
    growth = float(connection.saddle_eigenvalues[0])
    middle = (omega_h + omega_crit(parameters, 20).value) / 2
    cycle = limit_cycle(parameters, Fraction(float(middle)), engine, precision=DOUBLE)
    guess = (float(cycle.gamma_bar_0), float(cycle.v_0), float(middle))
    first = cycle_at_half_period(parameters, float(cycle.period) / 2, guess, engine, QUADRUPLE)
    rows = []
    steps = {"first_step": 0.1, "longest_step": 0.6}
    for point in lengthened(parameters, first, engine, longest=_LONGEST, precision=QUADRUPLE, **steps):
        above = fraction(point.omega) - omega_h
        omega, period = float(fraction(point.omega)), 2 * fraction(point.half_period)
        state = (float(point.gamma_bar_0), float(point.v_0))
        left = float(QUADRUPLE.pi - point.gamma_bar_0)
        errors: tuple[float | None, float | None] = (None, None)
        try:
            fixed_point = shoot(ReturnMap(LIBRATING, parameters, Fraction(omega), engine), state)
            errors = (
                abs(float(2 * fraction(fixed_point.image.time) - period)),
                abs(float(fraction(fixed_point.point[0]) - fraction(point.gamma_bar_0))) / left,
            )
        except NoSuchCycleError:
            pass
        rows.append((float(above), float(period), errors, 2 / growth / float(above) * math.ulp(omega) / 2))
    power = -float(connection.saddle_eigenvalues[1]) / growth - 1
    logarithmic = [(above, period + 2 / growth * math.log(above)) for above, period, _, _ in rows]
    constant = limit_of_powers(logarithmic[-_FITTED:], power)
    return (
        connection,
        constant,
        [
            Sight(above, period, period + 2 / growth * math.log(above) - constant, *errors, expected)
            for above, period, errors, expected in rows
        ],
    )
