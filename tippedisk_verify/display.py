"""The display of results: data for JSON, lines with units, tables, and fields with their meaning."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from fractions import Fraction
from html import escape
from typing import Any, ClassVar, NamedTuple

from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.decimals import exact_decimals
from tippedisk_verify.numbers.exact import fraction, plain_number
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors_in_methods

__all__ = [
    "COORDINATES",
    "Eigenvalue",
    "Printable",
    "QuantityMeaning",
    "as_json",
    "column_heading",
    "data_frame",
    "half_width_in_double",
    "numbers_as_json",
    "quantities",
    "quantity",
    "result_lines",
]

_MAX_REPR_LINES = 10
_MAX_REPR_WIDTH = 100  # characters
_MAX_EXACT_LENGTH = 24  # characters of an exact number
_MAX_NUMBERS_PER_LINE = 5  # an entry of a list with more numbers has a line for each


class QuantityMeaning(NamedTuple):
    """The unit of a quantity in a result, and its meaning in words."""

    unit: str  #: "1" for a pure number, "SI" for a unit that depends on a normalisation
    meaning: str


#: Quantities that results list without a field of that name: the speed, the coordinates, the time
#: and functions of these alone.
COORDINATES = {
    "omega": QuantityMeaning("rad/s", "Omega, the spinning speed"),
    "Omega": QuantityMeaning("rad/s", "the spinning speed"),
    "t": QuantityMeaning("s", "the time"),
    "beta": QuantityMeaning("rad", "the disk's inclination"),
    "gamma": QuantityMeaning("rad", "the angle of the centre of mass in the disk's plane"),
    "v": QuantityMeaning("rad/s", "beta'"),
    "margin": QuantityMeaning(
        "rad", "distance in beta from the boundary of the basins; above 0 the disk keeps standing"
    ),
}
_UNITLESS = ("1", "SI")  # not printed
# The unit of each name; one name has one unit in all results.
_UNITS = {name: coordinate.unit for name, coordinate in COORDINATES.items()}


def quantity(meaning: str, unit: str) -> dict[str, QuantityMeaning]:
    """Return the metadata for a dataclass field that holds a number: its meaning and unit.

    Help texts, printed tables and the web pages read them from the field.

    Args:
        meaning: The quantity in words.
        unit: Its unit; "1" for a pure number.
    """
    return {"quantity": QuantityMeaning(unit, meaning)}


def quantities(kind: type) -> dict[str, QuantityMeaning]:
    """Return the quantities that results of a class have, with their units and meanings, by name.

    Args:
        kind: The class.
    """
    return {
        item.name: item.metadata["quantity"] for item in fields(kind) if "quantity" in item.metadata
    }


class Printable:
    """The base class of all results: each prints itself from the fields of its dataclass."""

    __slots__ = ()

    # The entries that are listed, all fields if empty; the entries that come first; the entries
    # that are left out, because they hold the disk or the method.
    _listed: ClassVar[tuple[str, ...]] = ()
    _first: ClassVar[tuple[str, ...]] = ()
    _omitted: ClassVar[tuple[str, ...]] = ("parameters", "disk", "engine", "precision", "residuals")

    # A longer list is printed by its first and its last entry.
    _max_list_entries: ClassVar[int] = 4

    # True for a class whose methods do not use NumPy, so that it is not loaded for them.
    _without_numpy: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        known = (
            (name, getattr(item, "metadata", {}).get("quantity"))
            for name, item in vars(cls).items()
        )
        _UNITS.update(
            (name, item.unit) for name, item in known if item and item.unit not in _UNITLESS
        )
        if not vars(cls).get("_without_numpy"):
            ignore_numpy_errors_in_methods(cls)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data for JSON.

        A number with a half-width is a value and an uncertainty, both decimals as texts.
        """
        names = self._listed or [item.name for item in fields(self) if item.name[0] != "_"]  # type: ignore[arg-type]
        ordered = dict.fromkeys((*self._first, *names))
        return {name: as_json(getattr(self, name)) for name in ordered if name not in self._omitted}

    def _title(self) -> str:
        disk = getattr(self, "parameters", getattr(self, "disk", None))
        tools = (getattr(self, name) for name in ("engine", "precision") if hasattr(self, name))
        made = [getattr(tool, "name", tool) for tool in tools]
        whose = "" if disk is None else f" of {disk.name} ({', '.join([disk.law.name, *made])})"
        return type(self).__name__ + whose

    def __str__(self) -> str:
        return "\n".join([self._title(), *result_lines(self._brief(), "  ")])

    def _brief(self) -> dict[str, Any]:
        entries = self.to_dict().items()
        return {name: _brief(entry, self._max_list_entries) for name, entry in entries}

    def __repr__(self) -> str:
        lines = str(self).splitlines()
        if len(lines) > _MAX_REPR_LINES + 1:  # a cut of one line would save nothing
            lines[_MAX_REPR_LINES - 1 :] = [
                f"  and {len(lines) - _MAX_REPR_LINES + 1} more lines: print shows them"
            ]
        # A number of many digits keeps its half-width, which is at its end.
        return "\n".join(
            line if len(line) <= _MAX_REPR_WIDTH else f"{line[: _MAX_REPR_WIDTH - 20]}…{line[-19:]}"
            for line in lines
        )

    def _repr_html_(self) -> str:
        """Return the result as an HTML table for notebooks."""
        cells = ((column_heading(name), _cell(entry)) for name, entry in self._brief().items())
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in cells
        )
        return f"<table><caption>{escape(self._title())}</caption>{rows}</table>"


