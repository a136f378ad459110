"""Answer sheets: writing the questions of the reference data, and reading answers.

**CSV.** Every row is complete, parameters included, and no field needs quotes, so that ``strtok``
can read a sheet. An answered sheet may be separated by tabs or semicolons as well, and may begin
with a spreadsheet's ``sep=;``.

**JSON.** A sheet contains the same questions. It may also be simply ``{id: number}`` or
``{"from": "doubles", "answers": {id: number}}``, or have one question to a line.

A remark names the columns of CSV and the names of JSON that no sheet has.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any

from tippedisk_verify.conformance.answer_number import is_missing
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.grading_rules import (
    QUESTION_COLUMNS,
    VALUES_COLUMNS,
    question_fields,
)
from tippedisk_verify.reference_values.lookup import full_id
from tippedisk_verify.reference_values.store import (
    ReferenceValue,
    Store,
    definition_of,
    is_optional,
    optional_ids_of_state,
)
from tippedisk_verify.support.files import csv_text, printable, read_text

__all__ = [
    "Answers",
    "Row",
    "collect_answers",
    "parse_answer_line",
    "question_row",
    "questions",
    "read_answers",
    "sheet_csv",
    "sheet_json",
    "store_for_sheet",
]

# The columns that describe the question, apart from the id
_DESCRIPTION_COLUMNS = QUESTION_COLUMNS[1:-2]
Row = tuple[str, str, str, dict[str, str]]  #: id, reading, answer, and the other columns of the row
# bytes; a sheet with every question and fifty digits each is about ten million long
_MAX_SHEET_BYTES = 64_000_000
_MAX_ANSWER = 2_000  # characters of an answer
_MAX_UNKNOWN = 1_000
_READINGS = ("decimals", "doubles")
_SEPARATORS = ("\t", ";", ",")
_SEPARATOR_LINE = re.compile(
    r"sep=([^\"\s]|\t)", re.IGNORECASE
)  # the first line with which a spreadsheet declares its separator
_JSON_NAMES = ("format", "from", "questions", "answers")
_MAX_LISTED_NAMES = 20  # names that are listed


@dataclass
class Answers:
    """The answers that were read from a sheet, by id as (reading, text), and the parts that could
    not be used.
    """

    by_id: dict[str, tuple[str, str]] = field(default_factory=dict)
    sets: set[str] = field(default_factory=set)  #: parameter sets of the questions, answered or not
    unknown_ids: list[str] = field(default_factory=list)  #: ids that belong to no question
    #: Ids answered more than once; the first answer counts
    repeated_ids: list[str] = field(default_factory=list)
    #: Rows whose columns are not those of the question: id, column
    altered_rows: list[str] = field(default_factory=list)
    without_reading: int = 0  #: answers that do not name their inputs; taken as from doubles
    short_rows: int = 0  #: rows that end before the column answer
    #: Entries with answers of NaN or NA only; not answered
    missing_entries: list[str] = field(default_factory=list)
    #: columns that no sheet has, each with the one that may be meant
    unknown_names: list[str] = field(default_factory=list)


def questions(
    store: Store,
    *,
    sets: Sequence[str] = (),
    frictions: Sequence[str] = (),
    levels: Sequence[int] = (),
) -> list[ReferenceValue]:
    """Return the questions of some sets, laws and levels, in order of difficulty.

    Optional questions follow M of the same state. They have no true values here; look these up in
    the store.

    Args:
        store: The questions with their truths.
        sets: The parameter sets; () for all. ``printed`` is taken for `table1`.
        frictions: The friction laws; () for all.
        levels: The levels; () for all.

    Raises:
        InputError: If a name belongs to no question, or no question is left.
    """
    sets = [full_id(name) for name in sets]
    for asked, known, what in (
        (sets, {quantity.set for quantity in store.values()}, "parameter set"),
        (frictions, {"linear", "smooth"}, "friction law"),
        (levels, {quantity.level for quantity in store.values()}, "level"),
    ):
        for name in asked:
            if name not in known:
                raise InputError(
                    f"no reference data for {what} '{name!s:.40}': use "
                    f"{', '.join(map(str, sorted(known)))}"
                )
    chosen = [
        quantity
        for quantity in store.values()
        if (not sets or quantity.set in sets)
        and (not frictions or quantity.friction in (*frictions, "both"))
        and (not levels or quantity.level in levels)
    ]
    if not chosen:
        raise InputError("there is no such question: levels 3 to 5 are for the linear friction law")
    return [one for quantity in chosen for one in (quantity, *_optional_questions(quantity))]


def _optional_questions(reference_value: ReferenceValue) -> list[ReferenceValue]:
    """Return the optional questions about a state, from the question about its M, without answers;
    [] for other questions.
    """
    blank = replace(reference_value, values=dict.fromkeys(reference_value.values, ("", "")))
    names = [(id_, id_.rsplit("/", 1)[1]) for id_ in optional_ids_of_state(reference_value.id)]
    return [
        replace(blank, id=id_, name=name, unit=definition_of("rhs", name).unit)
        for id_, name in names
    ]


def question_row(store: Store, reference_value: ReferenceValue) -> dict[str, str]:
    """Return a question as texts by column, without the columns that do not apply.

    Args:
        store: The questions with their parameters.
        reference_value: The question.
    """
    return question_fields(store.parameters[reference_value.set], reference_value)


def sheet_csv(store: Store, asked_questions: Iterable[ReferenceValue]) -> str:
    """Return a sheet of questions as CSV text. Where only decimals make sense, the column ``from``
    is filled in.

    Args:
        store: The questions with their parameters.
        asked_questions: The questions of the sheet.
    """
    rows = (question_row(store, quantity) for quantity in asked_questions)
    return csv_text(
        QUESTION_COLUMNS, ([row.get(name, "") for name in QUESTION_COLUMNS] for row in rows)
    )


def sheet_json(store: Store, asked_questions: Iterable[ReferenceValue]) -> str:
    """Return a sheet of questions as JSON text, one question to a line.

    Args:
        store: The questions with their parameters.
        asked_questions: The questions of the sheet.
    """
    lines = [
        json.dumps(question_row(store, quantity), ensure_ascii=False)
        for quantity in asked_questions
    ]
    return '{"format": 1, "from": "", "questions": [\n' + ",\n".join(lines) + "\n]}\n"


def store_for_sheet(
    path: Path, store: Store, advance: Callable[[str, int], None] = lambda label, steps: None
) -> Store:
    """Return the store of questions, extended by the truths of the fresh questions that a sheet
    names.

    Args:
        path: The sheet.
        store: The published questions.
        advance: A function that is called with the progress in words and in steps.

    Raises:
        InputError: If the file cannot be read.
    """
    text = read_text(path, _MAX_SHEET_BYTES)
    if "fresh-" not in text:
        return store
    from tippedisk_verify.reference_values.fresh_questions import with_fresh

    return with_fresh(store, text.replace("\\/", "/"), advance)  # as some languages write JSON


def read_answers(path: Path, store: Store, default_reading: str | None = None) -> Answers:
    """Read the answers of a sheet in CSV or JSON. Rows without an answer are left out.

    Args:
        path: The sheet.
        store: The questions with their truths.
        default_reading: The inputs of answers that do not name them, decimals or doubles.

    Raises:
        InputError: If the file cannot be read as a sheet at all.
    """
    text = read_text(path, _MAX_SHEET_BYTES)
    answers = Answers()
    try:
        rows = (
            _json_rows(text, answers)
            if text.lstrip()[:1] in ("{", "[")
            else _csv_rows(text, answers)
        )
        return collect_answers(rows, store, default_reading, answers)
    except InputError as fault:
        raise InputError(f"{printable(path.name)}: {fault}") from None


def parse_answer_line(line: str) -> Row | None:
    """Read one line of JSON that a program has written, and return the answer in it; None if it
    gives no answer.

    Args:
        line: The line.
    """
    try:
        row = json.loads(line, parse_float=str, parse_int=str, parse_constant=str)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict) or not isinstance(row.get("id"), str) or "answer" not in row:
        return None
    reading = _as_text(row.get("from", "")).strip().lower()
    return _json_row(row, reading) if reading in ("", *_READINGS) else None


def _json_row(row: dict[str, Any], reading: str) -> Row:
    asked = {name: _as_text(row[name]) for name in _DESCRIPTION_COLUMNS if name in row}
    return _as_text(row["id"]), reading, _as_text(row.get("answer", "")), asked


def _json_rows(text: str, answers: Answers) -> Iterable[Row]:
    def first_of_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        unique: dict[str, Any] = {}
        for name, value in pairs:
            if name in unique:
                answers.repeated_ids.append(printable(name)[:200])
            else:
                unique[name] = value
        return unique

    def loaded(part: str) -> Any:
        # Numbers stay text: a double would lose digits of a fifty-digit answer.
        return json.loads(
            part,
            parse_float=str,
            parse_int=str,
            parse_constant=str,
            object_pairs_hook=first_of_each,
        )

    first, _, rest = text.strip().partition("\n")
    try:
        lines = first.rstrip().endswith("}") and rest.lstrip()[:1] == "{"
        content = (
            [loaded(line) for line in text.splitlines() if line.strip()] if lines else loaded(text)
        )
    except (ValueError, RecursionError) as fault:
        reason = str(fault).splitlines()[0][:120]
        raise InputError(f"neither a CSV nor a JSON sheet: {reason}") from None
    if isinstance(content, dict) and "id" in content:
        content = [content]
    named = content if isinstance(content, dict) else {"questions": content}
    common_reading = named.get("from", "")
    is_id_mapping = "questions" not in named and any("/" in name for name in named)
    if not is_id_mapping:
        _note_unknown_names(named, _JSON_NAMES, answers)
    answers_by_id = (
        {name: value for name, value in named.items() if name != "from"}
        if is_id_mapping
        else named.get("answers")
    )
    if isinstance(answers_by_id, dict):
        for id_, answer in answers_by_id.items():
            yield id_, _as_text(common_reading), _as_text(answer), {}
        return
    rows = named.get("questions")
    if not isinstance(rows, list):
        raise InputError(
            'a JSON sheet has "questions" or "answers", or is an object of ids and numbers; this one has '
            f"{_names_text(named, _JSON_NAMES)}"
        )
    for row in rows:
        if not isinstance(row, dict) or "id" not in row:
            has = f"; one has {_names_text(row, VALUES_COLUMNS)}" if isinstance(row, dict) else ""
            raise InputError(f'each question of a JSON sheet has an "id"{has}')
        _note_unknown_names(row, VALUES_COLUMNS, answers)
        yield _json_row(row, _as_text(row.get("from", "") or common_reading))


def _as_text(value: Any) -> str:
    return value if isinstance(value, str) else "" if value is None else f"({type(value).__name__})"


def _csv_rows(text: str, answers: Answers) -> Iterable[Row]:
    if "\0" in text:
        raise InputError("neither a CSV nor a JSON sheet: it holds NUL characters")
    first, _, rest = text.partition("\n")
    declared = _SEPARATOR_LINE.fullmatch(first.strip('\r" '))
    separator = declared[1] if declared else _separator(first)
    table = csv.reader(
        io.StringIO(rest if declared else text, newline=""), delimiter=separator, strict=True
    )
    try:
        header = [name.strip() for name in next(table, [])]
        _note_unknown_names(header, VALUES_COLUMNS, answers)
        if "id" not in header or "answer" not in header:
            raise InputError(
                "neither a CSV nor a JSON sheet: the first line must name the columns id and "
                "answer, separated by "
                f"commas, semicolons or tabs; it has {_names_text(header, VALUES_COLUMNS)}"
            )
        # Single columns of such names may be the user's own.
        asked = _DESCRIPTION_COLUMNS if set(_DESCRIPTION_COLUMNS) <= set(header) else ()
        for row in table:
            if len(row) > len(header):
                line, more = (
                    table.line_num + bool(declared),
                    ": is there a decimal comma?" if separator == "," else "",
                )
                raise InputError(
                    f"line {line} has {len(row)} fields, the header {len(header)}{more}"
                )
            # Of two columns of the same name the first counts.
            cells = dict(reversed(list(zip(header, row, strict=False))))
            if "id" in cells and "answer" in cells:
                yield (
                    cells["id"],
                    cells.get("from", ""),
                    cells["answer"],
                    {name: cells[name] for name in asked if name in cells},
                )
            else:
                answers.short_rows += bool(row)
    except csv.Error as fault:
        raise InputError(f"not a CSV sheet: {str(fault)[:120]}") from None


def _separator(header: str) -> str:
    """Return the separator between the columns of a header: a tab, a semicolon or a comma.

    It is the first that yields the columns id and answer, in upper or lower case; a comma if none
    does.
    """

    def columns(separator: str) -> set[str]:
        return {name.strip('\r" ').lower() for name in header.split(separator)}

    return next(
        (separator for separator in _SEPARATORS if {"id", "answer"} <= columns(separator)), ","
    )


def _note_unknown_names(names: Iterable[str], known: tuple[str, ...], answers: Answers) -> None:
    for name in names:
        message = "" if not name or name in known else _name_with_suggestion(name, known)
        if (
            message
            and message not in answers.unknown_names
            and len(answers.unknown_names) < _MAX_LISTED_NAMES
        ):
            answers.unknown_names.append(message)


@lru_cache(maxsize=256)
def _name_with_suggestion(name: str, known: tuple[str, ...]) -> str:
    """Return a name in quotes, followed by the known name that may be meant, if there is one.

    The two names differ in few letters, or only in upper and lower case.
    """
    by_lower = {known_name.lower(): known_name for known_name in known}
    likely = [] if name in known else get_close_matches(name.lower(), by_lower, 1, 0.75)
    meant = f" (written {by_lower[likely[0]]} here)" if likely else ""
    return f"'{printable(name)[:40]}'{meant}"


def _names_text(names: Iterable[str], known: tuple[str, ...]) -> str:
    """Return names found in a sheet as text for a message, as many as fit; "none" without a name.

    A likely meant name follows each that is not known.
    """
    return (
        ", ".join(_name_with_suggestion(name, known) for name in list(names)[:_MAX_LISTED_NAMES])[
            :400
        ]
        or "none"
    )


def collect_answers(
    rows: Iterable[Row], store: Store, default_reading: str | None, answers: Answers
) -> Answers:
    """Add the answers in the rows of a sheet to ``answers``.

    Args:
        rows: The rows of a sheet.
        store: The questions with their truths.
        default_reading: The inputs of answers that do not name them, decimals or doubles.
        answers: The answers so far; changed in place.

    Returns:
        The answers.

    Raises:
        InputError: If a row names other inputs than decimals or doubles.
    """
    for id_, reading, answer, asked in rows:
        id_, reading, answer = (
            full_id(printable(id_.strip())),
            reading.strip().lower(),
            answer.strip(),
        )
        if id_ in store:
            answers.sets.add(id_.split("/")[0])
        if not answer:
            continue
        if id_ not in store:
            if len(answers.unknown_ids) < _MAX_UNKNOWN:
                answers.unknown_ids.append(id_[:200])
            continue
        if (column := _altered_column(asked, store, store[id_])) is not None:
            answers.altered_rows.append(f"{id_}, {column}")
        if id_ in answers.by_id:
            answers.repeated_ids.append(id_)
            continue
        if not reading:
            reading = default_reading or (
                "doubles" if "doubles" in store[id_].values else "decimals"
            )
            answers.without_reading += default_reading is None
        if reading not in _READINGS:
            raise InputError(
                f"{id_}: the column from says decimals or doubles, not '{printable(reading)[:40]}'"
            )
        answers.by_id[id_] = (
            reading,
            answer if len(answer) <= _MAX_ANSWER else "(longer than 2000 characters)",
        )
    return _without_missing(answers)


def _without_missing(answers: Answers) -> Answers:
    """Remove missing answers that do not count from ``answers``, and return it.

    If all answers of an entry are missing, the program has not answered it, and the entry is listed
    in ``answers.missing_entries``. If only some are, these stay and are wrong, except for optional
    ones.
    """
    by_entry: dict[str, list[str]] = {}
    for id_ in answers.by_id:
        by_entry.setdefault(id_.rsplit("/", 1)[0], []).append(id_)
    for entry, ids in by_entry.items():
        missing = [id_ for id_ in ids if is_missing(answers.by_id[id_][1])]
        if len(missing) == len(ids):
            answers.missing_entries.append(entry)
        else:
            missing = [id_ for id_ in missing if is_optional(id_)]
        for id_ in missing:
            del answers.by_id[id_]
    return answers


def _altered_column(
    columns: dict[str, str], store: Store, reference_value: ReferenceValue
) -> str | None:
    """Return the name of the first column in which a row of a sheet differs from the question; None
    if there is no difference.

    A number may be written in another way, such as with a decimal comma.

    Args:
        columns: The columns of a row in a sheet.
        store: The questions with their parameters.
        reference_value: The question with the id of that row.
    """
    asked = question_row(store, reference_value) if columns else {}
    for name, text in columns.items():
        wanted, text = asked.get(name, ""), text.strip()
        if text and text != wanted:
            try:
                # A sheet may have decimal commas
                if float(text.replace(",", ".")) == float(wanted):
                    continue
            except ValueError:
                pass
            return name
    return None
