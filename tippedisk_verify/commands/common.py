"""What the commands share: options, progress, printing, and processes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import output_file
from tippedisk_verify.interrupts import undoing
from tippedisk_verify.model.results import QUANTITIES, heading, result_lines

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from fractions import Fraction

    from rich.console import Console

    from tippedisk_verify.progress import Advance

__all__ = [
    "Common",
    "alone_in",
    "certificate_option",
    "checked_jobs",
    "common_options",
    "console",
    "executor_option",
    "plain_options",
    "print_result",
    "processes",
    "progress",
    "quantities_of",
    "speed",
    "speed_options",
    "workers_of",
]

_FEWEST_OFFERED = 16  # processes, each with a memory of its own
F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Common:
    """The options that every command takes, checked."""

    parameters: Any
    digits: int
    json: bool
    quiet: bool

    @property
    def friction(self) -> str:
        """The friction law."""
        return str(self.parameters.friction)


def common_options(command: F) -> F:
    """Add the common options and hand them to the command as one `Common`."""

    @wraps(command)
    def checked(parameters: str, friction: str, digits: int, as_json: bool, quiet: bool, **options: Any) -> Any:
        from tippedisk_verify.model.parameters import Parameters, checked_friction
        from tippedisk_verify.model.precision import checked_digits

        named = Parameters.named(parameters).with_friction(checked_friction(friction))
        return command(Common(named, checked_digits(digits), as_json, quiet), **options)

    return _with(checked, *_QUESTION_OPTIONS, *_OUTPUT_OPTIONS)  # type: ignore[return-value]


def plain_options(command: F) -> F:
    """The common options of commands that read or make files, whose contents say what they are for."""

    @wraps(command)
    def wrapped(as_json: bool, quiet: bool, **options: Any) -> Any:
        return command(Common(None, 12, as_json, quiet), **options)

    return _with(wrapped, *_OUTPUT_OPTIONS)  # type: ignore[return-value]


def speed_options(command: F) -> F:
    """Add the two ways to give the speed."""
    return _with(command, *_SPEED_OPTIONS)


def quantities_of(*names: str) -> Callable[[click.Command], click.Command]:
    """Adds what these quantities are to the end of a command's help."""
    width = max(len(heading(name)) for name in names)
    lines = [f"  {heading(name):{width}}  {QUANTITIES[name].meaning}" for name in names]

    def added(command: click.Command) -> click.Command:
        # The mark keeps click from filling the lines anew.
        command.epilog = "\b\nQuantities (± is a half-width that holds the true value):\n" + "\n".join(lines)
        return command

    return added


def _with(command: F, *options: Callable[[F], F]) -> F:
    for option in reversed(options):
        command = option(command)
    return command


_QUESTION_OPTIONS = (
    click.option("--parameters", default="printed", show_default=True, metavar="NAME|FILE.toml",
                 help="printed, calibrated, geometry, or a TOML file of quoted decimals."),
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
certificate_option = click.option(
    "--certificate",
    callback=lambda context, option, name: None if name is None else output_file(name),
    metavar="FILE.json",
    help="Write what `certify check FILE.json` needs to prove it again.",
)
_SPEED_OPTIONS = (
    click.option("--omega", metavar="X", help="The spinning speed [rad/s]."),
    click.option("--below-crit", metavar="D", help="Omega_crit - D [rad/s]."),
)


def speed(common: Common, omega: str | None, below_crit: str | None) -> Fraction:
    """Omega as an exact rational [rad/s], from --omega or --below-crit."""
    from tippedisk_verify.model.equations import checked_speed
    from tippedisk_verify.theory.hopf import speed_below_crit

    if (omega is None) == (below_crit is None):
        raise InputError("give the speed with either --omega or --below-crit")
    if omega is not None:
        return checked_speed(omega)
    return speed_below_crit(common.parameters, below_crit, common.digits)


def print_result(common: Common, result: dict[str, Any], lines: Iterable[object] | None = None) -> None:
    """One JSON object, or these lines; its entries as lines, with units, if there are none of their own."""
    if common.json:
        click.echo(json.dumps(result, indent=1))
    elif not common.quiet:
        for line in result_lines(result) if lines is None else lines:
            click.echo(line)


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
