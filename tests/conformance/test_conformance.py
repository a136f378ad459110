"""Grading: digits that are right, mistakes that are named, and sheets of every kind of damage."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import subprocess
import sys
from decimal import Decimal, localcontext
from pathlib import Path

import pytest
from rich.console import Console

import tippedisk_verify as tv
from tests.command_line import answer, assert_refused, printed
from tests.report.test_page import Page
from tippedisk_verify.conformance.diagnosis import diagnose
from tippedisk_verify.conformance.grade_pages import Report, html_page, print_report
from tippedisk_verify.conformance.grading import (
    agreeing_digits,
    compare,
    grade_answers,
    tally_levels,
)
from tippedisk_verify.conformance.sheet import (
    Answers,
    questions,
    read_answers,
    sheet_csv,
    sheet_json,
)
from tippedisk_verify.reference_values.grading_rules import QUESTION_COLUMNS
from tippedisk_verify.reference_values.store import Store
from tippedisk_verify.support.files import csv_text

OMEGA_CRIT = "table1/linear/hopf/point/omega_crit"


def _answers(given: dict[str, str], reading: str = "doubles") -> Answers:
    return Answers({id_: (reading, answer) for id_, answer in given.items()})


# ------------------------------------------------------------------------------------------ sheets
def test_a_csv_sheet_needs_no_quotes_and_says_everything(store: Store) -> None:
    text = sheet_csv(store, questions(store))
    assert '"' not in text
    rows = list(csv.DictReader(io.StringIO(text)))
    assert tuple(rows[0]) == QUESTION_COLUMNS
    assert sum(row["form"] != "optional" for row in rows) == len(store)
    assert [int(row["level"]) for row in rows] == sorted(int(row["level"]) for row in rows)
    assert not any(row["answer"] for row in rows)
    crossing = next(row for row in rows if row["id"].endswith("trajectory/d1/crossing_time#3"))
    assert (crossing["quantity"], crossing["n"], crossing["t"]) == ("crossing_time", "3", "")
    # No truth leaks into the questions.
    period = store["table1/linear/limit-cycle/crit-0.5/period"].values["decimals"][0]
    assert period[:12] not in text


@pytest.mark.parametrize("write", [sheet_csv, sheet_json])
def test_the_truth_gets_full_marks_in_either_form_and_reading(
    write, store: Store, tmp_path: Path
) -> None:
    asked = questions(store, sets=["table1"])
    text = write(store, asked)
    path = tmp_path / "sheet"
    if write is sheet_csv:
        rows = list(csv.DictReader(io.StringIO(text)))
        for n, row in enumerate(rows):
            reading = "doubles" if n % 2 and "doubles" in store[row["id"]].values else "decimals"
            row["from"], row["answer"] = reading, store[row["id"]].values[reading][0]
        path.write_text(csv_text(QUESTION_COLUMNS, [[*row.values()] for row in rows]))
    else:
        content = json.loads(text)
        content["from"] = "decimals"
        for row in content["questions"]:
            row["answer"] = store[row["id"]].values["decimals"][0]
        path.write_text(json.dumps(content))
    grades = grade_answers(read_answers(path, store), store)
    assert len(grades) == len(asked)
    assert {grade.verdict for grade in grades} == {"exact"}
    assert diagnose(grades, store) == []
    assert all(level.failed == 0 for level in tally_levels(grades, asked))


# ------------------------------------------------------------------------------------------ digits
@pytest.mark.parametrize(
    ("error", "digits"), [("1e-3", 3), ("2e-9", 8.69897), ("-1e-30", 30), ("0.5", 0.30103)]
)
def test_digits_are_those_of_the_relative_error(error: str, digits: float) -> None:
    truth = Decimal(7)
    with localcontext() as context:
        context.prec = 60
        found = agreeing_digits(truth * (1 + Decimal(error)), truth, truth)
    assert found == pytest.approx(digits, abs=1e-4)  # as typed above


def test_what_is_exact_and_what_agrees(store: Store) -> None:
    """Rounding an answer is no error, each reading has a truth, and no program in doubles has
    a better double.
    """
    quantity = store[OMEGA_CRIT]
    truth, doubles = (quantity.values[reading][0] for reading in ("decimals", "doubles"))
    cut = round(Decimal(truth), 12)
    answers = {
        truth: "exact",
        truth + "123456789" * 10: "exact",
        str(cut): "exact",
        doubles: "agrees",
        "30.9": "wrong",
    }
    for text, verdict in (answers | {str(cut + Decimal("1e-12")): "agrees"}).items():
        grade = compare(OMEGA_CRIT, text, reading="decimals")
        assert (grade.verdict, grade.digits < 60) == (verdict, True)
        assert "inputs were rounded" in grade.note or text != doubles
    for quantity in store.matching("table1/both/rhs/00"):
        assert compare(quantity.id, quantity.for_doubles).verdict == "exact"
        assert (
            compare(quantity.id, f"{quantity.for_doubles * (1 + 1e-14):.16e}").verdict == "agrees"
        )
    # Next to the connection rounded inputs can change everything; that makes nonsense no answer.
    assert (
        compare(
            "table1/linear/near-heteroclinic/het+1e-30/period", "-1000", reading="decimals"
        ).verdict
        == "wrong"
    )
    assert compare("table1/linear/near-heteroclinic/het+1e-20/period", 25.1).verdict == "no-truth"


# ----------------------------------------------------------------------------------- damaged sheets
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\0\0\0",
        b"\xff\xfe\x00",
        b"a,b\n1,2\n",
        b"{",
        b"{}",
        b'{"questions": 3}',
        b'{"questions": [1]}',
        b"[1]",
        b'{"a":' * 100_000,
        b"id,answe",
        b"id,from,answer\nprinted/both/rhs/001/M,guess,1\n",
        b'id,answer\n"' + b"x" * 200_000,
        b"id,answer\nprinted/both/rhs/001/M,0,5\n",
        b'id,answer\n"table1/both,1\n',
        b"id,answer\nprinted/linear/hopf/omega_crit,30.9\n",
        b"cposix\nsystem\n(S'false'\ntR.",
        b'{"answers": {"a": ' + b"[" * 200_000 + b"]" * 200_000 + b"}}",
        "id,answer\n".encode("utf-16"),
    ],
)
def test_files_that_are_no_sheet(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    assert_refused(["conformance", "grade", str(tmp_path / "a.csv")])


def test_a_sheet_with_answers_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    # With a mistake in it it is still somebody's work
    for number, says in (("30.9", "has 1 answers"), ("30,9", "give another name")):
        path.write_text(f"id,answer\n{OMEGA_CRIT},{number}\n")
        assert says in assert_refused(["conformance", "questions", str(path)])
    path.write_text("id,answer\n")
    printed(f"conformance questions {path} --levels 3 --quiet")


def test_partial_repeated_and_unknown_answers(tmp_path: Path) -> None:
    truth = repr(float(tv.reference(OMEGA_CRIT)))
    rows = f"{OMEGA_CRIT},{truth}\n{OMEGA_CRIT},1\n../../etc/passwd,1\nprinted/nowhere,\nshort\n"
    path = tmp_path / "a.csv"
    path.write_text("\ufeffid,answer\n" + rows)
    result = answer(f"conformance grade {path}")
    assert [grade["verdict"] for grade in result["grades"]] == ["exact"]
    assert result["unknown"] == ["../../etc/passwd"]
    assert len(result["remarks"]) == 4
    assert result["repeated"] == [OMEGA_CRIT]
    assert result["first_failing_level"] is None


# ---------------------------------------------------------------------------------------- diagnosis
@pytest.mark.parametrize(
    "entry", ["both/rhs/00", "linear/trajectory/d1/beta@", "smooth/limit-cycle/crit-0.5"]
)
def test_nonsense_has_no_cause_and_breaks_nothing(entry: str, store: Store) -> None:
    questions, nonsense = (
        store.matching(f"table1/{entry}")[:40],
        ["1e99999", "1e-99999", "1", "abc"],
    )
    given = {quantity.id: nonsense[n % len(nonsense)] for n, quantity in enumerate(questions)}
    grades = grade_answers(_answers(given), store)
    (diagnosis,) = diagnose(grades, store)
    assert all(re.search("(is|are) (zero|one)$", cause) for _, cause in diagnosis.causes)
    assert diagnosis.no_numbers >= len(given) // 4
    assert not any(math.isfinite(grade.digits) for grade in grades if grade.answer == "abc")


# ------------------------------------------------------------------------------------------ pages
def _read_page(given: dict[str, str], store: Store) -> tuple[str, Page, int]:
    """The page, its elements, and how many of its details are open from the start."""
    answers = _answers(given)
    grades = grade_answers(answers, store)
    text = html_page(
        Report(
            "a.csv", answers, grades, tally_levels(grades, store.values()), diagnose(grades, store)
        )
    )
    page = Page(text)
    assert page.open == []
    assert not any({"src", "href"} & set(attributes) for _, attributes in page.elements)
    return (
        text,
        page,
        sum(tag == "details" and "open" in attributes for tag, attributes in page.elements),
    )


def test_a_page_shows_what_failed_and_folds_what_is_right(store: Store) -> None:
    right = {
        quantity.id: repr(quantity.for_doubles)
        for quantity in store.values()
        if quantity.level in (3, 4)
    }
    text, page, unfolded = _read_page(right, store)
    assert OMEGA_CRIT in text
    assert unfolded == 0
    assert "level 3, Hopf point: agrees, 12 of 12 answered" in "".join(page.text)
    text, page, unfolded = _read_page(right | {OMEGA_CRIT: "30.88"}, store)
    assert unfolded == 1
    assert "11 that did not fail" in "".join(page.text)
    text, *_ = _read_page({OMEGA_CRIT: "<script>alert(1)</script>"}, store)
    assert "<script>" not in text
    assert "&lt;script&gt;" in text


@pytest.mark.parametrize(
    ("name", "error", "colour"),
    [
        # Less than one digit is asked for
        ("linear/near-heteroclinic/het+1e-8/multiplier_slow", 0.1, "enough"),
        ("linear/trajectory/d1/beta@0.5", 1e-5, "enough"),
        ("linear/limit-cycle/crit-0.5/period", 1e-9, "enough"),
        ("linear/limit-cycle/crit-0.5/period", 1e-5, "few"),
        ("linear/hopf/point/period", 1e-7, "few"),
        ("both/rhs/001/M", 1e-4, "wrong"),
        ("both/rhs/001/M", math.nan, "wrong"),
        ("linear/near-heteroclinic/het+1e-20/period", 1e-12, ""),
    ],
)
def test_the_colour_follows_what_the_question_needs(
    name: str, error: float, colour: str, store: Store
) -> None:
    quantity = store[f"table1/{name}"]
    answers = _answers({quantity.id: repr(quantity.for_doubles * (1 + error))})
    grades = grade_answers(answers, store)
    text = html_page(Report("a.csv", answers, grades, tally_levels(grades, [quantity]), []))
    shades = {"enough", "few", "wrong"}
    cells = [
        attributes
        for tag, attributes in Page(text).elements
        if tag == "td" and attributes.get("class")
    ]
    found = [set(str(attributes["class"]).split()) & shades for attributes in cells]
    assert {one for shade in found for one in shade} == {colour} - {""}
    legend = [
        attributes["class"]
        for tag, attributes in Page(text).elements
        if "key" in str(attributes.get("class"))
    ]
    assert {word for text in legend for word in str(text).split()} == {*shades, "key"}


@pytest.mark.slow
def test_the_documented_example_runs(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "grading_tests.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    (tmp_path / "test_mine.py").write_text(code)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-W",
        "error",
        str(tmp_path),
    ]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stdout[-2000:]
    assert "202 passed" in run.stdout
    broken = code.replace("** 2 * math.cos(gamma)", "* math.cos(gamma)")
    assert broken != code
    (tmp_path / "test_mine.py").write_text(broken)
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 1
    assert "digits, not 14; the truth is" in run.stdout


def test_no_word_of_a_table_is_broken_in_80_columns(store: Store) -> None:
    given = {
        q.id: repr(q.for_doubles * (1 + 1e-3 * (q.level == 9)))
        for q in store.matching("table1/")
        if q.level != 5
    }
    answers = _answers(given)
    grades = grade_answers(answers, store)
    names = {
        "level": 9,
        "kind": "near-heteroclinic",
        "longest": "calibrated/linear/near-heteroclinic/het+1e-30",
    }
    times = dict.fromkeys(("answered", "entries", "total", "median", "largest"), 12345.6) | names
    levels = tally_levels(grades, questions(store, sets=["table1"]))
    report = Report("answers.csv", answers, grades, levels, [], times=[times], start_up=0.5)
    texts = []
    for width in (80, 400):
        file = io.StringIO()
        print_report(report, Console(width=width, file=file))
        texts.append(file.getvalue())
    assert set(texts[1].split()) <= set(texts[0].split())
    assert max(len(line.rstrip()) for line in texts[0].splitlines()) <= 80
