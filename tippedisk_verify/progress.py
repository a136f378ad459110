"""Progress of long work: a live bar on a terminal's standard error, one output in a notebook, elsewhere nothing.

What computes tells what it has done by calling an `Advance`; its caller decides here whether that is shown.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import copy_context
from datetime import timedelta
from importlib import import_module
from threading import Event, Thread
from typing import Any, TypeVar

__all__ = ["Advance", "progress_of", "watched"]

Advance = Callable[[str, int], None]  #: takes what is being done, and the steps that have been done since it last was
Item = TypeVar("Item")

_PATIENCE, _BETWEEN_DRAWINGS = 2.0, 0.1  # s in which nothing is shown, and between two drawings


@contextmanager
def progress_of(total: int = 0, progress: bool | None = None) -> Iterator[Advance]:
    """An `Advance` whose ``total`` steps (0 if nobody knows) are shown if they take long, unless ``progress`` is False.

    A thread of its own shows them, so that time is seen to pass within a step as well.
    """
    if progress is False or sys.stderr is None:
        yield lambda label, steps: None
        return
    told, over = [("at work", 0)], Event()

    def advance(label: str, steps: int) -> None:
        told[0] = label or told[0][0], told[0][1] + steps

    def show() -> None:
        if over.wait(_PATIENCE):
            return
        with (
            suppress(OSError, ValueError, ImportError, MemoryError),  # what cannot be shown is given up
            (_in_notebook if _has_kernel() else _on_terminal)(total) as draw,
        ):
            while not over.wait(_BETWEEN_DRAWINGS):
                draw(*told[0])
            draw(*told[0])

    # A kernel finds the cell that an output belongs to by the context.
    thread = Thread(target=copy_context().run, args=(show,), daemon=True)
    with suppress(RuntimeError):  # the process may have no more threads
        thread.start()
    try:
        yield advance
    finally:
        over.set()
        if thread.ident is not None:
            thread.join()


@contextmanager
def _on_terminal(total: int) -> Iterator[Advance]:
    """Draw a bar on standard error, if that is a terminal; it vanishes at the end."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True, force_jupyter=False)
    left = (TextColumn("left"), TimeRemainingColumn()) if total else ()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), *left)
    hidden = not console.is_interactive
    with Progress(*columns, console=console, transient=True, redirect_stdout=False, disable=hidden) as bar:
        task = bar.add_task("", total=total or None)
        bar.tasks[0].start_time = bar.get_time() - _PATIENCE
        yield lambda label, done: bar.update(task, description=label, completed=done)


def _has_kernel() -> bool:
    """Return True if this process runs the cells of a notebook."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


@contextmanager
def _in_notebook(total: int) -> Iterator[Advance]:
    """Write a line in the cell, and replace it: a notebook that is run to a file stores each output that is not."""
    display: Any = import_module("IPython.display").display
    began = time.monotonic() - _PATIENCE
    handle = display({"text/plain": ""}, raw=True, display_id=True)

    def draw(label: str, done: int) -> None:
        seconds = time.monotonic() - began
        line = f"{label} {done}/{total or '?'}, {timedelta(seconds=round(seconds))}"
        if 0 < done < total:
            line += f", {timedelta(seconds=round(seconds * (total - done) / done))} left"
        handle.update({"text/plain": line}, raw=True)

    yield draw


def watched(items: Iterable[Item], label: str, total: int = 0, progress: bool | None = None) -> Iterator[Item]:
    """The items as they come, each a step that is shown as `progress_of` says."""
    with progress_of(total, progress) as advance:
        advance(label, 0)
        for item in items:
            advance(label, 1)
            yield item
