"""What is proved of the limit cycles next to the connection of saddles; the kernel has the proof."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from typing import Any

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.proofs.kernel.claims.connection_cycles import End, sentence
from tippedisk_verify.proofs.search.certificate import as_text, certificate_text, parameter_texts
from tippedisk_verify.proofs.search.proved_connection import ProvedConnection

__all__ = ["ProvedEnd", "Status"]


class Status(Enum):
    """How the proof ended. The value says where it stopped and what to try next."""

    PROVED = "proved"
    NO_CONNECTION = "the connection itself is not proved: give the answer of `prove_connection` with its digits"
    NO_LID = "no cycle passes the saddle near enough at the largest speed: ask for a smaller reach"
    FLIGHT = "the flight between the saddles could not be enclosed: ask for a smaller reach"
    INEQUALITY = "an inequality of the proof does not hold: ask for a smaller reach"
    APART = "the connection could not be followed into the box of its own theorem: prove it to more digits"


@dataclass(frozen=True)
class ProvedEnd:
    """What is proved of the cycles at speeds from ``low`` to ``high`` [rad/s]; nothing without status PROVED."""

    status: Status
    connection: ProvedConnection
    low: Fraction
    high: Fraction
    gamma: Fraction = Fraction(0)  #: c [rad]
    v: Fraction = Fraction(0)  #: d [rad/s]
    numbers: dict[str, str] = field(default_factory=dict)  #: kappa and other sizes in the proof
    detail: str = ""
    choices: dict[str, Any] | None = None  #: that the kernel has accepted

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def statement(self) -> str:
        if not self.proved or self.connection.omega_h is None or self.connection.parameters is None:
            return f"nothing is proved: {self.status.value}{f' ({self.detail})' if self.detail else ''}."
        return sentence(self.claim())

    def claim(self) -> dict[str, Any]:
        """What is claimed, as a certificate says it. Only of what is proved."""
        assert self.connection.omega_h is not None
        assert self.connection.parameters is not None
        names = ("low", "high", "gamma", "v")
        return {
            "kind": "cycles next to the connection",
            "parameters": parameter_texts(self.connection.parameters),
            "friction": self.connection.parameters.friction,
            "numbers": {"omega_h": self.connection.omega_h.to_dict()},
            **{name: exact_text(getattr(self, name)) for name in names},
        }

    def evidence(self) -> dict[str, Any]:
        """The choices that the kernel has accepted, with those of the connection, as a certificate has them."""
        assert self.choices is not None
        entry = {name: part for name, part in self.choices["entry"].items() if name not in ("gamma", "v")}
        return {**as_text(self.choices | {"entry": entry}), "connection": self.connection.evidence()}

    def certificate(self) -> str:
        """The text of a certificate. Only of what is proved."""
        return certificate_text(self.claim(), self.connection.bits, self.evidence())

    def meets(self, omega: Any, gamma_bar: Any, v: Any) -> bool:
        """Whether the fixed point of P that is in these balls of gamma_bar and v is the statement's, at all speeds of
        the ball ``omega``: then a curve of cycles that is proved there is the same curve.
        """
        if not self.proved or self.connection.omega_h is None:
            return False
        above = self.connection.omega_h.value + self.connection.omega_h.uncertainty
        return End(self.low, self.high, above, self.gamma, self.v).meets(omega, gamma_bar, v)

    def to_dict(self) -> dict[str, object]:
        return {
            "proved": self.proved,
            "status": self.status.name.lower(),
            "statement": self.statement,
            "omega_h": None if self.connection.omega_h is None else self.connection.omega_h.to_dict(),
            "from": exact_text(self.low),
            "to": exact_text(self.high),
            "gamma": exact_text(self.gamma),
            "v": exact_text(self.v),
            "numbers": self.numbers,
        }
