"""Ctrl-C on the command line: one line and exit status 130, whatever the process is doing.

Python raises KeyboardInterrupt wherever it happens to be. In a destructor, a callback or an import by an extension
module the exception is printed and lost; in an import it leaves half a module behind. So the command line raises
nothing. It undoes what must not stay, writes its line and leaves, from within the signal's handler.

Only `answer_interrupts` touches the process's signals, and only the command line's entry calls it. In a program that
imports the package, Ctrl-C does what that program wants.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

__all__ = ["answer_interrupts", "deaf_children", "unbroken", "undoing"]

# Lists, because appending and removing are single steps to other threads and to the handler.
_holding: list[None] = []
_undoing: list[Callable[[], object]] = []
_pressed: list[None] = []


def answer_interrupts() -> None:
    """From now on Ctrl-C ends this process as described above. For the main thread."""
    signal.signal(signal.SIGINT, _handle)


@contextmanager
def unbroken() -> Iterator[None]:
    """Put the answer off until this is left. For short steps that must be done whole or not at all."""
    _holding.append(None)
    try:
        yield
    finally:
        _holding.pop()
        if _pressed and not _holding:
            _leave()


@contextmanager
def undoing(action: Callable[[], object]) -> Iterator[None]:
    """Have the answer call ``action`` while this is entered.

    It runs between any two steps of the main thread, so it must not wait for a lock that the main thread may hold.
    """
    _undoing.append(action)
    try:
        yield
    finally:
        _undoing.remove(action)


@contextmanager
def deaf_children() -> Iterator[None]:
    """Let processes that are started in here never hear Ctrl-C, which a terminal sends to them as well."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _handle(number: int, frame: object) -> None:
    _pressed.append(None)
    if len(_pressed) == 1 and not _holding:
        _leave()


def _leave() -> None:
    stream = None if sys.stderr is None else 2  # where it was closed from the start, 2 may be any file
    try:
        if stream is not None:
            with suppress(OSError):
                # Threads that draw a bar, or miss the processes that they wait for, have nothing more to say.
                stream = os.dup(2)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        for action in reversed(_undoing):
            with suppress(Exception):
                action()
        if stream is not None:
            os.write(stream, _clear(stream) + b"tippedisk-verify: interrupted\n")
    finally:
        os._exit(130)


def _clear(stream: int) -> bytes:
    """What takes ^C or a bar off a terminal's line, and shows the cursor, which a bar hides."""
    return b"\r\x1b[2K\x1b[?25h" if os.isatty(stream) and os.environ.get("TERM", "dumb") != "dumb" else b""
