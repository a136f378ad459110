"""The commands `conformance questions|grade|run|compare`, and those that print programs for other languages."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, plain_options, print_result, progress
from tippedisk_verify.commands.conformance_run import run
from tippedisk_verify.commands.conformance_sources import client, grader, guide
from tippedisk_verify.commands.grading import (
    Wanted,
    blank_ones,
    checked_reading,
    from_option,
    grading_options,
    levels_named,
    question_options,
)
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.conformance.sheet import Answers
    from tippedisk_verify.reference_values.store import Store

__all__ = ["COMMANDS"]

_SHOWN = 40  # changes on a terminal


@click.group(invoke_without_command=True)
@click.pass_context
def conformance(context: click.Context) -> None:
    """Ask another implementation, and grade its answers in digits."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@conformance.command()
@click.argument("file", metavar="[FILE.csv|FILE.json]", required=False)
@question_options
@plain_options
def questions(
    common: Common,
    file: str | None,
    sets: tuple[str, ...],
    laws: tuple[str, ...],
    levels: str | None,
    states: int | None,
    seed: int | None,
) -> int:
    """Write an answer sheet, to FILE or to standard output: inputs only, easiest first.

    With --states the questions are drawn, on every machine the same ones from the same seed. Their ids hold the seed,
    and `grade` computes the truths anew, with half-widths that hold them.
    """
    from tippedisk_verify.conformance.sheet import questions as asked
    from tippedisk_verify.conformance.sheet import sheet_csv, sheet_json
    from tippedisk_verify.files import output_file, write_text
    from tippedisk_verify.reference_values.store import stored

    target = None if file is None else output_file(file)
    if target is not None and target.suffix.lower() not in (".csv", ".json"):
        raise InputError(f"'{str(file)[:60]}' must end in .csv or .json: that decides the form of the sheet")
    store = stored()
    if target is not None:
        _refuse_filled_in(target, store)
    store = blank_ones(states, seed, sets) or store
    chosen = asked(store, sets=sets, frictions=laws, levels=levels_named(levels))
    if target is None:
        print_result(common, json.loads(sheet_json(store, chosen)), sheet_csv(store, chosen).splitlines())
        return 0
    write_text(target, (sheet_json if target.suffix.lower() == ".json" else sheet_csv)(store, chosen))
    line = f"{len(chosen)} questions: fill in the column answer in {target}, then grade it"
    print_result(common, {"questions": len(chosen), "file": str(target)}, [line])
    return 0


def _refuse_filled_in(target: Path, store: Store) -> None:
    """What somebody has filled in is not written over, nor what cannot be read: it may be answers with a mistake."""
    from tippedisk_verify.conformance.sheet import read_answers

    if not target.exists() or not target.stat().st_size:
        return
    try:
        answers = read_answers(target, store)
    except InputError as fault:
        raise InputError(f"there is a file already, and no sheet without answers: {fault}; give another name") from None
    if given := len(answers.given) + len(answers.unknown):
        raise InputError(f"{target} has {given} answers: give the questions another name, or remove it")


@conformance.command()
@click.argument("file", metavar="FILE")
@grading_options
@plain_options
def grade(common: Common, file: str, reading: str | None, **more: str | None) -> int:
    """Grade the answers of a sheet, by level, and name the likely mistake at the first level that fails.

    A sheet is what `conformance questions` wrote, or any CSV with the columns id and answer. The exit status is 0
    whatever the grades, a poor one being a result, unless --require or --expected-failures ask for more.
    """
    from tippedisk_verify.conformance.grading import graded
    from tippedisk_verify.files import printable

    with progress(common, 0) as advance:
        answers, store = _read(file, reading, advance)
    wanted = Wanted.checked(store, **more)
    asked = [quantity for quantity in store.values() if not answers.sets or quantity.set in answers.sets]
    return wanted.report(common, store, asked, graded(answers, store), answers, printable(Path(file).name))


@conformance.command()
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@from_option
@plain_options
def compare(common: Common, old: str, new: str, reading: str | None) -> int:
    """Say which answers lost or gained a digit or more between two sheets of one program.

    Digits of doubles beyond the fourteenth are rounding, and do not count. The exit status is 1 if an answer that
    passed does not any more, or is gone.
    """
    from tippedisk_verify.conformance.grading import graded
    from tippedisk_verify.conformance.regression import changes

    with progress(common, 0) as advance:
        found = changes(*(graded(*_read(file, reading, advance)) for file in (old, new)))
    counts = {kind: sum(change.kind == kind for change in found) for kind in ("broken", "gone", "lost", "gained")}
    lines = [f"{change.kind:8}{change.id}  {_digits(change.to_dict())}" for change in found[:_SHOWN]]
    if len(found) > _SHOWN:
        lines.append(f"{len(found) - _SHOWN} more are in what --json prints")
    lines.append(", ".join(f"{count} {kind}" for kind, count in counts.items()))
    print_result(common, {**counts, "changes": [change.to_dict() for change in found]}, lines)
    return 1 if counts["broken"] or counts["gone"] else 0


def _digits(change: dict[str, Any]) -> str:
    shown = ["none" if change[name] is None else f"{change[name]:.1f}" for name in ("old_digits", "new_digits")]
    return f"{shown[0]} -> {shown[1]} digits"


def _read(file: str, reading: str | None, advance: Callable[[str, int], None]) -> tuple[Answers, Store]:
    """The answers of a sheet, and the truths that they are graded by."""
    from tippedisk_verify.conformance.sheet import read_answers, store_for
    from tippedisk_verify.files import printable
    from tippedisk_verify.reference_values.store import stored

    checked_reading(reading)
    store = store_for(Path(file), stored(), advance)
    answers = read_answers(Path(file), store, reading)
    if answers.unknown and not answers.given:
        raise InputError(
            f"{printable(Path(file).name)}: none of its ids is a question, such as {answers.unknown[0][:80]}: "
            "`conformance questions` writes a sheet that has them"
        )
    return answers, store


for _command in (run, client, grader, guide):
    conformance.add_command(_command)
COMMANDS = (conformance,)
