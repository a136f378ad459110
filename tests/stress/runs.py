"""The program as a separate process, and Ctrl-C, or a kill, at a chosen step of it.

A strike at a step, or at random moments once the program listens, needs code inside the process.
Python imports a module named ``sitecustomize`` when it starts, and the one written here waits for
the step.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

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


# ------------------------------------------------------------------------------------------ strikes
INTERRUPTED = "tippedisk-verify: interrupted\n"


def ended_by(number: int) -> tuple[int, str]:
    """Return the exit status and the standard error of a run that a signal has ended."""
    return (130, INTERRUPTED) if number == signal.SIGINT else (-number, "")


_WATCH = '''
"""Says in the file LISTENS that the program listens, and strikes it at the step that STRIKE names."""
import atexit, os, signal, sys, weakref

# An audit event and its first argument, or "call" and the name of a function; which time; and from within what.
# "*" is any name.
kind, name, count, *within = os.environ["STRIKE"].split()
left = int(count)
listens = False

def interrupt(*given):
    signal.raise_signal(int(os.environ["STRIKE_BY"]))

class Dying:
    __del__ = interrupt

class Gone:
    pass

def strike():
    if within == ["destructor"]:
        Dying()
    elif within == ["weakref"]:
        gone = Gone()
        reference = weakref.ref(gone, interrupt)
        del gone
    elif within == ["exit"]:
        atexit.register(interrupt)
    else:
        interrupt()

def begin():
    global listens
    listens = True
    with open(os.environ["LISTENS"], "w") as stream:
        stream.write("yes")
    if kind == "call":
        sys.setprofile(called)

def passed(found):
    global left
    if name in ("*", found):
        left -= 1
        if left == 0:
            strike()

def happened(event, arguments):
    # The first module that the command line's entry imports, and the last moment before there is anything to stop.
    if not listens and event == "import" and arguments[0] == "tippedisk_verify.cli":
        begin()
    elif listens and event == kind:
        passed(arguments[0])

def called(frame, event, argument):
    if event == "call":
        passed(frame.f_code.co_name)

sys.addaudithook(happened)
'''


class Struck:
    """Runs of the program with that module; ``folder`` holds the module's files."""

    def __init__(self, folder: Path, program: Sequence[str] = PROGRAM) -> None:
        self._program = program
        folder.mkdir(exist_ok=True)
        (folder / "sitecustomize.py").write_text(_WATCH, encoding="utf-8")
        self._path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._listens = folder / "listens"

    def at(
        self, step: str, arguments: Sequence[str], number: int = signal.SIGINT
    ) -> tuple[int | None, str, str]:
        """Strike a run at a step, "event name count [within]"; return its exit status, output and
        error.
        """
        return _end(self._started(arguments, step, number))

    def lasts(self, arguments: Sequence[str]) -> float:
        """Measure the time of a whole run from the moment it listens [s], to draw moments from."""
        run = self._listening(arguments)
        begin = time.monotonic()
        assert _end(run)[0] == 0
        return time.monotonic() - begin

    def at_random(
        self, arguments: Sequence[str], number: int, lasts: float, seed: int = 0
    ) -> Iterator[tuple[int | None, str, str]]:
        """Yield the ends of runs that a signal has ended, at moments spread evenly over ``lasts``
        seconds.

        A run that ends before its signal must have succeeded, and does not count. So the caller
        gets as many struck runs as it takes, on any machine. Moments before the program listens are
        left out, because Python's own start answers them.
        """
        draw = random.Random(seed)
        while True:
            run = self._listening(arguments)
            with suppress(subprocess.TimeoutExpired):
                run.wait(draw.uniform(0, lasts))
            with suppress(ProcessLookupError):
                if draw.random() < 0.5:
                    run.send_signal(number)
                else:
                    # As a terminal does, to all that belong to the command
                    os.killpg(run.pid, number)
            end = _end(run)
            if end[0] == 0:
                assert end[2] == ""
            else:
                yield end

    def _listening(self, arguments: Sequence[str]) -> subprocess.Popen[str]:
        run = self._started(arguments, "none none 0")
        until = time.monotonic() + LONGEST
        while not self._listens.exists() and run.poll() is None:
            assert time.monotonic() < until, "the program does not start"
            time.sleep(0.001)
        return run

    def _started(
        self, arguments: Sequence[str], step: str, number: int = signal.SIGINT
    ) -> subprocess.Popen[str]:
        self._listens.unlink(missing_ok=True)
        pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        own = environment(
            PYTHONPATH=self._path,
            LISTENS=str(self._listens),
            STRIKE=step,
            STRIKE_BY=str(int(number)),
        )
        program = self._program[:1] if arguments[0] in MAKE else self._program
        # A group of its own, as a shell gives to a command.
        options = {**pipes, "env": own, "start_new_session": True, "preexec_fn": _hearing}
        return subprocess.Popen([*program, *arguments], **options)


def _hearing() -> None:
    """Reset the handling of Ctrl-C, which the process that runs the tests may ignore."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _end(run: subprocess.Popen[str]) -> tuple[int | None, str, str]:
    """Read standard error to its end, which the last process of the run closes."""
    try:
        out, told = run.communicate(timeout=LONGEST)
    except subprocess.TimeoutExpired:
        os.killpg(run.pid, signal.SIGKILL)
        run.communicate()
        raise
    return run.returncode, out, told
