"""The command `integrate`: one motion."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, common_options, print_result, quantities_of, speed, speed_options
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.results import result_lines

if TYPE_CHECKING:
    from tippedisk_verify.motion.solution import Solution

__all__ = ["COMMANDS"]

_MOST_TIMES = 1_000_000
_LARGEST_FILE = 2**25  # bytes


@quantities_of("beta", "gamma", "v")
@click.command()
@speed_options
@click.option("--state", required=True, metavar="BETA,GAMMA,V", help="The start, such as pi/2,pi/2+0.4,0.")
@click.option("--time", "span", required=True, metavar="T|T0,T1", help="How long, or from when to when [s].")
@click.option("--times", metavar="N|FILE", help="So many even times, or the first column of a file.")
@click.option(
    "--events",
    metavar="NAME,...",
    help="Crossings to report: section (beta = pi/2), turn (v = 0), surface (the sliding velocity is zero).",
)
@click.option("--out", metavar="FILE.csv|.parquet|.png", help="Write the motion there, or draw it.")
@common_options
def integrate(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    state: str,
    span: str,
    times: str | None,
    events: str | None,
    out: str | None,
) -> int:
    """One motion, with half-widths of states and events; 201 even times if none are given."""
    from tippedisk_verify.files import table_file
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.motion.solution import integrated

    value, ends = speed(common, omega, below_crit), span.split(",")
    target = None if out is None else table_file(out, ".png")
    solution = integrated(
        common.parameters,
        value,
        state.split(","),
        ends if len(ends) > 1 else span,
        t_eval=None if times is None else _times(times, ends),
        digits=common.digits,
        events=() if events is None else events.split(","),
        engine=default_engine(),
    )
    entries = solution.to_dict()
    rows = [
        {"t": time} | {name: entries[name][n] for name in ("beta", "gamma", "v")} for n, time in enumerate(entries["t"])
    ]
    if target is not None:
        _write(solution, rows, target)
    told = {name: entries[name] for name in ("message", "end", "events")} | ({"samples": rows} if times else {})
    print_result(common, entries, result_lines(told))
    return 0


def _times(text: str, ends: list[str]) -> list[Any]:
    """Even ones over the run, or those in the first column of a file, below ``t`` if that stands there."""
    from tippedisk_verify.files import read_text
    from tippedisk_verify.model.exact import exact

    if not text.isdecimal():
        lines = read_text(Path(text), _LARGEST_FILE).splitlines()
        column = [line.split(",")[0].strip() for line in lines if line.strip()]
        return column[1:] if column[:1] == ["t"] else column
    if not 2 <= (count := int(text[:20])) <= _MOST_TIMES:
        raise InputError(f"--times is a number from 2 to {_MOST_TIMES}, or a file, not '{text[:40]}'")
    first, last = exact(ends[0] if len(ends) > 1 else 0), exact(ends[-1])
    return [float(first + (last - first) * Fraction(n, count - 1)) for n in range(count)]


def _write(solution: Solution, rows: list[dict[str, Any]], target: Path) -> None:
    """The picture or the table, as the file's name says."""
    from tippedisk_verify.files import write_bytes, write_table

    if target.suffix.lower() == ".png":
        from tippedisk_verify.figures.motion import draw_motion
        from tippedisk_verify.figures.style import encoded

        write_bytes(target, encoded(draw_motion(solution), "png"))
        return
    table = []
    for row in rows:
        states = {name: entry for name, entry in row.items() if name != "t"}
        widths = {f"{name}_uncertainty": entry["uncertainty"] for name, entry in states.items()}
        table.append({"t": row["t"]} | {name: entry["value"] for name, entry in states.items()} | widths)
    write_table(target, table)


COMMANDS = (integrate,)
