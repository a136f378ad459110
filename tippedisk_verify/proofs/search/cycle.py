"""Limit cycles, proved: the search for what the kernel's test (`kernel.claims.cycle`) is likely to pass.

A guess is sharpened by Newton's iteration on midpoints. The precision and the box's radii grow until the numbers have
the digits asked for; wider boxes are tried for how far the next fixed point must be. Whatever is chosen here, what is
said comes from a test that was passed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import exact_text, rounded_down
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.claims import cycle
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.kernel.krawczyk import FixedPoints, krawczyk_test, product
from tippedisk_verify.proofs.kernel.reading import dyadic_text
from tippedisk_verify.proofs.kernel.section import HALF, TURN, Return, Section, returned
from tippedisk_verify.proofs.kernel.sliding import model_of
from tippedisk_verify.proofs.kernel.step import magnitude
from tippedisk_verify.proofs.numbers import measured, widened
from tippedisk_verify.proofs.search.certificate import certificate_text, parameter_texts
from tippedisk_verify.proofs.search.steps import SearchedTest, Steps, midpoint_inverse

__all__ = ["HALF", "TURN", "Attempt", "OrbitProof", "Status", "prove_cycle"]


_GUARD_DIGITS = 6  # the box is that much smaller than the digits asked for
_GUARD_BITS = 40  # rounding over half a period costs about 10 of them
_FIRST_BITS = 96
_REMOTE_BITS = 64  # enough for the wide boxes that show how far the next fixed point must be
_REMOTE_BOXES = (12, 16, 22, 30, 40)  # -log2 of their radii relative to the state
_MOST_ITERATIONS = 25
_MOST_ATTEMPTS = 6


class Status(Enum):
    """How an attempted proof of a limit cycle ended. The value says what happened and what to try next."""

    PROVED = "proved"
    NO_GUESS = "the ordinary road finds no limit cycle to start from"
    NOT_FOLLOWED = "the flow could not be followed from section to section"
    NOT_CONVERGED = "the guess could not be sharpened to a fixed point: start closer to a cycle"
    TRIVIAL = "the guess falls onto the equilibrium: start closer to a cycle"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box: work in more bits, or from a better guess"
    TOO_FEW_DIGITS = (
        "a cycle is proved to exist, but its numbers are not enclosed to the digits asked for: work in more bits"
    )


@dataclass(frozen=True)
class OrbitProof:
    """What is proved of one limit cycle, librating (`HALF`) or rotating (`TURN`). Without a proof: None.

    Names of numbers are those of `cycles.limit_cycle.LimitCycle` and `RotatingCycle`.
    """

    section: Section
    status: Status
    where: str  #: how far the proof came
    parameters: Parameters
    omega: Fraction  #: [rad/s], exact
    bits: int  #: working precision
    values: Mapping[str, Any] = field(default_factory=dict)  #: the numbers, balls that hold the true ones, by name
    unique_within: Any = None  #: distances of the two coordinates within which the map has no other fixed point
    stable: bool | None = None  #: asymptotically stable (True) or unstable (False), proved; None if not decided
    reversals: int = 0  #: how often the sliding velocity changes its sign in a period, proved under the smooth law only
    evidence: Mapping[str, Any] | None = field(default=None, repr=False)  #: the choices that the kernel accepted

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        if not self.proved:
            return f"nothing is proved: {self.status.value} ({self.where})."
        return cycle.sentence(self.claim())

    def claim(self) -> dict[str, Any]:
        """What is proved, as certificates have it."""
        distances = zip(cycle.UNKNOWNS[self.section], self.unique_within, strict=True)
        claim = {
            "kind": next(kind for kind, section in cycle.KINDS.items() if section == self.section),
            **orbit_setting(self.parameters, self.omega),
            "numbers": {name: number.to_dict() for name, number in self.numbers().items()},
            "stable": self.stable,
            "unique_within": {name: _decimal_below(distance) for name, distance in distances},
        }
        return claim | ({"reversals": self.reversals} if self.parameters.friction == "smooth" else {})

    def certificate(self) -> str:
        """The proof as a file that the kernel alone checks. Raises InputError if there is no proof."""
        if self.evidence is None:
            raise InputError(self.statement)
        return certificate_text(self.claim(), self.bits, self.evidence)

    def lacking_bits(self, digits: int) -> int:
        """Bits by which the worst number misses ``digits`` significant digits, or decimals if it is no main result."""
        worst = 0
        for name, value in self.values.items():
            if not value.is_finite():
                return 64
            size = magnitude(value) if name in cycle.main(self.section) else max(0, magnitude(value))
            # 2^size may be twice the value, and 10^-digits is rounded: two bits for that.
            worst = max(worst, magnitude(value.rad()) - size + 2 + math.ceil(digits * math.log2(10)))
        return worst

    def numbers(self) -> dict[str, Measured]:
        """The enclosures, a little wider, as exact rational midpoints and radii.

        Raises InputError if there is no proof.
        """
        if not self.proved:
            raise InputError(self.statement)
        return {name: widened(measured(self.values[name])) for name in cycle.names(self.section)}

    def to_dict(self) -> dict[str, object]:
        """For the command line: the statement and, if proved, the numbers."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        entries["omega"] = Measured(self.omega, Fraction(0)).to_dict()
        if self.proved:
            claim = self.claim()
            entries |= claim["numbers"] | {"stable": self.stable}
            if self.parameters.friction == "smooth":
                entries["sliding_reversals"] = self.reversals
            entries["unique_within"] = claim["unique_within"]
        return entries | {"parameters": self.parameters.name, "bits": self.bits, "status": self.status.name}


