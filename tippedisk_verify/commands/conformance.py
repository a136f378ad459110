"""The commands `conformance questions|grade|run|compare`, which ask, grade and compare programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.conformance_sources import client, grader, guide
from tippedisk_verify.commands.definition import OutputOptions, command, group
from tippedisk_verify.commands.grading_output import GradingOutput, grading_options
from tippedisk_verify.commands.options import (
    combined_options,
    levels_callback,
    lock_output_folder,
    option_callback,
)
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import checked_file_path, printable, write_text
from tippedisk_verify.support.interrupts import clean_up_on_ctrl_c

if TYPE_CHECKING:
    from tippedisk_verify.conformance.sheet import Answers
    from tippedisk_verify.reference_values.store import Store
    from tippedisk_verify.support.progress import Advance

__all__ = ["COMMANDS"]

_SHOWN_CHANGES = 40  # changes that a terminal shows
_MAX_SECONDS = 86_400.0  # s for an answer


def _checked_reading(reading: str) -> str:
    if reading not in ("decimals", "doubles"):
        raise InputError(f"--from is decimals or doubles, not '{reading!s:.40}'")
    return reading


_question_options = combined_options(
    click.option(
        "--set",
        "set_",
        multiple=True,
        metavar="NAME",
        help="The parameter set, table1 or calibrated; both if not given.",
    ),
    click.option(
        "--friction",
        multiple=True,
        metavar="linear|smooth",
        help="Ask about one friction law only.",
    ),
    click.option(
        "--levels",
        callback=levels_callback,
        metavar="N-M",
        help="Levels of difficulty, such as 1-3,7; all ten if not given.",
    ),
    click.option(
        "--states",
        type=int,
        metavar="N",
        help="Ask fresh questions instead: N drawn states, ten to a drawn disk.",
    ),
    click.option(
        "--seed", type=int, metavar="S", help="The seed of fresh questions; 0 if not given."
    ),
)
_from_option = click.option(
    "--from",
    "from_",
    callback=option_callback(_checked_reading),
    metavar="decimals|doubles",
    help="How the answers read their inputs, if the sheet does not say so.",
)


@command(
    """Write an answer sheet, to FILE or to standard output: inputs only, easiest first.

    With --states the questions are drawn from the seed, the same ones on every machine. Their ids
    hold the seed, so `grade` can compute the true values, with half-widths.
    """
)
@click.argument("file", metavar="[FILE.csv|FILE.json]", required=False)
@_question_options
def questions(
    output: OutputOptions,
    file: str | None,
    set_: tuple[str, ...],
    friction: tuple[str, ...],
    levels: tuple[int, ...] | None,
    states: int | None,
    seed: int | None,
) -> int:
    from tippedisk_verify.conformance import sheet
    from tippedisk_verify.reference_values.store import load_store

    target = None if file is None else checked_file_path(file, ".csv", ".json")
    store = load_store()
    if target is not None:
        _refuse_filled_in(target, store)
    store = _blank_questions(states, seed, set_) or store
    chosen = sheet.questions(store, sets=set_, frictions=friction, levels=levels or ())
    if target is None:
        as_json, as_csv = sheet.sheet_json(store, chosen), sheet.sheet_csv(store, chosen)
        output.show(json.loads(as_json), as_csv.splitlines())
        return 0
    written = sheet.sheet_json if target.suffix.lower() == ".json" else sheet.sheet_csv
    write_text(target, written(store, chosen))
    line = f"{len(chosen)} questions: fill in the column answer in {target}, then grade it"
    output.show({"questions": len(chosen), "file": str(target)}, [line])
    return 0


def _refuse_filled_in(target: Path, store: Store) -> None:
    """Raise InputError if writing questions to a file would overwrite answers, or a file that is
    not a sheet.

    A file that cannot be read may have answers with a mistake.
    """
    from tippedisk_verify.conformance.sheet import read_answers

    if not target.exists() or not target.stat().st_size:
        return
    try:
        answers = read_answers(target, store)
    except InputError as fault:
        raise InputError(
            f"the file exists and is not a sheet without answers: {fault}; give another name"
        ) from None
    if given := len(answers.by_id) + len(answers.unknown_ids):
        raise InputError(
            f"{target} has {given} answers: give the questions another name, or remove it"
        )


@command(
    """Grade the answers of a sheet by level, and name the likely mistake at the first failing level.

    A sheet comes from `conformance questions`, or is any CSV with the columns id and answer. The
    exit status is 0 for all grades, because a poor grade is a result too, unless --require or
    --expected-failures demand more.
    """
)
@click.argument("file", metavar="FILE")
@_from_option
@grading_options
def grade(output: OutputOptions, file: str, from_: str | None, **grading: Any) -> int:
    from tippedisk_verify.conformance.grading import grade_answers

    with output.progress() as advance:
        answers, store = _read(file, from_, advance)
    requested = GradingOutput.checked(store, **grading)
    asked = [
        question for question in store.values() if not answers.sets or question.set in answers.sets
    ]
    return requested.report(
        output, store, asked, grade_answers(answers, store), answers, printable(Path(file).name)
    )


@command(
    """Ask a program over its standard input and output, one JSON object a line; grade and time it.

    `docs/protocol.md` defines the lines. A program that hangs or dies is graded on the answers it
    gave. The exit status is 0 for all grades, unless --require or --expected-failures demand more.
    With --states the questions are drawn, and their true values are computed first, in a few
    seconds, or in a quarter of a minute with all levels.
    """
)
@click.argument("command", nargs=-1, required=True, metavar="-- PROGRAM [ARGUMENT]...")
@_question_options
@click.option(
    "--limit",
    type=float,
    default=100.0,
    show_default=True,
    metavar="SECONDS",
    help="Time for one answer; a limit cycle in plain Python with SciPy takes seven.",
)
@click.option("--out", metavar="DIR", help="Write answers and grades there.")
@_from_option
@grading_options
def run(
    output: OutputOptions,
    command: tuple[str, ...],
    set_: tuple[str, ...],
    friction: tuple[str, ...],
    levels: tuple[int, ...] | None,
    states: int | None,
    seed: int | None,
    limit: float,
    out: str | None,
    from_: str | None,
    **grading: Any,
) -> int:
    from tippedisk_verify.conformance import sheet
    from tippedisk_verify.conformance.interview import Interview
    from tippedisk_verify.reference_values.fresh_questions import with_fresh
    from tippedisk_verify.reference_values.store import load_store
    from tippedisk_verify.support.dialogue import start_program

    if not 0 < limit <= _MAX_SECONDS:
        raise InputError(f"--limit must lie between 0 and {_MAX_SECONDS:g} seconds, not {limit:g}")
    store = load_store()
    requested = GradingOutput.checked(store, **grading)
    blank = _blank_questions(states, seed, set_)
    asked = sheet.questions(blank or store, sets=set_, frictions=friction, levels=levels or ())
    first = sheet.questions(blank or store, sets=set_, levels=(1,))[0]
    folder = lock_output_folder(out)
    if blank is not None:
        ids = [question.id for question in (first, *asked)]
        with output.progress(len({id_.rsplit("/", 1)[0] for id_ in ids})) as advance:
            store = with_fresh(store, "\n".join(ids), advance)
        asked, first = [store[question.id] for question in asked], store[first.id]
    with start_program(command, limit) as talk:
        interview = Interview(talk, store, from_)

        def keep() -> None:
            if folder is not None and interview.answer_rows:
                write_text(folder / "answers.jsonl", interview.answers_as_json_lines())

        with clean_up_on_ctrl_c(keep), output.progress(len(asked)) as advance:
            try:
                interview.ask_all(asked, first, advance)
            finally:
                keep()
        interview.finish()
    if not output.quiet:
        for line in talk.errors():
            click.echo(f"{talk.name}: {line}", err=True)
    if folder is not None:
        requested = replace(requested, page=requested.page or folder / "grades.html")
    timing: dict[str, Any] = {
        "start_up": interview.start_up,
        "times": interview.times(),
        "program_remarks": interview.remarks(),
    }
    source = printable(" ".join(Path(word).name for word in command))[:60]
    answers, broke_off = interview.answers(), interview.break_off_reason
    return requested.report(
        output, store, asked, interview.grades, answers, source, broke_off, **timing
    )


@command(
    """Compare two sheets of one program, and list the answers that lost or gained a digit or more.

    Digits of doubles beyond the fourteenth are rounding and do not count. The exit status is 1 if
    an answer that passed now fails or is missing.
    """
)
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@_from_option
def compare(output: OutputOptions, old: str, new: str, from_: str | None) -> int:
    from tippedisk_verify.conformance.gate import grade_changes
    from tippedisk_verify.conformance.grading import grade_answers

    with output.progress() as advance:
        changes = grade_changes(
            *(grade_answers(*_read(file, from_, advance)) for file in (old, new))
        )
    kinds = ("broken", "gone", "lost", "gained")
    counts = {kind: sum(change.kind == kind for change in changes) for kind in kinds}
    lines = [
        f"{change.kind:8}{change.id}  {_digits(change.to_dict())}"
        for change in changes[:_SHOWN_CHANGES]
    ]
    if len(changes) > _SHOWN_CHANGES:
        lines.append(f"{len(changes) - _SHOWN_CHANGES} more: use --json to see all")
    lines.append(", ".join(f"{count} {kind}" for kind, count in counts.items()))
    output.show({**counts, "changes": [change.to_dict() for change in changes]}, lines)
    return 1 if counts["broken"] or counts["gone"] else 0


def _digits(change: dict[str, Any]) -> str:
    shown = [
        "none" if change[name] is None else f"{change[name]:.1f}"
        for name in ("old_digits", "new_digits")
    ]
    return f"{shown[0]} -> {shown[1]} digits"


def _read(file: str, reading: str | None, advance: Advance) -> tuple[Answers, Store]:
    """Read a sheet of answers, and return the answers and the store with the true values.

    Raises:
        InputError: If the sheet cannot be read, or none of its ids is a question.
    """
    from tippedisk_verify.conformance.sheet import read_answers, store_for_sheet
    from tippedisk_verify.reference_values.store import load_store

    store = store_for_sheet(Path(file), load_store(), advance)
    answers = read_answers(Path(file), store, reading)
    if answers.unknown_ids and not answers.by_id:
        raise InputError(
            f"{printable(Path(file).name)}: none of its ids is a question (the first is "
            f"{answers.unknown_ids[0][:80]}): "
            "`conformance questions` writes a sheet with the right ids"
        )
    return answers, store


def _blank_questions(states: int | None, seed: int | None, sets: Sequence[str]) -> Store | None:
    """Return the fresh questions that --states and --seed ask for, without answers, or None.

    Raises:
        InputError: If the options do not go together.
    """
    from tippedisk_verify.reference_values.fresh_questions import blank_questions

    if states is None:
        if seed is not None:
            raise InputError("--seed is for fresh questions: give their number with --states")
        return None
    if sets:
        raise InputError("--set is for the published questions: fresh ones have their own disks")
    return blank_questions(states, seed or 0)


_HELP = "Ask another implementation, and grade its answers in digits."
COMMANDS = (group("conformance", _HELP, questions, grade, run, compare, client, grader, guide),)
