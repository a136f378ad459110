"""Showing grades: a table for the terminal, a page for the browser, an object for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tippedisk_verify.conformance.diagnosis import Diagnosis
from tippedisk_verify.conformance.grading import FAILS_BELOW, TOLERANCES, Grade, Tally, by_quantity
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.files import csv_text
from tippedisk_verify.model.results import Printable

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Report", "html_page", "print_report"]

#: The colour of a verdict on an answer or on a level; a level's least answers have its own. Without one: not graded.
_SHADES = {
    **dict.fromkeys(("exact", "agrees", "rounding", "partial"), "enough"),
    **dict.fromkeys(("few-digits", "too few digits"), "few"),
    **dict.fromkeys(("wrong", "not-a-number", "unreadable", "fails"), "wrong"),
}
_TERMINAL = {"enough": "green", "few": "yellow", "wrong": "bold red", "": "dim"}
#: What the colours mean, in the order of the page's legend.
_LEGEND = {"enough": "enough digits for the question", "few": "too few digits", "wrong": "wrong, or no number"}
_WORST = 12
_MOST_REASONS = 5  # why answers are no numbers
_MOST_ROWS = 2_000  # of a level on a page, failures first; the JSON has all


@dataclass(frozen=True, repr=False)
class Report(Printable):
    """Everything about one graded sheet."""

    source: str
    answers: Answers
    grades: Sequence[Grade]
    levels: Sequence[Tally]
    diagnoses: Sequence[Diagnosis]
    shortcomings: Sequence[str] = ()  #: what keeps it from passing, where levels are required
    mended: Sequence[str] = ()  #: ids that were expected to fail, and pass
    noticed: Sequence[str] = ()  #: what a program did beside answering
    start_up: float | None = None  #: [s] until a program's first answer
    times: Sequence[Mapping[str, Any]] = ()  #: how long a program took, by level and kind

    @property
    def failed(self) -> list[Grade]:
        """The answers that failed, easiest first."""
        return [grade for grade in self.grades if grade.failed]

    @property
    def passed(self) -> bool:
        """Whether there are graded answers, and none failed."""
        return any(grade.verdict != "no-truth" for grade in self.grades) and not self.failed

    def __str__(self) -> str:
        """The result in a sentence, the diagnosis, what was noticed, and the failures, in ten lines at most."""
        lines = [self.headline(), *(diagnosis.says() for diagnosis in self.diagnoses), *self.remarks()]
        lines += [grade.shortfall(grade.needs) for grade in self.failed]
        return "\n".join(lines if len(lines) <= 10 else [*lines[:9], f"and {len(lines) - 9} more"])

    @property
    def first_failure(self) -> Tally | None:
        return next((level for level in self.levels if level.failed), None)

    def headline(self) -> str:
        """The result in one sentence."""
        if not self.grades:
            return "no question was answered"
        first = self.first_failure
        if first is None:
            reached = [level for level in self.levels if level.answered]
            if not reached:
                return "no answer could be graded"
            least = min(level.least for level in reached)
            answers = counted(sum(level.answered for level in reached), "answer agrees", "answers agree")
            rounded = sum(level.rounded for level in reached)
            said = f"{answers}, the least with {least:.1f} digits"
            return said + (f"; {counted(rounded, 'is', 'are')} off by what rounding the inputs does" if rounded else "")
        answers = counted(first.answered, "answer", "answers")
        how = "is the first with too few digits" if first.few == first.failed else "is the first that fails"
        few = f", {first.few} of them with too few digits only" if 0 < first.few < first.failed else ""
        return f"level {first.level}, {first.name}, {how}: {first.failed} of {answers}{few}"

    @property
    def quantities(self) -> list[Tally]:
        """By quantity, at the levels that fail."""
        failing = {level.level for level in self.levels if level.failed}
        return [row for row in by_quantity(self.grades) if row.level in failing]

    def remarks(self) -> list[str]:
        """What was noticed about the sheet itself."""
        answers = self.answers
        rounded = sum("inputs were rounded" in grade.note for grade in self.grades)
        untold = sum(grade.verdict == "no-truth" for grade in self.grades)
        said = list(self.noticed)
        said += _remark(
            answers.undeclared, "answer does", "answers do", "not say from which inputs; graded as from doubles"
        )
        said += _remark(answers.unknown, "unknown id,", "unknown ids,", "such as {}")
        said += _remark(answers.repeated, "id", "ids", "answered more than once, such as {}; the first answer counts")
        lost = "not ask what the id stands for, such as {}: is the sheet damaged?"
        said += _remark(answers.altered, "row does", "rows do", lost)
        said += _remark(
            answers.missing, "entry has", "entries have", "NaN or NA only, such as {}: counted as not answered"
        )
        said += _remark(answers.strange, "column or name is", "columns or names are", "not known, and not read: {all}")
        said += self._unread()
        said += self._tolerance()
        said += _remark(
            self.mended, "answer passes", "answers pass", "though expected to fail, such as {}: mend the list"
        )
        said += _remark(answers.short, "row ends", "rows end", "before the column answer")
        said += _remark(rounded, "answer", "answers", "said to be from decimals: exactly what doubles give")
        doubles = "from doubles where doubles cannot tell the inputs apart: not graded"
        return said + _remark(untold, "answer", "answers", doubles)

    def _unread(self) -> list[str]:
        """Why answers are no numbers: a remark for each reason, with the first of these answers."""
        by_reason: dict[str, list[Grade]] = {}
        for grade in self.grades:
            if grade.verdict in ("unreadable", "not-a-number"):
                by_reason.setdefault(grade.note, []).append(grade)
        said = [
            f"{counted(len(grades), 'answer is', 'answers are')} no number, such as '{grades[0].answer[:60]}' at"
            f" {grades[0].id}: {reason}"
            for reason, grades in list(by_reason.items())[:_MOST_REASONS]
        ]
        more = len(by_reason) - _MOST_REASONS
        return said + (
            [f"{counted(more, 'more reason', 'more reasons')} why answers are no numbers"] if more > 0 else []
        )

    def _tolerance(self) -> list[str]:
        """Where an integrator's tolerance shows: answers that are not wrong, but off by more than `TOLERANCES`."""
        said = []
        for level in self.levels:
            if level.level < 6 or level.failed > level.few:
                continue
            here = [grade for grade in self.grades if grade.level == level.level]
            off = [grade for grade in here if grade.off > TOLERANCES[level.level] and grade.verdict != "exact"]
            if off:
                most = max(off, key=lambda grade: grade.off)
                said.append(
                    f"level {level.level}: a tolerance shows, at {counted(len(off), 'answer', 'answers')} of"
                    f" {len(here)}, the most at {most.id}, off as if all inputs were changed by {most.off:.0e}"
                )
        return said

    def csv(self) -> str:
        """The grades by level, quantity and friction law, as a table."""
        columns = list(Tally.of((), 0, 0, "any").to_dict())
        return csv_text(columns, (list(row.to_dict().values()) for row in by_quantity(self.grades)))

    def to_dict(self) -> dict[str, Any]:
        first = self.first_failure
        seconds = {"start_up": self.start_up, "kinds": list(self.times)}
        return {
            "source": self.source,
            "headline": self.headline(),
            "first_failing_level": None if first is None else first.level,
            "levels": [level.to_dict() for level in self.levels],
            "quantities": [row.to_dict() for row in by_quantity(self.grades)],
            "diagnoses": [diagnosis.to_dict() for diagnosis in self.diagnoses],
            "shortcomings": list(self.shortcomings),
            "remarks": self.remarks(),
            "unknown": self.answers.unknown,
            "repeated": self.answers.repeated,
            "grades": [grade.to_dict() for grade in self.grades],
            **({"seconds": seconds} if self.start_up is not None else {}),
        }

    def worst(self) -> list[Grade]:
        """Failures, those of the first failing level first, then by digits."""
        return sorted(self.failed, key=lambda grade: (grade.level, grade.digits))[:_WORST]


