"""An exhibit of the report: a figure with its data, what it shows, and one line that reads it."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from tippedisk_verify.audit.citations import cited
from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.files import csv_text

__all__ = ["CSV", "Drawing", "Exhibit", "by_curve", "drawn"]

CSV = tuple[Sequence[str], Sequence[Sequence[object]]]  #: header, with the unit of each number in brackets, and rows
_MEDIA = {"svg": "image/svg+xml", "webp": "image/webp"}


@dataclass(frozen=True)
class Drawing:
    """What an exhibit came to."""

    figure: Callable[[int], Any]  #: draws it in so many columns
    columns: int  #: where there is room
    reading: str  #: what to see, in one line
    data: Mapping[str, CSV]  #: by file: all that is drawn
    facts: dict[str, Any] = field(default_factory=dict)  #: more for results.json
    embedded: str = "svg"  #: the form that the page holds: svg, or webp where an svg would be megabytes


@dataclass(frozen=True)
class Exhibit:
    """One figure of the report."""

    draw: Callable[[Audit, Sequence[str]], Drawing]  #: from the audit and the names of the claims examined
    name: str
    title: str
    alternative: str  #: what the picture shows, for those who cannot see it
    labels: str = ""  #: of the paper's figures that it redraws; empty for a study of our own
    alone: bool = False  #: measures run times, so nothing else should run beside it
    packages: tuple[str, ...] = ()  #: that it uses beside those of all figures, if they are installed
    cost: float = 0.0  #: what drawing it takes alone on one core [s], where that is three or more

    @property
    def source(self) -> str:
        """The figures of the paper that it redraws, by their published numbers with the labels behind."""
        return f"{cited(self.labels)}, {self.labels}" if self.labels else ""


def by_curve(header: Sequence[str], curves: Mapping[str, Sequence[Sequence[object]]]) -> CSV:
    """Several curves in one file: the first column names the curve."""
    return ("curve", *header), [(name, *row) for name, rows in curves.items() for row in rows]


def drawn(exhibit: Exhibit, audit: Audit, examined: Sequence[str]) -> dict[str, Any]:
    """The exhibit as plain data: what results.json says of it, its files, and what the page embeds.

    A figure that cannot be had for these parameters says why under ``missing``.
    """
    entry: dict[str, Any] = {name: getattr(exhibit, name) for name in ("name", "title", "source", "alternative")}
    entry["claims"] = list(examined)
    try:
        drawing = exhibit.draw(audit, examined)
    except (AccuracyError, ArithmeticError, InputError) as reason:
        return {"entry": entry | {"missing": str(reason), "files": []}, "facts": {}, "files": {}, "embedded": {}}
    from tippedisk_verify.figures.style import encoded, pyplot

    files: dict[str, bytes] = {}
    embedded: dict[str, dict[str, Any]] = {}
    for place, columns in {"wide": drawing.columns, "narrow": 1}.items():
        figure = drawing.figure(columns)
        if place == "wide":
            files = {f"{exhibit.name}.{kind}": encoded(figure, kind) for kind in ("png", "svg")}
        picture = files.get(f"{exhibit.name}.{drawing.embedded}") if place == "wide" else None
        width, height = figure.get_size_inches()
        embedded[place] = {
            "kind": _MEDIA[drawing.embedded],
            "content": b64encode(picture or encoded(figure, drawing.embedded)).decode(),
            "width": round(96 * width),
            "height": round(96 * height),
        }
        pyplot().close(figure)
    files |= {name: csv_text(header, rows).encode() for name, (header, rows) in drawing.data.items()}
    entry |= {"reading": drawing.reading, "files": list(files)}
    texts = {name: b64encode(content).decode() for name, content in files.items()}
    return {"entry": entry, "facts": drawing.facts, "files": texts, "embedded": embedded}
