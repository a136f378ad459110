"""Proved limit cycles: against the reference data and the ordinary road, and what must not be proved."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import lru_cache

import pytest

from tests.proofs.cases import NUMBERS, half_flight, included, speed_below
from tippedisk_verify.cli import main
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.cycles.shooting import limit_cycle
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, hull, positive, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.cycle import OrbitProof, Status, _decimal_below, prove_cycle
from tippedisk_verify.reference_values.lookup import reference
from tippedisk_verify.reference_values.store import stored

OMEGA = Fraction("30.386592688644")  # the reference data's speed half a radian per second below Omega_crit
PLACE = "printed/linear/limit-cycle/crit-0.5"
TRUTH = tuple(reference(f"{PLACE}/{name}").measured() for name in ("gamma_bar_0", "v_0"))
GUESS = tuple(f"{float(part):.12g}" for part in TRUTH)


@lru_cache(maxsize=1)
def proved() -> OrbitProof:
    return prove_cycle(PRINTED, OMEGA, GUESS, digits=16)


def model(parameters=PRINTED, omega=OMEGA, law=None) -> Model:
    return Model(ball_constants(parameters), ball(omega), law)


def box(relative: str) -> tuple[list, list]:
    """The reference's fixed point and radii of that relative size."""
    middle = [ball(part.value) for part in TRUTH]
    return middle, [abs(part) * ball(relative) for part in middle]


# ------------------------------------------------------------------------------------------------------- what is proved
@pytest.mark.slow
def test_the_reference_values_lie_in_the_proved_intervals() -> None:
    proof = proved()
    assert proof.proved, proof.statement
    assert proof.stable is True
    for name, mine in proof.numbers().items():
        value = reference(f"{PLACE}/{name}").measured()
        assert mine.holds(value.value), name
        assert mine.uncertainty < max(1, abs(mine.value)) / 10**16, name
    for name in NUMBERS[:4]:
        assert proof.numbers()[name].uncertainty < abs(proof.numbers()[name].value) / 10**16, name


def test_what_the_proof_says() -> None:
    found = proved().to_dict()
    assert found["proved"] is True
    assert found["status"] == "PROVED"
    assert "asymptotically stable" in found["statement"]
    assert set(NUMBERS) <= set(found)
    assert json.loads(json.dumps(found)) == found
    assert all(1e-8 < float(distance) < 1 for distance in found["unique_within"].values())


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        (9.999999999999999e-6, "9.9e-6"),  # its logarithm to base 10 rounds to -5
        (1e-5, "9.9e-6"),  # the double is a little above, but not by 2^-20 of it
        (0.99999999999999994, "0.99"),
        (0.00041999, "0.00041"),
        (123.4, "120"),
    ],
)
def test_distances_are_rounded_down_and_by_no_more_than_their_second_digit(x: float, expected: str) -> None:
    found = _decimal_below(arb(x))
    assert found == expected
    assert Fraction(x) * Fraction(10, 11) < Fraction(found) <= Fraction(x)


def test_a_distance_that_may_be_none_is_none() -> None:
    for x in (arb(0), arb(1, 1), arb(-1)):
        assert _decimal_below(x) == "0"


def test_twice_the_half_map_turns_the_fixed_point_into_itself() -> None:
    """The defining property, at another precision: the image of the proved box meets the box."""
    proof = proved()
    with working_precision(150):
        period, gamma_bar_0, v_0, beta_max = (proof.values[name] for name in NUMBERS[:4])
        flight = half_flight(model(), gamma_bar_0, v_0)
        assert flight.status is HalfStatus.RETURNED
        assert flight.image[0].overlaps(gamma_bar_0)
        assert flight.image[1].overlaps(v_0)
        assert (2 * flight.time).overlaps(period)
        assert (-flight.beta_least).overlaps(beta_max)


def test_the_determinant_by_liouville_is_that_of_the_matrix() -> None:
    with working_precision(150):
        wide = half_flight(model(), *(proved().values[name] for name in ("gamma_bar_0", "v_0")), derivatives=True)
    (a, b), (c, d) = wide.matrix
    assert (a * d - b * c).overlaps(-wide.divergence.exp())


def test_a_half_flight_off_the_cycle_against_the_ordinary_road(taylor) -> None:
    """In double: the half map amplifies rounding some hundred times, and its derivatives are of size 1."""
    ordinary = ReturnMap(LIBRATING, PRINTED, OMEGA, taylor)((1.5, -1.6))
    with working_precision(80):
        flight = half_flight(model(), ball("1.5"), ball("-1.6"), derivatives=True)
    assert flight.status is HalfStatus.RETURNED
    pairs = [
        (flight.time, ordinary.time),
        (flight.image[0], ordinary.residual[0] + 1.5),
        (flight.image[1], ordinary.residual[1] - 1.6),
        *zip((*flight.matrix[0], *flight.matrix[1]), (*ordinary.matrix[0], *ordinary.matrix[1]), strict=True),
        *zip(flight.by_omega, ordinary.by_omega, strict=True),
        *zip(flight.time_by_state, ordinary.time_by_state, strict=True),
        (flight.time_by_omega, ordinary.time_by_omega),
    ]
    for mine, other in pairs:
        assert mine.rad() < 1e-18
        assert abs(float(mine) - other) < 1e-12


