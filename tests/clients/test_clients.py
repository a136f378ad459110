"""Programs in six languages, written from the paper alone, answer questions: two whole ones, four
starters, and answerers that take a question a line.

That they agree with the reference data is also evidence for the data: nothing is shared but the
paper.
"""

from __future__ import annotations

import csv
import io
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tippedisk_verify.commands.conformance_sources import CLIENTS, FOLDER
from tippedisk_verify.conformance import client_text
from tippedisk_verify.conformance.diagnosis import diagnose
from tippedisk_verify.conformance.grading import Grade, compare, grade_answers
from tippedisk_verify.conformance.sheet import questions, read_answers, sheet_csv
from tippedisk_verify.reference_values.grading_rules import question_fields
from tippedisk_verify.reference_values.store import Store, load_store

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
NODE = shutil.which("node")
FORTRAN = shutil.which("gfortran")
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
JULIA = shutil.which("julia")
#: What is said of the mistakes that the C client can make on request, in the order of its fault
#: numbers.
FAULTS = (
    "in h: the sign of h_2",
    "in h: the sign of h_3",
    "in h: the sign of h_4",
    "in h: the sign of h_5",
    "in gamma_y: -e Omega sin(beta) cos(gamma) for -e Omega sin(beta)^2 cos(gamma)",
    "Bbar = B, not B - m e^2",
    "the inputs: the angles taken as degrees",
    "the inputs: both angles shifted by pi/2",
    "the inputs: r, e, m, A, B, g, mu, epsilon in single precision",
    "the inputs: A and B exchanged",
    "gamma_rate has the wrong sign",
    "in h_4: m e rho Omega^2 sin(beta) cos(beta) sin(gamma) for",
    "sin(beta) cos(gamma) for -e Omega sin(beta)^2 cos(gamma); (2) in h: the sign of h_2",
    "in M: m r^2 cos(beta)^2 for m rho^2",
    "in f_G: -m g r cos(beta) for -m g rho cos(beta)",
    "the inputs: mu = 0.33",
)


