"""Fresh questions: drawn alike everywhere, with truths that hold, and answered by nothing
that was published.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest

import tippedisk_verify as tv
from graded_programs.scipy_program import motion
from reference_data.make.recipes import CONFIRM
from tests.command_line import answer, assert_refused, printed
from tippedisk_verify.conformance.grading import grade_answers
from tippedisk_verify.conformance.sheet import (
    questions,
    read_answers,
    sheet_csv,
    sheet_json,
    store_for_sheet,
)
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.drawn_disks import disk_of, drawn_disk
from tippedisk_verify.reference_values.entries import ReferenceEntry, case_of, disagreements
from tippedisk_verify.reference_values.fresh_questions import blank_questions, with_fresh
from tippedisk_verify.reference_values.store import Store, load_store


def sheet(states: int, seed: int, *levels: int) -> str:
    store = blank_questions(states, seed)
    return sheet_csv(store, questions(store, levels=levels))


# ------------------------------------------------------------------------------------ what is asked
def test_a_draw_is_a_hash_and_a_line() -> None:
    """So it is the same on every processor, in every version; here it is written a second time."""
    for seed, number in ((7, 1), (7, 2), (0, 100), (999_999_999, 1)):
        numbers = drawn_disk(seed, number).decimals()
        if number == 1:  # the first state that is asked for
            inputs = next(iter(blank_questions(1, seed).values())).inputs
            numbers |= {f"{name} 1": inputs[name] for name in ("beta", "gamma", "v")}
        for name, low, high, places in (
            ("r", "0.038", "0.052", 4),
            ("g", "9.78", "9.83", 3),
            ("mu", "0.2", "0.45", 3),
            ("beta 1", "0.0708", "3.0708", 6),
            ("gamma 1", "-3.1292", "6.2708", 5),
            ("v 1", "-12", "12", 4),
        ):
            text = hashlib.sha256(f"{seed}/{number}/{name}".encode()).hexdigest()[:12]
            drawn = Decimal(low) + (Decimal(high) - Decimal(low)) * int(text, 16) / 16**12
            assert name not in numbers or Fraction(numbers[name]) == Fraction(
                round(drawn, places)
            ), name


def test_drawn_disks_are_like_the_papers_and_more_states_begin_with_the_same_ones() -> None:
    """Cycles are born stable at Omega_crit, so that each question of a sheet has an answer."""
    for number in range(1, 9):
        assert tv.hopf_point(disk_of(f"fresh-12-{number}")).criticality == "supercritical"
    many = sheet(23, 3).splitlines()
    assert set(sheet(7, 3).splitlines()) < set(many)
    speeds = {(row["set"], row["Omega"]) for row in csv.DictReader(many) if row["kind"] == "rhs"}
    assert (len(speeds), len({name for name, _ in speeds})) == (23, 3)


# ------------------------------------------------------------------------------------------ truths
@pytest.fixture(scope="module")
def truths() -> Store:
    return with_fresh(
        load_store(), "\n".join(id_ for id_ in blank_questions(3, 5) if "/limit-cycle/" not in id_)
    )


def test_each_question_has_a_truth_in_both_readings(truths: Store) -> None:
    asked = [id_ for id_ in blank_questions(3, 5) if "/limit-cycle/" not in id_]
    assert [id_ for id_ in truths if id_.startswith("fresh-")] == asked
    for id_ in asked:
        quantity = truths[id_]
        assert set(quantity.values) == {"decimals", "doubles"}
        # Orbits of two seconds lose a digit or two of doubles; a real eigenvalue's imaginary part
        # is 0 exactly.
        assert quantity.uncertainty < 1e-13 * max(abs(quantity.value), 1)
        assert quantity.condition or not quantity.value


@pytest.mark.parametrize(
    "kind", ["rhs", "equilibrium", "hopf", "harmonic-balance", "slow-manifold"]
)
def test_other_methods_agree_with_the_truths(kind: str, truths: Store) -> None:
    asked = [quantity for quantity in truths.matching("fresh-5-1/") if quantity.kind == kind]
    for entry in dict.fromkeys(quantity.id.rsplit("/", 1)[0] for quantity in asked):
        here = [quantity for quantity in asked if quantity.id.startswith(f"{entry}/")]
        fresh_entry = ReferenceEntry(entry, here[0].inputs)
        for reading in ("decimals", "doubles"):
            known = {quantity.name: quantity.measured(reading) for quantity in here}
            for name, method in CONFIRM[kind].items():
                if name != "symbolic":  # compiles for seconds; another method confirms the same
                    assert disagreements(known, method(case_of(fresh_entry, reading), known)) == []


@pytest.mark.parametrize("law", ["linear", "smooth"])
def test_half_widths_of_orbits_hold_what_more_digits_say(law: str, truths: Store) -> None:
    disk = tv.Disk(
        **{name: getattr(drawn_disk(5, 1), name) for name in tv.PRINTED.decimals()}, friction=law
    )
    samples = {
        quantity.name: quantity for quantity in truths.matching(f"fresh-5-1/{law}/trajectory/")
    }
    given = next(iter(samples.values())).inputs
    start = [given[name] for name in ("beta", "gamma", "v")]
    run = disk.integrate(given["Omega"], start, 2, t_eval=["0.5", "1", "1.5", "2"], digits=20)
    for name, row in zip(("beta", "gamma", "v"), run.y, strict=True):
        for time, value in zip(("0.5", "1", "1.5", "2"), row, strict=True):
            assert samples[f"{name}@{time}"].measured().holds(value)


# ------------------------------------------------------------------------------------------ grading
def answered(text: str, **wrong: float) -> str:
    """The answers of a program with the right equations, in doubles, to the questions about
    states.
    """
    lines = ["id,answer"]
    for row in csv.DictReader(io.StringIO(text)):
        if row["kind"] != "rhs" or row["quantity"] not in ("gamma_rate", "v_rate", "gamma_y"):
            continue
        p = {
            name: float(row[name]) for name in ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
        } | wrong
        state = [float(row[name]) for name in ("beta", "gamma", "v")]
        gamma_rate, v_rate, slip = motion(
            math, p, float(row["Omega"]), row["friction"] == "smooth", state
        )
        answer = {"gamma_rate": gamma_rate, "v_rate": v_rate, "gamma_y": slip}[row["quantity"]]
        lines.append(f"{row['id']},{answer!r}")
    return "\n".join(lines) + "\n"


def test_a_right_program_passes_and_a_number_of_its_own_is_named(tmp_path: Path) -> None:
    printed(f"conformance questions {tmp_path / 'q.csv'} --states 20 --seed 8 --levels 1")
    text = (tmp_path / "q.csv").read_text()
    for name, wrong in (("right", {}), ("mu", {"mu": 0.3})):
        (tmp_path / f"{name}.csv").write_text(answered(text, **wrong))
    right, own = tmp_path / "right.csv", tmp_path / "mu.csv"
    (level,) = answer(f"conformance grade {right} --require 1")["levels"]
    assert (level["failed"], level["asked"]) == (0, 20 * 16)
    assert level["least_digits"] > 12
    causes = [one["causes"] for one in answer(f"conformance grade {own}")["diagnoses"]]
    assert [[cause["cause"] for cause in here] for here in causes] == [["the inputs: mu = 0.3"]]
    printed(f"conformance compare {right} {own}", status=1)
    (tmp_path / "expected").write_text(
        "fresh-8-*/linear/rhs/*/v_rate\nfresh-8-*/smooth/rhs/*/v_rate\n"
    )
    printed(f"conformance grade {own} --expected-failures {tmp_path / 'expected'}")


def test_the_ids_are_enough_in_every_form_of_sheet(tmp_path: Path, truths: Store) -> None:
    ids = [id_ for id_ in blank_questions(3, 5) if "/rhs/" in id_ or "/hopf/" in id_]
    short = {id_: truths[id_].for_doubles for id_ in ids}
    store = blank_questions(3, 5)
    full = json.loads(sheet_json(store, [store[id_] for id_ in ids]))
    for row in full["questions"]:
        row["answer"] = short[row["id"]]
    for text in (json.dumps(short), json.dumps(short).replace("/", "\\/"), json.dumps(full)):
        (tmp_path / "a.json").write_text(text)
        found = store_for_sheet(tmp_path / "a.json", load_store())
        answers = read_answers(tmp_path / "a.json", found)
        grades = grade_answers(answers, found)
        assert [grade.id for grade in grades] == ids
        assert not any(grade.failed for grade in grades)
        assert (answers.unknown_ids, answers.altered_rows) == ([], [])
    full["questions"][0]["mu"] = "0.3"
    (tmp_path / "a.json").write_text(json.dumps(full))
    assert read_answers(tmp_path / "a.json", found).altered_rows == [f"{ids[0]}, mu"]


def test_ids_that_no_draw_gives(tmp_path: Path) -> None:
    wrong = (
        "fresh-5-1/both/rhs/11/M",
        "fresh-05-1/both/rhs/01/M",
        "fresh-5-0/both/rhs/01/M",
        "fresh-5-1/both/rhs/1/M",
        "fresh-5-1/linear/heteroclinic/point/omega_h",
        "fresh-1234567890-1/both/rhs/01/M",
        "fresh-5-1/both/rhs/01/m",
        "fresh-5-1000/both/rhs/01/M",
        "refresh-5-1/both/rhs/01/M",
        "fresh-x-1/both/rhs/01/M",
    )
    (tmp_path / "a.csv").write_text(
        "id,answer\nfresh-5-1/both/rhs/01/M,1\n" + "".join(f"{id_},1\n" for id_ in wrong)
    )
    assert answer(f"conformance grade {tmp_path / 'a.csv'}")["unknown"] == list(wrong)
    for id_ in wrong[:2]:
        with pytest.raises(InputError, match="no reference value"):
            tv.reference(id_)
    many = "".join(
        f"fresh-{seed}-{n}/both/rhs/01/M,1\n" for seed in range(9) for n in range(1, 600)
    )
    (tmp_path / "a.csv").write_text(f"id,answer\n{many}")
    refused = assert_refused(["conformance", "grade", str(tmp_path / "a.csv")])
    assert "fresh questions for 5391 entries" in refused


def test_bad_numbers_of_states_and_seeds(tmp_path: Path) -> None:
    target = str(tmp_path / "q.csv")
    for words, says in (
        (["--states", "0"], "from 1 to 1000"),
        (["--states", "1001"], "from 1 to 1000"),
        (["--seed", "3"], "--states"),
        (["--states", "5", "--seed", "-1"], "from 0 to 999999999"),
        (["--states", "5", "--set", "table1"], "--set"),
        (["--states", "5", "--levels", "9"], "level '9'"),
        (["--states", "five"], "not a valid integer"),
    ):
        assert says in assert_refused(["conformance", "questions", target, *words])
    assert not Path(target).exists()
