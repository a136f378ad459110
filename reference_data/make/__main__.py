"""``python reference_data/make [PREFIX]...``: make the entries whose ids start so, all if nothing is said."""

from __future__ import annotations

import sys
from pathlib import Path

import click

FOLDER = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(FOLDER.parent))  # for the processes that compute, too

from tippedisk_verify.commands.common import Output, command, processes  # noqa: E402
from tippedisk_verify.interrupts import answering  # noqa: E402


@command
@click.argument("prefixes", nargs=-1, metavar="[PREFIX]...")
def make(output: Output, prefixes: tuple[str, ...], out: str = str(FOLDER), jobs: int | None = None) -> int:
    """Make the reference values whose ids start with a PREFIX, such as printed/linear/hopf; all takes some CPU hours.

    What an interrupted run has computed is taken up again.

    --out DIR  Where the files go.
    """
    from reference_data.make.generation import generate

    with output.progress() as advance, processes(jobs) as pool:
        count = generate(out, prefixes, pool, advance)
    output.show({"made": count}, [f"{count} entries made"])
    return 0


if __name__ == "__main__":
    with answering():
        from tippedisk_verify.cli import cli, entry

        cli.add_command(make)
        sys.argv.insert(1, "make")
        entry()
