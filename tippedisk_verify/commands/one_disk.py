"""The commands `integrate`, `equilibria`, `hopf`, `slow-manifold`, `orbit`, `harmonic-balance`,
`branch` and `basin`, about one disk.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import (
    MOTION_COLUMNS,
    DiskOptions,
    below_crit_option,
    decimal,
    disk_command,
    half_widths_option,
    lock_output_folder,
    motion_rows,
    omega_option,
    output_file_callback,
    rotating_option,
    table,
    unstable_option,
    with_width_columns,
)
from tippedisk_verify.commands.jobs import jobs_option, process_pool
from tippedisk_verify.display import column_heading, result_lines
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import require_one_speed
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.support.files import read_text, write_bytes, write_csv, write_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tippedisk_verify.cycles.limit_cycle import LimitCycle, MissingCycle, RotatingCycle
    from tippedisk_verify.motion.solution import Solution

__all__ = ["COMMANDS"]

_MAX_TIMES = 1_000_000  # of one motion
_MAX_FILE = 2**25  # bytes of a file of times
_BRANCH_DIGITS = 12  # of the cycles of a family
_STATES = ("inverted", "noninverted")


@disk_command(
    "Integrate one motion, with half-widths of its states and events, at 201 evenly "
    "spaced times if none are given."
)
@omega_option
@below_crit_option
@click.option(
    "--state",
    required=True,
    metavar="BETA,GAMMA,V",
    help="The initial state, such as pi/2,pi/2+0.4,0.",
)
@click.option(
    "--time", required=True, metavar="T|T0,T1", help="The duration, or the start and end time [s]."
)
@click.option(
    "--times",
    metavar="N|FILE",
    help="The number of even times, or a file whose first column has the times.",
)
@click.option(
    "--events",
    default="",
    metavar="NAME,...",
    help="Crossings to report: section (beta = pi/2), turn (v = 0), surface (the sliding velocity "
    "is zero).",
)
@click.option(
    "--max-steps",
    default=100_000,
    show_default=True,
    metavar="N",
    help="The maximum number of steps; a run that needs more ends with exit status 1.",
)
@half_widths_option
@click.option(
    "--out",
    callback=output_file_callback(".csv", ".parquet", ".png"),
    metavar="FILE.csv|.parquet|.png",
    help="Write a table of the motion and its events there, or a figure.",
)
def integrate(
    common: DiskOptions,
    omega: str | None,
    below_crit: str | None,
    state: str,
    time: str,
    times: str | None,
    events: str,
    max_steps: int,
    half_widths: bool,
    out: Path | None,
) -> int:
    ends = time.split(",")
    solution = common.disk.integrate(
        common.speed(omega, below_crit),
        state.split(","),
        ends if len(ends) > 1 else time,
        t_eval=None if times is None else _times(times, ends),
        digits=common.digits,
        events=events.split(",") if events else (),
        max_steps=max_steps,
        half_widths=half_widths,
        progress=not common.quiet,
    )
    if solution.note:
        click.echo(f"note: {solution.note}", err=True)
    entries = solution.to_dict()
    rows = motion_rows(*(entries[name] for name in MOTION_COLUMNS))
    if out is not None:
        _write_motion(
            solution, rows + [{**event, "event": event["name"]} for event in entries["events"]], out
        )
    shown = {name: entries[name] for name in ("message", "end", "events")} | (
        {"samples": rows} if times else {}
    )
    common.show(entries, result_lines(shown))
    return 0 if solution.success else 1


def _times(text: str, ends: list[str]) -> Sequence[Any]:
    """Return the times that --times gives: exact even times, or the first column of a file.

    The column may have the heading t.
    """
    from tippedisk_verify.motion.times import EvenTimes

    if not text.isdecimal():
        lines = read_text(Path(text), _MAX_FILE).splitlines()
        column = [line.split(",")[0].strip() for line in lines if line.strip()]
        return column[1:] if column[:1] == ["t"] else column
    if not 2 <= (count := int(text[:20])) <= _MAX_TIMES:
        raise InputError(
            f"--times is a number from 2 to {_MAX_TIMES}, or a file, not '{text[:40]}'"
        )
    first, last = exact(ends[0] if len(ends) > 1 else 0), exact(ends[-1])
    return EvenTimes(first, last, count)


def _write_motion(solution: Solution, rows: list[dict[str, Any]], target: Path) -> None:
    """Write a computed motion to a file: a figure, or the table of samples followed by the events
    with their names.
    """
    if target.suffix.lower() == ".png":
        from tippedisk_verify.figures.motion_figure import draw_motion
        from tippedisk_verify.figures.style import encode_figure

        write_bytes(target, encode_figure(draw_motion(solution), "png"))
        return
    write_table(target, with_width_columns(rows))


@disk_command("Compute states, eigenvalues and stability of inverted and noninverted spinning.")
@omega_option
@below_crit_option
def equilibria(common: DiskOptions, omega: str | None, below_crit: str | None) -> dict[str, Any]:
    speed = common.speed(omega, below_crit)
    return {
        name: common.disk.equilibrium(name, speed, digits=common.digits).to_dict()
        for name in _STATES
    }


@disk_command(
    "Compute the Hopf point: speed, period, first Lyapunov coefficient, laws of "
    "amplitude and period."
)
def hopf(common: DiskOptions) -> Any:
    return common.disk.hopf(digits=common.digits)


@disk_command("Compute the orders of the slow manifold, their residuals, and the reduced flow.")
@click.option(
    "--order",
    type=int,
    required=True,
    metavar="N",
    help="The highest order in epsilon, 0 to 40. Order 12 takes some three seconds, 20 twenty and 30 "
    "two minutes.",
)
@click.option(
    "--omega",
    callback=decimal,
    metavar="X",
    help="The spinning speed [rad/s]; Omega_crit - 0.5 if not given.",
)
@click.option(
    "--beta",
    callback=decimal,
    default="1.2",
    show_default=True,
    metavar="X",
    help="The angle beta at which h is evaluated [rad].",
)
@click.option(
    "--gamma",
    callback=decimal,
    default="0.3",
    show_default=True,
    metavar="X",
    help="The angle gamma at which h is evaluated [rad].",
)
def slow_manifold(common: DiskOptions, order: int, omega: str | None, beta: str, gamma: str) -> Any:
    return common.disk.slow_manifold(order, omega, at=(beta, gamma), digits=common.digits)


@disk_command("Compute one limit cycle by shooting: period, state, multipliers, sensitivities.")
@omega_option
@below_crit_option
@click.option(
    "--above-het",
    callback=decimal,
    metavar="D",
    help="The speed Omega_h + D [rad/s], with D as small as 1e-100.",
)
@click.option(
    "--below-het",
    callback=decimal,
    metavar="D",
    help="The speed Omega_h - D [rad/s], of a rotating cycle.",
)
@click.option(
    "--at-fold",
    is_flag=True,
    help="Compute the folds of the family, where two cycles meet and end.",
)
@rotating_option
@unstable_option
@half_widths_option
def orbit(
    common: DiskOptions,
    omega: str | None,
    below_crit: str | None,
    above_het: str | None,
    below_het: str | None,
    at_fold: bool,
    rotating: bool,
    unstable: bool,
    half_widths: bool,
) -> Any:
    disk, digits = common.disk, common.digits
    if rotating and above_het is not None:
        raise InputError("--above-het is for cycles that do not rotate")
    if not rotating and below_het is not None:
        raise InputError("--below-het belongs to --rotating")
    distance = {"below_het": below_het} if rotating else {"above_het": above_het}
    speeds = {"omega": omega, "below_crit": below_crit, **distance}
    require_one_speed(
        **{f"--{name.replace('_', '-')}": speed for name, speed in speeds.items()},
        **{"--at-fold": at_fold},
    )
    if unstable and omega is None and below_crit is None:
        raise InputError("--unstable goes with --omega or --below-crit")
    if at_fold:
        return disk.rotation_fold(digits=digits) if rotating else disk.folds(digits=digits)
    how: dict[str, Any] = {
        "digits": digits,
        "half_widths": half_widths,
        "progress": not common.quiet,
    }
    if rotating:
        return disk.rotating_cycle(**speeds, stable=not unstable, **how)
    return disk.limit_cycle(**speeds, stable=False if unstable else None, **how)


@disk_command(
    "Compute a limit cycle by harmonic balance of the full equations, without an integrator."
)
@omega_option
@below_crit_option
@click.option(
    "--harmonics",
    type=int,
    metavar="N",
    help="Number of odd harmonics; chosen for the digits if not given.",
)
def harmonic_balance(
    common: DiskOptions, omega: str | None, below_crit: str | None, harmonics: int | None
) -> Any:
    speed = common.speed(omega, below_crit)
    return common.disk.harmonic_balance(speed, harmonics=harmonics, digits=common.digits)


@disk_command(
    "Compute the family of limit cycles from Omega_crit towards Omega_h, through any folds, or the "
    "rotating ones."
)
@click.option("--paper-sets", is_flag=True, help="Use the paper's sets A^in and A^de: 801 speeds.")
@click.option("--omegas", metavar="X,X,...", help="Use these speeds [rad/s], in this order.")
@rotating_option
@click.option(
    "--out",
    callback=output_file_callback(".csv"),
    metavar="FILE.csv",
    help="Write the family there as CSV.",
)
@half_widths_option
def branch(
    common: DiskOptions,
    paper_sets: bool,
    omegas: str | None,
    rotating: bool,
    out: Path | None,
    half_widths: bool,
) -> int:
    if common.digits > _BRANCH_DIGITS:
        raise InputError(
            f"a branch has at most 12 digits, not {common.digits}: use orbit for more "
            f"at single speeds"
        )
    if paper_sets and (omegas is not None or rotating):
        raise InputError(
            "--paper-sets has its own speeds, and no rotating cycles: leave out the other option"
        )
    disk, speeds, seen = (
        common.disk,
        None if omegas is None else omegas.split(","),
        not common.quiet,
    )
    cycles: Sequence[LimitCycle | RotatingCycle | MissingCycle]
    if rotating:
        cycles = disk.rotating_branch(speeds, half_widths=half_widths, progress=seen)
    else:
        cycles = disk.branch(
            speeds, paper_sets=paper_sets, half_widths=half_widths, progress=seen
        ).cycles
    if out is not None:
        write_csv(out, *_family_table(cycles))
    result: dict[str, Any] = {"orbits": [cycle.to_dict() for cycle in cycles]}
    if rotating:
        result["fold"] = disk.rotation_fold(digits=common.digits).to_dict()
    else:
        with suppress(InputError, AccuracyError):  # the family may be known at single speeds only
            result |= disk.folds(digits=common.digits).to_dict()
    common.show(result, _family_lines(result))
    return 0


def _family_table(
    rows: Sequence[LimitCycle | RotatingCycle | MissingCycle],
) -> tuple[list[str], list[list[object]]]:
    """Return the header and rows of a table of limit cycles: numbers with half-widths, stability
    and status.

    A speed without a cycle has empty cells, and the reason as its status.
    """
    (first, *_) = (row for row in rows if hasattr(row, "stable"))
    names = [name for name, value in vars(first).items() if isinstance(value, Measured)]
    header = [part for name in names for part in (name, f"{name}_uncertainty")]
    lines = []
    for row in rows:
        numbers = [getattr(row, name, None) for name in names]
        cells = [part for number in numbers for part in (number.decimals() if number else ("", ""))]
        lines.append([*cells, getattr(row, "stable", ""), getattr(row, "status", "ok")])
    return [*header, "stable", "status"], lines


def _family_lines(result: dict[str, Any]) -> list[str]:
    shown = ("omega", "period", "beta_max", "multiplier_slow")
    rows = (
        [f"{float(entries[name]['value']):.12g}" if name in entries else "none" for name in shown]
        for entries in result["orbits"]
    )
    reasons = (entries["status"] for entries in result["orbits"] if "status" in entries)
    return [
        *table([column_heading(name) for name in shown], rows),
        *dict.fromkeys(reasons),
        *result_lines({name: entry for name, entry in result.items() if name != "orbits"}),
    ]


@disk_command(
    "Find where each of many initial states ends: shares with sampling errors, and a picture."
)
@omega_option
@below_crit_option
@click.option(
    "--count",
    type=int,
    default=100_000,
    show_default=True,
    metavar="N",
    help="Number of initial states.",
)
@click.option(
    "--seconds",
    type=float,
    default=20.0,
    show_default=True,
    metavar="T",
    help="The duration of each motion [s].",
)
@click.option(
    "--velocity",
    type=float,
    default=0.0,
    show_default=True,
    metavar="V",
    help="The initial d(beta)/dt [rad/s].",
)
@click.option(
    "--margin",
    metavar="BETA,GAMMA,V",
    help="Compute only the distance of this start from the boundary, in beta [rad].",
)
@click.option("--out", metavar="DIR", help="Write a picture and a CSV file to this directory.")
@jobs_option
def basin(
    common: DiskOptions,
    omega: str | None,
    below_crit: str | None,
    count: int,
    seconds: float,
    velocity: float,
    margin: str | None,
    out: str | None,
    jobs: int | None,
) -> Any:
    disk, speed = common.disk, common.speed(omega, below_crit)
    if margin is not None:
        if len(start := margin.split(",")) != 3:
            raise InputError(f"a start is three numbers, beta,gamma,v, not '{margin[:60]}'")
        distance = disk.basin_boundary(speed).margin([DOUBLE.number(part) for part in start])
        return {"margin": distance.to_dict(), "keeps_standing": distance > 0}
    folder = lock_output_folder(out)
    with process_pool(jobs, needed=count >= 10_000) as pool:
        how = {"count": count, "duration": seconds, "v": velocity, "executor": pool}
        plane = disk.basins(speed, progress=not common.quiet, **how)
    if folder is not None:
        from tippedisk_verify.figures.basin_figure import draw_basins
        from tippedisk_verify.figures.style import save

        boundary = None
        with suppress(InputError, AccuracyError):  # no boundary below the rotating cycles' fold
            boundary = disk.basin_boundary(speed)
        save(draw_basins(plane, boundary), folder, "basins")
        write_csv(
            folder / "basins.csv",
            ("beta [rad]", "gamma [rad]", "v [rad/s]", "ends on"),
            plane.rows(),
        )
    return plane


COMMANDS = (integrate, equilibria, hopf, slow_manifold, orbit, harmonic_balance, branch, basin)
