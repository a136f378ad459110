"""Ctrl-C on the command line: one line and exit status 130, at any moment.

Python raises KeyboardInterrupt wherever the process happens to be. In a destructor, a callback or
an import by an extension module the exception is printed and lost. In an import it leaves half a
module behind. So the command line raises nothing. The signal's handler undoes what must not stay,
writes one line and ends the process.

Only `handle_ctrl_c` changes the process's signals, and only the command line's entry calls it. In a
program that imports the package, signals keep the effect that the program gives them. Other signals
have their usual effect: files are written as a whole, and worker processes end with their parent,
however it ends.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

__all__ = ["children_without_ctrl_c", "clean_up_on_ctrl_c", "handle_ctrl_c", "postpone_ctrl_c"]

# Lists, because appending and removing are single steps to other threads and to the handler.
_holding: list[None] = []
_undoing: list[Callable[[], object]] = []
_pressed: list[bool] = []


@contextmanager
def handle_ctrl_c() -> Iterator[None]:
    """Let Ctrl-C end this process as the module describes. Call it in the main thread.

    Once the context is left, Ctrl-C is ignored: all output is out by then, and Python's shutdown
    should not be cut short.
    """
    signal.signal(signal.SIGINT, _handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def postpone_ctrl_c() -> Iterator[None]:
    """Postpone the answer to Ctrl-C until the context is left.

    It is for short steps that must be done completely or not at all.
    """
    _holding.append(None)
    try:
        yield
    finally:
        _holding.pop()
        if _pressed and not _holding:
            _end_process()


@contextmanager
def clean_up_on_ctrl_c(action: Callable[[], object]) -> Iterator[None]:
    """Let the answer to Ctrl-C call ``action`` while the context is entered.

    The action can run between any two steps of the main thread. So it must not wait for a lock that
    the main thread may hold.

    Args:
        action: A function without arguments.
    """
    _undoing.append(action)
    try:
        yield
    finally:
        _undoing.remove(action)


@contextmanager
def children_without_ctrl_c() -> Iterator[None]:
    """Keep Ctrl-C from processes that are started in the context.

    A terminal sends it to them as well.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _handle(number: int, frame: object) -> None:
    _pressed.append(True)
    if len(_pressed) == 1 and not _holding:
        _end_process()


def _end_process() -> None:
    _holding.append(None)  # an action may itself enter `postpone_ctrl_c`
    stream = None if sys.stderr is None else 2  # if it was closed from the start, 2 may be any file
    try:
        if stream is not None:
            with suppress(OSError):
                # Silence threads that draw a bar or miss the processes that they wait for.
                stream = os.dup(2)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        for action in reversed(_undoing):
            with suppress(Exception):
                action()
        if stream is not None:
            os.write(stream, _clear(stream) + b"tippedisk-verify: interrupted\n")
    finally:
        os._exit(128 + signal.SIGINT)


def _clear(stream: int) -> bytes:
    """Return the codes that clear a terminal's line and show its cursor; b"" if it is no terminal.

    A progress bar hides the cursor.
    """
    return (
        b"\r\x1b[2K\x1b[?25h"
        if os.isatty(stream) and os.environ.get("TERM", "dumb") != "dumb"
        else b""
    )
