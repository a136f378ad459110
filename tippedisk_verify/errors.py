"""The errors that the package raises. Each message names the fault and, where possible, a remedy."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = [
    "AccuracyError",
    "InputError",
    "NoConnectionError",
    "NoSuchCycleError",
    "UnknownKeywordError",
]


class InputError(ValueError):
    """Raised if an input cannot be used.

    ``faults`` holds one line for each fault. The command line prints them on one line and exits
    with status 2.

    Args:
        faults: One line, or one line for each fault.
    """

    def __init__(self, faults: str | Iterable[str]) -> None:
        self.faults: tuple[str, ...] = (faults,) if isinstance(faults, str) else tuple(faults)
        super().__init__("; ".join(self.faults))


class UnknownKeywordError(InputError, TypeError):
    """Raised if a function has no such keyword; the message names the alternatives."""


class AccuracyError(RuntimeError):
    """Raised if a computation ended without the digits that were asked for.

    The message gives the reason and a remedy. The command line prints it on one line and exits with
    status 1.
    """


class NoSuchCycleError(InputError):
    """Raised if the requested limit cycle does not exist, or was not found; the message gives the
    reason.
    """


class NoConnectionError(InputError):
    """Raised if the disk has no heteroclinic connection as requested; the message gives
    the reason.
    """
