"""The Hopf point: its speed, its first Lyapunov coefficient and its laws, by formal series."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest
from hypothesis import given, settings

from tests.problems import decimals, physical_parameters
from tests.theory.formal_cycles import formal_cycles
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.theory.equilibria import characteristic_polynomial, linearization
from tippedisk_verify.theory.hopf import (
    critical_frequency_squared,
    criticality,
    hopf_point,
    omega_crit,
    omega_crit_squared,
)


@given(parameters=physical_parameters(), mu=decimals("0.01", "5"), epsilon=decimals("0.001", "5"))
def test_omega_crit_makes_an_imaginary_pair_for_every_friction(parameters, mu, epsilon) -> None:
    """Check lambda^2 = -w^2 exactly: the cubic vanishes iff a1 = w^2 and a2 w^2 = a0.

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


@settings(max_examples=15)
@given(parameters=physical_parameters())
def test_the_laws_follow_from_the_full_equations(parameters) -> None:
    """Compare with formal series: l_1 from the normal form, the laws from the family of cycles."""
    point = hopf_point(parameters, 40)
    with mpmath.workdps(70):
        frequency = 2 * mpmath.pi / point.period.mpf()
        # l_1 is for z with <q, q> = 1, the series' w is q_2 z.
        share = 1 / (1 + (frequency / point.omega_crit.mpf()) ** 2 * (1 + frequency**2))
        coefficient = (
            mpmath.re(formal_cycles(parameters, normal_form=True).kappa[0]) * share / frequency
        )
        family = formal_cycles(parameters)
        slope = 2 * mpmath.pi / frequency**2 * mpmath.im(family.kappa[0]) / family.omega[0]
        # Large friction and small differences of inertias cost some twenty of the 70 digits.
        assert abs(point.first_lyapunov_coefficient.mpf() / coefficient - 1) < mpmath.mpf(10) ** -38
        assert abs(point.slopes()[1].mpf() / slope - 1) < mpmath.mpf(10) ** -38
        coefficients = (point.quadratic_coefficient, point.quartic_coefficient)
        for mine, derived in zip(coefficients, family.amplitude_law(), strict=True):
            assert abs(derived - mine.mpf()) < mpmath.mpf(10) ** -38 * (
                abs(derived) + point.omega_crit.mpf()
            )
    assert point.criticality == ("supercritical" if coefficient < 0 else "subcritical")
    if parameters.e < parameters.r / 2:
        p = parameters
        bound = p.r * (2 * p.r - p.e) / (2 * (p.r + p.e) * (p.r - 2 * p.e))
        assert (p.A / p.Bbar > bound) == (point.criticality == "supercritical")
    else:
        assert point.criticality == "subcritical"


@settings(max_examples=8)
@given(parameters=physical_parameters(), share=decimals("0.01", "0.3"))
def test_where_the_first_coefficient_vanishes_the_second_follows_from_the_full_equations(
    parameters: Parameters, share: Fraction
) -> None:
    """Compare with formal series at A = Bbar r (2 r - e) / (2 (r + e) (r - 2 e))."""
    r, m, e = parameters.r, parameters.m, share * parameters.r
    Bbar = parameters.B + m * r**2
    A = Bbar * r * (2 * r - e) / (2 * (r + e) * (r - 2 * e))
    disk = parameters.changed(e=e, B=Bbar + m * e**2, A=A, C=None)
    assert criticality(disk) == "degenerate"
    point = hopf_point(disk, 30)
    assert (
        point.first_lyapunov_coefficient.value == point.first_lyapunov_coefficient.uncertainty == 0
    )
    assert point.amplitude_squared_slope is point.period_slope is None
    with mpmath.workdps(70):
        frequency = 2 * mpmath.pi / hopf_point(disk, 60).period.mpf()
        share = 1 / (1 + (frequency / omega_crit(disk, 60).mpf()) ** 2 * (1 + frequency**2))
        second = mpmath.re(formal_cycles(disk, normal_form=True).kappa[1]) * share**2 / frequency
        # Thirty digits, as asked
        assert abs(point.second_lyapunov_coefficient.mpf() / second - 1) < mpmath.mpf(10) ** -30


@pytest.mark.parametrize("distance", ["1e-30", "1e-100", "-1e-30"])
def test_next_to_a_generalized_hopf_point_cancellation_costs_no_digits(distance: str) -> None:
    """Move a hundred digits nearer: l_1 and c_1, both linear in A, are as much smaller."""
    # r = 4 e: l_1 = 0 where A = 7 Bbar / 5, a decimal.
    degenerate = PRINTED.changed(r="0.04", e="0.01", m="0.4", A="0.224e-3", B="0.2e-3", C=None)
    near, far = (
        degenerate.changed(A=degenerate.A + Fraction(shift)) for shift in (distance, "1e-6")
    )
    ratio = Fraction(distance) * 10**6
    found, reference = hopf_point(near, 20), hopf_point(far, 40)
    for name in ("first_lyapunov_coefficient", "quadratic_coefficient"):
        number = getattr(found, name)
        assert (number - getattr(reference, name) * ratio).holds(0)
        assert number.uncertainty * 10**20 <= abs(number.value)
    assert found.criticality == ("supercritical" if ratio > 0 else "subcritical")
