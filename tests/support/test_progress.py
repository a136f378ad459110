"""Progress of long work: where it is shown, and how it is turned off."""

from __future__ import annotations

import inspect
import io
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import pytest

import tippedisk_verify as tv
from tippedisk_verify.cli import main
from tippedisk_verify.support import progress

_CALLS = {
    "basins": lambda wanted: tv.Disk("table1").basins("30.4", count=50, progress=wanted),
    "branch": lambda wanted: tv.Disk("table1").branch("30.4", progress=wanted),
    "grade": lambda wanted: tv.grade({"table1/linear/hopf/point/period": 1.0}, progress=wanted),
    "stress": lambda wanted: main(
        ["stress", "--only", "epsilon 1, linear", *["--quiet"] * (wanted is False)]
    ),
}


_LONG = {
    "limit cycle": lambda: tv.Disk("table1").limit_cycle("30.4", digits=32),
    "cycle next to Omega_h": lambda: tv.Disk("table1").limit_cycle(above_het="1e-3", digits=20),
    "monodromy matrix": lambda: tv.Disk("table1").limit_cycle("30.41").monodromy,
    # A disk that no other test asks: Omega_h is kept
    "Omega_h": lambda: tv.Disk("table1", g="9.79").heteroclinic(digits=28),
}


@pytest.mark.parametrize(
    "call",
    [
        pytest.param(name, marks=pytest.mark.slow(minutes=0.1) if name == "limit cycle" else ())
        for name in _LONG
    ],
)
def test_long_numbers_report_their_share(call, monkeypatch) -> None:
    """The share only grows, to 100 percent at most, in several steps."""
    steps = [0]

    @contextmanager
    def seen(total: int, wanted: bool) -> Iterator[progress.Advance]:
        yield lambda label, more: steps.append(steps[-1] + more)

    monkeypatch.setattr(progress, "_shown", seen)
    _LONG[call]()
    assert steps == sorted(steps)
    assert len(set(steps)) > 3
    assert 40 < steps[-1] <= 100


def test_only_the_outermost_progress_is_shown(monkeypatch) -> None:
    started: list[Thread] = []
    monkeypatch.setattr(Thread, "start", lambda thread: started.append(thread))
    with progress.show_progress() as unseen:
        unseen("nothing", 1)
    assert not started  # nobody sees the standard error of a test
    monkeypatch.setattr(progress, "_has_viewer", lambda: True)
    with progress.show_progress(), progress.show_progress(3) as inner:
        inner("nothing", 1)
    with progress.show_progress(progress=False), progress.show_share("nothing"):
        progress.report_share(0.5)
    assert len(started) == 1
    progress.report_share(0.5)  # outside any work


@pytest.mark.parametrize("call", _CALLS)
def test_work_is_watched_unless_that_is_turned_off(call, monkeypatch) -> None:
    class Watching(Thread):
        def start(self) -> None:
            watching.append(self)
            super().start()

    watching: list[Thread] = []
    monkeypatch.setattr(progress, "Thread", Watching)
    monkeypatch.setattr(progress, "_has_viewer", lambda: True)
    _CALLS[call](False)
    assert watching == []
    _CALLS[call](None)
    assert len(watching) == 1
    assert not watching[0].is_alive()


@pytest.mark.parametrize("terminal", [False, True])
def test_long_work_is_shown_on_a_terminal_with_its_end(terminal, monkeypatch, capsys) -> None:
    output = io.StringIO()
    output.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", output)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "_DELAY", 0.0)
    with progress.show_progress(5) as advance:
        advance("cycles", 2)
        while terminal and not re.search(r"2/5.* left .*\d:\d\d:\d\d", output.getvalue()):
            time.sleep(0.01)
            advance("", 0)
    assert terminal or output.getvalue() == ""
    assert capsys.readouterr().out == ""


def test_a_notebook_that_is_run_to_a_file_stores_one_output_for_each_work() -> None:
    """Draw three times at least, with a known number of steps and with an unknown one."""
    nbformat, client = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    cell = """
        import threading, IPython.display
        from tippedisk_verify.support import progress
        update = IPython.display.DisplayHandle.update
        def counted(*data, **how):
            update(*data, **how)
            drawn.release()
        IPython.display.DisplayHandle.update = counted
        progress._DELAY = progress._BETWEEN_DRAWINGS = 0.0
        for total in (5, 0):
            drawn = threading.Semaphore(0)
            with progress.show_progress(total) as advance:
                advance("cycles", 2)
                for _ in range(3):
                    drawn.acquire()
    """
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(inspect.cleandoc(cell))])
    client.NotebookClient(notebook, timeout=60).execute()
    known, unknown = (output["data"]["text/plain"] for output in notebook.cells[0].outputs)
    assert re.fullmatch(r"cycles 2/5, \d:\d\d:\d\d, \d:\d\d:\d\d left", known)
    assert re.fullmatch(r"cycles 2/\?, \d:\d\d:\d\d", unknown)
