"""The limit epsilon -> 0, against the Hopf point and plain quadratures."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from tests.problems import SETS
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.theory.hopf import omega_crit, period_crit
from tippedisk_verify.theory.melnikov import limit_period, limit_speed
from tippedisk_verify.theory.slow_manifold import first_correction


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_small_cycles_sit_at_the_hopf_point(parameters) -> None:
    """Omega_crit and T_crit depend on epsilon not at all; the rest is of second order in the amplitude."""
    assert abs(limit_speed(parameters, "1e-5").value - omega_crit(parameters, 30).value) < Fraction(1, 10**8)
    assert abs(limit_period(parameters, "1e-5").value - period_crit(parameters, 30).value) < Fraction(1, 10**9)


def test_the_integral_vanishes_by_a_plain_quadrature() -> None:
    """In gamma itself, with beta from the conserved height: no substitution, no split into powers of Omega."""
    c = Constants(*(mpmath.mpf(v.numerator) / v.denominator for v in PRINTED.rational()))
    with mpmath.workdps(25):
        largest, omega = mpmath.mpf(2), mpmath.mpf(limit_speed(PRINTED, "2").decimals()[0])
        level = c.r + c.e * mpmath.cos(largest)

        def integrand(gamma_bar):
            rho = c.r + c.e * mpmath.cos(gamma_bar)
            beta = mpmath.pi - mpmath.asin(level / rho)
            return rho * first_correction(mpmath, c, omega, beta, gamma_bar + mpmath.pi / 2)

        whole = mpmath.quad(integrand, [-largest, 0, largest])
        size = mpmath.quad(lambda x: abs(integrand(x)), [-largest, 0, largest])
        assert abs(whole) < 1e-11 * size
        # gamma' = -Omega cos(beta); the square root at the ends is taken out by hand, with gamma_bar = 2 sin(x).
        turned = mpmath.quad(
            lambda x: (
                largest
                * mpmath.cos(x)
                / mpmath.sqrt(1 - (level / (c.r + c.e * mpmath.cos(largest * mpmath.sin(x)))) ** 2)
            ),
            [-mpmath.pi / 2, 0, mpmath.pi / 2],
        )
        assert abs(limit_period(PRINTED, "2").mpf() * omega / (2 * turned) - 1) < 1e-9


def test_it_does_not_depend_on_friction_and_digits_hold() -> None:
    coarse, fine = limit_speed(PRINTED, digits=12), limit_speed(PRINTED.changed(mu="0.9", epsilon="2"), digits=40)
    assert coarse.holds(fine.value)
    assert fine.uncertainty < Fraction(1, 10**38)


def test_refusals() -> None:
    for wrong in ("0", "-1", "3.2", "pi"):
        with pytest.raises(InputError, match="between 0 and pi"):
            limit_speed(PRINTED, wrong)
    with pytest.raises(InputError, match="200 digits"):
        limit_speed(PRINTED, digits=1000)
