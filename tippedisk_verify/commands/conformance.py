"""The commands `conformance questions|grade`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.common import Common, console, plain_options, print_result
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.reference_values.store import Store

__all__ = ["COMMANDS"]


@click.group(invoke_without_command=True)
@click.pass_context
def conformance(context: click.Context) -> None:
    """Ask another implementation, and grade its answers in digits."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@conformance.command()
@click.argument("file", metavar="FILE.csv|FILE.json")
@click.option("--set", "sets", multiple=True, metavar="NAME", help="printed or calibrated; both if not given.")
@click.option("--friction", "laws", multiple=True, metavar="linear|smooth", help="One law only.")
@click.option("--levels", metavar="N-M", help="Levels of difficulty, such as 1-3 or 7; all ten if not given.")
@plain_options
def questions(common: Common, file: str, sets: tuple[str, ...], laws: tuple[str, ...], levels: str | None) -> int:
    """Write an answer sheet: inputs only, easiest first."""
    from tippedisk_verify.conformance.sheet import questions as asked
    from tippedisk_verify.conformance.sheet import sheet_csv, sheet_json
    from tippedisk_verify.files import output_file, write_text
    from tippedisk_verify.reference_values.store import stored

    target = output_file(file)
    if target.suffix.lower() not in (".csv", ".json"):
        raise InputError(f"'{file[:60]}' must end in .csv or .json: that decides the form of the sheet")
    store = stored()
    _refuse_filled_in(target, store)
    chosen = asked(store, sets=sets, frictions=laws, levels=_levels(levels))
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


def _levels(text: str | None) -> tuple[int, ...]:
    if text is None:
        return ()
    given = re.fullmatch(r"(\d{1,2})(?:-(\d{1,2}))?", text, re.ASCII)
    if given is None:
        raise InputError(f"--levels is a number or a range such as 1-3, not '{text[:40]}'")
    from tippedisk_verify.conformance.grading import LEVEL_NAMES

    ends = int(given[1]), int(given[2] or given[1])
    if not 1 <= ends[0] <= ends[1] <= len(LEVEL_NAMES):
        raise InputError(f"levels go from 1 to {len(LEVEL_NAMES)}, not '{text[:40]}'")
    return tuple(range(ends[0], ends[1] + 1))


@conformance.command()
@click.argument("file", metavar="FILE")
@click.option(
    "--from", "reading", metavar="decimals|doubles", help="What answers that do not say so were computed from."
)
@click.option("--html", metavar="FILE.html", help="Write a page with all grades there.")
@plain_options
def grade(common: Common, file: str, reading: str | None, html: str | None) -> int:
    """Grade the answers of a sheet, by level, and name the likely mistake at the first level that fails.

    A sheet is what `conformance questions` wrote, or any CSV with the columns id and answer. The exit status is 0
    whatever the grades: a poor one is a result.
    """
    from tippedisk_verify.conformance.diagnosis import diagnosed
    from tippedisk_verify.conformance.grading import graded, levels_of
    from tippedisk_verify.conformance.pages import Report, html_page, print_report
    from tippedisk_verify.conformance.sheet import read_answers
    from tippedisk_verify.files import output_file, printable, write_text
    from tippedisk_verify.reference_values.store import stored

    if reading not in (None, "decimals", "doubles"):
        raise InputError(f"--from says decimals or doubles, not '{reading!s:.40}'")
    target = None if html is None else output_file(html)
    if target is not None and target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"'{str(html)[:60]}' must end in .html: --html writes a page there, over what it holds")
    store = stored()
    answers = read_answers(Path(file), store, reading)
    if answers.unknown and not answers.given:
        raise InputError(
            f"{printable(Path(file).name)}: none of its ids is a question, such as {answers.unknown[0][:80]}: "
            "`conformance questions` writes a sheet that has them"
        )
    grades = graded(answers, store)
    asked = [quantity for quantity in store.values() if not answers.sets or quantity.set in answers.sets]
    report = Report(printable(Path(file).name), answers, grades, levels_of(grades, asked), diagnosed(grades, store))
    if target is not None:
        write_text(target, html_page(report))
    if common.json:
        print_result(common, report.json())
    elif not common.quiet:
        print_report(report, console())
    return 0


COMMANDS = (conformance,)
