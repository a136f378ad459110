"""Lines and tables for the terminal, and the rows of tables for files."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from typing import Any

from tippedisk_verify.model.equations import STATE_NAMES

__all__ = [
    "MOTION_COLUMNS",
    "break_line",
    "motion_rows",
    "table",
    "with_width_columns",
]

# Options of `textwrap.wrap` that break lines between words only.
_BETWEEN_WORDS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
#: The columns of a motion: the time [s] and the state [rad, rad, rad/s].
MOTION_COLUMNS = ("t", *STATE_NAMES)


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    """Yield the lines of a table with columns as wide as their cells.

    On a terminal that is too narrow, cells are broken between words.

    Args:
        headings: The column headings.
        rows: The cells of each row.
    """
    cells = [headings, *(list(map(str, row)) for row in rows)]
    columns = list(zip(*cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    least = [
        max(len(word) for cell in column for word in [*cell.split(), ""]) for column in columns
    ]
    while sum(widths) + 2 * len(widths) - 2 > _width() and widths != least:
        widest = max(range(len(widths)), key=lambda n: (widths[n] > least[n], widths[n]))
        widths[widest] -= 1
    for row in cells:
        parts = [
            textwrap.wrap(cell, width, **_BETWEEN_WORDS)
            for cell, width in zip(row, widths, strict=True)
        ]
        for line in zip_longest(*parts, fillvalue=""):
            yield "  ".join(
                f"{part:{width}}" for part, width in zip(line, widths, strict=True)
            ).rstrip()


def break_line(line: str) -> str:
    """Break a line that is longer than the terminal's between words, and indent what follows."""
    if len(line) <= (width := _width()):
        return line
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    return "\n".join(textwrap.wrap(line, width, subsequent_indent=indent, **_BETWEEN_WORDS))


def _width() -> int:
    """Return the number of characters in a line of the terminal; the lines of a file
    have no limit.
    """
    return shutil.get_terminal_size().columns if sys.stdout and sys.stdout.isatty() else sys.maxsize


def motion_rows(*columns: Sequence[Any]) -> list[dict[str, Any]]:
    """Convert the columns of a motion's table, as data for JSON, to rows: one for each time, by
    column name.
    """
    return [dict(zip(MOTION_COLUMNS, row, strict=True)) for row in zip(*columns, strict=True)]


def with_width_columns(rows: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """Return the rows of a table as texts, with each number's half-width in a column
    NAME_uncertainty of its own.

    An event's name is left out, because it is in the column ``event``.
    """
    lines = []
    for row in rows:
        texts = {
            name: entry for name, entry in row.items() if isinstance(entry, str) and name != "name"
        }
        numbers = {name: entry for name, entry in row.items() if isinstance(entry, dict)}
        widths = {f"{name}_uncertainty": entry["uncertainty"] for name, entry in numbers.items()}
        lines.append(texts | {name: entry["value"] for name, entry in numbers.items()} | widths)
    return lines
