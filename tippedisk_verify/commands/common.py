"""What the commands share: options and what is checked of them, progress, printing, and processes."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, wraps
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.help import load_quantities
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import file_ending_in, output_file, sole_writer
from tippedisk_verify.interrupts import undoing
from tippedisk_verify.model.results import result_lines
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.parallel import usable_cores
from tippedisk_verify.progress import Advance, progress_of

if TYPE_CHECKING:
    from concurrent.futures import Executor

__all__ = [
    "Common",
    "Output",
    "alone_in",
    "at_a_speed",
    "below_crit_option",
    "certificate_option",
    "checked",
    "checked_jobs",
    "command",
    "decimal",
    "disk_command",
    "file_for",
    "group",
    "jobs_option",
    "known_executor",
    "levels",
    "omega_option",
    "processes",
    "rotating_option",
    "table",
    "unstable_option",
    "workers_of",
]

_FEWEST_OFFERED = 16  # processes, each with a memory of its own
Check = Callable[[click.Context, click.Parameter, Any], Any]  #: click's callback of an option
_BETWEEN_WORDS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}


# ------------------------------------------------------------------------------------------ what a command is asked
@dataclass(frozen=True)
class Output:
    """How a command shows what it does; for those that read or make files, whose contents say what they are for."""

    json: bool
    quiet: bool

    def progress(self, total: int = 0) -> AbstractContextManager[Advance]:
        """What the command has done is shown while this is entered, unless it is to be quiet; 0: nobody knows."""
        return progress_of(total, not self.quiet)

    def show(self, result: Any, lines: Iterable[object] | None = None) -> None:
        """One JSON object, or these lines; its entries as lines, with units, if there are none of their own.

        A terminal breaks lines anywhere, so that longer ones are broken here, between words.
        """
        if self.json:
            click.echo(json.dumps(result, indent=1))
        elif not self.quiet:
            if lines is None:
                load_quantities()
            for line in map(str, result_lines(result) if lines is None else lines):
                indent = " " * (len(line) - len(line.lstrip()) + 4)
                parts = textwrap.wrap(line, _width(), subsequent_indent=indent, **_BETWEEN_WORDS)
                click.echo("\n".join(parts) if len(line) > _width() else line)

    def finish(self, result: Any) -> int:
        """The exit status of what a command returns; a result or data are shown first. 1: it is not proved."""
        if isinstance(result, int):
            return result
        entries = result if isinstance(result, dict) else result.to_dict()
        self.show(entries)
        return 0 if entries.get("proved", True) else 1


@dataclass(frozen=True)
class Common(Output):
    """And which disk it is asked about, with how many digits."""

    disk: Any
    digits: int

    def speed(self, omega: str | None, below_crit: str | None) -> Fraction:
        """Omega as an exact rational [rad/s], from --omega or --below-crit."""
        if (omega is None) == (below_crit is None):
            raise InputError(f"give the speed with either --omega or --below-crit{', not both' * (omega is not None)}")
        return self.disk.speed(omega, below_crit=below_crit, digits=self.digits)  # type: ignore[no-any-return]


# ------------------------------------------------------------------------------------------ what options take
def checked(check: Callable[[Any], Any]) -> Check:
    """Return the callback of an option whose value is what ``check`` returns; that raises InputError for nonsense."""
    return lambda context, option, value: None if value is None else check(value)


def decimal(context: click.Context, option: click.Parameter, value: str | None) -> str | None:
    """The text of a decimal, which stays a text: no value passes through a double. Raises InputError for any other."""
    from tippedisk_verify.model.exact import exact

    try:
        exact("0" if value is None else value)
    except InputError as fault:
        raise InputError(f"{option.opts[0]}: {fault}") from None
    return value


def file_for(*endings: str) -> Check:
    """Return the callback of an option that names a file to write; its name ends in one of these."""
    return checked(lambda text: file_ending_in(text, *endings))


def checked_jobs(jobs: int | None) -> int | None:
    """A number of processes that this machine can be asked for. Raises InputError for any other."""
    most = max(_FEWEST_OFFERED, 2 * (os.cpu_count() or 1))
    if jobs is not None and not 1 <= jobs <= most:
        raise InputError(f"--jobs must lie between 1 and {most} on this machine, not {str(jobs)[:40]}")
    return jobs


def known_executor(executor: str) -> str:
    """The name of an executor. Raises InputError for any other text."""
    if executor not in ("serial", "local") and not executor.startswith("dask://"):
        raise InputError(f"executor '{executor[:60]}' is not known: use serial, local or dask://HOST:PORT")
    return executor


def _levels(text: str) -> tuple[int, ...]:
    from tippedisk_verify.conformance.grading import LEVEL_NAMES

    levels: set[int] = set()
    for part in text.split(","):
        found = re.fullmatch(r"(\d{1,2})(?:-(\d{1,2}))?", part, re.ASCII)
        if found is None:
            raise InputError(f"levels are numbers and ranges such as 1-3,7, not '{text[:40]}'")
        first, last = int(found[1]), int(found[2] or found[1])
        if not 1 <= first <= last <= len(LEVEL_NAMES):
            raise InputError(f"levels go from 1 to {len(LEVEL_NAMES)}, not '{text[:40]}'")
        levels.update(range(first, last + 1))
    return tuple(sorted(levels))


levels = checked(_levels)

# ------------------------------------------------------------------------------------------ options
_OUTPUT = (
    click.Option(["--json"], is_flag=True, help="One JSON object on standard output."),
    click.Option(["--quiet"], is_flag=True, help="No progress and no table."),
)
_ABOUT_A_DISK = (
    click.Option(
        ["--parameters"],
        default="table1",
        show_default=True,
        metavar="NAME|FILE.toml",
        help="table1, calibrated, geometry, or a TOML file of decimals.",
    ),
    click.Option(
        ["--friction"], default="linear", show_default=True, metavar="linear|smooth", help="The friction law."
    ),
    click.Option(
        ["--digits"],
        type=int,
        default=12,
        show_default=True,
        metavar="N",
        help="Significant digits of each main result, at least.",
    ),
)

omega_option = click.option("--omega", callback=decimal, metavar="X", help="The spinning speed [rad/s].")
below_crit_option = click.option("--below-crit", callback=decimal, metavar="D", help="Omega_crit - D [rad/s].")
rotating_option = click.option(
    "--rotating", is_flag=True, help="The rotating cycles, on which gamma grows by 2 pi a period."
)
unstable_option = click.option(
    "--unstable", is_flag=True, help="The unstable one, where a stable one has the same speed."
)
jobs_option = click.option(
    "--jobs",
    type=int,
    metavar="N",
    callback=checked(checked_jobs),
    help="Processes; as many as there are cores if not given.",
)
certificate_option = click.option(
    "--certificate",
    callback=checked(output_file),
    metavar="FILE.json",
    help="Write what `certify check FILE.json` needs to prove it again.",
)


def at_a_speed(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a command with --omega and --below-crit; it takes ``omega``, the exact rational [rad/s] of either."""

    @wraps(function)
    def with_speed(common: Common, omega: str | None, below_crit: str | None, **options: Any) -> Any:
        return function(common, omega=common.speed(omega, below_crit), **options)

    return omega_option(below_crit_option(with_speed))


