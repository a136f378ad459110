"""The Jacobian against two differentiations that share nothing with it; observables; domain of definition."""

from __future__ import annotations

import math

import heyoka
import numpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.problems import decimals, physical_parameters, states
from tippedisk_verify.errors import InputError
from tippedisk_verify.model import equations
from tippedisk_verify.model.parameters import PRINTED, Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits

PRECISE = bits(200)


def in_mpmath(parameters: Parameters) -> Constants:
    return Constants(*(PRECISE.mpf(value) for value in parameters.at(PRECISE)))


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@given(parameters=physical_parameters(), state=states, omega=decimals("1", "60"), flip=st.booleans())
def test_jacobian_by_hand_against_mpmath(friction, parameters, state, omega, flip) -> None:
    """Central differences of the field at 200 bits; half of the states have sin(beta) < 0."""
    ctx = PRECISE.context
    constants, speed = in_mpmath(parameters), PRECISE.mpf(PRECISE.number(omega))
    point = [PRECISE.mpf(PRECISE.number(part)) for part in state]
    if flip:
        point[0] = -point[0]
    sliding = equations.terms(ctx, constants, speed, *point).sliding_velocity
    step = ctx.mpf(2) ** -60
    if abs(sliding) < step * 2**10:
        return  # a difference across gamma_y = 0 sees the jump of the smooth law's second derivative
    function = equations.field(ctx, constants, speed, friction)
    by_hand = equations.jacobian(ctx, constants, speed, friction)(*point)
    for column in range(3):
        up, down = list(point), list(point)
        up[column] += step
        down[column] -= step
        for row, (high, low) in enumerate(zip(function(*up), function(*down), strict=True)):
            difference = (high - low) / (2 * step)
            # Truncation step^2 f'''/6 with third derivatives up to about 1e12 of a value here: 2^-120 * 1e12 < 1e-22.
            size = max(abs(by_hand[row][column]), 1, abs(high))
            assert abs(by_hand[row][column] - difference) < ctx.mpf("1e-18") * size


@given(parameters=physical_parameters(), state=states, omega=decimals("1", "60"))
def test_jacobian_by_hand_against_heyoka(parameters, state, omega) -> None:
    """heyoka differentiates its own expression tree; compared with round-off of the terms that are summed."""
    point = numpy.array([float(part) for part in state])
    rows = _compiled_derivatives()(point, pars=_pars(parameters, float(omega))).reshape(3, 3)
    by_hand = numpy.array(equations.jacobian(math, parameters.at(DOUBLE), float(omega), "linear")(*point))
    # Terms of up to 1e3 times the result cancel in the last row; each carries a few ulps.
    assert numpy.allclose(rows, by_hand, rtol=0, atol=2.0**-52 * 1e4 * (1 + abs(by_hand).max()))


def _pars(parameters: Parameters, omega: float) -> numpy.ndarray:
    c = parameters.at(DOUBLE)
    return numpy.array([omega, c.r, c.e, c.a, c.b, c.g, c.k])


_CACHE: list[object] = []


def _compiled_derivatives():
    if not _CACHE:
        state = heyoka.make_vars("beta", "gamma", "v")
        omega, r, e, a, b, g, k = (heyoka.par[index] for index in range(7))
        values = {"r": r, "e": e, "a": a, "b": b, "g": g, "k": k}
        constants = Constants(**{name: values.get(name) for name in Constants._fields})
        rates = equations.field(heyoka, constants, omega, "linear")(*state)
        entries = [heyoka.diff(heyoka.expression(rate), variable) for rate in rates for variable in state]
        _CACHE.append(heyoka.cfunc(entries, state))
    return _CACHE[0]


def test_smooth_law_has_the_linear_laws_slope_at_rest() -> None:
    state = (math.pi / 2, math.pi / 2, 0.0)
    both = [
        numpy.array(equations.jacobian(math, PRINTED.at(DOUBLE), 30.4, friction)(*state))
        for friction in ("linear", "smooth")
    ]
    # Same formula up to the rounding of k = (mu g) / epsilon.
    assert numpy.allclose(*both, rtol=1e-15 * 8, atol=1e-13)  # cancelling terms of order 100


def test_normal_force_is_the_weight_at_rest() -> None:
    constants = PRINTED.at(DOUBLE)
    for gamma in (math.pi / 2, -math.pi / 2):
        state = (math.pi / 2, gamma, 0.0)
        acceleration = equations.field(math, constants, 30.4, "linear")(*state)[2]
        ratio = equations.normal_force_over_weight(math, constants, 30.4, state, acceleration)
        # pi/2 is off by half an ulp, and its effect is multiplied by accelerations of up to 1e3.
        assert ratio == pytest.approx(1, abs=1e3 * 2.0**-52)  # a thousand roundings


def test_arrays_are_welcome() -> None:
    beta, gamma, v = numpy.meshgrid([1.0, 1.5], [0.1, 2.0], [-1.0, 3.0])
    together = equations.field(numpy, PRINTED.at(DOUBLE), 30.4, "smooth")(beta, gamma, v)[2]
    alone = equations.field(math, PRINTED.at(DOUBLE), 30.4, "smooth")(beta[1, 0, 1], gamma[1, 0, 1], v[1, 0, 1])[2]
    # numpy's and the C library's sine may differ in the last bit.
    assert together[1, 0, 1] == pytest.approx(alone, rel=64 * 2.0**-52)


def test_unknown_friction_is_refused() -> None:
    with pytest.raises(InputError, match="linear or smooth"):
        PRINTED.with_friction("sticky")
