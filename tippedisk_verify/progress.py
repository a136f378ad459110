"""Progress of long work on standard error: a live bar on a terminal and in a notebook, elsewhere nothing.

What computes tells what it has done by calling an `Advance`; its caller decides here whether that is shown.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TypeVar

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
        with suppress(OSError, ValueError, ImportError, MemoryError):  # what cannot be shown is given up
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            # A notebook's standard error takes what a terminal's does; rich's own way there needs another package.
            console = Console(stderr=True, force_jupyter=False)
            columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
            hidden = not console.is_interactive
            with Progress(*columns, console=console, transient=True, redirect_stdout=False, disable=hidden) as bar:
                task = bar.add_task("", total=total or None)
                bar.tasks[0].start_time = bar.get_time() - _PATIENCE
                while not over.wait(_BETWEEN_DRAWINGS):
                    bar.update(task, description=told[0][0], completed=told[0][1])

    thread = Thread(target=show, daemon=True)
    with suppress(RuntimeError):  # the process may have no more threads
        thread.start()
    try:
        yield advance
    finally:
        over.set()
        if thread.ident is not None:
            thread.join()


def watched(items: Iterable[Item], label: str, total: int = 0, progress: bool | None = None) -> Iterator[Item]:
    """The items as they come, each a step that is shown as `progress_of` says."""
    with progress_of(total, progress) as advance:
        advance(label, 0)
        for item in items:
            advance(label, 1)
            yield item
