"""All claims, in the order of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from tippedisk_verify.errors import InputError
from tippedisk_verify.evidence.claims import Claim
from tippedisk_verify.evidence.connection_claims import CONNECTION_CLAIMS
from tippedisk_verify.evidence.friction_claims import FRICTION_CLAIMS
from tippedisk_verify.evidence.global_claims import GLOBAL_CLAIMS
from tippedisk_verify.evidence.local_claims import LOCAL_CLAIMS
from tippedisk_verify.evidence.manifold_claims import MANIFOLD_CLAIMS

__all__ = ["CLAIMS", "selected"]

CLAIMS: tuple[Claim, ...] = LOCAL_CLAIMS + MANIFOLD_CLAIMS + CONNECTION_CLAIMS + GLOBAL_CLAIMS + FRICTION_CLAIMS


def selected(names: Sequence[str]) -> tuple[Claim, ...]:
    """The claims of those names, in the table's order; all if none is named. Raises InputError for unknown names."""
    known = {claim.name for claim in CLAIMS}
    if unknown := [name for name in names if name not in known]:
        near = get_close_matches(unknown[0], known, n=3, cutoff=0.4) or ["omega_crit"]
        raise InputError(f"claim '{unknown[0][:40]}' is not known: did you mean {' or '.join(near)}? verify lists all")
    return tuple(claim for claim in CLAIMS if not names or claim.name in names)