def _remark(which: int | Sequence[str], one: str, many: str, said: str) -> list[str]:
    """A remark on so many things, or on things by name, with the first of them or all; none where there are none."""
    number, names = (which, ("",)) if isinstance(which, int) else (len(which), which)
    return [f"{counted(number, one, many)} {said.format(*names[:1], all=', '.join(names))}"] if number else []


def counted(number: int, one: str, many: str) -> str:
    """A number of things, in words that agree with it."""
    return f"{number} {one if number == 1 else many}"


def shade(verdict: str) -> str:
    """The name of the colour for a verdict on an answer or on a level; empty where nothing was graded."""
    return _SHADES.get(verdict, "")


def shown_digits(digits: float) -> str:
    """One decimal, never "-0.0"; nothing for what has no digits."""
    return f"{round(digits, 1) + 0.0:.1f}" if math.isfinite(digits) else ""


def split_where_wrong(answer: str, truth: str) -> tuple[str, str]:
    """The answer's characters up to where it leaves the truth, and the rest; the whole if it never does."""
    same = 0
    for mine, right in zip(answer, truth, strict=False):
        if mine != right:
            break
        same += 1
    return answer[:same], answer[same:]


def print_report(report: Report, console: Console) -> None:
    """The diagnosis, the tables, the worst answers coloured by agreeing digits, and what was required."""
    from rich.text import Text

    def coloured(text: str, verdict: str) -> Text:
        return Text(text, style=_TERMINAL[shade(verdict)])

    def row(one: Tally, *about: str) -> list[Any]:
        least = coloured(shown_digits(one.least), one.verdict)
        return [*about, least, str(one.failed - one.few or ""), str(one.few or "")]

    rows = [
        [
            *row(one, f"{one.level} {one.name}", f"{one.answered}/{one.asked}"),
            shown_digits(one.middle),
            str(FAILS_BELOW[one.level]),
            coloured(one.verdict, one.verdict),
        ]
        for one in report.levels
    ]
    console.print(Text(f"{report.source}: {report.headline()}", style="bold"))
    for diagnosis in report.diagnoses:
        console.print(Text(diagnosis.says(), style="bold"))
    headings = "level =answered =least =wrong =few =median =needs verdict"
    _print_table(console, "\nby level (least, median, needs: digits; few: answers with too few)", headings, rows)
    if report.quantities:
        rows = [row(one, str(one.level), one.quantity, one.friction, str(one.answered)) for one in report.quantities]
        headings = "level quantity law =answered =least =wrong =few"
        _print_table(console, "\nby quantity, at the levels that fail", headings, rows)
    console.print()
    for remark in report.remarks():
        console.print(Text(f"note: {remark}"))
    if report.failed:
        console.print(Text("\nleast digits", style="italic"))
    for grade in report.worst():
        right, wrong = split_where_wrong(grade.answer[:40], grade.truth)
        has = f"{shown_digits(grade.digits)} digits" if grade.truth else grade.note
        console.print(Text(f"{grade.id}: ").append(coloured(grade.verdict, grade.verdict)).append(f", {has}"))
        truth = f"  truth {grade.truth[:24]}" if grade.truth else ""
        console.print(Text("    ").append(right, "green").append(wrong, "red").append(truth))
    if report.times:
        title = f"\nrun time [s]: {report.start_up or 0:.3g} to start up, then for each state, trajectory or cycle"
        rows = [
            [
                f"{one['level']} {one['kind']}",
                *(str(one[name]) for name in ("answered", "entries")),
                *(f"{one[name]:.3g}" for name in ("total", "median", "largest")),
                one["longest"].replace("/", " "),
            ]
            for one in report.times
        ]
        headings = "level =answers =entries =total =median =largest longest"
        _print_table(console, title, headings, rows)
    for said in report.shortcomings:
        console.print(Text(said, style="bold red"))


