"""The cycles next to the connection: what a certificate claims, and whether its evidence shows it.

All other claims: `kernel.claims`.
"""

from __future__ import annotations

import os
import tomllib
from typing import Any

from tippedisk_verify.proofs.checker.connection import CHOICES, end_shown
from tippedisk_verify.proofs.checker.steps import UNITS, context
from tippedisk_verify.proofs.kernel import claims as kernel
from tippedisk_verify.proofs.kernel.balls import need
from tippedisk_verify.proofs.kernel.claims import FORMAT
from tippedisk_verify.proofs.kernel.reading import MEASURED, count, decimal, digest, parsed

__all__ = ["FORMAT", "proved"]


def _end(claim: dict[str, Any], evidence: dict[str, Any]) -> None:
    """The cycles next to the connection of saddles."""
    end_shown(claim["parameters"], {**claim, **claim["numbers"], **evidence})


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
    room = dict.fromkeys(("low", "high", "gamma", "v"), decimal)
    return claim | room, CHOICES


def proved(content: Any, mapped: kernel.family.Mapped = map) -> str:
    """The claim in one sentence, if the evidence proves it. Raises Unproved or Refused if not.

    ``mapped`` may be the map of a pool of processes: a family's arcs take most of the time, and are shown one by one.
    """
    name, bits = kernel.opened(content, kernel.KINDS | _KINDS)
    if name in kernel.KINDS:
        return kernel.proved(content, mapped)
    kind = _KINDS[name]
    claim, evidence = _shapes(kind)
    shape = {"format": str, "claim": claim, "bits": count, "evidence": evidence, "sha256": str}
    with context(bits):
        file = parsed(content, shape, "the file")
        need(content["sha256"] == digest(content), "the content is not what its digest, sha256, was made of")
        _end(file["claim"], file["evidence"])
    words = {name: value for name, value in file["claim"].items() if isinstance(value, str)}
    words |= {name: f"{n['value']} ± {n['uncertainty']}" for name, n in file["claim"]["numbers"].items()}
    disk = ", ".join(f"{name} = {file['claim']['parameters'][name]}{unit}" for name, unit in UNITS.items())
    return str(kind["sentence"].format(disk=disk, **words))
