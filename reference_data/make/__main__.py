"""The command ``python reference_data/make [PREFIX]...``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

FOLDER = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(FOLDER.parent))  # the processes that compute inherit it

from tippedisk_verify.commands.definition import OutputOptions, command  # noqa: E402
from tippedisk_verify.commands.jobs import jobs_option, process_pool  # noqa: E402
from tippedisk_verify.support.interrupts import handle_ctrl_c  # noqa: E402


@command(
    """Make the reference values whose ids start with a PREFIX, such as table1/linear/hopf.

    Without a PREFIX all values are made, which takes some CPU hours. The results of an interrupted
    run are reused.
    """
)
@click.argument("prefixes", nargs=-1, metavar="[PREFIX]...")
@click.option(
    "--out", default=str(FOLDER), show_default=True, metavar="DIR", help="The folder to write."
)
@jobs_option
def make(output: OutputOptions, prefixes: tuple[str, ...], out: str, jobs: int | None) -> int:
    from reference_data.make.generation import generate

    with output.progress() as advance, process_pool(jobs) as pool:
        count = generate(out, prefixes, pool, advance)
    output.show({"made": count}, [f"{count} entries made"])
    return 0


if __name__ == "__main__":
    with handle_ctrl_c():
        from tippedisk_verify.cli import cli, entry

        cli.add_command(make)
        sys.argv.insert(1, "make")
        entry()
