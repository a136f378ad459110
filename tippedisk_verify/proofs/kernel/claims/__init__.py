"""The claims that certificates make, and whether the evidence in a file proves them. Nothing is searched for here."""

from __future__ import annotations

from typing import Any

from tippedisk_verify.proofs.kernel.balls import need, working_precision
from tippedisk_verify.proofs.kernel.claims import connection, connection_cycles, cycle, family, fold, interval
from tippedisk_verify.proofs.kernel.reading import Refused, digest, one_of, parsed, precision

__all__ = ["FORMAT", "KINDS", "opened", "proved"]

FORMAT = "tippedisk certificate 2"
#: by what shows them
KINDS: dict[str, Any] = {
    kind: module for module in (cycle, fold, interval, connection, connection_cycles, family) for kind in module.KINDS
}


def proved(content: Any, mapped: family.Mapped = map) -> str:
    """The claim in one sentence, if the evidence proves it. Raises Unproved or Refused if not.

    ``mapped`` may be the map of a pool of processes: a family's arcs take most of the time, and are shown one by one.
    """
    kind, bits = opened(content, KINDS)
    claim, evidence = KINDS[kind].shape(kind)
    with working_precision(bits):
        shape = {"format": str, "claim": claim, "bits": precision, "evidence": evidence, "sha256": str}
        file = parsed(content, shape, "the file")
        need(content["sha256"] == digest(content), "the content is not what its digest, sha256, was made of")
        shared = (mapped,) if KINDS[kind] is family else ()
        KINDS[kind].show(file["claim"], file["evidence"], *shared)
    return str(KINDS[kind].sentence(file["claim"]))


def opened(content: Any, kinds: Any) -> tuple[str, int]:
    """The kind of claim and the bits of precision. Raises Refused for what is no certificate of this version."""
    if not isinstance(content, dict) or not isinstance(content.get("claim"), dict):
        raise Refused(f"it is no object with the format '{FORMAT}' and a claim")
    if content.get("format") != FORMAT:
        raise Refused(f"its format is not '{FORMAT}': write it again with this version")
    kind = parsed(content["claim"].get("kind"), one_of(*kinds), "claim kind")
    return kind, parsed(content.get("bits"), precision, "bits")
