"""The list of all claims, in the order of the paper and in groups (`GROUPS`)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches

from tippedisk_verify.audit import (
    balance_claims,
    connection_claims,
    friction_claims,
    global_claims,
    linear_claims,
    manifold_claims,
)
from tippedisk_verify.audit.claims import Claim
from tippedisk_verify.errors import InputError

__all__ = ["CLAIMS", "GROUPS", "claims_drawn_in", "equations_named", "group_of", "select_claims"]

#: The claims by subject, in the order of the paper.
GROUPS: dict[str, tuple[Claim, ...]] = {
    "Model, linear analysis and harmonic balance": (
        *linear_claims.LINEAR_CLAIMS,
        *balance_claims.BALANCE_CLAIMS,
    ),
    "Slow manifold": manifold_claims.MANIFOLD_CLAIMS,
    "Heteroclinic connection": connection_claims.CONNECTION_CLAIMS,
    "Limit cycles and trajectories": global_claims.GLOBAL_CLAIMS,
    "Friction laws and attraction": friction_claims.FRICTION_CLAIMS,
}
CLAIMS: tuple[Claim, ...] = tuple(claim for claims in GROUPS.values() for claim in claims)


def group_of(name: str) -> str:
    """Return the subject of a claim, a key of `GROUPS`, given the claim's name."""
    return next(
        group for group, claims in GROUPS.items() if any(claim.name == name for claim in claims)
    )


def claims_drawn_in(figure: str) -> tuple[str, ...]:
    """Return the names of the claims that an exhibit illustrates."""
    return tuple(claim.name for claim in CLAIMS if figure in claim.figures)


def equations_named(names: Sequence[str]) -> list[str]:
    """Return the equation numbers among some names, as texts.

    An equation is written "eq. 30", "(30)" or "30". Other names are left out.
    """
    return [
        match[1]
        for name in names
        if (match := re.fullmatch(r"(?:eq\.? ?)?\(?(\d{1,3})\)?", name.strip()))
    ]


def select_claims(names: Sequence[str]) -> tuple[Claim, ...]:
    """Return the claims with these names, or about these equations.

    Args:
        names: Names of claims, or equation numbers as `equations_named` takes them. If there are
            none, all claims are returned.

    Returns:
        The claims in the order of the paper.

    Raises:
        InputError: If a name is not known, or no claim is about an equation.
    """
    known, wanted = {claim.name for claim in CLAIMS}, set(names)
    for name in names:
        for number in equations_named([name]):
            about = {claim.name for claim in CLAIMS if f"({number})" in claim.source}
            if not about:
                raise InputError(
                    f"no claim is about eq. ({number}): verify --list shows all claims"
                )
            wanted = wanted - {name} | about
        if name not in known and not equations_named([name]):
            near = get_close_matches(name, known, n=3, cutoff=0.6)
            hint = f"did you mean {' or '.join(near)}? " if near else ""
            raise InputError(f"claim '{name[:40]}' is not known: {hint}verify --list names all")
    return tuple(claim for claim in CLAIMS if not names or claim.name in wanted)
