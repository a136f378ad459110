"""A conversation with another program, line by line over pipes, with a time limit for each answer.

The program can neither block this process nor outlive it. A single thread does everything. It
writes only as much as the pipe takes, and reads whenever there is output. The program gets a
process group of its own. Ctrl-C on the terminal does not reach it, and its children end with it.
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
from tippedisk_verify.support.files import printable
from tippedisk_verify.support.interrupts import clean_up_on_ctrl_c, postpone_ctrl_c

__all__ = ["Program", "start_program"]

_MAX_LINE = 100_000  # bytes of a line that are kept; an answer has two thousand at most
_MAX_STDERR_LINES, _MAX_STDERR_WIDTH = (
    20,
    300,
)  # lines of standard error that are kept, and bytes of each
_CHUNK_BYTES = 65_536  # bytes of one read or write
_POLL_INTERVAL = 0.02  # s between checks that the program still runs
_END_TIMEOUT = 5.0  # s, the longest time for a program to end after its input has ended


class Program:
    """A running program, which answers questions line by line.

    `start_program` starts one, and makes sure that it ends.

    Args:
        command: The command and its arguments.
        limit: The time limit for each answer [s].

    Raises:
        InputError: If the program cannot be started.
    """

    def __init__(self, command: Sequence[str], limit: float) -> None:
        self.name = printable(command[0])[-60:]
        self.begun = time.perf_counter()
        self._limit = limit
        pipe = subprocess.PIPE
        try:
            self._process = subprocess.Popen(
                list(command),
                stdin=pipe,
                stdout=pipe,
                stderr=pipe,
                bufsize=0,
                start_new_session=True,
            )
        except (OSError, ValueError) as fault:
            reason = (isinstance(fault, OSError) and fault.strerror) or fault
            raise InputError(f"the program '{self.name}' cannot be started: {reason}") from None
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        self._pipes = tuple(stream for stream in pipes if stream is not None)  # all three exist
        self._input, output, errors = self._pipes
        self._unsent = self._partial_line = self._partial_error_line = b""
        self._errors: deque[str] = deque(maxlen=_MAX_STDERR_LINES)
        self._errors_before = 0
        self._closed = False  # standard output
        self._selector = selectors.DefaultSelector()
        for stream in self._pipes:
            os.set_blocking(stream.fileno(), False)
        self._selector.register(output, selectors.EVENT_READ, self._read_stdout)
        self._selector.register(errors, selectors.EVENT_READ, self._read_stderr)

    def ask(self, text: str, waiting: Collection[str], take: Callable[[str], None]) -> str:
        """Send questions to the program, and pass each line that it writes to ``take`` until all
        are answered.

        The time limit is for each answer: the clock restarts when ``waiting`` gets shorter, not
        with other lines.

        Args:
            text: The questions, one to a line.
            waiting: The ids without an answer; ``take`` removes each id that is answered.
            take: A function that is called with each line.

        Returns:
            "", or the reason why no more answers will come.
        """
        if text and not self._input.closed:
            if not self._unsent:  # a program may answer what it has not read
                self._selector.register(self._input, selectors.EVENT_WRITE, self._send)
            self._unsent += text.encode()
        still, deadline = len(waiting), time.monotonic() + self._limit
        while waiting:
            self._poll_pipes(take)
            id_ = next(iter(waiting), "")
            if len(waiting) < still:
                still, deadline = len(waiting), time.monotonic() + self._limit
            elif self._closed:
                if self._ends(take):
                    return f"{self.name} ended with {self._ending()} before it answered {id_}"
                return f"{self.name} closed its standard output before it answered {id_}, and was ended"
            elif time.monotonic() >= deadline:
                return f"{self.name} did not answer {id_} within {self._limit:g} s, and was ended"
        return ""

    def finish(self, take: Callable[[str], None]) -> str:
        """Close the program's input, pass its remaining lines to ``take``, and wait until it ends.

        The wait is limited; a program that goes on is reported, but not killed here.

        Args:
            take: A function that is called with each line.

        Returns:
            "", or a description of an end that is not normal.
        """
        self._close_input()
        if not self._ends(take):
            return f"{self.name} went on when its input had ended, and was ended"
        return "" if (how := self._ending()) == "status 0" else f"{self.name} ended with {how}"

    def end_reason(self, broken: str) -> str:
        """Return the reason why the program gives no more answers, with its last line of standard
        error.

        Args:
            broken: The reason that `ask` returned.
        """
        errors = self.errors()
        return f"{broken}: {errors[-1]}" if errors else broken

    def errors(self) -> list[str]:
        """Return the last lines that the program wrote to standard error.

        A first line counts the earlier ones, if any were dropped.
        """
        before = [f"({self._errors_before} lines before)"] if self._errors_before else []
        return [
            *before,
            *self._errors,
            *([_printable_line(self._partial_error_line)] if self._partial_error_line else []),
        ]

    def kill(self) -> None:
        """Kill the program and its children, which may hold the pipes too."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def close(self) -> None:
        """Kill the program if it still runs, and release its process and its pipes."""
        self.kill()
        self._process.wait()
        self._selector.close()
        for stream in self._pipes:
            stream.close()

    def _ending(self) -> str:
        """Return a description of how the program has ended, by its exit status or signal; "" while
        it runs.
        """
        code = self._process.poll()
        if code is None:
            return ""
        if code >= 0:
            return f"status {code}"
        return next((known.name for known in signal.Signals if known == -code), f"signal {-code}")

    def _ends(self, take: Callable[[str], None]) -> bool:
        deadline = time.monotonic() + min(self._limit, _END_TIMEOUT)
        while not (self._closed and self._ending()) and time.monotonic() < deadline:
            self._poll_pipes(take)
        self._poll_pipes(take)  # it may have written a last line of errors since
        return bool(self._ending())

    def _close_input(self) -> None:
        if self._unsent:
            self._selector.unregister(self._input)
        self._unsent = b""
        self._input.close()

    def _poll_pipes(self, take: Callable[[str], None]) -> None:
        """Check all pipes of the program once, and pass the lines that it has written
        to ``take``.
        """
        ready = self._selector.select(_POLL_INTERVAL)
        lines = [line for key, _ in ready for line in key.data(key.fileobj)]
        # A child of the program may keep the pipe open after the program has ended.
        if not ready and not self._closed and self._ending():
            lines = self._close_output()
        for line in lines:
            take(line.decode("utf-8", "replace"))

    def _send(self, stream: IO[bytes]) -> list[bytes]:
        try:
            self._unsent = self._unsent[os.write(stream.fileno(), self._unsent[:_CHUNK_BYTES]) :]
        except BlockingIOError:
            return []
        except OSError:  # it no longer reads its input; it may still answer
            self._close_input()
        else:
            if not self._unsent:
                self._selector.unregister(stream)
        return []

    def _read_stdout(self, stream: IO[bytes]) -> list[bytes]:
        content = self._read_chunk(stream)
        *whole, rest = (self._partial_line + content).split(b"\n")
        self._partial_line = rest[:_MAX_LINE]
        return whole if content else self._close_output()

    def _close_output(self) -> list[bytes]:
        """Mark the program's standard output as closed, and return the rest that was read.

        The last line may lack a newline.
        """
        self._closed = True
        rest, self._partial_line = self._partial_line, b""
        return [rest]

    def _read_stderr(self, stream: IO[bytes]) -> list[bytes]:
        *whole, rest = (self._partial_error_line + self._read_chunk(stream)).split(b"\n")
        self._partial_error_line = rest[:_MAX_STDERR_WIDTH]
        self._errors_before += max(len(self._errors) + len(whole) - _MAX_STDERR_LINES, 0)
        self._errors.extend(map(_printable_line, whole))
        return []

    def _read_chunk(self, stream: IO[bytes]) -> bytes:
        content = os.read(stream.fileno(), _CHUNK_BYTES)
        if not content:
            self._selector.unregister(stream)
        return content


def _printable_line(line: bytes) -> str:
    return printable(line[:_MAX_STDERR_WIDTH].decode("utf-8", "replace").rstrip())


@contextmanager
def start_program(command: Sequence[str], limit: float) -> Iterator[Program]:
    """Start a program, and end it on exit.

    Args:
        command: The command and its arguments.
        limit: The time limit for each answer [s].

    Raises:
        InputError: If the program cannot be started.
    """
    running: list[Program] = []

    def kill() -> None:
        for program in running:
            program.kill()

    with clean_up_on_ctrl_c(kill):
        try:
            with postpone_ctrl_c():
                running.append(Program(command, limit))
            yield running[0]
        finally:
            for program in running:
                program.close()
