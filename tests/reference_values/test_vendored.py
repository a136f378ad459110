"""The parts that others vendor: version, tables, exports, definitions and citation."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy
import pytest

import tippedisk_verify as tv
from reference_data.make.generation import DATA_VERSION
from tests.command_line import answer, printed
from tippedisk_verify.reference_values.export import write_values
from tippedisk_verify.reference_values.grading_rules import VALUES_COLUMNS
from tippedisk_verify.reference_values.store import (
    data_folder,
    definition_of,
    load_store,
    parse_values_csv,
    quantity_definitions,
)
from tippedisk_verify.support.provenance import digest

ROOT = Path(__file__).parents[2]
DATA = data_folder()


# ---------------------------------------------------------------------------- version and citation
def test_the_version_of_the_data_is_the_same_everywhere() -> None:
    manifest = json.loads((DATA / "manifest.json").read_text())
    assert manifest["data_version"] == DATA_VERSION
    assert (
        re.findall(r"^## (\S+)$", (DATA / "CHANGELOG.md").read_text(), re.MULTILINE)[0]
        == DATA_VERSION
    )
    assert f"\nversion: {DATA_VERSION}\n" in (DATA / "CITATION.cff").read_text()
    assert printed("reference list table1/linear/hopf").splitlines()[:2] == [
        f"# reference data {DATA_VERSION}",
        "table1/linear/hopf/point/omega_crit",
    ]
    assert answer("reference list table1/linear/hopf")["data_version"] == DATA_VERSION


def test_values_change_with_their_version() -> None:
    """Compare with the values of version 1.0.1.

    If this fails, values have changed: raise the version, and put the new hash here.
    """
    values = {id_: quantity.values["decimals"][0] for id_, quantity in load_store().items()}
    assert (DATA_VERSION, digest(values)[:16]) == ("2.0.0", "287c815a349ae66b")


# --------------------------------------------------------------------------------------- the table
def test_the_schema_is_that_of_the_table() -> None:
    """The table schema follows the Frictionless standard: each column, with the pattern of its
    entries.
    """
    fields = json.loads((DATA / "schema.json").read_text())["fields"]
    assert tuple(field["name"] for field in fields) == VALUES_COLUMNS
    patterns = {
        one["name"]: re.compile(one.get("constraints", {}).get("pattern", ".*")) for one in fields
    }
    required = {one["name"] for one in fields if one.get("constraints", {}).get("required")}
    for row in parse_values_csv((DATA / "values.csv").read_text()):
        for name, text in row.items():
            assert patterns[name].fullmatch(text) if text else name not in required, (
                row["id"],
                name,
            )
    assert '"' not in (DATA / "values.csv").read_text()  # no field needs quotes


# ------------------------------------------------------------------------------------- other forms
@pytest.mark.parametrize("form", ["csv", "jsonl", "parquet"])
def test_exported_values_are_the_stored_ones(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"hopf.{form}"
    words = f"reference export table1/linear/hopf --format {form} --out {path}"
    assert printed(words) == f"{path}\n"
    known = tv.references("table1/linear/hopf")
    if form == "jsonl":
        assert [json.loads(line) for line in path.read_text().splitlines()] == [
            one.to_dict() for one in known
        ]
    elif form == "csv":
        lines = (DATA / "values.csv").read_text().splitlines()
        assert path.read_text().splitlines() == [
            lines[0],
            *(line for line in lines if "table1/linear/hopf" in line),
        ]
    else:
        import pyarrow.parquet

        columns = pyarrow.parquet.read_table(path).to_pydict()
        assert columns["value_from_decimals"] == [one.values["decimals"][0] for one in known]


_USES = {
    "c": """#include <stdio.h>
#include "values.h"
#include "more.h"
int main(void) { for (int n = 0; n < 5; n++) printf("%s %a %a\\n", tippedisk_values[n].id,
  tippedisk_values[n].Omega, tippedisk_values[n].value); return 0; }
