"""What the commands share: options, progress, printing, and processes."""

from __future__ import annotations

import json
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import wraps
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import output_file
from tippedisk_verify.interrupts import undoing
from tippedisk_verify.model.results import result_lines

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from fractions import Fraction

    from rich.console import Console

    from tippedisk_verify.progress import Advance

__all__ = [
    *("Common", "alone_in", "at_a_speed", "certificate_option", "checked_jobs", "common_options", "console"),
    *("executor_option", "jobs_option", "plain_options", "print_result", "processes", "progress", "speed_options"),
    *("table", "workers_of"),
]

_FEWEST_OFFERED = 16  # processes, each with a memory of its own
_BETWEEN_WORDS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Common:
    """The options that every command takes, checked."""

    disk: Any  #: a `Disk`; None for commands that read or make files, whose contents say what they are for
    digits: int
    json: bool
    quiet: bool

    @property
    def parameters(self) -> Any:
        """The disk, as a `Parameters`."""
        return self.disk

    @property
    def friction(self) -> str:
        """The friction law."""
        return str(self.disk.friction)

    def speed(self, omega: str | None, below_crit: str | None) -> Fraction:
        """Omega as an exact rational [rad/s], from --omega or --below-crit."""
        if (omega is None) == (below_crit is None):
            raise InputError("give the speed with either --omega or --below-crit")
        return self.disk.speed(omega, below_crit=below_crit, digits=self.digits)  # type: ignore[no-any-return]


def common_options(command: F) -> F:
    """Add the common options and hand them to the command as one `Common`; what it returns is printed.

    That is a result or data for JSON, or else the exit status of a command that prints by itself.
    """

    @wraps(command)
    def checked(parameters: str, friction: Any, digits: int, as_json: bool, quiet: bool, **options: Any) -> int:
        from tippedisk_verify.disk import Disk
        from tippedisk_verify.model.precision import checked_digits

        common = Common(Disk(parameters, friction=friction), checked_digits(digits), as_json, quiet)
        return _printed(common, command(common, **options))

    return cast("F", _with_last(checked, *_QUESTION_OPTIONS, *_OUTPUT_OPTIONS))


def plain_options(command: F) -> F:
    """The common options of commands that read or make files; what the command returns is printed likewise."""

    @wraps(command)
    def wrapped(as_json: bool, quiet: bool, **options: Any) -> int:
        common = Common(None, 12, as_json, quiet)
        return _printed(common, command(common, **options))

    return cast("F", _with_last(wrapped, *_OUTPUT_OPTIONS))


def speed_options(command: F) -> F:
    """Add the two ways to give the speed."""
    return _OMEGA(_BELOW_CRIT(command))


def at_a_speed(command: F) -> F:
    """Add the two ways to give the speed, and hand it on as ``omega``, an exact rational [rad/s]."""

    @wraps(command)
    def resolved(common: Common, omega: str | None, below_crit: str | None, **options: Any) -> Any:
        return command(common, common.speed(omega, below_crit), **options)

    return speed_options(resolved)  # type: ignore[return-value]


def _printed(common: Common, result: Any) -> int:
    """The exit status: 0, or 1 where a result says that it is not proved."""
    if isinstance(result, int):
        return result
    entries = result if isinstance(result, dict) else result.to_dict()
    print_result(common, entries)
    return 0 if entries.get("proved", True) else 1


def _with_last(command: Any, *options: Callable[[Any], Any]) -> Any:
    """Add options that the help lists after all others."""
    own, command.__click_params__ = getattr(command, "__click_params__", []), []
    for option in reversed(options):
        option(command)
    command.__click_params__ += own
    return command


_QUESTION_OPTIONS = (
    click.option("--parameters", default="table1", show_default=True, metavar="NAME|FILE.toml",
                 help="table1, calibrated, geometry, or a TOML file of quoted decimals."),
    click.option("--friction", default="linear", show_default=True, metavar="linear|smooth",
                 help="The friction law."),
    click.option("--digits", type=int, default=12, show_default=True, metavar="N",
                 help="Significant digits of each main result, at least."),
)  # fmt: skip
_OUTPUT_OPTIONS = (
    click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output."),
    click.option("--quiet", is_flag=True, help="No progress and no table."),
)


def _known_executor(context: click.Context, option: click.Parameter, executor: str) -> str:
    if executor not in ("serial", "local") and not executor.startswith("dask://"):
        raise InputError(f"executor '{executor[:60]}' is not known: use serial, local or dask://HOST:PORT")
    return executor


