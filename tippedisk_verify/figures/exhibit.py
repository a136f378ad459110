"""An exhibit of the report: a figure, its data, and one line that explains it."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from tippedisk_verify.audit.citations import published_numbers
from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.display import column_heading
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.support.files import csv_text

__all__ = ["CSV", "MOTION_HEADER", "Drawing", "Exhibit", "by_curve", "draw_exhibit", "rounded_rows"]

#: The header, with units in brackets, and the rows.
CSV = tuple[Sequence[str], Sequence[Sequence[object]]]
#: The header of a motion in CSV: the time and the state.
MOTION_HEADER = tuple(map(column_heading, ("t", *STATE_NAMES)))
# The error of a double-precision orbit after a minute is smaller than the last decimal.
_CSV_DECIMALS = 10
_MEDIA = {"svg": "image/svg+xml", "webp": "image/webp"}


@dataclass(frozen=True)
class Drawing:
    """The result of drawing a figure of the report: the picture, its data and what to see in it."""

    figure: Callable[[int], Any]  #: draws it in a given number of columns
    columns: int  #: the number of columns on a wide page
    caption: str  #: what to see, in one line
    data: Mapping[str, CSV]  #: everything that is drawn, by file
    facts: dict[str, Any] = field(default_factory=dict)  #: further entries of results.json
    embedded: str = "svg"  #: format on the page: svg, or webp if an svg would have megabytes


@dataclass(frozen=True)
class Exhibit:
    """A figure of the audit's report, and the function that draws it."""

    draw: Callable[[Audit, Sequence[str]], Drawing]  #: takes the audit and the names of the claims
    name: str
    title: str
    alt_text: str  #: what the picture shows, for readers who cannot see it
    labels: str = ""  #: labels of the paper's figures that it redraws; empty for our own studies
    #: True if it measures run times, so that nothing else may run meanwhile
    runs_alone: bool = False
    packages: tuple[str, ...] = ()  #: further packages that it uses if they are installed
    cost: float = 0.0  #: time to draw it on one core [s], if that is three or more

    @property
    def source(self) -> str:
        """The published numbers of the paper's figures that this figure redraws, followed by their
        labels.
        """
        return f"{published_numbers(self.labels)}, {self.labels}" if self.labels else ""


def by_curve(header: Sequence[str], curves: Mapping[str, Sequence[Sequence[object]]]) -> CSV:
    """Put the rows of several curves into one CSV table, whose first column names the curve.

    Args:
        header: The names of the other columns.
        curves: The rows of each curve.
    """
    return ("curve", *header), [(name, *row) for name, rows in curves.items() for row in rows]


def rounded_rows(places: Any, *columns: Any) -> list[list[float]]:
    """Return the rows of a CSV table: times or points as they are, then rounded numbers.

    Args:
        places: An array (n,) or (n, k).
        *columns: Arrays (n,) or (n, k) of states and other numbers.
    """
    import numpy

    rounded = (column.round(_CSV_DECIMALS) for column in columns)
    return numpy.column_stack((places, *rounded)).tolist()  # type: ignore[no-any-return]


def draw_exhibit(exhibit: Exhibit, audit: Audit, examined: Sequence[str]) -> dict[str, Any]:
    """Draw a figure of the report and return the result as plain data.

    Args:
        exhibit: The figure.
        audit: The audit.
        examined: The names of the claims that it illustrates.

    Returns:
        Its ``entry`` in results.json, further ``facts``, its ``files``, and the pictures
        ``embedded`` in the page. If it cannot be drawn for these parameters, the entry has the
        reason under ``missing``.
    """
    entry: dict[str, Any] = {
        "name": exhibit.name,
        "title": exhibit.title,
        "source": exhibit.source,
        "alternative": exhibit.alt_text,
        "claims": list(examined),
    }
    try:
        drawing = exhibit.draw(audit, examined)
    except (AccuracyError, ArithmeticError, InputError) as reason:
        return {
            "entry": entry | {"missing": str(reason), "files": []},
            "facts": {},
            "files": {},
            "embedded": {},
        }
    from tippedisk_verify.figures.style import encode_figure, pyplot

    files: dict[str, bytes] = {}
    embedded: dict[str, dict[str, Any]] = {}
    for place, columns in {"wide": drawing.columns, "narrow": 1}.items():
        figure = drawing.figure(columns)
        if place == "wide":
            files = {
                f"{exhibit.name}.{kind}": encode_figure(figure, kind) for kind in ("png", "svg")
            }
        picture = files.get(f"{exhibit.name}.{drawing.embedded}") if place == "wide" else None
        width, height = figure.get_size_inches()
        embedded[place] = {
            "kind": _MEDIA[drawing.embedded],
            "content": b64encode(picture or encode_figure(figure, drawing.embedded)).decode(),
            "width": round(96 * width),
            "height": round(96 * height),
        }
        pyplot().close(figure)
    files |= {
        name: csv_text(header, rows).encode() for name, (header, rows) in drawing.data.items()
    }
    entry |= {"reading": drawing.caption, "files": list(files)}
    texts = {name: b64encode(content).decode() for name, content in files.items()}
    return {"entry": entry, "facts": drawing.facts, "files": texts, "embedded": embedded}
