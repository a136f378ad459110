"""The kernel's flights against Picard's iteration, which shares no code with them."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tests.proofs import picard
from tests.proofs.cases import carry
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.flow import Status
from tippedisk_verify.proofs.kernel.sliding import model_of

DISK = {name: getattr(PRINTED, name) for name in SYMBOLS}
OMEGA, H, STEPS, SIZE = "30.4", Fraction(1, 2000), 12, Fraction(1, 10**7)


@pytest.mark.parametrize(
    ("friction", "sign", "side"),
    [
        ("linear", 1, 0),
        pytest.param("smooth", 1, 1, marks=pytest.mark.slow),
        pytest.param("smooth", -1, -1, marks=pytest.mark.slow),
    ],
)
def test_ends_and_derivatives_against_picards_iteration(friction: str, sign: int, side: int) -> None:
    """From a point where gamma_y > 0, or from its mirror image, for 6 ms; and from points beside it."""
    with working_precision(128):
        model, start = (
            model_of(PRINTED.with_friction(friction), ball(OMEGA)),
            [sign * ball(x) for x in (0.1, 1.6, -1.5)],
        )
        reach = ball(SIZE)
        thin = carry(model, start, H * STEPS)
        wide = carry(model, [part + arb(0, reach.upper()) for part in start], H * STEPS, derivatives=True)
        assert thin.status is wide.status is Status.REACHED
        end = picard.flight(DISK, OMEGA, start, STEPS, H, side)
        for mine, true in zip(thin.state, end, strict=True):
            assert true.rad() < 1e-18
            assert true.contains(mine.mid())
            assert mine.rad() < 1e-30
        for k in range(3):
            moved = [part + (reach / 2 if row == k else 0) for row, part in enumerate(start)]
            other = picard.flight(DISK, OMEGA, moved, STEPS, H, side)
            for row in range(3):
                assert wide.state[row].contains(other[row].mid())
                slope = (other[row] - end[row]) / (reach / 2)
                assert slope.rad() < 1e-10
                assert wide.matrix[row][k].overlaps(slope)
