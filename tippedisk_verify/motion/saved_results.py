"""`Solution.save` and `tv.load`: saved results (JSON, not tables).

`motion` is the lowest package that knows both motions and limit cycles.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy

from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle
from tippedisk_verify.display import quantities
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import EventRecord, Status
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.result_format import read_number, read_saved, saved_numbers, write_saved
from tippedisk_verify.motion.solution import Derivative, Solution
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    EXTENDED,
    precision_named,
    precision_of,
)

__all__ = ["load", "save_solution"]

_CYCLES: dict[str, type[LimitCycle | RotatingCycle]] = {
    kind.__name__: kind for kind in (LimitCycle, RotatingCycle)
}
_ARRAYS = (
    *("y", "uncertainty", "transition", "transition_uncertainty"),
    *("by_omega", "by_omega_uncertainty"),
)
_TEXTS = ("engine", "precision", "note")
_RECORD = ("time", "state", "time_uncertainty", "uncertainty")


def save_solution(solution: Solution, path: str | PathLike[str]) -> Path:
    """Save a motion to a file; see `Solution.save`."""
    entries = {
        "status": solution.status.name.lower(),
        **{name: getattr(solution, name) for name in _TEXTS},
        "omega": saved_numbers(solution.omega),
        "t": _entry(solution.t, solution.times),
        **{name: _entry(getattr(solution, name)) for name in _ARRAYS},
        "by": {
            variable: {name: _entry(array) for name, array in derivative._asdict().items()}
            for variable, derivative in solution.by.items()
        },
        "end": _record_entry(solution.end),
        "events": [_record_entry(record) for record in solution.events],
        "watched": list(solution._event_names),
        "span": saved_numbers([solution._start, solution._end_time]),
    }
    return write_saved(path, Solution.__name__, solution.disk, entries)


def _entry(values: Any, exact: Any = None) -> dict[str, Any] | None:
    """Convert a number or an array to data for a saved file: its exact numbers, and its
    arithmetic's name.

    ``exact``, if given, holds the numbers before they were rounded to ``values``; it is written
    instead. None stays None.
    """
    if values is None:
        return None
    first = next(iter(values.flat), 0.0) if hasattr(values, "flat") else values
    numbers = saved_numbers(values if exact is None else exact)
    return {"arithmetic": precision_of(first).name, "numbers": numbers}


def _record_entry(record: EventRecord) -> dict[str, Any]:
    return {"name": record.name} | {name: _entry(getattr(record, name)) for name in _RECORD}


@ignore_numpy_errors()
def load(path: str | PathLike[str]) -> Solution | LimitCycle | RotatingCycle:
    """Return a result that ``solution.save(path)`` or ``cycle.save(path)`` has written.

    All its numbers, half-widths included, equal those of the saved one.

    Args:
        path: The file.

    Raises:
        InputError: If the file cannot be read, or does not hold a saved result.
    """
    content = read_saved(path)
    try:
        disk = Parameters(**content["disk"])
        if content["kind"] == Solution.__name__:
            return _solution(disk, content)
        return _cycle(_CYCLES[content["kind"]], disk, content)
    except (KeyError, TypeError, ValueError, ArithmeticError, AttributeError) as fault:
        reason = f"{type(fault).__name__}: {fault}"
        raise InputError(
            f"{Path(path).name} is damaged, or not a saved result: {reason[:120]}"
        ) from None


def _cycle(
    kind: type[LimitCycle | RotatingCycle], disk: Parameters, entries: dict[str, Any]
) -> LimitCycle | RotatingCycle:
    numbers: dict[str, Any] = {name: read_number(entries[name]) for name in quantities(kind)}
    return kind(
        **numbers,
        stable=entries["stable"],
        residuals=tuple(float(read_number(residual)) for residual in entries["residuals"]),
        parameters=disk,
        engine=entries["engine"],
        precision=entries["precision"],
    )


def _solution(disk: Parameters, entries: dict[str, Any]) -> Solution:
    first, last = map(read_number, entries["span"])
    return Solution(
        disk=disk,
        omega=read_number(entries["omega"]),
        status=Status[entries["status"].upper()],
        end=_record(entries["end"]),
        events=tuple(map(_record, entries["events"])),
        times=tuple(map(read_number, entries["t"]["numbers"])),
        **{name: _values(entries[name]) for name in ("t", *_ARRAYS)},
        **{name: entries[name] for name in _TEXTS},
        by={
            variable: Derivative(**{name: _values(entry) for name, entry in derivative.items()})
            for variable, derivative in entries["by"].items()
        },
        _event_names=tuple(entries["watched"]),
        _start=first,
        _end_time=last,
        _request=None,
        _engine=None,
    )


def _values(entry: dict[str, Any] | None) -> Any:
    """Convert an entry of a saved file back to a number or an array; beyond extended numbers, to an
    array of objects.
    """
    if entry is None:
        return None
    precision = precision_named(entry["arithmetic"])
    texts = numpy.array(entry["numbers"], object)
    exact = (read_number(text) for text in texts.flat)
    values = [value if value == math.inf else precision.number(value) for value in exact]
    if not texts.ndim:
        return values[0]
    kind = precision.number_type if precision in (DOUBLE, EXTENDED) else object
    return numpy.array(values, kind).reshape(texts.shape)


def _record(entry: dict[str, Any]) -> EventRecord:
    return EventRecord(entry["name"], *(_values(entry[name]) for name in _RECORD))
