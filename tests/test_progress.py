"""Progress of long work: where it is shown, what turns it off, and that Ctrl-C ends it all the same."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from threading import Thread

import pytest

import tippedisk_verify as tv
from tippedisk_verify import progress
from tippedisk_verify.cli import main

_CALLS = {
    "basins": lambda wanted: tv.Disk("printed").basins("30.4", count=50, progress=wanted),
    "branch": lambda wanted: tv.Disk("printed").branch("30.4", progress=wanted),
    "rotating_branch": lambda wanted: tv.Disk("printed").rotating_branch("30.03", progress=wanted),
    "grade": lambda wanted: tv.grade({"printed/linear/hopf/point/period": 1.0}, progress=wanted),
    "stress": lambda wanted: main(["stress", "--only", "epsilon 1, linear", *["--quiet"] * (wanted is False)]),
}


@pytest.mark.parametrize("call", _CALLS)
def test_work_is_watched_unless_that_is_turned_off(call, monkeypatch) -> None:
    class Watching(Thread):
        def start(self) -> None:
            watching.append(self)
            super().start()

    watching: list[Thread] = []
    monkeypatch.setattr(progress, "Thread", Watching)
    _CALLS[call](False)
    assert watching == []
    _CALLS[call](None)
    assert len(watching) == 1
    assert not watching[0].is_alive()


@pytest.mark.parametrize("terminal", [False, True])
def test_what_takes_long_is_shown_on_standard_error(terminal, monkeypatch, capsys) -> None:
    told = io.StringIO()
    told.isatty = lambda: terminal  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", told)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "_PATIENCE", 0.01)
    monkeypatch.setattr(progress, "_BETWEEN_LINES", 0.01)
    with progress.progress_of(5) as advance:
        advance("cycles", 2)
        while ("2/5" if terminal else "cycles: 2 of 5 done after ") not in told.getvalue():
            pass
    assert capsys.readouterr().out == ""


def test_ctrl_c_ends_work_that_is_watched() -> None:
    program = (
        "import tippedisk_verify as tv; from tippedisk_verify import progress\n"
        "progress._PATIENCE = progress._BETWEEN_LINES = 0.1; tv.Disk('printed').basins('30.4', count=10**7)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        assert " of 10000000 done after " in run.stderr.readline()
        run.send_signal(signal.SIGINT)
        assert "KeyboardInterrupt" in run.stderr.read()
    assert run.returncode == -signal.SIGINT
