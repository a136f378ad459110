"""The saddle's charts against what defines them."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy
import pytest

from tests.problems import paper_rates
from tippedisk_verify.model.parameters import CALIBRATED
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.precision import DOUBLE, EXTENDED, wider_precision
from tippedisk_verify.theory.saddle_chart import ChartFamily, SaddleChart
from tippedisk_verify.theory.saddle_manifolds import Saddle

pytestmark = pytest.mark.skipif(
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


def test_one_law_is_the_other_ones_image() -> None:
    """W of the side -1 at -x is -W of the side 1 at x."""
    smooth = CALIBRATED.changed(friction="smooth")
    one, other = (
        ChartFamily(smooth, ORIGIN, side, 12, 4).chart_at(EXTENDED.number(0)) for side in (1, -1)
    )
    for point in (numpy.array(point, EXTENDED.number_type) for point in POINTS):
        # Some roundings of 64 bits, of coordinates of 0.1
        assert abs(one.offset_at(point) + other.offset_at(-point)).max() < 1e-19
