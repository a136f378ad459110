"""An exhibit of the report: a figure with its tables, what it shows, and one line that reads it."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.files import csv_text
from tippedisk_verify.model.results import Printable

__all__ = ["Drawing", "Exhibit", "Table", "drawn"]


@dataclass(frozen=True, repr=False)
class Table(Printable):
    """Rows that the report prints: each cell a number with all its digits, and as it is shown."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    shown: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, caption: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 3) -> Table:
        """Floats are shown with so many significant digits, None as an empty cell."""
        shown = tuple(tuple(_cell(value, digits) for value in row) for row in rows)
        return cls(caption, tuple(columns), tuple(map(tuple, rows)), shown)


def _cell(value: Any, digits: int) -> str:
    if value is None:
        return ""
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Drawing:
    """What an exhibit came to."""

    figure: Callable[[int], Any]  #: draws it in so many columns
    columns: int  #: where there is room
    reading: str  #: what to see, in one line
    data: Mapping[
        str, tuple[Sequence[str], Sequence[Sequence[object]]]
    ]  #: CSV file: header and rows, all that is drawn
    tables: tuple[Table, ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)  #: more for results.json
    embedded: str = "svg"  #: the form that the page holds: svg, or webp where an svg would be megabytes


@dataclass(frozen=True)
class Exhibit:
    """One figure of the report."""

    name: str
    title: str
    source: str  #: which figure of the paper it redraws; empty for a study of our own
    alternative: str  #: what the picture shows, for those who cannot see it
    draw: Callable[[Audit, Sequence[str]], Drawing]  #: from the audit and the names of the claims examined
    laws: tuple[str, ...] = ("linear", "smooth")  #: friction laws that it is for
    alone: bool = False  #: measures run times, so nothing else should run beside it
    cost: float = 0.0  #: what drawing it takes alone on one core [s], where that is three or more


def drawn(exhibit: Exhibit, audit: Audit, examined: Sequence[str]) -> dict[str, Any]:
    """The exhibit as plain data: what results.json says of it, its files, and what the page embeds.

    A figure that cannot be had for these parameters says why under ``missing``.
    """
    entry: dict[str, Any] = {
        "name": exhibit.name,
        "title": exhibit.title,
        "source": exhibit.source,
        "alternative": exhibit.alternative,
    }
    try:
        drawing = exhibit.draw(audit, examined)
    except (Shortfall, ArithmeticError, InputError) as reason:
        return {"entry": entry | {"missing": str(reason), "files": []}, "facts": {}, "files": {}, "embedded": {}}
    from tippedisk_verify.figures.style import encoded, pyplot

    files: dict[str, str] = {}
    embedded: dict[str, dict[str, Any]] = {}
    for place, columns in (("wide", drawing.columns), ("narrow", 1)):
        if place == "narrow" and drawing.columns == 1:
            continue
        figure = drawing.figure(columns)
        if place == "wide":
            files |= {f"{exhibit.name}.{kind}": _text(encoded(figure, kind)) for kind in ("png", "svg")}
        width, height = figure.get_size_inches()
        embedded[place] = {
            "kind": {"svg": "image/svg+xml", "webp": "image/webp"}[drawing.embedded],
            "content": _text(encoded(figure, drawing.embedded)),
            "width": round(96 * width),
            "height": round(96 * height),
        }
        pyplot().close(figure)
    files |= {name: _text(csv_text(header, rows).encode()) for name, (header, rows) in drawing.data.items()}
    entry |= {
        "reading": drawing.reading,
        "files": list(files),
        "tables": [table.to_dict() for table in drawing.tables],
    }
    return {"entry": entry, "facts": drawing.facts, "files": files, "embedded": embedded}


def _text(content: bytes) -> str:
    return b64encode(content).decode()
