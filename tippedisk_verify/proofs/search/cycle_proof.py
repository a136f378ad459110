"""Proofs of limit cycles: the search for evidence that the kernel's test
(`kernel.certificates.cycle`) accepts.

A guess is refined by Newton's iteration on midpoints. The precision and the box change until the
numbers have the requested digits. Wider boxes are tried to bound the distance of the next fixed
point. Every statement comes from a test that was passed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Any, ClassVar

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import round_down
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import bits_for_digits
from tippedisk_verify.proofs.ball_conversions import ball_to_measured, field_for_disk, widened
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.certificates import cycle
from tippedisk_verify.proofs.kernel.krawczyk import KrawczykResult
from tippedisk_verify.proofs.kernel.poincare_map import (
    LIBRATING_SECTION,
    ROTATING_SECTION,
    PoincareImage,
    PoincareSection,
    enclose_poincare_map,
)
from tippedisk_verify.proofs.kernel.proved_flow import FlightStopped
from tippedisk_verify.proofs.kernel.small_matrices import matrix_times_vector, midpoint_inverse
from tippedisk_verify.proofs.kernel.step import log2_magnitude
from tippedisk_verify.proofs.search.proof_search import (
    Proof,
    SearchStopped,
    certificate_claim,
    first_success,
)
from tippedisk_verify.proofs.search.step_search import FlightStepSearch, searched_test

__all__ = ["LIBRATING_SECTION", "ROTATING_SECTION", "CycleProof", "CycleStatus", "prove_cycle"]


_GUARD_DIGITS = 6  # by these the box is smaller than the requested digits
_GUARD_BITS = 40  # rounding over half a period costs about 10 of them
_FIRST_BITS = 96
_WIDE_BOX_BITS = 64  # enough for the wide boxes, which bound the distance of the next fixed point
_WIDE_BOX_EXPONENTS = (12, 16, 22, 30, 40)  # -log2 of their radii relative to the state
_MAX_ITERATIONS = 25
_MAX_ATTEMPTS = 6


class CycleStatus(Enum):
    """The ways in which a proof of a limit cycle can end.

    Each value is a message with what to try next.
    """

    PROVED = "proved"
    NO_GUESS = "shooting in double precision did not converge to a limit cycle from which to start"
    NOT_FOLLOWED = "the flow could not be followed from section to section"
    NOT_CONVERGED = "the guess could not be refined to a fixed point: start closer to a cycle"
    TRIVIAL = "the guess falls onto the equilibrium: start closer to a cycle"
    NOT_INCLUDED = (
        "Krawczyk's image does not lie inside the box: work in more bits, or from a better guess"
    )
    TOO_FEW_DIGITS = (
        "a cycle is proved to exist, but its numbers are not enclosed to the requested digits: "
        "work in more bits"
    )


@dataclass(frozen=True, repr=False)
class CycleProof(Proof):
    """The proof of one limit cycle, librating (section `LIBRATING_SECTION`) or rotating (section
    `ROTATING_SECTION`).

    The numbers have the same names as in `cycles.limit_cycle.LimitCycle` and `RotatingCycle`.
    """

    _printed_claim_entries: ClassVar = ("stable", "reversals", "unique_within")

    section: PoincareSection
    status: CycleStatus
    outcome_detail: str  #: the place at which the proof ended
    parameters: Parameters
    omega: Fraction  #: [rad/s], exact
    bits: int  #: working precision
    #: The numbers, balls that hold the true ones, by name
    values: Mapping[str, Any] = field(default_factory=dict)
    #: Distances of the two coordinates within which the map has no other fixed point
    unique_within: Any = None
    #: Asymptotically stable (True) or unstable (False), proved; None if not decided
    stable: bool | None = None
    #: Sign changes of the sliding velocity in a period, under the smooth law only
    reversals: int = 0
    #: What the kernel accepted
    evidence: Mapping[str, Any] | None = field(default=None, repr=False)

    @property
    def claim(self) -> dict[str, Any]:
        """The claim of the certificate about this limit cycle, as a dictionary.

        It has the disk, the speed, the enclosed numbers, the stability and the distances within
        which the cycle is unique.
        """
        kind = next(kind for kind, section in cycle.KINDS.items() if section == self.section)
        distances = zip(cycle.COORDINATE_NAMES[self.section], self.unique_within, strict=True)
        room = {name: _two_digits_below(distance) for name, distance in distances}
        sliding = {"reversals": self.reversals} if self.parameters.law.two_sided else {}
        return certificate_claim(
            kind,
            self.parameters,
            self.numbers(),
            omega=self.omega,
            stable=self.stable,
            **sliding,
            unique_within=room,
        )

    @property
    def input_entries(self) -> dict[str, object]:
        return {"omega": Measured(self.omega, Fraction(0)).to_dict()}

    def lacking_bits(self, digits: int) -> int:
        """Return how many more bits the least accurate enclosure needs for ``digits`` digits; 0 if
        all have them, and 64 if one is unbounded.

        The digits are significant digits for the main results, and decimals for the other numbers.
        The number is up to two bits too large.
        """
        worst = 0
        for name, value in self.values.items():
            if not value.is_finite():
                return 64
            size = (
                log2_magnitude(value)
                if name in cycle.main_numbers(self.section)
                else max(0, log2_magnitude(value))
            )
            # 2^size may be twice the value, and 10^-digits is rounded: two bits for that.
            worst = max(
                worst, log2_magnitude(value.rad()) - size + 2 + math.ceil(digits * math.log2(10))
            )
        return worst

    def numbers(self) -> dict[str, Measured]:
        """Return the enclosed numbers of the cycle by name, as exact rational midpoints and radii.

        The radii are slightly widened. Raises InputError if nothing is proved.
        """
        if not self.proved:
            raise InputError(self.statement)
        return {
            name: widened(ball_to_measured(self.values[name]))
            for name in cycle.claimed_names(self.section)
        }


def _two_digits_below(x: Any) -> str:
    """Return a decimal of two digits below all numbers of the ball, with a relative margin of
    2^-20.

    Returns "0" if there is no positive one.
    """
    enclosure = ball_to_measured(x)
    least = enclosure.value - enclosure.uncertainty
    return round_down(least * (1 - Fraction(1, 2**20))) if least > 0 else "0"


def prove_cycle(
    parameters: Parameters,
    omega: object,
    guess: Sequence[object],
    *,
    digits: int = 12,
    max_bits: int = 20_000,
    section: PoincareSection = LIBRATING_SECTION,
) -> CycleProof:
    """Prove the limit cycle near ``guess`` at ``omega`` [rad/s] and enclose its numbers.

    The guess is (gamma_bar, v) at beta = pi/2 or, with ``section`` `ROTATING_SECTION`, (beta_bar,
    v) at gamma = pi/2, of a few digits or more. Period, state and beta_max are enclosed to
    ``digits`` significant digits, the others to about as many. ``max_bits`` bounds the working
    precision. Raises InputError for a guess or speed out of range. Any other failure is a status.
    """
    attempt = CycleAttempt(parameters, checked_speed(omega), digits, max_bits, section)
    if len(guess) != 2:
        raise InputError(
            f"a guess has two components: {'gamma_bar' if section == LIBRATING_SECTION else 'beta_bar'} and v"
        )
    try:
        middle = attempt.refined_guess([exact(part) for part in guess])
        return first_success(attempt.test_about, middle, _MAX_ATTEMPTS)
    except SearchStopped as fault:
        return CycleProof(
            section, fault.status, str(fault), parameters, attempt.omega, attempt.bits
        )


class CycleAttempt:
    """The search for a proof of one limit cycle at one speed, with its current precision and box
    size.

    `test_about` applies Krawczyk's test to a box about a refined guess. It is repeated with more
    bits until the cycle is proved to the wanted digits.
    """

    def __init__(
        self,
        parameters: Parameters,
        omega: Fraction,
        digits: int,
        max_bits: int,
        section: PoincareSection,
    ) -> None:
        self.parameters, self.omega, self.digits, self.max_bits = (
            parameters,
            omega,
            digits,
            max_bits,
        )
        self.section, self.setting = section, certificate_claim("", parameters, {}, omega=omega)
        self.box_bits = bits_for_digits(digits + _GUARD_DIGITS)
        self.bits = min(max_bits, self.box_bits + _GUARD_BITS)

    def test_about(self, middle: Sequence[Any]) -> CycleProof:
        """Test the box about ``middle``, both coordinates on the section, and return the proof."""
        with working_precision(self.bits):
            at, speed_deviation = cycle.box_centre(self.setting, middle)
            try:
                fixed, evidence = self.test_box(at, speed_deviation, self.box_bits)
            except FlightStopped as fault:
                raise self.stopped(CycleStatus.NOT_FOLLOWED, f"at {fault}", 64, middle) from None
            if all(part.is_finite() for part in fixed.image):
                middle = [part.mid() for part in fixed.image[:2]]
            if not fixed.included:
                detail, lacking = f"in {self.bits} bits", _lacking_bits(fixed, evidence)
                raise self.stopped(CycleStatus.NOT_INCLUDED, detail, lacking, middle)
            values = cycle.cycle_numbers(self.section, fixed)
            proof = CycleProof(
                self.section,
                CycleStatus.PROVED,
                f"in {self.bits} bits, {fixed.centre.steps} + {fixed.box.steps} steps",
                self.parameters,
                self.omega,
                self.bits,
                values,
                stable=cycle.stability(values),
                reversals=cycle.reversals_per_period(self.section, fixed),
            )
            if lacking := proof.lacking_bits(self.digits):
                self.box_bits += lacking + 4
                detail = f"{lacking} bits are lacking"
                raise self.stopped(CycleStatus.TOO_FEW_DIGITS, detail, lacking + 4, middle)
            return self.with_uniqueness_distances(proof, fixed, speed_deviation, evidence)

    def stopped(
        self, status: CycleStatus, detail: str, extra_bits: int, middle: Sequence[Any]
    ) -> SearchStopped:
        """Return the fault of an attempt, and raise the precision for the next one, about
        ``middle``, unless it would be too high.
        """
        if self.bits + extra_bits > self.max_bits:
            return SearchStopped(status, detail)
        self.bits += extra_bits
        return SearchStopped(status, detail, middle)

    def test_box(
        self,
        middle: Sequence[Any],
        speed_deviation: Any,
        size: int,
        centre: tuple[FlightStepSearch, PoincareImage] | None = None,
    ) -> tuple[KrawczykResult, dict[str, Any]]:
        """Apply Krawczyk's test to a box whose radii are 2^-size times the state at its centre.

        Args:
            middle: The box's centre: both coordinates on the section, and the speed.
            speed_deviation: A ball of the speed's deviation from the centre.
            size: The exponent of the radii.
            centre: The search and the map at the centre, if they have already been computed.

        Returns:
            The test's result, and the evidence.

        Raises:
            FlightStopped: If the flights are not shown to return to the section.
        """
        radii = [(abs(part) * arb(2) ** -size).mid() for part in middle[:2]]
        return searched_test(
            self.setting, self.section, (0, 1), middle, radii, speed_deviation, centre
        )

    def refined_guess(self, guess: Sequence[Any]) -> Sequence[Any]:
        """Refine a guess of a limit cycle by Newton's iteration on midpoints, until its distance
        from the cycle is less than the radius of the box to be tested.
        """
        with working_precision(self.bits):
            state = [ball(part).mid() for part in guess]
        scale = float(abs(state[0])) + float(abs(state[1])) / 10
        if not scale > 0:
            raise SearchStopped(CycleStatus.TRIVIAL, "the guess is the equilibrium")
        matrix: Any = None
        # -log2 of the last step's size relative to the state, and of the matrix's error
        correct, gain = 0, 0
        for _ in range(_MAX_ITERATIONS):
            with working_precision(min(self.bits, max(_FIRST_BITS, 2 * correct + 64))):
                try:
                    image = enclose_poincare_map(
                        field_for_disk(self.parameters, ball(self.omega)),
                        self.section,
                        state,
                        FlightStepSearch(),
                        derivatives=matrix is None,
                    )
                except FlightStopped as fault:
                    raise SearchStopped(CycleStatus.NOT_FOLLOWED, f"at {fault}") from None
                if matrix is None:
                    (a, b, _), (c, d, _) = image.image_by_start
                    matrix = ((a - 1, b), (c, d - 1))
                inverse = midpoint_inverse(matrix)
                step = matrix_times_vector(
                    inverse, [new - old for new, old in zip(image.image, state, strict=True)]
                )
                if not all(part.is_finite() for part in step):
                    raise SearchStopped(
                        CycleStatus.NOT_CONVERGED, "the derivative of the map is singular"
                    )
            with working_precision(self.bits):
                state = [(old - part).mid() for old, part in zip(state, step, strict=True)]
            if float(abs(state[0])) + float(abs(state[1])) / 10 < scale / 5:
                raise SearchStopped(CycleStatus.TRIVIAL, "in Newton's iteration")
            size = max(log2_magnitude(part) for part in step) - max(
                log2_magnitude(part) for part in state
            )
            previous, correct = correct, -size
            if correct < 20:  # far off: a fresh derivative for the next step
                matrix, gain = None, 0
                continue
            gain = gain or correct
            # Within the box's radius, or within the limits of this precision.
            if correct + min(gain, correct) > min(self.box_bits + 4, self.bits - 16):
                return state
            if correct <= previous:  # a stale derivative
                matrix, gain = None, 0
        raise SearchStopped(
            CycleStatus.NOT_CONVERGED, f"after {_MAX_ITERATIONS} steps of Newton's iteration"
        )

    def with_uniqueness_distances(
        self,
        proof: CycleProof,
        fixed: KrawczykResult,
        speed_deviation: Any,
        evidence: dict[str, Any],
    ) -> CycleProof:
        """Return the proof of a cycle, completed by its evidence and a distance to any other cycle.

        Wider boxes than that of the proof are tested, the widest first. The first one that passes
        gives distances within which there is no second fixed point.
        """
        with working_precision(_WIDE_BOX_BITS):
            for size in _WIDE_BOX_EXPONENTS:
                if size >= self.box_bits:
                    break
                with suppress(FlightStopped):
                    wide_result, wide = self.test_box(
                        fixed.middle, speed_deviation, size, (evidence["centre"], fixed.centre)
                    )
                    if wide_result.included:
                        evidence["wide box"] = wide["box"] | {"bits": _WIDE_BOX_BITS}
                        break
        radii = [arb(0, size) for size in evidence.get("wide box", evidence["box"])["radii"]]
        return replace(proof, unique_within=cycle.uniqueness_radii(fixed, radii), evidence=evidence)


def _lacking_bits(fixed: KrawczykResult, evidence: Mapping[str, Any]) -> int:
    """Return the number of extra bits, at least 16, with which the next test of a box should
    compute.

    With them the rounding errors of Y F(m), the residual term of Krawczyk's operator, are well
    below the box's radius.
    """
    if not all(part.is_finite() for part in fixed.residual):
        return 64
    pairs = zip(fixed.residual, evidence["box"]["radii"], strict=True)
    return max(
        16, 8 + max(log2_magnitude(part.rad()) - log2_magnitude(size) for part, size in pairs)
    )
