"""The equations against a transcription of the paper's, and the Jacobian against differences."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp

from tests.friction_laws import OWN_LAWS
from tests.model import transcription as paper
from tests.problems import decimals, physical_parameters, states
from tippedisk_verify import DOUBLE, PRINTED, FrictionLaw, precision_of_bits
from tippedisk_verify.model import equations
from tippedisk_verify.model.friction import LAWS, law_of
from tippedisk_verify.numbers.exact import rational_in_context

CTX = precision_of_bits(200).context


@pytest.mark.parametrize("friction", LAWS)
@given(
    parameters=physical_parameters(), state=states, omega=decimals("1", "60"), flip=st.booleans()
)
def test_equations_are_the_papers(friction: str, parameters, state, omega, flip) -> None:
    """Compare at 60 digits, of which cancelling sums may cost ten: no double may enter."""
    with mp.workdps(60):
        c, speed = parameters.constants_in_context(mp), rational_in_context(mp, omega)
        beta, gamma, v = (rational_in_context(mp, part) for part in state)
        beta = -beta if flip else beta
        mass = paper.mass_matrix(c.A, c.Bbar, c.m, c.r, c.e, beta, gamma)
        gyroscopic = paper.gyroscopic_forces(c.A, c.Bbar, c.m, c.r, c.e, speed, beta, gamma, v)
        gravity = paper.gravitational_force(c.m, c.g, c.r, c.e, beta, gamma)
        direction = paper.force_direction(c.r, c.e, beta, gamma)
        sliding = paper.lateral_sliding_velocity(c.r, c.e, speed, beta, gamma, v)
        law = {"linear": paper.linear_friction, "smooth": paper.smooth_friction}[friction]
        M, h, gamma_y = sum(mass), sum(gyroscopic), sum(sliding)
        force = law(c.mu, c.m, c.g, c.epsilon, gamma_y)
        rates = paper.state_rates(M, h, gravity, direction, force, speed, beta, v)

        grip = c.mu * c.m * c.g / c.epsilon * sum(map(abs, sliding))
        # 3 sin^2 - 2 cancels
        pull = sum(map(abs, gyroscopic)) + 2 * c.m * c.e * c.r * abs(speed * v) + abs(gravity)
        terms = equations.equation_terms(mp, c, speed, beta, gamma, v)
        expected: list[tuple[Any, Any, Any]] = [
            *zip(
                (*terms[:-1], *terms.gyroscopic_terms),
                (M, h, gravity, direction, gamma_y, *gyroscopic),
                (M, pull, gravity, direction, c.r * v, *5 * [pull]),
                strict=True,
            ),
            (law_of(friction)(math, terms.sliding_velocity, c), force, grip),
        ]
        vector_field = equations.vector_field(mp, c, speed, friction)
        acceleration = (pull + c.r * grip) / M
        expected += zip(vector_field(beta, gamma, v), rates, (v, speed, acceleration), strict=True)
        # The point symmetry reverses all rates.
        image = vector_field(mp.pi - beta, mp.pi - gamma, -v)
        expected += zip(image, (-rate for rate in rates), (v, speed, acceleration), strict=True)
        for value, truth, size in expected:
            assert abs(value - truth) <= mp.mpf(10) ** -50 * (abs(size) + c.e * speed + abs(truth))


@pytest.mark.parametrize("law", [*LAWS.values(), *OWN_LAWS], ids=str)
@given(
    parameters=physical_parameters(), state=states, omega=decimals("1", "60"), flip=st.booleans()
)
def test_jacobian_against_differences(law: FrictionLaw, parameters, state, omega, flip) -> None:
    """Compare with central differences at 200 bits; half of the states have sin(beta) < 0."""
    constants, speed = parameters.constants_in_context(CTX), rational_in_context(CTX, omega)
    point = [rational_in_context(CTX, part) for part in state]
    if flip:
        point[0] = -point[0]
    sliding = equations.equation_terms(CTX, constants, speed, *point).sliding_velocity
    step = CTX.mpf(2) ** -60
    if abs(sliding) < step * 2**10:
        # A difference across gamma_y = 0 sees the jump of the smooth law's second derivative
        return
    function = equations.vector_field(CTX, constants, speed, law)
    by_hand = equations.jacobian(CTX, constants, speed, law)(*point)
    for column in range(3):
        up, down = list(point), list(point)
        up[column] += step
        down[column] -= step
        for row, (high, low) in enumerate(zip(function(*up), function(*down), strict=True)):
            difference = (high - low) / (2 * step)
            # Truncation step^2 f'''/6 with third derivatives up to about 1e12 of a value here
            size = max(abs(by_hand[row][column]), 1, abs(high))
            assert abs(by_hand[row][column] - difference) < step**2 * 10**12 * size
    # The analytic branch of this side is the law itself, and the other one is not
    if law.two_sided:
        side = 1 if sliding > 0 else -1
        for made in (equations.vector_field, equations.jacobian):
            plain, mine, other = (
                made(CTX, constants, speed, law, s)(*point)[2] for s in (None, side, -side)
            )
            assert plain == mine != other


def test_arrays_and_shifted_angles_are_accepted() -> None:
    beta, gamma, v = numpy.meshgrid([1.0, 1.5], [0.1, 2.0], [-1.0, 3.0])
    together = equations.vector_field(numpy, PRINTED.constants_in(DOUBLE), 30.4, "smooth")(
        beta, gamma, v
    )
    half = mpmath.mp.mpf(mpmath.pi) / 2
    shifted = equations.vector_field(
        equations.shifted_ops(mpmath), PRINTED.constants_in(DOUBLE), 30.4, "smooth"
    )
    alone = shifted(beta[1, 0, 1] - half, gamma[1, 0, 1] - half, v[1, 0, 1])
    for rates, rate in zip(together, alone, strict=True):
        # Terms of 1e2 times the result
        assert rates[1, 0, 1] == pytest.approx(float(rate), rel=1e3 * 2.0**-52)
