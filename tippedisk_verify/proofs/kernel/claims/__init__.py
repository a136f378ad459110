"""The claims that certificates make, and whether the evidence in a file proves them. Nothing is searched for here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tippedisk_verify.proofs.kernel.balls import Unproved, need, working_precision
from tippedisk_verify.proofs.kernel.claims import connection, connection_cycles, cycle, family, fold
from tippedisk_verify.proofs.kernel.field import UNITS
from tippedisk_verify.proofs.kernel.reading import DISK, LAWS, Refused, content_of, digest, one_of, parsed, precision

__all__ = ["FORMAT", "KINDS", "Refused", "Unproved", "check", "digest", "proved", "sentence"]

FORMAT = "tippedisk certificate 3"
#: The modules that show them. ``SHAPES`` says what a claim has besides `DISK`, and what its evidence; ``show`` raises
#: Unproved if the evidence does not prove the claim; ``sentence`` says what is claimed of the disk, given the numbers
#: with their half-widths.
KINDS: dict[str, Any] = {
    kind: module for module in (cycle, fold, connection, connection_cycles, family) for kind in module.SHAPES
}


def check(path: str, mapped: family.Mapped = map) -> str:
    """`proved`, of what is in a file."""
    return proved(content_of(path), mapped)


def proved(content: Any, mapped: family.Mapped = map) -> str:
    """The claim in one sentence, if the evidence proves it. Raises Unproved or Refused if not.

    ``mapped`` may be the map of a pool of processes: a family's arcs take most of the time, and are shown one by one.
    """
    if not isinstance(content, dict) or not isinstance(content.get("claim"), dict):
        raise Refused(f"it is no object with the format '{FORMAT}' and a claim")
    if content.get("format") != FORMAT:
        raise Refused(f"its format is not '{FORMAT}': write it again with this version")
    kind = parsed(content["claim"].get("kind"), one_of(*KINDS), "claim kind")
    bits = parsed(content.get("bits"), precision, "bits")
    claim, evidence = KINDS[kind].SHAPES[kind]
    with working_precision(bits):
        shape = {"format": str, "claim": DISK | claim, "bits": precision, "evidence": evidence, "sha256": str}
        file = parsed(content, shape, "the file")
        need(content["sha256"] == digest(content), "the content is not what its digest, sha256, was made of")
        shared = (mapped,) if KINDS[kind] is family else ()
        try:
            KINDS[kind].show(file["claim"], file["evidence"], *shared)
        except (ValueError, IndexError, OverflowError, ZeroDivisionError) as fault:
            raise Unproved(f"its choices cannot be computed with: {fault}") from None
    return sentence(file["claim"])


def sentence(claim: Mapping[str, Any]) -> str:
    """What is claimed, in one sentence or some."""
    disk = ", ".join(f"{name} = {claim['parameters'][name]}{unit}" for name, unit in UNITS.items())
    numbers = {name: f"{number['value']} ± {number['uncertainty']}" for name, number in claim["numbers"].items()}
    words = KINDS[claim["kind"]].sentence(claim, numbers)
    return f"for the tippedisk with {disk} under the {LAWS[claim['friction']]} friction law{words}"
