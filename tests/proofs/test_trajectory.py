"""Proved states along an orbit, with more bits and against the reference trajectories."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest

from tests.proofs.cases import proved_state
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.balls import ball, working_precision
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.reference_values.lookup import reference


def test_more_bits_lie_within_fewer() -> None:
    coarse, fine = (proved_state(PRINTED, "30.3866", ("0", "1.69", "-1.71"), "0.1", bits) for bits in (80, 120))
    for rough, sharp in zip(coarse, fine, strict=True):
        assert sharp.uncertainty < rough.uncertainty / 2**30
        assert abs(rough.value - sharp.value) <= rough.uncertainty + sharp.uncertainty


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
    found = proved_state(PRINTED.with_friction(law), inputs["Omega"], start, time, bits=300)
    with working_precision(300):
        right_angle = measured(ball(quarter))
    for mine, value, angle in zip(found, stored, (right_angle.value, right_angle.value, 0), strict=True):
        other = value.measured()
        assert mine.uncertainty <= Fraction(1, 10**45)
        assert abs(mine.value + angle - other.value) <= mine.uncertainty + other.uncertainty + right_angle.uncertainty
