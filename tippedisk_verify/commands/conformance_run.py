"""The command `conformance run`: a program is asked over pipes, graded and timed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    from tippedisk_verify.bench.race import Score
    from tippedisk_verify.conformance.interview import Interview
    from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["run"]

_RACED = ("cycle", "passage", "smooth")  # the problems whose methods take seconds, and one for the other law
#: [s] A limit cycle in plain Python with SciPy takes seven; an interpreter ten times slower is not cut short.
_LIMIT = 100.0
_LONGEST = 86_400.0
_LARGEST = 2**24  # bytes of a figure
_MOST = 300  # the decimal exponent of a number that doubles hold


@click.command()
@click.argument("command", nargs=-1, required=True, metavar="-- PROGRAM [ARGUMENT]...")
@question_options
@click.option(
    "--limit", type=float, default=_LIMIT, show_default=True, metavar="SECONDS", help="How long an answer may take."
)
@click.option("--out", metavar="DIR", help="Write answers, grades and a race against other integrators there.")
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
        scores = [] if folder is None else _raced(common, interview, source[:30])
        interview.finish()
    if not common.quiet:
        for line in program.errors():
            click.echo(f"{program.name}: {line}", err=True)
    told: dict[str, Any] = {"start_up": interview.start_up, "times": interview.times()}
    if folder is not None:
        wanted = replace(wanted, page=wanted.page or folder / "grades.html")
        if scores:
            race = [_point(score) for score in scores if score.family == "asked"]
            told |= {"picture": _drawn(folder, scores), "race": race}
    told["noticed"] = interview.remarks()
    answers, broke_off = interview.answers(), interview.broke_off
    return wanted.report(common, store, asked, interview.grades, answers, source, broke_off, **told)


def _with_truths(common: Common, store: Store, asked: Sequence[Quantity]) -> Store:
    from tippedisk_verify.reference_values.fresh import with_fresh

    with progress(common, len({one.id.rsplit("/", 1)[0] for one in asked})) as advance:
        return with_fresh(store, "\n".join(one.id for one in asked), advance)


def _raced(common: Common, interview: Interview, name: str) -> list[Score]:
    """The program and the report's methods, on the problems of the race that it answers; none if it answers none."""
    from decimal import Decimal, InvalidOperation

    from tippedisk_verify.bench.asked import scores_by_asking
    from tippedisk_verify.bench.problems import problem_named
    from tippedisk_verify.bench.race import raced
    from tippedisk_verify.conformance.grading import as_decimal
    from tippedisk_verify.figures.race import brief_methods

    def ask(rows: Sequence[Mapping[str, str]]) -> tuple[dict[str, Decimal], float]:
        got, seconds = interview.exchange(rows)
        numbers = {}
        for id_, _, text, _ in got:
            try:
                number = as_decimal(text.strip())
            except InvalidOperation:
                continue
            if number.is_finite() and abs(number.adjusted()) < _MOST:
                numbers[id_] = number
        return numbers, seconds

    problems = {name: problem_named(name) for name in _RACED}
    methods = brief_methods()
    with progress(common, len(problems) * (1 + len(methods))) as advance:
        mine = scores_by_asking(name, ask, list(problems.values()), advance)
        return [*raced([problems[score.problem] for score in mine], methods, advance), *mine]


def _drawn(folder: Path, scores: Sequence[Score]) -> str:
    """Write the race, and give its figure as what a page embeds."""
    from base64 import b64encode

    from tippedisk_verify.bench.race import machine
    from tippedisk_verify.files import read_bytes
    from tippedisk_verify.report.tables import write_bench

    write_bench(folder, scores, {"machine": machine(), "runs": [score.json() for score in scores]}, columns=2)
    return "data:image/svg+xml;base64," + b64encode(read_bytes(folder / "bench.svg", _LARGEST)).decode()


def _point(score: Score) -> dict[str, Any]:
    from tippedisk_verify.bench.problems import problem_named

    says = problem_named(score.problem).says
    return {"problem": score.problem, "says": says, "error": score.error, "seconds": score.seconds}
