"""A program of somebody else's, spoken to in lines over pipes. Whatever it does, it neither blocks nor outlives this.

One thread does it all: it writes only what the pipe takes, and reads whatever there is. The program gets a process
group of its own, so that Ctrl-C on the terminal does not reach it, and its children end with it.
"""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable
from tippedisk_verify.interrupts import unbroken, undoing

__all__ = ["Program", "started"]

_LONGEST = 100_000  # bytes of a line that are kept; an answer has two thousand at most
_SHOWN, _WIDEST = 20, 300  # lines of standard error, and bytes of each
_AT_ONCE = 65_536  # bytes
_LOOK = 0.02  # s between looks at whether the program is still there
_PATIENCE = 5.0  # s, at most, that a program has to end when its input does


class Program:
    """A running program. `started` makes one, and sees to its end."""

    def __init__(self, command: Sequence[str], limit: float) -> None:
        self.name = printable(command[0])[-60:]
        self.begun = time.perf_counter()
        self._limit = limit
        pipe = subprocess.PIPE
        try:
            self._process = subprocess.Popen(
                list(command), stdin=pipe, stdout=pipe, stderr=pipe, bufsize=0, start_new_session=True
            )
        except (OSError, ValueError) as fault:
            reason = (isinstance(fault, OSError) and fault.strerror) or fault
            raise InputError(f"the program '{self.name}' cannot be started: {reason}") from None
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        self._pipes = tuple(stream for stream in pipes if stream is not None)  # all, as they were asked for
        self._input, output, errors = self._pipes
        self._unsent = self._rest = self._murmur = b""
        self._errors: deque[str] = deque(maxlen=_SHOWN)
        self._errors_before = 0
        self._closed = False  # standard output
        self._selector = selectors.DefaultSelector()
        for stream in self._pipes:
            os.set_blocking(stream.fileno(), False)
        self._selector.register(output, selectors.EVENT_READ, self._hear)
        self._selector.register(errors, selectors.EVENT_READ, self._overhear)

    def ask(self, text: str, waiting: Collection[str], take: Callable[[str], None]) -> str:
        """Write ``text``, and hand each line read to ``take`` until that has emptied ``waiting``.

        Returns why it never will be, or nothing. The limit is for each answer: the clock starts anew when ``waiting``
        gets shorter, and not with other lines.
        """
        if text and not self._input.closed:
            if not self._unsent:  # a program may answer what it has not read
                self._selector.register(self._input, selectors.EVENT_WRITE, self._send)
            self._unsent += text.encode()
        still, deadline = len(waiting), time.monotonic() + self._limit
        while waiting:
            self._listen(take)
            id_ = next(iter(waiting), "")
            if len(waiting) < still:
                still, deadline = len(waiting), time.monotonic() + self._limit
            elif self._closed:
                if self._ends(take):
                    return f"{self.name} ended with {self._fate()} before it answered {id_}"
                return f"{self.name} closed its standard output before it answered {id_}, and was ended"
            elif time.monotonic() >= deadline:
                return f"{self.name} did not answer {id_} within {self._limit:g} s, and was ended"
        return ""

    def finish(self, take: Callable[[str], None]) -> str:
        """End its input, and hand what it still says to ``take``. Returns what was wrong with its end, or nothing."""
        self._close_input()
        if not self._ends(take):
            return f"{self.name} went on when its input had ended, and was ended"
        return "" if (how := self._fate()) == "status 0" else f"{self.name} ended with {how}"

    def errors(self) -> list[str]:
        """The last lines of its standard error."""
        before = [f"({self._errors_before} lines before)"] if self._errors_before else []
        return [*before, *self._errors, *([_shown(self._murmur)] if self._murmur else [])]

    def kill(self) -> None:
        """End the whole group: the program's children, too, may hold the pipes."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def close(self) -> None:
        """Leave nothing behind: no process, no zombie, no open pipe. The end of its input asked it to end before."""
        self.kill()
        self._process.wait()
        self._selector.close()
        for stream in self._pipes:
            stream.close()

    def _fate(self) -> str:
        """How the program has ended; nothing while it runs."""
        code = self._process.poll()
        if code is None:
            return ""
        if code >= 0:
            return f"status {code}"
        return next((known.name for known in signal.Signals if known == -code), f"signal {-code}")

    def _ends(self, take: Callable[[str], None]) -> bool:
        deadline = time.monotonic() + min(self._limit, _PATIENCE)
        while not (self._closed and self._fate()) and time.monotonic() < deadline:
            self._listen(take)
        return bool(self._fate())

    def _close_input(self) -> None:
        if self._unsent:
            self._selector.unregister(self._input)
        self._unsent = b""
        self._input.close()

    def _listen(self, take: Callable[[str], None]) -> None:
        """One look at all pipes."""
        ready = self._selector.select(_LOOK)
        lines = [line for key, _ in ready for line in key.data(key.fileobj)]
        # A child of the program's may keep the pipe open when the program has ended.
        if not ready and not self._closed and self._fate():
            lines = self._last()
        for line in lines:
            take(line.decode("utf-8", "replace"))

    def _send(self, stream: IO[bytes]) -> list[bytes]:
        try:
            self._unsent = self._unsent[os.write(stream.fileno(), self._unsent[:_AT_ONCE]) :]
        except BlockingIOError:
            return []
        except OSError:  # it does not listen any more; it may still answer
            self._close_input()
        else:
            if not self._unsent:
                self._selector.unregister(stream)
        return []

    def _hear(self, stream: IO[bytes]) -> list[bytes]:
        content = self._received(stream)
        *whole, rest = (self._rest + content).split(b"\n")
        self._rest = rest[:_LONGEST]
        return whole if content else self._last()

    def _last(self) -> list[bytes]:
        """What there is at the end of standard output; a last line need not be ended."""
        self._closed = True
        rest, self._rest = self._rest, b""
        return [rest]

    def _overhear(self, stream: IO[bytes]) -> list[bytes]:
        *whole, rest = (self._murmur + self._received(stream)).split(b"\n")
        self._murmur = rest[:_WIDEST]
        self._errors_before += max(len(self._errors) + len(whole) - _SHOWN, 0)
        self._errors.extend(map(_shown, whole))
        return []

    def _received(self, stream: IO[bytes]) -> bytes:
        content = os.read(stream.fileno(), _AT_ONCE)
        if not content:
            self._selector.unregister(stream)
        return content


def _shown(line: bytes) -> str:
    return printable(line[:_WIDEST].decode("utf-8", "replace").rstrip())


@contextmanager
def started(command: Sequence[str], limit: float) -> Iterator[Program]:
    """The program, running; ``limit`` [s] is for each answer. Raises InputError if it cannot be started."""
    running: list[Program] = []

    def kill() -> None:
        for program in running:
            program.kill()

    with undoing(kill):
        try:
            with unbroken():
                running.append(Program(command, limit))
            yield running[0]
        finally:
            for program in running:
                program.close()
