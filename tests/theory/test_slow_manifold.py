"""Orders 0 and 1: pure rolling, and an invariance residual of order epsilon^2."""

from __future__ import annotations

import math

import numpy
import pytest

from tippedisk_verify.model import equations
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import DOUBLE, bits
from tippedisk_verify.theory.slow_manifold import critical_manifold, slow_manifold

POINTS = [(1.2, 0.3), (1.9, -1.1), (0.9, 2.5), (1.57, 4.0)]


@pytest.mark.parametrize("point", POINTS)
def test_order_0_rolls(point) -> None:
    rolling = critical_manifold(math, PRINTED.at(DOUBLE), 30.4, *point)
    here = equations.terms(math, PRINTED.at(DOUBLE), 30.4, *point, rolling)
    assert abs(here.sliding_velocity) < 1e-16  # two terms of size 0.1 m/s cancel


@pytest.mark.parametrize("order", [0, 1])
def test_invariance_residual_has_the_next_order(order) -> None:
    """epsilon (dh/dx) f - g along the truncated surface, differentiated numerically in 300 bits."""
    precision = bits(300)
    ctx = precision.context
    step = ctx.mpf(2) ** -80
    sizes = []
    epsilons = ["1e-4", "1e-5", "1e-6", "1e-7"]
    for epsilon in epsilons:
        parameters = PRINTED.changed(epsilon=epsilon)
        constants = type(parameters.at(precision))(*(precision.mpf(value) for value in parameters.at(precision)))
        omega = ctx.mpf("30.4")

        def surface(beta, gamma, c=constants, w=omega):
            return slow_manifold(ctx, c, w, beta, gamma, order=order)

        worst = ctx.mpf(0)
        for point in POINTS:
            beta, gamma = map(ctx.mpf, point)
            v = surface(beta, gamma)
            by_beta = (surface(beta + step, gamma) - surface(beta - step, gamma)) / (2 * step)
            by_gamma = (surface(beta, gamma + step) - surface(beta, gamma - step)) / (2 * step)
            _, gamma_rate, rate = equations.right_hand_side(ctx, constants, omega, (beta, gamma, v), "linear")
            worst = max(worst, constants.epsilon * abs(by_beta * v + by_gamma * gamma_rate - rate))
        sizes.append(float(worst))
    slope = numpy.polyfit(numpy.log([float(e) for e in epsilons]), numpy.log(sizes), 1)[0]
    assert abs(slope - (order + 1)) < 0.1
