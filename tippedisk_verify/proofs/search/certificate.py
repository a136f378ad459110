"""Certificates as files: a claim, the choices that the kernel accepted when it proved the claim, and a digest."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.proofs.kernel.claims import FORMAT
from tippedisk_verify.proofs.kernel.reading import digest

__all__ = ["certificate_text", "checked_text", "parameter_texts"]


def certificate_text(claim: Mapping[str, Any], bits: int, evidence: Mapping[str, Any]) -> str:
    """The file's text."""
    content: dict[str, Any] = {"format": FORMAT, "claim": claim, "bits": bits, "evidence": evidence}
    return json.dumps(content | {"sha256": digest(content)}, indent=None, separators=(",", ":")) + "\n"


def checked_text(
    claim: Mapping[str, Any], bits: int, evidence: Mapping[str, Any], mapped: Callable[..., Any] = map
) -> str:
    """The file's text, which `checker` has read and accepted. Raises Unproved or Refused if it does not accept it."""
    from tippedisk_verify.proofs import checker

    text = certificate_text(claim, bits, evidence)
    checker.proved(json.loads(text), mapped)
    return text


def parameter_texts(parameters: Parameters) -> dict[str, str]:
    return {name: exact_text(getattr(parameters, name)) for name in SYMBOLS}
