"""The common parts of the commands: options and their checks, progress, printing and tables."""

from __future__ import annotations

import json
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, wraps
from itertools import zip_longest
from pathlib import Path
from typing import Any

import click

from tippedisk_verify.commands.help import DefinedCommand, load_quantities
from tippedisk_verify.display import result_lines
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import STATE_NAMES, require_one_speed
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.support.files import checked_file_path, output_file, sole_writer
from tippedisk_verify.support.progress import Advance, show_progress

__all__ = [
    "MOTION_COLUMNS",
    "DiskOptions",
    "OutputOptions",
    "below_crit_option",
    "certificate_option",
    "command",
    "decimal",
    "disk_command",
    "group",
    "half_widths_option",
    "levels",
    "lock_output_folder",
    "motion_rows",
    "omega_option",
    "option_callback",
    "output_file_callback",
    "rotating_option",
    "table",
    "unstable_option",
    "with_width_columns",
]

Check = Callable[[click.Context, click.Parameter, Any], Any]  #: click's callback of an option
_BETWEEN_WORDS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}


# ---------------------------------------------------------------------------------- common options
@dataclass(frozen=True)
class OutputOptions:
    """The options of a command that say how its result is printed."""

    json: bool
    quiet: bool

    def progress(self, total: int = 0) -> AbstractContextManager[Advance]:
        """Show progress while the context is entered, unless the command is quiet.

        Args:
            total: The number of steps; 0 if it is not known.
        """
        return show_progress(total, not self.quiet)

    def show(self, result: Any, lines: Iterable[object] | None = None) -> None:
        """Print a result as JSON, or as lines.

        Lines longer than the terminal's are broken between words.

        Args:
            result: The result, as plain data.
            lines: The lines; None for the entries of the result, with units.
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
        """Print a command's result, and return the exit status.

        Args:
            result: A result to print, or an exit status, which is returned as it is. The exit
                status of a result that is not proved is 1.
        """
        if isinstance(result, int):
            return result
        entries = result if isinstance(result, dict) else result.to_dict()
        self.show(entries)
        return 0 if entries.get("proved", True) else 1


@dataclass(frozen=True)
class DiskOptions(OutputOptions):
    """The options that all commands about one disk share, with the disk."""

    disk: Any
    digits: int

    def speed(self, omega: str | None, below_crit: str | None) -> Fraction:
        """Return the exact speed [rad/s] that --omega or --below-crit gives.

        Raises:
            InputError: If none of the options is given, or both.
        """
        require_one_speed(**{"--omega": omega, "--below-crit": below_crit})
        return self.disk.speed(omega, below_crit=below_crit, digits=self.digits)  # type: ignore[no-any-return]


# ------------------------------------------------------------------------------- checks of options
def option_callback(check: Callable[[Any], Any]) -> Check:
    """Return a callback for click that replaces an option's text by ``check(text)``; None stays
    None.

    Args:
        check: A function of the text, which raises InputError for a bad value.
    """
    return lambda context, option, value: None if value is None else check(value)


def decimal(context: click.Context, option: click.Parameter, value: str | None) -> str | None:
    """Check that the text of a command-line option is a decimal, and return the text.

    It stays a text, because no value may pass through a double.

    Raises:
        InputError: If it is not a decimal.
    """
    from tippedisk_verify.numbers.exact import exact

    try:
        exact("0" if value is None else value)
    except InputError as fault:
        raise InputError(f"{option.opts[0]}: {fault}") from None
    return value


def output_file_callback(*endings: str) -> Check:
    """Return a callback for click that checks an option: the name of an output file with one of
    these endings.
    """
    return option_callback(lambda text: checked_file_path(text, *endings))


def _levels(text: str) -> tuple[int, ...]:
    from tippedisk_verify.conformance.grading import LEVEL_NAMES

    levels: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"(\d{1,2})(?:-(\d{1,2}))?", part, re.ASCII)
        if match is None:
            raise InputError(f"levels are numbers and ranges such as 1-3,7, not '{text[:40]}'")
        first, last = int(match[1]), int(match[2] or match[1])
        if not 1 <= first <= last <= len(LEVEL_NAMES):
            raise InputError(f"levels go from 1 to {len(LEVEL_NAMES)}, not '{text[:40]}'")
        levels.update(range(first, last + 1))
    return tuple(sorted(levels))


levels = option_callback(_levels)

# ----------------------------------------------------------------------------------------- options
_OUTPUT = (
    click.Option(["--json"], is_flag=True, help="Print one JSON object on standard output."),
    click.Option(["--quiet"], is_flag=True, help="Print no progress and no table."),
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
        ["--friction"],
        default="linear",
        show_default=True,
        metavar="linear|smooth",
        help="The friction law.",
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

omega_option = click.option(
    "--omega", callback=decimal, metavar="X", help="The spinning speed [rad/s]."
)
below_crit_option = click.option(
    "--below-crit",
    callback=decimal,
    metavar="D",
    help="The speed Omega_crit - D [rad/s], rounded to 35 digits more than requested.",
)
half_widths_option = click.option(
    "--half-widths/--no-half-widths",
    default=True,
    help="Compute half-widths. Without them, numbers take a fraction of the time.",
)
rotating_option = click.option(
    "--rotating",
    is_flag=True,
    help="Compute rotating cycles, on which gamma grows by 2 pi in each period.",
)
unstable_option = click.option(
    "--unstable", is_flag=True, help="Choose the unstable cycle if a stable one has the same speed."
)
certificate_option = click.option(
    "--certificate",
    callback=option_callback(output_file),
    metavar="FILE.json",
    help="Write a certificate, with which `certify check FILE.json` repeats the proof.",
)


def command(help_text: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that makes a command of a function.

    The function takes an `OutputOptions` and the options declared below the decorator. Its result
    is printed, unless it is an exit status.

    Args:
        help_text: The help of the command.
    """
    return partial(_command, help_text, _OUTPUT, OutputOptions)


