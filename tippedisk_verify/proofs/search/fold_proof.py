"""Proofs of folds of limit cycles: the search for evidence that the kernel
(`kernel.certificates.fold`) accepts.

The arc is short, so the slope of the speed is small on all of it: the speed has about twice the
digits of the arc's length. Boxes are widened until they hold Krawczyk's image. Middles at the arc's
ends come from chord steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar, Literal

from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import bits_for_digits, checked_digits
from tippedisk_verify.proofs.ball_conversions import ball_to_measured, field_for_disk, widened
from tippedisk_verify.proofs.kernel.balls import (
    Unproved,
    arb,
    ball,
    require,
    working_precision,
)
from tippedisk_verify.proofs.kernel.certificates import fold
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
from tippedisk_verify.proofs.search.proof_search import (
    Proof,
    SearchStopped,
    certificate_claim,
    first_success,
)
from tippedisk_verify.proofs.search.step_search import FlightStepSearch, searched_test

__all__ = ["LIBRATING_SECTION", "ROTATING_SECTION", "FoldProof", "prove_fold"]

_GUARD_BITS = 60
# The arc's length has this many digits more than half the requested ones, because enclosures of
# derivatives over it are wide.
_ARC_DIGITS = 5
_FIRST_SLOPE = 8  # of v along the arc [1/s], at first
# First radius of Omega's enclosure over the arc, in units of the squared half-length
_FIRST_WIDTH = 2**26
_INFLATIONS = 3
_MAX_CHORD_STEPS = 12

Box = tuple[list[Any], list[Any]]  #: the middle and the radii of v and Omega


@dataclass(frozen=True, repr=False)
class FoldProof(Proof):
    """The proof of a fold, where two limit cycles merge: an extremum of Omega along a family.

    The cycles are librating (section `LIBRATING_SECTION`) or rotating (section `ROTATING_SECTION`).
    """

    _printed_claim_entries: ClassVar = ("extremum",)

    section: PoincareSection
    outcome_detail: str  #: the reason for which the proof ended
    parameters: Parameters
    bits: int  #: working precision
    #: The extreme speed on the arc, omega [rad/s], the first coordinate on the section along the
    #: arc, v [rad/s] and the period [s]
    values: Mapping[str, Measured] = field(default_factory=dict)
    extremum: Literal["smallest", "largest"] | None = None  #: the kind of extremum
    #: What the kernel accepted
    evidence: Mapping[str, Any] | None = field(default=None, repr=False)

    status = None  #: a fold has no status: ``outcome_detail`` gives the reason of a failure

    @property
    def proved(self) -> bool:
        return bool(self.values)

    @property
    def reason(self) -> str:
        return self.outcome_detail

    @property
    def claim(self) -> dict[str, Any]:
        """The claim of the certificate about this fold, as a dictionary."""
        kind = next(kind for kind, section in fold.KINDS.items() if section == self.section)
        return certificate_claim(kind, self.parameters, self.values, extremum=self.extremum)


def prove_fold(
    parameters: Parameters,
    near: Sequence[object],
    *,
    digits: int = 12,
    section: PoincareSection = LIBRATING_SECTION,
) -> FoldProof:
    """Prove a fold of limit cycles near a given point and enclose its speed to ``digits``
    significant digits.

    The point consists of both coordinates on the section and Omega. It needs a few more than
    ``digits`` digits. If the proof fails, the result gives the reason. Raises InputError under the
    smooth law.
    """
    parameters.refuse_unless_linear("the fold of limit cycles is proved")
    digits = checked_digits(digits)
    p, v, omega = (Measured.of(part, 0).value for part in near)
    # On the arc the speed moves by its squared half-length.
    places = math.ceil(digits / 2) + _ARC_DIGITS
    # The printed arc is exactly the tested one, so its middle has no more decimals than its
    # half-length.
    arc = Measured(round(p, places + 2), Fraction(1, 10**places))
    # Enough for the squared half-length, with a margin
    bits = bits_for_digits(digits + 2 * _ARC_DIGITS + 4) + _GUARD_BITS
    attempt = _FoldAttempt(section, parameters, (v, omega), arc)
    with working_precision(bits):
        try:
            extremum, values = attempt.run()
            faint = f"the speed is not enclosed to {digits} digits: ask for more"
            require(values["omega"].uncertainty <= values["omega"].value / 10**digits, faint)
        except FlightStopped as fault:
            reason = f"on the arc, the orbit could not be followed beyond {fault}"
            return FoldProof(section, reason, parameters, bits)
        except Unproved as fault:
            return FoldProof(section, str(fault), parameters, bits)
    return FoldProof(
        section, f"in {bits} bits", parameters, bits, values, extremum, attempt.evidence
    )


class _FoldAttempt:
    """A proof of a fold in progress, near one point and on one arc of cycles.

    Failures are raised as Unproved.
    """

    def __init__(
        self,
        section: PoincareSection,
        parameters: Parameters,
        near: tuple[Fraction, Fraction],
        arc: Measured,
    ) -> None:
        self.section, self.parameters, self.near, self.arc = section, parameters, near, arc
        self.evidence: dict[str, Any] = {}

    def run(self) -> tuple[Literal["smallest", "largest"], dict[str, Measured]]:
        """Prove the fold at the current working precision. Return the kind of the extremum of
        Omega, and the enclosed numbers.
        """
        p, *ends = fold.arc_balls(self.arc.value, self.arc.uncertainty)
        length = ball(self.arc.uncertainty)
        whole = self.test_arc(p, length)
        radii = [(length / 2**20).mid(), (length**2 * 2**10).mid()]
        points = [
            self.test_end(name, end, whole, radii)
            for name, end in zip(fold.TEST_NAMES[1:], ends, strict=True)
        ]
        extremum = fold.extremum(*map(fold.speed_slope, points))
        if extremum is None:
            raise Unproved(
                "Omega is not proved to rise at one end of the arc and to fall at the other"
            )
        v, omega, period = map(
            ball_to_measured, (*whole.image[1:], self.section.flights_per_period * whole.box.time)
        )
        numbers = (widened(omega), self.arc, widened(v), widened(period))
        values = dict(zip(fold.claimed_names(self.section), numbers, strict=True))
        claim = certificate_claim("", self.parameters, values, extremum=extremum)
        fold.require_extremum(
            claim,
            self.section,
            [whole, *points],
            [arb(0, x) for x in self.evidence["arc"]["box"]["radii"]],
        )
        return extremum, values

    def test_arc(self, arc: Any, length: Any) -> KrawczykResult:
        """Apply Krawczyk's test to the limit cycles of all points of the arc, and return the passed
        test.

        The box is widened until it holds Krawczyk's image.
        """

        def attempt(box: Box) -> KrawczykResult:
            fixed = self.test_box("arc", arc, *box)
            if fixed.included:
                return fixed
            image, finite = fixed.image[1:], all(part.is_finite() for part in fixed.image)
            wider = [part.mid() for part in image], [2 * part.rad() for part in image]
            refusal = "on the arc, Krawczyk's image does not lie inside the box"
            raise SearchStopped(None, refusal, wider if finite else None)

        first_radii = [(_FIRST_SLOPE * length).mid(), (_FIRST_WIDTH * length**2).mid()]
        first_box = [ball(part).mid() for part in self.near], first_radii
        return first_success(attempt, first_box, 1 + _INFLATIONS)

    def test_end(
        self, name: str, end: Any, whole: KrawczykResult, radii: Sequence[Any]
    ) -> KrawczykResult:
        """Apply Krawczyk's test to the limit cycle at an end of the arc, and return the passed
        test.

        Chord steps first approximate that cycle.
        """
        (f, *first), (g, *second) = whole.jacobian
        inverse, p = midpoint_inverse((first, second)), end.mid()
        along, distance = (
            matrix_times_vector(inverse, (f, g)),
            p - whole.middle[0],
        )  # -d(v, Omega)/dp
        m = [
            (part - slope * distance).mid()
            for part, slope in zip(whole.image[1:], along, strict=True)
        ]
        for _ in range(_MAX_CHORD_STEPS):
            search, start = FlightStepSearch(), (p, m[0])
            image = enclose_poincare_map(
                field_for_disk(self.parameters, m[1]), self.section, start, search
            )
            steps = matrix_times_vector(
                inverse, [after - before for after, before in zip(image.image, start, strict=True)]
            )
            if all(abs(step) < size / 4 for step, size in zip(steps, radii, strict=True)):
                break
            m = [(part - step).mid() for part, step in zip(m, steps, strict=True)]
        else:
            raise Unproved("at an end of the arc, the iteration towards the cycle does not settle")
        fixed = self.test_box(name, end, m, radii, (search, image))
        require(
            fixed.included, "at an end of the arc, Krawczyk's image does not lie inside the box"
        )
        return fixed

    def test_box(
        self,
        name: str,
        p: Any,
        m: Sequence[Any],
        radii: Sequence[Any],
        centre: tuple[FlightStepSearch, PoincareImage] | None = None,
    ) -> KrawczykResult:
        """Apply Krawczyk's test to a limit cycle in a box about a point, and store the
        evidence.
        """
        setting, middle = certificate_claim("", self.parameters, {}), [p.mid(), *m]
        fixed, self.evidence[name] = searched_test(
            setting, self.section, (1, 2), middle, radii, p - p.mid(), centre
        )
        return fixed