def command(says: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Make a command of a function that takes an `Output` and what the decorators below this one declare.

    ``says`` is its help. What the function returns is shown, unless it is an exit status.
    """
    return partial(_command, says, _OUTPUT, Output)


def disk_command(says: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Make a command about one disk, as `command` does, of a function that takes a `Common`."""
    return partial(_command, says, (*_ABOUT_A_DISK, *_OUTPUT), _common)


def _command(
    says: str, shared: Sequence[click.Option], shown_by: Callable[..., Output], function: Callable[..., Any]
) -> click.Command:
    names = [option.name for option in shared]

    @wraps(function)
    @undisturbed
    def run(**options: Any) -> int:
        output = shown_by(**{str(name): options.pop(str(name)) for name in names})
        return output.finish(function(output, **options))

    params = [*reversed(getattr(function, "__click_params__", [])), *shared]
    name = function.__name__.rstrip("_").replace("_", "-")
    return click.Command(name, params=params, callback=run, help=says)


def _common(parameters: str, friction: Any, digits: int, json: bool, quiet: bool) -> Common:
    from tippedisk_verify.disk import Disk
    from tippedisk_verify.model.precision import checked_digits

    return Common(json, quiet, Disk(parameters, friction=friction), checked_digits(digits))


def group(name: str, says: str, *commands: click.Command) -> click.Group:
    """A group of commands, which prints its help when it is called by itself."""

    def helped() -> None:
        context = click.get_current_context()
        if context.invoked_subcommand is None:
            click.echo(context.get_help())

    return click.Group(name, commands, callback=helped, invoke_without_command=True, help=says)


# ------------------------------------------------------------------------------------------ output
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
    return None if out is None else click.get_current_context().with_resource(sole_writer(out))


# ------------------------------------------------------------------------------------------ processes
@contextmanager
def processes(jobs: int | None, *, needed: bool = True, beside: bool = False) -> Iterator[Executor | None]:
    """A pool of fresh processes, or None where one process does (unless it is to work beside this) or none is needed.

    Ctrl-C reaches this process only, and the pool ends with it, however it ends. Raises InputError for a number
    of processes that makes no sense.
    """
    workers = checked_jobs(jobs) or usable_cores()
    if (workers == 1 and not beside) or not needed:
        yield None
        return
    from tippedisk_verify.commands.workers import Pool, kill_workers

    with undoing(kill_workers), Pool(workers) as pool:
        yield pool


@contextmanager
def workers_of(executor: str, jobs: int | None) -> Iterator[Executor | None]:
    """What --executor names, with a check that its processes have this code; None where this process does it."""
    from tippedisk_verify.commands.workers import Checked, cluster

    if executor.startswith("dask://"):
        with cluster(executor) as workers:
            yield workers
    else:
        with processes(jobs, needed=executor == "local") as pool:
            yield pool and Checked(pool)
