"""The limit epsilon -> 0, against the Hopf point, a plain quadrature, and cycles at small epsilon."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from tests.problems import SETS
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.cycles.spectral import balanced_cycle
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


def test_it_does_not_depend_on_friction_and_digits_hold() -> None:
    coarse, fine = limit_speed(PRINTED, digits=12), limit_speed(PRINTED.changed(mu="0.9", epsilon="2"), digits=40)
    assert coarse.holds(fine.value)
    assert fine.uncertainty < Fraction(1, 10**38)


def test_cycles_at_small_epsilon_tend_to_it() -> None:
    """Omega of the cycle through gamma_bar_0 = 1 differs from the limit by order epsilon^2 here."""
    limit = limit_speed(PRINTED, "1")
    differences = []
    for epsilon in ("0.02", "0.01"):
        thin = PRINTED.changed(epsilon=epsilon)
        # dOmega/dgamma_bar_0 from two balances; gamma_bar_0 = 1 by the secant.
        speeds = [limit.value, limit.value + Fraction(1, 1000)]
        sizes = [balanced_cycle(thin, speed).gamma_bar_0.value for speed in speeds]
        for _ in range(3):
            ahead = speeds[-1] + (1 - sizes[-1]) * (speeds[-1] - speeds[-2]) / (sizes[-1] - sizes[-2])
            speeds.append(Fraction(round(ahead * 10**18), 10**18))
            sizes.append(balanced_cycle(thin, speeds[-1]).gamma_bar_0.value)
            if abs(sizes[-1] - 1) < Fraction(1, 10**10):
                break
        differences.append(abs(speeds[-1] - limit.value))
    assert differences[1] < Fraction(1, 10**3)
    assert 1.8 < float(differences[0] / differences[1]) < 4.5


@pytest.mark.slow
def test_omega_h_extrapolated_to_epsilon_zero(taylor) -> None:
    nodes = [Fraction(1, 10 * 2**k) for k in range(7)]
    values = [heteroclinic(PRINTED.changed(epsilon=x), taylor, digits=15).omega_h.value for x in nodes]
    for step in range(1, len(nodes)):  # Neville's scheme at 0
        values = [
            (nodes[i] * values[i + 1] - nodes[i + step] * values[i]) / (nodes[i] - nodes[i + step])
            for i in range(len(values) - 1)
        ]
    assert abs(values[-1] / limit_speed(PRINTED).value - 1) < Fraction(1, 10**8)


def test_refusals() -> None:
    for wrong in ("0", "-1", "3.2", "pi"):
        with pytest.raises(InputError, match="between 0 and pi"):
            limit_speed(PRINTED, wrong)
    with pytest.raises(InputError, match="200 digits"):
        limit_speed(PRINTED, digits=1000)
