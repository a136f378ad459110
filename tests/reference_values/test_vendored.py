"""What others vendor: the data's version, tables and lines that follow from the values, definitions, how to cite."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import tippedisk_verify as tv
from tippedisk_verify.cli import main
from tippedisk_verify.provenance import digest
from tippedisk_verify.reference_values.checking import check
from tippedisk_verify.reference_values.definitions import DEFINITIONS, definition
from tippedisk_verify.reference_values.kinds import KINDS
from tippedisk_verify.reference_values.manifest import (
    DATA_VERSION,
    STATIC,
    faults_in_files,
    replace_files,
    write_manifest,
)
from tippedisk_verify.reference_values.store import data_folder, stored
from tippedisk_verify.reference_values.tables import tables

ROOT = Path(__file__).parents[2]
DATA = data_folder()


# ------------------------------------------------------------------------------------------ version and citation
def test_the_version_of_the_data_is_the_same_everywhere(capsys: pytest.CaptureFixture[str]) -> None:
    manifest = json.loads((DATA / "manifest.json").read_text())
    assert manifest["data_version"] == DATA_VERSION
    assert re.findall(r"^## (\S+)$", (DATA / "CHANGELOG.md").read_text(), re.MULTILINE)[0] == DATA_VERSION
    assert f"\nversion: {DATA_VERSION}\n" in (DATA / "CITATION.cff").read_text()
    assert main(["reference", "list", "printed/linear/hopf"]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        f"# reference data {DATA_VERSION}", "printed/linear/hopf/point/omega_crit"
    ]  # fmt: skip
    assert main(["reference", "list", "printed/linear/hopf", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["data_version"] == DATA_VERSION


def test_values_change_with_their_version() -> None:
    """Of version 1.0.1. Where this fails, values were changed: raise the version, say so, and put the new hash here."""
    values = {id_: quantity.values["decimals"][0] for id_, quantity in stored().items()}
    assert (DATA_VERSION, digest(values)[:16]) == ("1.0.1", "cc4c134dac3c7d25")


def test_what_a_deposit_asks_for() -> None:
    deposit = json.loads((ROOT / ".zenodo.json").read_text())
    assert {"title", "description", "upload_type", "creators", "license", "access_right"} <= deposit.keys()
    assert (DATA / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    assert deposit["license"] == json.loads((DATA / "manifest.json").read_text())["license"] == "MIT"
    for path in (ROOT / "CITATION.cff", DATA / "CITATION.cff"):
        text = path.read_text()
        for key in ("cff-version: 1.2.0", "message:", "title:", "authors:", "license: MIT", "type:"):
            assert re.search(rf"^{key}", text, re.MULTILINE), (path, key)


# ------------------------------------------------------------------------------------------ tables and lines
def test_the_lines_say_what_the_files_say() -> None:
    store, seen = stored(), []
    for path in sorted(DATA.glob("*/values.jsonl")):
        for line in path.read_text().splitlines():
            told = json.loads(line)
            quantity = store[told["id"]]
            assert (told["value"], told["uncertainty"]) == quantity.values["decimals"]
            if "from_doubles" in told:
                assert tuple(told["from_doubles"].values()) == quantity.values["doubles"]
            assert (told["inputs"], told["unit"], told["grade"]) == (quantity.inputs, quantity.unit, quantity.grade)
            seen.append(told["id"])
    assert sorted(seen) == sorted(store)


def test_tables_are_made_anew_and_checked(tmp_path: Path) -> None:
    (tmp_path / "printed").mkdir()
    for name in ("printed/hopf.json", "printed/equilibrium.json", *STATIC):
        (tmp_path / name).write_bytes((DATA / name).read_bytes())
    write_manifest(tmp_path)
    assert "does not hold the same numbers" in " ".join(check(tmp_path, sample=0).faults)
    documents = [json.loads((tmp_path / f"printed/{kind}.json").read_text()) for kind in ("equilibrium", "hopf")]
    made = tables(documents)
    assert made.keys() == {"values.csv", "values.jsonl", "sheet_with_truths.csv"}
    replace_files(tmp_path, {f"printed/{name}": text for name, text in made.items()})
    assert check(tmp_path, sample=2).faults == ()
    lines = (tmp_path / "printed/values.jsonl").read_text().splitlines()
    assert lines == [line for line in (DATA / "printed/values.jsonl").read_text().splitlines()
                     if "/hopf/" in line[:40] or "/equilibrium/" in line[:40]]  # fmt: skip
    assert faults_in_files(DATA) == []


# ------------------------------------------------------------------------------------------ definitions
def test_every_quantity_is_defined_where_it_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "grading_equations.md").read_text(encoding="utf-8")
    for quantity in stored().values():
        assert definition(quantity.kind, quantity.name)
    for kind in KINDS:
        if kind.level < 10:
            for name, said in DEFINITIONS[kind.name].items():
                assert re.search(rf"\| `{name}` \| [^|]* \| {re.escape(said)} \|", page), (kind.name, name)
    id_ = "printed/linear/trajectory/d1/crossing_time#3"
    assert main(["reference", "show", id_]) == 0
    printed = capsys.readouterr().out
    assert "time of the n-th crossing of beta = pi/2" in printed
    assert main(["reference", "show", id_, "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["values"]
    assert one["definition"] == DEFINITIONS["trajectory"]["crossing_time"]


def test_the_one_harmonic_law_is_the_documents() -> None:
    """Both forms by the formulas of docs/grading_equations.md, which are read from there."""
    page = (ROOT / "docs" / "grading_equations.md").read_text(encoding="utf-8")
    law = page.split("### The one-harmonic law")[1].split("\n## ")[0]
    displayed = re.findall(r"\$\$(.*?)\$\$", law, re.DOTALL)
    parts = [part.strip(" \n,.") for block in displayed for part in block.split(r"\qquad")]
    formulas = [tuple(side.strip() for side in part.split(" =")) for part in parts]
    assert [name for name, _ in formulas] == ["C^2", "T", r"\omega^2", r"\chi", r"\delta", r"\chi", r"\delta"]

    def value(text: str, names: dict[str, float]) -> float:
        """Of a formula in LaTeX: fractions, powers, products."""
        text = text.replace(r"\bar B", "Bbar").replace("C^2", "C2").replace(r"\,", " ").replace("^", "**")
        while r"\frac" in text:
            text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1) / (\2))", text)
        text = " ".join(text.replace("\\", "").split())
        return float(eval(re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", text), dict(names)))

    for form, (chi, delta) in {"printed": formulas[3:5], "consistent": formulas[5:7]}.items():
        for quantity in tv.references(f"printed/linear/harmonic-balance/{form}"):
            p = {name: float(text) for name, text in tv.PRINTED.decimals().items()}
            p |= {"Omega": float(quantity.inputs["Omega"]), "Bbar": p["B"] - p["m"] * p["e"] ** 2}
            p |= {"chi": value(chi[1], p), "delta": value(delta[1], p)}
            p["C2"] = value(formulas[0][1], p)
            omega = value(formulas[2][1], p) ** 0.5
            mine = {"amplitude": p["C2"] ** 0.5, "frequency": omega, "period": 2 * 3.141592653589793 / omega}
            # Close to Omega_crit the numerator of C^2 cancels to 1e-5 of its terms; a dozen roundings remain elsewhere.
            assert mine[quantity.name] == pytest.approx(quantity.for_doubles, rel=1e-10)
