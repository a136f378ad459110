"""The command `heteroclinic`: Omega_h, the connecting orbit, and the study next to Omega_h."""

from __future__ import annotations

import csv
import math
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.definition import DiskOptions, disk_command
from tippedisk_verify.commands.options import half_widths_option, output_file_callback
from tippedisk_verify.commands.tables import motion_rows, table, with_width_columns
from tippedisk_verify.display import numbers_as_json
from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import Exact, exact
from tippedisk_verify.support.files import read_text, write_bytes, write_table

if TYPE_CHECKING:
    from tippedisk_verify.omega_h.distance_study import NearHeteroclinic

__all__ = ["COMMANDS"]

_MAX_DISTANCES = 1000
_MAX_FILE = 2**20  # bytes of a file of answers; each takes seconds


@disk_command("Compute Omega_h, where the saddles are connected, by one of several methods.")
@click.option(
    "--method",
    default="manifolds",
    show_default=True,
    metavar="NAME",
    help="manifolds, limit-cycles, bisection or scipy.",
)
@click.option(
    "--near",
    metavar="FIRST:LAST:COUNT",
    help="Study the cycles at these distances above Omega_h [rad/s] instead, evenly spaced in the "
    "logarithm.",
)
@click.option(
    "--answers",
    metavar="FILE.csv",
    help="With --near: periods found elsewhere, in columns omega and period.",
)
@click.option(
    "--out",
    callback=output_file_callback(".csv", ".png"),
    metavar="FILE.csv|.png",
    help="Write samples of the connecting orbit there; with --near the table, or its figure.",
)
@half_widths_option
def heteroclinic(
    common: DiskOptions,
    method: str,
    near: str | None,
    answers: str | None,
    out: Path | None,
    half_widths: bool,
) -> Any:
    if near is not None:
        return _near_heteroclinic(common, near, answers, out)
    if answers is not None or (out is not None and out.suffix.lower() == ".png"):
        raise InputError("--answers and a figure go with --near FIRST:LAST:COUNT")
    connection = common.disk.heteroclinic(
        digits=common.digits, method=method, half_widths=half_widths, progress=not common.quiet
    )
    if out is not None:
        times, states, widths = connection.samples()
        exact_times = [exact_text(Fraction(time)) for time in times]
        write_table(
            out, with_width_columns(motion_rows(exact_times, *numbers_as_json(states, widths)))
        )
    return connection


def _near_heteroclinic(
    common: DiskOptions, near: str, answers: str | None, out: Path | None
) -> int:
    """Study the limit cycles next to Omega_h, print a row for each distance and answer, and write
    the table or the figure.
    """
    pairs = None if answers is None else _answers(Path(answers))
    study = common.disk.near_heteroclinic(_distances(near), answers=pairs)
    result = study.to_dict()
    if out is not None and out.suffix.lower() == ".png":
        from tippedisk_verify.figures.style import encode_figure

        write_bytes(out, encode_figure(study.plot(), "png"))
    elif out is not None:
        from tippedisk_verify.omega_h.distance_study import PERIOD_LAW_COLUMNS

        rows = [
            {**row, **dict(zip(PERIOD_LAW_COLUMNS, row["law"], strict=True))}
            for row in result["rows"]
        ]
        write_table(
            out,
            with_width_columns([{key: row[key] for key in row if key != "law"} for row in rows]),
        )
    common.show(result, _near_lines(study))
    return 0


def _near_lines(study: NearHeteroclinic) -> list[str]:
    law = study.period_law
    signs = {True: "+", False: "-"}
    rows = (
        [
            f"{float(row.distance):.3g}",
            f"{row.period:.13g}",
            *(f"{float(term - row.period):.1e}" for term in row.law),
            f"{float(row.multiplier_slow):.6g}",
            f"{row.double_resolves:.1e}",
        ]
        for row in study.rows
    )
    answers = [
        [
            exact_text(row.omega.value),
            f"{float(row.period_found):.15g}",
            f"{row.period:.13g}",
            f"{float(row.error):.1e}",
        ]
        for row in study.answers
    ]
    return [
        f"T = {float(law.slope):.9g} ln D {signs[law.constant > 0]} "
        f"{abs(float(law.constant)):.9g} {signs[law.coefficient > 0]} "
        f"{abs(float(law.coefficient)):.6g} "
        f"D^{float(law.exponent):.6g} + ..., D above Omega_h in rad/s, T in s",
        *table(
            ("D [rad/s]", "T [s]", "1 term", "2 terms", "3 terms", "multiplier", "a double"), rows
        ),
        "terms: the error of the law with so many terms [s]; a double: the change of T by half an ulp of Omega [s]",
        *(table(("Omega [rad/s]", "answer [s]", "T [s]", "error [s]"), answers) if answers else ()),
    ]


def _distances(text: str) -> list[str]:
    """Return the distances that the text FIRST:LAST:COUNT means, as decimals of three digits.

    They are evenly spaced in the logarithm. Raises InputError for another text.
    """
    try:
        first, last, count = text.split(":")
        ends, number = [math.log10(float(exact(end))) for end in (first, last)], int(count)
        if not 1 <= number <= _MAX_DISTANCES:
            raise ValueError
    except (ValueError, ArithmeticError):
        raise InputError(
            f"--near is FIRST:LAST:COUNT, such as 1e-2:1e-20:10, with distances above 0 and COUNT "
            f"up to {_MAX_DISTANCES}, not '{text[:60]}'"
        ) from None
    steps = [n / max(1, number - 1) for n in range(number)]
    exponents = [ends[0] + (ends[1] - ends[0]) * step for step in steps]
    return [f"{10 ** (x - math.floor(x)):.2f}e{math.floor(x)}" for x in exponents]


def _answers(file: Path) -> list[tuple[Exact, Exact]]:
    """Return the pairs (omega, period) of a CSV file with these columns.

    Raises InputError if the file lacks one of them, or has something else than numbers there.
    """
    rows = csv.DictReader(read_text(file, _MAX_FILE).splitlines())
    if not {"omega", "period"} <= set(rows.fieldnames or ()):
        raise InputError("--answers needs a CSV file with the columns omega and period")
    pairs = []
    for row in rows:
        try:
            pairs.append((exact(row["omega"] or ""), exact(row["period"] or "")))
        except InputError as fault:
            raise InputError(f"{file.name}, line {rows.line_num}: {fault}") from None
    return pairs


COMMANDS = (heteroclinic,)
