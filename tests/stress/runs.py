"""The program as a separate process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

PROGRAM = [sys.executable, "-m", "tippedisk_verify"]
LONGEST = 240  # s; a run that is still there then hangs
ROOT = Path(__file__).parents[2]
MAKE = [str(ROOT / "reference_data" / "make")]
GENERATE = [*MAKE, "table1/linear/hopf", "--jobs", "1", "--quiet", "--out"]
SWEEP = ["sweep", "hopf", "--over", "g=9.7:9.9:300", "--executor", "serial", "--quiet", "--out"]


def program(arguments: Sequence[str]) -> list[str]:
    """Return the command line of the program, or of `reference_data/make`, with these arguments."""
    return [*(PROGRAM[:1] if arguments[0] in MAKE else PROGRAM), *arguments]


def environment(**changes: str) -> dict[str, str]:
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", **changes}


def run(arguments: list[str], **changes: str) -> subprocess.CompletedProcess[str]:
    command, own = program(arguments), environment(**changes)
    return subprocess.run(
        command, capture_output=True, text=True, timeout=LONGEST, env=own, cwd="/tmp", check=False
    )


def one_line(done: subprocess.CompletedProcess[str], *statuses: int) -> str:
    assert done.returncode in statuses, done
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("tippedisk-verify: ")
    return done.stderr
