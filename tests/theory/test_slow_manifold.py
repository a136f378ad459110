"""The slow manifold: pure rolling, invariance to the stated order, the reduced flow, and what order 0 conserves."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import pytest
import sympy
from hypothesis import given, settings

from tests.problems import decimals, physical_parameters
from tippedisk_verify.cli import main
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.model import equations
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.slow_manifold import (
    analyse_slow_manifold,
    attraction_rate,
    critical_manifold,
    first_correction,
    invariance_residuals,
    orders,
    reduced_equilibrium,
    reduced_omega_crit,
    slow_manifold,
)

PLACES = [(1.2, 0.3), (1.9, -1.1), (0.9, 2.5), (1.57, 4.0)]


def in_mpmath(parameters, digits):
    ctx = bits(bits_for_digits(digits)).context
    return ctx, parameters.within(ctx)


def test_order_0_conserves_the_height() -> None:
    """d/dt (r + e sin gamma) sin beta = 0 along beta' = h_c, gamma' = -Omega cos beta: exactly, in symbols."""
    r, e, omega, beta, gamma = sympy.symbols("r e Omega beta gamma", positive=True)
    constants = Constants(**{name: {"r": r, "e": e}.get(name) for name in Constants._fields})
    height = (r + e * sympy.sin(gamma)) * sympy.sin(beta)
    rolling = critical_manifold(sympy, constants, omega, beta, gamma)
    change = sympy.diff(height, beta) * rolling - sympy.diff(height, gamma) * omega * sympy.cos(beta)
    assert sympy.simplify(change) == 0


@settings(max_examples=20)
@given(parameters=physical_parameters(), omega=decimals("5", "40"))
def test_residual_slopes_for_random_disks(parameters, omega) -> None:
    place = (1.3, 0.4)
    logs = []
    for exponent in (7, 8):
        ctx, constants = in_mpmath(parameters.changed(epsilon=Fraction(1, 10**exponent)), 80)
        speed = ctx.mpf(omega.numerator) / omega.denominator
        logs.append([ctx.log10(abs(r)) for r in invariance_residuals(ctx, constants, speed, *map(ctx.mpf, place), 3)])
    for order, (coarse, fine) in enumerate(zip(*logs, strict=True)):
        assert abs(float(coarse - fine) - (order + 1)) < 0.1


def test_exponents_hold_where_the_series_is_not_yet_asymptotic() -> None:
    """Weak friction: at epsilon = 1e-4 ... 1e-5 the next term counts as much as this one, with the other sign."""
    found = analyse_slow_manifold(PRINTED.changed(mu="0.0253451", epsilon="0.00269722"), "16.9618", 1)
    for order, slope in enumerate(found.residual_slope):
        assert slope.holds(order + 1)
        assert slope.uncertainty < Fraction(1, 10)


def test_residual_by_series_against_numerical_differences() -> None:
    """The same residual from the surface alone, differentiated numerically, and the field."""
    ctx, constants = in_mpmath(PRINTED.changed(epsilon="1e-3"), 100)
    omega, step = ctx.mpf("30.4"), ctx.mpf(10) ** -30

    def surface(beta, gamma):
        return sum(h * constants.epsilon**n for n, h in enumerate(orders(ctx, constants, omega, beta, gamma, 3)))

    beta, gamma = ctx.mpf("1.2"), ctx.mpf("0.3")
    v = surface(beta, gamma)
    by_beta = (surface(beta + step, gamma) - surface(beta - step, gamma)) / (2 * step)
    by_gamma = (surface(beta, gamma + step) - surface(beta, gamma - step)) / (2 * step)
    _, gamma_rate, rate = equations.field(ctx, constants, omega, "linear")(beta, gamma, v)
    outside = constants.epsilon * (by_beta * v + by_gamma * gamma_rate - rate)
    inside = invariance_residuals(ctx, constants, omega, beta, gamma, 3)[-1]
    # Central differences: step^2 = 1e-60 times third derivatives.
    assert abs(outside - inside) < abs(inside) * ctx.mpf(10) ** -40


@pytest.mark.parametrize("point", PLACES)
def test_the_papers_h1_is_the_recursions(point) -> None:
    constants = PRINTED.at(DOUBLE)
    formula = first_correction(math, constants, 30.4, *point)
    found = orders(math, constants, 30.4, *point, 1)[1]
    assert found == pytest.approx(formula, rel=1e3 * 2.0**-52)  # terms of 1e2 times the result: a thousand roundings
    assert slow_manifold(math, constants, 30.4, *point) == pytest.approx(
        critical_manifold(math, constants, 30.4, *point) + 0.1 * formula
    )


def test_reduced_flow() -> None:
    """Order 0: saddle +-Omega sqrt(e/(r-e)) and centre; order 1 and above: Omega_crit itself."""
    omega = Fraction("30.4")
    saddle = reduced_equilibrium(PRINTED, omega, "noninverted", 0)
    assert abs(saddle.trace) < 1e-30  # pi/2 is rounded to 120 bits
    assert float(-saddle.determinant) == pytest.approx(30.4**2 * 0.0025 / 0.0425, rel=1e-14)  # fifty roundings
    centre = reduced_equilibrium(PRINTED, omega, "inverted", 0)
    assert abs(centre.trace) < 1e-30
    assert float(centre.determinant) == pytest.approx(30.4**2 * 0.0025 / 0.0475, rel=1e-14)  # fifty roundings
    crit = omega_crit(PRINTED, 40).value
    for order in (1, 2, 4):
        assert reduced_omega_crit(PRINTED, order, 25).holds(crit)
    with pytest.raises(AccuracyError, match="centre at every speed"):
        reduced_omega_crit(PRINTED, 0)


def test_attraction_rate_is_the_friction_part_of_the_jacobian() -> None:
    constants, point = PRINTED.at(DOUBLE), (1.2, 0.3)
    free = PRINTED.changed(mu="1e-30").at(DOUBLE)
    with_friction, without = (equations.jacobian(math, c, 30.4, "linear")(*point, 0.5)[2][2] for c in (constants, free))
    rate = attraction_rate(math, constants, *point)
    assert rate == pytest.approx(with_friction - without, rel=1e-12)  # roundings, as terms cancel


def test_command(capsys) -> None:
    """At a point of its own: h_0 is where the disk rolls, gamma_y = 0."""
    point = ["--beta", "1.4", "--gamma", "-2.5", "--omega", "30.4"]
    assert main(["slow-manifold", "--order", "2", "--json", *point]) == 0
    result = json.loads(capsys.readouterr().out)
    c = PRINTED.at(DOUBLE)
    rolling = 30.4 * c.e * math.sin(1.4) * math.cos(-2.5) / (c.r + c.e * math.sin(-2.5))
    assert [float(h["value"]) for h in result["h"][:2]] == pytest.approx(
        [rolling, first_correction(math, c, 30.4, 1.4, -2.5)],
        rel=1e-12,  # some hundred roundings
    )
    for order, slope in enumerate(result["residual_slope"]):
        assert Measured.of(**slope).holds(order + 1)
        assert float(slope["uncertainty"]) < 0.1
    assert "too large for order 2" in result["warning"]
