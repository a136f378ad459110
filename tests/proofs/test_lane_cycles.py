"""Limit cycles from flights side by side: against reference values and single proofs; and the smooth law's flights."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import pytest

from tests.proofs.cases import NUMBERS, carry
from tests.proofs.test_sliding import GUESS, OMEGA, SMOOTH
from tippedisk_verify.cli import main
from tippedisk_verify.model.decimals import decimal_magnitude
from tippedisk_verify.model.parameters import PRINTED, Constants
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.kernel.lanes import Lanes, quiet
from tippedisk_verify.proofs.kernel.section import HALF, Round, Walk
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus
from tippedisk_verify.proofs.kernel.sliding import SlidingPath, SmoothModel, model_of
from tippedisk_verify.proofs.search import lane_cycles
from tippedisk_verify.proofs.search.cycle import Status, prove_cycle
from tippedisk_verify.proofs.search.lane_cycles import prove_cycles
from tippedisk_verify.proofs.search.lane_flight import LaneSteps, half_flights
from tippedisk_verify.reference_values.lookup import reference

MAIN = ("period", "gamma_bar_0", "v_0", "beta_max")


@pytest.mark.slow(minutes=0.5)
def test_twelve_digits_hold_the_reference_values_and_what_leads_to_no_cycle_is_not_proved() -> None:
    """These have 50 digits. A guess of six digits is sharpened."""
    places = [f"printed/linear/limit-cycle/crit-{distance}" for distance in ("0.01", "0.3", "0.7")]
    truth = [{name: reference(f"{place}/{name}").measured() for name in NUMBERS} for place in places]
    speeds = [Fraction(reference(f"{place}/period").inputs["Omega"]) for place in places]
    guesses = [(round(values["gamma_bar_0"].value, 12), round(values["v_0"].value, 12)) for values in truth]
    guesses[1] = tuple(round(part, 6) for part in guesses[1])
    *found, nothing = prove_cycles(PRINTED, [*speeds, speeds[0]], [*guesses, ("0.01", "-0.01")], digits=12)
    assert not nothing.proved
    for proof, values in zip(found, truth, strict=True):
        assert (proof.status, proof.stable) == (Status.PROVED, True)
        assert 0 < float(proof.unique_within[0]) < 1e-3
        for name, mine in proof.numbers().items():
            assert abs(mine.value - values[name].value) <= mine.uncertainty + values[name].uncertainty, name
        for name in MAIN:
            last = Fraction(10) ** (decimal_magnitude(values[name].value) + 1 - 12)
            assert proof.numbers()[name].uncertainty <= last / 2, name


@pytest.mark.slow(minutes=2.9)
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


def test_a_speed(capsys) -> None:
    assert main(["branch", "--proved", "--omegas", "30.386592688644", "--digits", "10", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (entry,) = told["orbits"]
    assert (entry["proved"], entry["stable"], told["share_proved"]) == (True, True, 1)
    assert "asymptotically stable" in entry["statement"]
    mine, known = entry["period"], reference("printed/linear/limit-cycle/crit-0.5/period").measured()
    assert abs(Fraction(mine["value"]) - known.value) <= Fraction(mine["uncertainty"]) + known.uncertainty


def test_refused(capsys) -> None:
    for words in (["--digits", "13"], ["--rotating"], ["--out", "branch.csv"]):
        assert main(["branch", "--proved", *words]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


# ----------------------------------------------------------------------------------------- flights under the smooth law
START = np.array([[float(part)] for part in (*GUESS, OMEGA)])  # gamma_bar, v and Omega of a limit cycle
#: A point, a narrow and a wide box; and one that begins on the other side.
RADII = np.array([0.0, 1e-9, 1e-6, 1e-9])
MIDDLES = START + np.array([[0.0], [1.0], [0.0]]) * np.array([0.0, 0.0, 0.0, 0.2])
SPAN = 0.012  # s: the first reversal of the cycle is 0.01 s after the section


def model(middles: np.ndarray, radii: np.ndarray | float = 0.0) -> SmoothModel:
    with working_precision(96):
        constants = Constants(*(Lanes.of([value]) for value in ball_constants(SMOOTH)))
    return SmoothModel(constants, Lanes(middles[2], radii))


def test_orbits_through_a_reversal_are_held() -> None:
    """With their derivatives, of corners of all lanes that are followed beyond `SPAN`; those are flown in 100 bits."""
    start = [Lanes(part, RADII) for part in MIDDLES[:2]]
    with quiet():
        walk = Walk(model(MIDDLES, RADII), HALF, start, search := LaneSteps(len(RADII)), derivatives=True)
        while not (walk.path.time.midpoints > SPAN).all():
            tried = walk.advance()
            assert isinstance(tried, Round)
            assert (search.answered(tried) == None).all()  # noqa: E711
    path = walk.path
    assert isinstance(path, SlidingPath)
    with working_precision(100):
        for lane, shares in ((0, (0, 0, 0)), (1, (1, -1, 1)), (2, (-1, 1, 1)), (2, (1, 1, -1)), (3, (1, 1, 1))):
            gamma_bar, v, omega = (
                arb(float(m)) + share * arb(float(RADII[lane]))
                for m, share in zip(MIDDLES[:, lane], shares, strict=True)
            )
            true = carry(model_of(SMOOTH, omega), (ball(0), gamma_bar, v), path.time.arb(lane), derivatives=True)
            assert true.status is FlowStatus.REACHED
            for mine, others in zip((path.box, *path.matrix), (true.state, *(true.matrix or ())), strict=True):
                assert all(x.arb(lane).overlaps(y) for x, y in zip(mine, others, strict=True))
            assert path.divergence.arb(lane).overlaps(true.divergence)
    assert list(path.reversals) == [1, 1, 1, 0]
    assert list(path.side) == [1] * 4
    assert path.box[2].radii[0] < 1e-12  # of a point, no digits are lost: some hundred operations of 1e-16 each
    assert path.box[2].radii[2] < 1e-4


def test_what_is_not_followed_ends_with_a_status() -> None:
    """A box on both sides of gamma_y = 0; no number; the wrong sign of v."""
    e_over_r = Fraction(SMOOTH.e) / Fraction(SMOOTH.r)
    # gamma_y = 0 on the section where rho v = -e Omega sin(gamma_bar): near gamma_bar = 0.1 for v = -e Omega 0.1 / rho.
    grazing = -float(e_over_r) * START[2, 0] * 0.1
    middles = np.array([[0.1, 1.7, 1.7], [grazing, np.nan, 1.7], np.repeat(START[2], 3)])
    found = half_flights(model(middles), Lanes(middles[0], [0.05, 0.0, 0.0]), Lanes(middles[1], [0.05, 0.0, 0.0]))
    assert list(found.status) == [HalfStatus.GRAZING, HalfStatus.NO_START, HalfStatus.NO_START]
