"""Recurrences against closed forms, and recorded derivatives against the hand-written ones."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.problems import decimals, physical_parameters
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.proofs.kernel.balls import ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.series import Graph, System
from tippedisk_verify.proofs.numbers import measured

ORDER = 12


def solve(rates, start):
    """Coefficients for x' = rates(graph, *x), in the arithmetic of the start."""
    graph = Graph()
    variables = [graph.variable() for _ in start]
    system = System(graph, variables, [graph.number(rate) for rate in rates(graph, *variables)])
    return system.coefficients(start, ORDER)


def factorial_inverse(n: int) -> Fraction:
    return Fraction(1, math.factorial(n))


# Exact rational coefficients: the recurrences run on Fractions as well as on balls.
EXACT = {
    "growth": (lambda g, x: [x], [1], lambda n: factorial_inverse(n)),
    "pole": (lambda g, x: [x * x], [1], lambda n: Fraction(1)),
    "pole of a cube": (lambda g, x: [x * (x * x)], [1], lambda n: Fraction(math.comb(2 * n, n), 2**n)),
    "root": (lambda g, x: [1 / (2 * x)], [1], lambda n: _binomial(Fraction(1, 2), n)),
    "quotient": (lambda g, x, t: [-x / (1 + t), 1 + 0 * t], [1, 0], lambda n: Fraction((-1) ** n)),
    "difference": (lambda g, x: [3 - x - 1], [0], lambda n: -2 * (-1) ** n * factorial_inverse(n) if n else 0),
    "falling": (lambda g, x: [-x], [1], lambda n: (-1) ** n * factorial_inverse(n)),
    "straight": (lambda g, x: [g.number(Fraction(2))], [5], lambda n: [5, 2][n] if n < 2 else 0),
}


def _binomial(power: Fraction, n: int) -> Fraction:
    result = Fraction(1)
    for k in range(n):
        result = result * (power - k) / (k + 1)
    return result


@pytest.mark.parametrize("name", EXACT)
def test_closed_forms(name) -> None:
    rates, start, coefficient = EXACT[name]
    found = solve(rates, [Fraction(value) for value in start])[0]
    assert found == [coefficient(n) for n in range(ORDER + 1)]


@pytest.mark.parametrize("name", EXACT)
def test_closed_forms_on_balls(name) -> None:
    rates, start, coefficient = EXACT[name]
    if name == "straight":
        rates = lambda g, x: [g.number(ball(2))]  # noqa: E731
    with working_precision(80):
        found = solve(rates, [ball(value) for value in start])[0]
    for n, value in enumerate(found):
        assert measured(value).holds(coefficient(n)), n


def test_sine_and_cosine() -> None:
    """x' = 1: sin(x) is rated by y' = cos(x), so y = sin(t) from 0; and cos(2 t) through an inner function."""
    with working_precision(90):
        _, y, z = solve(lambda g, x, y, z: [g.number(1), g.cos(x), -2 * g.sin(2 * x)], [ball(0), ball(0), ball(1)])
    for n in range(ORDER + 1):
        sine = Fraction(0) if n % 2 == 0 else (-1) ** (n // 2) * factorial_inverse(n)
        cosine = Fraction(0) if n % 2 else (-1) ** (n // 2) * 2**n * factorial_inverse(n)
        assert measured(y[n]).holds(sine)
        assert measured(z[n]).holds(cosine)


@settings(max_examples=25)
@given(physical_parameters(), decimals("5", "60"), st.tuples(*[decimals("-1.4", "1.4")] * 2, decimals("-9", "9")))
def test_recorded_derivatives_are_the_hand_written_ones(parameters, omega, state) -> None:
    with working_precision(120):
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        constants = ball_constants(parameters)
        numbers = Constants(*(graph.number(value) for value in constants))
        speed = graph.number(ball(omega), active=True)
        rates = field(shifted(graph), numbers, speed, "linear")(*variables)
        partials = [part for rate in rates for part in graph.gradient(rate, [*variables, speed])]
        # Each partial derivative as the rate of a variable: its value at the start is that variable's coefficient 1.
        holders = [graph.variable() for _ in partials]
        system = System(graph, [*variables, *holders], [*rates, *partials])
        point = [ball(part) for part in state]
        columns = system.coefficients([*point, *(ball(0) for _ in holders)], 1)[3:]
        found = [[columns[4 * row + column][1] for column in range(4)] for row in range(3)]

        class Ops:
            sin = staticmethod(lambda x: x.sin())
            cos = staticmethod(lambda x: x.cos())

        by_hand = jacobian(shifted(Ops), constants, ball(omega), "linear")(*point)
        step = ball("1e-12")
        ahead, behind = (
            field(shifted(Ops), constants, ball(omega) + sign * step, "linear")(*point) for sign in (1, -1)
        )
    for row in range(3):
        for column in range(3):
            assert found[row][column].overlaps(by_hand[row][column])
        # The field is a quadratic polynomial in Omega: central differences are exact.
        assert found[row][3].overlaps((ahead[row] - behind[row]) / (2 * step))


def test_a_variable_without_a_rate_is_refused() -> None:
    """Its coefficients would be those that another system left behind."""
    graph = Graph()
    x, y = graph.variable(), graph.variable()
    with pytest.raises(ValueError, match="variable"):
        System(graph, [x], [x * y])


def test_a_ball_of_starts_holds_the_coefficients_of_its_points() -> None:
    with working_precision(100):
        graph = Graph()
        variables = [graph.variable() for _ in range(3)]
        numbers = Constants(*(graph.number(value) for value in ball_constants(PRINTED)))
        rates = field(shifted(graph), numbers, graph.number(ball("30.4")), "linear")(*variables)
        system = System(graph, variables, rates)
        centre = [ball("-0.1"), ball("1.2"), ball("-1.5")]
        spread = [ball(0).union(ball(text)) for text in ("0.01", "-0.02", "0.03")]
        wide = system.coefficients([a + b for a, b in zip(centre, spread, strict=True)], ORDER)
        for share in ("0", "0.3", "1"):
            part = [ball(share) * ball(text) for text in ("0.01", "-0.02", "0.03")]
            thin = system.coefficients([a + b for a, b in zip(centre, part, strict=True)], ORDER)
            for n in range(ORDER + 1):
                assert all(w[n].contains(t[n]) for w, t in zip(wide, thin, strict=True))