""",
    "fortran": """include 'values.h'
program main
  use tippedisk_values
  integer :: n
  do n = 1, 5
    print '(a, 2(1x, es25.17e3))', trim(values(n)%id), values(n)%Omega, values(n)%value
  end do
end program
""",
    "octave": """source values.h
for n = 1:5, q = tippedisk_values(n); printf('%s %.17g %.17g\\n', q.id, q.Omega, q.value); end
""",
}


def _output(language: str, source: str, folder: Path, *arguments: object) -> list[str]:
    """Return the words that a program in a language prints, run in a folder."""
    compiler, suffix = {
        "c": ("gcc -std=c99 -Wall -Werror -o use", "c"),
        "fortran": ("gfortran -o use", "f90"),
        "octave": ("octave-cli --quiet", "m"),
    }[language]
    command = [*compiler.split(), f"use.{suffix}"]
    if shutil.which(command[0]) is None:
        pytest.skip(f"no {command[0]} here")
    (folder / command[-1]).write_text(source)
    if "-o" in command:
        subprocess.run(command, check=True, cwd=folder)
        command = ["./use"]
    done = subprocess.run(
        [*command, *map(str, arguments)], check=True, cwd=folder, capture_output=True, text=True
    )
    return done.stdout.split()


@pytest.mark.parametrize("form", _USES)
def test_a_test_file_is_a_program_s(form: str, tmp_path: Path) -> None:
    known = tv.references("table1/linear/rhs/001")
    for name in ("values.h", "more.h"):
        write_values(known, form, str(tmp_path / name))
    words = _output(form, _USES[form], tmp_path)
    number = float.fromhex if form == "c" else float
    assert words[::3] == [quantity.id for quantity in known]
    assert [*map(number, words[1::3])] == [float(quantity.inputs["Omega"]) for quantity in known]
    assert [*map(number, words[2::3])] == [quantity.for_doubles for quantity in known]


def test_a_julia_test_file_has_the_doubles(tmp_path: Path) -> None:
    write_values(
        tv.references("table1/linear/limit-cycle/crit-0.5"), "julia", str(tmp_path / "values.jl")
    )
    rows = re.findall(
        r'id = "(\S+)".* value = (\S+), tolerance = (\S+)\)', (tmp_path / "values.jl").read_text()
    )
    assert len(rows) == 10
    write_values(
        tv.references("table1/linear/slow-manifold/01/"), "julia", str(tmp_path / "values.jl")
    )
    orders = re.findall(
        r'quantity = "h_(\d)".* order = (\d)\.0, ', (tmp_path / "values.jl").read_text()
    )
    assert orders == [(str(n), str(n)) for n in range(6)]
    for id_, value, tolerance in rows:
        assert float(value) == tv.reference(id_).for_doubles
        # An answer that far off is the first that fails.
        assert not tv.compare(id_, float(value) + 0.9 * float(tolerance)).failed
        assert tv.compare(id_, float(value) + 1.1 * float(tolerance)).failed


# ----------------------------------------------------------------------------- without the package


@pytest.mark.parametrize("library", ["duckdb", "pandas", "polars"])
def test_the_lines_of_the_datas_page_read_every_digit(
    library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = pytest.importorskip(library)
    page = (ROOT / "docs" / "reference" / "data.md").read_text(encoding="utf-8")
    (line,) = re.findall(rf"^{library}\..*$", page, re.MULTILINE)
    monkeypatch.chdir(DATA)
    table = eval(line, {library: module})
    with open(DATA / "values.csv", encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    for name in ("id", "Omega", "value_from_doubles", "uncertainty_from_decimals"):
        cells = numpy.ma.filled(table[name], "")  # an empty cell is masked, NaN or None
        read = ["" if cell is None or cell != cell else cell for cell in cells]
        assert read == [row[name] for row in rows]


@pytest.mark.parametrize("language", ["c", pytest.param("octave", marks=pytest.mark.slow)])
def test_the_programs_of_the_readme(language: str, tmp_path: Path) -> None:
    (program,) = re.findall(
        rf"```{language}\n(.*?)```", (DATA / "README.md").read_text(), re.DOTALL
    )
    done = _output(language, program, tmp_path, DATA / "values.csv")
    if language == "c":
        assert dict(zip(done[::2], map(float, done[1::2]), strict=True)) == {
            id_: tv.reference(id_).for_doubles for id_ in load_store() if id_.endswith("/omega_h")
        }
        return
    assert len(done) == 3 * 10 + 5
    # Some fifty roundings of terms that are up to a hundred times the sum
    assert all(abs(float(away)) < 50 * 100 * 2.0**-53 for away in done[2:30:3])
    # The solver's tolerance is 1e-13 a step, for some hundred steps.
    assert abs(float(done[-1])) < 1e-11


# ------------------------------------------------------------------------------------- definitions
def test_every_quantity_is_defined_where_it_is_shown() -> None:
    page = (ROOT / "docs" / "grading_equations.md").read_text(encoding="utf-8")
    for quantity in load_store().values():
        definition = definition_of(quantity.kind, quantity.name)
        assert (definition.level, definition.unit) == (quantity.level, quantity.unit)
        assert quantity.definition == definition.meaning != ""
    assert ":file: ../reference_data/quantities.csv\n" in page
    id_ = "table1/linear/trajectory/d1/crossing_time#3"
    assert "time of the n-th crossing of beta = pi/2" in printed(f"reference show {id_}")
    (one,) = answer(f"reference show {id_}")["values"]
    assert one["definition"] == quantity_definitions()["trajectory"]["crossing_time"].meaning


def test_the_one_harmonic_law_is_the_documents() -> None:
    """Read both forms from the formulas in docs/grading_equations.md."""
    page = (ROOT / "docs" / "grading_equations.md").read_text(encoding="utf-8")
    law = page.split("### The one-harmonic law")[1].split("\n## ")[0]
    displayed = re.findall(r"\$\$(.*?)\$\$", law, re.DOTALL)
    parts = [part.strip(" \n,.") for block in displayed for part in block.split(r"\qquad")]
    formulas = [tuple(side.strip() for side in part.split(" =")) for part in parts]
    assert [name for name, _ in formulas] == [
        "C^2",
        "T",
        r"\omega^2",
        r"\chi",
        r"\delta",
        r"\chi",
        r"\delta",
    ]

    def value(text: str, names: dict[str, float]) -> float:
        """Of a formula in LaTeX: fractions, powers, products."""
        text = (
            text.replace(r"\bar B", "Bbar")
            .replace("C^2", "C2")
            .replace(r"\,", " ")
            .replace("^", "**")
        )
        while r"\frac" in text:
            text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1) / (\2))", text)
        text = " ".join(text.replace("\\", "").split())
        return float(eval(re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", text), dict(names)))

    for form, (chi, delta) in {"printed": formulas[3:5], "consistent": formulas[5:7]}.items():
        for quantity in tv.references(f"table1/linear/harmonic-balance/{form}"):
            p = {name: float(text) for name, text in tv.PRINTED.decimals().items()}
            p |= {"Omega": float(quantity.inputs["Omega"]), "Bbar": p["B"] - p["m"] * p["e"] ** 2}
            p |= {"chi": value(chi[1], p), "delta": value(delta[1], p)}
            p["C2"] = value(formulas[0][1], p)
            omega = value(formulas[2][1], p) ** 0.5
            mine = {
                "amplitude": p["C2"] ** 0.5,
                "frequency": omega,
                "period": 2 * 3.141592653589793 / omega,
            }
            # Close to Omega_crit the numerator of C^2 cancels to 1e-5 of its terms; a dozen
            # roundings remain elsewhere.
            assert mine[quantity.name] == pytest.approx(quantity.for_doubles, rel=1e-10)
