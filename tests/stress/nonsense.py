"""The refusal of nonsense on the command line: status 2, one clear line, no standard output."""

from __future__ import annotations

import contextlib
import io
import re
import time
from dataclasses import dataclass

from tippedisk_verify.cli import main


@dataclass
class Ran:
    """The outcome of a command."""

    status: int
    out: str
    err: str
    seconds: float  #: of this process's CPU


def ran(arguments: list[str]) -> Ran:
    """Run the command line in this process; any exception is a fault of the program."""
    out, err = io.StringIO(), io.StringIO()
    begin = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(arguments)
    return Ran(status, out.getvalue(), err.getvalue(), time.process_time() - begin)


_LINE = re.compile(r"[^\n]{1,1020}\n")


def assert_refused(arguments: list[str]) -> Ran:
    done = ran(arguments)
    assert done.status == 2, (arguments, done)
    assert done.out == "", (arguments, done)
    assert _LINE.fullmatch(done.err), (arguments, done)
    assert done.err.rstrip("\n").isprintable(), (arguments, done)
    return done
