"""How far the proof in ball arithmetic that a claim offers decides it: for which sets, and by which commands.

A claim is *proved* if the commands named, run as they stand, prove what its verdict says of each set that is audited.
It is *proved in part* if they prove it for some of the sets, or a part of its sentence. Theorem 1 holds for every disk;
of the other theorems only proofs for the named sets are spoken of here, because there a test runs them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from shlex import quote

from tippedisk_verify.audit.claims import Claim, Finding, Theorem, rounds_to
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import NAMED_SETS, Parameters
from tippedisk_verify.model.results import Printable

__all__ = ["ClaimProof", "proof_of"]


@dataclass(frozen=True, repr=False)
class ClaimProof(Printable):
    """How far a claim's verdict is proved."""

    theorem: str  #: of docs/certified.md
    friction: tuple[str, ...]  #: the laws that the theorem covers
    proves: str  #: what the commands prove
    not_proved: str  #: what of the verdict they do not prove; empty if they prove all of it for all sets
    commands: Mapping[str, str]  #: by parameter set

    @property
    def grade(self) -> str:
        return "proved in part" if self.not_proved else "proved"


def proof_of(claim: Claim, finding: Finding, sets: Mapping[str, Parameters]) -> ClaimProof | None:
    """How far a claim's verdict on these sets is proved; None if nothing of it is."""
    offer = claim.proof
    if offer is None:
        return None
    commands = {}
    for name, answer in finding.holds.items():
        if (
            answer is None
            or not _covered(offer.theorem, sets[name])
            or not _decides(finding.computed[name], claim.printed)
        ):
            continue
        chosen = f"--parameters {quote(name)}" + " --friction smooth" * (sets[name].friction == "smooth")
        commands[name] = " && ".join(f"tippedisk-verify {part} {chosen}" for part in offer.theorem.commands)
    if not commands:
        return None
    rests = [offer.rest] if offer.rest else []
    if others := [name for name in finding.holds if name not in commands]:
        rests.append(f"anything for {', '.join(others)}")
    laws = ("linear", "smooth") if offer.theorem.law is None else (offer.theorem.law,)
    return ClaimProof(offer.theorem.name, laws, offer.proves, "; ".join(rests), commands)


def _covered(theorem: Theorem, parameters: Parameters) -> bool:
    """Whether the theorem speaks of the disk and its friction law, and a command can name it."""
    if theorem.law not in (None, parameters.friction):
        return False
    if NAMED_SETS.get(parameters.name) == parameters.with_friction("linear"):
        return True
    return theorem.every_disk and ("." in parameters.name or "/" in parameters.name)


def _decides(computed: Measured | str, printed: str) -> bool:
    """Whether a command's twelve digits tell if the number rounds as printed; it may lie next to a boundary."""
    if isinstance(computed, str):
        return True
    twelve_digits = Measured(computed.value, computed.uncertainty + abs(computed.value) / 10**11)
    return rounds_to(twelve_digits, printed) is not None
