"""What is proved of the limit cycles next to the connection of saddles; `connection_end` has the proof."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from typing import Any

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.proofs.kernel.balls import arb, ball, positive
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection

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

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def statement(self) -> str:
        if not self.proved or self.connection.omega_h is None or self.connection.parameters is None:
            return f"nothing is proved: {self.status.value}{f' ({self.detail})' if self.detail else ''}."
        parameters = self.connection.parameters
        middle, half_width = self.connection.omega_h.decimals()
        low, high, gamma, v = map(exact_text, (self.low, self.high, self.gamma, self.v))
        return (
            f"for the tippedisk with {parameters.definition()} under the {parameters.law} friction law let gamma be a "
            "real number, not an angle; let P be the half map from the section beta = pi/2, v < 0 along the flow to "
            "the next crossing of beta = pi/2, there v > 0, with |beta - pi/2| < pi/2 between, and by S: (beta, gamma, "
            "v) -> (pi - beta, pi - gamma, -v) back; "
            f"let Q be the set of the section's states with 3 pi/2 - {gamma} <= gamma < 3 pi/2 and -{v} rad/s <= v < "
            f"0; and let Omega_h be the speed of the heteroclinic connection, |Omega_h - {middle} rad/s| <= "
            f"{half_width} rad/s. For every Omega with Omega_h < Omega <= {high} rad/s P has exactly one fixed point "
            "in Q; the limit cycle through it is asymptotically stable, S maps it to itself, and it crosses beta = "
            "pi/2 exactly twice a period; as Omega grows, its period, its largest |beta - pi/2| and its gamma in Q "
            "fall strictly; as Omega falls to Omega_h, its period tends to infinity and the fixed point to (pi/2, 3 "
            f"pi/2, 0). For every Omega with {low} rad/s <= Omega <= Omega_h P has no fixed point in Q."
        )

    def meets(self, omega: Any, gamma_bar: Any, v: Any) -> bool:
        """Whether the fixed point of P that is in these balls of gamma_bar and v is the statement's, at all speeds of
        the ball ``omega``: then a curve of cycles that is proved there is the same curve.
        """
        if not self.proved or self.connection.omega_h is None:
            return False
        middle, half_width = self.connection.omega_h.value, self.connection.omega_h.uncertainty
        inside = (
            ball(omega) - ball(middle + half_width),
            ball(self.high) - omega,
            ball(gamma_bar) - arb.pi() + ball(self.gamma),
            arb.pi() - gamma_bar,
            ball(v) + ball(self.v),
            -ball(v),
        )
        return all(map(positive, inside))

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
