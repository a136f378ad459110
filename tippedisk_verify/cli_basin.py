"""The command `basin`: what many initial states end on."""

from __future__ import annotations

import click

from tippedisk_verify.cli_common import Common, common_options, print_json, progress, speed, speed_options
from tippedisk_verify.errors import InputError

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
    import os
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from tippedisk_verify.files import output_folder
    from tippedisk_verify.orbits.basins import basins

    if jobs is not None and not 1 <= jobs <= 4096:
        raise InputError(f"--jobs must lie between 1 and 4096, not {jobs}")
    value = speed(common, omega, below_crit)
    folder = None if out is None else output_folder(out)
    options = {"friction": common.friction, "count": count, "duration": seconds, "v": velocity}
    with progress(common, count) as advance:
        workers = jobs or os.cpu_count() or 1
        if workers == 1 or count < 10_000:
            found = basins(common.parameters, value, advance=advance, **options)
        else:
            # Fresh processes: what the parent has compiled and its threads are not for forking.
            pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
            try:
                found = basins(common.parameters, value, advance=advance, executor=pool, **options)
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
    if folder is not None:
        from tippedisk_verify.plots import draw_basins, save
        from tippedisk_verify.report import write_basins

        save(draw_basins(found), folder, "basins")
        write_basins(found, folder)
    if common.json:
        print_json(found.json())
    elif not common.quiet:
        for name, (share, error) in found.fractions().items():
            click.echo(f"{name:20s} {100 * share:8.3f} % +- {100 * error:.3f} %")
    return 0


COMMANDS = (basin,)
