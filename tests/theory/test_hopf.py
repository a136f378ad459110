"""The Hopf point: a purely imaginary pair at Omega_crit, whatever the friction."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest
from hypothesis import given

from tests.problems import SETS, decimals, physical_parameters
from tippedisk_verify.theory.equilibria import characteristic_polynomial, linearization
from tippedisk_verify.theory.hopf import critical_frequency_squared, omega_crit, omega_crit_squared, period_crit


@given(parameters=physical_parameters(), mu=decimals("0.01", "5"), epsilon=decimals("0.001", "5"))
def test_omega_crit_makes_an_imaginary_pair_whatever_the_friction(parameters, mu, epsilon) -> None:
    """Exactly: lambda^3 + a2 lambda^2 + a1 lambda + a0 with lambda^2 = -w^2 vanishes iff a1 = w^2 and a2 w^2 = a0.

    The entries hold Omega only as Omega^2 (A31, and Omega A32), so the squares make this rational.
    """
    changed = parameters.changed(mu=mu, epsilon=epsilon)
    square = omega_crit_squared(changed)
    assert square == omega_crit_squared(parameters)
    unit = linearization(changed, Fraction(1))
    a2 = -unit.A33
    a1 = -(unit.A31 + 1) + square  # A31 = g (r + e) / b - Omega^2
    a0 = -unit.A32 * square  # Omega A32 is proportional to Omega^2
    frequency = critical_frequency_squared(changed)
    assert a1 == frequency
    assert a2 * frequency == a0
    assert characteristic_polynomial(unit)[1] == a2


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_digits_hold(parameters) -> None:
    for function in (omega_crit, period_crit):
        coarse, fine = function(parameters, 12), function(parameters, 60)
        assert coarse.holds(fine.value)
        assert coarse.uncertainty <= coarse.value / 10**12
    with mpmath.workdps(60):
        p = parameters
        ratio = (p.r + p.e) ** 2 * p.m * p.g / (p.r * p.Bbar)
        expected = mpmath.sqrt(mpmath.mpf(ratio.numerator) / ratio.denominator)
        assert abs(mpmath.mpf(omega_crit(p, 50).decimals()[0]) - expected) < mpmath.mpf("1e-45")
