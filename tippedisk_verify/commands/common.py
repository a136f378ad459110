"""What the commands share: options, which are written in their docstrings, progress, printing, and processes."""

from __future__ import annotations

import inspect
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
from functools import wraps
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import file_ending_in, output_file, sole_writer
from tippedisk_verify.interrupts import undoing
from tippedisk_verify.model.results import result_lines
from tippedisk_verify.parallel import usable_cores
from tippedisk_verify.progress import Advance, progress_of

if TYPE_CHECKING:
    from concurrent.futures import Executor

__all__ = ["Common", "Output", "alone_in", "checked_jobs", "command", "group", "processes", "table", "workers_of"]

_FEWEST_OFFERED = 16  # processes, each with a memory of its own
_BETWEEN_WORDS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
#: Options that several commands have; a command takes those that its parameters name.
_SHARED = """
--omega X  The spinning speed [rad/s].
--below-crit D  Omega_crit - D [rad/s].
--rotating  The rotating cycles, on which gamma grows by 2 pi a period.
--unstable  The unstable one, where a stable one has the same speed.
--executor serial|local|dask://HOST:PORT  One process, all cores of this machine, or a cluster.
--jobs N  Processes; as many as there are cores if not given.
--certificate FILE.json  Write what `certify check FILE.json` needs to prove it again.
--parameters NAME|FILE.toml  table1, calibrated, geometry, or a TOML file of decimals.
--friction linear|smooth  The friction law.
--digits N  Significant digits of each main result, at least.
--json  One JSON object on standard output.
--quiet  No progress and no table.
--set NAME  table1 or calibrated; both if not given.
--levels N-M  Levels of difficulty, such as 1-3,7; all ten if not given.
--states N  Fresh questions instead: N drawn states, ten to a drawn disk.
--seed S  What they are drawn from; 0 if not given.
--from decimals|doubles  What answers that do not say so were computed from.
--html FILE.html|.htm  Write a page with all grades there.
--csv FILE.csv  Write the grades by quantity there.
--badge FILE.svg  Write a picture there that says which levels agree.
--require N-M  Exit with 1 if one of these levels has no answer or a wrong one.
--expected-failures FILE  Ids that may fail, one to a line, * for any characters; exit with 1 if others do.
"""
_LINE = re.compile(r"^--([\w-]+)(?: (\S+))?  +(.+)$")
_TYPES = {"int": int, "float": float}


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


# ------------------------------------------------------------------------------------------ options
def command(function: Callable[..., Any]) -> click.Command:
    """The command that a function is: its first parameter is a `Common` or an `Output`, the others are options.

    Those are described in its docstring, a line ``--name METAVAR  text`` each, or in `_SHARED`; type and default are
    the parameter's, and `_check` makes of the text what it stands for. ``omega: Fraction`` is the speed, from --omega
    or --below-crit; keywords without names are what may be asked for beside grades. What has no line is an argument,
    which a decorator below this one declares. What the function returns is shown, unless it is an exit status.
    """
    says, described = _described(inspect.cleandoc(function.__doc__ or ""))
    (_, first), *others = inspect.signature(function).parameters.items()
    by_speed = any(one.annotation == "Fraction" for _, one in others)
    has_disk = first.annotation == "Common"

    @wraps(function)
    def checked(**options: Any) -> int:
        output = Output(options.pop("json"), options.pop("quiet"))
        if has_disk:
            from tippedisk_verify.disk import Disk
            from tippedisk_verify.model.precision import checked_digits

            disk = Disk(options.pop("parameters"), friction=options.pop("friction"))
            output = Common(output.json, output.quiet, disk, checked_digits(options.pop("digits")))
            if by_speed:
                options["omega"] = output.speed(options["omega"], options.pop("below_crit"))
        return output.finish(function(output, **options))

    known = _described(_SHARED)[1] | described
    params = list(reversed(getattr(function, "__click_params__", [])))
    for name, one in others:
        if one.kind is one.VAR_KEYWORD or one.annotation == "Fraction":
            names = _GRADING if one.kind is one.VAR_KEYWORD else ("omega", "below_crit")
            params += [_option(name, *known[name], "str", None) for name in names]
        elif name.rstrip("_") in known:
            params.append(_option(name, *known[name.rstrip("_")], str(one.annotation), one.default))
    params += [_option(name, *known[name], *told) for name, told in (_ABOUT if has_disk else _EVERY).items()]
    return click.Command(function.__name__.rstrip("_").replace("_", "-"), params=params, callback=checked, help=says)


