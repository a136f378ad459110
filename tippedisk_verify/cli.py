"""The command line: a thin layer over the package's functions.

Exit status 0: done; 1: one of our own checks fell short; 2: bad input, one line on standard error; 130: interrupted.
Nothing but click is imported until a command runs.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from io import TextIOWrapper
from typing import Any, NoReturn

import click

from tippedisk_verify import __version__
from tippedisk_verify.commands.basin import COMMANDS as BASIN_COMMANDS
from tippedisk_verify.commands.bench import COMMANDS as BENCH_COMMANDS
from tippedisk_verify.commands.common import Common, Interrupts, common_options, print_json, progress
from tippedisk_verify.commands.conformance import COMMANDS as CONFORMANCE_COMMANDS
from tippedisk_verify.commands.numbers import COMMANDS
from tippedisk_verify.commands.reference import COMMANDS as REFERENCE_COMMANDS
from tippedisk_verify.commands.stress import COMMANDS as STRESS_COMMANDS
from tippedisk_verify.commands.sweep import COMMANDS as SWEEP_COMMANDS
from tippedisk_verify.errors import InputError, Shortfall

__all__ = ["entry", "main"]

_LONGEST = 1_000  # characters of a line that says what is wrong


@click.group(
    context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False, invoke_without_command=True
)
@click.version_option(__version__, prog_name="tippedisk-verify", message="%(prog)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """True numbers of the tippedisk, and a verdict on each number that its paper prints."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@cli.command()
@click.option("--out", metavar="DIR", help="Write report, figures and data there.")
@click.option("--only", multiple=True, metavar="CLAIM...", help="Examine these claims only.")
@click.argument("more", nargs=-1, metavar="")
@common_options
def verify(common: Common, out: str | None, only: Sequence[str], more: Sequence[str]) -> int:
    """Audit every claim of the paper; write the report, figures and data."""
    if more and not only:
        raise InputError(f"'{more[0][:40]}' stands alone: name claims with --only")
    from tippedisk_verify.evidence.catalogue import selected
    from tippedisk_verify.evidence.claims import Audit, audited
    from tippedisk_verify.flow import default_engine

    names = [name for group in (*only, *more) for name in group.split(",") if name]
    if only and not names:
        raise InputError("--only names no claim")
    claims = selected(names)
    folder = _folder(out)
    audit = Audit(common.parameters, default_engine(), common.friction, common.digits)
    findings = []
    with progress(common, len(claims) + (folder is not None)) as advance:
        advance(claims[0].name, 0)
        for position, (claim, finding) in enumerate(audited(audit, claims)):
            findings.append((claim, finding))
            advance(claims[position + 1].name if position + 1 < len(claims) else "report", 1)
        from tippedisk_verify.report import results_json, summary, write_report

        if folder is not None:
            scenes = [claim.name.removeprefix("scene_") for claim in claims if claim.name.startswith("scene_")]
            results = write_report(folder, audit, findings, _computed(audit, scenes))
            advance("report", 1)
        else:
            results = results_json(audit, findings)
    if common.json:
        print_json(results)
    elif not common.quiet:
        _print_claims(audit, findings)
        if folder is not None:
            click.echo(f"report, figures and data: {folder}")
    failed = summary(findings)["own_checks_failed"]
    if failed:
        click.echo(f"own checks that fell short: {', '.join(failed)}", err=True)
    return 1 if failed else 0


def _computed(audit: Any, scenes: Sequence[str]) -> list[Any]:
    """The audited set's panels; a scene that could not be computed is missing here and undecided in the table."""
    panels = []
    for scene in scenes:
        try:
            panels.append(audit.panel(scene, audit.parameters.name))
        except (Shortfall, ArithmeticError, InputError):
            continue
    return panels