@pytest.mark.slow
def test_the_turn_moves_as_its_derivative_says() -> None:
    with working_precision(80):
        step = ball("1e-6")
        start = (ball("1.5"), ball("-1.6"))
        whole = half_flight(model(), start[0] + arb(0, step), start[1], derivatives=True)
        moved = half_flight(model(), start[0] + step, start[1])
        here = half_flight(model(), *start)
        assert whole.beta_least.contains(moved.beta_least)
        assert (whole.turn_by_start[0] * step).overlaps(moved.beta_least - here.beta_least)
        assert (whole.time_by_state[0] * step).overlaps(moved.time - here.time)
        speeds = hull(OMEGA, OMEGA + Fraction(1, 10**6))
        faster = half_flight(model(omega=OMEGA + Fraction(1, 10**6)), *start)
        whole = half_flight(model(omega=speeds), *start, derivatives=True)
        for derivative, mine, other in (
            (whole.turn_by_start[2], faster.beta_least, here.beta_least),
            (whole.time_by_omega, faster.time, here.time),
            (whole.by_omega[0], faster.image[0], here.image[0]),
            (whole.by_omega[1], faster.image[1], here.image[1]),
        ):
            assert (derivative * step).overlaps(mine - other)


# ---------------------------------------------------------------------------------------------- what must not be proved
@pytest.mark.slow
def test_a_box_beside_the_cycle_is_not_included() -> None:
    with working_precision(64):
        middle, radii = box("1e-9")
        assert included(model(), middle, radii)
        beside = [middle[0] + 3 * radii[0], middle[1]]
        assert not included(model(), beside, radii)
        assert not included(model(omega="31.4"), middle, radii)  # above Omega_crit there is no cycle


@pytest.mark.parametrize(
    "name", ["mu", *(pytest.param(name, marks=pytest.mark.slow) for name in ("r", "e", "m", "A", "B", "g", "epsilon"))]
)
def test_a_perturbed_parameter_moves_the_cycle_out_of_the_box(name) -> None:
    """A change of a ten-thousandth moves gamma_bar_0 by 7e-6 rad at least (mu); the box reaches 5e-8 rad."""
    changed = PRINTED.changed(**{name: getattr(PRINTED, name) * Fraction(10_001, 10_000)})
    with working_precision(64):
        middle, radii = box("3e-8")
        assert not included(model(changed), middle, radii)


def test_a_perturbed_equation_moves_the_cycle_out_of_the_box() -> None:
    def wrong(ops, constants, omega):
        right = field(shifted(ops), constants, omega, "linear")

        def rates(beta, gamma, v):
            first, second, third = right(beta, gamma, v)
            return first, second, third + v * (v * v) * (4 * constants.e)

        return rates

    with working_precision(64):
        middle, radii = box("3e-8")
        assert not included(model(law=wrong), middle, radii)  # the right law's is, see above


@pytest.mark.parametrize(
    ("omega", "guess", "status"),
    [
        pytest.param("31.4", GUESS, None, marks=pytest.mark.slow),  # above Omega_crit the cycle is gone
        pytest.param("29.5", GUESS, None, marks=pytest.mark.slow),  # below Omega_h too
        (OMEGA, ("1.7", "1.7"), Status.NOT_FOLLOWED),  # the wrong side of the section
        (OMEGA, ("0", "0"), Status.TRIVIAL),
        (OMEGA, ("1e-3", "-2e-3"), None),
        (OMEGA, ("0.5", "-400"), Status.NOT_FOLLOWED),  # falls flat
    ],
    ids=str,
)
def test_ends_without_a_proof(omega, guess, status) -> None:
    proof = prove_cycle(PRINTED, omega, guess, digits=8, most_bits=120)
    assert not proof.proved
    assert status is None or proof.status is status
    assert proof.where
    assert proof.statement.startswith("nothing is proved")
    assert proof.to_dict()["proved"] is False
    with pytest.raises(InputError, match="nothing is proved"):
        proof.numbers()


@pytest.mark.slow
@pytest.mark.parametrize("most_bits", [40, 100])
def test_too_low_a_precision_ends_without_a_proof(most_bits) -> None:
    proof = prove_cycle(PRINTED, OMEGA, GUESS, digits=30, most_bits=most_bits)
    assert proof.status is Status.NOT_INCLUDED
    assert proof.bits <= most_bits


