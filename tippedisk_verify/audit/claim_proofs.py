"""The proofs in ball arithmetic that belong to a claim, and how much of its verdict they decide.

A claim is *proved* if the named commands prove its verdict for each audited set. It is *proved in
part* if they prove it for some of the sets, or a part of its statement. Theorem 1 holds for every
disk. For the other theorems only proofs for the named sets count here, because a test runs them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from shlex import quote

from tippedisk_verify.audit.claims import Claim, Finding, Theorem, rounds_to
from tippedisk_verify.display import Printable
from tippedisk_verify.model.parameters import NAMED_SETS, Parameters
from tippedisk_verify.numbers.measured import Measured

__all__ = ["ClaimProof", "proof_of"]


@dataclass(frozen=True, repr=False)
class ClaimProof(Printable):
    """The proof of a claim's verdict, and what it leaves open."""

    theorem: str  #: its name in docs/certified.md
    friction: tuple[str, ...]  #: the laws that the theorem covers
    proves: str  #: what the commands prove
    not_proved: str  #: the rest of the verdict; empty if all of it is proved for all sets
    commands: Mapping[str, str]  #: the commands that prove it, by parameter set

    @property
    def extent(self) -> str:
        """How much is proved: "proved", or "proved in part" if something is left open."""
        return "proved in part" if self.not_proved else "proved"


def proof_of(claim: Claim, finding: Finding, sets: Mapping[str, Parameters]) -> ClaimProof | None:
    """Return the proof of a claim's verdict.

    Args:
        claim: The claim.
        finding: Its outcome.
        sets: The audited sets.

    Returns:
        The proof, or None if no part of the verdict is proved.
    """
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
        options = f"--parameters {quote(name)}"
        if not sets[name].law.is_linear:
            options += f" --friction {sets[name].friction}"
        parts = (f"tippedisk-verify {part} {options}" for part in offer.theorem.commands)
        commands[name] = " && ".join(parts)
    if not commands:
        return None
    open_parts = [offer.not_proved] if offer.not_proved else []
    if open_sets := [name for name in finding.holds if name not in commands]:
        open_parts.append(f"anything for {', '.join(open_sets)}")
    laws = ("linear", "smooth") if offer.theorem.law is None else (offer.theorem.law,)
    return ClaimProof(offer.theorem.name, laws, offer.proves, "; ".join(open_parts), commands)


def _covered(theorem: Theorem, parameters: Parameters) -> bool:
    """Return True if a theorem covers the disk and its friction law, and a command can name the
    disk.
    """
    if theorem.law not in (None, parameters.friction):
        return False
    if NAMED_SETS.get(parameters.name) == parameters.with_friction("linear"):
        return True
    return theorem.every_disk and ("." in parameters.name or "/" in parameters.name)


def _decides(computed: Measured | str, printed: str) -> bool:
    """Return True if the twelve digits of a command's result decide whether the number rounds as
    printed.

    They do not if the number lies next to a rounding boundary. A word is always decided.
    """
    if isinstance(computed, str):
        return True
    twelve_digits = Measured(computed.value, computed.uncertainty + abs(computed.value) / 10**11)
    return rounds_to(twelve_digits, printed) is not None