@dataclass(frozen=True, repr=False)
class Eigenvalue(Printable):
    """One eigenvalue [1/s]: a complex number, each part with the half-width that holds it.

    A real eigenvalue's imaginary part is 0 exactly. ``complex`` and `numpy.array` take the values.
    """

    re: Measured
    im: Measured

    @property
    def real(self) -> Measured:
        """The real part, `re`, under NumPy's name."""
        return self.re

    @property
    def imag(self) -> Measured:
        """The imaginary part, `im`."""
        return self.im

    def __complex__(self) -> complex:
        return complex(self.re, self.im)

    def __abs__(self) -> Measured:
        return (self.re**2 + self.im**2).sqrt()

    def __str__(self) -> str:
        imaginary = self.im.value or self.im.uncertainty
        return f"({self.re}) + ({self.im}) i" if imaginary else str(self.re)

    def __repr__(self) -> str:
        return f"Eigenvalue({self})"


def as_json(value: Any) -> Any:
    """Convert a result, or an entry of one, to data for JSON.

    An infinity or NaN becomes None, and a number wider than a double becomes a text.

    Args:
        value: A result, a number, a text, or mappings and sequences of these.

    Returns:
        Dicts, lists, texts, numbers, truth values and None.
    """
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(name): as_json(entry) for name, entry in value.items()}
    if isinstance(value, tuple | list):
        return [as_json(entry) for entry in value]
    if isinstance(value, Fraction):
        return Measured(value, Fraction(0)).to_dict()
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, int | str | None):
        return value
    bare = (
        value.tolist()
        if hasattr(value, "tolist")
        else value.value
        if isinstance(value, Enum)
        else value
    )
    # tolist() leaves NumPy's long double as it is
    return str(value) if type(bare) is type(value) else as_json(bare)


def numbers_as_json(values: Any, widths: Any) -> Any:
    """Convert numbers and their half-widths to data for JSON, in lists of the arrays' shape.

    Args:
        values: A number or an array.
        widths: The half-widths, of the same shape.

    Returns:
        Lists of the arrays' shape, with a value and an uncertainty as texts for each number. The
        uncertainty is None if the half-width is infinite.
    """
    if hasattr(values, "__len__"):
        return [numbers_as_json(*pair) for pair in zip(values, widths, strict=True)]
    # str() of NumPy's numbers depends on the caller's print options
    if not math.isfinite(widths):
        number = plain_number(values)
        text = repr(number) if isinstance(number, float) else exact_decimals(fraction(number))[0]
        return {"value": text, "uncertainty": None}
    return Measured.of(values, float(widths)).to_dict()


