"""Folds of limit cycles, proved: the search for what the kernel's test (`kernel.claims.fold`) is likely to pass.

The arc is short, so that the slope of the speed is small on all of it: the speed comes to about twice the digits of its
length. Boxes are widened to what Krawczyk's image turns out to need; middles at the arc's ends come from chord steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits, checked_digits
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.claims import fold
from tippedisk_verify.proofs.kernel.claims.cycle import UNKNOWNS
from tippedisk_verify.proofs.kernel.flow import Model, Status
from tippedisk_verify.proofs.kernel.krawczyk import FixedPoints, krawczyk_test, product
from tippedisk_verify.proofs.kernel.reading import dyadic_text
from tippedisk_verify.proofs.kernel.section import HALF, TURN, Return, Section, returned
from tippedisk_verify.proofs.numbers import measured, widened
from tippedisk_verify.proofs.search.certificate import certificate_text, parameter_texts
from tippedisk_verify.proofs.search.steps import SearchedTest, Steps, midpoint_inverse

__all__ = ["HALF", "TURN", "FoldProof", "prove_fold"]

_GUARD_BITS = 60
_SHORTER = 5  # digits by which the arc is shorter than half the digits: enclosures of derivatives over it are wide
_SLOPE = 8  # of v along the arc [1/s], at first
_EXCESS = 2**26  # of the enclosure of Omega over the arc, in units of its squared half-length, at first
_INFLATIONS = 3
_CHORDS = 12


@dataclass(frozen=True)
class FoldProof:
    """What is proved of a fold of librating (`HALF`) or rotating (`TURN`) cycles."""

    section: Section
    proved: bool
    where: str  #: how far the proof came
    parameters: Parameters
    bits: int  #: working precision
    #: omega, the extreme speed on the arc [rad/s], the first coordinate on the section along the arc, v and the period
    values: Mapping[str, Measured] = field(default_factory=dict)
    extremum: Literal["smallest", "largest"] | None = None  #: which
    evidence: Mapping[str, Any] | None = field(default=None, repr=False)  #: the choices that the kernel accepted

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        return fold.sentence(self.claim()) if self.proved else f"nothing is proved: {self.where}."

    def claim(self) -> dict[str, Any]:
        """What is proved, as certificates have it."""
        return {
            "kind": next(kind for kind, section in fold.KINDS.items() if section == self.section),
            "parameters": parameter_texts(self.parameters),
            "friction": self.parameters.friction,
            "numbers": {name: number.to_dict() for name, number in self.values.items()},
            "extremum": self.extremum,
        }

    def certificate(self) -> str:
        """The proof as a file that the kernel alone checks. Raises InputError if there is no proof."""
        if self.evidence is None:
            raise InputError(self.statement)
        return certificate_text(self.claim(), self.bits, self.evidence)

    def to_dict(self) -> dict[str, object]:
        """For the command line."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        entries |= {name: value.to_dict() for name, value in self.values.items()}
        if self.extremum is not None:
            entries["extremum"] = self.extremum
        return entries | {"parameters": self.parameters.name, "bits": self.bits}


def prove_fold(
    parameters: Parameters, near: Sequence[object], *, digits: int = 12, section: Section = HALF
) -> FoldProof:
    """Prove the fold near a point (both coordinates on the section, Omega).

    The point is given to some more than ``digits`` digits; the fold's speed is enclosed to ``digits`` significant
    digits. What prevents a proof is said in the answer. Raises InputError under the smooth law.
    """
    parameters.refuse_smooth("the fold of limit cycles is proved")
    checked_digits(digits)
    p, v, omega = (Measured.of(part, 0).value for part in near)
    # On the arc the speed moves by its squared half-length.
    places = math.ceil(digits / 2) + _SHORTER
    # The arc is said as it is tested: its middle has the decimals that are printed beside its half-length.
    p = Fraction(round(p * 10 ** (places + 2)), 10 ** (places + 2))
    attempt = _Attempt(section, parameters, (p, v, omega), Fraction(1, 10**places), digits)
    with working_precision(attempt.bits):
        try:
            return attempt.run()
        except Unproved as fault:
            return FoldProof(section, False, str(fault), parameters, attempt.bits)


