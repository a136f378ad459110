"""The reference data: complete, of the published form, derived twice, and honest."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import mpmath
import pytest

import tippedisk_verify as tv
from reference_data.make.generation import write_manifest
from tests.command_line import answer, printed
from tests.problems import paper_rates, paper_terms
from tippedisk_verify import Disk, InputError, Parameters, ScipyEngine, exact, reference
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.numbers.exact import rational_in_context
from tippedisk_verify.reference_values.checking import (
    StoredEntry,
    check,
    recompute_and_compare,
    stored_entries,
)
from tippedisk_verify.reference_values.entries import case_of, disk_in_doubles
from tippedisk_verify.reference_values.manifest import faults_in_files
from tippedisk_verify.reference_values.store import (
    Store,
    data_folder,
    parse_values_csv,
)
from tippedisk_verify.reference_values.truths import shoot_known_cycle

SETS = ("table1", "calibrated")


# ---------------------------------------------------------------------------------------- contents
@pytest.mark.slow
def test_the_files_are_those_of_the_manifest_and_of_the_form_of_the_schema() -> None:
    report = check(data_folder(), sample=0)
    assert report.faults == ()
    assert report.numbers > 20_000


def test_numbers_have_34_digits_and_omega_h_100_by_two_methods(store: Store) -> None:
    for quantity in store.values():
        for reading in quantity.values:
            measured = quantity.measured(reading)
            # An angle is known to 34 digits of a radian even where it is nearly zero.
            size = max(
                abs(measured.value), Fraction(1) if quantity.kind == "trajectory" else Fraction(0)
            )
            digits = 100 if quantity.name == "omega_h" else 34
            assert measured.uncertainty <= size / 10**digits, (quantity.id, reading)
        assert quantity.grade != "single", quantity.id
        assert len(quantity.methods) > 1, quantity.id


def test_hexadecimal_numbers_are_the_doubles_nearest_to_the_decimals(store: Store) -> None:
    seen, numbers = 0, {}
    for row in parse_values_csv((data_folder() / "values.csv").read_text()):
        numbers[row["set"]] = tuple(row[symbol] for symbol in SYMBOLS)
        for name in (*SYMBOLS, "Omega", "beta", "gamma", "v", "t"):
            if row["value_from_doubles"] and row[name]:
                assert float.fromhex(row[f"{name}_hex"]) == float(row[name])
                seen += 1
            else:
                assert not row[f"{name}_hex"]
    assert seen > 100_000
    for name in SETS:
        disk = Disk(name)
        assert numbers.pop(name) == tuple(disk.decimals()[symbol] for symbol in SYMBOLS)
        assert all(
            getattr(disk_in_doubles(disk), symbol) == float(getattr(disk, symbol))
            for symbol in SYMBOLS
        )


# ------------------------------------------------------------------------------------------ values
@pytest.mark.parametrize("name", SETS)
def test_the_right_hand_side_is_that_of_the_tests_own_transcription(
    name: str, store: Store
) -> None:
    with mpmath.workdps(70):
        for n in (1, 40, 77, 110, 200):
            quantity = store[f"{name}/linear/rhs/{n:03d}/v_rate"]
            beta, gamma, v, omega = (
                Fraction(quantity.inputs[symbol]) for symbol in ("beta", "gamma", "v", "Omega")
            )
            state = tuple(
                mpmath.mpf(part.numerator) / part.denominator for part in (beta, gamma, v)
            )
            disk = Parameters.named(name)
            rate = paper_rates(disk, omega, state)[2]
            assert quantity.measured().holds(rate)
            terms = paper_terms(disk, rational_in_context(mpmath.mp, omega), state).gyroscopic
            for k, term in enumerate(terms, start=1):
                assert store[f"{name}/both/rhs/{n:03d}/h_{k}"].measured().holds(term)
            assert store[f"{name}/both/rhs/{n:03d}/Bbar"].measured().holds(disk.Bbar)


@pytest.mark.slow
def test_what_rounding_to_doubles_does_is_what_the_condition_numbers_say(store: Store) -> None:
    """Compare two independent parts of each entry: the value from doubles, and the slopes in its
    inputs.
    """
    shifts: dict[tuple[str, str], dict[str, Fraction]] = {}
    for quantity in store.values():
        if "doubles" not in quantity.values:
            continue
        key = (quantity.set, json.dumps(dict(quantity.inputs)))
        if key not in shifts:
            inputs = {**store.parameters[quantity.set], **quantity.inputs}
            shifts[key] = {}
            for symbol, text in inputs.items():
                try:
                    value = Fraction(text)
                except ValueError:
                    continue
                shifts[key][symbol] = Fraction(float(value)) / value - 1 if value else Fraction(0)
        moved = quantity.measured("doubles").value - quantity.measured("decimals").value
        parts = [
            exact(slope).rational * shifts[key][symbol]
            for symbol, slope in quantity.condition.items()
        ]
        # The slopes have two or three digits, and near the connection only the leading term.
        size = sum(abs(part) for part in parts)
        noise = max(abs(quantity.measured().value), 1) / Fraction(10) ** 21
        assert abs(moved - sum(parts)) <= size / 10 + noise, quantity.id


# ---------------------------------------------------------------------------------- computed again
@pytest.mark.parametrize(
    ("kind", "entries"),
    [
        *((kind, 6) for kind in ("rhs", "equilibrium", "hopf", "harmonic-balance")),
        ("slow-manifold", 6),
        *(
            pytest.param(kind, 1, marks=pytest.mark.slow)
            for kind in ("trajectory", "limit-cycle", "rotating-cycle")
        ),
    ],
)
def test_computed_again_they_agree(kind: str, entries: int, store: Store) -> None:
    known = [stored for stored in stored_entries(store) if stored.entry.kind == kind]
    for stored in random.Random(7).sample(known, min(entries, len(known))):
        count, faults = recompute_and_compare(stored)
        assert faults == []
        assert count == len(stored.reference_values) * len(stored.entry.readings)


@pytest.mark.parametrize("id_", ["limit-cycle/crit-0.5", "rotating-cycle/unstable-crit+0.5"])
def test_a_cycle_is_shot_for_from_its_numbers(id_: str, store: Store) -> None:
    (stored,) = stored_entries(store, f"table1/linear/{id_}/")
    case, values = (
        case_of(stored.entry, "decimals"),
        {q.name: float(q) for q in stored.reference_values},
    )
    found = shoot_known_cycle(case, values, ScipyEngine())
    names = found.return_map.section.coordinate_names
    # SciPy's tolerance is 1e-13
    assert found.point == pytest.approx([values[name] for name in names], rel=1e-10)


def test_a_false_digit_is_found(store: Store) -> None:
    (stored,) = stored_entries(store, "table1/linear/hopf/")
    changed = []
    for quantity in stored.reference_values:
        value, uncertainty = quantity.values["decimals"]
        if quantity.name == "period_slope":
            value = value[:30] + str((int(value[30]) + 5) % 10) + value[31:]
        changed.append(
            replace(quantity, values={**quantity.values, "decimals": (value, uncertainty)})
        )
    _, faults = recompute_and_compare(StoredEntry(stored.entry, tuple(changed)))
    assert len(faults) == 1
    assert "period_slope" in faults[0]


# ------------------------------------------------------------------------------------------ damage
def test_a_manifest_that_points_elsewhere_reads_nothing(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("x")
    content = json.loads((folder / "manifest.json").read_text())
    content["files"]["../secret"] = content["files"]["LICENSE"]
    (folder / "manifest.json").write_text(json.dumps(content))
    # The secret is not mentioned
    assert faults_in_files(folder) == ["manifest.json has been changed"]


def test_rows_that_contradict_themselves_are_reported(folder: Path) -> None:
    """The manifest fits the files, so only the rows show the damage."""
    text = (folder / "values.csv").read_text()
    faults = {
        ",10.0,3.13e-19,": (
            ",9.0,3.13e-19,",
            "digits_needed does not follow from the other columns",
        ),
        "0x1.d1da5119ce076p+4": ("0x1.d1da5119ce077p+4", "Omega_hex does not"),
        "30.8865926886435672782860900151017816823": (
            "30.8865926886435672782860900151017816824",
            "proved enclosure",
        ),
    }
    for old, (new, _) in faults.items():
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "values.csv").write_text(text)
    write_manifest(folder)
    reported = check(folder, sample=0).faults
    assert all(any(text in fault for fault in reported) for _, text in faults.values())


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("proofs.json", "[" * 100_000),
        ("proofs.json", "5"),
        ("values.csv", "\udcff"),
        ("values.csv", "id,level\n,"),
    ],
)
def test_forged_folders_are_reported(name: str, content: str, folder: Path) -> None:
    """A manifest that fits damaged files is forged; the check must give lines, not tracebacks."""
    (folder / name).write_bytes(content.encode(errors="surrogateescape"))
    write_manifest(folder)
    assert check(folder, sample=0).faults
    with pytest.raises(InputError):
        Store(folder)


# ----------------------------------------------------------------------------------------- reading
def test_a_value_by_its_id() -> None:
    quantity = reference("table1/linear/hopf/point/omega_crit")
    assert quantity == reference("table1/linear/hopf/point/omega_crit")
    assert quantity.unit == "rad/s"
    assert float(quantity) == pytest.approx(30.8866, abs=1e-4)  # a look at the leading digits
    assert (quantity.real, quantity.imag) == (float(quantity), 0)
    with pytest.raises(InputError, match="no value from doubles"):
        reference("table1/linear/near-heteroclinic/het+1e-30/period").measured("doubles")


@pytest.mark.parametrize(
    ("id_", "beginning"),
    [
        ("table1/linear/limit-cycle/crit-0.5/perod", "table1/linear/limit-cycle/crit-0.5/"),
        ("table1/linear/limit-cycle/crit-9/period", "table1/linear/limit-cycle/"),
        ("calibrated/smooth/hopf/point/omega_h", "calibrated/smooth/"),
        ("table1/linear/limit-cycle/crit-0.5", "table1/linear/limit-cycle/crit-0.5/"),
    ],
)
def test_suggested_ids_share_the_beginning_of_a_wrong_one(id_: str, beginning: str) -> None:
    with pytest.raises(InputError) as fault:
        reference(id_)
    suggested = str(fault.value).partition("did you mean ")[2].rstrip("?").split(" or ")
    assert 1 < len(suggested) <= 5
    assert all(one.startswith(beginning) for one in suggested)


def test_the_commands(folder: Path) -> None:
    ids = answer("reference list table1/linear/hopf")["ids"]
    assert "table1/linear/hopf/point/period" in ids
    shown = answer(f"reference show {ids[0]}")["values"][0]
    assert Decimal(shown["uncertainty"]) < Decimal("1e-40")  # as many digits are published
    assert "from doubles" in printed(f"reference show {ids[0]}")
    assert answer(f"reference check --data {folder} --sample 1 --jobs 1")["faults"] == []


def test_ids_of_versions_before_2_are_taken_and_answered_with_the_new_ones(
    tmp_path: Path,
) -> None:
    new = "table1/linear/hopf/point/omega_crit"
    old = new.replace("table1", "printed")
    truth = tv.reference(old)
    assert truth.id == new
    assert tv.compare(old, float(truth)).id == new
    assert {quantity.id for quantity in tv.references("printed/linear/hopf/point/omega")} == {new}
    (grade,) = tv.grade({old: float(truth)}).grades
    assert (grade.id, grade.verdict) == (new, "exact")
    sheet = tmp_path / "answers.csv"
    sheet.write_text(f"id,answer\n{old},{float(truth)!r}\n")
    assert answer(f"conformance grade {sheet}")["grades"][0]["id"] == new
    printed(f"conformance questions {tmp_path / 'sheet.csv'} --set printed --levels 3")
    assert "printed/" not in (tmp_path / "sheet.csv").read_text()
