"""The definition of a command: the options that all have, the printing of its result, groups."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, wraps
from typing import Any

import click

from tippedisk_verify.commands.help import CommandGroup, DefinedCommand, load_quantities
from tippedisk_verify.commands.tables import break_line
from tippedisk_verify.display import result_lines
from tippedisk_verify.model.equations import require_one_speed
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.support.progress import Advance, show_progress

__all__ = ["DiskOptions", "OutputOptions", "command", "disk_command", "group"]

_OUTPUT_OPTIONS = (
    click.Option(["--json"], is_flag=True, help="Print one JSON object on standard output."),
    click.Option(["--quiet"], is_flag=True, help="Print no progress and no table."),
)
_DISK_OPTIONS = (
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
                click.echo(break_line(line))

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


def command(help_text: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that makes a command of a function.

    The function takes an `OutputOptions` and the options declared below the decorator. Its result
    is printed, unless it is an exit status.

    Args:
        help_text: The help of the command.
    """
    return partial(_command, help_text, _OUTPUT_OPTIONS, OutputOptions)


def disk_command(help_text: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that makes a command about one disk of a function.

    The function takes a `DiskOptions` and the options declared below the decorator, as with
    `command`.

    Args:
        help_text: The help of the command.
    """
    return partial(_command, help_text, (*_DISK_OPTIONS, *_OUTPUT_OPTIONS), _disk_options)


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


def _disk_options(
    parameters: str, friction: Any, digits: int, json: bool, quiet: bool
) -> DiskOptions:
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

    return CommandGroup(
        name, commands, callback=show_help, invoke_without_command=True, help=help_text
    )
