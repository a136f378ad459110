"""The saddle's local manifolds against their defining equations."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from tests.problems import SETS, paper_rates
from tippedisk_verify.model.parameters import PRINTED
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
