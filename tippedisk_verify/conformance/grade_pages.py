"""The display of grades: a table for the terminal, a page for the browser, an object in Python."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import TYPE_CHECKING, Any

from tippedisk_verify.conformance.diagnosis import Diagnosis
from tippedisk_verify.conformance.grading import Grade, Tally, tally_quantities
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.display import Printable, data_frame
from tippedisk_verify.reference_values.grading_rules import ALLOWED_INPUT_CHANGE, DIGITS_REQUIRED
from tippedisk_verify.reference_values.store import is_optional
from tippedisk_verify.support.files import csv_text

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Report", "html_page", "print_report"]

# The colours of the verdicts on answers and levels. A verdict without a colour is not graded.
_COLOURS_OF_VERDICTS = {
    **dict.fromkeys(("exact", "agrees", "rounding", "partial"), "enough"),
    **dict.fromkeys(("few-digits", "too few digits"), "few"),
    **dict.fromkeys(("wrong", "not-a-number", "unreadable", "fails"), "wrong"),
}
_TERMINAL_STYLES = {"enough": "green", "few": "yellow", "wrong": "bold red", "": "dim"}
# The meanings of the colours, in the order of the page's legend.
_LEGEND = {
    "enough": "enough digits for the question",
    "few": "too few digits",
    "wrong": "wrong, or no number",
}
_LISTED_FAILURES = 12  # failures in the list of the worst answers
_MAX_REASONS = 5  # reasons listed why answers are not numbers
_MAX_ROWS = 2_000  # rows of a level on a page, failures first; the JSON contains all


@dataclass(frozen=True, repr=False)
class Report(Printable):
    """The report on a sheet of answers: its grades, its diagnosis and remarks."""

    source: str
    answers: Answers
    grades: Sequence[Grade]
    levels: Sequence[Tally]
    diagnoses: Sequence[Diagnosis]
    shortcomings: Sequence[str] = ()  #: the reasons why it does not pass, where levels are required
    unexpected_passes: Sequence[str] = ()  #: ids that were expected to fail, and pass
    program_remarks: Sequence[str] = ()  #: remarks on what a program did apart from answering
    start_up: float | None = None  #: [s] until a program's first answer
    times: Sequence[Mapping[str, Any]] = ()  #: a program's run times, by level and kind

    @property
    def failed(self) -> list[Grade]:
        """The answers that failed, easiest first."""
        return [grade for grade in self.grades if grade.failed]

    @property
    def passed(self) -> bool:
        """True if there are graded answers, and none failed; optional ones do not count."""
        counting = [grade for grade in self.grades if not is_optional(grade.id)]
        graded = any(grade.verdict != "no-truth" for grade in counting)
        return graded and not any(grade.failed for grade in counting)

    def __str__(self) -> str:
        """Return the report in at most ten lines: the result, the diagnosis, the remarks and the
        failures.
        """
        lines = [
            self.headline(),
            *(diagnosis.summary() for diagnosis in self.diagnoses),
            *self.remarks(),
        ]
        lines += [grade.shortfall(grade.required_digits) for grade in self.failed]
        return "\n".join(lines if len(lines) <= 10 else [*lines[:9], f"and {len(lines) - 9} more"])

    @property
    def first_failure(self) -> Tally | None:
        return next((level for level in self.levels if level.failed), None)

    def headline(self) -> str:
        """Return the result of the grading in one sentence."""
        if not self.grades:
            return "no question was answered"
        first = self.first_failure
        if first is None:
            reached = [level for level in self.levels if level.answered]
            if not reached:
                return "no answer could be graded"
            least = min(level.least_digits for level in reached)
            answers = count_text(
                sum(level.answered for level in reached), "answer agrees", "answers agree"
            )
            rounded = sum(level.within_rounding for level in reached)
            sentence = f"{answers}, the least with {least:.1f} digits"
            by_rounding = f"; {count_text(rounded, 'is', 'are')} off by rounding of the inputs"
            return sentence + by_rounding if rounded else sentence
        answers = count_text(first.answered, "answer", "answers")
        how = (
            "is the first with too few digits"
            if first.too_few_digits == first.failed
            else "is the first that fails"
        )
        few = (
            f", {first.too_few_digits} of them with too few digits only"
            if 0 < first.too_few_digits < first.failed
            else ""
        )
        return f"level {first.level}, {first.name}, {how}: {first.failed} of {answers}{few}"

    @property
    def quantities(self) -> list[Tally]:
        """The tallies of answers by quantity, for the levels that fail."""
        failing = {level.level for level in self.levels if level.failed}
        return [row for row in tally_quantities(self.grades) if row.level in failing]

    def remarks(self) -> list[str]:
        """Return remarks on the sheet of answers itself, such as unknown ids, each in one line."""
        answers = self.answers
        rounded = sum("inputs were rounded" in grade.note for grade in self.grades)
        ungraded = sum(grade.verdict == "no-truth" for grade in self.grades)
        remarks = list(self.program_remarks)
        remarks += _remark(
            answers.without_reading,
            "answer does",
            "answers do",
            "not say from which inputs; graded as from doubles",
        )
        remarks += _remark(answers.unknown_ids, "unknown id,", "unknown ids,", "such as {}")
        remarks += _remark(
            answers.repeated_ids,
            "id",
            "ids",
            "answered more than once, such as {}; the first answer counts",
        )
        lost = "not ask what the id stands for, such as {}: is the sheet damaged?"
        remarks += _remark(answers.altered_rows, "row does", "rows do", lost)
        remarks += _remark(
            answers.missing_entries,
            "entry has",
            "entries have",
            "NaN or NA only, such as {}: counted as not answered",
        )
        remarks += _remark(
            answers.unknown_names,
            "column or name is",
            "columns or names are",
            "not known, and not read: {all}",
        )
        remarks += self._unreadable_remarks()
        remarks += self._tolerance_remarks()
        remarks += _remark(
            self.unexpected_passes,
            "answer passes",
            "answers pass",
            "though expected to fail, such as {}: update the list",
        )
        remarks += _remark(answers.short_rows, "row ends", "rows end", "before the column answer")
        remarks += _remark(
            rounded, "answer", "answers", "declared as from decimals: exactly those from doubles"
        )
        doubles = "from doubles where doubles cannot tell the inputs apart: not graded"
        return remarks + _remark(ungraded, "answer", "answers", doubles)

    def _unreadable_remarks(self) -> list[str]:
        """Return remarks on answers that are not numbers, one for each reason, with the first such
        answer.

        At most five reasons are given, and the number of the others.
        """
        by_reason: dict[str, list[Grade]] = {}
        for grade in self.grades:
            if grade.verdict in ("unreadable", "not-a-number"):
                by_reason.setdefault(grade.note, []).append(grade)
        remarks = [
            f"{count_text(len(grades), 'answer is not a number', 'answers are not numbers')}, such as "
            f"'{grades[0].answer[:60]}' at"
            f" {grades[0].id}: {reason}"
            for reason, grades in list(by_reason.items())[:_MAX_REASONS]
        ]
        more = len(by_reason) - _MAX_REASONS
        return remarks + (
            [f"{count_text(more, 'more reason', 'more reasons')} why answers are not numbers"]
            if more > 0
            else []
        )

    def _tolerance_remarks(self) -> list[str]:
        """Return remarks on levels at which a program's integration tolerance seems to limit its
        digits.

        At such a level no answer is wrong, but some errors are larger than `ALLOWED_INPUT_CHANGE`.
        """
        remarks = []
        for level in self.levels:
            if level.level < 6 or level.failed > level.too_few_digits:
                continue
            level_grades = [grade for grade in self.grades if grade.level == level.level]
            off = [
                grade
                for grade in level_grades
                if grade.input_change > ALLOWED_INPUT_CHANGE[level.level]
                and grade.verdict != "exact"
            ]
            if off:
                most = max(off, key=lambda grade: grade.input_change)
                remarks.append(
                    f"level {level.level}: a tolerance shows in "
                    f"{count_text(len(off), 'answer', 'answers')} of"
                    f" {len(level_grades)}; the largest error, at {most.id}, is as if all inputs were "
                    f"changed by {most.input_change:.0e}"
                )
        return remarks

    def csv(self) -> str:
        """Return the tallies of answers by level, quantity and friction law as the text of a CSV
        file.
        """
        columns = list(Tally.of((), 0, 0, "any").to_dict())
        return csv_text(
            columns, (list(row.to_dict().values()) for row in tally_quantities(self.grades))
        )

    def to_dataframe(self) -> Any:
        """Return a pandas data frame with a row for each grade, as in ``grades`` of `to_dict`.

        Raises:
            InputError: If pandas is not installed.
        """
        return data_frame([grade.to_dict() for grade in self.grades])

    def to_dict(self) -> dict[str, Any]:
        first = self.first_failure
        seconds = {"start_up": self.start_up, "kinds": list(self.times)}
        return {
            "source": self.source,
            "headline": self.headline(),
            "first_failing_level": None if first is None else first.level,
            "levels": [level.to_dict() for level in self.levels],
            "quantities": [row.to_dict() for row in tally_quantities(self.grades)],
            "diagnoses": [diagnosis.to_dict() for diagnosis in self.diagnoses],
            "shortcomings": list(self.shortcomings),
            "remarks": self.remarks(),
            "unknown": self.answers.unknown_ids,
            "repeated": self.answers.repeated_ids,
            "grades": [grade.to_dict() for grade in self.grades],
            **({"seconds": seconds} if self.start_up is not None else {}),
        }

    def worst_answers(self) -> list[Grade]:
        """Return up to twelve failed answers, by level, then by digits, fewest first."""
        return sorted(self.failed, key=lambda grade: (grade.level, grade.digits))[:_LISTED_FAILURES]


def _remark(which: int | Sequence[str], one: str, many: str, text: str) -> list[str]:
    """Return a list with one remark about some items; [] if there are none.

    Args:
        which: The number of the items, or their names.
        one: The words for one item, with a verb.
        many: The words for several items, with a verb.
        text: The end of the remark. {} stands for the first name, {all} for all names.
    """
    number, names = (which, ("",)) if isinstance(which, int) else (len(which), which)
    return (
        [f"{count_text(number, one, many)} {text.format(*names[:1], all=', '.join(names))}"]
        if number
        else []
    )


def count_text(number: int, one: str, many: str) -> str:
    """Return a text with a number, followed by the words for one thing or for several.

    Args:
        number: The number.
        one: The words for one thing.
        many: The words for several things.
    """
    return f"{number} {one if number == 1 else many}"


def colour_of(verdict: str) -> str:
    """Return the name of the colour in which a verdict is shown; "" if nothing was graded.

    Args:
        verdict: The verdict on an answer or on a level.
    """
    return _COLOURS_OF_VERDICTS.get(verdict, "")


def digits_text(digits: float) -> str:
    """Return a number of digits as text with one decimal, never "-0.0"; "" if it is not finite.

    Args:
        digits: The number of digits.
    """
    return f"{round(digits, 1) + 0.0:.1f}" if math.isfinite(digits) else ""


def least_digits_text(tally: Tally) -> str:
    """Return the least number of digits in a tally of answers as text; "none" if one of its answers
    is not a number.

    Args:
        tally: The tally of the level or the quantity.
    """
    return "none" if tally.not_numbers else digits_text(tally.least_digits)


def split_where_wrong(answer: str, truth: str) -> tuple[str, str]:
    """Return an answer in two parts, divided at the first character that differs from the truth.

    Args:
        answer: The answer's text.
        truth: The truth's text.

    Returns:
        The characters before that place, and the rest.
    """
    pairs = zip(answer, truth, strict=False)
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    return answer[:same], answer[same:]


def print_report(report: Report, console: Console) -> None:
    """Print a report on a terminal.

    It has the diagnosis, the tables, the worst answers coloured by agreeing digits, and the unmet
    requirements.

    Args:
        report: The report.
        console: The console to print on.
    """
    from rich.text import Text

    def coloured(text: str, verdict: str) -> Text:
        return Text(text, style=_TERMINAL_STYLES[colour_of(verdict)])

    def row(tally: Tally, *about: str) -> list[Any]:
        least = coloured(least_digits_text(tally), tally.verdict)
        return [
            *about,
            least,
            str(tally.failed - tally.too_few_digits or ""),
            str(tally.too_few_digits or ""),
        ]

    rows = [
        [
            *row(level, f"{level.level} {level.name}", f"{level.answered}/{level.asked}"),
            digits_text(level.median_digits),
            str(DIGITS_REQUIRED[level.level]),
            coloured(level.verdict, level.verdict),
        ]
        for level in report.levels
    ]
    console.print(Text(f"{report.source}: {report.headline()}", style="bold"))
    for diagnosis in report.diagnoses:
        console.print(Text(diagnosis.summary(), style="bold"))
    headings = "level =answered =least =wrong =few =median =needs verdict"
    _print_table(
        console,
        "\nby level (least, median, needs: digits; few: answers with too few)",
        headings,
        rows,
    )
    if report.quantities:
        rows = [
            row(tally, str(tally.level), tally.quantity, tally.friction, str(tally.answered))
            for tally in report.quantities
        ]
        headings = "level quantity law =answered =least =wrong =few"
        _print_table(console, "\nby quantity, at the levels that fail", headings, rows)
    console.print()
    for remark in report.remarks():
        console.print(Text(f"note: {remark}"))
    if report.failed:
        console.print(Text("\nleast digits", style="italic"))
    for grade in report.worst_answers():
        right, wrong = split_where_wrong(grade.answer[:40], grade.truth)
        has = f"{digits_text(grade.digits)} digits" if grade.truth else grade.note
        console.print(
            Text(f"{grade.id}: ").append(coloured(grade.verdict, grade.verdict)).append(f", {has}")
        )
        truth = f"  truth {grade.truth[:24]}" if grade.truth else ""
        console.print(Text("    ").append(right, "green").append(wrong, "red").append(truth))
    if report.times:
        title = f"\nrun time [s]: {report.start_up or 0:.3g} to start up, then for each state, trajectory or cycle"
        rows = [
            [
                f"{kind['level']} {kind['kind']}",
                *(str(kind[name]) for name in ("answered", "entries")),
                *(f"{kind[name]:.3g}" for name in ("total", "median", "largest")),
                kind["longest"].replace("/", " "),
            ]
            for kind in report.times
        ]
        headings = "level =answers =entries =total =median =largest longest"
        _print_table(console, title, headings, rows)
    for shortcoming in report.shortcomings:
        console.print(Text(shortcoming, style="bold red"))


def _print_table(
    console: Console, title: str, headings: str, rows: Sequence[Sequence[Any]]
) -> None:
    """Print a table for a terminal of 80 columns, in which no word is broken.

    A column whose heading starts with = is aligned to the right, for numbers.
    """
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in headings.split():
        table.add_column(
            heading.removeprefix("="), justify="right" if heading[0] == "=" else "left"
        )
    for row in rows:
        table.add_row(*row)
    console.print(Text(title, style="italic"), table, sep="\n")


def html_page(report: Report) -> str:
    """Return the report as one self-contained HTML page.

    Answers that pass are folded away, so they do not appear on paper.

    Args:
        report: The report.
    """
    from tippedisk_verify.support.web import render

    return render(
        "tippedisk_verify.conformance",
        "grades.html",
        digits=digits_text,
        least=least_digits_text,
        report=report,
        levels=[_level_section(level, report.grades) for level in report.levels],
        quantities=report.quantities,
        colour_of=colour_of,
        legend=_LEGEND,
        split=split_where_wrong,
        needs=DIGITS_REQUIRED,
    )


def _level_section(level: Tally, grades: Sequence[Grade]) -> dict[str, Any]:
    """Return the parts of the HTML page about one level, by name.

    They are the level's tally, its failures, its other answers, and the number of rows beyond the
    limit.
    """
    own = sorted(
        (grade for grade in grades if grade.level == level.level),
        key=lambda grade: not grade.failed,
    )
    return {
        "grade": level,
        "failed": [grade for grade in own[:_MAX_ROWS] if grade.failed],
        "passed": [grade for grade in own[:_MAX_ROWS] if not grade.failed],
        "hidden": max(len(own) - _MAX_ROWS, 0),
    }
