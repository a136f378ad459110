"""Sheets as other programs and spreadsheets write them: what is read, and what is said of the
rest.
"""

from __future__ import annotations

import csv
import io
import re
from decimal import Decimal
from pathlib import Path

import pytest
from rich.console import Console

from tippedisk_verify.conformance.answer_number import as_decimal
from tippedisk_verify.conformance.grade_pages import Report, print_report
from tippedisk_verify.conformance.grading import grade_answers, tally_levels
from tippedisk_verify.conformance.sheet import questions, read_answers, sheet_csv
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.store import load_store
from tippedisk_verify.support.files import csv_text

CRIT, PERIOD = "table1/linear/hopf/point/omega_crit", "table1/linear/hopf/point/period"
RIGHT = {
    quantity.id: repr(quantity.for_doubles)
    for quantity in load_store().matching("table1/linear/hopf/")
}

READ = {
    "-8.7913543067821860-003": "-0.0087913543067821860",  # Fortran
    ".5+300": "5e299",
    "3.08q+01": "30.8",
    "3.08*^+01": "30.8",  # Mathematica
    "30.88`": "30.88",
    "3.088``16.*^1": "30.88",
}
NOT_FINITE = {
    **dict.fromkeys(
        ("-nan(ind)", "1.#QNAN", "1.#QNAN0", "-1.#IND", "sNaN", "NaN32", ".nan"),
        "there is no number",
    ),
    **dict.fromkeys(
        ("NULL", "None", "n/a", "nothing", "undefined", "Missing"), "there is no number"
    ),
    **dict.fromkeys(
        ("1.#INF", "-1.#INF00", "-Infinity", "+inf", "Inf32", "-.inf", "1.#J"), "infinite"
    ),
    "1e123456": "exponent",
}
#: Texts that are no numbers, between bars, by a word of what is said of them.
REASONS = {
    "complex": "-0.00879 + 0.0im | (30.9+0j) | 30.9 - 1e-3i | (1.5,0.0) | ( 1.5E+00 , -0.0) | "
    "nan+nanj | 0.1*I"
    " | 30.88 + 0.0*I | #C(30.88 0.0) | 30.88 :+ 0.0 | 30.9+-0.0i",
    "single precision": "30.88f0 | 3.088f1 | 30.88f | -.5F-3",
    "literal": "30.88_dp | 30.88f64 | 30.88L",
    "uncertainty": "30.88(12) | 30.88 (12) | 30.88(12)e-3 | 0.88 +/- 0.01 | [0.88 +/- 1e-3] | 30.9 "
    "± 0.1 | 30.9+-0.1",
    "ratio": "4346/1407 | -4346//1407 | 4346.0 / 1407",
    "date": "01.Mai | 1-Jan | Jan-88 | 02. Mär | 3 Dec 2026 | 30.08.1988 | 2026-03-01 | août-88",
    "time of day": "12:34 | 12:34:56.7",
    "too narrow": "***** | -*** | #####",
    "error of a spreadsheet": "#REF! | #DIV/0! | #N/A | #WERT! | Err:502",
    "truth value": "true | FALSE",
    "thousands": "1,234.5 | 1'234 | 1 234 | 1_000 | 1.234,5 | 12 345,67 | 1.234.567 | 1,234",
    "decimal comma": "30,9 | 0,045 | -,5 | 3,09e1",
    "unit": "30.9 rad/s | 30.9 rad s^-1 | 30.9 [s] | 30.9 1/s | 30.9° | 30.9%",
    "space": "- 5 | 3.088E 01 | 3.088 e1",
    "exponent": "1.5-3 | 1.5-03 | 15+003 | 1.5e | 1e99999999999",
    "power of ten": "3.088×10^1 | 3.088*10^1 | 3.088x10**-1 | 10^-3",
    "interval": "30.8..30.9 | [30.8, 30.9] | [1;2]",
    "list": "[0.88] | [[0.88]] | (0.88) | {0.88} | (0.88,)",
    "language": "np.float64(30.9) | mpf('30.9') | array([30.9]) | Float64[30.88] | tensor(0.8, "
    "dtype=f8)",
    "quotes": "'30.9' | `30.9` | b'30.9'",
    "hexadecimal": "0x1.8p3 | -0x1f",
    "name": "x = 30.9 | period: 30.9",
    "bound": "<30.9 | ~30.9 | =30.9",
    "more than one": "30.9 30.8 | 30.9;30.8 | 1,2,3",
    "behind it": "30.9; | 30.9, | 30.9 apples | 0.88+0.01 | 3.088b1",
    "no digit": "overflow | - | ?",
    "no decimal number": "--5 | $30.9",
    "U+2212, MINUS SIGN": "\N{MINUS SIGN}5 | 1e\N{MINUS SIGN}5 | 30.9\N{MINUS SIGN}0",
    "U+2013, EN DASH": "\N{EN DASH}5",
    "U+202F, NARROW NO-BREAK SPACE": "1\N{NARROW NO-BREAK SPACE}234",
    "U+FF13, FULLWIDTH DIGIT THREE": "\N{FULLWIDTH DIGIT THREE}.5",
    "U+0661, ARABIC-INDIC DIGIT ONE": "\N{ARABIC-INDIC DIGIT ONE}",
    "U+201C, LEFT DOUBLE QUOTATION MARK": "\N{LEFT DOUBLE QUOTATION MARK}5\N{RIGHT DOUBLE QUOTATION MARK}",
    "U+200B, ZERO WIDTH SPACE": "30\N{ZERO WIDTH SPACE}.9",
    "U+221E, INFINITY": "\N{INFINITY}",
    "U+001B, a control character": "30.9\x1b[0m",
}
NO_NUMBERS = [(text, says) for says, texts in REASONS.items() for text in texts.split(" | ")]


