"""The command `conformance run`: a program is asked over pipes, graded and timed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, alone_in, plain_options, progress
from tippedisk_verify.commands.grading import (
    Wanted,
    blank_ones,
    checked_reading,
    grading_options,
    levels_named,
    question_options,
)
from tippedisk_verify.errors import InputError
from tippedisk_verify.interrupts import undoing

if TYPE_CHECKING:
    from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["run"]

#: [s] A limit cycle in plain Python with SciPy takes seven; an interpreter ten times slower is not cut short.
_LIMIT = 100.0
_LONGEST = 86_400.0


@click.command()
@click.argument("command", nargs=-1, required=True, metavar="-- PROGRAM [ARGUMENT]...")
@question_options
@click.option(
    "--limit", type=float, default=_LIMIT, show_default=True, metavar="SECONDS", help="How long an answer may take."
)
@click.option("--out", metavar="DIR", help="Write answers and grades there.")
@grading_options
@plain_options
def run(
    common: Common,
    command: tuple[str, ...],
    sets: tuple[str, ...],
    laws: tuple[str, ...],
    levels: str | None,
    states: int | None,
    seed: int | None,
    limit: float,
    out: str | None,
    reading: str | None,
    **more: str | None,
) -> int:
    """Ask a program over its standard input and output, one JSON object a line, and grade and time it.

    `docs/protocol.md` says what a line holds. A program that hangs or dies is graded on what it answered. The exit
    status is 0 whatever the grades, unless --require or --expected-failures ask for more. With --states the questions
    are drawn, and their truths computed first: in a few seconds, or in a quarter of a minute with all levels.
    """
    from tippedisk_verify.conformance.dialogue import started
    from tippedisk_verify.conformance.interview import Interview
    from tippedisk_verify.conformance.sheet import questions
    from tippedisk_verify.files import printable, write_text
    from tippedisk_verify.reference_values.store import stored

    if not 0 < limit <= _LONGEST:
        raise InputError(f"--limit must lie between 0 and {_LONGEST:g} seconds, not {limit:g}")
    store = stored()
    wanted = Wanted.checked(store, **more)
    blank = blank_ones(states, seed, sets)
    asked = questions(blank or store, sets=sets, frictions=laws, levels=levels_named(levels))
    first = questions(blank or store, sets=sets, levels=(1,))[0]
    checked_reading(reading)
    folder = alone_in(out)
    if blank is not None:
        store = _with_truths(common, store, [first, *asked])
        asked, first = [store[one.id] for one in asked], store[first.id]
    source = printable(" ".join(Path(word).name for word in command))[:60]
    with started(command, limit) as program:
        interview = Interview(program, store, reading)

        def keep() -> None:
            if folder is not None and interview.rows:
                write_text(folder / "answers.jsonl", interview.sheet())

        with undoing(keep), progress(common, len(asked)) as advance:
            try:
                interview.conduct(asked, first, advance)
            finally:
                keep()
        interview.finish()
    if not common.quiet:
        for line in program.errors():
            click.echo(f"{program.name}: {line}", err=True)
    if folder is not None:
        wanted = replace(wanted, page=wanted.page or folder / "grades.html")
    told: dict[str, Any] = {
        "start_up": interview.start_up,
        "times": interview.times(),
        "noticed": interview.remarks(),
    }
    answers, broke_off = interview.answers(), interview.broke_off
    return wanted.report(common, store, asked, interview.grades, answers, source, broke_off, **told)


def _with_truths(common: Common, store: Store, asked: Sequence[Quantity]) -> Store:
    from tippedisk_verify.reference_values.fresh import with_fresh

    with progress(common, len({one.id.rsplit("/", 1)[0] for one in asked})) as advance:
        return with_fresh(store, "\n".join(one.id for one in asked), advance)
