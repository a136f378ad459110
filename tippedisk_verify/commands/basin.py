"""The command `basin`: what many initial states end on."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    common_options,
    print_result,
    processes,
    progress,
    quantities_of,
    speed,
    speed_options,
)
from tippedisk_verify.errors import InputError, Shortfall

if TYPE_CHECKING:
    from fractions import Fraction

    from tippedisk_verify.model.parameters import Parameters
    from tippedisk_verify.motion.basin_boundary import BasinBoundary

__all__ = ["COMMANDS"]


@quantities_of("margin")
@click.command()
@speed_options
@click.option("--count", type=int, default=100_000, show_default=True, metavar="N", help="Number of initial states.")
@click.option("--seconds", type=float, default=20.0, show_default=True, metavar="T", help="How long each runs [s].")
@click.option("--velocity", type=float, default=0.0, show_default=True, metavar="V", help="d(beta)/dt at the start.")
@click.option("--margin", metavar="BETA,GAMMA,V", help="Only how far this start is from the boundary, in beta [rad].")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@click.option("--out", metavar="DIR", help="Write picture and CSV there.")
@common_options
def basin(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    count: int,
    seconds: float,
    velocity: float,
    margin: str | None,
    jobs: int | None,
    out: str | None,
) -> int:
    """What each of many initial states ends on: picture, and fractions with their sampling error."""
    from tippedisk_verify.motion.basins import basins

    value = speed(common, omega, below_crit)
    if margin is not None:
        print_result(common, _margin(common, value, margin))
        return 0
    folder = alone_in(out)
    with processes(jobs, needed=count >= 10_000) as pool, progress(common, count) as advance:
        plane = basins(
            common.parameters, value, count=count, duration=seconds, v=velocity, executor=pool, advance=advance
        )
    if folder is not None:
        from tippedisk_verify.figures.basins import draw_basins
        from tippedisk_verify.figures.style import save
        from tippedisk_verify.report.tables import write_basins

        boundary = _boundary(common.parameters, value)
        save(draw_basins(plane, boundary), folder, "basins")
        write_basins(plane, folder)
    shares = plane.fractions().items()
    lines = (f"{name:20s} {100 * share:8.3f} % +- {100 * error:.3f} %" for name, (share, error) in shares)
    print_result(common, plane.to_dict(), lines)
    return 0


def _margin(common: Common, omega: Fraction, start: str) -> dict[str, object]:
    """How far a start is from the boundary of the basins, as JSON."""
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.model.precision import DOUBLE
    from tippedisk_verify.motion.basin_boundary import BasinBoundary

    state = [DOUBLE.number(part) for part in start.split(",")]
    if len(state) != 3:
        raise InputError(f"a start is three numbers, beta,gamma,v, not '{start[:60]}'")
    margin = BasinBoundary(common.parameters, omega, default_engine()).margin(state)
    return {"margin": margin.to_dict(), "keeps_standing": margin > 0}


def _boundary(parameters: Parameters, omega: Fraction) -> BasinBoundary | None:
    """What separates the basins, if there is anything: below the rotating cycles' fold everything lies flat."""
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.motion.basin_boundary import BasinBoundary

    with suppress(InputError, Shortfall):
        return BasinBoundary(parameters, omega, default_engine())
    return None


COMMANDS = (basin,)