def orbit_setting(parameters: Parameters, omega: Fraction) -> dict[str, Any]:
    """What a claim says of the disk, the law and the speed."""
    return {
        "parameters": parameter_texts(parameters),
        "friction": parameters.friction,
        "omega": exact_text(omega),
    }


def _decimal_below(x: Any) -> str:
    """A decimal of two digits that is below all numbers of the ball, by 2^-20 of them or more; 0 if they may be 0."""
    enclosure = measured(x)
    least = enclosure.value - enclosure.uncertainty
    return rounded_down(least * (1 - Fraction(1, 2**20))) if least > 0 else "0"


def prove_cycle(
    parameters: Parameters,
    omega: object,
    guess: Sequence[object],
    *,
    digits: int = 12,
    most_bits: int = 20_000,
    section: Section = HALF,
) -> OrbitProof:
    """Prove the limit cycle near ``guess`` at ``omega`` [rad/s] and enclose its numbers.

    The guess is (gamma_bar, v) at beta = pi/2 or, with ``section`` `TURN`, (beta_bar, v) at gamma = pi/2, of a few
    digits or more. Period, state and beta_max come to ``digits`` significant digits, the others to about as many;
    ``most_bits`` bounds the working precision. Raises InputError for input that makes no sense; whatever else prevents
    a proof is a status.
    """
    speed = exact(omega)
    if speed.pi_multiple or speed.rational <= 0:
        raise InputError(f"Omega must be a positive decimal, not {str(omega)[:40]}")
    if len(guess) != 2:
        raise InputError(f"a guess has two components: {'gamma_bar' if section == HALF else 'beta_bar'} and v")
    attempt = Attempt(parameters, speed.rational, digits, most_bits, section)
    return attempt.run([exact(part) for part in guess])


