"""Proved limit cycles, librating and rotating: against the reference data and other methods,
and what is not proved.
"""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from typing import Any

import pytest

from tests.command_line import answer
from tests.problems import speed_below
from tests.proofs.cases import NUMBERS, box_is_included, half_flight, hull, turn_flight
from tippedisk_verify import PRINTED, InputError, Measured, reference, shoot_limit_cycle
from tippedisk_verify.cycles.collocation.collocation_cycles import collocation_rotating_cycle
from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING
from tippedisk_verify.model.equations import shifted_ops, vector_field
from tippedisk_verify.proofs.ball_conversions import (
    ball_constants,
    ball_to_measured,
    field_for_disk,
)
from tippedisk_verify.proofs.kernel.balls import arb, ball, positive, working_precision
from tippedisk_verify.proofs.kernel.certificates.cycle import claimed_names
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField, FlightStopped, FlowStatus
from tippedisk_verify.proofs.search.cycle_proof import (
    ROTATING_SECTION,
    CycleProof,
    CycleStatus,
    prove_cycle,
)

# The reference data's speed half a radian per second below Omega_crit
OMEGA = Fraction("30.386592688644")
PLACE = "table1/linear/limit-cycle/crit-0.5"
TRUTH = tuple(reference(f"{PLACE}/{name}").measured() for name in ("gamma_bar_0", "v_0"))
GUESS = tuple(f"{float(part):.12g}" for part in TRUTH)
ABOVE = "31.386592688643567"  # where unstable rotating cycles are
SMOOTH = PRINTED.with_friction("smooth")
FLIGHTS = pytest.mark.parametrize(
    ("disk", "flight", "section", "start"),
    [
        pytest.param(
            *(PRINTED, half_flight, LIBRATING, ("1.5", "-1.6")), marks=pytest.mark.slow(minutes=0.1)
        ),
        (PRINTED, turn_flight, ROTATING, ("0.5", "0.6")),
        pytest.param(
            *(SMOOTH, half_flight, LIBRATING, ("1.5", "-1.6")), marks=pytest.mark.slow(minutes=0.2)
        ),
    ],
)


def field(disk=PRINTED, omega=OMEGA) -> EnclosedField:
    return field_for_disk(disk, ball(omega))


def box(relative: str) -> tuple[list, list]:
    """The reference's fixed point and radii of that relative size."""
    middle = [ball(part.value) for part in TRUTH]
    return middle, [abs(part) * ball(relative) for part in middle]


def numbers_of(flight: Any) -> list[Any]:
    return [
        flight.time,
        *flight.image,
        *flight.image_by_start[0],
        *flight.image_by_start[1],
        *flight.time_by_start,
    ]


# ----------------------------------------------------------------------------------- what is proved
@cache
def proved_cycle() -> CycleProof:
    """Return the proof of the reference data's cycle."""
    return prove_cycle(PRINTED, OMEGA, GUESS, digits=8)


def test_the_reference_values_lie_in_the_proved_intervals() -> None:
    proof = proved_cycle()
    assert proof.proved, proof.statement
    assert proof.stable is True
    for name, mine in proof.numbers().items():
        value = reference(f"{PLACE}/{name}").measured()
        assert mine.holds(value.value), name
        assert (  # eight digits, as asked
            mine.uncertainty
            < (abs(mine.value) if name in NUMBERS[:4] else max(1, abs(mine.value))) / 10**8
        ), name
    found = proof.to_dict()
    assert (found["proved"], found["status"]) == (True, "PROVED")
    assert "asymptotically stable" in found["statement"]
    assert set(NUMBERS) <= set(found)
    assert json.loads(json.dumps(found)) == found
    assert all(1e-8 < float(distance) < 1 for distance in found["unique_within"].values())


