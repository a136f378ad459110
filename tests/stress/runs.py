"""The program as a process of its own, with limits, without rights, in odd surroundings."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

PROGRAM = [sys.executable, "-m", "tippedisk_verify"]
LONGEST = 240  # s; a run that is still there then hangs
ROOT = Path(__file__).parents[2]
MAKE = [str(ROOT / "reference_data" / "make")]
GENERATE = [*MAKE, "printed/linear/hopf", "--jobs", "1", "--quiet", "--out"]
SWEEP = ["sweep", "hopf", "--over", "g=9.7:9.9:300", "--executor", "serial", "--quiet", "--out"]


def program(arguments: Sequence[str]) -> list[str]:
    """The command line of these arguments: the program's, or that of what makes the reference data."""
    return [*(PROGRAM[:1] if arguments[0] in MAKE else PROGRAM), *arguments]


def environment(**changes: str | None) -> dict[str, str]:
    merged = {**os.environ, "OPENBLAS_NUM_THREADS": "1", **changes}
    return {name: value for name, value in merged.items() if value is not None}


def run(
    arguments: list[str],
    prefix: tuple[str, ...] = (),
    limits: dict[int, int] | None = None,
    errors: str = "strict",
    **changes: str | None,
) -> subprocess.CompletedProcess[str]:
    def limited() -> None:
        for what, limit in (limits or {}).items():
            resource.setrlimit(what, (limit, limit))

    return subprocess.run(
        [*prefix, *program(arguments)],
        capture_output=True,
        text=True,
        errors=errors,
        timeout=LONGEST,
        env=environment(**changes),
        preexec_fn=limited if limits else None,
        cwd="/tmp",
    )


def one_line(done: subprocess.CompletedProcess[str], *statuses: int) -> str:
    assert done.returncode in statuses, done
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("tippedisk-verify: ")
    return done.stderr


def without_rights() -> tuple[str, ...]:
    """What takes root's way past the rights of files; nothing for others."""
    if os.geteuid():
        return ()
    if shutil.which("setpriv") is None:
        pytest.skip("root without setpriv: rights cannot be taken away")
    return ("setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner")
