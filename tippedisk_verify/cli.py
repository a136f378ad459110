"""The command line: a thin layer over the package's functions.

Exit status 0: done; 1: one of our own checks fell short; 2: bad input, one line on standard error; 130: interrupted.
Nothing but click is imported until a command runs.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn, TypeVar

import click

from tippedisk_verify import __version__
from tippedisk_verify.errors import InputError, Shortfall

__all__ = ["entry", "main"]

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Common:
    """The options that every command takes, checked."""

    parameters: Any
    friction: Any
    digits: int
    json: bool
    quiet: bool


def common_options(command: F) -> F:
    """Add the common options and hand them to the command as one `Common`."""
    from functools import wraps

    @wraps(command)
    def checked(parameters: str, friction: str, digits: int, as_json: bool, quiet: bool, **options: Any) -> Any:
        from tippedisk_verify.model.equations import checked_friction
        from tippedisk_verify.model.parameters import Parameters
        from tippedisk_verify.model.precision import bits_for_digits

        bits_for_digits(digits)  # refuses what no precision can hold
        chosen = Common(Parameters.named(parameters), checked_friction(friction), digits, as_json, quiet)
        return command(chosen, **options)

    for option in reversed(
        (
            click.option("--parameters", default="printed", show_default=True, metavar="NAME|FILE.toml",
                         help="printed, calibrated, geometry, or a TOML file of quoted decimals."),
            click.option("--friction", default="linear", show_default=True, metavar="linear|smooth",
                         help="The friction law."),
            click.option("--digits", type=int, default=12, show_default=True, metavar="N",
                         help="Significant digits of each main result."),
            click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output."),
            click.option("--quiet", is_flag=True, help="No progress and no table."),
        )
    ):  # fmt: skip
        checked = option(checked)
    return checked  # type: ignore[return-value]


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
    claims = selected(names)
    folder = _folder(out)
    audit = Audit(common.parameters, default_engine(common.friction), common.friction, common.digits)
    findings = []
    with _progress(common, len(claims) + (folder is not None)) as advance:
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
        _print_json(results)
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
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.model.exact import exact
    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.orbits.scenes import SCENES, compute, scene_named

    chosen = list(SCENES) if "all" in names else list(dict.fromkeys(scene_named(name) for name in names))
    if common.digits > 12:
        raise InputError(f"scenes hold at most 12 digits, not {common.digits}: their orbits run in double precision")
    given = None
    if omega_h is not None:
        number = exact(omega_h)
        if number.pi_multiple or not 0 < number.rational < 10**6:
            raise InputError(f"--omega-h must lie between 0 and 1e6 rad/s, not {omega_h[:40]}")
        given = Measured(number.rational, number.rational * 0)
    folder = _folder(out)
    engine = default_engine(common.friction)
    with _progress(common, len(chosen)) as advance:
        found_with: tuple[Any, ...] = ()
        if given is None and any(panel.base == "Omega_h" for panel in chosen):
            from tippedisk_verify.orbits.heteroclinic import bisect_omega_h

            advance("Omega_h", 0)
            given = bisect_omega_h(common.parameters, engine, friction=common.friction).omega_h
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
        _print_json(result)
    elif not common.quiet:
        for drawn in panels:
            click.echo(f"scene {drawn.scene.name}: Omega = {drawn.omega} rad/s")
            for start, orbit in enumerate(drawn.orbits, start=1):
                ending = orbit.ending
                detail = f" at {ending.time} s" if ending.time is not None else ""
                click.echo(f"  orbit {start}: {ending.kind}{detail} ({ending.reason})")
    return 0


def _speed(common: Common, omega: str | None, below_crit: str | None) -> Any:
    """Omega as an exact rational [rad/s], from --omega or --below-crit."""
    from fractions import Fraction

    from tippedisk_verify.model.exact import exact
    from tippedisk_verify.theory.hopf import omega_crit

    if (omega is None) == (below_crit is None):
        raise InputError("give the speed with either --omega or --below-crit")
    number = exact(omega if omega is not None else below_crit)
    if number.pi_multiple:
        raise InputError("the speed must be a decimal")
    if omega is not None:
        speed = number.rational
    else:
        # 30 digits more than asked for: the rounding of Omega_crit then stays far below every half-width.
        speed = Fraction(omega_crit(common.parameters, common.digits + 30).decimals()[0]) - number.rational
    if not 0 < speed < 10**6:
        raise InputError(f"Omega must lie between 0 and 1e6 rad/s, not {float(speed):.12g}")
    return speed


def _speed_options(command: F) -> F:
    command = click.option("--below-crit", metavar="D", help="Omega_crit - D [rad/s].")(command)
    return click.option("--omega", metavar="X", help="The spinning speed [rad/s].")(command)


def _print_result(common: Common, result: dict[str, Any]) -> None:
    """One JSON object, or its entries as lines."""
    if common.json:
        _print_json(result)
    elif not common.quiet:
        for name, value in result.items():
            click.echo(f"{name}: {_said(value)}")


def _said(value: Any) -> str:
    if isinstance(value, dict) and set(value) == {"value", "uncertainty"}:
        text, width = str(value["value"]), str(value["uncertainty"])
        return text if width == "0" else f"{text} ± {width}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_said(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return "; ".join(_said(entry) for entry in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


@cli.command()
@_speed_options
@common_options
def equilibria(common: Common, omega: str | None, below_crit: str | None) -> int:
    """States, eigenvalues and stability of inverted and noninverted spinning."""
    from tippedisk_verify.theory.equilibria import equilibrium

    speed = _speed(common, omega, below_crit)
    _print_result(
        common,
        {
            "inverted": equilibrium(common.parameters, speed, "inverted", common.digits).json(),
            "noninverted": equilibrium(common.parameters, speed, "noninverted", common.digits).json(),
        },
    )
    return 0


@cli.command()
@common_options
def hopf(common: Common) -> int:
    """The Hopf point: speed, period, first Lyapunov coefficient, amplitude and period laws."""
    from tippedisk_verify.theory.hopf import hopf_point

    if common.friction == "smooth":
        raise InputError(
            "the smooth field is only once differentiable: it has no first Lyapunov coefficient; use linear"
        )
    _print_result(common, hopf_point(common.parameters, common.digits).json())
    return 0


@cli.command("slow-manifold")
@click.option("--order", type=int, required=True, metavar="N", help="Highest order in epsilon, 0 to 40.")
@click.option("--omega", metavar="X", help="The spinning speed [rad/s]; Omega_crit - 0.5 if not given.")
@common_options
def slow_manifold(common: Common, order: int, omega: str | None) -> int:
    """Orders of the slow manifold, their residuals, and the reduced flow."""
    from tippedisk_verify.theory.slow_manifold import study

    if common.friction == "smooth":
        raise InputError("the slow manifold's expansion is for the linear friction law")
    speed = _speed(common, omega, None if omega is not None else "0.5")
    found = study(common.parameters, speed, order, common.digits)
    if found.warning and not common.quiet:
        click.echo(f"tippedisk-verify: {found.warning}", err=True)
    _print_result(common, found.json())
    return 0


@cli.command()
@_speed_options
@common_options
def orbit(common: Common, omega: str | None, below_crit: str | None) -> int:
    """One limit cycle by shooting: period, state, multipliers, sensitivities."""
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits.periodic import limit_cycle

    if common.friction == "smooth":
        raise InputError("limit cycles are offered for the linear friction law")
    speed = _speed(common, omega, below_crit)
    found = limit_cycle(common.parameters, speed, default_engine(common.friction), digits=common.digits).json()
    del found["residuals"]  # of interest to who studies the iteration, from Python
    _print_result(common, found)
    return 0


@cli.command()
@click.option("--paper-sets", is_flag=True, help="The paper's sets A^in and A^de: 801 speeds.")
@click.option("--omegas", metavar="X,X,...", help="These speeds [rad/s], in this order.")
@click.option("--out", metavar="FILE.csv", help="Write the family there as CSV.")
@common_options
def branch(common: Common, paper_sets: bool, omegas: str | None, out: str | None) -> int:
    """The family of limit cycles between Omega_h and Omega_crit."""
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits import branches

    if common.friction == "smooth":
        raise InputError("limit cycles are offered for the linear friction law")
    if common.digits > 12:
        raise InputError(f"a branch holds at most 12 digits, not {common.digits}: ask orbit for more at single speeds")
    if paper_sets and omegas is not None:
        raise InputError("give either --paper-sets or --omegas")
    target = None if out is None else branches.target(out)
    engine = default_engine(common.friction)
    total = 801 if paper_sets else len(omegas.split(",")) if omegas else branches.DEFAULT_COUNT
    cycles = []
    with _progress(common, total) as advance:
        for cycle in branches.family(common.parameters, engine, paper_sets=paper_sets, omegas=omegas):
            cycles.append(cycle)
            advance(f"Omega = {float(cycle.omega):.6g}", 1)
    if target is not None:
        branches.write(cycles, target)
    if common.json:
        _print_json({"orbits": [branches.entry(cycle) for cycle in cycles]})
    elif not common.quiet:
        for cycle in cycles:
            click.echo(
                f"Omega {float(cycle.omega):.10f}  T {float(cycle.period):.12f} s"
                f"  beta_max {float(cycle.beta_max):.12f} rad  multiplier {float(cycle.multiplier_slow):.6g}"
            )
    return 0


@cli.command("harmonic-balance")
@_speed_options
@click.option("--harmonics", type=int, metavar="N", help="Number of odd harmonics; chosen for the digits if not given.")
@common_options
def harmonic_balance(common: Common, omega: str | None, below_crit: str | None, harmonics: int | None) -> int:
    """A limit cycle by harmonic balance of the full equations, without an integrator."""
    from tippedisk_verify.theory.spectral_balance import balanced_cycle

    if common.friction == "smooth":
        raise InputError("harmonic balance is offered for the linear friction law")
    speed = _speed(common, omega, below_crit)
    found = balanced_cycle(common.parameters, speed, digits=common.digits, harmonics=harmonics)
    _print_result(common, found.json())
    return 0


def _folder(out: str | None) -> Any:
    if out is None:
        return None
    if not out:
        raise InputError("--out needs the name of a folder")
    from tippedisk_verify.files import output_folder

    return output_folder(out)


def _print_json(result: dict[str, Any]) -> None:
    click.echo(json.dumps(result, indent=1, ensure_ascii=False))


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


@contextmanager
def _progress(common: Common, total: int) -> Iterator[Callable[[str, int], None]]:
    """A live bar on a terminal's standard error, nothing anywhere else."""
    if common.quiet or not sys.stderr.isatty():
        yield lambda label, steps: _raise_if_interrupted()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)

        def advance(label: str, steps: int) -> None:
            _raise_if_interrupted()
            bar.update(task, description=label, advance=steps)

        yield advance