@pytest.mark.slow(minutes=0.5)
@pytest.mark.parametrize(
    ("omega", "stable"),
    [(ABOVE, False), ("30.0388", True)],
)
def test_rotating_cycles_of_other_methods_lie_in_the_proved_intervals(
    taylor, omega, stable
) -> None:
    which = "" if stable else "--unstable"
    found = answer(f"certify orbit --rotating {which} --omega {omega} --digits 8")
    assert (found["proved"], found["stable"]) == (True, stable)
    assert ("unstable" in found["statement"]) is not stable
    ordinary = rotating_cycle_at(PRINTED, omega, taylor, stable=stable)
    collocated = (
        collocation_rotating_cycle(PRINTED, omega, stable=stable, digits=14)
        if stable
        else vars(ordinary)
    )
    for name in claimed_names(ROTATING_SECTION):
        mine = Measured.of(found[name]["value"], found[name]["uncertainty"])
        theirs = [getattr(ordinary, name), collocated.get(name)]
        for other in (
            theirs if name in ("period", "beta_bar_top", "v_top", "multiplier_slow") else theirs[:1]
        ):
            assert abs(mine.value - other.value) <= mine.uncertainty + other.uncertainty, name


@pytest.mark.slow
def test_subcritical_cycles_are_proved_unstable(taylor) -> None:
    thin = PRINTED.changed(A="0.231e-3")
    omega = speed_below(thin, "-0.01")
    cycle = shoot_limit_cycle(thin, omega, taylor)
    proof = prove_cycle(thin, omega, (cycle.gamma_bar_0.value, cycle.v_0.value))
    assert proof.proved, proof.statement
    assert proof.stable is False
    assert positive(proof.values["log_multiplier_slow"])
    assert ball_to_measured(proof.values["multiplier_slow"]).value > 1


@FLIGHTS
def test_a_flight_off_the_cycle_against_shooting(taylor, disk, flight, section, start) -> None:
    """In double: the maps amplify rounding some thousand times, and their derivatives are of
    size 1.
    """
    ordinary = ReturnMap(section, disk, OMEGA, taylor)(tuple(map(float, start)))
    with working_precision(80):
        found = flight(field(disk), *map(ball, start), derivatives=True)
    image = [
        residual + float(part) for residual, part in zip(ordinary.residual, start, strict=True)
    ]
    others = [
        ordinary.time,
        *image,
        *ordinary.jacobian[0],
        ordinary.by_omega[0],
        *ordinary.jacobian[1],
        ordinary.by_omega[1],
        *ordinary.time_by_state,
        ordinary.time_by_omega,
    ]
    for mine, other in zip(numbers_of(found), others, strict=True):
        # Of 80 bits some twenty: the amplification, and as many of the boxes
        assert mine.rad() < 1e-17 * (1 + abs(other))
        # A thousand times the roundings of some ninety steps
        assert float(mine.mid()) == pytest.approx(float(other), rel=1e-11, abs=1e-11)


@FLIGHTS
@pytest.mark.slow
def test_differences_of_flights_lie_in_the_enclosed_derivatives(
    disk, flight, section, start
) -> None:
    """Starts and speeds of a box of size 1e-6."""
    with working_precision(64):
        step = ball("1e-6")
        middle = [*map(ball, start), ball(OMEGA)]
        whole = flight(
            field(disk, hull(OMEGA, OMEGA + Fraction(1, 10**6))),
            *(x + arb(0, step) for x in middle[:2]),
            derivatives=True,
        )
        here = flight(field(disk), *middle[:2])
        columns = zip(*whole.image_by_start, strict=True)
        for k, (column, time_by) in enumerate(zip(columns, whole.time_by_start, strict=True)):
            moved = [x + (step if j == k else 0) for j, x in enumerate(middle)]
            ahead = flight(field(disk, moved[2]), *moved[:2])
            pairs = [
                (time_by, ahead.time, here.time),
                *zip(column, ahead.image, here.image, strict=True),
            ]
            if flight is half_flight:
                pairs.append((whole.beta_least_by_start[k], ahead.beta_least, here.beta_least))
                assert whole.beta_least.contains(ahead.beta_least)
            for slope, after, before in pairs:
                assert (slope * step).overlaps(after - before)
            assert whole.time.contains(ahead.time)
            assert all(
                wide.contains(point) for wide, point in zip(whole.image, ahead.image, strict=True)
            )