executor_option = click.option(
    "--executor",
    callback=_known_executor,
    default="local",
    show_default=True,
    metavar="serial|local|dask://HOST:PORT",
    help="One process, all cores of this machine, or a cluster.",
)
jobs_option = click.option(
    "--jobs",
    callback=lambda context, option, jobs: checked_jobs(jobs),
    type=int,
    metavar="N",
    help="Processes; as many as there are cores if not given.",
)
certificate_option = click.option(
    "--certificate",
    callback=lambda context, option, name: None if name is None else output_file(name),
    metavar="FILE.json",
    help="Write what `certify check FILE.json` needs to prove it again.",
)
_OMEGA = click.option("--omega", metavar="X", help="The spinning speed [rad/s].")
_BELOW_CRIT = click.option("--below-crit", metavar="D", help="Omega_crit - D [rad/s].")


def print_result(common: Common, result: dict[str, Any], lines: Iterable[object] | None = None) -> None:
    """One JSON object, or these lines; its entries as lines, with units, if there are none of their own.

    A terminal breaks lines anywhere, so that longer ones are broken here, between words.
    """
    if common.json:
        click.echo(json.dumps(result, indent=1))
    elif not common.quiet:
        for line in map(str, result_lines(result) if lines is None else lines):
            indent = " " * (len(line) - len(line.lstrip()) + 4)
            parts = textwrap.wrap(line, _width(), subsequent_indent=indent, drop_whitespace=True, **_BETWEEN_WORDS)
            click.echo("\n".join(parts) if len(line) > _width() else line)


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    """A table as lines: columns as wide as their cells; where a terminal is too narrow, cells are broken at words."""
    cells = [headings, *(list(map(str, row)) for row in rows)]
    columns = list(zip(*cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    least = [max(len(word) for cell in column for word in [*cell.split(), ""]) for column in columns]
    while sum(widths) + 2 * len(widths) - 2 > _width() and widths != least:
        widest = max(range(len(widths)), key=lambda n: (widths[n] > least[n], widths[n]))
        widths[widest] -= 1
    for row in cells:
        parts = [textwrap.wrap(cell, width, **_BETWEEN_WORDS) for cell, width in zip(row, widths, strict=True)]
        for line in zip_longest(*parts, fillvalue=""):
            yield "  ".join(f"{part:{width}}" for part, width in zip(line, widths, strict=True)).rstrip()


def _width() -> int:
    """The characters of a terminal's line; a file's are as long as they need be."""
    return shutil.get_terminal_size().columns if sys.stdout and sys.stdout.isatty() else sys.maxsize


def alone_in(out: str | None) -> Path | None:
    """The output folder, if one is given, with no other run writing into it until the command has ended.

    Raises InputError if it cannot be used, or another run does so now.
    """
    from tippedisk_verify.files import sole_writer

    return None if out is None else click.get_current_context().with_resource(sole_writer(out))


def console() -> Console:
    """Where tables are printed; a file has no width of its own, and gets one that keeps rows on one line."""
    from rich.console import Console

    terminal = Console()
    return terminal if terminal.is_terminal else Console(width=160)


def progress(common: Common, total: int) -> AbstractContextManager[Advance]:
    """What the command has done is shown while this is entered, unless it is to be quiet; total 0: nobody knows."""
    from tippedisk_verify.progress import progress_of

    return progress_of(total, not common.quiet)


def checked_jobs(jobs: int | None) -> int | None:
    """A number of processes that this machine can be asked for. Raises InputError for any other."""
    most = max(_FEWEST_OFFERED, 2 * (os.cpu_count() or 1))
    if jobs is not None and not 1 <= jobs <= most:
        raise InputError(f"--jobs must lie between 1 and {most} on this machine, not {str(jobs)[:40]}")
    return jobs


@contextmanager
def processes(jobs: int | None, *, needed: bool = True, beside: bool = False) -> Iterator[Executor | None]:
    """A pool of fresh processes, or None where one process does (unless it is to work beside this) or none is needed.

    Ctrl-C and HUP reach this process only, and the pool ends with it, however it ends. Raises InputError for a number
    of processes that makes no sense.
    """
    from tippedisk_verify.parallel import usable_cores

    workers = checked_jobs(jobs) or usable_cores()
    if (workers == 1 and not beside) or not needed:
        yield None
        return
    from tippedisk_verify.commands.workers import Pool, kill_workers

    with undoing(kill_workers), Pool(workers) as pool:
        yield pool


@contextmanager
def workers_of(executor: str, jobs: int | None, *, needed: bool = True) -> Iterator[Executor | None]:
    """What `executor_option` names, with a check that its processes have this code; None where this process does it.

    Processes of this machine start if ``needed``.
    """
    if executor == "serial":
        yield None
    elif executor == "local":
        from tippedisk_verify.commands.workers import Checked

        with processes(jobs, needed=needed) as pool:
            yield pool and Checked(pool)
    else:
        from tippedisk_verify.commands.workers import cluster

        with cluster(executor) as workers:
            yield workers
