"""The smooth friction law: its flow through sliding reversals, the limit cycles and Omega_h
proved under it.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from tests.proofs.cases import NUMBERS, flow_for, half_flight, in_precision
from tippedisk_verify import PRINTED, Parameters, reference
from tippedisk_verify.proofs.ball_conversions import (
    ball_constants,
    ball_to_measured,
    field_for_disk,
)
from tippedisk_verify.proofs.kernel import sliding
from tippedisk_verify.proofs.kernel.balls import arb, ball, positive
from tippedisk_verify.proofs.kernel.proved_flow import FlightStopped, FlowStatus
from tippedisk_verify.proofs.kernel.sliding import SlidingReversalStep
from tippedisk_verify.proofs.kernel.vector_field import sliding_motion
from tippedisk_verify.proofs.search.connection_proof import (
    ConnectionProof,
    prove_connection,
)
from tippedisk_verify.proofs.search.cycle_proof import prove_cycle
from tippedisk_verify.proofs.search.step_search import FlightStepSearch

SMOOTH = PRINTED.with_friction("smooth")
OMEGA = Fraction("30.386592688644")
PLACE = "table1/smooth/limit-cycle/crit-0.5"
GUESS = tuple(
    f"{float(reference(f'{PLACE}/{name}').measured()):.12g}" for name in ("gamma_bar_0", "v_0")
)
#: A hundredth of a second before the first sliding reversal of the limit cycle, and until as long
#: after it.
START, SPAN = ("0", "1.725", "-1.7105"), "0.02"


_context = in_precision(100)


def gamma_y(constants, omega, state):
    return sliding_motion(sliding.BallOps, constants, omega, state)[0]


# -------------------------------------------------------------------------- what must not be proved
#: From here the sliding velocity, which is negative, rises to a greatest value close to zero and
#: falls again. It stays negative for a v somewhat below -1.809586 rad/s, and is positive for a
#: while for one above.
GRAZING = ("-0.2527", "1.0417", "-1.809586")
LATER = "0.08"  # s


@pytest.mark.parametrize(
    ("start", "span", "reversals"),
    [
        (START, SPAN, 1),
        ((*GRAZING[:2], "-1.810586"), LATER, 0),
        ((*GRAZING[:2], "-1.808586"), LATER, 2),
    ],
)
def test_reversals_are_counted_and_the_sign_between_them_is_known(
    start: Any, span: str, reversals: int
) -> None:
    flight = field_for_disk(SMOOTH, ball(OMEGA)).flight(
        [ball(part) for part in start], FlightStepSearch()
    )
    crossings, before = 0, flight.side
    while flight.time < ball(span):
        step = flight.step()
        crossings += isinstance(step, SlidingReversalStep)
        flight.take_step(step)
        assert positive(flight.side * gamma_y(ball_constants(SMOOTH), ball(OMEGA), flight.box))
    assert (flight.reversals, before, flight.side) == (reversals, -1, 1 if reversals == 1 else -1)
    assert crossings == min(reversals, 1) or reversals == 2


def test_a_box_that_holds_a_grazing_orbit_is_not_followed() -> None:
    start = [*map(ball, GRAZING[:2]), ball(GRAZING[2]) + arb(0, "0.001")]
    outcome = flow_for(field_for_disk(SMOOTH, ball(OMEGA)), start, LATER)
    assert outcome.status is FlowStatus.GRAZING
    assert outcome.flight.time < ball(LATER)


def test_a_start_on_both_sides_is_not_followed() -> None:
    """On the section gamma_y = 0 where rho v = -e Omega sin(gamma_bar)."""
    field = field_for_disk(SMOOTH, ball(OMEGA))
    gamma = ball("1.7")
    constants = field.constants
    v = -constants.e * ball(OMEGA) * gamma.sin() / (constants.r + constants.e * gamma.cos())
    with pytest.raises(FlightStopped) as stopped:
        half_flight(field, gamma, v)
    assert stopped.value.status is FlowStatus.GRAZING


def test_a_moment_in_doubt_has_no_derivatives() -> None:
    start = [ball(part) + arb(0, "1e-6") for part in START]
    flight = field_for_disk(SMOOTH, ball(OMEGA)).flight(start, FlightStepSearch(), derivatives=True)
    step = flight.step()
    while not isinstance(step, SlidingReversalStep):
        flight.take_step(step)
        step = flight.step()
    doubtful = step.reversal_time.mid()
    assert not any(entry.is_finite() for row in step.step_derivatives_at(doubtful) for entry in row)
    assert not step.divergence_at(doubtful).is_finite()
    assert step.states_at(doubtful) == step.enclosure
    flight.take_step(step, doubtful)
    assert not any(part.is_finite() for part in flight.box)


# ------------------------------------------------------------------------------------- limit cycles
def test_the_reference_cycle_returns_to_its_start() -> None:
    truth = {name: reference(f"{PLACE}/{name}").measured() for name in NUMBERS[:4]}
    start = truth["gamma_bar_0"], truth["v_0"]
    image = half_flight(field_for_disk(SMOOTH, ball(OMEGA)), *(ball(part.value) for part in start))
    assert image.reversals == 3
    held = [*image.image, 2 * image.time, -image.beta_least]
    for mine, other in zip(held, (*start, truth["period"], truth["beta_max"]), strict=True):
        assert ball_to_measured(mine).holds(other.value)
        # The flight multiplies the roundings of 100 bits by some thousands.
        assert mine.rad() < 2.0 ** (24 - 100)


@pytest.mark.parametrize(
    ("place", "digits"),
    [
        pytest.param(PLACE, 8, marks=pytest.mark.slow(minutes=0.2)),
        pytest.param(
            "table1/smooth/near-heteroclinic/het+1e-3", 30, marks=pytest.mark.slow(minutes=2)
        ),
        pytest.param(
            "calibrated/smooth/limit-cycle/crit-0.01", 30, marks=pytest.mark.slow(minutes=2)
        ),
    ],
)
def test_reference_cycles_lie_in_the_proved_intervals(place: str, digits: int) -> None:
    """The reference data's half-widths are some 1e-50."""
    disk = Parameters.named(place.partition("/")[0]).with_friction("smooth")
    values = {name: reference(f"{place}/{name}").measured() for name in NUMBERS}
    omega = Fraction(reference(f"{place}/period").inputs["Omega"])
    proof = prove_cycle(
        disk, omega, (values["gamma_bar_0"].value, values["v_0"].value), digits=digits
    )
    assert proof.proved, proof.statement
    assert proof.stable
    assert proof.to_dict()["sliding_reversals"] == proof.reversals == 6
    assert "under the smooth Coulomb friction law" in proof.statement
    assert (
        "gamma_y changes its sign exactly 6 times a period and is 0 nowhere else" in proof.statement
    )
    for name, number in proof.numbers().items():
        assert (
            abs(number.value - values[name].value) <= number.uncertainty + values[name].uncertainty
        ), name
        assert number.uncertainty < max(1, abs(number.value)) / Fraction(10) ** digits, name


# -------------------------------------------------------------------------- Omega_h and the saddles
TRUTH = reference("table1/smooth/heteroclinic/point/omega_h").measured()


@pytest.fixture(scope="module")
def connection() -> ConnectionProof:
    # So wide an interval could not be followed past the saddle: a narrower one is proved.
    return prove_connection(SMOOTH, TRUTH.value, 1)


def test_the_proved_interval_holds_omega_h(connection: ConnectionProof) -> None:
    assert connection.proved
    assert connection.unique
    assert connection.upright
    assert connection.omega_h.holds(TRUTH.value)
    assert 2 * connection.omega_h.uncertainty <= Fraction(1, 10)
    assert (
        "under the smooth Coulomb friction law there is exactly one Omega" in connection.statement
    )


def test_nothing_is_said_of_limit_cycles_of_a_field_without_second_derivatives(
    connection: ConnectionProof,
) -> None:
    """All other hypotheses of the theorem are there."""
    assert connection.verified.arrives_along_slow_direction
    assert connection.limit_cycle is None
    assert replace(connection, parameters=PRINTED).limit_cycle is not None
