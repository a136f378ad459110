"""The commands `reference generate|prove|check|list|show`."""

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
    """Reference values: make them, check them, read them."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@reference.command()
@click.option("--out", default="reference_data", show_default=True, metavar="DIR", help="Where the files go.")
@click.option("--only", multiple=True, metavar="KIND", help="These kinds only.")
@click.option("--set", "sets", multiple=True, metavar="NAME", help="These parameter sets only.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@plain_options
def generate(common: Common, out: str, only: tuple[str, ...], sets: tuple[str, ...], jobs: int | None) -> int:
    """Make the reference files; what an interrupted run has computed is taken up again."""
    from tippedisk_verify.reference_values.generation import generate as made
    from tippedisk_verify.reference_values.manifest import SETS

    if not out:
        raise InputError("--out needs the name of a folder")
    with progress(common, 0) as advance, processes(jobs) as pool:
        written = made(Path(out), only=only, sets=sets or SETS, executor=pool, advance=advance)
    print_result(common, {"written": [str(path) for path in written]}, written)
    return 0


@reference.command()
@click.argument("prefixes", nargs=-1, metavar="[PREFIX]...")
@click.option("--data", default="reference_data", show_default=True, metavar="DIR", help="The folder to work on.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@plain_options
def prove(common: Common, prefixes: tuple[str, ...], data: str, jobs: int | None) -> int:
    """Prove values by ball arithmetic (those whose id starts with PREFIX), and write enclosures and statements."""
    from tippedisk_verify.reference_values.proofs import prove as proved

    if not data or not Path(data).is_dir():
        raise InputError(f"--data needs a folder with reference files, not '{data[:100]}'")
    with progress(common, 0) as advance, processes(jobs) as pool:
        count = proved(Path(data), prefixes=prefixes, executor=pool, advance=advance)
    print_result(common, {"proved": count}, [f"{count} entries proved"])
    return 0


@reference.command()
@click.option("--data", metavar="DIR", help="The folder to check; the installed data if not given.")
@click.option("--all", "everything", is_flag=True, help="Compute every number again (some CPU hours).")
@click.option("--sample", type=int, default=20, show_default=True, metavar="N", help="Compute so many entries again.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="N", help="Which ones.")
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@plain_options
def check(common: Common, data: str | None, everything: bool, sample: int, seed: int, jobs: int | None) -> int:
    """Hold the files against their hashes and schema, and numbers against their other roads."""
    from tippedisk_verify.reference_values.checking import check as checked
    from tippedisk_verify.reference_values.store import data_folder

    folder = data_folder() if data is None else Path(data)
    with progress(common, 0) as advance, processes(jobs, needed=bool(sample) or everything) as pool:
        report = checked(folder, sample=None if everything else sample, seed=seed, executor=pool, advance=advance)
    total = (
        f"{report.files} files, {report.numbers} numbers, {report.recomputed} computed again by another road: "
        f"{len(report.faults) or 'no'} fault{'s' * (len(report.faults) != 1)}"
    )
    print_result(common, report.to_dict(), [*report.faults, total])
    return 1 if report.faults else 0


@reference.command("list")
@click.argument("prefix", default="")
@plain_options
def listed(common: Common, prefix: str) -> int:
    """The ids that start with PREFIX, such as printed/linear/limit-cycle, after a line with the data's version."""
    from tippedisk_verify.reference_values.manifest import DATA_VERSION
    from tippedisk_verify.reference_values.store import stored

    ids = [quantity.id for quantity in stored().matching(prefix)]
    if not ids:
        raise InputError(f"no reference value starts with '{prefix[:100]}': try printed/ or calibrated/")
    print_result(common, {"data_version": DATA_VERSION, "ids": ids}, [f"# reference data {DATA_VERSION}", *ids])
    return 0


@reference.command()
@click.argument("ids", nargs=-1, required=True, metavar="ID...")
@plain_options
def show(common: Common, ids: tuple[str, ...]) -> int:
    """Values with all that is known of them.

    The condition says by how much a value changes, in its own unit, per relative change of
    each parameter or input.
    """
    from tippedisk_verify.reference_values.definitions import definition
    from tippedisk_verify.reference_values.lookup import reference as value_of

    quantities = [value_of(id_) for id_ in ids]
    lines = (line for quantity in quantities for line in _lines(quantity))
    told = [{**quantity.to_dict(), "definition": definition(quantity.kind, quantity.name)} for quantity in quantities]
    print_result(common, {"values": told}, lines)
    return 0


def _lines(quantity: Quantity) -> Iterator[str]:
    from tippedisk_verify.model.results import heading
    from tippedisk_verify.reference_values.definitions import definition

    yield f"{quantity.id} [{quantity.unit}]"
    yield f"  is            {definition(quantity.kind, quantity.name)}"
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
