"""The commands `reference check|list|show|export`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.common import Common, plain_options, print_result, processes, progress
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.reference_values.store import Quantity

__all__ = ["COMMANDS"]


@click.group(invoke_without_command=True)
@click.pass_context
def reference(context: click.Context) -> None:
    """Reference values: check them, read them, export them."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def _moved(name: str) -> None:
    """What was a command once says where it is now."""

    @reference.command(name, hidden=True, add_help_option=False, context_settings={"ignore_unknown_options": True})
    @click.argument("rest", nargs=-1, type=click.UNPROCESSED)
    def moved(rest: tuple[str, ...]) -> None:
        raise InputError(f"reference {name} is now 'python reference_data/make', in a checkout of the source")


_moved("generate")
_moved("prove")


@reference.command()
@click.option("--data", metavar="DIR", help="The folder to check; the installed data if not given.")
@click.option("--all", "everything", is_flag=True, help="Compute every number again (an hour).")
@click.option("--sample", type=int, default=20, show_default=True, metavar="N", help="Compute so many entries again.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="N", help="Which ones.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@plain_options
def check(common: Common, data: str | None, everything: bool, sample: int, seed: int, jobs: int | None) -> int:
    """Hold the files against their hashes, and a sample of their numbers against new ones.

    The new ones are computed in another formulation or another precision.
    """
    from tippedisk_verify.reference_values.checking import check as checked
    from tippedisk_verify.reference_values.manifest import data_folder

    folder = data_folder() if data is None else Path(data)
    with progress(common, 0) as advance, processes(jobs, needed=bool(sample) or everything) as pool:
        report = checked(folder, sample=None if everything else sample, seed=seed, executor=pool, advance=advance)
    total = (
        f"{report.files} files, {report.numbers} numbers, {report.recomputed} computed again: "
        f"{len(report.faults) or 'no'} fault{'s' * (len(report.faults) != 1)}"
    )
    print_result(common, report.to_dict(), [*report.faults, total])
    return 1 if report.faults else 0


@reference.command("list")
@click.argument("prefix", default="")
@plain_options
def listed(common: Common, prefix: str) -> int:
    """The ids that start with PREFIX, such as printed/linear/limit-cycle, after a line with the data's version."""
    from tippedisk_verify.reference_values.lookup import references
    from tippedisk_verify.reference_values.manifest import data_folder, read_manifest

    ids = [quantity.id for quantity in references(prefix)]
    version = read_manifest(data_folder())[0]["data_version"]
    print_result(common, {"data_version": version, "ids": ids}, [f"# reference data {version}", *ids])
    return 0


@reference.command()
@click.argument("ids", nargs=-1, required=True, metavar="ID...")
@plain_options
def show(common: Common, ids: tuple[str, ...]) -> int:
    """Values with all that is known of them.

    The condition says by how much a value changes, in its own unit, per relative change of
    each parameter or input.
    """
    from tippedisk_verify.reference_values.lookup import reference as value_of

    quantities = [value_of(id_) for id_ in ids]
    lines = (line for quantity in quantities for line in _lines(quantity))
    print_result(common, {"values": [quantity.to_dict() for quantity in quantities]}, lines)
    return 0


@reference.command()
@click.argument("prefix", default="")
@click.option("--format", "form", default="csv", show_default=True, metavar="csv|jsonl|parquet|c|fortran|julia",
              help="A table, one JSON object to a line, or a test file to include.")  # fmt: skip
@click.option("--out", required=True, metavar="FILE", help="Where the values go.")
@plain_options
def export(common: Common, prefix: str, form: str, out: str) -> int:
    """Write the values whose ids start with PREFIX in another form."""
    from tippedisk_verify.reference_values.export import export as exported
    from tippedisk_verify.reference_values.lookup import references

    file = exported(references(prefix), form, out)
    print_result(common, {"written": [str(file)]}, [file])
    return 0


def _lines(quantity: Quantity) -> Iterator[str]:
    from tippedisk_verify.model.results import heading

    yield f"{quantity.id} [{quantity.unit}]"
    yield f"  is            {quantity.definition}"
    for reading, (value, uncertainty) in quantity.values.items():
        yield f"  from {reading:8s} {value} ± {uncertainty}"
    inputs = ", ".join(f"{heading(name)} {text}" for name, text in quantity.inputs.items())
    yield f"  inputs        {inputs or 'the parameters only'}"
    others = ", ".join(f"{name} within {away}" for name, away in quantity.methods.items() if away != "0")
    yield f"  grade         {quantity.grade}: {', '.join(quantity.methods)}" + (f" ({others})" if others else "")
    if quantity.proof is not None:
        yield f"  proved in     {quantity.proof['value']} ± {quantity.proof['uncertainty']}"
        yield f"  by            {quantity.proof['command']}"
    slopes = ", ".join(f"{name} {slope}" for name, slope in quantity.condition.items())
    yield f"  condition     {slopes or 'depends on nothing'}"


COMMANDS = (reference,)
