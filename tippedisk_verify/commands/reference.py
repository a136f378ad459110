"""The commands `reference check|list|show|export`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.definition import OutputOptions, command, group
from tippedisk_verify.commands.jobs import jobs_option, process_pool
from tippedisk_verify.display import column_heading

if TYPE_CHECKING:
    from tippedisk_verify.reference_values.store import ReferenceValue

__all__ = ["COMMANDS"]


@command(
    """Compare the files with their hashes, and a sample of their numbers with new ones.

    The new numbers are computed in another formulation or another precision.
    """
)
@click.option("--data", metavar="DIR", help="The folder to check; the installed data if not given.")
@click.option("--all", "all_", is_flag=True, help="Compute every number again (takes an hour).")
@click.option(
    "--sample",
    type=int,
    default=20,
    show_default=True,
    metavar="N",
    help="The number of entries to compute again.",
)
@click.option("--seed", type=int, default=0, metavar="N", help="The seed that chooses the sample.")
@jobs_option
def check(
    output: OutputOptions, data: str | None, all_: bool, sample: int, seed: int, jobs: int | None
) -> int:
    from tippedisk_verify.reference_values import checking
    from tippedisk_verify.reference_values.manifest import data_folder

    folder = data_folder() if data is None else Path(data)
    with output.progress() as advance, process_pool(jobs, needed=bool(sample) or all_) as pool:
        report = checking.check(
            folder, sample=None if all_ else sample, seed=seed, executor=pool, advance=advance
        )
    total = (
        f"{report.files} files, {report.numbers} numbers, {report.recomputed} computed again: "
        f"{len(report.faults) or 'no'} {'fault' if len(report.faults) == 1 else 'faults'}"
    )
    output.show(report.to_dict(), [*report.faults, total])
    return 1 if report.faults else 0


@command(
    "List the ids that start with PREFIX, such as table1/linear/limit-cycle, after a line with the "
    "data's version."
)
@click.argument("prefix", default="")
def list_(output: OutputOptions, prefix: str) -> int:
    from tippedisk_verify.reference_values.lookup import references
    from tippedisk_verify.reference_values.manifest import data_folder, read_manifest

    ids = [value.id for value in references(prefix)]
    version = read_manifest(data_folder())[0]["data_version"]
    output.show({"data_version": version, "ids": ids}, [f"# reference data {version}", *ids])
    return 0


@command(
    """Show values with their definition, half-width, grade, proof and condition.

    The condition is the change of a value, in its own unit, per relative change of each parameter
    or input.
    """
)
@click.argument("ids", nargs=-1, required=True, metavar="ID...")
def show(output: OutputOptions, ids: tuple[str, ...]) -> int:
    from tippedisk_verify.reference_values import lookup

    values = [lookup.reference(id_) for id_ in ids]
    lines = (line for value in values for line in _lines(value))
    output.show({"values": [value.to_dict() for value in values]}, lines)
    return 0


@command("Write the values whose ids start with PREFIX to a file in another format.")
@click.argument("prefix", default="")
@click.option(
    "--format",
    "format_",
    default="csv",
    show_default=True,
    metavar="csv|jsonl|parquet|c|fortran|julia|octave",
    help="The format: a table, one JSON object a line, or a test file to include.",
)
@click.option("--out", required=True, metavar="FILE", help="The file to write.")
def export(output: OutputOptions, prefix: str, format_: str, out: str) -> int:
    from tippedisk_verify.reference_values import lookup
    from tippedisk_verify.reference_values.export import write_values

    file = write_values(lookup.references(prefix), format_, out)
    output.show({"written": [str(file)]}, [file])
    return 0


def _lines(reference_value: ReferenceValue) -> Iterator[str]:
    yield f"{reference_value.id} [{reference_value.unit}]"
    yield f"  is            {reference_value.definition}"
    for reading, (value, uncertainty) in reference_value.values.items():
        yield f"  from {reading:8s} {value} ± {uncertainty}"
    inputs = ", ".join(
        f"{column_heading(name)} {text}" for name, text in reference_value.inputs.items()
    )
    yield f"  inputs        {inputs or 'the parameters only'}"
    distances = ", ".join(
        f"{name} within {away}" for name, away in reference_value.methods.items() if away != "0"
    )
    grade = f"{reference_value.grade}: {', '.join(reference_value.methods)}"
    yield f"  grade         {grade}" + (f" ({distances})" if distances else "")
    if reference_value.proof is not None:
        yield f"  proved in     {reference_value.proof['value']} ± {reference_value.proof['uncertainty']}"
        yield f"  by            {reference_value.proof['command']}"
    slopes = ", ".join(f"{name} {slope}" for name, slope in reference_value.condition.items())
    yield f"  condition     {slopes or 'depends on nothing'}"


_HELP = "Check, show and export reference values."
COMMANDS = (group("reference", _HELP, check, list_, show, export),)
