"""The export of reference values as tables, JSON, and text in C, Fortran, Julia and Octave."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from pathlib import Path

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.drawn_disks import disk_of
from tippedisk_verify.reference_values.grading_rules import digits_needed, scale_of, values_csv_row
from tippedisk_verify.reference_values.store import ReferenceValue
from tippedisk_verify.support.files import checked_file_path, output_file, write_table, write_text

__all__ = ["FORMATS", "write_values"]

_TEXT_FIELDS = ("id", "set", "kind", "friction", "quantity", "unit", "equilibrium", "form")
_INPUTS = (*SYMBOLS, "Omega", *STATE_NAMES, "t", "n", "order")
_NUMBER_FIELDS = (*_INPUTS, "value", "tolerance")
_HEADER = (
    "Reference values of the tippedisk. A good answer in doubles is off by `tolerance` at most."
    " An input that does not apply is 0."
)
_MAX_NAME = 63  # characters of a name, the limit of Fortran and of MATLAB
Row = tuple[list[str], list[float]]  #: the values of `_TEXT_FIELDS` and of `_NUMBER_FIELDS`


def write_values(reference_values: Sequence[ReferenceValue], form: str, path: str) -> Path:
    """Write reference values to a file.

    A test file has the values computed from doubles, and how far an answer may be off. Its array
    (in Fortran its module) is named after the file: tippedisk_hopf in hopf.h.

    Args:
        reference_values: The values.
        form: The format, one of `FORMATS`.
        path: The file's path.

    Returns:
        The path of the file.

    Raises:
        InputError: If the file cannot be written, the format is not known, or a test file would
            have no value.
    """
    if form not in FORMATS:
        raise InputError(f"a form is one of {', '.join(FORMATS)}, not '{form[:40]}'")
    if form in ("csv", "parquet"):
        return write_table(
            checked_file_path(path, f".{form}"),
            [_csv_row(reference_value) for reference_value in reference_values],
        )
    file = output_file(path)
    if form == "jsonl":
        lines = (
            json.dumps(reference_value.to_dict(), ensure_ascii=False)
            for reference_value in reference_values
        )
        return write_text(file, "".join(f"{line}\n" for line in lines))
    rows = [
        _test_file_row(reference_value)
        for reference_value in reference_values
        if "doubles" in reference_value.values
    ]
    if not rows:
        raise InputError(
            "doubles cannot tell the inputs of these values apart: a test file would be empty"
        )
    name = re.sub(r"\W", "_", f"tippedisk_{file.stem}", flags=re.ASCII)[:_MAX_NAME]
    return write_text(file, "\n".join([*_LANGUAGES[form](rows, name), ""]))


def _csv_row(reference_value: ReferenceValue) -> dict[str, str]:
    return values_csv_row(disk_of(reference_value.set).decimals(), reference_value)


def _test_file_row(reference_value: ReferenceValue) -> Row:
    row = _csv_row(reference_value)
    scale = scale_of(reference_value, Decimal(row["value_from_doubles"]))
    tolerance = max(float(scale) * 10 ** -digits_needed(reference_value), float(row["rounding"]))
    numbers = [*(float(row[name] or 0) for name in _INPUTS), reference_value.for_doubles, tolerance]
    return [row[name] for name in _TEXT_FIELDS], numbers


def _c(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"/* {_HEADER} */"
    yield "#ifndef TIPPEDISK_VALUE"
    yield "#define TIPPEDISK_VALUE"
    yield f"struct tippedisk_value {{ const char *{', *'.join(_TEXT_FIELDS)}; double {', '.join(_NUMBER_FIELDS)}; }};"
    yield "#endif"
    yield f"static const struct tippedisk_value {name}[{len(rows)}] = {{"
    for texts, numbers in rows:
        literals = [f'"{text}"' for text in texts] + [number.hex() for number in numbers]
        yield f"  {{{', '.join(literals)}}},"
    yield "};"


def _julia(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"# {_HEADER}"
    yield f"const {name} = ["
    yield from (f"  ({', '.join(map(' = '.join, _literals(row)))})," for row in rows)
    yield "]"


def _octave(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"% {_HEADER}"
    yield f"{name} = ["
    for row in rows:
        arguments = [f"'{field}', {value}" for field, value in _literals(row)]
        yield f"  struct({', '.join(arguments)})"
    yield "];"


def _literals(row: Row) -> Iterator[tuple[str, str]]:
    """Return pairs of a field's name and its value, written as a literal of a programming language,
    for a row of a test file.
    """
    texts, numbers = row
    return zip(
        (*_TEXT_FIELDS, *_NUMBER_FIELDS),
        [*(f'"{text}"' for text in texts), *map(repr, numbers)],
        strict=True,
    )


def _fortran(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"! {_HEADER}"
    yield f"module {name}"
    yield "  implicit none"
    yield "  type tippedisk_value"
    longest = max(len(text) for texts, _ in rows for text in texts)
    yield f"    character(len={longest}) :: {', '.join(_TEXT_FIELDS)}"
    yield f"    double precision :: {', '.join(_NUMBER_FIELDS)}"
    yield "  end type"
    yield f"  type(tippedisk_value) :: values({len(rows)})"
    for n, (texts, numbers) in enumerate(rows, start=1):
        yield f'  data values({n}) / tippedisk_value("{texts[0]}" &'
        yield from (f'    , "{text}" &' for text in texts[1:])
        yield from (f"    , {number:.16e} &".replace("e", "d") for number in numbers)
        yield "  ) /"
    yield "end module"


_LANGUAGES: dict[str, Callable[[Sequence[Row], str], Iterator[str]]] = {
    "c": _c,
    "fortran": _fortran,
    "julia": _julia,
    "octave": _octave,
}
FORMATS = ("csv", "jsonl", "parquet", *_LANGUAGES)
