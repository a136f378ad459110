"""Limit cycles from flights side by side: the scalar proofs' enclosures, what falls back, and the commands."""

from __future__ import annotations

import json
from fractions import Fraction
from types import SimpleNamespace

import pytest

from tests.proofs.cases import NUMBERS
from tests.proofs.test_sliding import GUESS, OMEGA, PLACE, SMOOTH
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel.balls import arb, working_precision
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus
from tippedisk_verify.proofs.search import lane_cycles
from tippedisk_verify.proofs.search.cycle import Status, prove_cycle
from tippedisk_verify.proofs.search.lane_cycles import prove_cycles
from tippedisk_verify.reference_values.lookup import reference

SPEEDS = [Fraction("30.3866"), Fraction("30.5"), Fraction("30.3866")]
GUESSES = [("1.716267", "-1.710005"), ("1.419348159", "-1.681333424"), ("0.01", "-0.01")]
MAIN = ("period", "gamma_bar_0", "v_0", "beta_max")


def half_a_unit(value: Fraction, digits: int) -> Fraction:
    """Of the last of so many significant digits."""
    return Fraction(10) ** (decimal_magnitude(value) + 1 - digits) / 2


@pytest.mark.slow(minutes=1)
def test_the_scalar_proofs_agree_and_take_what_is_left(monkeypatch) -> None:
    """To 12 digits. The first guess has six digits and is sharpened; the last leads to no cycle."""
    left: list[Fraction] = []

    def scalar(parameters, omega, guess, **options):
        left.append(omega)
        return prove_cycle(parameters, omega, guess, **options)

    monkeypatch.setattr(lane_cycles, "prove_cycle", scalar)
    monkeypatch.setitem(lane_cycles._FEW, "linear", 0)
    found = prove_cycles(PRINTED, SPEEDS, GUESSES, digits=12)
    assert left == SPEEDS[2:]
    assert not found[2].proved
    for proof, omega, guess in zip(found[:2], SPEEDS, GUESSES, strict=False):
        assert proof.status is Status.PROVED
        assert proof.stable is True
        alone = prove_cycle(PRINTED, omega, guess, digits=16)
        for name in NUMBERS:
            assert proof.values[name].overlaps(alone.values[name]), name
        for name in MAIN:
            assert proof.numbers()[name].uncertainty <= half_a_unit(alone.numbers()[name].value, 12), name
        assert 0 < float(proof.unique_within[0]) < 1e-3


@pytest.mark.slow(minutes=1)
def test_twelve_digits_hold_what_the_integrator_finds_in_more_than_200_bits(monkeypatch) -> None:
    """The reference values have 50 digits. No cycle is left to single proofs, none to flights on other balls."""
    for name in ("prove_cycle", "_alone"):
        monkeypatch.setattr(lane_cycles, name, None)
    places = [f"printed/linear/limit-cycle/crit-{distance}" for distance in ("0.01", "0.3", "0.7")]
    truth = [{name: reference(f"{place}/{name}").measured() for name in NUMBERS} for place in places]
    speeds = [Fraction(reference(f"{place}/period").inputs["Omega"]) for place in places]
    guesses = [(round(values["gamma_bar_0"].value, 12), round(values["v_0"].value, 12)) for values in truth]
    for proof, values in zip(prove_cycles(PRINTED, speeds, guesses, digits=12), truth, strict=True):
        for name, mine in proof.numbers().items():
            assert abs(mine.value - values[name].value) <= mine.uncertainty + values[name].uncertainty, name
        for name in MAIN:
            assert proof.numbers()[name].uncertainty <= half_a_unit(values[name].value, 12), name


@pytest.mark.slow
def test_a_cycle_of_the_smooth_law(monkeypatch) -> None:
    """Doubles do for it; the guess is the ordinary road's."""
    monkeypatch.setattr(lane_cycles, "_alone", None)
    monkeypatch.setitem(lane_cycles._FEW, "smooth", 0)
    (proof,) = prove_cycles(
        SMOOTH, [Fraction("30.819602851214587")], [(0.5236456570518794, -0.8184023229692314)], digits=10
    )
    told = json.loads(json.dumps(proof.to_dict()))
    assert told["proved"] is told["stable"] is True
    assert told["sliding_reversals"] == 6
    assert "smooth Coulomb friction law" in told["statement"]


@pytest.mark.slow
def test_cycles_of_the_smooth_law_against_single_proofs(monkeypatch) -> None:
    """One of which doubles show enough, one so close to the Hopf point that they do not."""
    speeds = [OMEGA, Fraction("30.877617412006046")]
    guesses = [GUESS, (0.18843515382480858, -0.3047816033604534)]
    monkeypatch.setitem(lane_cycles._FEW, "smooth", 0)
    for proof, omega, guess in zip(prove_cycles(SMOOTH, speeds, guesses), speeds, guesses, strict=True):
        alone = prove_cycle(SMOOTH, omega, guess, digits=14)
        assert proof.stable is alone.stable is True
        assert proof.reversals == alone.reversals
        for name in NUMBERS:
            assert proof.values[name].overlaps(alone.values[name]), name
    period = reference(f"{PLACE}/period").measured()
    first = prove_cycles(SMOOTH, speeds[:1], guesses[:1])[0].numbers()["period"]
    assert abs(first.value - period.value) <= first.uncertainty + period.uncertainty


@pytest.mark.slow(minutes=40)
def test_the_papers_cycles_under_the_smooth_law(capsys) -> None:
    assert main(["branch", "--paper-sets", "--proved", "--friction", "smooth", "--digits", "10", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (len(told["orbits"]), told["share_proved"]) == (801, 1)
    for entry in told["orbits"]:
        assert entry["stable"]
        assert float(entry["period"]["uncertainty"]) <= 0.5e-10 * float(entry["period"]["value"])


def test_requests_that_make_no_sense() -> None:
    assert prove_cycles(PRINTED, [], []) == []
    for speeds, guesses in (([Fraction(-1)], [(1, -1)]), ([Fraction(30)], [])):
        with pytest.raises(InputError, match="positive speed"):
            prove_cycles(PRINTED, speeds, guesses)


def test_a_speed(capsys) -> None:
    assert main(["branch", "--proved", "--omegas", "30.5", "--digits", "10", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (entry,) = told["orbits"]
    assert (entry["proved"], entry["stable"], told["share_proved"]) == (True, True, 1)
    assert "asymptotically stable" in entry["statement"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("branch", "--proved", "--digits", "13"),
        ("branch", "--proved", "--rotating"),
        ("branch", "--proved", "--out", "branch.csv"),
    ],
)
def test_refused(arguments, capsys) -> None:
    assert main(list(arguments)) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_krawczyks_box_is_no_wider_than_the_one_that_was_flown() -> None:
    middle, radii = [1.5, -1.5], [2.0**-31, 2.0**-31]
    with working_precision(lane_cycles._BITS):
        zero = arb(0)
        box = SimpleNamespace(status=HalfStatus.RETURNED, matrix=((zero, zero), (zero, zero)), by_omega=(zero, zero))
        for share, included in ((1 + arb(2) ** -30, False), (1 - arb(2) ** -20, True)):
            image = [arb(middle[0]) + arb(radii[0]) * share, arb(middle[1])]
            centre = SimpleNamespace(status=HalfStatus.RETURNED, image=image)
            narrower = [lane_cycles._narrower(radius) for radius in radii]
            fixed = lane_cycles._tested(middle, narrower, centre, box)
            assert fixed is not None
            assert fixed.included is included