_interrupted = False


def _interrupt(number: int, frame: object) -> NoReturn:
    """Ctrl-C, remembered as well: an extension module that is being imported may clear the exception."""
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt


def _raise_if_interrupted() -> None:
    if _interrupted:
        raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status. For tests: takes the arguments as a list."""
    global _interrupted
    _interrupted = False
    try:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, _interrupt)
        status = cli.main(args=None if arguments is None else list(arguments), standalone_mode=False)
        sys.stdout.flush()  # here, where a full disk can still be told
    except click.exceptions.Exit as stop:
        return int(stop.exit_code)
    except click.ClickException as fault:
        return _refused(fault.format_message())
    except InputError as fault:
        return _refused(str(fault))
    except (Shortfall, ArithmeticError) as shortfall:
        click.echo(f"tippedisk-verify: {_one_line(str(shortfall))}", err=True)
        return 1
    except (KeyboardInterrupt, click.Abort):
        click.echo("tippedisk-verify: interrupted", err=True)
        return 130
    except BrokenPipeError:  # the reader of our output has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as fault:
        where = f" {fault.filename}" if fault.filename else ""
        return _refused(f"cannot write{where}: {fault.strerror or fault}")
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.default_int_handler)
    return status if isinstance(status, int) else 0


def entry() -> NoReturn:
    """The console script: `main`, with its status as the process's, also after Ctrl-C."""
    status = main()
    if status == 130:
        # An interrupt inside exec() leaves a mark that makes Python end by the signal instead of with our status.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def _refused(message: str) -> int:
    click.echo(f"tippedisk-verify: {_one_line(message)}", err=True)
    return 2


def _one_line(message: str) -> str:
    return " ".join(message.split())
