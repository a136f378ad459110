"""The commands `conformance questions|grade|compare`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, console, plain_options, print_result, progress
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.conformance.sheet import Answers
    from tippedisk_verify.reference_values.store import Store

__all__ = ["COMMANDS"]

_SHOWN = 40  # changes on a terminal
_LARGEST = 64_000_000  # bytes of a file that --csv may replace


@click.group(invoke_without_command=True)
@click.pass_context
def conformance(context: click.Context) -> None:
    """Ask another implementation, and grade its answers in digits."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@conformance.command()
@click.argument("file", metavar="[FILE.csv|FILE.json]", required=False)
@click.option("--set", "sets", multiple=True, metavar="NAME", help="printed or calibrated; both if not given.")
@click.option("--friction", "laws", multiple=True, metavar="linear|smooth", help="One law only.")
@click.option("--levels", metavar="N-M", help="Levels of difficulty, such as 1-3 or 7; all ten if not given.")
@click.option("--states", type=int, metavar="N", help="Fresh questions instead: N drawn states, ten to a drawn disk.")
@click.option("--seed", type=int, metavar="S", help="What they are drawn from; 0 if not given.")
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
    if states is not None:
        store = _fresh(states, seed or 0, sets)
    elif seed is not None:
        raise InputError("--seed is for fresh questions: say with --states how many")
    chosen = asked(store, sets=sets, frictions=laws, levels=_levels(levels))
    if target is None:
        print_result(common, json.loads(sheet_json(store, chosen)), sheet_csv(store, chosen).splitlines())
        return 0
    write_text(target, (sheet_json if target.suffix.lower() == ".json" else sheet_csv)(store, chosen))
    line = f"{len(chosen)} questions: fill in the column answer in {target}, then grade it"
    print_result(common, {"questions": len(chosen), "file": str(target)}, [line])
    return 0


def _fresh(states: int, seed: int, sets: tuple[str, ...]) -> Store:
    from tippedisk_verify.reference_values.fresh import blank_questions

    if sets:
        raise InputError("--set is for the published questions: fresh ones are about disks of their own")
    return blank_questions(states, seed)


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
        raise InputError(f"levels are a number or a range such as 1-3, not '{text[:40]}'")
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
@click.option("--csv", "table", metavar="FILE.csv", help="Write the grades by quantity there.")
@click.option("--badge", metavar="FILE.svg", help="Write a picture there that says which levels agree.")
@click.option("--require", metavar="N-M", help="Exit with 1 unless these levels are answered and agree.")
@click.option(
    "--expected-failures",
    "expected",
    metavar="FILE",
    help="Ids that may fail, one to a line, * for any characters; exit with 1 if others do.",
)
@plain_options
def grade(
    common: Common,
    file: str,
    reading: str | None,
    html: str | None,
    table: str | None,
    badge: str | None,
    require: str | None,
    expected: str | None,
) -> int:
    """Grade the answers of a sheet, by level, and name the likely mistake at the first level that fails.

    A sheet is what `conformance questions` wrote, or any CSV with the columns id and answer. The exit status is 0
    whatever the grades, a poor one being a result, unless --require or --expected-failures ask for more.
    """
    from tippedisk_verify.conformance.diagnosis import diagnosed
    from tippedisk_verify.conformance.grading import graded, levels_of
    from tippedisk_verify.conformance.pages import Report, html_page, print_report
    from tippedisk_verify.conformance.regression import badge as drawn
    from tippedisk_verify.conformance.regression import expected_failures, shortcomings
    from tippedisk_verify.files import printable, write_text

    page, picture = _output(html, "--html", ".html", ".htm"), _output(badge, "--badge", ".svg")
    rows = _table_output(table)
    required = _levels(require) or None
    with progress(common, 0) as advance:
        answers, store = _read(file, reading, advance)
    expectable = frozenset[str]() if expected is None else expected_failures(Path(expected), store)
    grades = graded(answers, store)
    asked = [quantity for quantity in store.values() if not answers.sets or quantity.set in answers.sets]
    levels = levels_of(grades, asked)
    with progress(common, 0) as advance:
        diagnoses = diagnosed(grades, store, advance)
    gated = require is not None or expected is not None
    short = shortcomings(levels, grades, required, expectable) if gated else []
    mended = sorted(expectable & {one.id for one in grades if not one.failed})
    report = Report(printable(Path(file).name), answers, grades, levels, diagnoses, short, mended)
    if page is not None:
        write_text(page, html_page(report))
    if rows is not None:
        write_text(rows, report.csv())
    if picture is not None:
        write_text(picture, drawn(levels))
    if common.json:
        print_result(common, report.json())
    elif not common.quiet:
        print_report(report, console())
    return 1 if short else 0


@conformance.command()
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option(
    "--from", "reading", metavar="decimals|doubles", help="What answers that do not say so were computed from."
)
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
    lines = [f"{change.kind:8}{change.id}  {_digits(change.json())}" for change in found[:_SHOWN]]
    if len(found) > _SHOWN:
        lines.append(f"{len(found) - _SHOWN} more are in what --json prints")
    lines.append(", ".join(f"{count} {kind}" for kind, count in counts.items()))
    print_result(common, {**counts, "changes": [change.json() for change in found]}, lines)
    return 1 if counts["broken"] or counts["gone"] else 0


def _digits(change: dict[str, Any]) -> str:
    shown = ["none" if change[name] is None else f"{change[name]:.1f}" for name in ("old_digits", "new_digits")]
    return f"{shown[0]} -> {shown[1]} digits"


def _output(name: str | None, option: str, *endings: str) -> Path | None:
    from tippedisk_verify.files import output_file

    target = None if name is None else output_file(name)
    if target is not None and target.suffix.lower() not in endings:
        raise InputError(f"'{str(name)[:60]}' must end in {endings[0]}: {option} writes there, over what it holds")
    return target


def _table_output(name: str | None) -> Path | None:
    """Where a table of grades may go: over another one, and over nothing else, since answers are CSV as well."""
    from tippedisk_verify.files import read_text

    target = _output(name, "--csv", ".csv")
    if target is not None and target.exists() and not read_text(target, _LARGEST).startswith("level,quantity,"):
        raise InputError(f"{target} is no table of grades: --csv would write over it; give another name")
    return target


def _read(file: str, reading: str | None, advance: Callable[[str, int], None]) -> tuple[Answers, Store]:
    """The answers of a sheet, and the truths that they are graded by."""
    from tippedisk_verify.conformance.sheet import read_answers, store_for
    from tippedisk_verify.files import printable
    from tippedisk_verify.reference_values.store import stored

    if reading not in (None, "decimals", "doubles"):
        raise InputError(f"--from says decimals or doubles, not '{reading!s:.40}'")
    store = store_for(Path(file), stored(), advance)
    answers = read_answers(Path(file), store, reading)
    if answers.unknown and not answers.given:
        raise InputError(
            f"{printable(Path(file).name)}: none of its ids is a question, such as {answers.unknown[0][:80]}: "
            "`conformance questions` writes a sheet that has them"
        )
    return answers, store


COMMANDS = (conformance,)
