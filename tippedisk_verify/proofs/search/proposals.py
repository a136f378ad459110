"""Choices for the kernel's claims: proposed one by one while they are searched for, and logged."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from flint import arb

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.search.certificate import dyadic

__all__ = ["Proposer", "as_text", "certificate"]


class Proposer:
    """Has a method for each name that a claim asks for; what it last answered stands in ``log``."""

    def __init__(self) -> None:
        self.log: dict[str, Any] = {}
        self.asked = ""  #: the last of the names

    def __call__(self, name: str, *shown: Any) -> Any:
        self.asked = name
        self.log[name] = getattr(self, name)(*shown)
        return self.log[name]


def as_text(value: Any) -> Any:
    """Choices as a certificate has them: exact points and rational numbers as texts."""
    if isinstance(value, dict):
        return {name: as_text(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [as_text(part) for part in value]
    if isinstance(value, arb):
        return dyadic(value)
    return exact_text(value) if isinstance(value, Fraction) else value


def certificate(claim: Mapping[str, Any], bits: int, evidence: Mapping[str, Any]) -> str:
    """The file's text: the log of a proof that the kernel has accepted, with its claim."""
    content: dict[str, Any] = {"format": checker.FORMAT, "claim": claim, "bits": bits, "evidence": evidence}
    return json.dumps(content | {"sha256": checker.digest(content)}, separators=(",", ":")) + "\n"
