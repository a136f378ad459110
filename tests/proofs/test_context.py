"""Python-flint's one context per process: proofs in several threads, and threads that change it during a proof."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

import pytest
from flint import acb_series, arb_series, ctx

from tests.proofs.cases import proved_state
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Parameters
from tippedisk_verify.proofs import closed_forms
from tippedisk_verify.proofs.angles import rates
from tippedisk_verify.proofs.closed_forms import hopf_balls, proved_equilibrium, proved_hopf
from tippedisk_verify.proofs.kernel.balls import (
    DisturbedError,
    arb,
    ball,
    ball_constants,
    coefficient,
    series_length,
    working_precision,
)
from tippedisk_verify.proofs.kernel.field import field
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.heteroclinic import prove_connection
from tippedisk_verify.reference_values.lookup import reference

CALLS = 20_000
L_1 = reference("printed/linear/hopf/point/first_lyapunov_coefficient").measured()


@pytest.fixture(autouse=True)
def _context() -> Iterator[None]:
    """What a test leaves behind in the context is not the next one's."""
    before = ctx.prec, ctx.cap, sys.getswitchinterval()
    yield
    ctx.prec, ctx.cap = before[:2]
    sys.setswitchinterval(before[2])


@contextmanager
def beside(work: Callable[[], object]) -> Iterator[None]:
    """``work`` over and over in a thread of its own, once at least, until the block ends."""
    done = threading.Event()

    def run() -> None:
        work()
        while not done.is_set():
            work()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def meddle() -> None:
    """What other code in the process may do with python-flint, without a thought for this package."""
    before, ctx.cap = ctx.cap, 2
    for _ in range(20):
        arb_series([1, 1], prec=2).exp()
    ctx.cap = before


def first_lyapunov_coefficient() -> Measured:
    with working_precision(64):
        return measured(hopf_balls(ball_constants(PRINTED))["first_lyapunov_coefficient"])


@pytest.mark.slow
def test_a_thread_that_cuts_series_short_falsifies_no_proof() -> None:
    """The coefficient that it cuts off would read as an exact zero, and l_1 come out at -0.0127 for -0.0088."""
    proved, refused = 0, 0
    with beside(meddle):
        for _ in range(CALLS):
            try:
                found = first_lyapunov_coefficient()
            except DisturbedError:
                refused += 1
                continue
            assert abs(found.value - L_1.value) <= found.uncertainty + L_1.uncertainty
            proved += 1
    assert proved
    assert proved + refused == CALLS


def slope_of_chi() -> Measured:
    """By e, of the disk printed; series of two coefficients in 100 bits."""
    with working_precision(100), series_length(2):
        e, constants = arb_series([ball(PRINTED.e), 1], prec=2), ball_constants(PRINTED)
        moved = constants._replace(e=e, Bbar=constants.B - constants.m * e * e)
        return measured(coefficient(closed_forms.chi(moved), 1))


@pytest.mark.parametrize(
    "other",
    [
        slope_of_chi,
        lambda: proved_equilibrium(CALIBRATED, "30.4", "noninverted", 40),
        lambda: proved_state(PRINTED, "30.4", ("0", "1.7", "-1.7"), "0.01", 60),
    ],
    ids=["series", "equilibrium", "flow"],
)
def test_two_threads_prove_what_each_proves_alone(other: Callable[[], Any]) -> None:
    sys.setswitchinterval(1e-5)
    mine, theirs, found = first_lyapunov_coefficient(), other(), []
    with beside(lambda: found.append(other())):
        for _ in range(1000):
            assert first_lyapunov_coefficient() == mine
    assert found.count(theirs) == len(found) > 0


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


# ------------------------------------------------------------------------- the same, at the worst moment, each time
@pytest.fixture
def meddled(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], None]:
    """Has the context changed whenever the equations are evaluated in a proof."""

    def change(name: str, value: int) -> None:
        for place, usual in (("closed_forms.rates", rates), ("kernel.claims.saddle.field", field)):

            def spoilt(*arguments: Any, usual: Callable[..., Any] = usual) -> Any:
                setattr(ctx, name, value)
                return usual(*arguments)

            monkeypatch.setattr(f"tippedisk_verify.proofs.{place}", spoilt)

    return change


@pytest.mark.parametrize("length", [1, 2, 3])
def test_a_series_cut_short_in_a_proof_ends_it(meddled: Callable[[str, int], None], length: int) -> None:
    meddled("cap", length)
    for prove in (lambda: proved_hopf(PRINTED), lambda: prove_connection(PRINTED, "30.0488682607", 6)):
        with pytest.raises(DisturbedError, match=r"ctx\.cap"):
            prove()


@pytest.mark.parametrize("bits", [2, 24, 500])
def test_another_precision_in_a_proof_makes_balls_wider_and_never_wrong(
    meddled: Callable[[str, int], None], bits: int
) -> None:
    meddled("prec", bits)
    with working_precision(64):
        found = hopf_balls(ball_constants(PRINTED))["first_lyapunov_coefficient"]
    with working_precision(200):
        assert found.overlaps(ball(L_1.value) + arb(0, ball(L_1.uncertainty).upper()))
    if bits < 60:
        with pytest.raises(AccuracyError, match="has no 12 digits"):
            proved_hopf(PRINTED)


# ---------------------------------------------------------------------------------------------------- the parts
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


def test_near_eigenvalues_are_told_apart_whatever_the_context() -> None:
    """The real pair of a disk next to the saddle-focus lies closer together than a context of few bits can tell."""
    low, high = Fraction(3, 100), PRINTED.mu  # spirals, and two real stable directions
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if _discriminant(PRINTED.changed(mu=middle)) > 0 else (middle, high)
    ctx.prec = 24
    proof = proved_equilibrium(PRINTED.changed(mu=high), "30.4", "noninverted", 20)
    slow, fast = (value.re for value in proof.eigenvalues[1:])
    assert 0 < slow.value - fast.value < Fraction(1, 10**6)
    assert all(value.im == Measured(Fraction(0), Fraction(0)) for value in proof.eigenvalues)


def _discriminant(disk: Parameters) -> Fraction:
    """Of noninverted spinning's characteristic polynomial at 30.4 rad/s: positive where all its roots are real."""
    a, b, c = closed_forms.characteristic_polynomial(disk.rational(), Fraction("30.4"), closed_forms.NONINVERTED)
    return a * a * b * b - 4 * b**3 - 4 * a**3 * c - 27 * c * c + 18 * a * b * c
