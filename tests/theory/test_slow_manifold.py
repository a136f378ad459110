"""The slow manifold: pure rolling, invariance, the reduced flow, and the conserved height."""

from __future__ import annotations

import math
import operator
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.command_line import answer
from tests.problems import decimals, paper_rates, physical_parameters
from tippedisk_verify import (
    DOUBLE,
    PRINTED,
    AccuracyError,
    Measured,
    Parameters,
    analyse_slow_manifold,
    omega_crit,
)
from tippedisk_verify.model import equations
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.theory.slow_manifold import (
    attraction_rate,
    critical_manifold,
    first_correction,
    invariance_residuals,
    reduced_equilibrium,
    reduced_omega_crit,
    series_orders,
    slow_manifold,
)

HIGHEST = 4
#: [m/s]; the digits leave a hundred to a residual of order epsilon^5.
EPSILONS = [Fraction(1, 10**20 * 2**n) for n in range(4)]
DIGITS = 200


class Surface(NamedTuple):
    """The orders h_0 ... h_4 at a point, with derivatives by complex steps."""

    h: list[Any]
    by_beta: list[Any]
    by_gamma: list[Any]

    @classmethod
    def at(cls, parameters: Parameters, omega: Any, beta: Any, gamma: Any) -> Surface:
        """In mpmath's precision. The square of the step is left out, below the last digit."""
        step = mpmath.mpc(0, mpmath.mpf(10) ** (-mpmath.mp.dps))
        constants = parameters.constants_in_context(mpmath.mp)
        along_beta, along_gamma = (
            series_orders(mpmath.mp, constants, omega, *place, HIGHEST)
            for place in ((beta + step, gamma), (beta, gamma + step))
        )
        by_beta, by_gamma = (
            [value.imag / step.imag for value in along] for along in (along_beta, along_gamma)
        )
        return cls([value.real for value in along_beta], by_beta, by_gamma)

    def residual(
        self, parameters: Parameters, omega: Fraction, beta: Any, gamma: Any, order: int
    ) -> Any:
        """epsilon (dh/dt - v') along the reduced flow beta' = h, gamma' = -Omega cos(beta) of
        an order.
        """
        epsilon = rational_in_context(mpmath.mp, parameters.epsilon)
        powers = [epsilon**n for n in range(order + 1)]
        v, by_beta, by_gamma = (sum(map(operator.mul, part, powers)) for part in self)
        beta_rate, gamma_rate, rate = paper_rates(parameters, omega, (beta, gamma, v))
        return epsilon * (by_beta * beta_rate + by_gamma * gamma_rate - rate)


def assert_exponent(sizes: list[Any], exponent: int) -> None:
    """Check that the sizes fall like that power of epsilon between neighbours of `EPSILONS`.

    The next power counts 1e-20 times the ratio of two orders. That ratio is below 1e12 except next
    to a zero.
    """
    for coarse, fine in pairwise(sizes):
        # 1e-20 times 1e12 is 1e-8; a hundred times more for a ratio next to a zero.
        assert abs(mpmath.log(coarse / fine, 2) - exponent) < 1e-6


@pytest.mark.parametrize("law", ["linear", "smooth"])
@settings(max_examples=15)
@given(
    parameters=physical_parameters(),
    omega=decimals("5", "40"),
    beta=decimals("0.3", "2.8"),
    gamma=decimals("-7", "7"),
)
def test_the_reduced_flow_leaves_residuals_of_its_order(
    law, parameters, omega, beta, gamma
) -> None:
    """Check epsilon^(N + 1) under the linear law.

    Under the smooth law only h_0 is right, and a residual of first order remains.
    """
    with mpmath.workdps(DIGITS):
        speed, *place = (rational_in_context(mpmath.mp, number) for number in (omega, beta, gamma))
        surface = Surface.at(parameters, speed, *place)
        disks = [parameters.changed(epsilon=epsilon, friction=law) for epsilon in EPSILONS]
        rows = [
            [surface.residual(disk, omega, *place, order) for disk in disks]
            for order in range(HIGHEST + 1)
        ]
        for order, row in enumerate(rows):
            assert_exponent(
                [abs(residual) for residual in row], order + 1 if law == "linear" else 1
            )
        if law == "linear":
            for column, disk in enumerate(disks):
                constants = disk.constants_in_context(mpmath.mp)
                stated = invariance_residuals(mpmath.mp, constants, speed, *place, HIGHEST)
                for row, residual in zip(rows, stated, strict=True):
                    # Of 200 digits the smallest residual, 1e-100 of its terms, keeps a hundred.
                    assert abs(residual - row[column]) < abs(residual) * mpmath.mpf(10) ** -70
                closed = critical_manifold(mpmath.mp, constants, speed, *place)
                correction = first_correction(mpmath.mp, constants, speed, *place)
                # Of 200 digits cancelling terms lose some
                assert abs(closed - surface.h[0]) < abs(closed) * mpmath.mpf(10) ** -180
                assert abs(correction - surface.h[1]) < abs(correction) * mpmath.mpf(10) ** -180
                assert slow_manifold(mpmath.mp, constants, speed, *place, 0) == closed
                assert (
                    slow_manifold(mpmath.mp, constants, speed, *place)
                    == closed + constants.epsilon * correction
                )


