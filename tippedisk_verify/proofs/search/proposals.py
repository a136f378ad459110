"""Choices for the kernel's claims: proposed one by one while they are searched for, and logged."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from flint import arb

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.proofs.kernel.reading import dyadic_text
from tippedisk_verify.proofs.search.steps import Steps

__all__ = ["Proposer", "as_text"]


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
    if isinstance(value, Steps):
        return value.log
    if isinstance(value, arb):
        return dyadic_text(value)
    return exact_text(value) if isinstance(value, Fraction) else value
