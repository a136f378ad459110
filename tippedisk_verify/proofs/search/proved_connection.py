"""What is proved of the connection of saddles; `kernel.claims.connection` has the proof."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, NamedTuple

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable
from tippedisk_verify.proofs.kernel.claims.connection import EIGENVALUES, Connection, sentence
from tippedisk_verify.proofs.search.certificate import as_text, certificate_text, parameter_texts

__all__ = ["ProvedConnection", "Room", "Status", "not_proved"]


class Status(Enum):
    """How the proof ended. The value says where it stopped and what to try next."""

    PROVED = "proved"
    NO_SADDLE = "there is no connection of saddles to look for"
    UNSTABLE_BRANCH = "the unstable branch could not be enclosed at the first saddle: ask for more digits"
    FLOW = "the flight between the saddles could not be enclosed: ask for more digits"
    NOT_NEAR = "the branch does not come near the second saddle: try another speed"
    BLOCK = "no isolating block at the second saddle holds the arrivals: ask for more digits"
    SIDES = "the ends of the interval are not proved to pass on opposite sides: is there a connection in it?"
    ROOM = "no box at the second saddle is proved to keep what arrives, and to let it converge: ask for more digits"
    CONES = "the cone conditions at a saddle are not proved: ask for more digits"


class Room(NamedTuple):
    """The box |beta - pi/2| <= ``beta``, |gamma - 3 pi/2| <= ``gamma``, |v| <= ``v`` [rad, rad, rad/s]."""

    beta: Fraction
    gamma: Fraction
    v: Fraction


@dataclass(frozen=True, repr=False)
class ProvedConnection(Printable):
    """The interval of Omega_h, and what was proved of it; without status PROVED nothing was."""

    listed = (
        *("proved", "status", "statement", "limit_cycle", "omega_h", "unique"),
        *("saddle_eigenvalues", "saddle_value", "upright", "room", "bits"),
    )

    status: Status
    omega_h: Measured | None  #: [rad/s]; the interval I
    unique: bool  #: no second speed of I has a connection of this kind
    saddle_eigenvalues: tuple[Measured, ...]  #: unstable, slow stable, fast stable [1/s], for every speed of I
    room: Room | None  #: where the branch stays
    upright: bool  #: |beta - pi/2| < pi/2 all along: the disk never lies flat
    bits: int  #: working precision of the last pass
    detail: str = ""
    slowly: bool = False  #: the connection comes in along the slow stable direction
    turns_back: str = ""  #: "above" or "below" Omega_h, in I: where the branch leaves N with falling gamma
    parameters: Parameters | None = None  #: the disk of which this is proved
    shown: Connection | None = None  #: by the kernel
    choices: dict[str, Any] | None = None  #: that the kernel has accepted

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def saddle_value(self) -> Measured | None:
        """lambda_u + lambda_s [1/s]; where it is negative the cycle next to the connections attracts."""
        if not self.saddle_eigenvalues:
            return None
        unstable, slow, _ = self.saddle_eigenvalues
        return unstable + slow

    @property
    def statement(self) -> str:
        if not self.proved or self.omega_h is None or self.room is None or self.parameters is None:
            return f"nothing is proved: {self.status.value}{f' ({self.detail})' if self.detail else ''}."
        return sentence(self.claim())

    def claim(self) -> dict[str, Any]:
        """What is claimed, as a certificate says it. Only of what is proved."""
        assert self.parameters is not None
        assert self.omega_h is not None
        assert self.room is not None
        numbers = dict(zip(("omega_h", *EIGENVALUES), (self.omega_h, *self.saddle_eigenvalues), strict=True))
        return {
            "kind": "heteroclinic connection",
            "parameters": parameter_texts(self.parameters),
            "friction": self.parameters.friction,
            "unique": self.unique,
            "upright": self.upright,
            **{name: exact_text(part) for name, part in self.room._asdict().items()},
            "numbers": {name: number.to_dict() for name, number in numbers.items()},
        }

    def evidence(self) -> dict[str, Any]:
        """The choices that the kernel has accepted, as a certificate has them."""
        assert self.choices is not None
        return {name: as_text(part) for name, part in self.choices.items() if name != "arrived"}

    def certificate(self) -> str:
        """The text of a certificate. Only of what is proved."""
        claimed = ("room", "eigenvalues")
        evidence = {name: part for name, part in self.evidence().items() if name not in claimed}
        return certificate_text(self.claim(), self.bits, evidence)

    @property
    def limit_cycle(self) -> str | None:
        """What follows by Shilnikov's theorem; None if one of its hypotheses is not proved."""
        value = self.saddle_value
        if not (self.proved and self.unique and self.slowly and value and value.value + value.uncertainty < 0):
            return None
        if self.parameters is not None and self.parameters.friction == "smooth":
            return None  # the theorem asks for a smoother field
        other = "below" if self.turns_back == "above" else "above"
        return (
            "for the tippedisk, the friction law and the Omega_h of the statement, by Shilnikov's theorem: with gamma "
            "in R (not modulo 2 pi) the two connections and the saddles have a neighbourhood in which, for all speeds "
            f"close enough to Omega_h, there is exactly one periodic orbit {self.turns_back} Omega_h and none {other} "
            "it or at it; the orbit is asymptotically stable, the point symmetry maps it to itself, and its period "
            "tends to infinity as Omega tends to Omega_h."
        )

    def to_dict(self) -> dict[str, object]:
        room = None if self.room is None else {name: exact_text(x) for name, x in self.room._asdict().items()}
        return super().to_dict() | {"status": self.status.name.lower(), "room": room}


def not_proved(status: Status, bits: int = 0, detail: str = "") -> ProvedConnection:
    """The result without a proof."""
    return ProvedConnection(status, None, False, (), None, False, bits, detail)
