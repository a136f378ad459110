"""Proved rotating cycles: against the ordinary roads, and what must not be proved."""

from __future__ import annotations

import json
from fractions import Fraction

import pytest

from tests.proofs.cases import turn_flight
from tippedisk_verify.atlas.cycles_at_speed import rotating_cycle
from tippedisk_verify.cli import main
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import ROTATING
from tippedisk_verify.cycles.spectral import spectral_rotation
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.section import Status as FlightStatus
from tippedisk_verify.proofs.search.cycle import TURN, Status, prove_cycle

SHARED = ("period", "beta_bar_top", "v_top", "multiplier_slow")


def flown(beta_bar, v, omega="30.0388", **options):
    """A turn on balls, and its status."""
    with working_precision(100):
        return turn_flight(Model(ball_constants(PRINTED), ball(omega)), ball(beta_bar), ball(v), **options)


def test_a_turn_off_the_cycle_against_the_ordinary_road(taylor) -> None:
    """In double: the turn map amplifies rounding some thousand times."""
    ordinary = ReturnMap(ROTATING, PRINTED, Fraction("30.2"), taylor)((0.5, 0.6))
    flight = flown("0.5", "0.6", "30.2", derivatives=True)
    assert flight.status is FlightStatus.RETURNED
    pairs = [
        (flight.time, ordinary.time),
        (flight.image[0], ordinary.residual[0] + 0.5),
        (flight.image[1], ordinary.residual[1] + 0.6),
        *zip((*flight.matrix[0], *flight.matrix[1]), (*ordinary.matrix[0], *ordinary.matrix[1]), strict=True),
        *zip(flight.by_omega, ordinary.by_omega, strict=True),
        *zip(flight.time_by_state, ordinary.time_by_state, strict=True),
        (flight.time_by_omega, ordinary.time_by_omega),
    ]
    for mine, theirs in pairs:
        assert float(mine.mid()) == pytest.approx(float(theirs), rel=1e-10, abs=1e-11)  # a thousand times rounding


@pytest.mark.slow
def test_the_image_of_a_box_holds_those_of_its_corners() -> None:
    step = arb(1) / 2**40
    with working_precision(100):
        model = Model(ball_constants(PRINTED), ball("30.2"))
        whole = turn_flight(model, ball("0.5") + arb(0, step), ball("0.6") + arb(0, step), derivatives=True)
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            corner = turn_flight(model, ball("0.5") + signs[0] * step, ball("0.6") + signs[1] * step)
            assert all(wide.contains(point) for wide, point in zip(whole.image, corner.image, strict=True))
            assert whole.time.contains(corner.time)


@pytest.mark.parametrize(
    ("omega", "stable"),
    [
        pytest.param("30.0388", True, marks=pytest.mark.slow(minutes=0.5)),
        ("31.386592688643567", False),
        pytest.param("30.0388", False, marks=pytest.mark.slow(minutes=0.5)),
    ],
)
def test_both_other_roads_lie_in_the_proved_intervals(taylor, omega, stable) -> None:
    ordinary = rotating_cycle(PRINTED, omega, taylor, stable=stable)
    proof = prove_cycle(PRINTED, omega, (ordinary.beta_bar_top.value, ordinary.v_top.value), digits=12, section=TURN)
    assert proof.proved, proof.statement
    assert proof.stable is stable
    numbers = proof.numbers()
    for name, number in numbers.items():
        theirs = getattr(ordinary, name)
        assert abs(number.value - theirs.value) <= number.uncertainty + theirs.uncertainty, name
    spectral = spectral_rotation(PRINTED, omega, stable=stable, digits=14)
    for name in SHARED:
        theirs = getattr(spectral, name)
        assert abs(numbers[name].value - theirs.value) <= numbers[name].uncertainty + theirs.uncertainty, name
    assert "unstable" in proof.statement or stable


@pytest.mark.slow
def test_nothing_is_proved_below_the_fold() -> None:
    below = prove_cycle(PRINTED, "29.9", ("0.463", "0.526"), digits=6, most_bits=120, section=TURN)
    assert below.status in (Status.NOT_CONVERGED, Status.NOT_INCLUDED, Status.NOT_FOLLOWED)


def test_what_is_not_proved() -> None:
    """On orbits that turn back or lie flat, and for what makes no sense."""
    assert flown("0.3", "0.3").status is not FlightStatus.RETURNED
    assert flown("1.2", "1").status is not FlightStatus.RETURNED
    assert flown("-0.5", "-0.5").status is not FlightStatus.RETURNED
    with pytest.raises(InputError, match="two components"):
        prove_cycle(PRINTED, "30.06", ("0.45",), section=TURN)
    with pytest.raises(InputError, match="positive decimal"):
        prove_cycle(PRINTED, "-1", ("0.45", "0.55"), section=TURN)


def test_the_command(capsys) -> None:
    words = [
        "certify",
        "orbit",
        "--rotating",
        "--unstable",
        "--omega",
        "31.386592688643567",
        "--json",
        "--digits",
        "10",
    ]
    assert main(words) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["proved"] is True
    assert shown["stable"] is False
    assert main(["certify", "orbit", "--rotating", "--omega", "31"]) == 1
    assert "nothing is proved" in capsys.readouterr().out
    for words, told in (
        (["--fold", "1", "--omega", "30"], "belongs to --at-fold"),
        (["--at-fold", "--below-crit", "1"], "leave out"),
        (["--at-fold", "--friction", "smooth"], "linear"),
        (["--rotating", "--at-fold", "--omega", "30"], "leave out"),
        (["--rotating"], "give the speed"),
    ):
        assert main(["certify", "orbit", *words]) == 2
        assert told in capsys.readouterr().err
