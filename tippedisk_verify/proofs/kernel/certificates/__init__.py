"""Certificates: the version of their format, their kinds, and the check that the evidence in a file
proves its claim.

The check replays recorded evidence. It never searches for any.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tippedisk_verify.proofs.kernel.balls import Unproved, require, working_precision
from tippedisk_verify.proofs.kernel.certificate_format import (
    DISK_SHAPE,
    FRICTION_LAWS,
    ClaimReader,
    NotACertificate,
    digest,
    one_of,
    read_json,
    read_precision,
    read_shape,
)
from tippedisk_verify.proofs.kernel.certificates import (
    connection,
    cycle,
    cycles_near_omega_h,
    family,
    fold,
)
from tippedisk_verify.proofs.kernel.vector_field import PARAMETER_UNITS

__all__ = [
    "CERTIFICATE_FORMAT",
    "KINDS",
    "NotACertificate",
    "Unproved",
    "check",
    "digest",
    "sentence",
    "verify_content",
]

CERTIFICATE_FORMAT = "tippedisk certificate 3"
#: The module of each kind. Its ``SHAPES`` are the members of claim (besides `DISK_SHAPE`) and
#: evidence. Its ``verify`` raises Unproved unless the evidence proves the claim. Its ``sentence``
#: states the claim, given the numbers with half-widths.
KINDS: dict[str, Any] = {
    kind: module
    for module in (cycle, fold, connection, cycles_near_omega_h, family)
    for kind in module.SHAPES
}


def check(path: str, map_arcs: family.ArcMap = map) -> str:
    """Verify the certificate in the file at ``path`` and return its claim as a sentence.

    Raises NotACertificate if the file is not a certificate, and Unproved if its evidence does not
    prove the claim. ``map_arcs`` verifies the arcs of a family, as in `verify_content`.
    """
    return verify_content(read_json(path), map_arcs)


def verify_content(content: Any, map_arcs: family.ArcMap = map) -> str:
    """Verify the content of a certificate and return its claim as a sentence.

    Raises NotACertificate if the content is not a certificate, and Unproved if its evidence does
    not prove the claim. ``map_arcs`` may be the map of a pool of processes: a family's arcs take
    most of the time, and each is verified separately.
    """
    if not isinstance(content, dict) or not isinstance(content.get("claim"), dict):
        raise NotACertificate(
            f"it is not an object with the format '{CERTIFICATE_FORMAT}' and a claim"
        )
    if content.get("format") != CERTIFICATE_FORMAT:
        raise NotACertificate(
            f"its format is not '{CERTIFICATE_FORMAT}': write it again with this version"
        )
    kind = read_shape(content["claim"].get("kind"), one_of(*KINDS), "claim kind")
    bits = read_shape(content.get("bits"), read_precision, "bits")
    claim, evidence = KINDS[kind].SHAPES[kind]
    with working_precision(bits):
        shape = {
            "format": str,
            "claim": DISK_SHAPE | claim,
            "bits": read_precision,
            "evidence": evidence,
            "sha256": str,
        }
        file = read_shape(content, shape, "the file")
        require(
            content["sha256"] == digest(content), "the content does not have its digest, sha256"
        )
        reader = ClaimReader(file["claim"])
        extra = (map_arcs,) if KINDS[kind] is family else ()
        try:
            KINDS[kind].verify(reader, file["evidence"], *extra)
        except (ValueError, IndexError, OverflowError, ZeroDivisionError) as fault:
            raise Unproved(f"the computation with its choices fails: {fault}") from None
    # The kind has selected the test. Members of `DISK_SHAPE` that a kind narrows were tested on
    # reading.
    untested = reader.keys() - reader.names_read - {"kind"} - (claim.keys() & DISK_SHAPE.keys())
    require(not untested, f"claim: nothing tests {', '.join(sorted(untested))}")
    return sentence(file["claim"])


def sentence(claim: Mapping[str, Any]) -> str:
    """Return the theorem that a certificate's claim states, in one or more sentences of English,
    which also name the disk and the friction law.
    """
    disk = ", ".join(
        f"{name} = {claim['parameters'][name]}{unit}" for name, unit in PARAMETER_UNITS.items()
    )
    numbers = {
        name: f"{number['value']} ± {number['uncertainty']}"
        for name, number in claim["numbers"].items()
    }
    words = KINDS[claim["kind"]].sentence(claim, numbers)
    return f"for the tippedisk with {disk} under the {FRICTION_LAWS[claim['friction']].title} friction law{words}"