class _Attempt:
    """A proof under way: about which point, on which arc, in how many bits. What prevents it is raised as Unproved."""

    def __init__(
        self,
        section: Section,
        parameters: Parameters,
        near: tuple[Fraction, Fraction, Fraction],
        half_length: Fraction,
        digits: int,
    ) -> None:
        self.section, self.parameters, self.digits, self.half_length = section, parameters, digits, half_length
        self.p, *self.near = near
        self.bits = bits_for_digits(digits + 2 * _SHORTER + 4) + _GUARD_BITS  # the squared half-length, and some more
        self.setting = {"parameters": parameter_texts(parameters), "friction": parameters.friction}
        self.evidence: dict[str, Any] = {}

    def run(self) -> FoldProof:
        """The proof, at the working precision ``bits``, which must be in force."""
        length = ball(self.half_length)
        arc, *ends = fold.arc_balls(self.p, self.half_length)
        whole, room = self.whole(arc, length)
        sizes = [(length / 2**20).mid(), (length**2 * 2**10).mid()]
        points = [self.at_end(name, end, whole, sizes) for name, end in zip(fold.POINTS[1:], ends, strict=True)]
        extremum = fold.extremum(*map(fold.slope, points))
        if extremum is None:
            raise Unproved("Omega is not proved to rise at one end of the arc and to fall at the other")
        first, second = UNKNOWNS[self.section]
        values = {
            "omega": widened(measured(whole.image[2])),
            first: Measured(self.p, self.half_length),
            second: widened(measured(whole.image[1])),
            "period": widened(measured(self.section.laps * whole.box.time)),
        }
        proof = FoldProof(
            self.section,
            True,
            f"in {self.bits} bits",
            self.parameters,
            self.bits,
            values,
            extremum,
            self.evidence,
        )
        fold.judge(proof.claim(), self.section, [whole, *points], [arb(0, size) for size in room])
        if values["omega"].uncertainty > values["omega"].value / 10**self.digits:
            raise Unproved(f"the speed is not enclosed to {self.digits} digits: ask for more")
        return proof

    def whole(self, arc: Any, length: Any) -> tuple[FixedPoints, list[Any]]:
        """The cycles of all points of the arc, and the radii of their box, widened to what Krawczyk's image needs."""
        m, sizes = [ball(part).mid() for part in self.near], [(_SLOPE * length).mid(), (_EXCESS * length**2).mid()]
        for _ in range(1 + _INFLATIONS):
            fixed = self.test("arc", arc, m, sizes)
            if fixed.included:
                return fixed, sizes
            if not all(part.is_finite() for part in fixed.image):
                break
            m, sizes = ([getattr(part, name)() for part in fixed.image[1:]] for name in ("mid", "rad"))
            sizes = [2 * size for size in sizes]
        raise Unproved("on the arc, Krawczyk's image does not lie inside the box")

    def at_end(self, name: str, end: Any, whole: FixedPoints, sizes: Sequence[Any]) -> FixedPoints:
        """The cycle at an end of the arc."""
        (f, *first), (g, *second) = whole.slopes
        inverse = midpoint_inverse((first, second))
        along = [-factor for factor in product(inverse, (f, g))]  # d(v, Omega)/dp
        distance = end.mid() - whole.middle[0]
        m = [(part + slope * distance).mid() for part, slope in zip(whole.image[1:], along, strict=True)]
        fixed = self.test(name, end, *self.sharpened(end, m, sizes, inverse))
        if not fixed.included:
            raise Unproved("at an end of the arc, Krawczyk's image does not lie inside the box")
        return fixed

    def test(
        self, name: str, p: Any, m: Sequence[Any], sizes: Sequence[Any], centre: tuple[Steps, Return] | None = None
    ) -> FixedPoints:
        """Krawczyk's test about a point; its choices become the evidence."""
        choices, flight = SearchedTest(), None
        if centre is not None:
            choices.centre, flight = centre
        deviations = [p - p.mid(), *(arb(0, size) for size in sizes)]
        fixed = krawczyk_test(self.setting, self.section, [p.mid(), *m], deviations, (1, 2), choices, flight)
        if isinstance(fixed, Return):
            raise _not_followed(fixed)
        self.evidence[name] = {
            "middle": [dyadic_text(part) for part in m],
            "centre": choices.centre.log,
            "box": choices.written(sizes),
        }
        return fixed

    def sharpened(
        self, p: Any, m: Sequence[Any], sizes: Sequence[Any], inverse: Sequence[Any]
    ) -> tuple[Sequence[Any], Sequence[Any], tuple[Steps, Return]]:
        """A point well within the box of this p's cycle, by chord steps from near ``m``; the sizes; the flight."""
        for _ in range(_CHORDS):
            search = Steps()
            flight = returned(Model(ball_constants(self.parameters), m[1]), self.section, (p.mid(), m[0]), search)
            if flight.status is not Status.RETURNED:
                raise _not_followed(flight)
            value = [after - before for after, before in zip(flight.image, (p.mid(), m[0]), strict=True)]
            steps = product(inverse, value)
            if all(abs(step) < size / 4 for step, size in zip(steps, sizes, strict=True)):
                return m, sizes, (search, flight)
            m = [(part - step).mid() for part, step in zip(m, steps, strict=True)]
        raise Unproved("at an end of the arc, the iteration towards the cycle does not settle")


def _not_followed(flight: Return) -> Unproved:
    return Unproved(
        f"on the arc, the orbit could not be followed beyond t = {float(flight.reached):.4g} s: {flight.status.value}"
    )