@pytest.mark.parametrize("law", ["linear", "smooth"])
@settings(max_examples=15)
@given(
    parameters=physical_parameters(),
    omega=decimals("5", "40"),
    name=st.sampled_from(("inverted", "noninverted")),
    order=st.integers(0, HIGHEST),
)
def test_the_reduced_linearisation_leaves_residuals_of_its_order(
    law, parameters, omega, name, order
) -> None:
    """Check that v = p x + q y solves the linearised equations up to its order, under both laws."""
    with mpmath.workdps(DIGITS):
        speed, step = rational_in_context(mpmath.mp, omega), mpmath.mpf(10) ** -DIGITS
        start = (mpmath.pi / 2, mpmath.pi / 2 if name == "inverted" else -mpmath.pi / 2)
        sizes = []
        for epsilon in EPSILONS:
            disk = parameters.changed(epsilon=epsilon, friction=law)
            reduced = reduced_equilibrium(disk, omega, name, order, mpmath.mp.prec)
            trace, determinant = (
                rational_in_context(mpmath.mp, fraction(number)) for number in reduced
            )
            by_beta, by_gamma = trace, -determinant / speed
            residuals = []
            for x, y in ((1, 0), (0, 1)):
                v = by_beta * x + by_gamma * y
                moved = [
                    at + mpmath.mpc(0, step * part)
                    for at, part in zip((*start, 0), (x, y, v), strict=True)
                ]
                beta_rate, gamma_rate, rate = (
                    part.imag / step for part in paper_rates(disk, omega, moved)
                )
                residuals.append(by_beta * beta_rate + by_gamma * gamma_rate - rate)
            sizes.append(rational_in_context(mpmath.mp, epsilon) * max(map(abs, residuals)))
        assert_exponent(sizes, order + 1)


def test_exponents_hold_where_the_series_is_not_yet_asymptotic() -> None:
    """Check weak friction, where the next term is as large and has the other sign.

    This holds at epsilon = 1e-4 ... 1e-5.
    """
    found = analyse_slow_manifold(
        PRINTED.changed(mu="0.0253451", epsilon="0.00269722"), "16.9618", 1
    )
    for order, slope in enumerate(found.residual_slope):
        assert slope.holds(order + 1)
        assert slope.uncertainty < Fraction(1, 10)


def test_the_reduced_flow_has_the_same_omega_crit_from_the_first_order_on() -> None:
    crit = omega_crit(PRINTED, 40).value
    for order in (1, 2, 4):
        assert reduced_omega_crit(PRINTED, order, 25).holds(crit)
    with pytest.raises(AccuracyError, match="centre at every speed"):
        reduced_omega_crit(PRINTED, 0)


def test_attraction_rate_is_the_friction_part_of_the_jacobian() -> None:
    constants, point = PRINTED.constants_in(DOUBLE), (1.2, 0.3)
    free = PRINTED.changed(mu="1e-30").constants_in(DOUBLE)
    with_friction, without = (
        equations.jacobian(math, c, 30.4, "linear")(*point, 0.5)[2][2] for c in (constants, free)
    )
    rate = attraction_rate(math, constants, *point)
    assert rate == pytest.approx(with_friction - without, rel=1e-12)  # roundings, as terms cancel


def test_command() -> None:
    """Check at another point: h_0 is pure rolling, gamma_y = 0."""
    result = answer("slow-manifold --order 2 --beta 1.4 --gamma -2.5 --omega 30.4")
    c = PRINTED.constants_in(DOUBLE)
    rolling = 30.4 * c.e * math.sin(1.4) * math.cos(-2.5) / (c.r + c.e * math.sin(-2.5))
    assert [float(h["value"]) for h in result["h"][:2]] == pytest.approx(
        [rolling, first_correction(math, c, 30.4, 1.4, -2.5)],
        rel=1e-12,  # some hundred roundings
    )
    for order, slope in enumerate(result["residual_slope"]):
        assert Measured.of(**slope).holds(order + 1)
        assert float(slope["uncertainty"]) < 0.1
    assert "too large for order 2" in result["warning"]
