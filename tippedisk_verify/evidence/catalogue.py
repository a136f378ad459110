"""All claims, in the order of the paper."""

from __future__ import annotations

from collections.abc import Sequence

from tippedisk_verify.errors import InputError
from tippedisk_verify.evidence.claims import Claim
from tippedisk_verify.evidence.global_claims import GLOBAL_CLAIMS
from tippedisk_verify.evidence.local_claims import LOCAL_CLAIMS

__all__ = ["CLAIMS", "selected"]

CLAIMS: tuple[Claim, ...] = LOCAL_CLAIMS + GLOBAL_CLAIMS


def selected(names: Sequence[str]) -> tuple[Claim, ...]:
    """The claims of those names, in the table's order; all if none is named. Raises InputError for unknown names."""
    known = {claim.name for claim in CLAIMS}
    if unknown := [name for name in names if name not in known]:
        raise InputError(f"claim '{unknown[0][:40]}' is not known: use {', '.join(sorted(known))}")
    return tuple(claim for claim in CLAIMS if not names or claim.name in names)
