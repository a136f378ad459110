"""An arc of the family of limit cycles over an interval of amplitudes a = gamma_bar_0: what its evidence shows.

An arc is that of `arc` over an interval of a, or, at the Hopf point, that of `scaled` over an interval of a^2 that
begins at 0. Over a first box about the polynomials the inclusion and all signs of Theorem 5b (docs/certified.md) are
shown; over a wider one the inclusion alone, which says how far there is no other cycle. The numbers of a `Piece` are
exact: balls are rounded outwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from typing import Any

from tippedisk_verify.proofs.kernel.arc import GAMMA_BAR, Arc, arc_test
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, midpoint_and_radius, need, working_precision
from tippedisk_verify.proofs.kernel.curves import Curve, Replay
from tippedisk_verify.proofs.kernel.field import constants
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.reading import decimal, parsed, precision
from tippedisk_verify.proofs.kernel.scaled import ScaledCurve

__all__ = ["ARC", "BOX", "Job", "Piece", "Status", "box_test", "piece_shown", "polynomial", "signs",
           "upper_bound"]  # fmt: skip

STEPS = [{"share": decimal, "axes?": [[decimal, 3], 3]}, None]
BOX = {"radii": [decimal, 2], "steps": STEPS}
ARC = {
    "end": decimal, "curve": [[decimal, None], 2], "half": [decimal, None], "bits": precision,
    "box": BOX, "wide box?": BOX,
}  # fmt: skip

Pair = tuple[Fraction, Fraction]
Rows = tuple[tuple[Fraction, ...], tuple[Fraction, ...]]  #: coefficients of two polynomials
Job = tuple[Mapping[str, str], Fraction, int, Mapping[str, Any]]  #: the disk, where the arc begins, number, evidence


class Status(Enum):
    """Why an arc is not proved, or not joined to the others. The value says what failed."""

    NOT_FOLLOWED = "the orbits of all these amplitudes could not be followed from section to section"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box"
    RISING = "Omega grows with the amplitude"
    UNSTABLE = "the limit cycles are unstable"
    NOT_JOINED = "it is not proved that two pieces of the family are one curve"
    NOT_FALLING = "it is not proved that Omega falls as the amplitude grows"
    NOT_STABLE = "it is not proved that the limit cycles are asymptotically stable"
    NOT_SLOWING = "it is not proved that the period grows with the amplitude"
    NOT_WIDENING = "it is not proved that beta_max grows with the amplitude"


@dataclass(frozen=True)
class Piece:
    """What is proved of all amplitudes from ``low`` to ``high`` [rad].

    ``curve`` holds two polynomials of s, their coefficients beginning with that of s^0. Of an ordinary piece they are
    v_0 [rad/s] and Omega [rad/s], and s = (2 a - low - high) / (high - low). A ``scaled`` one begins at the Hopf point,
    low = 0; its first polynomial is v_0 / a [1/s], and s = 2 a^2 / high^2 - 1.
    """

    low: Fraction
    high: Fraction
    curve: Rows
    unique_within: Pair  #: of the polynomials
    within: Pair  #: of the polynomials lie the true values
    evidence: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)  #: of the shape `ARC`

    @property
    def scaled(self) -> bool:
        return not self.low

    def at(self, amplitude: Fraction) -> Pair:
        """The polynomials' v_0 [rad/s] and Omega [rad/s]."""
        s = (2 * amplitude - self.low - self.high) / (self.high - self.low)
        if self.scaled:
            s = 2 * amplitude**2 / self.high**2 - 1
        first, second = (sum((c * s**k for k, c in enumerate(row)), Fraction(0)) for row in self.curve)
        return self.scaled_to(amplitude, (first, second))

    def scaled_to(self, amplitude: Fraction, values: Pair) -> Pair:
        """Values or distances of the polynomials as those of v_0 and Omega."""
        return values[0] * (amplitude if self.scaled else 1), values[1]

    def speeds(self, amplitude: Fraction) -> Pair:
        """Numbers between which Omega lies [rad/s]."""
        middle = self.at(amplitude)[1]
        return middle - self.within[1], middle + self.within[1]


def polynomial(texts: Sequence[str]) -> Jet:
    """Decimals, as exact as balls hold them."""
    return Jet([ball(Fraction(text)) for text in texts])


def upper_bound(x: Any) -> Fraction:
    """A number that no absolute value in the finite ball exceeds."""
    middle, radius = midpoint_and_radius(x)
    return abs(middle) + radius


def box_test(
    disk: Mapping[str, str], low: Fraction, arc: Mapping[str, Any], radii: Sequence[Fraction], choices: Any
) -> Arc:
    """The test over a box about an arc's polynomials, at the working precision. Raises Unproved if the flight fails."""
    high = Fraction(arc["end"])
    v, omega, half = map(polynomial, (*arc["curve"], arc["half"]))
    need(0 <= low < high, "it ends where it must not")
    need(v.degree == omega.degree == half.degree > 0, "its polynomials have unlike degrees")
    need(min(radii) > 0, "a radius is not positive")
    first, last = (low, high) if low else (low, high**2)
    parameter = Jet([ball((first + last) / 2), ball((last - first) / 2), *[arb(0)] * (half.degree - 1)])
    deviation = [arb(0), *(arb(0, ball(radius)) for radius in radii)]
    kind = Curve if low else ScaledCurve
    return arc_test(constants(disk), kind(parameter, v, omega, deviation, half.mid()), GAMMA_BAR, choices)


def signs(arc: Arc) -> Status | None:
    """Which of the signs is not shown of an arc that has passed its test."""
    falling, stable = arc.falling(), arc.stable()
    if not falling:
        return Status.NOT_FALLING if falling is None else Status.RISING
    if not stable:
        return Status.NOT_STABLE if stable is None else Status.UNSTABLE
    if not arc.slowing():
        return Status.NOT_SLOWING
    return None if arc.widening() else Status.NOT_WIDENING


def piece_shown(job: Job) -> Piece:
    """What the evidence of one arc shows. Raises Unproved."""
    disk, low, number, content = job
    arc = parsed(content, ARC, f"arc {number}")
    names = [name for name in ("box", "wide box") if name in arc]
    tests: list[Arc] = []
    with working_precision(arc["bits"]):
        for name in names:
            radii = [Fraction(text) for text in arc[name]["radii"]]
            try:
                tests.append(box_test(disk, low, arc, radii, Replay(arc[name]["steps"])))
                need(tests[-1].included, Status.NOT_INCLUDED.value)
                refusal = None if len(tests) > 1 else signs(tests[0])
                need(refusal is None, refusal.value if refusal else "")
            except Unproved as fault:
                raise Unproved(f"arc {number}, {name}: {fault}") from None
        within = [upper_bound(off) for off in tests[0].within]
    boxes = [[Fraction(text) for text in arc[name]["radii"]] for name in (names[0], names[-1])]
    need(all(a <= b for a, b in zip(*boxes, strict=True)), f"arc {number}: the wide box does not hold the other one")
    v, omega = (tuple(map(Fraction, row)) for row in arc["curve"])
    return Piece(low, Fraction(arc["end"]), (v, omega), (boxes[1][0], boxes[1][1]), (within[0], within[1]), content)
