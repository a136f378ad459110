"""What the commands' help texts say of the quantities that they print."""

from __future__ import annotations

from collections.abc import Callable

import click

from tippedisk_verify.model.quantities import QUANTITIES, heading

__all__ = ["quantities_of"]


def quantities_of(*names: str) -> Callable[[click.Command], click.Command]:
    """Adds what these quantities are to the end of a command's help."""
    width = max(len(heading(name)) for name in names)
    lines = [f"  {heading(name):{width}}  {QUANTITIES[name].meaning}" for name in names]

    def added(command: click.Command) -> click.Command:
        # The mark keeps click from filling the lines anew.
        command.epilog = "\b\nQuantities (± is a half-width that holds the true value):\n" + "\n".join(lines)
        return command

    return added
