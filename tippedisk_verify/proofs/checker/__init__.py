"""Checks a certificate of `certify ... --certificate FILE`: ``python -m tippedisk_verify.proofs.checker FILE``.

This folder stands alone. It imports nothing else of the package and searches for nothing: what there is to choose
(steps, matrices, moments, boxes, weights) is in the certificate, and is only tested, by strict comparisons of balls.
docs/certified.md says what is shown, and why it suffices.

Exit status 0: proved; 1: not proved, and the line says what fails; 2: no certificate can be read.
"""

from __future__ import annotations

from tippedisk_verify.proofs.checker.claims import FORMAT, proved
from tippedisk_verify.proofs.checker.family import Mapped, Shown, arc_shown
from tippedisk_verify.proofs.checker.steps import Flow, Piece, States, Unproved
from tippedisk_verify.proofs.kernel.reading import Refused, content_of, digest

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
