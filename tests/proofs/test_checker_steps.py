"""One step of the checker's flow: how long it may be, and that Taylor's polynomials have their rests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from flint import arb, ctx

from tests.proofs.test_checker_curves import DISK, orbit
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker.steps import Flow, Piece, States
from tippedisk_verify.proofs.kernel.balls import working_precision

SPEED, START = "30.88", ("0", "0.105", "-0.17")


@pytest.fixture(autouse=True)
def _context() -> Iterator[None]:
    cap = ctx.cap
    with working_precision(160):
        yield
    ctx.cap = cap


def step(length: str) -> Piece:
    states = States.start([arb(x).mid() for x in START], [arb(0)] * 4)
    return Piece(Flow(DISK, arb(SPEED).mid()), states, arb(length).mid(), (12, 10), None)


@pytest.mark.parametrize(("length", "line"), [("0.04", "stay in its enclosure"), ("0", "length"), ("-0.01", "length")])
def test_a_step_that_is_too_long_or_backwards_is_refused(length: str, line: str) -> None:
    """Over 0.04 s the polynomials alone lie in the enclosure; with what the orbit's derivatives add they do not."""
    with pytest.raises(checker.Unproved, match=line):
        step(length)


def test_a_step_holds_its_polynomials_rest() -> None:
    """An orbit, its derivatives and the integral of div f, whose polynomials are off by far more than the roundings."""
    piece = step("0.01")
    exact, slopes = orbit([arb(x).mid() for x in START], arb(SPEED).mid(), piece.length)
    image, by = piece.image(piece.length), piece.derivatives(piece.length)
    determinant: Any = slopes[0, 0] * 0
    for k in range(3):
        others = [row for row in range(3) if row != k]
        minor = slopes[others[0], 1] * slopes[others[1], 2] - slopes[others[0], 2] * slopes[others[1], 1]
        determinant = determinant + slopes[k, 0] * minor * (-1) ** k
    for row in range(3):
        assert image[row].overlaps(exact[row])
        assert all(by[row, k].overlaps(slopes[row, k]) for k in range(4))
    # Liouville's formula
    assert piece.divergence(piece.length).exp().overlaps(determinant)