class Attempt:
    """A proof under way: the precision and box in use, and how to report an end."""

    def __init__(
        self, parameters: Parameters, omega: Fraction, digits: int, most_bits: int, section: Section = HALF
    ) -> None:
        self.parameters, self.omega, self.digits, self.most_bits = parameters, omega, digits, most_bits
        self.section, self.setting = section, orbit_setting(parameters, omega)
        self.box_bits = bits_for_digits(digits + _GUARD_DIGITS)
        self.bits = min(most_bits, self.box_bits + _GUARD_BITS)

    def ended(self, status: Status, where: str) -> OrbitProof:
        return OrbitProof(self.section, status, where, self.parameters, self.omega, self.bits)

    def not_followed(self, flight: Return) -> OrbitProof:
        return self.ended(Status.NOT_FOLLOWED, f"at t = {float(flight.reached):.4g} s: {flight.status.value}")

    def model(self) -> Model:
        """At the working precision, which must be in force."""
        return model_of(self.parameters, ball(self.omega))

    def run(self, guess: Sequence[Any]) -> OrbitProof:
        middle = self.sharpened(guess)
        if isinstance(middle, OrbitProof):
            return middle
        outcome: OrbitProof | None = None
        for _ in range(_MOST_ATTEMPTS):
            with working_precision(self.bits):
                sizes = [(abs(part) * arb(2) ** -self.box_bits).mid() for part in middle]
                radii = [arb(0, size) for size in sizes]
                choices = SearchedTest()
                at, drift = cycle.place(self.setting, middle)
                fixed = krawczyk_test(self.setting, self.section, at, [*radii, drift], (0, 1), choices)
                if isinstance(fixed, Return):
                    outcome, wanted = self.not_followed(fixed), self.bits + 64
                elif fixed.included:
                    proof = self.concluded(fixed, radii)
                    lacking = proof.lacking_bits(self.digits)
                    if not lacking:
                        return self.neighbourhood(proof, fixed, sizes, drift, choices)
                    outcome = self.ended(Status.TOO_FEW_DIGITS, f"{lacking} bits are lacking")
                    self.box_bits += lacking + 4
                    wanted = self.bits + lacking + 4
                    middle = [part.mid() for part in fixed.image[:2]]
                else:
                    outcome = self.ended(Status.NOT_INCLUDED, f"in {self.bits} bits")
                    wanted = self.bits + _shortage(fixed.residual, radii)
                    if all(part.is_finite() for part in fixed.image):
                        middle = [part.mid() for part in fixed.image[:2]]
            if wanted > self.most_bits:
                return outcome
            self.bits = wanted
        assert outcome is not None
        return outcome

    def sharpened(self, guess: Sequence[Any]) -> list[Any] | OrbitProof:
        """A point within the box's radius of the fixed point, by Newton's iteration on midpoints; or how that ended."""
        with working_precision(self.bits):
            state = [ball(part).mid() for part in guess]
        scale = float(abs(state[0])) + float(abs(state[1])) / 10
        if not scale > 0:
            return self.ended(Status.TRIVIAL, "the guess is the equilibrium")
        matrix: Any = None
        correct, gain = 0, 0  # -log2 of the last step's size relative to the state, and of the matrix's error
        for _ in range(_MOST_ITERATIONS):
            with working_precision(min(self.bits, max(_FIRST_BITS, 2 * correct + 64))):
                flight = returned(self.model(), self.section, state, Steps(), derivatives=matrix is None)
                if flight.status is not FlowStatus.RETURNED:
                    return self.not_followed(flight)
                if matrix is None:
                    (a, b), (c, d) = flight.matrix
                    matrix = ((a - 1, b), (c, d - 1))
                inverse = midpoint_inverse(matrix)
                step = product(inverse, [new - old for new, old in zip(flight.image, state, strict=True)])
                if not all(part.is_finite() for part in step):
                    return self.ended(Status.NOT_CONVERGED, "the derivative of the map is singular")
            with working_precision(self.bits):
                state = [(old - part).mid() for old, part in zip(state, step, strict=True)]
            if float(abs(state[0])) + float(abs(state[1])) / 10 < scale / 5:
                return self.ended(Status.TRIVIAL, "in Newton's iteration")
            size = max(magnitude(part) for part in step) - max(magnitude(part) for part in state)
            previous, correct = correct, -size
            if correct < 20:  # far off: a fresh derivative for the next step
                matrix, gain = None, 0
                continue
            gain = gain or correct
            # Within the box's radius, or within what this precision can tell.
            if correct + min(gain, correct) > min(self.box_bits + 4, self.bits - 16):
                return state
            if correct <= previous:  # a stale derivative
                matrix, gain = None, 0
        return self.ended(Status.NOT_CONVERGED, f"after {_MOST_ITERATIONS} steps of Newton's iteration")

    def neighbourhood(
        self, proof: OrbitProof, fixed: FixedPoints, sizes: Sequence[Any], drift: Any, choices: SearchedTest
    ) -> OrbitProof:
        """The proof with the widest box that passes the test, and with its evidence."""
        evidence = {
            "middle": [dyadic_text(part) for part in fixed.middle[:2]],
            "centre": choices.centre.log,
            "box": choices.written(sizes),
        }
        radii = [arb(0, size) for size in sizes]
        with working_precision(_REMOTE_BITS):
            for size in _REMOTE_BOXES:
                if size >= self.box_bits:
                    continue
                sizes = [(abs(part) * arb(2) ** -size).mid() for part in fixed.middle[:2]]
                wide, search = [arb(0, part) for part in sizes], SearchedTest()
                deviations = [*wide, drift]
                remote = krawczyk_test(
                    self.setting, self.section, fixed.middle, deviations, (0, 1), search, fixed.centre
                )
                if isinstance(remote, FixedPoints) and remote.included:
                    evidence["wide box"] = search.written(sizes) | {"bits": _REMOTE_BITS}
                    radii = wide
                    break
        return replace(proof, unique_within=cycle.apart(fixed, radii), evidence=evidence)

    def concluded(self, fixed: FixedPoints, radii: Sequence[Any]) -> OrbitProof:
        """The cycle's numbers from a test that was passed on a box of these radii, balls."""
        numbers = cycle.cycle_numbers(self.section, fixed)
        return OrbitProof(
            self.section,
            Status.PROVED,
            f"in {self.bits} bits, {fixed.centre.steps} + {fixed.box.steps} steps",
            self.parameters,
            self.omega,
            self.bits,
            numbers,
            cycle.apart(fixed, radii),
            cycle.stability(numbers),
            cycle.reversals(self.section, fixed),
        )


def _shortage(residual: Sequence[Any], radii: Sequence[Any]) -> int:
    """Bits that would bring the rounding errors of Y F(m) well below the box's radius; at least 16."""
    if not all(part.is_finite() for part in residual):
        return 64
    return max(16, 8 + max(magnitude(part.rad()) - magnitude(r) for part, r in zip(residual, radii, strict=True)))
