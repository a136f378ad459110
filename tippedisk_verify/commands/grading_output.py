"""The options of the grading commands: the files to write, and the grades that are required."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.definition import OutputOptions
from tippedisk_verify.commands.options import (
    combined_options,
    levels_callback,
    output_file_callback,
)
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import read_text, write_text

if TYPE_CHECKING:
    from tippedisk_verify.conformance.grading import Grade
    from tippedisk_verify.conformance.sheet import Answers
    from tippedisk_verify.reference_values.store import ReferenceValue, Store

__all__ = ["GradingOutput", "grading_options"]

_FILE_WIDTH = 100_000  # width of a file in characters, more than any line has
_MAX_CSV_BYTES = 64_000_000  # bytes of a file that --csv may replace

grading_options = combined_options(
    click.option(
        "--html",
        callback=output_file_callback(".html", ".htm"),
        metavar="FILE.html|.htm",
        help="Write a page with all grades there.",
    ),
    click.option(
        "--csv",
        callback=output_file_callback(".csv"),
        metavar="FILE.csv",
        help="Write the grades of each quantity there.",
    ),
    click.option(
        "--badge",
        callback=output_file_callback(".svg"),
        metavar="FILE.svg",
        help="Write a badge there that shows which levels agree.",
    ),
    click.option(
        "--require",
        callback=levels_callback,
        metavar="N-M",
        help="Exit with 1 if one of these levels has no answer or a wrong one.",
    ),
    click.option(
        "--expected-failures",
        metavar="FILE",
        help="A list of ids that may fail, one a line, with * for any characters; exit with 1 if "
        "others fail.",
    ),
)


@dataclass(frozen=True)
class GradingOutput:
    """The files that a command is to write, and the grades that it requires."""

    page: Path | None
    table: Path | None
    picture: Path | None
    required: tuple[int, ...] | None  #: levels that must pass
    expectable: frozenset[str] | None  #: ids that may fail

    @classmethod
    def checked(
        cls,
        store: Store,
        html: Path | None,
        csv: Path | None,
        badge: Path | None,
        require: tuple[int, ...] | None,
        expected_failures: str | None,
    ) -> GradingOutput:
        """Check the options of a command about files and required grades, and return them as one
        object.

        Raises:
            InputError: If a file cannot be written or read.
        """
        from tippedisk_verify.conformance.gate import expected_failures as named

        if csv is not None:
            _refuse_to_overwrite(csv)
        expectable = None if expected_failures is None else named(Path(expected_failures), store)
        return cls(html, csv, badge, require, expectable)

    def report(
        self,
        output: OutputOptions,
        store: Store,
        asked_questions: Sequence[ReferenceValue],
        grades: Sequence[Grade],
        answers: Answers,
        source: str,
        broke_off: str = "",
        **more: Any,
    ) -> int:
        """Diagnose the grades of a sheet, print and write the report, and return the exit status.

        ``more`` holds further fields of the `Report`.
        """
        from rich.console import Console

        from tippedisk_verify.conformance.diagnosis import diagnose
        from tippedisk_verify.conformance.gate import badge, shortcomings
        from tippedisk_verify.conformance.grade_pages import Report, html_page, print_report
        from tippedisk_verify.conformance.grading import tally_levels

        levels = tally_levels(grades, asked_questions)
        with output.progress() as advance:
            diagnoses = diagnose(grades, store, advance)
        short, expectable = [], self.expectable or frozenset()
        if self.required is not None or self.expectable is not None:
            short = shortcomings(levels, grades, self.required, expectable) + [broke_off] * bool(
                broke_off
            )
        unexpected_passes = sorted(expectable & {grade.id for grade in grades if not grade.failed})
        report = Report(
            source, answers, grades, levels, diagnoses, short, unexpected_passes, **more
        )
        if self.page is not None:
            write_text(self.page, html_page(report))
        if self.table is not None:
            write_text(self.table, report.csv())
        if self.picture is not None:
            write_text(self.picture, badge(levels))
        if output.json:
            output.show(report.to_dict())
        elif not output.quiet:
            terminal = Console()  # a file gets a width at which nothing is wrapped
            print_report(report, terminal if terminal.is_terminal else Console(width=_FILE_WIDTH))
        return 1 if short else 0


def _refuse_to_overwrite(path: Path) -> None:
    """Raise InputError if --csv would overwrite a file that is not a table of grades.

    Sheets of answers are CSV files as well.
    """
    if path.exists() and not read_text(path, _MAX_CSV_BYTES).startswith("level,quantity,"):
        raise InputError(
            f"{path} is not a table of grades, and --csv would overwrite it; give another name"
        )
