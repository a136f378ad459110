"""The list of all cases, and functions to choose and run them."""

from __future__ import annotations

from tippedisk_verify.errors import InputError
from tippedisk_verify.stress import cycle_cases, motion_cases
from tippedisk_verify.stress.case import StressCase, StressResult

__all__ = ["CASES", "cases_named", "run_stress_case"]

CASES: tuple[StressCase, ...] = (*motion_cases.CASES, *cycle_cases.CASES)
_BY_NAME = {case.name: case for case in CASES}


def cases_named(names: tuple[str, ...], quick: bool = False) -> list[StressCase]:
    """Return the cases with these names, or all cases if there are no names.

    Args:
        names: The names of cases.
        quick: True to leave out cases that take more than some seconds.

    Raises:
        InputError: If no case has one of the names.
    """
    for name in names:
        if name not in _BY_NAME:
            raise InputError(f"case '{name[:40]}' is not known: `stress --list` names them all")
    chosen = [_BY_NAME[name] for name in dict.fromkeys(names)] or list(CASES)
    return [case for case in chosen if case.quick or not quick]


def run_stress_case(name: str) -> StressResult:
    """Run the stress case with this name and return its result. A name, unlike a case, can be sent
    to another process.
    """
    return StressResult.from_case(_BY_NAME[name])
