"""Grades as a gate: required levels, expected failures, two sheets compared, a badge, and
workflow files that run.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.command_line import answer, assert_refused, printed
from tippedisk_verify.cli import main
from tippedisk_verify.conformance.gate import badge, expected_failures, grade_changes
from tippedisk_verify.conformance.grading import Tally, compare
from tippedisk_verify.reference_values.store import load_store

RHS = "table1/both/rhs/001"
CRIT = "table1/linear/hopf/point/omega_crit"
CROSSING = "table1/linear/trajectory/d1/crossing_time#3"
WORKFLOWS = sorted((Path(__file__).parents[2] / "examples" / "ci").iterdir())


def _sheet(path: Path, **factors: float) -> str:
    """Right answers at levels 1 and 3, some of them times a factor; the name is the quantity's."""
    rows = [*load_store().matching(f"{RHS}/"), load_store()[CRIT]]
    lines = [
        f"{q.id},{q.for_doubles * factors.get(q.name, 1)!r}"
        for q in rows
        if factors.get(q.name) != 0
    ]
    path.write_text("id,answer\n" + "\n".join(lines) + "\n")
    return str(path)


def _grade(*arguments: str) -> int:
    return main(["conformance", "grade", *arguments, "--quiet"])


def test_required_levels_decide_the_exit_status(tmp_path: Path) -> None:
    right, wrong = _sheet(tmp_path / "a.csv"), _sheet(tmp_path / "b.csv", omega_crit=2)
    assert _grade(right) == _grade(wrong) == 0  # a poor grade is a result
    assert (
        _grade(right, "--require", "1")
        == _grade(wrong, "--require", "1")
        == _grade(right, "--require", "3")
        == 0
    )
    assert _grade(wrong, "--require", "3") == 1
    # Level 2 was not answered
    assert [_grade(right, "--require", levels) for levels in ("1-3", "3,1-1")] == [1, 0]
    short = answer(f"conformance grade {wrong} --require 1-3", status=1)["shortcomings"]
    assert [line.split(",")[0] for line in short] == ["level 2 is required", "level 3"]
    assert CRIT in short[1]
    assert _grade(right, "--require", "0-3") == 2
    # One state of level 1 was answered, and rightly: that passes
    assert "partial" in printed(f"conformance grade {right} --require 1")


def test_expected_failures_are_let_pass(tmp_path: Path) -> None:
    wrong = _sheet(tmp_path / "b.csv", omega_crit=2, M=2)
    known = tmp_path / "known.txt"
    both = f"# what we know of\n{CRIT}  # see the tracker\n\n{RHS}/M\n"
    for text, required, status in (
        (both, (), 0),
        (both, ("--require", "1-2"), 1),
        (f"{CRIT}\n", (), 1),
        (f"{CRIT}\n", ("--require", "3"), 0),
    ):
        known.write_text(text)
        assert _grade(wrong, "--expected-failures", str(known), *required) == status, text
    known.write_text(f"{CROSSING} # three\n#nothing\n")  # a crossing's number is no comment
    assert expected_failures(known, load_store()) == {CROSSING}
    known.write_text(f"{RHS}/*\n{CRIT}\n")
    # Into a pipe: a sentence is a line, and the diagnosis comes early
    said = printed(f"conformance grade {wrong} --expected-failures {known}").splitlines()
    assert said[0].startswith("b.csv: level 1, right-hand side, is the first that fails")
    assert any(line.startswith("note: 5 answers pass though expected to fail") for line in said)
    assert said.index("least digits") > next(
        n for n, line in enumerate(said) if "likely cause" in line
    )
    known.write_text("table1/both/rhs/001/N\n")
    command = ["conformance", "grade", wrong, "--expected-failures", str(known)]
    assert "no question is" in assert_refused(command)


def test_two_sheets_are_compared(tmp_path: Path) -> None:
    old = _sheet(tmp_path / "old.csv", h=1 + 1e-11, f_G=2)
    new = _sheet(tmp_path / "new.csv", omega_crit=2, M=0, w_y=1 + 1e-12)  # 0 leaves an answer out
    told = answer(f"conformance compare {old} {new}", status=1)
    kinds = {change["id"].rsplit("/", 1)[1]: change["change"] for change in told["changes"]}
    assert kinds == {
        "omega_crit": "broken",
        "M": "gone",
        "w_y": "lost",
        "h": "gained",
        "f_G": "mended",
    }
    assert [change["change"] for change in told["changes"]][:3] == ["broken", "gone", "lost"]
    assert "0 broken, 0 gone, 0 lost, 0 gained" in printed(f"conformance compare {old} {old}")
    # From sixteen digits to fourteen and a half: an ulp or ten of a double
    truth = float(load_store()[CRIT])
    assert grade_changes([compare(CRIT, truth)], [compare(CRIT, truth * (1 + 3e-15))]) == []


def _level(number: int, answered: int = 5, failed: int = 0) -> Tally:
    return Tally(number, 5, answered, failed, 0, 0, 0, 12.0, 13.0)


@pytest.mark.parametrize(
    ("levels", "says"),
    [
        ([_level(n) for n in range(1, 8)], "levels 1-7 agree"),
        ([_level(1), _level(2, 0)], "level 1 agrees"),
        ([_level(1), _level(2, 3)], "levels 1-2 partial"),
        ([_level(1, 3), _level(2, 3, 1)], "level 1 partial"),
        ([_level(1), _level(2), _level(3, failed=1)], "levels 1-2 agree"),
        ([_level(1, 0)], "not answered"),
        ([_level(1, failed=2), _level(2)], "fails at level 1"),
    ],
)
def test_the_badge(levels: list[Tally], says: str) -> None:
    root = ElementTree.fromstring(badge(levels))
    assert root.tag.endswith("svg")
    assert [text.text for text in root.iter("{http://www.w3.org/2000/svg}text")] == [
        "tippedisk",
        says,
    ]


@pytest.mark.parametrize(
    ("option", "name", "says"),
    [
        ("--badge", "a.svg", "levels 1-3 partial"),
        ("--html", "a.html", "<html"),
        ("--csv", "a.csv", "level,quantity,"),
    ],
)
def test_what_is_written_goes_over_its_own_kind_only(
    option: str, name: str, says: str, tmp_path: Path
) -> None:
    answers, target = _sheet(tmp_path / "answers.csv"), tmp_path / name
    before = Path(answers).read_bytes()
    for _ in range(2):
        assert _grade(answers, option, str(target)) == 0
    assert says in target.read_text()
    for other in (answers, str(tmp_path / "other.txt")):
        assert_refused(["conformance", "grade", answers, option, other])
    assert Path(answers).read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"answers.csv", name}


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflows_commands_run(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in turn, with a program between that answers nothing: the gate then stays shut."""
    monkeypatch.chdir(tmp_path)
    lines = re.findall(r"(?:tippedisk-verify|\./your_program) .*", path.read_text(encoding="utf-8"))
    assert len(lines) == 3
    statuses = []
    for line in lines:
        command, *arguments = shlex.split(line, comments=True)
        if command == "tippedisk-verify":
            statuses.append(main([*arguments, "--quiet"]))
        else:
            Path(arguments[1]).write_text(Path(arguments[0]).read_text())
    assert statuses == [0, 1]
    assert Path("grades.html").is_file()
    assert Path("tippedisk.svg").is_file()
