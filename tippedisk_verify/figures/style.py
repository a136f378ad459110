"""The style that all figures share, and their encoding as files."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

from tippedisk_verify.support.files import write_bytes

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "PURPLE",
    "RED",
    "SKY",
    "encode_figure",
    "figure_with_axes",
    "pyplot",
    "save",
]

#: Okabe and Ito's palette: distinct for all colour vision, and of different lightness in grey.
BLUE, SKY, ORANGE, GREEN, RED, PURPLE, BLACK = (
    "#0072B2",
    "#56B4E9",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#000000",
)
GREY = "#B0B0B0"

_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.3,
    "grid.alpha": 0.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.0,
    "lines.solid_joinstyle": "round",
    "savefig.dpi": 160,
    "svg.hashsalt": "tippedisk",  # the same picture gives the same file
    "figure.facecolor": "white",
}


def pyplot() -> Any:
    """Return Matplotlib's pyplot, set up to draw without a screen and in the style of
    all figures.
    """
    import matplotlib

    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    for key, value in _STYLE.items():
        plt.rcParams[key] = value
    return plt


def figure_with_axes(
    count: int, columns: int, size: tuple[float, float], below: float = 0.0, **subplot: Any
) -> tuple[Any, list[Any]]:
    """Make a figure with several axes.

    Args:
        count: The number of axes.
        columns: The largest number of columns.
        size: The width and height of each of the axes [inches].
        below: Height for a legend below them [inches].
        **subplot: Options of `add_subplot`.

    Returns:
        The figure and its axes.
    """
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    figure = pyplot().figure(
        figsize=(size[0] * columns, size[1] * rows + below), layout="constrained"
    )
    return figure, [
        figure.add_subplot(rows, columns, index + 1, **subplot) for index in range(count)
    ]


def encode_figure(figure: Any, kind: str) -> bytes:
    """Return a figure as the bytes of an image file, and leave it open.

    Args:
        figure: The figure.
        kind: png, svg or webp.
    """
    stream = io.BytesIO()
    options: dict[str, dict[str, Any]] = {
        "png": {},
        "svg": {"metadata": {"Date": None}},
        "webp": {"pil_kwargs": {"quality": 85, "method": 4}},
    }
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "log":
                axis.set_major_formatter(_power_of_ten)
    figure.savefig(stream, format=kind, **options[kind])
    # All formats share the layout; computing it takes a third of the time.
    figure.set_layout_engine("none")
    return stream.getvalue()


def _power_of_ten(value: float, place: int | None = None) -> str:
    """Return the label of a value on a logarithmic axis, as plain text such as 10⁻³.

    Matplotlib's own labels are formulas, and parsing them takes half the time of a figure.
    """
    exponent = round(math.log10(value)) if value > 0 else 0
    power = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{power}" if math.isclose(value, 10.0**exponent) else f"{value:g}"


def save(figure: Any, folder: Path, name: str) -> list[Path]:
    """Write ``name.png`` and ``name.svg`` into ``folder``, and close the figure.

    Returns:
        The paths.

    Raises:
        InputError: If a file cannot be written.
    """
    written = [
        write_bytes(folder / f"{name}.{kind}", encode_figure(figure, kind))
        for kind in ("png", "svg")
    ]
    pyplot().close(figure)
    return written