# -------------------------------------------------------------------------- what must not be proved
@pytest.mark.slow(minutes=0.2)
def test_boxes_beside_the_cycle_are_not_included() -> None:
    """Nor those of other equations."""

    def wrong(ops, constants, omega):
        right = vector_field(shifted_ops(ops), constants, omega, "linear")

        def rates(beta, gamma, v):
            first, second, third = right(beta, gamma, v)
            return first, second, third + v * (v * v) * (4 * constants.e)

        return rates

    with working_precision(48):
        middle, radii = box("3e-8")
        assert box_is_included(field(), middle, radii)
        assert not box_is_included(
            EnclosedField(ball_constants(PRINTED), ball(OMEGA), wrong), middle, radii
        )
        assert not box_is_included(field(), [middle[0] + 3 * radii[0], middle[1]], radii)
        # Each speed within 1e-5 rad/s has exactly one fixed point in a wider box.
        speeds = hull(OMEGA - Fraction(1, 10**5), OMEGA + Fraction(1, 10**5))
        assert box_is_included(field(omega=speeds), *box("2e-4"))
    with working_precision(35):
        assert not box_is_included(field(), *box("1e-12"))


@pytest.mark.parametrize(
    ("omega", "guess", "status"),
    [
        # Above Omega_crit the cycle is gone
        pytest.param("31.4", GUESS, None, marks=pytest.mark.slow),
        pytest.param("29.5", GUESS, None, marks=pytest.mark.slow),  # below Omega_h too
        (OMEGA, ("1.7", "1.7"), CycleStatus.NOT_FOLLOWED),  # the wrong side of the section
        (OMEGA, ("0", "0"), CycleStatus.TRIVIAL),
        (OMEGA, ("1e-3", "-2e-3"), None),
        # Falls flat
        pytest.param(OMEGA, ("0.5", "-400"), CycleStatus.NOT_FOLLOWED, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_ends_without_a_proof(omega, guess, status) -> None:
    proof = prove_cycle(PRINTED, omega, guess, digits=2, max_bits=64)
    assert not proof.proved
    assert status is None or proof.status is status
    assert proof.outcome_detail
    assert proof.statement.startswith("nothing is proved")
    assert proof.to_dict()["proved"] is False
    with pytest.raises(InputError, match="nothing is proved"):
        proof.numbers()


@pytest.mark.parametrize(
    ("flight", "first", "v", "status"),
    [
        (half_flight, ball("1.7"), arb(0, "0.1"), FlowStatus.NO_START),
        (half_flight, ball("1.7"), ball(1), FlowStatus.NO_START),
        (half_flight, ball("1.7"), arb("nan"), FlowStatus.NO_START),
        (half_flight, arb("nan"), ball(-1), FlowStatus.NO_ENCLOSURE),
        (half_flight, arb("1.7", "0.2"), ball("-1.7"), FlowStatus.TOO_WIDE),
        (half_flight, ball("0.5"), ball(-400), FlowStatus.FLAT),
        (turn_flight, ball("0.3"), ball("0.3"), None),  # turns back
        pytest.param(turn_flight, ball("1.2"), ball(1), None, marks=pytest.mark.slow),  # lies flat
        pytest.param(turn_flight, ball("-0.5"), ball("-0.5"), None, marks=pytest.mark.slow),
    ],
)
def test_flights_that_do_not_return(flight, first, v, status) -> None:
    with working_precision(64):
        with pytest.raises(FlightStopped) as stopped:
            flight(field(), first, v)
        assert status is None or stopped.value.status is status


def test_a_flight_gives_up_after_the_longest_time() -> None:
    with working_precision(64):
        with pytest.raises(FlightStopped) as stopped:
            half_flight(field(), *map(ball, GUESS), max_duration=0.05)
        assert stopped.value.status is FlowStatus.NO_RETURN
        assert positive(stopped.value.time_reached - ball("0.05"))
