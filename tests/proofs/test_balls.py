"""Exact inputs into balls, results out of them, and what no predicate may take for proved."""

from __future__ import annotations

import random
import sys
import threading
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import pytest
from flint import acb_series, arb_series, ctx

from tippedisk_verify import PRINTED, InputError, exact
from tippedisk_verify.proofs.angles import rates
from tippedisk_verify.proofs.ball_conversions import ball_to_measured
from tippedisk_verify.proofs.closed_forms import proved_hopf
from tippedisk_verify.proofs.kernel.balls import (
    DisturbedError,
    arb,
    ball,
    coefficient,
    inside,
    intersection,
    negative,
    positive,
    series_length,
    working_precision,
)
from tippedisk_verify.proofs.kernel.vector_field import vector_field
from tippedisk_verify.proofs.search.connection_proof import prove_connection

NOT_NUMBERS = (
    arb("nan"),
    arb("inf"),
    arb("-inf"),
    arb(0, "inf"),
    arb(1, "nan"),
    arb(1) / arb(0),
    arb(1) / arb(0, 1),
)


@pytest.mark.parametrize("strange", NOT_NUMBERS, ids=str)
def test_nothing_is_proved_of_what_is_not_finite(strange) -> None:
    for ordinary in (arb(0), arb(1), arb(0, 2), arb(-1, 1e-9)):
        assert not inside(strange, ordinary)
        assert not inside(ordinary, strange)
    assert not inside(strange, strange)
    assert not positive(strange)
    assert not negative(strange)
    with pytest.raises(InputError, match="infinite"):
        ball_to_measured(strange)


def test_predicates_are_strict() -> None:
    whole = arb(0, 1)  # Arb rounds radii up: a little wider than [-1, 1]
    edge = whole.rad()
    for x, within in (
        (whole, False),
        (edge, False),
        (edge / 2 + arb(0, edge / 2), False),
        (arb(0.5, 0.4375), True),
    ):
        assert inside(x, whole) is within, x
    for x, signs in (
        (arb(1, 1), (False, False)),
        (arb(1, 0.9), (True, False)),
        (arb(-1, 1), (False, False)),
        (arb(-1, 0.9), (False, True)),
        (arb(0), (False, False)),
    ):
        assert (positive(x), negative(x)) == signs, x


@pytest.mark.parametrize("bits", [24, 53, 64, 200])
@pytest.mark.parametrize(
    "text", ["0.1", "1/3", "pi/2", "-3*pi/2 + 0.4", "1e-40", "123456789012345678901234567890", "0"]
)
def test_a_ball_holds_its_exact_number(text, bits) -> None:
    with working_precision(bits):
        found = ball_to_measured(ball(exact(text)))
    low, high = exact(text).bounds(400)
    assert found.value - found.uncertainty <= low
    assert high <= found.value + found.uncertainty
    assert found.uncertainty <= 8 * max(abs(low), 1) / Fraction(2) ** bits


def test_what_a_ball_shares_with_an_interval_is_held() -> None:
    draw = random.Random(5)
    for _ in range(300):
        mid, rad, length = (
            draw.uniform(-2, 3),
            draw.choice([0.0, 1e-17, 0.3, 2.0]),
            draw.uniform(0.1, 2),
        )
        low, high = (
            max(Fraction(mid) - Fraction(rad), Fraction(0)),
            min(Fraction(mid) + Fraction(rad), Fraction(length)),
        )
        both = intersection(arb(mid, rad), arb(0).union(arb(length)))
        if low > high:
            assert not both.is_finite() or both.contains(arb(0)) or both.contains(arb(length))
            continue
        assert all(
            both.contains(arb(float(end))) for end in (low, high) if Fraction(float(end)) == end
        )
        # An intersection's radius has 16 bits or more in python-flint; and the rounding of sums of
        # doubles.
        assert ball_to_measured(both).uncertainty <= (high - low) / 2 * (
            1 + Fraction(1, 2**15)
        ) + Fraction(1, 2**50)
    unit = arb(0).union(arb(1))
    assert intersection(arb.nan(), unit).contains(unit)


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


@pytest.fixture(autouse=True)
def _context() -> Iterator[None]:
    """What a test leaves behind in the context is not the next one's."""
    before = ctx.prec, ctx.cap, sys.getswitchinterval()
    yield
    ctx.prec, ctx.cap = before[:2]
    sys.setswitchinterval(before[2])


def test_one_thread_waits_for_the_other() -> None:
    inside, seen = threading.Event(), []

    def enter() -> None:
        with working_precision(77), series_length(7):
            inside.set()
            seen.append((ctx.prec, ctx.cap))

    thread = threading.Thread(target=enter)
    with working_precision(222), series_length(3), working_precision(111):
        thread.start()
        assert not inside.wait(0.2)
        assert (ctx.prec, ctx.cap) == (111, 3)
    thread.join()
    assert seen == [(77, 7)]


# --------------------------------------------------------- the same, at the worst moment, each time
@pytest.fixture
def meddled(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], None]:
    """Has the context changed whenever the equations are evaluated in a proof."""

    def change(name: str, value: int) -> None:
        for place, usual in (
            ("closed_forms.rates", rates),
            ("kernel.saddle.vector_field", vector_field),
        ):

            def spoilt(*arguments: Any, usual: Callable[..., Any] = usual) -> Any:
                setattr(ctx, name, value)
                return usual(*arguments)

            monkeypatch.setattr(f"tippedisk_verify.proofs.{place}", spoilt)

    return change


@pytest.mark.parametrize("length", [1, 2, 3])
def test_a_series_cut_short_in_a_proof_ends_it(
    meddled: Callable[[str, int], None], length: int
) -> None:
    meddled("cap", length)
    for prove in (
        lambda: proved_hopf(PRINTED),
        lambda: prove_connection(PRINTED, "30.0488682607", 6),
    ):
        with pytest.raises(DisturbedError, match=r"ctx\.cap"):
            prove()


# ---------------------------------------------------------------------------------------- the parts
def test_a_coefficient_beyond_the_series_is_refused() -> None:
    for kind in (arb_series, acb_series):
        series = kind([1, 2, 3], prec=3)
        assert coefficient(series, 2) == 3
        assert coefficient(kind([1], prec=3), 2) == 0  # known to be zero
        for power in (3, 4, 100):
            with pytest.raises(DisturbedError, match=f"coefficient {power}"):
                coefficient(series, power)
        with series_length(2), pytest.raises(DisturbedError):
            coefficient(series * series, 2)
    assert coefficient(arb(5), 0) == 5
    assert coefficient(arb(5), 3) == 0
