"""The answerers in each language: a question a line in, an answer a line out."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tippedisk_verify.conformance.grading import compare
from tippedisk_verify.reference_values.grading_rules import question_fields
from tippedisk_verify.reference_values.store import load_store

EXAMPLES = Path(__file__).parents[2] / "examples" / "answerers"
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
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
