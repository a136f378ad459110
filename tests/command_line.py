"""The command line run in this process: its outcome, a JSON answer, the one line of a refusal."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tippedisk_verify.cli import main

#: A file of parameters: Table 1's.
TABLE_1_FILE = (
    'r = "0.045"\ne = "0.0025"\nm = "0.435"\nA = "0.249e-3"\nB = "0.227e-3"\n'
    'g = "9.81"\nmu = "0.3"\nepsilon = "0.1"\n'
)


class Ran(NamedTuple):
    """The outcome of a command."""

    status: int
    out: str
    err: str


def ran(arguments: Sequence[str]) -> Ran:
    """Run the command line in this process; any exception is a fault of the program."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(arguments)
    return Ran(status, out.getvalue(), err.getvalue())


def printed(words: str, status: int = 0) -> str:
    """Return what a command line, written as for a shell, prints; check its exit status."""
    done = ran(shlex.split(words))
    assert done.status == status, done
    return done.out


def answer(words: str, status: int = 0) -> Any:
    """Return the JSON that a command answers with ``--json``."""
    return json.loads(printed(f"{words} --json", status))


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV table."""
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


_LINE = re.compile(r"[^\n]{1,1020}\n")


def assert_refused(arguments: Sequence[str]) -> str:
    """Check status 2, one clear line, and no standard output; return the line."""
    done = ran(arguments)
    assert done.status == 2, (arguments, done)
    assert done.out == "", (arguments, done)
    assert _LINE.fullmatch(done.err), (arguments, done)
    assert done.err.rstrip("\n").isprintable(), (arguments, done)
    return done.err
