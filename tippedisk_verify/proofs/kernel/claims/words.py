"""What the sentences of all claims have in common."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from tippedisk_verify.proofs.kernel.balls import ball, need, working_bits, working_precision
from tippedisk_verify.proofs.kernel.field import UNITS
from tippedisk_verify.proofs.kernel.reading import decimal, one_of

__all__ = ["DISK", "LAWS", "MANNERS", "disk_words", "held", "number_words"]

LAWS = {"linear": "linear", "smooth": "smooth Coulomb"}

#: What is said of an orbit. One of undecided stability need not be isolated, as a limit cycle is.
MANNERS = {
    True: "a limit cycle, asymptotically stable",
    False: "a limit cycle, unstable",
    None: "a periodic orbit, of undecided stability",
}

#: what a claim says of the disk
DISK = {"parameters": dict.fromkeys(UNITS, decimal), "friction": one_of(*LAWS)}


def disk_words(claim: Mapping[str, Any]) -> str:
    """Which disk and which law a sentence is about."""
    disk = ", ".join(f"{name} = {claim['parameters'][name]}{unit}" for name, unit in UNITS.items())
    return f"for the tippedisk with {disk} under the {LAWS[claim['friction']]} friction law"


def number_words(claim: Mapping[str, Any]) -> dict[str, str]:
    """The numbers of a claim with their half-widths."""
    return {name: f"{number['value']} ± {number['uncertainty']}" for name, number in claim["numbers"].items()}


def held(number: Mapping[str, str], x: Any, name: str) -> None:
    """Shown: all that the ball stands for lies within the claimed half-width."""
    with working_precision(2 * working_bits()):  # a half-width of a few last bits leaves no room for their rounding
        within = x.is_finite() and abs(x - ball(Fraction(number["value"]))) <= ball(Fraction(number["uncertainty"]))
    need(bool(within), f"claim: {name} is not shown to lie within its uncertainty")