def _report(path: Path, text: str) -> Report:
    path.write_text(text, encoding="utf-8")
    store = load_store()
    answers = read_answers(path, store)
    grades = grade_answers(answers, store)
    asked = [store[grade.id] for grade in grades]
    return Report(path.name, answers, grades, tally_levels(grades, asked), [])


def _among_right_ones(folder: Path, text: str) -> Report:
    """The report on a sheet in which one answer is this text, and the others are right."""
    answers = {**{id_: a for id_, a in RIGHT.items() if id_ != CRIT}, CRIT: text}
    rows = ((id_, "doubles", answer) for id_, answer in answers.items())
    return _report(folder / "answers.csv", csv_text(("id", "from", "answer"), rows))


# --------------------------------------------------------------------------------------- one answer
@pytest.mark.parametrize("text", READ)
def test_what_is_unambiguous_is_read(text: str) -> None:
    assert as_decimal(text) == Decimal(READ[text])


@pytest.mark.parametrize(("text", "says"), [*NO_NUMBERS, *NOT_FINITE.items()])
def test_what_is_no_number_is_named_from_the_first_on(text: str, says: str, tmp_path: Path) -> None:
    report = _among_right_ones(tmp_path, text)
    (remark,) = report.remarks()
    assert f" at {CRIT}: " in remark
    reason = remark.partition(f" at {CRIT}: ")[2]
    assert says in reason
    assert ("unit" in reason) == (says == "unit")
    (failed,) = report.failed
    assert (failed.verdict, failed.note) == (
        "not-a-number" if text in NOT_FINITE else "unreadable",
        reason,
    )


@pytest.mark.parametrize("text", ["-Infinity", "NaN", "abc", "\N{MINUS SIGN}5", "30.0"])
def test_a_line_says_digits_and_truth_where_there_are_some(text: str, tmp_path: Path) -> None:
    file = io.StringIO()
    print_report(_among_right_ones(tmp_path, text), Console(width=400, file=file))
    lines = file.getvalue().partition("least digits")[2].splitlines()
    for line in lines:
        assert not re.search(r"(, +digits|truth *)$", line)
    assert ("truth" in lines[2]) == lines[1].endswith(" digits") == (text == "30.0")


def test_reasons_are_counted_and_not_too_many(tmp_path: Path) -> None:
    texts = ["30,9", "3,9", *(texts.split(" | ")[0] for texts in list(REASONS.values())[:9])]
    ids = [quantity.id for quantity in load_store().matching("table1/both/rhs/")]
    rows = "".join(
        f'{{"id": "{id_}", "answer": "{text}"}}\n' for id_, text in zip(ids, texts, strict=False)
    )
    remarks = [
        remark
        for remark in _report(tmp_path / "a.jsonl", rows).remarks()
        if "not numbers" in remark
    ]
    assert (
        remarks[0]
        == f"2 answers are not numbers, such as '30,9' at {ids[0]}: a decimal comma; write a point"
    )
    assert remarks[-1] == "5 more reasons why answers are not numbers"


