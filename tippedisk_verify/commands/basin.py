"""The command `basin`: what many initial states end on."""

from __future__ import annotations

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    common_options,
    print_result,
    processes,
    progress,
    speed,
    speed_options,
)

__all__ = ["COMMANDS"]


@click.command()
@speed_options
@click.option("--count", type=int, default=100_000, show_default=True, metavar="N", help="Number of initial states.")
@click.option("--seconds", type=float, default=20.0, show_default=True, metavar="T", help="How long each runs [s].")
@click.option("--velocity", type=float, default=0.0, show_default=True, metavar="V", help="d(beta)/dt at the start.")
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
    jobs: int | None,
    out: str | None,
) -> int:
    """What each of many initial states ends on: picture, and fractions with their sampling error."""
    from tippedisk_verify.orbits.basins import basins

    value = speed(common, omega, below_crit)
    folder = alone_in(out)
    with progress(common, count) as advance, processes(jobs, needed=count >= 10_000) as pool:
        plane = basins(
            common.parameters, value, count=count, duration=seconds, v=velocity, advance=advance, executor=pool
        )
    if folder is not None:
        from tippedisk_verify.figures.basins import draw_basins
        from tippedisk_verify.figures.style import save
        from tippedisk_verify.report.tables import write_basins

        save(draw_basins(plane), folder, "basins")
        write_basins(plane, folder)
    shares = plane.fractions().items()
    lines = (f"{name:20s} {100 * share:8.3f} % +- {100 * error:.3f} %" for name, (share, error) in shares)
    print_result(common, plane.json(), lines)
    return 0


COMMANDS = (basin,)
