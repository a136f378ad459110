"""Progress of long work: where it is shown, and what turns it off."""

from __future__ import annotations

import io
import sys
from threading import Thread

import pytest

import tippedisk_verify as tv
from tippedisk_verify import progress
from tippedisk_verify.cli import main

_CALLS = {
    "basins": lambda wanted: tv.Disk("printed").basins("30.4", count=50, progress=wanted),
    "branch": lambda wanted: tv.Disk("printed").branch("30.4", progress=wanted),
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
def test_what_takes_long_is_shown_on_a_terminal(terminal, monkeypatch, capsys) -> None:
    told = io.StringIO()
    told.isatty = lambda: terminal  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", told)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)
    with progress.progress_of(5) as advance:
        advance("cycles", 2)
        while terminal and "2/5" not in told.getvalue():
            pass
    assert terminal or told.getvalue() == ""
    assert capsys.readouterr().out == ""
