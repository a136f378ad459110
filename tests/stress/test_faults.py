"""Faults of a machine: kills, full disks, missing rights, damaged caches, little memory."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import rows_of
from tests.stress.runs import (
    GENERATE,
    LONGEST,
    PROGRAM,
    SWEEP,
    Struck,
    ended_by,
    one_line,
    run,
)
from tippedisk_verify.reference_values.manifest import faults_in_files

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="signals, limits and rights are POSIX here"
)


# ------------------------------------------------------------------------------ kill -9 and Ctrl-C
def _whole(folder: Path) -> int:
    """Check that every visible file is complete, old or new, and return their number."""
    found = [
        path
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".") and ".work" not in path.parts
    ]
    for path in found:
        text = path.read_text(encoding="utf-8")
        assert text.endswith("\n"), path
        if path.suffix == ".json":
            json.loads(text)
        if path.suffix == ".csv":
            rows = list(csv.reader(text.splitlines()))
            assert len({len(row) for row in rows}) == 1, path
    return len(found)


@pytest.mark.parametrize(
    ("number", "count"),
    [
        pytest.param(signal.SIGKILL, 3, marks=pytest.mark.slow(minutes=0.2)),
        pytest.param(signal.SIGINT, 40, marks=pytest.mark.slow(minutes=0.7)),
    ],
)
def test_strikes_leave_whole_files(number: int, count: int, tmp_path: Path) -> None:
    """Strike runs that write into one folder at random moments, then let each run to its end."""
    folder = tmp_path / "out"
    folder.mkdir()
    struck = Struck(tmp_path / "hand")
    commands = [
        [*GENERATE, str(folder / "data")],
        [*SWEEP, str(folder / "sweep.csv")],
        ["conformance", "questions", str(folder / "sheet.csv"), "--quiet"],
    ]
    ends = [
        struck.at_random(arguments, number, struck.lasts(arguments), count)
        for arguments in commands
    ]
    files = _whole(folder)
    for n in range(count):
        ended, _, told = next(ends[n % len(ends)])
        assert (ended, told) == ended_by(number)
        assert _whole(folder) >= files  # nothing that was there is lost or cut
    for arguments in commands:
        assert run(arguments).returncode == 0
    assert _whole(folder) == files
    assert faults_in_files(folder / "data") == []
    rows = rows_of(folder / "sweep.csv")
    assert (len(rows), {row["status"] for row in rows}) == (300, {"ok"})
    assert not list(folder.glob(".*journal"))


def test_a_pool_that_is_killed_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from concurrent.futures.process import BrokenProcessPool

    from tippedisk_verify import cli

    def dies(*given: object, **named: object) -> None:
        raise BrokenProcessPool("a child process terminated abruptly")

    for fault in (dies, lambda *given, **named: (_ for _ in ()).throw(MemoryError())):
        monkeypatch.setattr("tippedisk_verify.theory.hopf.hopf_point", fault)
        assert cli.main(["hopf"]) == 1
        assert capsys.readouterr().err.count("\n") == 1


# ------------------------------------------------------------------------------------------- disks
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["hopf", "--json"], ["--help"], ["reference", "list"]])
def test_a_full_disk_under_standard_output(arguments: list[str]) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*PROGRAM, *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=LONGEST,
            check=False,
        )
        both = subprocess.run(
            [*PROGRAM, *arguments], stdout=full, stderr=full, timeout=LONGEST, check=False
        )
    assert "No space left" in one_line(done, 2)
    assert both.returncode == 2


def test_standard_output_that_is_closed() -> None:
    for closing_of in (">&-", "2>&-"):
        command = ["sh", "-c", f'"$@" {closing_of}', "sh", *PROGRAM, "hopf"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
        assert (done.returncode, done.stderr) == (0, "")
