"""Progress of long work: a bar on a terminal's standard error, one output in a notebook.

Anywhere else nothing is shown. A computation reports its steps by calling an `Advance`. Its caller
decides with `show_progress` whether they are shown. A single number that takes long reports its
share with `report_share`, and its caller decides with `show_share`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar, copy_context
from datetime import timedelta
from importlib import import_module
from multiprocessing import parent_process
from threading import Event, Thread
from typing import Any, TypeVar

__all__ = ["Advance", "report_share", "show_progress", "show_share", "subrange", "with_progress"]

#: A function of the name of the work and the number of steps done since the last call.
Advance = Callable[[str, int], None]
Item = TypeVar("Item")

_DELAY = 2.0  # s before anything is shown
_BETWEEN_DRAWINGS = 0.1  # s
# The function that shows the share of the work that is done, and the two shares between which the
# present `subrange` lies; None outside `show_share`
_PART: ContextVar[tuple[Callable[[float], None], float, float] | None] = ContextVar(
    "part", default=None
)
# True inside `show_progress`, where no second one is shown
_WITHIN: ContextVar[bool] = ContextVar("within", default=False)


@contextmanager
def show_progress(total: int = 0, progress: bool | None = None) -> Iterator[Advance]:
    """Yield an `Advance` that shows its steps if they take longer than two seconds.

    A separate thread draws them, so the clock also advances within a step. Within another
    `show_progress`, and in a worker's process, nothing is shown.

    Args:
        total: The number of steps, or 0 if it is not known.
        progress: False shows nothing.
    """
    within = _WITHIN.get()
    _WITHIN.set(True)
    try:
        with _shown(total, progress is not False and not within) as advance:
            yield advance
    finally:
        _WITHIN.set(within)


@contextmanager
def _shown(total: int, wanted: bool) -> Iterator[Advance]:
    """Yield a function that shows progress, as `show_progress` does, or that shows nothing if it is
    not ``wanted``.
    """
    # Starting a thread takes as long as a fifth of a limit cycle.
    if not wanted or not _has_viewer() or parent_process() is not None:
        yield lambda label, steps: None
        return
    current, over = [("at work", 0)], Event()

    def advance(label: str, steps: int) -> None:
        current[0] = label or current[0][0], current[0][1] + steps

    def show() -> None:
        if over.wait(_DELAY):
            return
        with (
            # If drawing fails, nothing is shown.
            suppress(OSError, ValueError, ImportError, MemoryError),
            (_in_notebook if _has_kernel() else _on_terminal)(total) as draw,
        ):
            while not over.wait(_BETWEEN_DRAWINGS):
                draw(*current[0])
            draw(*current[0])

    # A kernel uses the context to find the cell to which an output belongs.
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
    """Yield a function that draws a bar on standard error; without a terminal it draws nothing.

    It takes a label and the number of steps done so far. The bar vanishes at the end.
    """
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
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        *left,
    )
    hidden = not console.is_interactive
    with Progress(
        *columns, console=console, transient=True, redirect_stdout=False, disable=hidden
    ) as bar:
        task = bar.add_task("", total=total or None)
        bar.tasks[0].start_time = bar.get_time() - _DELAY
        yield lambda label, done: bar.update(task, description=label, completed=done)


def _has_viewer() -> bool:
    """Return True if standard error is a terminal, or if this process runs a notebook."""
    with suppress(AttributeError, ValueError):  # there may be no standard error, or a closed one
        return _has_kernel() or sys.stderr.isatty()
    return False


def _has_kernel() -> bool:
    """Return True if this process runs the cells of a notebook."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


@contextmanager
def _in_notebook(total: int) -> Iterator[Advance]:
    """Yield a function that writes a line in the notebook's cell and replaces it at each call.

    It takes a label and the number of steps done so far.
    A notebook that is executed to a file stores every output that is not replaced.
    """
    display: Any = import_module("IPython.display").display
    began = time.monotonic() - _DELAY
    handle = display({"text/plain": ""}, raw=True, display_id=True)

    def draw(label: str, done: int) -> None:
        seconds = time.monotonic() - began
        line = f"{label} {done}/{total or '?'}, {timedelta(seconds=round(seconds))}"
        if 0 < done < total:
            line += f", {timedelta(seconds=round(seconds * (total - done) / done))} left"
        handle.update({"text/plain": line}, raw=True)

    yield draw


def with_progress(
    items: Iterable[Item], label: str, total: int = 0, progress: bool | None = None
) -> Iterator[Item]:
    """Yield the items as they come, and show each as a step of `show_progress`.

    Args:
        items: The items.
        label: The name of the work.
        total: The number of items, or 0 if it is not known.
        progress: False shows nothing.
    """
    with show_progress(total, progress) as advance:
        advance(label, 0)
        for item in items:
            advance(label, 1)
            yield item


@contextmanager
def show_share(label: str, progress: bool | None = None) -> Iterator[None]:
    """Show the share of a computation that `report_share` reports, in percent.

    Args:
        label: The name of the work.
        progress: False shows nothing.
    """
    before, done = _PART.get(), 0

    def show(share: float) -> None:
        nonlocal done
        percent = max(done, int(100 * share))
        advance("", percent - done)
        done = percent

    with show_progress(100, progress) as advance:
        advance(label, 0)
        _PART.set((show, 0.0, 1.0))
        try:
            yield
        finally:
            _PART.set(before)


@contextmanager
def subrange(start: float, end: float) -> Iterator[None]:
    """Count what `report_share` reports within a part of the work, all of which is done at the end.

    Args:
        start: The share of the work before the part.
        end: The share of the work after the part.
    """
    if (before := _PART.get()) is None:
        yield
        return
    show, low, high = before
    _PART.set((show, low + (high - low) * start, low + (high - low) * end))
    try:
        yield
        report_share(1)
    finally:
        _PART.set(before)


def report_share(share: float) -> None:
    """Report the share of the work, or of its present `subrange`, that is done."""
    if (now := _PART.get()) is not None:
        show, low, high = now
        show(low + (high - low) * share)
