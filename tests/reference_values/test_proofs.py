"""Reference values with proofs: they contain their enclosures, and no claim exceeds its proof."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from fractions import Fraction

import pytest

from reference_data.make.proofs import proved
from tippedisk_verify import AccuracyError, Measured
from tippedisk_verify.reference_values.checking import stored_entries
from tippedisk_verify.reference_values.entries import case_of
from tippedisk_verify.reference_values.store import data_folder, load_store

PROVED = ("/both/equilibrium/", "/linear/hopf/", "/linear/limit-cycle/", "/linear/heteroclinic/")


def test_what_can_be_proved_is_proved_in_the_data() -> None:
    store = load_store()
    for quantity in store.values():
        if any(part in quantity.id for part in PROVED):
            assert quantity.grade == "proved", quantity.id
        if quantity.grade == "proved":
            assert quantity.proof["command"].startswith("tippedisk-verify certify ")
            held = Measured.of(quantity.proof["value"], quantity.proof["uncertainty"])
            mine = quantity.measured()
            assert mine.contains(held), quantity.id
            # A proof is worth its name only if it is about as sharp as what it proves: 45 digits,
            # the defects aside.
            assert held.uncertainty <= abs(mine.value) / 10**45 or not mine.value, quantity.id


@pytest.mark.parametrize(
    "id_",
    [
        "table1/linear/hopf/point",
        "calibrated/both/equilibrium/noninverted-30.4",
        *(
            pytest.param(id_, marks=pytest.mark.slow(minutes=2.5))
            for id_ in ("table1/linear/limit-cycle/crit-0.5", "table1/linear/heteroclinic/point")
        ),
    ],
)
def test_a_proof_is_found_again(id_: str) -> None:
    """The sentence is the same except for decimals: doubles choose the steps, and processors may
    differ.
    """
    (stored,) = stored_entries(load_store(), f"{id_}/")
    proof = proved(case_of(stored.entry, "decimals"), stored.values("decimals"))
    known = json.loads((data_folder() / "proofs.json").read_text())[id_]
    statement, stored_statement = (
        re.sub(r"-?\d+\.\d+( ± [\d.e-]+)?", "#", one.pop("statement")) for one in (proof, known)
    )
    assert (statement, proof["command"]) == (stored_statement, known["command"])
    assert proof["enclosures"].keys() == known["enclosures"].keys()
    for name, mine in proof["enclosures"].items():
        assert (Measured.of(**mine) - Measured.of(**known["enclosures"][name])).holds(0), name


def test_values_that_are_wrong_or_claim_too_much_are_not_proved() -> None:
    (stored,) = stored_entries(load_store(), "table1/linear/hopf/point/")
    case, values = case_of(stored.entry, "decimals"), stored.values("decimals")
    period = values["period"]
    for spoilt in (
        Measured(period.value + Fraction(1, 10**45), period.uncertainty),
        replace(period, uncertainty=Fraction(1, 10**60)),
    ):
        with pytest.raises(AccuracyError, match="period does not contain its enclosure"):
            proved(case, {**values, "period": spoilt})


def test_what_has_no_proof_gets_none() -> None:
    for id_ in (
        "table1/smooth/rotating-cycle/stable-het-0.01",
        "table1/linear/near-heteroclinic/het+1e-5",
    ):
        (stored,) = stored_entries(load_store(), f"{id_}/")
        assert proved(case_of(stored.entry, "decimals"), stored.values("decimals")) is None
