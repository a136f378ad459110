"""Proved states to any digits, against the reference trajectories and at their own limits."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest

from tests.certified.trajectory import proved_state
from tippedisk_verify.certified.balls import ball, measured, working_precision
from tippedisk_verify.certified.flow import Status
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.reference_values.lookup import reference

START = ("0", "1.69", "-1.71")


def test_more_digits_lie_within_fewer() -> None:
    coarse, fine = (proved_state(PRINTED, "30.3866", START, "0.1", digits=digits) for digits in (10, 20))
    assert coarse.status is fine.status is Status.REACHED
    assert coarse.upright
    for rough, sharp in zip(coarse.state, fine.state, strict=True):
        assert rough.uncertainty <= Fraction(1, 10**10)
        assert sharp.uncertainty <= Fraction(1, 10**20)
        assert abs(rough.value - sharp.value) <= rough.uncertainty + sharp.uncertainty


def test_a_limit_on_the_bits_is_kept_and_said() -> None:
    found = proved_state(PRINTED, "30.3866", START, "0.1", digits=30, most_bits=60)
    assert found.status is Status.TOO_WIDE
    assert found.state is None
    assert found.bits <= 60


def test_refused_input() -> None:
    for wrong in ({"state": ("0", "1")}, {"duration": "-1"}, {"duration": "x"}, {"omega": "y"}):
        given = {"omega": "30.4", "state": START, "duration": "0.1"} | wrong
        with pytest.raises(InputError):
            proved_state(PRINTED, given["omega"], given["state"], given["duration"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "orbit", "time"),
    [*product(["linear"], ["a1", "d2"], ["0.5", "2"]), *product(["smooth"], ["c1", "d2"], ["0.5", "2"])],
)
def test_the_reference_trajectories_lie_in_the_proved_intervals(law, orbit, time) -> None:
    """Half-widths of 1e-47 at most, from MPFR runs at 51 and 60 digits."""
    names = [f"printed/{law}/trajectory/{orbit}/{part}@{time}" for part in ("beta", "gamma", "v")]
    stored = [reference(name) for name in names]
    inputs = stored[0].inputs
    quarter = PI * Fraction(1, 2)
    start = (exact(inputs["beta"]) - quarter, exact(inputs["gamma"]) - quarter, inputs["v"])
    found = proved_state(PRINTED.with_friction(law), inputs["Omega"], start, time, digits=45)
    assert found.status is Status.REACHED
    with working_precision(300):
        right_angle = measured(ball(quarter))
    for mine, value, angle in zip(found.state, stored, (right_angle.value, right_angle.value, 0), strict=True):
        other = value.measured()
        assert mine.uncertainty <= Fraction(1, 10**45)
        assert abs(mine.value + angle - other.value) <= mine.uncertainty + other.uncertainty + right_angle.uncertainty