@cli.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...|all")
@click.option("--out", metavar="DIR", help="Write figure and CSV data there.")
@click.option("--omega-h", metavar="X", help="Use this Omega_h [rad/s] instead of finding it.")
@common_options
def scene(common: Common, names: Sequence[str], out: str | None, omega_h: str | None) -> int:
    """The panels a to f of the paper's figures 3D and proj_3D."""
    from fractions import Fraction

    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.model.equations import checked_speed
    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.orbits.scenes import SCENES, compute, scene_named

    chosen = list(SCENES) if "all" in names else list(dict.fromkeys(scene_named(name) for name in names))
    if common.digits > 12:
        raise InputError(f"scenes hold at most 12 digits, not {common.digits}: their orbits run in double precision")
    given = None
    if omega_h is not None:
        given = Measured(checked_speed(omega_h), Fraction(0))
    folder = _folder(out)
    engine = default_engine()
    with progress(common, len(chosen)) as advance:
        found_with: tuple[Any, ...] = ()
        if given is None and any(panel.base == "Omega_h" for panel in chosen):
            from tippedisk_verify.orbits.heteroclinic import heteroclinic

            advance("Omega_h", 0)
            given = heteroclinic(common.parameters, engine, friction=common.friction).omega_h
            found_with = getattr(engine, "builds", ())
        panels = []
        for panel in chosen:
            advance(f"scene {panel.name}", 0)
            panels.append(compute(panel, common.parameters, engine, omega_h=given, friction=common.friction))
            advance(f"scene {panel.name}", 1)
        if folder is not None:
            from tippedisk_verify.plots import draw_scenes_2d, draw_scenes_3d, save
            from tippedisk_verify.report import write_scene_data

            save(draw_scenes_3d(panels, common.parameters), folder, "scenes_3d")
            save(draw_scenes_2d(panels), folder, "scenes_2d")
            for drawn in panels:
                write_scene_data(folder, drawn, common.parameters)
    if common.json:
        result = {
            "scenes": {panel.scene.name: panel.json() for panel in panels},
            "omega_h": None if given is None else given.json(),
            "compiled_for_omega_h": [build.json() for build in found_with],
            "parameters": common.parameters.name,
            "friction": common.friction,
        }
        print_json(result)
    elif not common.quiet:
        for drawn in panels:
            click.echo(f"scene {drawn.scene.name}: Omega = {drawn.omega} rad/s")
            for start, orbit in enumerate(drawn.orbits, start=1):
                ending = orbit.ending
                detail = f" at {ending.time} s" if ending.time is not None else ""
                click.echo(f"  orbit {start}: {ending.kind}{detail} ({ending.reason})")
    return 0


def _folder(out: str | None) -> Any:
    if out is None:
        return None
    from tippedisk_verify.files import output_folder

    return output_folder(out)


def _print_claims(audit: Any, findings: Sequence[tuple[Any, Any]]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from tippedisk_verify.report import shown

    colours = {"holds": "green", "holds-for": "yellow", "does-not-follow": "red", "undecided": "magenta"}
    table = Table(title=escape(f"Claims ({audit.parameters.name}, {audit.friction} friction)"), title_justify="left")
    for heading in ("claim", "paper", *audit.sets, "verdict"):
        table.add_column(escape(heading), overflow="fold")
    for claim, finding in findings:
        verdict = finding.verdict.value
        text = f"[{colours[verdict]}]{verdict}[/]" + (
            ": " + escape(", ".join(finding.sets)) if verdict == "holds-for" else ""
        )
        cells = [shown(finding.computed[name]) if name in finding.computed else "" for name in audit.sets]
        table.add_row(claim.name, claim.printed, *cells, text)
    console = Console()
    if not console.is_terminal:
        console = Console(width=160)  # a file has no width of its own; keep rows on one line
    console.print(table)


for command in (
    *COMMANDS,
    *BASIN_COMMANDS,
    *BENCH_COMMANDS,
    *REFERENCE_COMMANDS,
    *CONFORMANCE_COMMANDS,
    *SWEEP_COMMANDS,
    *STRESS_COMMANDS,
):
    cli.add_command(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status. For tests: takes the arguments as a list."""
    Interrupts.pressed = False
    try:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, Interrupts.handle)
        status = cli.main(args=None if arguments is None else list(arguments), standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()  # here, where a full disk can still be told
    except click.exceptions.Exit as stop:
        return int(stop.exit_code)
    except (KeyboardInterrupt, click.Abort):
        return _told("interrupted", 130)
    except click.ClickException as fault:
        return _refused(fault.format_message())
    except InputError as fault:
        return _refused(str(fault))
    except (Shortfall, ArithmeticError) as shortfall:
        return _told(str(shortfall), 1)
    except MemoryError:
        return _told("the memory is used up: ask for less at a time, or fewer --jobs", 1)
    except (ImportError, SystemError) as fault:  # what is left of a MemoryError while libraries are loaded
        return _told(f"a library cannot be loaded, perhaps for lack of memory: {fault}", 1)
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
        return _refused(f"{where}{fault.strerror or fault}")
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.default_int_handler)
    return status if isinstance(status, int) else 0


def entry() -> NoReturn:
    """The console script: `main`, with its status as the process's, also after Ctrl-C."""
    # The matrices here are small. Threads that wait for each other cost tenfold where other work keeps the cores busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal or a locale that cannot show a character
    status = main()
    if status == 130:
        # An interrupt inside exec() leaves a mark that makes Python end by the signal instead of with our status.
        with suppress(OSError, AttributeError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def _refused(message: str) -> int:
    return _told(message, 2)


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
