"""Ctrl-C, TERM and HUP on the command line: one line and exit status 128 + signal, whatever the process is doing.

Python raises KeyboardInterrupt wherever it happens to be. In a destructor, a callback or an import by an extension
module the exception is printed and lost; in an import it leaves half a module behind. So the command line raises
nothing. It undoes what must not stay, writes its line and leaves, from within the signal's handler.

Only the first function touches the process's signals, and only the command line's entry calls it. In a program
that imports the package, signals do what that program wants.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

__all__ = ["answering", "deaf_children", "unbroken", "undoing"]

_ANSWERED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # the last is what a terminal sends when it is closed

# Lists, because appending and removing are single steps to other threads and to the handler.
_holding: list[None] = []
_undoing: list[Callable[[], object]] = []
_pressed: list[int] = []


@contextmanager
def answering() -> Iterator[None]:
    """In here these signals end this process as described above. For the main thread.

    TERM and HUP stay ignored where they are: `nohup` wants that. Afterwards all is done and said; what Python tears
    down then should neither be cut short nor complain.
    """
    for number in _ANSWERED:
        if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _handle)
    try:
        yield
    finally:
        for number in _ANSWERED:
            signal.signal(number, signal.SIG_IGN)


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
    """Let processes that are started in here never hear Ctrl-C or HUP, which a terminal sends to them as well.

    TERM they hear: it is how Python ends the rest of a pool that has lost a process.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*_ANSWERED} - {signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _handle(number: int, frame: object) -> None:
    _pressed.append(number)
    if len(_pressed) == 1 and not _holding:
        _leave()


def _leave() -> None:
    _holding.append(None)  # what is undone may itself be unbroken
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
            name = signal.Signals(_pressed[0]).name
            says = "interrupted" if name == "SIGINT" else f"stopped by {name}"
            os.write(stream, _clear(stream) + f"tippedisk-verify: {says}\n".encode())
    finally:
        os._exit(128 + _pressed[0])


def _clear(stream: int) -> bytes:
    """What takes ^C or a bar off a terminal's line, and shows the cursor, which a bar hides."""
    return b"\r\x1b[2K\x1b[?25h" if os.isatty(stream) and os.environ.get("TERM", "dumb") != "dumb" else b""
