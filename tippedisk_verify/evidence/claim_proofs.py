"""Which claims are decided by a proof in ball arithmetic, by which theorem of docs/certified.md, and how to run it."""

from __future__ import annotations

from typing import NamedTuple

from tippedisk_verify.model.equations import Friction
from tippedisk_verify.model.parameters import NAMED_SETS

__all__ = ["ClaimProof", "proof_of"]


class ClaimProof(NamedTuple):
    """A theorem and the command that proves it again."""

    theorem: str
    command: str


_EQUILIBRIA = "tippedisk-verify certify equilibria --omega 30.4"
_HOPF, _TABLE = "tippedisk-verify certify hopf", "tippedisk-verify certify table"
_CONNECTION = "tippedisk-verify certify heteroclinic"
#: Of the linearisation, which both friction laws share.
_OF_BOTH_LAWS = {
    "omega_crit": ClaimProof("Theorems 1 and 4", _TABLE),
    "omega_crit_friction": ClaimProof("Theorem 1", _HOPF),
    "lambda_3": ClaimProof("Theorems 1 and 4", _TABLE),
    "period_crit": ClaimProof("Theorems 1 and 4", _TABLE),
    "critical_pair": ClaimProof("Theorem 1", _HOPF),
    "inverted_stable_above": ClaimProof("Theorem 1", _EQUILIBRIA),
    "inverted_unstable_below": ClaimProof("Theorem 1", _EQUILIBRIA),
    "noninverted_unstable": ClaimProof("Theorem 1", _EQUILIBRIA),
}
_OF_THE_LINEAR_LAW = {
    "table_1": ClaimProof("Theorem 4", f"{_TABLE} --omega-h"),
    "chi": ClaimProof("Theorem 4", _TABLE),
    "supercritical": ClaimProof("Theorems 3 and 4", _HOPF),
    "omega_h": ClaimProof("Theorems 4 and 6", _CONNECTION),
    "both_connections": ClaimProof("Theorem 6", _CONNECTION),
}


def proof_of(name: str, friction: Friction, parameters: str) -> ClaimProof | None:
    """The proof of a claim's verdict for the named sets; None if there is none, or for another set."""
    if parameters not in NAMED_SETS:
        return None
    found = _OF_BOTH_LAWS.get(name)
    return found or (_OF_THE_LINEAR_LAW.get(name) if friction == "linear" else None)
