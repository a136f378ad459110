"""The commands about one disk: its states and cycles, its motion, and Omega_h."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    at_a_speed,
    below_crit_option,
    decimal,
    disk_command,
    file_for,
    jobs_option,
    omega_option,
    processes,
    rotating_option,
    table,
    unstable_option,
)
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.files import read_text, write_bytes, write_csv, write_table
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.model.results import heading, result_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle
    from tippedisk_verify.motion.solution import Solution

__all__ = ["COMMANDS", "OMEGA_H"]

_MOST_TIMES = 1_000_000
_LARGEST_FILE = 2**25  # bytes
_BRANCH_DIGITS = 12  # of the cycles of a family
_MOTION = ("t", "beta", "gamma", "v")
_STATES = ("inverted", "noninverted")


@disk_command("Integrate one motion, with half-widths of its states and events; at 201 even times if none are given.")
@at_a_speed
@click.option("--state", required=True, metavar="BETA,GAMMA,V", help="The start, such as pi/2,pi/2+0.4,0.")
@click.option("--time", required=True, metavar="T|T0,T1", help="How long, or from when to when [s].")
@click.option("--times", metavar="N|FILE", help="So many even times, or the first column of a file.")
@click.option(
    "--events",
    default="",
    metavar="NAME,...",
    help="Crossings to report: section (beta = pi/2), turn (v = 0), surface (the sliding velocity is zero).",
)
@click.option(
    "--max-steps",
    default=100_000,
    show_default=True,
    metavar="N",
    help="Steps that the run may take; a run that needs more ends with exit status 1.",
)
@click.option(
    "--out",
    callback=file_for(".csv", ".parquet", ".png"),
    metavar="FILE.csv|.parquet|.png",
    help="Write the motion with its events there, or draw it.",
)
def integrate(
    common: Common,
    omega: Fraction,
    state: str,
    time: str,
    times: str | None,
    events: str,
    max_steps: int,
    out: Path | None,
) -> int:
    ends = time.split(",")
    solution = common.disk.integrate(
        omega,
        state.split(","),
        ends if len(ends) > 1 else time,
        t_eval=None if times is None else _times(times, ends),
        digits=common.digits,
        events=events.split(",") if events else (),
        max_steps=max_steps,
        progress=not common.quiet,
    )
    if solution.note:
        click.echo(f"note: {solution.note}", err=True)
    entries = solution.to_dict()
    rows = [dict(zip(_MOTION, row, strict=True)) for row in zip(*(entries[name] for name in _MOTION), strict=True)]
    if out is not None:
        _write_motion(solution, rows + [{**one, "event": one["name"]} for one in entries["events"]], out)
    shown = {name: entries[name] for name in ("message", "end", "events")} | ({"samples": rows} if times else {})
    common.show(entries, result_lines(shown))
    return 0 if solution.success else 1


def _times(text: str, ends: list[str]) -> list[Any]:
    """Return even times over the run, exactly, or those in the first column of a file, with or without a heading t."""
    from tippedisk_verify.motion.solution import even_times

    if not text.isdecimal():
        lines = read_text(Path(text), _LARGEST_FILE).splitlines()
        column = [line.split(",")[0].strip() for line in lines if line.strip()]
        return column[1:] if column[:1] == ["t"] else column
    if not 2 <= (count := int(text[:20])) <= _MOST_TIMES:
        raise InputError(f"--times is a number from 2 to {_MOST_TIMES}, or a file, not '{text[:40]}'")
    first, last = exact(ends[0] if len(ends) > 1 else 0), exact(ends[-1])
    return even_times(first, last, count)


def _write_motion(solution: Solution, rows: list[dict[str, Any]], target: Path) -> None:
    """The picture, or the table: the samples, and below them the events with their names."""
    if target.suffix.lower() == ".png":
        from tippedisk_verify.figures.motion import draw_motion
        from tippedisk_verify.figures.style import encoded

        write_bytes(target, encoded(draw_motion(solution), "png"))
        return
    lines = []
    for row in rows:
        texts = {name: entry for name, entry in row.items() if isinstance(entry, str) and name != "name"}
        numbers = {name: entry for name, entry in row.items() if isinstance(entry, dict)}
        widths = {f"{name}_uncertainty": entry["uncertainty"] for name, entry in numbers.items()}
        lines.append(texts | {name: entry["value"] for name, entry in numbers.items()} | widths)
    write_table(target, lines)


@disk_command("Compute states, eigenvalues and stability of inverted and noninverted spinning.")
@at_a_speed
def equilibria(common: Common, omega: Fraction) -> dict[str, Any]:
    return {name: common.disk.equilibrium(name, omega, digits=common.digits).to_dict() for name in _STATES}


@disk_command("Compute the Hopf point: speed, period, first Lyapunov coefficient, laws of amplitude and period.")
def hopf(common: Common) -> Any:
    return common.disk.hopf(digits=common.digits)


@disk_command("Compute the orders of the slow manifold, their residuals, and the reduced flow.")
@click.option(
    "--order",
    type=int,
    required=True,
    metavar="N",
    help="Highest order in epsilon, 0 to 40. Above 5 it takes long: 8 some ten seconds, 12 half a minute.",
)
@click.option(
    "--omega", callback=decimal, metavar="X", help="The spinning speed [rad/s]; Omega_crit - 0.5 if not given."
)
@click.option("--beta", callback=decimal, default="1.2", show_default=True, metavar="X", help="Where h is taken [rad].")
@click.option(
    "--gamma", callback=decimal, default="0.3", show_default=True, metavar="X", help="Where h is taken [rad]."
)
def slow_manifold(common: Common, order: int, omega: str | None, beta: str, gamma: str) -> Any:
    return common.disk.slow_manifold(order, omega, at=(beta, gamma), digits=common.digits)


@disk_command("Compute one limit cycle by shooting: period, state, multipliers, sensitivities.")
@omega_option
@below_crit_option
@click.option("--above-het", callback=decimal, metavar="D", help="Omega_h + D [rad/s], with D as small as 1e-100.")
@click.option("--below-het", callback=decimal, metavar="D", help="The rotating cycle at Omega_h - D [rad/s].")
@click.option("--at-fold", is_flag=True, help="Where two cycles of the family meet and end: each of its folds.")
@rotating_option
@unstable_option
def orbit(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    above_het: str | None,
    below_het: str | None,
    at_fold: bool,
    rotating: bool,
    unstable: bool,
) -> Any:
    disk, digits = common.disk, common.digits
    if rotating and above_het is not None:
        raise InputError("--above-het is for cycles that do not rotate")
    if not rotating and below_het is not None:
        raise InputError("--below-het belongs to --rotating")
    beside = {"below_het": below_het} if rotating else {"above_het": above_het}
    speeds = {"omega": omega, "below_crit": below_crit, **beside}
    number = at_fold + sum(speed is not None for speed in speeds.values())
    if number != 1:
        ways = ", ".join(f"--{name.replace('_', '-')}" for name in speeds)
        raise InputError(
            f"give the speed of the cycle with one of {ways} and --at-fold{', not with several' * (number > 1)}"
        )
    if unstable and omega is below_crit is None:
        raise InputError("--unstable goes with --omega or --below-crit")
    if at_fold:
        return disk.rotation_fold(digits=digits) if rotating else disk.folds(digits=digits)
    if rotating:
        return disk.rotating_cycle(**speeds, stable=not unstable, digits=digits)
    return disk.limit_cycle(**speeds, stable=False if unstable else None, digits=digits)


@disk_command("Compute a limit cycle by harmonic balance of the full equations, without an integrator.")
@at_a_speed
@click.option("--harmonics", type=int, metavar="N", help="Number of odd harmonics; chosen for the digits if not given.")
def harmonic_balance(common: Common, omega: Fraction, harmonics: int | None) -> Any:
    return common.disk.harmonic_balance(omega, harmonics=harmonics, digits=common.digits)


@disk_command(
    "Compute the family of limit cycles from Omega_crit towards Omega_h, through any folds, or the rotating ones."
)
@click.option("--paper-sets", is_flag=True, help="The paper's sets A^in and A^de: 801 speeds.")
@click.option("--omegas", metavar="X,X,...", help="These speeds [rad/s], in this order.")
@rotating_option
@click.option("--out", callback=file_for(".csv"), metavar="FILE.csv", help="Write the family there as CSV.")
def branch(common: Common, paper_sets: bool, omegas: str | None, rotating: bool, out: Path | None) -> int:
    if common.digits > _BRANCH_DIGITS:
        raise InputError(f"a branch holds at most 12 digits, not {common.digits}: ask orbit for more at single speeds")
    if paper_sets and (omegas is not None or rotating):
        raise InputError("--paper-sets are speeds of their own, without rotating cycles: leave out the other option")
    disk, speeds, seen = common.disk, None if omegas is None else omegas.split(","), not common.quiet
    cycles: Sequence[LimitCycle | RotatingCycle]
    if rotating:
        cycles = disk.rotating_branch(speeds, progress=seen)
    else:
        cycles = disk.branch(speeds, paper_sets=paper_sets, progress=seen).cycles
    if out is not None:
        write_csv(out, *_family_table(cycles))
    result: dict[str, Any] = {"orbits": [cycle.to_dict() for cycle in cycles]}
    if rotating:
        result["fold"] = disk.rotation_fold(digits=common.digits).to_dict()
    else:
        with suppress(InputError, AccuracyError):  # none where the family is known at single speeds only
            result |= disk.folds(digits=common.digits).to_dict()
    common.show(result, _family_lines(result))
    return 0


def _family_table(cycles: Sequence[LimitCycle | RotatingCycle]) -> tuple[list[str], list[list[object]]]:
    """Return a header and a row for each cycle: each number with its half-width, and the stability."""
    names = [name for name, value in vars(cycles[0]).items() if isinstance(value, Measured)]
    header = [part for name in names for part in (name, f"{name} uncertainty")]
    rows = [[*(part for name in names for part in getattr(cycle, name).decimals()), cycle.stable] for cycle in cycles]
    return [*header, "stable"], rows


def _family_lines(result: dict[str, Any]) -> Iterator[str]:
    shown = ("omega", "period", "beta_max", "multiplier_slow")
    rows = ([f"{float(entries[name]['value']):.12g}" for name in shown] for entries in result["orbits"])
    yield from table([heading(name) for name in shown], rows)
    yield from result_lines({name: entry for name, entry in result.items() if name != "orbits"})


@disk_command("Compute what each of many initial states ends on: fractions with their sampling error, and a picture.")
@at_a_speed
@click.option("--count", type=int, default=100_000, show_default=True, metavar="N", help="Number of initial states.")
@click.option("--seconds", type=float, default=20.0, show_default=True, metavar="T", help="How long each runs [s].")
@click.option("--velocity", type=float, default=0.0, show_default=True, metavar="V", help="d(beta)/dt at the start.")
@click.option("--margin", metavar="BETA,GAMMA,V", help="Only how far this start is from the boundary, in beta [rad].")
@click.option("--out", metavar="DIR", help="Write picture and CSV there.")
@jobs_option
def basin(
    common: Common,
    omega: Fraction,
    count: int,
    seconds: float,
    velocity: float,
    margin: str | None,
    out: str | None,
    jobs: int | None,
) -> Any:
    disk = common.disk
    if margin is not None:
        if len(start := margin.split(",")) != 3:
            raise InputError(f"a start is three numbers, beta,gamma,v, not '{margin[:60]}'")
        distance = disk.basin_boundary(omega).margin([DOUBLE.number(part) for part in start])
        return {"margin": distance.to_dict(), "keeps_standing": distance > 0}
    folder = alone_in(out)
    with processes(jobs, needed=count >= 10_000) as pool:
        how = {"count": count, "duration": seconds, "v": velocity, "executor": pool}
        plane = disk.basins(omega, progress=not common.quiet, **how)
    if folder is not None:
        from tippedisk_verify.figures.basins import draw_basins
        from tippedisk_verify.figures.style import save

        boundary = None
        with suppress(InputError, AccuracyError):  # below the rotating cycles' fold everything lies flat
            boundary = disk.basin_boundary(omega)
        save(draw_basins(plane, boundary), folder, "basins")
        write_csv(folder / "basins.csv", ("beta [rad]", "gamma [rad]", "v [rad/s]", "ends on"), plane.rows())
    return plane


@disk_command("Compute Omega_h, where the saddles are connected, by one of several methods.")
@click.option(
    "--method",
    default="manifolds",
    show_default=True,
    metavar="NAME",
    help="manifolds, limit-cycles, bisection or scipy.",
)
@click.option("--out", callback=file_for(".csv"), metavar="FILE.csv", help="Write samples of the connection there.")
def heteroclinic(common: Common, method: str, out: Path | None) -> Any:
    connection = common.disk.heteroclinic(digits=common.digits, method=method)
    if out is not None:
        times, states = connection.orbit()
        rows = [list(row) for row in zip(times.tolist(), *states.tolist(), strict=True)]
        write_csv(out, [heading(name) for name in _MOTION], rows)
    return connection


COMMANDS = (integrate, equilibria, hopf, slow_manifold, orbit, harmonic_balance, branch, basin)
OMEGA_H = (heteroclinic,)
