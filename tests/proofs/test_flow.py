"""The enclosed flow: exact solutions, the integrator, boxes and their points, and how it ends
without a proof.
"""

from __future__ import annotations

from fractions import Fraction

import pytest

from tests.proofs.cases import flow_for
from tippedisk_verify import PRINTED, QUADRUPLE, Request
from tippedisk_verify.proofs.ball_conversions import (
    ball_constants,
    ball_to_measured,
    field_for_disk,
)
from tippedisk_verify.proofs.kernel.ball_array import BallArray
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField, FlowStatus
from tippedisk_verify.proofs.kernel.step import StepTrial
from tippedisk_verify.proofs.search.step_search import FlightStepSearch

OMEGA = Fraction("30.3866")
START = ("0", "1.69", "-1.71")


def field() -> EnclosedField:
    return field_for_disk(PRINTED, ball(OMEGA))


def start() -> list:
    return [ball(part) for part in START]


# ---------------------------------------------------------------------------------- exact solutions
def rotation(ops, constants, omega):
    """x' = Omega y, y' = -Omega x, z' = -3 z: a circle and a decay."""
    return lambda x, y, z: (omega * y, -(omega * x), -3 * z)


def blow_up(ops, constants, omega):
    """x' = x^2 becomes infinite at t = 1/x(0)."""
    return lambda x, y, z: (x * x, 0 * y, -z)


def test_a_rotation_and_its_derivatives() -> None:
    with working_precision(100):
        outcome = flow_for(
            EnclosedField(ball_constants(PRINTED), ball("2"), rotation),
            [1, 0, 1],
            "1.3",
            derivatives=True,
        )
        assert outcome.status is None
        time = outcome.flight.time
    with working_precision(200):
        angle, exact_time = ball("2.6"), ball("1.3")
        sine, cosine, decay = angle.sin(), angle.cos(), (-3 * exact_time).exp()
        expected = (cosine, -sine, decay)
        matrix = (
            (cosine, sine, 0, -exact_time * sine),
            (-sine, cosine, 0, -exact_time * cosine),
            (0, 0, decay, 0),
        )
        assert time.contains(exact_time)
        for mine, true in zip(outcome.flight.box, expected, strict=True):
            assert mine.contains(true)
            assert mine.rad() < 2.0**-90
        for row, true_row in zip(outcome.flight.derivatives, matrix, strict=True):
            for mine, true in zip(row, true_row, strict=True):
                assert mine.contains(true)
                assert mine.rad() < 2.0**-85
        assert outcome.flight.divergence.contains(-3 * exact_time)


def test_a_step_beyond_the_singularity_fails_the_inclusion_itself() -> None:
    """x(0) = 2 is infinite at 1/2: no box E can pass there, whatever the step control would
    have said.
    """
    lengths, shown = [0.03, 0.5, 0.5625, -0.03], [True, False, False, False]
    with working_precision(60):
        constants = ball_constants(PRINTED)
        flight = EnclosedField(constants, ball(1), blow_up).flight([2, 1, 1], FlightStepSearch())
        trial = StepTrial(flight, (18, 16))
        assert [trial.tested_step(length).included for length in lengths] == shown
        array_field = EnclosedField(
            type(constants)(*(BallArray.of([x]) for x in constants)), BallArray([1.0] * 4), blow_up
        )
        start = [BallArray([part] * 4) for part in (2.0, 1.0, 1.0)]
        trial = StepTrial(array_field.flight(start, FlightStepSearch()), (18, 16))
        assert list(trial.tested_step(BallArray(lengths)).included) == shown


# ----------------------------------------------------------------------------------- the integrator
@pytest.mark.parametrize(
    ("disk", "start", "span"),
    [
        (PRINTED, START, "0.05"),
        # From a hundredth of a second before a sliding reversal, at which the field bends
        (PRINTED.with_friction("smooth"), ("0", "1.725", "-1.7105"), "0.02"),
    ],
)
def test_it_holds_the_end_that_the_integrator_finds(taylor, disk, start, span) -> None:
    """heyoka in quadruple precision, whose own error is far below the last of 80 bits of balls;
    with all derivatives.
    """
    request = Request(
        disk,
        OMEGA,
        start,
        span,
        shifted=True,
        precision=QUADRUPLE,
        domain="none",
        variations=("beta", "gamma", "v", "Omega"),
        divergence=True,
    )
    ordinary = taylor(request)
    with working_precision(80):
        outcome = flow_for(
            field_for_disk(disk, ball(OMEGA)), map(ball, start), span, derivatives=True
        )
        found = (outcome.flight.box, *outcome.flight.derivatives, [outcome.flight.divergence])
    assert (outcome.status, outcome.upright) == (None, True)
    for row, others in zip(
        found,
        (ordinary.state, *ordinary.derivatives, [ordinary.divergence]),
        strict=True,
    ):
        for mine, other in zip(row, others, strict=True):
            assert ball_to_measured(mine).holds(other)
            # The flight multiplies roundings by some thousands, and each step adds its own.
            assert mine.rad() < 2.0 ** (24 - 80)


def test_the_enclosure_holds_the_orbit_throughout_each_step() -> None:
    with working_precision(64):
        flight = field().flight(start(), FlightStepSearch())
        while flight.time < arb(0.1):
            step = flight.step()
            for share in (0, 0.3, 0.7, 1):
                state = step.states_at(ball(share * step.length))
                assert all(
                    whole.contains(part) for whole, part in zip(step.enclosure, state, strict=True)
                )
            flight.take_step(step)


# ----------------------------------------------------------------------------- ends without a proof
def test_wide_boxes_and_few_bits_end_with_a_status() -> None:
    with working_precision(64):
        wide = [part + arb(0, "0.05") for part in start()]
        assert flow_for(field(), wide, "0.5").status in (
            FlowStatus.TOO_WIDE,
            FlowStatus.NO_ENCLOSURE,
        )
        assert (
            flow_for(field(), [part + arb(0, 1) for part in start()], "0.5").status
            is FlowStatus.TOO_WIDE
        )
        for strange in (arb("nan"), arb("inf"), arb(0, "inf")):
            outcome = flow_for(field(), [0, strange, -1], "0.1")
            assert outcome.status is FlowStatus.NO_ENCLOSURE
            assert outcome.flight.step_count == 0
        assert (
            flow_for(EnclosedField(ball_constants(PRINTED), arb("nan")), start(), "0.1").status
            is FlowStatus.NO_ENCLOSURE
        )
    with working_precision(24):
        short = flow_for(field(), start(), "0.5")
        # Twenty-four bits hold seven digits.
        assert short.status is not None or max(part.rad() for part in short.flight.box) > 1e-6