def test_few_bits_do_not_prove_a_narrow_box() -> None:
    middle, radii = box("1e-12")
    for bits, passes in ((35, False), (64, True)):
        with working_precision(bits):
            assert included(model(), middle, radii) is passes, bits


@pytest.mark.parametrize(
    ("gamma_bar", "v", "status"),
    [
        (ball("1.7"), arb(0, "0.1"), HalfStatus.NO_START),
        (ball("1.7"), ball(1), HalfStatus.NO_START),
        (ball("1.7"), arb("nan"), HalfStatus.NO_START),
        (arb("nan"), ball(-1), HalfStatus.NO_ENCLOSURE),
        (arb("1.7", "0.2"), ball("-1.7"), HalfStatus.TOO_WIDE),
        (ball("0.5"), ball(-400), HalfStatus.FLAT),
    ],
)
def test_half_flights_that_do_not_return(gamma_bar, v, status) -> None:
    with working_precision(64):
        assert half_flight(model(), gamma_bar, v).status is status


def test_a_search_that_is_too_short() -> None:
    with working_precision(64):
        flight = half_flight(model(), *(ball(part) for part in GUESS), longest=0.2)
        assert flight.status is HalfStatus.NO_RETURN
        assert positive(flight.reached - ball("0.2"))


def test_refused_input() -> None:
    for omega in ("0", "-30", "pi", "abc"):
        with pytest.raises(InputError):
            prove_cycle(PRINTED, omega, GUESS)
    with pytest.raises(InputError, match="two components"):
        prove_cycle(PRINTED, OMEGA, ("1", "2", "3"))
    with pytest.raises(InputError):
        prove_cycle(PRINTED, OMEGA, ("x", "-1"))


# ---------------------------------------------------------------------------------------------------------- the command
@pytest.mark.slow
def test_command(capsys) -> None:
    arguments = ["certify", "orbit", "--omega", str(float(OMEGA)), "--digits", "6"]
    assert main([*arguments, "--guess", *GUESS, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["proved"] is True
    value, width = (Fraction(found["period"][key]) for key in ("value", "uncertainty"))
    # The command line's decimal of the speed is the reference's only to 17 digits.
    assert abs(value - reference(f"{PLACE}/period").measured().value) < width + Fraction(1, 10**14)
    assert main(["certify", "orbit", "--omega", "30.4", "--guess", "1.7", "1.7"]) == 1
    assert "nothing is proved" in capsys.readouterr().out
    for wrong in (
        ["--omega", "30.4", "--friction", "sticky"],
        ["--omega", "x"],
        [],
        ["--below-crit", "0.5", "--digits", "0"],
    ):
        assert main(["certify", "orbit", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1


# --------------------------------------------------------------------------------------------------------- slow studies
def _reference_cycles() -> list[str]:
    return sorted({name.rpartition("/")[0] for name in stored() if "/linear/limit-cycle/" in name})


@pytest.mark.slow
@pytest.mark.parametrize("place", _reference_cycles())
def test_every_reference_cycle_of_the_linear_law_is_proved(place) -> None:
    """Reference values of 50 digits; each half-width must meet the proved interval."""
    name = place.partition("/")[0]
    omega = Fraction(reference(f"{place}/period").inputs["Omega"])
    values = {key: reference(f"{place}/{key}").measured() for key in NUMBERS}
    proof = prove_cycle(Parameters.named(name), omega, (values["gamma_bar_0"].value, values["v_0"].value), digits=45)
    assert proof.proved, proof.statement
    for key, mine in proof.numbers().items():
        assert abs(mine.value - values[key].value) <= mine.uncertainty + values[key].uncertainty, key


@pytest.mark.slow
def test_all_speeds_of_an_interval_at_once() -> None:
    """Each speed within 1e-5 rad/s has exactly one fixed point in the box."""
    middle, radii = box("2e-4")
    with working_precision(64):
        speeds = hull(OMEGA - Fraction(1, 10**5), OMEGA + Fraction(1, 10**5))
        assert included(model(omega=speeds), middle, radii)


@pytest.mark.slow
@pytest.mark.parametrize("inertia", ["0.227e-3", "0.231e-3"])
def test_subcritical_cycles_are_proved_unstable(taylor, inertia) -> None:
    thin = PRINTED.changed(A=inertia)
    omega = speed_below(thin, "-0.01")
    cycle = limit_cycle(thin, omega, taylor)
    proof = prove_cycle(thin, omega, (cycle.gamma_bar_0.value, cycle.v_0.value))
    assert proof.proved, proof.statement
    assert proof.stable is False
    assert positive(proof.values["log_multiplier_slow"])
    assert measured(proof.values["multiplier_slow"]).value > 1
