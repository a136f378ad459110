"""Speeds without a connection: proofs that must succeed, and those that must not."""

from __future__ import annotations

import json
from fractions import Fraction

import pytest

from tippedisk_verify.certified import no_connection
from tippedisk_verify.certified.no_connection import prove_absence
from tippedisk_verify.certified.rounding import rounding_interval
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import CALIBRATED, GEOMETRY, PRINTED, Parameters
from tippedisk_verify.orbits.bisection import unstable_branch
from tippedisk_verify.reference_values.lookup import reference

OMEGA_H = reference("printed/linear/heteroclinic/point/omega_h").measured().value
NEAR = Fraction(1, 1000)


@pytest.mark.parametrize(("side", "outcome"), [(-1, "goes past 3 pi/2"), (1, "turns back")])
def test_either_side_of_the_connection_is_proved(
    monkeypatch: pytest.MonkeyPatch, taylor: Taylor, side: int, outcome: str
) -> None:
    """A piece a hundredth of its distance long, and what the ordinary road sees in its middle."""
    monkeypatch.setattr(no_connection, "_FIRST_SHARE", Fraction(1))
    ends = sorted(OMEGA_H + side * NEAR * share for share in (1, Fraction(101, 100)))
    shares: list[float] = []
    found = prove_absence(PRINTED, *ends, shares.append)
    assert found.proved
    assert (found.outcomes, found.pieces, shares) == ((outcome,), 1, [1.0])
    told = json.loads(json.dumps(found.json()))
    assert [Fraction(told[name]) for name in ("low", "high")] == ends
    assert told["low"] in found.statement
    assert outcome in found.statement
    branch = unstable_branch(PRINTED, sum(ends) / 2, taylor)
    assert (branch.events[-1].name == "turns back") == (outcome == "turns back")


@pytest.mark.parametrize("share", [Fraction(1, 2), Fraction(0), Fraction(1)])
def test_an_interval_with_the_connection_is_not_proved(monkeypatch: pytest.MonkeyPatch, share: Fraction) -> None:
    """In its middle and at its very ends."""
    monkeypatch.setattr(no_connection, "_FIRST_SHARE", Fraction(1))
    monkeypatch.setattr(no_connection, "_SMALLEST_SHARE", Fraction(1))
    monkeypatch.setattr(no_connection, "_LONGEST", 2.0)
    low = OMEGA_H - share * NEAR / 10
    found = prove_absence(PRINTED, low, low + NEAR / 10)
    assert not found.proved
    assert found.reached == low
    assert found.statement.startswith("nothing is proved")
    assert found.json()["proved"] is False


def test_ends_that_make_no_sense_are_refused() -> None:
    for ends in (("30", "30"), ("31", "30"), ("-1", "30"), ("30", "pi"), ("30", "1e7"), ("30", "soon")):
        with pytest.raises(InputError):
            prove_absence(PRINTED, *ends)


def test_without_real_eigenvalues_nothing_is_proved() -> None:
    found = prove_absence(PRINTED.changed(mu="0.03"), "30", "30.01")
    assert not found.proved
    assert "saddle-focus" in found.statement


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "outcome"), [(PRINTED, "turns back"), (GEOMETRY, "goes past 3 pi/2")], ids=lambda p: str(p)[:9]
)
def test_no_speed_that_rounds_to_the_printed_one(parameters: Parameters, outcome: str) -> None:
    found = prove_absence(parameters, *rounding_interval("30.07"))
    assert found.proved
    assert found.outcomes == (outcome,)


@pytest.mark.slow
def test_the_proof_ends_where_the_connection_is() -> None:
    truth = reference("calibrated/linear/heteroclinic/point/omega_h").measured().value
    found = prove_absence(CALIBRATED, *rounding_interval("30.07"))
    assert not found.proved
    assert 0 < truth - found.reached < Fraction(1, 10**4)
    assert found.outcomes == ("goes past 3 pi/2",)