@pytest.fixture(scope="module")
def c_client(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if COMPILER is None:
        pytest.skip("no C compiler on this machine")
    program = tmp_path_factory.mktemp("c") / "client"
    options = ["-O2", "-std=c99", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(
        [COMPILER, *options, "-o", str(program), str(FOLDER / CLIENTS["c"]), "-lm"], check=True
    )
    return program


def _asked(store: Store, starts: tuple[str, ...]) -> str:
    """A sheet with the questions whose ids start so."""
    chosen = [quantity for quantity in questions(store) if quantity.id.startswith(starts)]
    assert chosen
    return sheet_csv(store, chosen)


def _answered(command: list[str], sheet: str, store: Store, folder: Path) -> list[Grade]:
    (folder / "sheet.csv").write_text(sheet)
    subprocess.run(command, check=True, timeout=300, cwd=folder)
    return grade_answers(read_answers(folder / "answers.csv", store), store)


def _least(grades: list[Grade], level: int) -> float:
    return min(grade.digits for grade in grades if grade.level == level)


RHS = ("table1/both/rhs", "table1/linear/rhs", "table1/smooth/rhs", "table1/both/equilibrium")


def test_the_c_client_has_the_digits_of_its_arithmetic(
    c_client: Path, store: Store, tmp_path: Path
) -> None:
    motion = tuple(
        f"{name}/{law}/{kind}"
        for name in ("table1", "calibrated")
        for law in ("linear", "smooth")
        for kind in ("trajectory/d", "limit-cycle/crit-0.3", "limit-cycle/crit-0.5")
    )
    sheet = _asked(store, (*RHS, *motion))
    grades = _answered([str(c_client), "sheet.csv", "answers.csv"], sheet, store, tmp_path)
    asked = sum(row["form"] != "optional" for row in csv.DictReader(io.StringIO(sheet)))
    assert len(grades) > 0.95 * asked  # all but the derivatives of a cycle's state
    assert not any(grade.failed for grade in grades)
    # Printed doubles; it computes in long double where the machine has it
    assert _least(grades, 1) >= 15
    assert _least(grades, 2) >= 15
    # Its integrator's tolerance is 1e-14 or better per step, and an orbit amplifies by some
    # hundred.
    assert _least(grades, 6) >= 12
    assert _least(grades, 7) >= 12


@pytest.mark.parametrize(
    "fault",
    [pytest.param(n, marks=[] if n == 14 else pytest.mark.slow(minutes=0.1)) for n in range(1, 17)],
)
def test_each_fault_of_the_c_client_is_named(
    fault: int, c_client: Path, store: Store, tmp_path: Path
) -> None:
    grades = _answered(
        [str(c_client), "sheet.csv", "answers.csv", str(fault)], _asked(store, RHS), store, tmp_path
    )
    diagnosis = diagnose(grades, store)[0]
    assert diagnosis.level == 1
    assert FAULTS[fault - 1] in diagnosis.summary()
    assert diagnosis.unexplained == 0


@pytest.mark.parametrize(
    "asked",
    [
        (
            "table1/both/",
            "table1/linear/rhs",
            "table1/smooth/rhs",
            "table1/linear/hopf",
            "table1/linear/harmonic",
            "table1/linear/slow-manifold",
            "table1/linear/limit-cycle/crit-0.5",
        ),
        pytest.param(("table1/",), marks=pytest.mark.slow(minutes=3)),
    ],
    ids=["pieces", "printed"],
)
def test_the_python_client(asked: tuple[str, ...], store: Store, tmp_path: Path) -> None:
    """All levels but the cycles nearer than 1e-6 to Omega_h, whose flights doubles do not
    resolve.
    """
    sheet = _asked(store, asked)
    (tmp_path / "client.py").write_text(client_text(CLIENTS["python"]))
    command = [sys.executable, "client.py", "sheet.csv", "answers.csv"]
    grades = _answered(command, sheet, store, tmp_path)
    assert not any(grade.failed for grade in grades)
    rows = list(csv.DictReader(io.StringIO(sheet)))
    assert {row["id"] for row in rows if row["level"] != "9"} <= {grade.id for grade in grades}
    # Levels 1 to 4 are closed forms in doubles; at level 3 differences cancel some hundred times.
    assert min(_least(grades, level) for level in (1, 2, 4)) >= 11
    assert _least(grades, 3) >= 12


class Starter(NamedTuple):
    """What runs a starter, and builds it if need be."""

    tool: str | None
    command: list[str]
    build: tuple[str, ...] = ()


STARTERS = {
    "javascript": Starter(NODE, [str(FOLDER / CLIENTS["javascript"])]),
    "fortran": Starter(
        FORTRAN,
        [],
        ("-O2", "-std=f2008", "-Wall", "-o", "client", str(FOLDER / CLIENTS["fortran"])),
    ),
    "octave": Starter(
        OCTAVE,
        [
            "--no-gui",
            "--quiet",
            "--path",
            str(FOLDER),
            "--eval",
            "tippedisk_answers('sheet.csv', 'answers.csv')",
        ],
    ),
    "julia": Starter(JULIA, [str(FOLDER / CLIENTS["julia"])]),
}
#: Of levels 1 and 6, with a short orbit and one that lies flat, and one question that a starter
#: leaves open.
FOR_STARTERS = (
    *(f"table1/{law}/rhs/00" for law in ("both", "linear", "smooth")),
    "table1/linear/trajectory/d1/beta@0.5",
    "table1/linear/trajectory/d1/v@2",
    "table1/smooth/trajectory/a1",
    "table1/linear/hopf/point/period",
)


@pytest.mark.parametrize(
    "language",
    [
        pytest.param(name, marks=pytest.mark.slow(minutes=0.4) if name == "octave" else ())
        for name in STARTERS
    ],
)
def test_a_starter_is_short_and_right(language: str, store: Store, tmp_path: Path) -> None:
    """Level 1 to the digits of doubles, level 6 to those of its fixed step; what it does not
    answer stays empty.
    """
    starter = STARTERS[language]
    assert len(client_text(CLIENTS[language]).splitlines()) <= 150
    if starter.tool is None:
        pytest.skip(f"nothing on this machine runs the starter in {language}")
    if starter.build:
        subprocess.run([starter.tool, *starter.build], check=True, cwd=tmp_path)
    files = [] if language == "octave" else ["sheet.csv", "answers.csv"]
    command = [*(["./client"] if starter.build else [starter.tool]), *starter.command, *files]
    grades = _answered(command, _asked(store, FOR_STARTERS), store, tmp_path)
    assert not any(grade.failed for grade in grades)
    assert {grade.level for grade in grades} == {1, 6}
    assert {"v_rate", "h", "gamma_y"} <= {
        grade.id.rsplit("/", 1)[1] for grade in grades if grade.level == 1
    }
    assert _least(grades, 1) >= 13
    # A step of 1e-4 s against rates of about 30 1/s, to the fourth power, and orbits that amplify
    # by some hundred.
    assert _least(grades, 6) >= 7


# ---------------------------------------------------------------------- answerers, a line at a time
EXAMPLES = Path(__file__).parents[2] / "examples" / "answerers"
#: What builds each, and what runs it.
COMMANDS: dict[str, tuple[list[str], list[str]]] = {
    "answerer.c": (
        [
            "cc",
            "-O2",
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-o",
            "answerer",
            "answerer.c",
            "-lm",
        ],
        ["./answerer"],
    ),
    "answerer.f90": (
        ["gfortran", "-O2", "-std=f2008", "-Wall", "-o", "answerer", "answerer.f90"],
        ["./answerer"],
    ),
    "answerer.m": ([], [OCTAVE or "octave", "--no-gui", "--quiet", "answerer.m"]),
    "answerer.mjs": ([], ["node", "answerer.mjs"]),
    "answerer.py": ([], [sys.executable, "answerer.py"]),
}


@pytest.mark.parametrize("file", COMMANDS)
def test_questions_are_answered_line_by_line(file: str, tmp_path: Path) -> None:
    build, command = COMMANDS[file]
    if shutil.which((build or command)[0]) is None:
        pytest.skip(f"nothing on this machine runs {file}")
    shutil.copy(EXAMPLES / file, tmp_path)
    if build:
        subprocess.run(build, check=True, cwd=tmp_path)
    store = load_store()
    asked = store.matching("table1/both/rhs/001/")
    lines = [
        json.dumps(question_fields(store.parameters["table1"], quantity)) for quantity in asked
    ]
    done = subprocess.run(
        command,
        input="\n".join(lines) + "\n",
        check=True,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    answers = {
        answer["id"]: answer["answer"] for answer in map(json.loads, done.stdout.splitlines())
    }
    assert answers.keys() == {quantity.id for quantity in asked}
    given = {id_: answer for id_, answer in answers.items() if answer is not None}
    assert {id_.rpartition("/")[2] for id_ in given} >= {"f_G", "w_y", "gamma_y", "gamma_rate"}
    for id_, answer in given.items():
        assert compare(id_, answer).digits > 13
