"""The format of saved results: JSON files in which every number is exact.

A file is one object with these keys:

- ``format`` is `RESULT_FORMAT`, ``kind`` the class of the result, and ``tippedisk_verify`` the
  version of the package that wrote it.
- ``disk`` has the parameters [SI], the name and the friction law.
- The other keys are the result's own.

A number is a text: a decimal, or a ratio such as "1/3" if its decimals never end. Binary
floating-point numbers have all their digits. A number with a half-width is an object with ``value``
and ``uncertainty``. A half-width that was not measured is "infinite". A time that contains pi is an
object with ``rational`` and ``pi``, the multiple of pi.

An array of a solution is an object with ``arithmetic``, such as "double", "extended", "quadruple"
or "real200", and with ``numbers``, in lists of the array's shape. The numbers of ``t`` are the
exact times, which the array rounds to this arithmetic.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import Exact, exact, parse_long_fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.support.files import checked_file_path, file_path, read_text, write_text

__all__ = ["RESULT_FORMAT", "read_number", "read_saved", "saved_numbers", "write_saved"]

RESULT_FORMAT = "tippedisk-verify result 1"  #: the name and version of the form of these files
_MAX_FILE_BYTES = 2**30  # bytes; a file with a million samples is about half as large
_INFINITE = "infinite"


def saved_numbers(value: Any) -> Any:
    """Convert numbers to exact texts for a saved file, and lists and arrays to lists of these.

    None stays None.

    Args:
        value: A number of any kind, or a list or an array of numbers.

    Raises:
        InputError: If a number is not finite, other than an infinite half-width.
    """
    if value is None:
        return None
    if getattr(value, "ndim", 0) or (isinstance(value, Sequence) and not isinstance(value, str)):
        return [saved_numbers(entry) for entry in value]
    if isinstance(value, Measured):
        width = saved_numbers(value.uncertainty) if value.is_measured else _INFINITE
        return {"value": exact_text(value.value), "uncertainty": width}
    if value == math.inf:
        return _INFINITE
    parts = exact(value)
    if parts.pi_multiple:
        return {"rational": exact_text(parts.rational), "pi": exact_text(parts.pi_multiple)}
    return exact_text(parts.rational)


def read_number(entry: Any) -> Any:
    """Convert an entry of a saved file back to the number that was saved.

    Args:
        entry: The entry, as `saved_numbers` returns it for one number.

    Returns:
        An `Exact`, a `Measured` if the entry has a half-width, or infinity.
    """
    if isinstance(entry, Mapping) and "value" in entry:
        value, width = parse_long_fraction(entry["value"]), read_number(entry["uncertainty"])
        if width == math.inf:
            return Measured.without_half_width(value)
        return Measured(value, width.rational)
    if isinstance(entry, Mapping):
        return Exact(parse_long_fraction(entry["rational"]), parse_long_fraction(entry["pi"]))
    return math.inf if entry == _INFINITE else Exact(parse_long_fraction(entry))


def write_saved(
    path: str | PathLike[str], kind: str, disk: Parameters, entries: Mapping[str, Any]
) -> Path:
    """Save a result to a JSON file. A failure leaves no incomplete file.

    Args:
        path: The file; its name ends in ".json".
        kind: The class of the result.
        disk: The disk and its friction law.
        entries: The result's own keys, with values that JSON can hold.

    Returns:
        The path of the file written.

    Raises:
        InputError: If the friction law is a user's own, the name has another ending, or the file
            cannot be written.
    """
    from tippedisk_verify import __version__

    disk.refuse_custom_law("results can be saved")
    content = {
        "format": RESULT_FORMAT,
        "kind": kind,
        "tippedisk_verify": __version__,
        "disk": {**disk.exact_texts(), "name": disk.name, "friction": disk.friction},
        **entries,
    }
    return write_text(checked_file_path(path, ".json"), json.dumps(content, indent=1) + "\n")


def read_saved(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the content of a file that `write_saved` wrote.

    Args:
        path: The file.

    Raises:
        InputError: If the file cannot be read, or has another form.
    """
    file = file_path(path)
    text = read_text(file, _MAX_FILE_BYTES)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict) or content.get("format") != RESULT_FORMAT:
        raise InputError(f"{file.name} is not a file with the format '{RESULT_FORMAT}'")
    return content
