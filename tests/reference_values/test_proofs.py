"""Reference values with proofs: they contain their enclosures, and what contradicts or exceeds its proof is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.reference_values.checking import check
from tippedisk_verify.reference_values.manifest import write_manifest
from tippedisk_verify.reference_values.proofs import prove, proved_entry
from tippedisk_verify.reference_values.store import Store, data_folder, stored

PROVED = ("/both/equilibrium/", "/linear/hopf/", "/linear/limit-cycle/", "/linear/heteroclinic/")


def test_what_can_be_proved_is_proved_in_the_data() -> None:
    store = stored()
    for quantity in store.values():
        if any(part in quantity.id for part in PROVED):
            assert quantity.grade == "proved", quantity.id
        if quantity.grade == "proved":
            assert quantity.proof is not None
            assert quantity.proof["command"].startswith("tippedisk-verify certify ")
            held = Measured(exact(quantity.proof["value"]).rational, exact(quantity.proof["uncertainty"]).rational)
            mine = quantity.measured()
            assert mine.contains(held), quantity.id
            # A proof is worth its name only if it is about as sharp as what it proves: 45 digits, the defects aside.
            assert held.uncertainty <= abs(mine.value) / 10**45 or not mine.value, quantity.id


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Equilibria and Hopf points only, without their proofs."""
    for name in ("printed", "calibrated"):
        (tmp_path / name).mkdir()
        for kind in ("equilibrium", "hopf"):
            document = json.loads((data_folder() / name / f"{kind}.json").read_text())
            for entry in document["entries"]:
                entry.pop("proof", None)
                for quantity in entry["quantities"].values():
                    if quantity.pop("enclosure", None) is not None:
                        quantity["grade"] = "two-method"
            (tmp_path / name / f"{kind}.json").write_text(json.dumps(document))
    for name in ("schema.json", "README.md"):
        shutil.copy(data_folder() / name, tmp_path / name)
    write_manifest(tmp_path)
    return tmp_path


def test_proofs_are_written_as_stored(folder: Path) -> None:
    assert main(["reference", "prove", "--data", str(folder), "--jobs", "1", "--quiet"]) == 0
    for name in ("printed", "calibrated"):
        for kind in ("equilibrium", "hopf"):
            mine = json.loads((folder / name / f"{kind}.json").read_text())
            assert mine == json.loads((data_folder() / name / f"{kind}.json").read_text())
    assert check(folder, sample=0).faults == ()
    assert not (folder / ".work").exists()


def test_a_wrong_value_is_not_proved(folder: Path) -> None:
    path = folder / "printed" / "hopf.json"
    text = path.read_text()
    path.write_text(text.replace("30.886592688643567278286", "30.886592688643567278287"))
    assert path.read_text() != text
    write_manifest(folder)
    before = {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    with pytest.raises(Shortfall, match="omega_crit does not contain its enclosure"):
        prove(folder)
    assert {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()} == before


def test_a_value_that_claims_more_than_is_proved_is_not_proved(folder: Path) -> None:
    """The value as it should be, with a half-width of 1e-60 where some 52 digits are proved."""
    path = folder / "printed" / "hopf.json"
    document = json.loads(path.read_text())
    (entry,) = document["entries"]
    entry["quantities"]["period"]["uncertainty"] = "1e-60"
    path.write_text(json.dumps(document))
    write_manifest(folder)
    with pytest.raises(Shortfall, match="period does not contain its enclosure"):
        prove(folder, prefixes=("printed/linear/hopf",))


def test_check_sees_a_value_that_claims_more_than_is_proved(folder: Path) -> None:
    """The enclosure still holds the value, and reaches further than the value's half-width."""
    prove(folder, prefixes=("printed/linear/hopf",))
    path = folder / "printed" / "hopf.json"
    document = json.loads(path.read_text())
    (entry,) = document["entries"]
    entry["quantities"]["period"]["enclosure"]["uncertainty"] = "1e-40"
    path.write_text(json.dumps(document))
    write_manifest(folder)
    faults = check(folder, sample=0).faults
    assert faults == ("printed/linear/hopf/point/period does not contain its proved enclosure",)


def test_check_sees_a_value_outside_its_enclosure(folder: Path) -> None:
    prove(folder, prefixes=("printed/linear/hopf",))
    assert {q.grade for q in Store(folder).matching("printed/linear/hopf")} == {"proved"}
    path = folder / "printed" / "hopf.json"
    start = '"enclosure": {"value": "30.88659268864356727828'
    text = path.read_text()
    assert text.count(f"{start}6") == 1
    path.write_text(text.replace(f"{start}6", f"{start}7"))
    write_manifest(folder)
    assert any("omega_crit does not contain its proved" in fault for fault in check(folder, sample=0).faults)


def test_refusals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match="no proof is offered"):
        proved_entry({"id": "printed/smooth/rotating-cycle/stable-het-0.01", "inputs": {}, "quantities": {}})
    assert main(["reference", "prove", "--data", str(tmp_path / "none")]) == 2
    assert "needs a folder" in capsys.readouterr().err
    assert main(["reference", "prove", "--data", str(tmp_path)]) == 2
    assert "nothing there can be proved" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("place", ["limit-cycle/crit-0.5", "heteroclinic/point"])
def test_a_proof_is_found_again(place: str) -> None:
    """A minute for Omega_h to 104 digits; what is proved anew must be contained as what is stored is."""
    document = json.loads((data_folder() / "printed" / f"{place.partition('/')[0]}.json").read_text())
    entry = next(entry for entry in document["entries"] if entry["id"] == f"printed/linear/{place}")
    proof = proved_entry(entry)
    assert entry["proof"] == {"statement": proof.statement, "command": f"tippedisk-verify {proof.command}"}
    for name, enclosure in proof.enclosures.items():
        assert entry["quantities"][name]["enclosure"] == enclosure.to_dict()
        assert stored()[f"{entry['id']}/{name}"].measured().contains(enclosure)
