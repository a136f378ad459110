"""Reference values in other forms: tables, JSON, and test files in C, Fortran, Julia and Octave."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from pathlib import Path

from tippedisk_verify.errors import InputError
from tippedisk_verify.files import file_ending_in, output_file, write_table, write_text
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.draws import disk_of
from tippedisk_verify.reference_values.questions import needed, scale_of, table_row
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["FORMATS", "export"]

_TEXTS = ("id", "set", "kind", "friction", "quantity", "unit", "equilibrium", "form")
_INPUTS = (*SYMBOLS, "Omega", "beta", "gamma", "v", "t", "n", "order")
_FIELDS = (*_INPUTS, "value", "tolerance")
_SAYS = (
    "Reference values of the tippedisk; a good answer in doubles is off by `tolerance` at most. 0 where no input is."
)
_LONGEST = 63  # characters of a name, in Fortran and in MATLAB
Row = tuple[list[str], list[float]]  #: for each of `_TEXTS` and each of `_FIELDS`


def export(quantities: Sequence[Quantity], form: str, path: str) -> Path:
    """Write these values to a file. A test file has the values from doubles, and how far an answer may be off.

    The array, in Fortran the module, is named after the file: tippedisk_hopf in hopf.h.
    Raises InputError if the file cannot be written, the form is not known, or a test file would have no value.
    """
    if form not in FORMATS:
        raise InputError(f"a form is one of {', '.join(FORMATS)}, not '{form[:40]}'")
    if form in ("csv", "parquet"):
        return write_table(file_ending_in(path, f".{form}"), [_row(one) for one in quantities])
    file = output_file(path)
    if form == "jsonl":
        return write_text(file, "".join(f"{json.dumps(one.to_dict(), ensure_ascii=False)}\n" for one in quantities))
    rows = [_fields(one) for one in quantities if "doubles" in one.values]
    if not rows:
        raise InputError("doubles cannot tell the inputs of these apart: a test file would have no value")
    name = re.sub(r"\W", "_", f"tippedisk_{file.stem}", flags=re.ASCII)[:_LONGEST]
    return write_text(file, "\n".join([*_LANGUAGES[form](rows, name), ""]))


def _row(quantity: Quantity) -> dict[str, str]:
    return table_row(disk_of(quantity.set).decimals(), quantity)


def _fields(quantity: Quantity) -> Row:
    row = _row(quantity)
    scale = scale_of(quantity, Decimal(row["value_from_doubles"]))
    tolerance = max(float(scale) * 10 ** -needed(quantity), float(row["rounding"]))
    numbers = [*(float(row[name] or 0) for name in _INPUTS), quantity.for_doubles, tolerance]
    return [row[name] for name in _TEXTS], numbers


def _c(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"/* {_SAYS} */"
    yield "#ifndef TIPPEDISK_VALUE"
    yield "#define TIPPEDISK_VALUE"
    yield f"struct tippedisk_value {{ const char *{', *'.join(_TEXTS)}; double {', '.join(_FIELDS)}; }};"
    yield "#endif"
    yield f"static const struct tippedisk_value {name}[{len(rows)}] = {{"
    for texts, numbers in rows:
        told = [f'"{text}"' for text in texts] + [number.hex() for number in numbers]
        yield f"  {{{', '.join(told)}}},"
    yield "};"


def _julia(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"# {_SAYS}"
    yield f"const {name} = ["
    yield from (f"  ({', '.join(map(' = '.join, _told(row)))})," for row in rows)
    yield "]"


def _octave(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"% {_SAYS}"
    yield f"{name} = ["
    for row in rows:
        told = [f"'{field}', {value}" for field, value in _told(row)]
        yield f"  struct({', '.join(told)})"
    yield "];"


def _told(row: Row) -> Iterator[tuple[str, str]]:
    """Each field of a value, and what it is."""
    texts, numbers = row
    return zip((*_TEXTS, *_FIELDS), [*(f'"{text}"' for text in texts), *map(repr, numbers)], strict=True)


def _fortran(rows: Sequence[Row], name: str) -> Iterator[str]:
    yield f"! {_SAYS}"
    yield f"module {name}"
    yield "  implicit none"
    yield "  type tippedisk_value"
    longest = max(len(text) for texts, _ in rows for text in texts)
    yield f"    character(len={longest}) :: {', '.join(_TEXTS)}"
    yield f"    double precision :: {', '.join(_FIELDS)}"
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
