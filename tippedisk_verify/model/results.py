"""Results as they are shown: as plain data, which the commands print as JSON, in a few lines, and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from enum import Enum
from fractions import Fraction
from html import escape
from typing import Any, ClassVar

from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.quantities import heading

__all__ = ["Printable", "plain", "result_lines"]

_MOST_LINES, _WIDEST = 10, 100
_MOST_ENTRIES = 4  # of a list, before it is shown by its first and its last


class Printable:
    """What results have in common: they say themselves, each from the fields of its dataclass."""

    __slots__ = ()

    #: Fields that are not told: whose result it is, which the title says, and how it was found.
    untold: ClassVar[tuple[str, ...]] = ("parameters", "disk", "engine", "precision", "residuals")

    def to_dict(self) -> dict[str, Any]:
        """As plain data for JSON. A number with a half-width is a value and an uncertainty, both decimals as texts."""
        names = [item.name for item in fields(self) if not item.name.startswith("_")]  # type: ignore[arg-type]
        return {name: plain(getattr(self, name)) for name in names if name not in self.untold}

    def _title(self) -> str:
        disk = getattr(self, "parameters", getattr(self, "disk", None))
        parts = (getattr(self, name) for name in ("engine", "precision") if hasattr(self, name))
        made = [getattr(part, "name", part) for part in parts]
        whose = "" if disk is None else f" of {disk.name} ({', '.join([disk.friction, *made])})"
        return type(self).__name__ + whose

    def __repr__(self) -> str:
        lines = [self._title(), *result_lines(_brief(self.to_dict()), "  ")]
        if len(lines) > _MOST_LINES:
            lines[_MOST_LINES - 1 :] = [f"  and {len(lines) - _MOST_LINES + 1} more lines: to_dict() has everything"]
        # A number of many digits keeps its half-width, which is at its end.
        return "\n".join(line if len(line) <= _WIDEST else f"{line[: _WIDEST - 20]}…{line[-19:]}" for line in lines)

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        told = ((heading(name), _said(entry)) for name, entry in _brief(self.to_dict()).items())
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in told)
        return f"<table><caption>{escape(self._title())}</caption>{rows}</table>"


def plain(value: Any) -> Any:
    """Any part of a result as data for JSON: no finite number is None, one that is wider than a double is a text."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, tuple | list):
        return [plain(part) for part in value]
    if isinstance(value, Fraction):
        return Measured(value, Fraction(0)).to_dict()
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, int | str | None):
        return value
    listed = value.tolist() if hasattr(value, "tolist") else value.value if isinstance(value, Enum) else value
    return str(value) if type(listed) is type(value) else plain(listed)  # NumPy has no other name for a long double


def result_lines(entries: dict[str, Any], indent: str = "") -> Iterator[str]:
    """A line for each number and sentence of plain data; what consists of several goes below its name."""
    for name, value in entries.items():
        if value in (None, [], {}):
            continue
        if isinstance(value, dict) and not _measured(value):
            yield f"{indent}{heading(name)}:"
            yield from result_lines(value, indent + "  ")
        elif isinstance(value, list) and len(value) > 1:
            yield f"{indent}{heading(name)}:"
            yield from (f"{indent}  {_said(entry)}" for entry in value)
        else:
            yield f"{indent}{heading(name)}: {_said(value)}"


def _measured(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == {"value", "uncertainty"}


def _said(value: Any) -> str:
    if _measured(value):
        text, width = str(value["value"]), str(value["uncertainty"])
        return text if width == "0" else f"{text} ± {width}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_said(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return "; ".join(_said(entry) for entry in value)
    if isinstance(value, bool | None):
        return {True: "yes", False: "no", None: "unknown"}[value]
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _brief(value: Any) -> Any:
    """Plain data with its long lists cut down to their ends, and rows of a matrix beside each other."""
    if isinstance(value, dict):
        return {name: _brief(part) for name, part in value.items()}
    if not isinstance(value, list):
        return value
    if len(value) > _MOST_ENTRIES:
        return f"{len(value)}, from {_said(_brief(value[0]))} to {_said(_brief(value[-1]))}"
    shorter = [_brief(part) for part in value]
    return "; ".join(map(_said, shorter)) if any(isinstance(part, list) for part in value) else shorter
