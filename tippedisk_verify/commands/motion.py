"""The commands `integrate`, one motion, and `basin`, where many motions end."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.definition import DiskOptions, disk_command
from tippedisk_verify.commands.jobs import jobs_option, process_pool
from tippedisk_verify.commands.options import (
    below_crit_option,
    half_widths_option,
    lock_output_folder,
    omega_option,
    output_file_callback,
)
from tippedisk_verify.commands.tables import MOTION_COLUMNS, motion_rows, with_width_columns
from tippedisk_verify.display import result_lines
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.support.files import read_text, write_bytes, write_csv, write_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tippedisk_verify.motion.solution import Solution

__all__ = ["basin", "integrate"]

_MAX_TIMES = 1_000_000  # of one motion
_MAX_FILE = 2**25  # bytes of a file of times


# --------------------------------------------------------------------------------------- integrate
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


# ------------------------------------------------------------------------------------------- basin
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
