"""The command line as a whole: its groups of commands, exit statuses and error lines.

Exit status 0 means done, and 1 that one of the package's own checks failed. Status 2 means bad
input, with one line on standard error. A signal ends the process with 128 plus its number, Ctrl-C
with 130. Nothing but click is imported until a command runs.
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
from tippedisk_verify.commands import (
    certify,
    conformance,
    cycles,
    heteroclinic,
    motion,
    reference,
    scene,
    studies,
    theory,
    verify,
)
from tippedisk_verify.commands.help import Cli
from tippedisk_verify.errors import AccuracyError, InputError

__all__ = ["entry", "main"]

_MAX_LINE_LENGTH = 1_000  # characters of an error message


@click.group(
    cls=Cli,
    sections={
        "The paper": (*verify.COMMANDS, *scene.COMMANDS),
        "One disk's motion and cycles": (
            motion.integrate,
            *theory.COMMANDS,
            *cycles.COMMANDS,
            motion.basin,
        ),
        "Omega_h": heteroclinic.COMMANDS,
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
    """Run the command line and return its exit status.

    One list holds every exception that can end a run. Some of them are subclasses of others, so
    their order matters.

    Args:
        arguments: The arguments, for tests; those of the process if left out.

    Returns:
        0 for success, 1 for a check that failed, 2 for bad input, 130 for Ctrl-C.
    """
    try:
        status = cli.main(
            args=None if arguments is None else list(arguments), standalone_mode=False
        )
        if sys.stdout is not None:
            sys.stdout.flush()  # here, where a full disk can still be reported
    except click.exceptions.Exit as stop:
        return int(stop.exit_code)
    except (KeyboardInterrupt, click.Abort):
        return _report_error("interrupted", 130)
    except click.ClickException as fault:
        return _report_error(fault.format_message(), 2)
    except InputError as fault:
        return _report_error(str(fault), 2)
    except (AccuracyError, ArithmeticError) as shortfall:
        return _report_error(str(shortfall), 1)
    except MemoryError:
        return _report_error("the memory is used up: ask for less at a time, or fewer --jobs", 1)
    # A MemoryError while libraries are loaded arrives here as a SystemError.
    except (ImportError, SystemError) as fault:
        return _report_error(f"a library is missing, or there is no memory for it: {fault}", 1)
    except RuntimeError as fault:
        from concurrent.futures import BrokenExecutor

        if not isinstance(fault, BrokenExecutor):
            raise
        return _report_error(
            "a process of the pool died, perhaps for lack of memory: try again with fewer --jobs", 1
        )
    except BrokenPipeError:  # the reader of our output has closed it
        _discard_output()
        return 0
    except SystemExit as stop:  # click raises it when the reader of our output has closed it
        return 0 if stop.code == 1 else int(stop.code or 0)
    except OSError as fault:
        where = f"{str(fault.filename)[-200:]}: " if fault.filename else ""
        return _report_error(f"{where}{fault.strerror or fault}", 2)
    return status if isinstance(status, int) else 0


def entry() -> NoReturn:
    """Run `main` and end the process with its status."""
    # Matrices here are small: on busy cores, BLAS threads that wait for each other cost tenfold.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal or a locale that cannot show a character
            stream.reconfigure(errors="replace")
    sys.exit(main())


def _report_error(message: str, status: int) -> int:
    """Print one line on standard error and return ``status``.

    Output that cannot be written to standard output is discarded.
    """
    # Import nothing here: there may be no memory left for it.
    line = "".join(
        character if character.isprintable() else "?" for character in " ".join(message.split())
    )
    with suppress(OSError, ValueError):  # standard error, too, may lead to a full disk
        click.echo(
            f"tippedisk-verify: "
            f"{line if len(line) <= _MAX_LINE_LENGTH else line[: _MAX_LINE_LENGTH - 3] + '...'}",
            err=True,
        )
    try:
        sys.stdout.flush()
    except (OSError, AttributeError, ValueError):
        _discard_output()
    return status


def _discard_output() -> None:
    """Send all remaining standard output to the null device.

    Python would otherwise try to write it again at its end, and complain.
    """
    with suppress(OSError, AttributeError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
