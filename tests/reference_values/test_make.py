"""The making of the reference data: methods that agree with the values, interrupted runs, and
proofs, which no claim exceeds.
"""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from reference_data.make.generation import _computed, entries_of, generate
from reference_data.make.proofs import proved
from reference_data.make.recipes import CONFIRM, confirmed, methods_of
from tests.reference_values.places import PLACES
from tests.stress.runs import MAKE
from tippedisk_verify import AccuracyError, Measured
from tippedisk_verify.reference_values.checking import check, stored_entries
from tippedisk_verify.reference_values.entries import case_of
from tippedisk_verify.reference_values.store import (
    Store,
    data_folder,
    load_store,
    quantity_definitions,
)

SETS = ("table1", "calibrated")
INTEGRATED = ("trajectory", "near-heteroclinic", "rotating-cycle")
HOPF = ("table1/linear/hopf", "calibrated/linear/hopf")
QUICK = tuple(
    f"calibrated/{kind}" for kind in ("both/equilibrium/", "linear/hopf", "linear/harmonic")
)


def _bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


# --------------------------------------------------------------------------- questions and methods
def test_each_kind_has_the_methods_of_the_table() -> None:
    assert list(CONFIRM) == list(quantity_definitions())
    for kind, methods in CONFIRM.items():
        assert list(methods_of(kind))[1:] == list(methods)
    for quantity in load_store().values():
        assert set(quantity.methods) <= set(methods_of(quantity.kind))


@pytest.mark.parametrize(
    "kind",
    [
        kind if kind not in INTEGRATED else pytest.param(kind, marks=pytest.mark.slow)
        for kind in PLACES
    ],
)
def test_questions_are_where_the_rules_put_them(kind: str) -> None:
    for name in SETS:
        stored_items = [
            stored.entry
            for stored in stored_entries(load_store(), f"{name}/")
            if stored.entry.kind == kind
        ]
        assert [(one.id, dict(one.inputs), one.readings) for one in PLACES[kind](name)] == [
            (one.id, dict(one.inputs), one.readings) for one in stored_items
        ]


def test_the_further_methods_agree() -> None:
    for kind in ("rhs", "equilibrium", "hopf", "harmonic-balance", "slow-manifold"):
        entries = [stored for stored in stored_entries(load_store()) if stored.entry.kind == kind]
        stored = random.Random(7).choice(entries)
        answers = confirmed(case_of(stored.entry, "doubles"), stored.values("doubles"))
        assert any(answers.values()) or stored.entry.friction == "both"


@pytest.mark.slow(minutes=0.5)
@pytest.mark.parametrize(
    "id_", ["calibrated/linear/limit-cycle/crit-0.3", "table1/linear/rotation-fold/point"]
)
def test_the_further_methods_agree_where_integrators_are_needed(id_: str) -> None:
    (stored,) = stored_entries(load_store(), f"{id_}/")
    answers = confirmed(case_of(stored.entry, "decimals"), stored.values("decimals"))
    assert set(answers) == set(CONFIRM[stored.entry.kind])


@pytest.mark.parametrize(
    ("id_", "reading", "name", "false", "by"),
    [
        (HOPF[0], "decimals", "omega_crit", lambda true: Measured.of("30.9", "0.001"), "balance"),
        # the thirtieth digit, from another section
        pytest.param(
            *("calibrated/smooth/rotating-cycle/unstable-crit-0.5", "doubles", "v_top"),
            lambda true: Measured(true.value * (1 + Fraction(1, 10**30)), true.uncertainty),
            "bottom",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_false_value_is_excluded_by_another_method(
    id_: str, reading: str, name: str, false: Callable[[Measured], Measured], by: str
) -> None:
    (stored,) = stored_entries(load_store(), f"{id_}/")
    values = stored.values(reading)
    values[name] = false(values[name])
    with pytest.raises(AccuracyError, match=f"by {by}: {name}"):
        confirmed(case_of(stored.entry, reading), values)


# -------------------------------------------------------------------------------------------- runs
def test_what_is_made_is_what_is_stored(tmp_path: Path) -> None:
    """Compare to the half-widths, because the last digits depend on the libraries."""
    assert generate(tmp_path, QUICK) == 25
    made = Store(tmp_path)
    assert list(made) == [id_ for id_ in load_store() if id_.startswith(QUICK)]
    for id_, quantity in made.items():
        known = load_store()[id_]
        assert (quantity.unit, quantity.inputs, quantity.grade) == (
            known.unit,
            known.inputs,
            known.grade,
        )
        for reading in ("decimals", "doubles"):
            one, other = quantity.measured(reading), known.measured(reading)
            assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty
    assert check(tmp_path, sample=0).faults == ()


def test_threads_and_parts_make_the_same_bytes(tmp_path: Path) -> None:
    prefixes = (*HOPF, "table1/both/equilibrium/inverted-30.4")
    with ThreadPoolExecutor(8) as pool:
        generate(tmp_path / "threads", prefixes, pool)
    for prefix in reversed(prefixes):
        generate(tmp_path / "parts", (prefix,))
    assert _bytes(tmp_path / "parts") == _bytes(tmp_path / "threads")


def test_a_process_with_other_code_computes_no_entry(tmp_path: Path) -> None:
    (entry,) = entries_of(HOPF[:1])
    with pytest.raises(AccuracyError, match="has changed"):
        _computed((entry, tmp_path, "other code"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("left", ['[{"id": "pri', "[5]", "[" * 100_000])
def test_damaged_answers_are_computed_again(
    left: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    generate(tmp_path / "whole", HOPF)
    work = tmp_path / "other" / ".work"
    with monkeypatch.context() as patch:
        patch.setattr("reference_data.make.generation.replace_files", lambda folder, texts: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            generate(tmp_path / "other", HOPF)
    kept = list(work.glob("*.json"))
    assert len(kept) == 2
    for path in kept:
        path.write_text(left)
    generate(tmp_path / "other", HOPF)
    assert _bytes(tmp_path / "other") == _bytes(tmp_path / "whole")


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (["table1/linear/hopf", "--out", "{folder}", "--jobs", "1"], 0, "1 entries made"),
        (["nothing", "--out", "{folder}", "--jobs", "1"], 2, "no entry starts with 'nothing'"),
        (["--jobs", "0", "--out", "{folder}"], 2, "--jobs"),
    ],
)
def test_the_program(arguments: list[str], status: int, says: str, tmp_path: Path) -> None:
    # No progress in between
    words = [word.format(folder=tmp_path) for word in arguments] + ["--quiet"] * bool(status)
    done = subprocess.run(
        [sys.executable, *MAKE, *words], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == status, done
    assert says in (done.stderr if status else done.stdout)
    assert not status or done.stderr.count("\n") == 1


# ------------------------------------------------------------------------------------------- proofs
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