# ------------------------------------------------------------------------------------ a whole sheet
@pytest.mark.parametrize(
    "text",
    [
        "sep=;\nid;answer\nID;30.9\n",
        "SEP=;\r\nid;answer\r\nID;30.9\r\n",
        "sep=,\nid,answer\nID,30.9\n",
        '"sep=;"\n"id";"answer"\n"ID";"30.9"\n',
        "sep=\t\nid\tanswer\nID\t30.9\n",
        "sep=|\nid|answer\nID|30.9\n",
        "id;answer;remark, mine\nID;30.9;\n",
        "id\tanswer\ta;b,c\nID\t30.9\t\n",
        '{"ID": 30.9}',
        '{"from": "doubles", "ID": 30.9}',
        '[{"id": "ID", "answer": 30.9}]',
        f'{{"id": "ID", "answer": 30.9}}\n{{"id": "{PERIOD}", "answer": null}}\n',
        '\n{"id": "ID", "answer": "30.9"}\n',
    ],
)
def test_every_form_of_a_sheet_is_read(text: str, tmp_path: Path) -> None:
    """The separator is the one that the header has; JSON comes as an object, a list or lines."""
    answers = _report(tmp_path / "a.csv", text.replace("ID", CRIT)).answers
    assert answers.by_id == {CRIT: ("doubles", "30.9")}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"ID,ANSWER\n{CRIT},1\n", "'ID' (written id here), 'ANSWER' (written answer here)"),
        (f"id;Answer\n{CRIT};1\n", "'Answer' (written answer here)"),
        (f"id,anwser\n{CRIT},1\n", "'anwser' (written answer here)"),
        (f"id|answer\n{CRIT}|1\n", "separated by commas, semicolons or tabs"),
        (f"question,value\n{CRIT},1\n", "it has 'question', 'value'"),
        (f"sep=;\nid,answer\n{CRIT},1\n", "it has 'id,answer'"),
        (f'{{"Answers": {{"{CRIT}": 1}}}}', "'Answers' (written answers here)"),
        (f'{{"questions": [{{"ID": "{CRIT}", "answer": 1}}]}}', "'ID' (written id here)"),
        (f'[{{"name": "{CRIT}", "answer": 1}}]', "one has 'name', 'answer'"),
        (f"sep=;\nid;answer\n{CRIT};1;2\n", "line 3 has 3 fields, the header 2"),
    ],
)
def test_a_header_that_is_none_is_told_by_name(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        _report(tmp_path / "a", text)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"id,FROM,answer\n{CRIT},decimals,1\n", "'FROM' (written from here)"),
        (f"id;answer;Bemerkung;omega\n{CRIT};1;;\n", "'Bemerkung', 'omega' (written Omega here)"),
        (f'[{{"id": "{CRIT}", "Answer": 1}}]', "'Answer' (written answer here)"),
        (f'{{"From": "decimals", "answers": {{"{CRIT}": 1}}}}', "'From' (written from here)"),
    ],
)
def test_a_column_that_is_not_read_is_named(text: str, says: str, tmp_path: Path) -> None:
    (remark,) = (
        remark for remark in _report(tmp_path / "a", text).remarks() if "not read" in remark
    )
    assert remark.endswith(f"not known, and not read: {says}")


def test_a_semicolon_sheet_with_decimal_commas_asks_the_same_and_is_helped(tmp_path: Path) -> None:
    asked = questions(load_store(), sets=["table1"], levels=[3])
    rows = list(csv.DictReader(io.StringIO(sheet_csv(load_store(), asked))))
    lines = [";".join(rows[0])]
    for row in rows:
        row |= {"from": "doubles", "answer": RIGHT[row["id"]]}
        lines.append(
            ";".join(text if name == "id" else text.replace(".", ",") for name, text in row.items())
        )
    report = _report(tmp_path / "a.csv", "\n".join(lines) + "\n")
    (remark,) = report.remarks()
    assert remark.startswith(f"{len(asked)} answers are not numbers")
    assert remark.endswith(": a decimal comma; write a point")