_GRADING = ("html", "csv", "badge", "require", "expected_failures")
#: Types and defaults of the options that all commands have, and those about a disk.
_EVERY = {"json": ("bool", False), "quiet": ("bool", False)}
_ABOUT = {"parameters": ("str", "table1"), "friction": ("str", "linear"), "digits": ("int", 12)} | _EVERY


def group(name: str, says: str, *commands: click.Command) -> click.Group:
    """A group of commands, which prints its help when it is called by itself."""

    def helped() -> None:
        context = click.get_current_context()
        if context.invoked_subcommand is None:
            click.echo(context.get_help())

    return click.Group(name, commands, callback=helped, invoke_without_command=True, help=says)


def _described(docstring: str) -> tuple[str, dict[str, tuple[str, str | None, str]]]:
    """A docstring without its lines of options, and these by parameter: name, metavar and text of each."""
    lines = docstring.splitlines()
    first = next((n for n, line in enumerate(lines) if line.startswith("--")), len(lines))
    told = re.findall(r"^--.*(?:\n .*)*", "\n".join(lines[first:]), re.MULTILINE)
    options = [_LINE.fullmatch(re.sub(r"\n +", " ", one)) for one in told]
    by_name = {one[1].replace("-", "_"): (one[1], one[2], one[3]) for one in options if one}
    return "\n".join(lines[:first]).strip(), by_name


def _option(parameter: str, name: str, metavar: str | None, text: str, kind: str, default: Any) -> click.Option:
    required = default is inspect.Parameter.empty
    return click.Option(
        [f"--{name}", parameter],
        type=_TYPES.get(kind.removesuffix(" | None")),
        default=None if required else default,
        required=required,
        show_default=not required and default not in (None, False, "", ()),
        is_flag=metavar is None,
        multiple=kind.startswith("tuple[str, ..."),
        metavar=metavar,
        help=text,
        callback=_check(parameter, metavar or ""),
    )


def checked_jobs(jobs: int | None) -> int | None:
    """A number of processes that this machine can be asked for. Raises InputError for any other."""
    most = max(_FEWEST_OFFERED, 2 * (os.cpu_count() or 1))
    if jobs is not None and not 1 <= jobs <= most:
        raise InputError(f"--jobs must lie between 1 and {most} on this machine, not {str(jobs)[:40]}")
    return jobs


def _known_executor(executor: str) -> str:
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


def _known_reading(reading: str) -> str:
    if reading not in ("decimals", "doubles"):
        raise InputError(f"--from says decimals or doubles, not '{reading!s:.40}'")
    return reading


def _decimal(option: str, text: str) -> str:
    """The text of a decimal, which stays one. Raises InputError, with the option's name, for what is none."""
    from tippedisk_verify.model.exact import exact

    try:
        exact(text)
    except InputError as fault:
        raise InputError(f"{option}: {fault}") from None
    return text


_CHECKS: dict[str, Callable[[Any], Any]] = {
    "jobs": checked_jobs, "executor": _known_executor, "certificate": output_file, "from_": _known_reading,
    "levels": _levels, "require": _levels,
}  # fmt: skip


def _check(parameter: str, metavar: str) -> Callable[[click.Context, click.Parameter, Any], Any]:
    """What makes an option's value of its text, or raises InputError; FILE.x|.y is where a file of that kind may go."""
    endings = re.findall(r"\.\w+", metavar) if metavar.startswith("FILE.") else []
    if metavar in ("X", "D", "R"):
        return lambda context, option, value: None if value is None else _decimal(option.opts[0], value)
    check = _CHECKS.get(parameter) or (lambda value: file_ending_in(value, *endings) if endings else value)
    return lambda context, option, value: None if value is None else check(value)


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
