"""The command `sweep`: an analysis over many points."""

from __future__ import annotations

import click

from tippedisk_verify.commands.common import (
    Common,
    checked_jobs,
    common_options,
    executor_option,
    print_result,
    progress,
    workers_of,
)

__all__ = ["COMMANDS"]


@click.command()
@click.argument("analysis", metavar="orbit|equilibria|hopf|heteroclinic|trajectory")
@click.option(
    "--over",
    multiple=True,
    required=True,
    metavar="NAME=FIRST:LAST:COUNT|NAME=X,X,...",
    help="An axis: omega, below-crit, a parameter, or beta, gamma, v, duration of a trajectory.",
)
@click.option("--out", required=True, metavar="FILE.csv|FILE.parquet", help="Where the table goes.")
@executor_option
@click.option("--jobs", type=int, metavar="N", help="Processes of `local`; as many as there are cores if not given.")
@common_options
def sweep(common: Common, analysis: str, over: tuple[str, ...], out: str, executor: str, jobs: int | None) -> int:
    """An analysis at every combination of the axes' values; interrupted, it goes on where it stopped.

    The table has the axes as they were given, the status, and each result beside its half-width (NAME_uncertainty); a
    trajectory ends at final_beta, final_gamma, final_v. Every worker of a cluster needs this version of the package.
    """
    from tippedisk_verify.files import table_file
    from tippedisk_verify.sweep.plan import Plan, axis
    from tippedisk_verify.sweep.running import swept

    plan = Plan(analysis, common.parameters, tuple(axis(text) for text in over), common.digits)
    target = table_file(out)
    checked_jobs(jobs)
    with progress(common, len(plan)) as advance:
        points, without = swept(plan, target, lambda: workers_of(executor, jobs), advance)
    line = f"{points} points, {without} of them without numbers (their status says why): {target}"
    print_result(common, {"points": points, "without_numbers": without, "file": str(target)}, [line])
    return 0


COMMANDS = (sweep,)
