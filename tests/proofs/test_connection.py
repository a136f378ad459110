"""Omega_h and the cycles next to it: proofs that must succeed, and those that must not."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import pytest
from flint import arb, arb_mat

from tests.proofs.cases import proved_connection
from tests.proofs.saddle_orbits import OMEGA_H
from tippedisk_verify import CALIBRATED, PRINTED, Measured, Taylor, heteroclinic, reference
from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.proofs.kernel.balls import ball, working_precision
from tippedisk_verify.proofs.kernel.certificates.connection import _converges_along_slow_direction
from tippedisk_verify.proofs.search import connection_proof as certified
from tippedisk_verify.proofs.search.connection_proof import (
    ConnectionProof,
    ConnectionStatus,
    prove_connection,
)
from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import (
    CyclesNearOmegaHProof,
    CyclesNearOmegaHStatus,
    prove_cycles_near_omega_h,
)

TRUTH = {
    name: reference(f"{name}/linear/heteroclinic/point/omega_h").measured()
    for name in ("table1", "calibrated")
}
DIGITS = 9  #: of `proved_connection`


def test_the_proof_holds_the_reference_values() -> None:
    proof = proved_connection()
    assert (proof.proved, proof.unique, proof.upright) == (True, True, True)
    assert 2 * proof.omega_h.uncertainty <= Fraction(1, 10**DIGITS)
    assert proof.omega_h.holds(TRUTH["table1"].value)
    assert "there is exactly one Omega with" in proof.statement
    assert proof.saddle_value.value + proof.saddle_value.uncertainty < 0
    for mine, theirs in zip(proof.saddle_eigenvalues, ("u", "s", "ss"), strict=True):
        entry = reference(f"table1/linear/heteroclinic/point/lambda_{theirs}").measured()
        assert abs(mine.value - entry.value) <= mine.uncertainty + entry.uncertainty
    # The interval printed is the interval of the statement, to the last digit.
    result = json.loads(json.dumps(proof.to_dict()))
    assert Fraction(result["omega_h"]["value"]) == proof.omega_h.value
    assert Fraction(result["omega_h"]["uncertainty"]) == proof.omega_h.uncertainty


def test_what_follows_of_limit_cycles_names_its_space() -> None:
    """With gamma a real number, and only with all hypotheses."""
    proof = proved_connection()
    said = proof.limit_cycle
    assert said in proof.to_dict().values()
    assert "gamma in R (not modulo 2 pi)" in said
    assert "exactly one periodic orbit above Omega_h and none below it or at it" in said
    unstable, slow, fast = proof.saddle_eigenvalues
    # lambda_u + lambda_s = 0, to within its width
    repelling = (Measured(-slow.value, slow.uncertainty), slow, fast)
    for changed in (
        {"unique": False},
        {"verified": replace(proof.verified, arrives_along_slow_direction=False)},
        {"saddle_eigenvalues": repelling},
        {"saddle_eigenvalues": (Measured(9 + unstable.value, unstable.uncertainty), slow, fast)},
        {"status": ConnectionStatus.SIDES},
    ):
        assert replace(proof, **changed).limit_cycle is None


def test_an_orbit_that_comes_in_along_the_fast_direction_is_told() -> None:
    z = [arb(0, 1e-9), arb("0.01", 1e-9), arb("0.001", 1e-9)]
    apart = arb_mat([[6, 1, 1], [1, -8, 2], [1, 2, -100]])
    # The discs are [-11, -5] and [-16.9, -10.9]
    near = arb_mat([[6, 1, 1], [1, -8, 2], [1, 2, -13.9]])
    for matrix, box, slow in (
        (apart, z, True),
        (apart, [z[0], z[2], z[1]], False),
        (apart, [z[0], arb(0, "0.01"), z[2]], False),
        (near, z, False),
    ):
        assert bool(_converges_along_slow_direction(matrix, box)) is slow


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1, 1])
def test_an_interval_beside_the_truth_is_not_proved(monkeypatch, side: int) -> None:
    """The interval ends a fiftieth of its length short of Omega_h: as near as that, and still
    no proof.
    """
    monkeypatch.setattr(certified, "_MAX_PASSES", 1)
    half = proved_connection().omega_h.uncertainty
    found = prove_connection(
        PRINTED, TRUTH["table1"].value + side * half * Fraction(104, 100), DIGITS
    )
    assert found.status is ConnectionStatus.SIDES
    assert "nothing is proved" in found.statement
    assert (found.omega_h, found.proved) == (None, False)


def test_a_disk_without_a_saddle_is_refused() -> None:
    with pytest.raises(NoConnectionError):
        prove_connection(PRINTED.changed(mu="0.03"), Fraction(30), 8)


# ---------------------------------------------------------------------------- the cycles next to it
def test_what_is_refused_of_the_cycles_next_to_it() -> None:
    assert (
        prove_cycles_near_omega_h(ConnectionProof(ConnectionStatus.FLOW)).status
        is CyclesNearOmegaHStatus.NO_CONNECTION
    )
    assert (
        prove_cycles_near_omega_h(ConnectionProof(ConnectionStatus.NO_SADDLE)).to_dict()["proved"]
        is False
    )


def test_what_is_said_of_the_cycles_next_to_it() -> None:
    """As if it were proved: the reference data's cycles are the statement's as far as Omega_h
    is known.
    """
    lengths = map(Fraction, ("30.0479", "30.0569", "0.14", "0.268"))
    end = CyclesNearOmegaHProof(CyclesNearOmegaHStatus.PROVED, proved_connection(), *lengths)
    for part in (PRINTED.definition(), "linear", "30.0569", "3 pi/2 - 0.14", "-0.268"):
        assert part in end.statement
    assert json.loads(json.dumps(end.to_dict()))["to"] == "30.0569"
    for k in (3, 5, 8, 12):
        name = f"table1/linear/near-heteroclinic/het+1e-{k}"
        omega = OMEGA_H + Fraction(1, 10**k)
        with working_precision(64):
            speed, *cycle = map(
                ball,
                (
                    omega,
                    *(reference(f"{name}/{x}").measured().value for x in ("gamma_bar_0", "v_0")),
                ),
            )
            assert end.contains_cycle(speed, *cycle) == (k < 9)  # Omega_h is known to 1e-9 here
            assert not replace(end, status=CyclesNearOmegaHStatus.FLIGHT).contains_cycle(
                speed, *cycle
            )


@pytest.mark.slow(minutes=0.5)
def test_the_end_of_another_disk_is_proved(taylor: Taylor) -> None:
    omega_h = heteroclinic(CALIBRATED, taylor, digits=14).omega_h.value
    end = prove_cycles_near_omega_h(prove_connection(CALIBRATED, omega_h, 9))
    assert end.proved, end.statement