def _print_table(console: Console, title: str, headings: str, rows: Sequence[Sequence[Any]]) -> None:
    """A table for a terminal of 80 columns, in which no word is broken; a heading that starts with = is of numbers."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in headings.split():
        table.add_column(heading.removeprefix("="), justify="right" if heading[0] == "=" else "left")
    for row in rows:
        table.add_row(*row)
    console.print(Text(title, style="italic"), table, sep="\n")


def html_page(report: Report) -> str:
    """One self-contained page; what is right is folded away, and so stays off paper."""
    from tippedisk_verify.web import rendered

    return rendered(
        "tippedisk_verify.conformance",
        "grades.html",
        digits=shown_digits,
        report=report,
        levels=[_level_section(level, report.grades) for level in report.levels],
        quantities=report.quantities,
        shade=shade,
        legend=_LEGEND,
        split=split_where_wrong,
        needs=FAILS_BELOW,
    )


def _level_section(level: Tally, grades: Sequence[Grade]) -> dict[str, Any]:
    """A level on the page: its failures, the answers that did not fail, and how many are beyond what a page holds."""
    here = sorted((grade for grade in grades if grade.level == level.level), key=lambda grade: not grade.failed)
    return {
        "grade": level,
        "failed": [grade for grade in here[:_MOST_ROWS] if grade.failed],
        "passed": [grade for grade in here[:_MOST_ROWS] if not grade.failed],
        "hidden": max(len(here) - _MOST_ROWS, 0),
    }
