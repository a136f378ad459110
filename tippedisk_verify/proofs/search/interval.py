"""The limit cycles of an interval of speeds: polynomials and a box that `kernel.claims.interval` accepts.

Where a ball becomes a point or a float: the polynomials are rounded to decimals, which are then exact; radii are
chosen. What is printed of an enclosure holds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.closed_forms import refuse_past_birth
from tippedisk_verify.proofs.kernel.arc import OMEGA, Arc
from tippedisk_verify.proofs.kernel.balls import Unproved, ball, working_precision
from tippedisk_verify.proofs.kernel.claims.interval import (
    KINDS,
    UNKNOWNS,
    beta_bound,
    interval_numbers,
    interval_test,
    sentence,
)
from tippedisk_verify.proofs.kernel.curves import Curve
from tippedisk_verify.proofs.kernel.field import constants
from tippedisk_verify.proofs.numbers import WIDER, measured, widened
from tippedisk_verify.proofs.search.certificate import certificate_text, parameter_texts
from tippedisk_verify.proofs.search.curve_choices import (
    BITS,
    StepSearch,
    decimal_above,
    duration,
    family_polynomials,
    rounded_jet,
    two_digits,
)

__all__ = ["IntervalProof", "Status", "failed_interval", "prove_interval"]

_DEGREE = 4
_SHARE = Fraction(1, 10_000)  # of the box's radius in how far the family moves: it widens the enclosures by little
_LEAST = Fraction(1, 10**12)  # a box's radius [rad, rad/s]
_MOST_ATTEMPTS = 3


class Status(Enum):
    """How an attempted proof for an interval of speeds ended. The value says what happened and what to try next."""

    PROVED = "proved"
    NO_GUESS = "the ordinary road finds no limit cycle to start from"
    NO_RETURN = "the guess does not return to beta = pi/2: start closer to a cycle"
    NOT_FOLLOWED = "the orbits of all these speeds could not be followed from section to section: take a smaller radius"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box: take a smaller radius, or start closer to a cycle"


@dataclass(frozen=True)
class IntervalProof:
    """What is proved of the limit cycles of all speeds with |Omega - omega| <= radius."""

    status: Status
    parameters: Parameters
    omega: Fraction  #: middle of the interval [rad/s], exact
    radius: Fraction  #: [rad/s], exact
    claim: Mapping[str, Any] = field(default_factory=dict)  #: see `kernel.claims.interval`; empty without a proof
    evidence: Mapping[str, Any] = field(default_factory=dict)

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def numbers(self) -> dict[str, Measured]:
        """Half-widths about values that hold the true one at each of the speeds; names as of `cycle`."""
        return {name: Measured.of(**number) for name, number in self.claim.get("numbers", {}).items()}

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        if self.proved:
            return sentence(self.claim)
        middle, radius = exact_text(self.omega), exact_text(self.radius)
        return f"nothing is proved of Omega within {radius} rad/s of {middle} rad/s: {self.status.value}."

    def to_dict(self) -> dict[str, object]:
        """For the command line: the statement and, if proved, the numbers."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        entries["omega"] = Measured(self.omega, Fraction(0)).to_dict()
        entries["radius"] = exact_text(self.radius)
        if self.proved:
            names = ("stable", "beta_below", "unique_within", "enclosed_within", "curve")
            entries |= self.claim["numbers"] | {name: self.claim[name] for name in names}
        return entries | {"parameters": self.parameters.name, "bits": BITS, "status": self.status.name}

    def certificate(self) -> str:
        """The text of a certificate of what is proved."""
        return certificate_text(self.claim, BITS, self.evidence)


def failed_interval(
    parameters: Parameters, omega: object, radius: object, status: Status = Status.NO_GUESS
) -> IntervalProof:
    """That nothing is proved. Raises InputError for the smooth law, and for speeds that make no sense for the disk."""
    parameters.refuse_smooth("the limit cycles of an interval of speeds are proved")
    speed, around = checked_speed(omega), exact(radius)
    if around.pi_multiple or not 0 < around.rational < speed:
        raise InputError(f"the radius must be a positive decimal less than Omega, not {str(radius)[:40]}")
    refuse_past_birth(parameters, speed + around.rational)
    return IntervalProof(status, parameters, speed, around.rational)


def prove_interval(parameters: Parameters, omega: object, radius: object, guess: Sequence[object]) -> IntervalProof:
    """Prove the limit cycles of all speeds within ``radius`` of ``omega`` [rad/s].

    ``guess`` = (gamma_bar, v) of the one at ``omega``, to some digits. Raises InputError for input that makes no sense;
    whatever else prevents a proof is a status.
    """
    if len(guess) != 2:
        raise InputError("a guess has two components: gamma_bar and v")
    failed = failed_interval(parameters, omega, radius, Status.NO_RETURN)
    disk = parameter_texts(parameters)
    with working_precision(BITS):
        equations, speed, width = constants(disk), ball(failed.omega), ball(failed.radius)
        start = [ball(exact(number).rational) for number in guess]
        total = duration(equations, speed.mid(), *start)
        if total is None:
            return failed
        failed = replace(failed, status=Status.NOT_FOLLOWED)
        polynomials, half = family_polynomials(equations, [*start, speed], width, _DEGREE, total, OMEGA, Curve)
        if not all(entry.is_finite() for jet in (*polynomials, half) for entry in jet.c):
            return failed
        curve, times = [rounded_jet(jet) for jet in polynomials[:2]], list(map(exact_text, rounded_jet(half)))
        claim: dict[str, Any] = {
            "kind": KINDS[0],
            "parameters": disk,
            "friction": "linear",
            "omega": exact_text(failed.omega),
            "radius": exact_text(failed.radius),
            "low": exact_text(failed.omega - failed.radius),
            "high": exact_text(failed.omega + failed.radius),
            "curve": {name: list(map(exact_text, row)) for name, row in zip(UNKNOWNS, curve, strict=True)},
        }
        radii = [two_digits(max(abs(row[1]) * _SHARE, _LEAST)) for row in curve]
        for _ in range(_MOST_ATTEMPTS):
            choices, box = StepSearch(), dict(zip(UNKNOWNS, map(exact_text, radii), strict=True))
            try:
                arc = interval_test(claim | {"unique_within": box}, times, choices)
            except Unproved:
                return failed
            if not all(off.is_finite() for off in arc.within):
                return failed
            within = [decimal_above(off) for off in arc.within]
            numbers = interval_numbers(arc)
            if arc.included and all(a <= b for a, b in zip(within, radii, strict=True)):
                if not all(number.is_finite() for number in numbers.values()):
                    break
                near = dict(zip(UNKNOWNS, map(exact_text, within), strict=True))
                claim |= {"unique_within": box, "enclosed_within": near} | _claimed(arc, numbers)
                return replace(
                    failed, status=Status.PROVED, claim=claim, evidence={"half": times, "steps": choices.log}
                )
            radii = [two_digits(2 * part) for part in within]
        return replace(failed, status=Status.NOT_INCLUDED)


def _claimed(arc: Arc, numbers: Mapping[str, Any]) -> dict[str, Any]:
    """What is claimed beside the box."""
    below = two_digits(beta_bound(arc) * WIDER)
    return {
        "beta_below": exact_text(min(below, Fraction(15707, 10000))),
        "stable": arc.stable(),
        "numbers": {name: widened(measured(number)).to_dict() for name, number in numbers.items()},
    }