def half_width_in_double(number: Measured) -> float:
    """Return the half-width of a number after its value has been rounded to a double.

    It includes the rounding of the value and is itself rounded up, to a double.

    Args:
        number: A number with a half-width; without one, the result is infinite.
    """
    if not number.is_measured:
        return math.inf
    width = number.uncertainty + abs(number.value - Fraction(float(number)))
    return math.nextafter(float(width), math.inf) if width else 0.0


def data_frame(table: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> Any:
    """Return a table as a pandas data frame.

    A number with a half-width in a row becomes two columns of doubles, NAME and NAME_uncertainty.
    The half-width includes the rounding to a double. Missing cells are NaN.

    Args:
        table: The columns by name, or the rows.

    Raises:
        InputError: If pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("a data frame needs pandas: pip install pandas") from None
    if isinstance(table, Mapping):
        return pandas.DataFrame(table)
    return pandas.DataFrame([dict(_cells_in_doubles(row)) for row in table])


def _cells_in_doubles(row: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, cell in row.items():
        if isinstance(cell, Measured):
            yield name, float(cell)
            yield f"{name}_uncertainty", half_width_in_double(cell)
        else:
            yield name, cell


def column_heading(name: str) -> str:
    """Return a quantity's name, followed by its unit in brackets if it has one.

    Args:
        name: The quantity's name.
    """
    unit = _UNITS.get(name)
    return f"{name} [{unit}]" if unit else name


def result_lines(entries: dict[str, Any], indent: str = "") -> Iterator[str]:
    """Yield the lines in which a result is printed: one for each number and sentence in its data.

    The parts of a compound entry follow below its name.

    Args:
        entries: The data by name.
        indent: The text before each line.
    """
    for name, value in entries.items():
        if value in (None, {}):
            continue
        if isinstance(value, list) and any(
            isinstance(entry, dict) and len(entry) > _MAX_NUMBERS_PER_LINE for entry in value
        ):
            for number, entry in enumerate(value, 1):
                yield from result_lines({f"{name} {number}": entry}, indent)
        elif isinstance(value, dict) and not _measured(value):
            yield f"{indent}{column_heading(name)}:"
            yield from result_lines(value, indent + "  ")
        elif isinstance(value, list) and len(value) > 1:
            yield f"{indent}{column_heading(name)}:"
            yield from (f"{indent}  {_cell(entry)}" for entry in value)
        else:
            yield f"{indent}{column_heading(name)}: {_cell(value)}"


def _measured(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == {"value", "uncertainty"}


def _cell(value: Any) -> str:
    if _measured(value):
        text, width = str(value["value"]), value["uncertainty"]
        if width is None:
            return f"{text} (no half-width)"
        return text if width == "0" else f"{text} ± {width}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_cell(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return "; ".join(_cell(entry) for entry in value) or "none"
    if isinstance(value, bool | None):
        return {True: "yes", False: "no", None: "unknown"}[value]
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _brief(value: Any, longest: int) -> Any:
    """Shorten a result, as data for JSON, for display.

    A list of more than ``longest`` entries becomes a text with its length, first and last entry.
    Each row of a matrix becomes one text. Exact numbers lose their later digits.
    """
    if _measured(value) and value["uncertainty"] == "0" and len(value["value"]) > _MAX_EXACT_LENGTH:
        return f"{value['value'][:_MAX_EXACT_LENGTH]}…"  # a double has up to 50 digits
    if isinstance(value, dict):
        return {name: _brief(entry, longest) for name, entry in value.items()}
    if not isinstance(value, list):
        return value
    if len(value) > longest:
        return f"{len(value)}, from {_cell(_brief(value[0], longest))} to {_cell(_brief(value[-1], longest))}"
    shorter = [_brief(entry, longest) for entry in value]
    if not any(isinstance(entry, list) for entry in shorter):
        return shorter
    return [
        ", ".join(map(_cell, entry)) if isinstance(entry, list) else _cell(entry)
        for entry in shorter
    ]
