"""Which claims are decided by proofs in ball arithmetic: for which sets, how far, by which theorem and command.

A claim is *proved* if the commands named, run as they stand, prove what its verdict says of each set that is audited.
It is *proved in part* if they prove it for some of the sets, or a part of its sentence. Theorem 1 holds for every disk;
of the other theorems only proofs for the named sets are spoken of here, because there a test runs them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from shlex import quote
from typing import Any, NamedTuple

from tippedisk_verify.evidence.claims import Claim, Finding, rounds_to
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import NAMED_SETS, Friction, Parameters

__all__ = ["ClaimProof", "proof_of"]


@dataclass(frozen=True)
class ClaimProof:
    """How far a claim's verdict is proved."""

    theorem: str  #: of docs/certified.md
    friction: tuple[str, ...]  #: the laws that the theorem covers
    proves: str  #: what the commands prove
    rest: str  #: what of the verdict they do not prove; empty if they prove all of it for all sets
    commands: Mapping[str, str]  #: by parameter set

    @property
    def grade(self) -> str:
        return "proved in part" if self.rest else "proved"

    def json(self) -> dict[str, Any]:
        return {
            "theorem": self.theorem,
            "friction": list(self.friction),
            "proves": self.proves,
            "not_proved": self.rest,
            "commands": dict(self.commands),
        }


class _Offer(NamedTuple):
    """What a theorem has to say to a claim."""

    theorem: str
    command: str
    proves: str
    rest: str = ""
    law: Friction | None = None  #: the only one that it covers; None: both
    every_disk: bool = False
    against: str = ""  #: a further command, for the sets of which the claim does not hold


_EVERY_SPEED = "certify equilibria --every-speed"
_BOTH_LAWS: tuple[Friction, ...] = ("linear", "smooth")
_SAME_CYCLE = "that this limit cycle is the one born at Omega_crit (measured)"


def _first(proves: str, rest: str = "") -> _Offer:
    return _Offer("Theorem 1", _EVERY_SPEED, proves, rest, every_disk=True)


def _connection(theorem: str, proves: str, rest: str = "", against: str = "") -> _Offer:
    return _Offer(theorem, "certify heteroclinic", proves, rest, law="linear", against=against)


_OFFERS = {
    "table_1": _Offer(
        "Theorem 4",
        "certify table",
        "whether the disk rounds to Table 1, and which of the four printed numbers it gives",
        law="linear",
    ),
    "omega_crit": _first("the formula, and an enclosure of the number"),
    "omega_crit_friction": _first("that the formula is right whatever mu and epsilon are"),
    "lambda_3": _first(
        "an enclosure of A_33, which is lambda_3 at Omega_crit",
        "how near lambda_3 is to A_33 at other speeds",
    ),
    "critical_pair": _first(
        "that a pair of complex conjugate eigenvalues crosses the imaginary axis, with nonzero speed",
        "that 'convex' is a slip of the pen (read)",
    ),
    "inverted_stable_above": _first("asymptotic stability at every speed above Omega_crit"),
    "inverted_unstable_below": _first("instability at every speed below Omega_crit"),
    "noninverted_unstable": _first("instability at every speed"),
    "period_crit": _first("an enclosure of 2 pi / omega for the pair +- i omega at Omega_crit"),
    "chi": _Offer("Theorem 3", "certify hopf", "an enclosure of the number", law="linear"),
    "supercritical": _Offer(
        "Theorem 3",
        "certify hopf",
        "the signs of the first Lyapunov coefficient and of d(Re lambda)/dOmega",
        law="linear",
    ),
    "omega_h": _connection(
        "Theorems 6, 7 and 8",
        "that one speed of a short interval, and no other there, has a connection in which a limit cycle ends; whether "
        "that speed rounds to 30.07; and where it does not, that no speed that does has a connection on which gamma "
        "grows all the way",
        _SAME_CYCLE,
        against="certify heteroclinic --none-between 30.065 30.075",
    ),
    "infinite_period": _connection(
        "Theorem 7", "that the period of the limit cycle next to the connection tends to infinity", _SAME_CYCLE
    ),
    "both_connections": _connection("Theorem 6", "that both connections exist at one and the same speed"),
    "attracting_cycle": _connection(
        "Theorem 7", "that the limit cycle next to the connection is asymptotically stable"
    ),
}


def proof_of(claim: Claim, finding: Finding, sets: Mapping[str, Parameters]) -> ClaimProof | None:
    """How far a claim's verdict on these sets is proved; None if nothing of it is."""
    offer = _OFFERS.get(claim.name)
    if offer is None:
        return None
    commands = {}
    for name, answer in finding.holds.items():
        if answer is None or not _covered(offer, sets[name]) or not _decides(finding.computed[name], claim.printed):
            continue
        parts = (offer.command, offer.against) if offer.against and not answer else (offer.command,)
        commands[name] = " && ".join(f"tippedisk-verify {part} --parameters {quote(name)}" for part in parts)
    if not commands:
        return None
    rests = [offer.rest] if offer.rest else []
    if others := [name for name in finding.holds if name not in commands]:
        rests.append(f"anything for {', '.join(others)}")
    laws = _BOTH_LAWS if offer.law is None else (offer.law,)
    return ClaimProof(offer.theorem, laws, offer.proves, "; ".join(rests), commands)


def _covered(offer: _Offer, parameters: Parameters) -> bool:
    """Whether the theorem speaks of the disk and its friction law, and a command can name it."""
    if offer.law not in (None, parameters.friction):
        return False
    if NAMED_SETS.get(parameters.name) == parameters.with_friction("linear"):
        return True
    return offer.every_disk and ("." in parameters.name or "/" in parameters.name)


def _decides(computed: Measured | str, printed: str) -> bool:
    """Whether a command's twelve digits tell if the number rounds as printed; it may lie next to a boundary."""
    if isinstance(computed, str):
        return True
    twelve_digits = Measured(computed.value, computed.uncertainty + abs(computed.value) / 10**11)
    return rounds_to(twelve_digits, printed) is not None
