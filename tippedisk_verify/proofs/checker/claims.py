"""The family of limit cycles: what a certificate claims, and whether its evidence shows it.

All else: `kernel.claims`.
"""

from __future__ import annotations

import os
import tomllib
from typing import Any

from tippedisk_verify.proofs.checker.family import CLAIM, EVIDENCE, Mapped, family_shown
from tippedisk_verify.proofs.checker.steps import UNITS, context
from tippedisk_verify.proofs.kernel import claims as kernel
from tippedisk_verify.proofs.kernel.balls import need
from tippedisk_verify.proofs.kernel.claims import FORMAT, connection_cycles
from tippedisk_verify.proofs.kernel.reading import MEASURED, count, decimal, digest, parsed

__all__ = ["FORMAT", "proved"]


def _family(claim: dict[str, Any], evidence: dict[str, Any], mapped: Mapped) -> None:
    """The family of limit cycles, and that it runs into the cycles next to the connection, if that is claimed."""
    last = family_shown(claim, evidence["arcs"], mapped)
    if "end" in evidence:
        end = connection_cycles.show(claim, evidence["end"])
        need(end.meets(*last), "the last arc is not shown to run into the cycles next to the connection")


with open(os.path.join(os.path.dirname(__file__), "claims.toml"), "rb") as _stream:
    _KINDS: dict[str, dict[str, Any]] = tomllib.load(
        _stream
    )  #: names of the numbers and sentence of each kind of claim


def _shapes(kind: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a claim and its evidence have."""
    claim = {
        "kind": str,
        "parameters": dict.fromkeys(UNITS, decimal),
        "numbers": dict.fromkeys(kind["numbers"], MEASURED),
    }
    if kind["proof"] == "family":
        return claim | CLAIM, EVIDENCE
    return claim | CLAIM | connection_cycles.CLAIM, {**EVIDENCE, "end": connection_cycles.EVIDENCE}


def proved(content: Any, mapped: Mapped = map) -> str:
    """The claim in one sentence, if the evidence proves it. Raises Unproved or Refused if not.

    ``mapped`` may be the map of a pool of processes: a family's arcs take most of the time, and are shown one by one.
    """
    name, bits = kernel.opened(content, kernel.KINDS | _KINDS)
    if name in kernel.KINDS:
        return kernel.proved(content)
    kind = _KINDS[name]
    claim, evidence = _shapes(kind)
    shape = {"format": str, "claim": claim, "bits": count, "evidence": evidence, "sha256": str}
    with context(bits):
        file = parsed(content, shape, "the file")
        need(content["sha256"] == digest(content), "the content is not what its digest, sha256, was made of")
        _family(file["claim"], file["evidence"], mapped)
    words = {name: value for name, value in file["claim"].items() if isinstance(value, str)}
    words |= {f"near_{name}": value for name, value in file["claim"].get("unique_within", {}).items()}
    words |= {name: f"{n['value']} ± {n['uncertainty']}" for name, n in file["claim"]["numbers"].items()}
    disk = ", ".join(f"{name} = {file['claim']['parameters'][name]}{unit}" for name, unit in UNITS.items())
    return str(kind["sentence"].format(disk=disk, **words))
