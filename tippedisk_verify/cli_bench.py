"""The command `bench`: run time against error."""

from __future__ import annotations

import click

from tippedisk_verify.cli_common import Common, common_options, print_json, progress
from tippedisk_verify.errors import InputError

__all__ = ["COMMANDS"]


@click.command()
@common_options
def bench(common: Common) -> int:
    """Run time against error: the paper's limit cycles, all together, one by one, and by SciPy."""
    from tippedisk_verify.evidence.workprecision import race

    if common.friction == "smooth":
        raise InputError("limit cycles are offered for the linear friction law")
    with progress(common, 21) as advance:
        runs = race(common.parameters, advance)
    if common.json:
        print_json({"runs": [run.json() for run in runs]})
    elif not common.quiet:
        bare = runs[0].seconds
        for run in runs:
            error = "" if run.error is None else f"error of T {run.error:.1e} s"
            cost = f"{run.seconds * 1e3:9.4f} ms  {run.seconds / bare:9.2f} times"
            click.echo(f"{run.method:52s} {run.setting:28s} {cost}  {error}")
    return 0


COMMANDS = (bench,)
