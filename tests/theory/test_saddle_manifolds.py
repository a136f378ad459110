"""The saddle's local manifolds and charts against their defining equations."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy
import pytest

from tests.problems import SETS, paper_rates
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import DOUBLE, EXTENDED, wider_precision
from tippedisk_verify.theory.saddle_chart import ChartFamily, SaddleChart
from tippedisk_verify.theory.saddle_manifolds import Saddle

ORDER = 15
SPEED = Fraction("30.05")


def rates(saddle: Saddle, y):
    """Return the rates at the saddle plus y, by the tests' own transcription of the equations."""
    with mpmath.workprec(saddle.working_bits):
        state = (
            mpmath.pi / 2 + mpmath.mpf(y[0]),
            -mpmath.pi / 2 + mpmath.mpf(y[1]),
            mpmath.mpf(y[2]),
        )
        return [
            saddle.context.mpf(part) for part in paper_rates(saddle.parameters, saddle.omega, state)
        ]


def slope(series, s):
    return sum(n * c * s ** (n - 1) for n, c in enumerate(series.coefficients) if n)


@pytest.mark.parametrize("parameters", SETS, ids=lambda p: p.name)
def test_curves_are_invariant_to_their_order(parameters) -> None:
    """Check that f(K(s)) - lambda s K'(s) falls like s^(order + 2), the next odd power."""
    saddle = Saddle(parameters, SPEED, 300, ORDER)
    for curve, eigenvalue in (
        (saddle.unstable_curve, saddle.eigenvalues[0]),
        (saddle.stable_curve, saddle.eigenvalues[1]),
    ):
        sizes = []
        for s in (saddle.context.mpf("0.02"), saddle.context.mpf("0.01")):
            along = [eigenvalue * s * slope(component, s) for component in curve]
            there = rates(saddle, [component.value_at(s) for component in curve])
            sizes.append(max(abs(a - b) for a, b in zip(along, there, strict=True)))
        assert abs(mpmath.log(sizes[0] / sizes[1], 2) - (ORDER + 2)) < 0.05


def test_carried_directions_solve_their_equation() -> None:
    """Check Df(K) L = lambda_s s L' + lambda L, with Df by differences, and that L is even."""
    saddle = Saddle(PRINTED, SPEED, 400, ORDER)
    ctx = saddle.context
    h = ctx.mpf(10) ** -40
    slow = saddle.eigenvalues[1]
    for direction, own in (
        (saddle.unstable_direction, saddle.eigenvalues[0]),
        (saddle.fast_direction, saddle.eigenvalues[2]),
    ):
        sizes = []
        for s in (ctx.mpf("0.02"), ctx.mpf("0.01")):
            at, along = (
                [c.value_at(s) for c in saddle.stable_curve],
                [c.value_at(s) for c in direction],
            )
            ends = [
                rates(saddle, [a + sign * h * b for a, b in zip(at, along, strict=True)])
                for sign in (1, -1)
            ]
            left = [(a - b) / (2 * h) for a, b in zip(*ends, strict=True)]
            right = [slow * s * slope(c, s) + own * c.value_at(s) for c in direction]
            sizes.append(max(abs(a - b) for a, b in zip(left, right, strict=True)))
        assert abs(mpmath.log(sizes[0] / sizes[1], 2) - (ORDER + 1)) < 0.1


def test_coordinates_of_a_point_come_back() -> None:
    saddle = Saddle(PRINTED, SPEED, 200, ORDER)
    ctx = saddle.context
    u, s, t = ctx.mpf("1e-20"), ctx.mpf("-0.01"), ctx.mpf("1e-15")
    point = [
        k.value_at(s) + t * f.value_at(s) + u * m.value_at(s)
        for k, f, m in zip(
            saddle.stable_curve, saddle.fast_direction, saddle.unstable_direction, strict=True
        )
    ]
    for found, given in zip(saddle.stable_coordinates(point), (u, s, t), strict=True):
        assert abs(found - given) < ctx.mpf(10) ** -55


# ------------------------------------------------------------------------------------------- charts
_needs_extended = pytest.mark.skipif(
    wider_precision(DOUBLE) != EXTENDED, reason="needs numbers of 64 bits"
)

ORIGIN = Fraction(30)
DISTANCE = Fraction(1, 2**10)
#: On the unstable and on the stable manifold, next to either, and between them; f is what the
#: smooth law leaves there.
POINTS = ((0.1, 0, 0), (0, -0.1, 0), (0.1, -1e-9, 0), (1e-6, -0.1, 1e-9), (2e-4, -2e-4, 1e-8))


def residual(chart: SaddleChart, parameters, point) -> float:
    """What DW (lambda x) leaves of the tests' own transcription of the equations, relative to
    its terms.
    """
    y = chart.offset_at(point)
    moved = chart.derivative(point) @ (chart.eigenvalues * point)
    with mpmath.workprec(100):
        state = [mpmath.mpf(number.numerator) / number.denominator for number in map(fraction, y)]
        state = (mpmath.pi / 2 + state[0], -mpmath.pi / 2 + state[1], state[2])
        rates = paper_rates(parameters, ORIGIN + DISTANCE, state)
        sizes = abs(chart.derivative(point)) @ abs(chart.eigenvalues * point)
        left = (
            rate - mpmath.mpf(str(rate_of_chart))
            for rate, rate_of_chart in zip(rates, moved, strict=True)
        )
        return max(float(abs(part) / float(size)) for part, size in zip(left, sizes, strict=True))


@_needs_extended
@pytest.mark.parametrize("law", ["linear", "smooth"])
def test_the_flow_is_linear_in_the_chart(law) -> None:
    """On the side of gamma_y that each curve leaves or reaches the saddle on, at a speed between
    those of the series.

    What is left is f^3, rounding, and what the speed's polynomials leave out.
    """
    parameters = CALIBRATED.changed(friction=law)
    saddle = Saddle(parameters, ORIGIN, 80, 1)
    families = [ChartFamily(parameters, ORIGIN, saddle.law_side(which), 20, 5) for which in (0, 1)]
    charts = [family.chart_at(EXTENDED.number(DISTANCE)) for family in families]
    for point in (numpy.array(point, EXTENDED.number_type) for point in POINTS):
        chart = charts[0] if point[0] > 1e-3 else charts[1]
        if law == "linear" or abs(point).max() > 1e-3:
            # Truncation and some hundred roundings of 64 bits
            assert residual(chart, parameters, point) < 1e-16
        # Some roundings of 64 bits
        assert abs(chart.coordinates(chart.offset_at(point)) - point).max() < 1e-18


@_needs_extended
def test_one_law_is_the_other_ones_image() -> None:
    """W of the side -1 at -x is -W of the side 1 at x."""
    smooth = CALIBRATED.changed(friction="smooth")
    one, other = (
        ChartFamily(smooth, ORIGIN, side, 12, 4).chart_at(EXTENDED.number(0)) for side in (1, -1)
    )
    for point in (numpy.array(point, EXTENDED.number_type) for point in POINTS):
        # Some roundings of 64 bits, of coordinates of 0.1
        assert abs(one.offset_at(point) + other.offset_at(-point)).max() < 1e-19
