"""The command line: a thin layer over the package's functions.

Exit status 0: done; 1: one of our own checks fell short; 2: bad input, one line on standard error; 128 + a signal's
number: ended by it (Ctrl-C 130).
Nothing but click is imported until a command runs.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from io import TextIOWrapper
from typing import NoReturn

import click

from tippedisk_verify import __version__
from tippedisk_verify.commands import certify, conformance, one_disk, reference, studies, verify
from tippedisk_verify.commands.help import Cli
from tippedisk_verify.errors import AccuracyError, InputError

__all__ = ["entry", "main"]

_LONGEST = 1_000  # characters of a line that says what is wrong


@click.group(
    cls=Cli,
    sections={
        "The paper": verify.COMMANDS,
        "One disk's motion and cycles": one_disk.COMMANDS,
        "Omega_h": one_disk.OMEGA_H,
        "Your implementation": (*conformance.COMMANDS, *reference.COMMANDS),
        "Proofs": certify.COMMANDS,
        "Studies": studies.COMMANDS,
    },
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=False,
    invoke_without_command=True,
)
@click.version_option(__version__, prog_name="tippedisk-verify", message="%(prog)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """True numbers of the tippedisk, and a verdict on each number that its paper prints."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status. For tests: takes the arguments as a list.

    All that can end a run stands in one list: some of these exceptions are kinds of others, so their order decides.
    """
    try:
        status = cli.main(args=None if arguments is None else list(arguments), standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()  # here, where a full disk can still be told
    except click.exceptions.Exit as stop:
        return int(stop.exit_code)
    except (KeyboardInterrupt, click.Abort):
        return _told("interrupted", 130)
    except click.ClickException as fault:
        return _told(fault.format_message(), 2)
    except InputError as fault:
        return _told(str(fault), 2)
    except (AccuracyError, ArithmeticError) as shortfall:
        return _told(str(shortfall), 1)
    except MemoryError:
        return _told("the memory is used up: ask for less at a time, or fewer --jobs", 1)
    except (
        ImportError,
        SystemError,
    ) as fault:  # the latter is what is left of a MemoryError while libraries are loaded
        return _told(f"a library is missing, or there is no memory for it: {fault}", 1)
    except RuntimeError as fault:
        from concurrent.futures import BrokenExecutor

        if not isinstance(fault, BrokenExecutor):
            raise
        return _told("a process of the pool died, perhaps for lack of memory: try again with fewer --jobs", 1)
    except BrokenPipeError:  # the reader of our output has had enough
        _discard_output()
        return 0
    except SystemExit as stop:  # how click ends when the reader of our output has had enough
        return 0 if stop.code == 1 else int(stop.code or 0)
    except OSError as fault:
        where = f"{str(fault.filename)[-200:]}: " if fault.filename else ""
        return _told(f"{where}{fault.strerror or fault}", 2)
    return status if isinstance(status, int) else 0


def entry() -> NoReturn:
    """The whole process: `main`, with its status as the process's."""
    # The matrices here are small. Threads that wait for each other cost tenfold where other work keeps the cores busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal or a locale that cannot show a character
    sys.exit(main())


def _told(message: str, status: int) -> int:
    """One line on standard error; what could not be written to standard output is given up."""
    # Nothing is imported here: there may be no memory left to do so.
    line = "".join(character if character.isprintable() else "?" for character in " ".join(message.split()))
    with suppress(OSError, ValueError):  # a full disk, too, may be where the line should go
        click.echo(f"tippedisk-verify: {line if len(line) <= _LONGEST else line[: _LONGEST - 3] + '...'}", err=True)
    try:
        sys.stdout.flush()
    except (OSError, AttributeError, ValueError):
        _discard_output()
    return status


def _discard_output() -> None:
    """Send what is still to be written to standard output nowhere: Python would try again, and complain, at its end."""
    with suppress(OSError, AttributeError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
