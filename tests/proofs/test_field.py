"""The kernel's equations against those that the rest of the package uses: two transcriptions, each differentiated."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from tippedisk_verify.model.equations import field, jacobian, shifted, terms
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS, Parameters
from tippedisk_verify.proofs.kernel.balls import BallOps, Unproved, arb, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.field import Constants, constants, one_sided, sliding_motion
from tippedisk_verify.proofs.kernel.field import field as kernel_field
from tippedisk_verify.proofs.kernel.flow import Model

LAWS = (("linear", "linear", None), ("smooth", "smooth", None), (1, "smooth", 1), (-1, "smooth", -1))
DISK = {name: str(getattr(PRINTED, name)) for name in SYMBOLS}


def same(mine, other) -> bool:
    """Whether two balls share a point, and are narrow."""
    narrow = all(x.rad() < abs(x).upper() * arb(2) ** -90 + arb(2) ** -150 for x in (mine, other))
    return narrow and mine.overlaps(other)


def test_rates_and_derivatives_at_random_points_of_random_disks() -> None:
    draw = random.Random(11)
    with working_precision(200):
        for _ in range(40):
            disk = {n: str(Fraction(value) * Fraction(draw.randint(900, 1100), 1000)) for n, value in DISK.items()}
            disk["A"] = str(Fraction(disk["B"]) * Fraction(draw.randint(1000, 1300), 1000))
            mine = constants(disk)
            theirs = ball_constants(Parameters(**{name: Fraction(value) for name, value in disk.items()}))
            state = [arb(draw.uniform(-1.5, 1.5)), arb(draw.uniform(-7, 7)), arb(draw.uniform(-20, 20))]
            speed = arb(draw.uniform(0.1, 60))
            for law, friction, side in LAWS:
                rates = kernel_field(BallOps, mine, speed, law)(*state)
                others = field(shifted(BallOps), theirs, speed, friction, side)(*state)
                assert all(same(a, b) for a, b in zip(rates, others, strict=True)), law
                if law == "smooth":
                    continue
                unit = [arb(int(row == column)) for column in range(4) for row in range(3)]
                model = Model(mine, speed, one_sided(law) if side else None)
                columns = [part[1] for part in model.variational.coefficients([*state, *unit], 1)[3:12]]
                rows = jacobian(shifted(BallOps), theirs, speed, friction, side)(*state)
                assert all(same(columns[3 * k + row], arb(rows[row][k])) for row in range(3) for k in range(3)), law
            velocity, _ = sliding_motion(BallOps, mine, speed, state)
            assert same(velocity, terms(shifted(BallOps), theirs, speed, *state).sliding_velocity)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("e", "0.045"),
        ("e", "0"),
        ("m", "0"),
        ("B", "0.25e-3"),
        ("B", "2.7e-6"),
        ("g", "-1"),
        ("mu", "0"),
        ("epsilon", "0"),
    ],
)
def test_what_is_no_disk_is_refused(name: str, value: str) -> None:
    with pytest.raises(Unproved, match="no disk's"):
        constants({**DISK, name: value})


def test_constants_are_the_parameters_own() -> None:
    with working_precision(100):
        found, exact = constants(DISK), ball_constants(PRINTED)
        assert all(same(getattr(found, name), getattr(exact, name)) for name in Constants._fields)
