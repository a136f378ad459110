"""Exact inputs into balls, results out of them, and what no predicate may take for proved."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest
from flint import ctx
from hypothesis import given
from hypothesis import strategies as st

from tests.problems import physical_parameters
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import exact
from tippedisk_verify.proofs.kernel.balls import (
    arb,
    ball,
    ball_constants,
    hull,
    inside,
    negative,
    positive,
    shared,
    working_precision,
)
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.numbers import measured

NOT_NUMBERS = (arb("nan"), arb("inf"), arb("-inf"), arb(0, "inf"), arb(1, "nan"), arb(1) / arb(0), arb(1) / arb(0, 1))


@pytest.mark.parametrize("strange", NOT_NUMBERS, ids=str)
def test_nothing_is_proved_of_what_is_not_finite(strange) -> None:
    for ordinary in (arb(0), arb(1), arb(0, 2), arb(-1, 1e-9)):
        assert not inside(strange, ordinary)
        assert not inside(ordinary, strange)
    assert not inside(strange, strange)
    assert not positive(strange)
    assert not negative(strange)
    with pytest.raises(InputError, match="infinite"):
        measured(strange)


def test_predicates_are_strict() -> None:
    whole = arb(0, 1)  # Arb rounds radii up: a little wider than [-1, 1]
    edge = whole.rad()
    assert not inside(whole, whole)
    assert not inside(edge, whole)
    assert not inside(edge / 2 + arb(0, edge / 2), whole)
    assert inside(arb(0.5, 0.4375), whole)
    assert not positive(arb(1, 1))
    assert positive(arb(1, 0.9))
    assert not negative(arb(-1, 1))
    assert negative(arb(-1, 0.9))
    assert not positive(arb(0))
    assert not negative(arb(0))


@pytest.mark.parametrize("bits", [24, 53, 64, 200])
@pytest.mark.parametrize(
    "text", ["0.1", "1/3", "pi/2", "-3*pi/2 + 0.4", "1e-40", "123456789012345678901234567890", "0"]
)
def test_a_ball_holds_its_exact_number(text, bits) -> None:
    with working_precision(bits):
        found = measured(ball(exact(text)))
    low, high = exact(text).enclosed(400)
    assert found.value - found.uncertainty <= low
    assert high <= found.value + found.uncertainty
    assert found.uncertainty <= 8 * max(abs(low), 1) / Fraction(2) ** bits


@given(st.fractions(), st.fractions(), st.integers(24, 120))
def test_a_hull_holds_both_ends_and_what_lies_between(first, second, bits) -> None:
    with working_precision(bits):
        found = measured(hull(first, second))
    for point in (first, second, (first + second) / 2):
        assert found.holds(point)


@given(physical_parameters())
def test_constants_hold_the_exact_ones(parameters) -> None:
    with working_precision(60):
        found = ball_constants(parameters)
    for name, value in parameters.rational()._asdict().items():
        assert measured(getattr(found, name)).holds(value), name


def test_what_a_ball_shares_with_an_interval_is_held() -> None:
    draw = random.Random(5)
    for _ in range(300):
        mid, rad, length = draw.uniform(-2, 3), draw.choice([0.0, 1e-17, 0.3, 2.0]), draw.uniform(0.1, 2)
        low, high = (Fraction(mid) + sign * Fraction(rad) for sign in (-1, 1))
        low, high = max(low, Fraction(0)), min(high, Fraction(length))
        found = [
            shared(arb(mid, rad), hull(0, length)),
            shared(Lanes([mid], [rad]), Lanes([length / 2], [length / 2])).arb(0),
        ]
        for both in found:
            if low > high:
                assert not both.is_finite() or both.contains(arb(0)) or both.contains(arb(length))
            else:
                assert all(both.contains(arb(float(end))) for end in (low, high) if Fraction(float(end)) == end)
                number = measured(both)
                # An intersection's radius has 16 bits or more in python-flint; and the rounding of sums of doubles.
                assert number.uncertainty <= (high - low) / 2 * (1 + Fraction(1, 2**15)) + Fraction(1, 2**50)
    assert shared(arb.nan(), hull(0, 1)).contains(hull(0, 1))
    assert shared(Lanes([math.nan]), Lanes([0.5], [0.5])).arb(0).contains(hull(0, 1))
    assert not shared(Lanes([5.0]), Lanes([0.5], [0.5])).is_finite().any()
    assert not shared(Lanes([0.5]), Lanes([0.5], [math.inf])).is_finite().any()


def test_the_precision_is_restored() -> None:
    before = ctx.prec
    with working_precision(333):
        assert ctx.prec == 333
    assert ctx.prec == before
    with pytest.raises(ValueError, match="no number"), working_precision(333):
        ball("no number")
    assert ctx.prec == before
    for bits in (1, 10**9):
        with pytest.raises(ValueError, match="bits"), working_precision(bits):
            pass
