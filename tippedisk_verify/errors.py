"""What can be wrong with a request, said in one line that tells what would be right."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["AccuracyError", "InputError", "NoConnectionError", "NoSuchCycleError", "UnknownKeywordError"]


class InputError(ValueError):
    """The input cannot be used. ``faults`` holds one clear line for each fault found.

    The command line prints them on one line and exits with status 2.
    """

    def __init__(self, faults: str | Iterable[str]) -> None:
        self.faults: tuple[str, ...] = (faults,) if isinstance(faults, str) else tuple(faults)
        super().__init__("; ".join(self.faults))


class UnknownKeywordError(InputError, TypeError):
    """A keyword that a function does not have; the message says what there is instead."""


class AccuracyError(RuntimeError):
    """A computation ended without the digits that were asked for; the message says why and what to try.

    The command line prints it on one line and exits with status 1.
    """


class NoSuchCycleError(InputError):
    """There is no limit cycle, or none was found, where one was asked for; the message says what and why."""


class NoConnectionError(InputError):
    """The parameters have no heteroclinic connection of the kind looked for; the message says why."""
