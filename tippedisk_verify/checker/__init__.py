"""Checks a certificate of `certify ... --certificate FILE`: ``python -m tippedisk_verify.checker FILE``.

This folder stands alone. It imports nothing else of the package and searches for nothing: the certificate gives every
box, step, matrix and moment, and each is only tested, by strict comparisons of Arb's balls. (A family's arcs come with
boxes, steps and axes; what encloses a step and moves with the curve is made here, by one rule.)
docs/certified.md says what is shown, and why it suffices.

Exit status 0: proved; 1: not proved, and the line says what fails; 2: no certificate can be read.
"""

from __future__ import annotations

from tippedisk_verify.checker.claims import FORMAT, proved
from tippedisk_verify.checker.family import Mapped, Shown, arc_shown
from tippedisk_verify.checker.reading import Refused, content_of, digest
from tippedisk_verify.checker.steps import Flow, Piece, States, Unproved

__all__ = [
    "FORMAT",
    "Flow",
    "Mapped",
    "Piece",
    "Refused",
    "Shown",
    "States",
    "Unproved",
    "arc_shown",
    "check",
    "digest",
    "proved",
]


def check(path: str, mapped: Mapped = map) -> str:
    """The claim of a file in one sentence, if its evidence proves it. Raises Unproved or Refused if not."""
    return proved(content_of(path), mapped)