def disk_command(help_text: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that makes a command about one disk of a function.

    The function takes a `DiskOptions` and the options declared below the decorator, as with
    `command`.

    Args:
        help_text: The help of the command.
    """
    return partial(_command, help_text, (*_ABOUT_A_DISK, *_OUTPUT), _common)


def _command(
    help_text: str,
    shared: Sequence[click.Option],
    make_output: Callable[..., OutputOptions],
    function: Callable[..., Any],
) -> click.Command:
    names = [option.name for option in shared]

    @wraps(function)
    @ignore_numpy_errors()
    def run(**options: Any) -> int:
        output = make_output(**{str(name): options.pop(str(name)) for name in names})
        return output.finish(function(output, **options))

    params = [*reversed(getattr(function, "__click_params__", [])), *shared]
    name = function.__name__.rstrip("_").replace("_", "-")
    return DefinedCommand(name, params=params, callback=run, help=help_text)


def _common(parameters: str, friction: Any, digits: int, json: bool, quiet: bool) -> DiskOptions:
    from tippedisk_verify.disk import Disk
    from tippedisk_verify.numbers.precision import checked_digits

    return DiskOptions(json, quiet, Disk(parameters, friction=friction), checked_digits(digits))


def group(name: str, help_text: str, *commands: click.Command) -> click.Group:
    """Make a command-line group of subcommands, which prints its help if it is called without one
    of them.
    """

    def show_help() -> None:
        context = click.get_current_context()
        if context.invoked_subcommand is None:
            click.echo(context.get_help())

    return click.Group(
        name, commands, callback=show_help, invoke_without_command=True, help=help_text
    )


# ------------------------------------------------------------------------------------------ output
def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    """Yield the lines of a table with columns as wide as their cells.

    On a terminal that is too narrow, cells are broken between words.

    Args:
        headings: The column headings.
        rows: The cells of each row.
    """
    cells = [headings, *(list(map(str, row)) for row in rows)]
    columns = list(zip(*cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    least = [
        max(len(word) for cell in column for word in [*cell.split(), ""]) for column in columns
    ]
    while sum(widths) + 2 * len(widths) - 2 > _width() and widths != least:
        widest = max(range(len(widths)), key=lambda n: (widths[n] > least[n], widths[n]))
        widths[widest] -= 1
    for row in cells:
        parts = [
            textwrap.wrap(cell, width, **_BETWEEN_WORDS)
            for cell, width in zip(row, widths, strict=True)
        ]
        for line in zip_longest(*parts, fillvalue=""):
            yield "  ".join(
                f"{part:{width}}" for part, width in zip(line, widths, strict=True)
            ).rstrip()


def _width() -> int:
    """Return the number of characters in a line of the terminal; the lines of a file
    have no limit.
    """
    return shutil.get_terminal_size().columns if sys.stdout and sys.stdout.isatty() else sys.maxsize


def lock_output_folder(out: str | None) -> Path | None:
    """Lock the output folder for this run until the command ends, and return its path.

    Args:
        out: The folder's path, or None.

    Raises:
        InputError: If it cannot be used, or another run is writing into it.
    """
    return None if out is None else click.get_current_context().with_resource(sole_writer(out))


# ------------------------------------------------------------------------------- motions as tables
#: The columns of a motion: the time [s] and the state [rad, rad, rad/s].
MOTION_COLUMNS = ("t", *STATE_NAMES)


def motion_rows(*columns: Sequence[Any]) -> list[dict[str, Any]]:
    """Convert the columns of a motion's table, as data for JSON, to rows: one for each time, by
    column name.
    """
    return [dict(zip(MOTION_COLUMNS, row, strict=True)) for row in zip(*columns, strict=True)]


def with_width_columns(rows: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """Return the rows of a table as texts, with each number's half-width in a column
    NAME_uncertainty of its own.

    An event's name is left out, because it is in the column ``event``.
    """
    lines = []
    for row in rows:
        texts = {
            name: entry for name, entry in row.items() if isinstance(entry, str) and name != "name"
        }
        numbers = {name: entry for name, entry in row.items() if isinstance(entry, dict)}
        widths = {f"{name}_uncertainty": entry["uncertainty"] for name, entry in numbers.items()}
        lines.append(texts | {name: entry["value"] for name, entry in numbers.items()} | widths)
    return lines
