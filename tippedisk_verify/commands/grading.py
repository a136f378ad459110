"""What `conformance grade` and `conformance run` share: their options, the report, and the exit status."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import Common, console, print_result, progress
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.conformance.grading import Grade
    from tippedisk_verify.conformance.sheet import Answers
    from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = [
    "Wanted",
    "blank_ones",
    "checked_reading",
    "from_option",
    "grading_options",
    "levels_named",
    "question_options",
]

from_option = click.option(
    "--from", "reading", metavar="decimals|doubles", help="What answers that do not say so were computed from."
)


def question_options(command: Any) -> Any:
    """The options of the commands that ask."""
    return _decorated(command, _QUESTION_OPTIONS)


def grading_options(command: Any) -> Any:
    """The options of the commands that grade."""
    return _decorated(command, _GRADING_OPTIONS)


def _decorated(command: Any, options: Sequence[Any]) -> Any:
    for option in reversed(options):
        command = option(command)
    return command


def blank_ones(states: int | None, seed: int | None, sets: Sequence[str]) -> Store | None:
    """The fresh questions that --states and --seed ask for, without truths. Raises InputError."""
    from tippedisk_verify.reference_values.fresh import blank_questions

    if states is None:
        if seed is not None:
            raise InputError("--seed is for fresh questions: say with --states how many")
        return None
    if sets:
        raise InputError("--set is for the published questions: fresh ones are about disks of their own")
    return blank_questions(states, seed or 0)


_LARGEST = 64_000_000  # bytes of a file that --csv may replace
_QUESTION_OPTIONS = (
    click.option("--set", "sets", multiple=True, metavar="NAME", help="table1 or calibrated; both if not given."),
    click.option("--friction", "laws", multiple=True, metavar="linear|smooth", help="One law only."),
    click.option("--levels", metavar="N-M", help="Levels of difficulty, such as 1-3 or 7; all ten if not given."),
    click.option(
        "--states", type=int, metavar="N", help="Fresh questions instead: N drawn states, ten to a drawn disk."
    ),
    click.option("--seed", type=int, metavar="S", help="What they are drawn from; 0 if not given."),
)
_GRADING_OPTIONS = (
    from_option,
    click.option("--html", metavar="FILE.html", help="Write a page with all grades there."),
    click.option("--csv", "table", metavar="FILE.csv", help="Write the grades by quantity there."),
    click.option("--badge", metavar="FILE.svg", help="Write a picture there that says which levels agree."),
    click.option("--require", metavar="N-M", help="Exit with 1 if one of these levels has no answer or a wrong one."),
    click.option(
        "--expected-failures",
        "expected",
        metavar="FILE",
        help="Ids that may fail, one to a line, * for any characters; exit with 1 if others do.",
    ),
)


@dataclass(frozen=True)
class Wanted:
    """What is asked for beside the grades, checked: files, and what must pass."""

    page: Path | None
    table: Path | None
    picture: Path | None
    gated: bool
    required: tuple[int, ...] | None
    expectable: frozenset[str]

    @classmethod
    def checked(
        cls,
        store: Store,
        html: str | None,
        table: str | None,
        badge: str | None,
        require: str | None,
        expected: str | None,
    ) -> Wanted:
        """From the options. Raises InputError for what they cannot be."""
        from tippedisk_verify.conformance.regression import expected_failures

        page, picture = _output(html, "--html", ".html", ".htm"), _output(badge, "--badge", ".svg")
        rows = _table_output(table)
        required = levels_named(require) or None
        expectable = frozenset[str]() if expected is None else expected_failures(Path(expected), store)
        return cls(page, rows, picture, require is not None or expected is not None, required, expectable)

    def report(
        self,
        common: Common,
        store: Store,
        asked: Sequence[Quantity],
        grades: Sequence[Grade],
        answers: Answers,
        source: str,
        broke_off: str = "",
        **more: Any,
    ) -> int:
        """Diagnose, print and write; the exit status. ``more`` is for the `Report`."""
        from tippedisk_verify.conformance.diagnosis import diagnosed
        from tippedisk_verify.conformance.grading import levels_of
        from tippedisk_verify.conformance.pages import Report, html_page, print_report
        from tippedisk_verify.conformance.regression import badge, shortcomings
        from tippedisk_verify.files import write_text

        levels = levels_of(grades, asked)
        with progress(common, 0) as advance:
            diagnoses = diagnosed(grades, store, advance)
        short = shortcomings(levels, grades, self.required, self.expectable) if self.gated else []
        short += [broke_off] if self.gated and broke_off else []
        mended = sorted(self.expectable & {one.id for one in grades if not one.failed})
        report = Report(source, answers, grades, levels, diagnoses, short, mended, **more)
        if self.page is not None:
            write_text(self.page, html_page(report))
        if self.table is not None:
            write_text(self.table, report.csv())
        if self.picture is not None:
            write_text(self.picture, badge(levels))
        if common.json:
            print_result(common, report.to_dict())
        elif not common.quiet:
            print_report(report, console())
        return 1 if short else 0


def levels_named(text: str | None) -> tuple[int, ...]:
    """The levels of a range such as 1-3; none if it is None. Raises InputError for any other text."""
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


def checked_reading(reading: str | None) -> str | None:
    """What --from says. Raises InputError for anything but the two."""
    if reading not in (None, "decimals", "doubles"):
        raise InputError(f"--from says decimals or doubles, not '{reading!s:.40}'")
    return reading


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
