"""Checks a certificate of `certify ... --certificate FILE`: ``python -m tippedisk_verify.proofs.checker FILE``.

What there is to choose (steps, axes, matrices, moments, boxes, weights) is in the certificate, and the kernel only
tests it, by strict comparisons of balls. docs/certified.md says what is shown, and why it suffices.

Exit status 0: proved; 1: not proved, and the line says what fails; 2: no certificate can be read.
"""

from __future__ import annotations

from tippedisk_verify.proofs.kernel.balls import Unproved
from tippedisk_verify.proofs.kernel.claims import FORMAT, proved
from tippedisk_verify.proofs.kernel.claims.family import Mapped
from tippedisk_verify.proofs.kernel.reading import Refused, content_of, digest

__all__ = [
    "FORMAT",
    "Refused",
    "Unproved",
    "check",
    "digest",
    "proved",
]


def check(path: str, mapped: Mapped = map) -> str:
    """The claim of a file in one sentence, if its evidence proves it. Raises Unproved or Refused if not."""
    return proved(content_of(path), mapped)
