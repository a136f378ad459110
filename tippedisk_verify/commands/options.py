"""The options that several commands take, and the checks of options' texts."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Any

import click

from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import checked_file_path, output_file, sole_writer

__all__ = [
    "below_crit_option",
    "certificate_option",
    "combined_options",
    "decimal_callback",
    "half_widths_option",
    "levels_callback",
    "lock_output_folder",
    "omega_option",
    "option_callback",
    "output_file_callback",
    "rotating_option",
    "unstable_option",
]

Check = Callable[[click.Context, click.Parameter, Any], Any]  #: click's callback of an option


def option_callback(check: Callable[[Any], Any]) -> Check:
    """Return a callback for click that replaces an option's text by ``check(text)``; None stays
    None.

    Args:
        check: A function of the text, which raises InputError for a bad value.
    """
    return lambda context, option, value: None if value is None else check(value)


def decimal_callback(
    context: click.Context, option: click.Parameter, value: str | None
) -> str | None:
    """Check that the text of a command-line option is a decimal, and return the text.

    It stays a text, because no value may pass through a double.

    Raises:
        InputError: If it is not a decimal.
    """
    from tippedisk_verify.numbers.exact import exact

    try:
        exact("0" if value is None else value)
    except InputError as fault:
        raise InputError(f"{option.opts[0]}: {fault}") from None
    return value


def combined_options(*options: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Combine the decorators of several options into one."""
    return lambda function: reduce(lambda made, option: option(made), reversed(options), function)


def output_file_callback(*endings: str) -> Check:
    """Return a callback for click that checks an option: the name of an output file with one of
    these endings.
    """
    return option_callback(lambda text: checked_file_path(text, *endings))


def _levels(text: str) -> tuple[int, ...]:
    from tippedisk_verify.conformance.grading import LEVEL_NAMES

    levels: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"(\d{1,2})(?:-(\d{1,2}))?", part, re.ASCII)
        if match is None:
            raise InputError(f"levels are numbers and ranges such as 1-3,7, not '{text[:40]}'")
        first, last = int(match[1]), int(match[2] or match[1])
        if not 1 <= first <= last <= len(LEVEL_NAMES):
            raise InputError(f"levels go from 1 to {len(LEVEL_NAMES)}, not '{text[:40]}'")
        levels.update(range(first, last + 1))
    return tuple(sorted(levels))


levels_callback = option_callback(_levels)

omega_option = click.option(
    "--omega", callback=decimal_callback, metavar="X", help="The spinning speed [rad/s]."
)
below_crit_option = click.option(
    "--below-crit",
    callback=decimal_callback,
    metavar="D",
    help="The speed Omega_crit - D [rad/s], rounded to 35 digits more than requested.",
)
half_widths_option = click.option(
    "--half-widths/--no-half-widths",
    default=True,
    help="Compute half-widths. Without them, numbers take a fraction of the time.",
)
rotating_option = click.option(
    "--rotating",
    is_flag=True,
    help="Compute rotating cycles, on which gamma grows by 2 pi in each period.",
)
unstable_option = click.option(
    "--unstable", is_flag=True, help="Choose the unstable cycle if a stable one has the same speed."
)
certificate_option = click.option(
    "--certificate",
    callback=option_callback(output_file),
    metavar="FILE.json",
    help="Write a certificate, with which `certify check FILE.json` repeats the proof.",
)


def lock_output_folder(out: str | None) -> Path | None:
    """Lock the output folder for this run until the command ends, and return its path.

    Args:
        out: The folder's path, or None.

    Raises:
        InputError: If it cannot be used, or another run is writing into it.
    """
    return None if out is None else click.get_current_context().with_resource(sole_writer(out))
