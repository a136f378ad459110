"""The commands `orbit`, `harmonic-balance` and `branch`: limit cycles one by one and as a family."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.definition import DiskOptions, disk_command
from tippedisk_verify.commands.options import (
    below_crit_option,
    decimal_callback,
    half_widths_option,
    omega_option,
    output_file_callback,
    rotating_option,
    unstable_option,
)
from tippedisk_verify.commands.tables import table
from tippedisk_verify.display import column_heading, result_lines
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import require_one_speed
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.support.files import write_csv

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tippedisk_verify.cycles.limit_cycle import LimitCycle, MissingCycle, RotatingCycle

__all__ = ["COMMANDS"]

_BRANCH_DIGITS = 12  # of the cycles of a family


@disk_command("Compute one limit cycle by shooting: period, state, multipliers, sensitivities.")
@omega_option
@below_crit_option
@click.option(
    "--above-het",
    callback=decimal_callback,
    metavar="D",
    help="The speed Omega_h + D [rad/s], with D as small as 1e-100.",
)
@click.option(
    "--below-het",
    callback=decimal_callback,
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


COMMANDS = (orbit, harmonic_balance, branch)
