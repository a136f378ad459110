"""The limit cycles of an interval of speeds: polynomials and a box that `kernel.claims.interval` accepts.

Where a ball becomes a point or a float: the polynomials are rounded to decimals, which are then exact; radii are
chosen. What is printed of an enclosure holds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Any, ClassVar

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.closed_forms import refuse_past_birth
from tippedisk_verify.proofs.kernel.balls import ball, working_precision
from tippedisk_verify.proofs.kernel.claims.interval import (
    UNKNOWNS,
    beta_bound,
    interval_numbers,
    interval_test,
)
from tippedisk_verify.proofs.kernel.curves import OMEGA, Curve
from tippedisk_verify.proofs.kernel.field import constants
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.kernel.section import HALF, returned
from tippedisk_verify.proofs.numbers import WIDER, measured, widened
from tippedisk_verify.proofs.search.certificate import Proof, Stopped, claim_of
from tippedisk_verify.proofs.search.curve_choices import BITS, boxed, family_rows, two_digits
from tippedisk_verify.proofs.search.steps import Steps

__all__ = ["IntervalProof", "Status", "failed_interval", "prove_interval"]

_SHARE = Fraction(1, 10_000)  # of the box's radius in how far the family moves: it widens the enclosures by little


class Status(Enum):
    """How an attempted proof for an interval of speeds ended. The value says what happened and what to try next."""

    PROVED = "proved"
    NO_GUESS = "the ordinary road finds no limit cycle to start from"
    NO_RETURN = "the guess does not return to beta = pi/2: start closer to a cycle"
    NOT_FOLLOWED = "the orbits of all these speeds could not be followed from section to section: take a smaller radius"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box: take a smaller radius, or start closer to a cycle"


@dataclass(frozen=True, repr=False)
class IntervalProof(Proof):
    """What is proved of the limit cycles of all speeds with |Omega - omega| <= radius."""

    _told: ClassVar = ("stable", "beta_below", "unique_within", "enclosed_within", "curve")

    status: Status
    parameters: Parameters
    omega: Fraction  #: middle of the interval [rad/s], exact
    radius: Fraction  #: [rad/s], exact
    claim: Mapping[str, Any] = field(default_factory=dict)  #: see `kernel.claims.interval`; empty without a proof
    evidence: Mapping[str, Any] = field(default_factory=dict)

    @property
    def bits(self) -> int:  # type: ignore[override]
        return BITS

    @property
    def where(self) -> str:
        return f"Omega within {exact_text(self.radius)} rad/s of {exact_text(self.omega)} rad/s"

    @property
    def asked(self) -> dict[str, object]:
        return {"omega": Measured(self.omega, Fraction(0)).to_dict(), "radius": exact_text(self.radius)}

    @property
    def numbers(self) -> dict[str, Measured]:
        """Half-widths about values that hold the true one at each of the speeds; names as of `cycle`."""
        return {name: Measured.of(**number) for name, number in self.claim.get("numbers", {}).items()}


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
    start = [exact(number).rational for number in guess]
    with working_precision(BITS):
        try:
            claim, evidence = _searched(failed, [*map(ball, start)])
        except Stopped as fault:
            return replace(failed, status=Status[fault.status.name])
    return replace(failed, status=Status.PROVED, claim=claim, evidence=evidence)


def _searched(failed: IntervalProof, start: list[Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The claim and the evidence. Raises Stopped."""
    omega, radius = failed.omega, failed.radius
    ends = {"low": omega - radius, "high": omega + radius}
    claim = claim_of("limit cycles of an interval of speeds", failed.parameters, {}, omega=omega, radius=radius, **ends)
    equations, speed = constants(claim["parameters"]), ball(omega)
    flight = returned(Model(equations, speed.mid()), HALF, [part.mid() for part in start], Steps())
    if flight.status is not FlowStatus.RETURNED:
        raise Stopped(Status.NO_RETURN)
    rows = family_rows(equations, [*start, speed], ball(radius), flight.time.mid(), OMEGA, Curve)
    claim["curve"] = dict(zip(UNKNOWNS, rows.texts, strict=False))

    def named(radii: Sequence[Fraction]) -> dict[str, str]:
        return dict(zip(UNKNOWNS, map(exact_text, radii), strict=True))

    box = boxed(
        lambda radii, choices: interval_test(claim | {"unique_within": named(radii)}, rows.texts[2], choices),
        [abs(row[1]) * _SHARE for row in rows.numbers],
    )
    numbers = interval_numbers(box.arc)
    if not all(number.is_finite() for number in numbers.values()):
        raise Stopped(Status.NOT_INCLUDED)
    claim |= {
        "unique_within": named(box.radii),
        "enclosed_within": named(box.within),
        "beta_below": exact_text(min(two_digits(beta_bound(box.arc) * WIDER), Fraction(15707, 10000))),
        "stable": box.arc.stable(),
        "numbers": {name: widened(measured(number)).to_dict() for name, number in numbers.items()},
    }
    return claim, {"half": rows.texts[2], "steps": box.steps}
