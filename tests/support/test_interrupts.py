"""Ctrl-C gives one line and exit status 130 at any moment, and nothing is left half done."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from tests.stress.runs import INTERRUPTED, LONGEST, PROGRAM, Struck

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX here")

_ORBIT = "orbit --below-crit 0.5 --quiet"
_SWEEP = "sweep hopf --over g=9.7:9.9:40 --quiet --out {folder}/a.csv"


@pytest.fixture
def struck(tmp_path: Path) -> Struck:
    return Struck(tmp_path / "hand")


@pytest.mark.parametrize(
    ("arguments", "step"),
    [
        *[("--version", f"call * {10**n}") for n in (0, 3)],
        ("hopf", "call * 8000"),
        # Python prints an exception that it cannot hand to anybody, and goes on.
        *[(_ORBIT, f"import mpmath 1 {within}") for within in ("weakref", "destructor")],
        # Imports by Python, by an extension module, and of one.
        *[(_ORBIT, f"import {name} 1") for name in ("click", "gmpy2.gmpy2", "heyoka")],
        # Starting processes, waiting for them, and writing down what they computed.
        *[(f"{_SWEEP} --jobs 2", f"call {name} 1") for name in ("spawnv_passfds", "keep")],
        pytest.param(f"{_SWEEP} --jobs 2", "call wait 1", marks=pytest.mark.slow(minutes=0.05)),
    ],
)
def test_an_interruption_is_one_line(
    arguments: str, step: str, struck: Struck, tmp_path: Path
) -> None:
    assert struck.at(step, arguments.format(folder=tmp_path).split())[::2] == (130, INTERRUPTED)


def test_the_console_script_listens_as_early(tmp_path: Path) -> None:
    project = tomllib.loads(
        (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    )["project"]
    module, _, function = project["scripts"]["tippedisk-verify"].partition(":")
    struck = Struck(
        tmp_path, [sys.executable, "-c", f"from {module} import {function}; {function}()"]
    )
    assert struck.at("import click 1", ["--version"])[::2] == (130, INTERRUPTED)


def test_a_result_that_is_out_is_not_called_interrupted(struck: Struck) -> None:
    """Interrupt while Python ends, when nothing is left to stop."""
    status, out, message = struck.at("import mpmath 1 exit", ["hopf"])
    assert (status, message) == (0, "")
    assert out.startswith("omega_crit")


@pytest.mark.parametrize("step", ["tempfile.mkstemp * 1", "os.rename * 1"])
def test_a_file_is_written_whole_first(step: str, struck: Struck, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    arguments = ["conformance", "questions", str(out / "sheet.csv"), "--levels", "3", "--quiet"]
    assert struck.at(step, arguments)[::2] == (130, INTERRUPTED)
    assert [path.name for path in out.iterdir()] == ["sheet.csv"]
    assert (out / "sheet.csv").read_text(encoding="utf-8").endswith("\n")


def test_a_terminal_gets_its_cursor_back(tmp_path: Path) -> None:
    """Interrupt once the live bar has hidden the cursor; its thread draws on until the end."""
    ours, theirs = os.openpty()
    at_once = (
        "import runpy; from tippedisk_verify.support import progress; progress._DELAY = 0.0; "
        "runpy.run_module('tippedisk_verify', run_name='__main__')"
    )
    words = ["sweep", "hopf", "--over", "g=9.7:9.9:9999", "--executor", "serial", "--out"]
    process = subprocess.Popen(
        [sys.executable, "-c", at_once, *words, str(tmp_path / "a.csv")],
        stderr=theirs,
        env={**os.environ, "TERM": "xterm"},
    )
    os.close(theirs)
    shown, hidden = bytearray(), False
    with suppress(OSError):  # which is how a terminal ends that nobody writes to any more
        while True:
            shown.extend(os.read(ours, 65536))
            if not hidden and b"\x1b[?25l" in shown:
                hidden = True
                process.send_signal(signal.SIGINT)
    os.close(ours)
    assert process.wait() == 130
    assert hidden
    assert shown.endswith(b"\r\x1b[2K\x1b[?25htippedisk-verify: interrupted\r\n")


def test_a_file_that_has_the_number_of_standard_error_is_not_written_to(tmp_path: Path) -> None:
    """Close standard error from the start, so that the next opened file gets its number."""
    out = tmp_path / "out"
    out.mkdir()
    struck = Struck(tmp_path / "hand", ["sh", "-c", 'exec "$@" 2>&-', "sh", *PROGRAM])
    assert (
        struck.at("call keep 3", f"{_SWEEP} --executor serial".format(folder=out).split())[0] == 130
    )
    journal = (out / ".a.csv.journal").read_text().splitlines()
    assert len([json.loads(line) for line in journal]) == 3


def test_the_package_leaves_signals_to_its_users() -> None:
    """Check also while libraries are loaded, and when the command line runs inside a program."""
    program = (
        "import signal, sys\n"
        "mine = lambda *given: None\n"
        "signal.signal(signal.SIGINT, mine)\n"
        "changed = []; signal.signal = signal.pthread_sigmask = lambda *given: "
        "changed.append(given)\n"
        "from tippedisk_verify.flow.jit import heyoka_module; heyoka_module()\n"
        "from tippedisk_verify.cli import main\n"
        "assert main(['hopf', '--quiet']) == 0\n"
        "assert signal.getsignal(signal.SIGINT) is mine and not changed, changed\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
