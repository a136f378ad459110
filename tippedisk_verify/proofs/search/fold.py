"""Folds of limit cycles, proved: an extreme speed on an arc of a family, rotating or librating.

The family is taken as a curve over p, the first coordinate on the section of a map P, whose fixed points are the
family's cycles. For p in a ball, unknown are the second coordinate v and Omega, with the two fixed-point equations
F(p, v, Omega) = 0: Krawczyk's test on a box of (v, Omega) that holds for every p of the ball proves that the box holds
exactly one cycle for each p, and these form an analytic curve (implicit function theorem: the matrices of
dF/d(v, Omega) over the box are regular). Its slope dOmega/dp follows on balls. If its signs at the arc's ends are
proved to differ, Omega has a smallest or largest value on the arc at an inner point, where dOmega/dp = 0: there
dF/d(p, v), which is P' - 1, is singular. The speed there lies in the box.

P is the turn map (see `rotation`), or the half map (see `section`), which has the symmetry in it: the multipliers of a
period are the squares of its own. By Liouville's formula (see `cycle` and `rotation`) the third multiplier of the cycle
at the fold is exp(integral of div f) over a period, if that of the others is 1.

The arc is short, so that the slope is small on all of it: the speed comes to about twice the digits of its length.

Where a ball becomes a point or a float: the arc, the middles and radii of boxes and the bits of the flights are chosen,
and any choice that passes the tests is right.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar, Literal

from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits, checked_digits
from tippedisk_verify.proofs.kernel.balls import (
    arb,
    ball,
    ball_constants,
    inside,
    measured,
    negative,
    positive,
    working_precision,
)
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.krawczyk import Flight, midpoint_inverse, product
from tippedisk_verify.proofs.kernel.section import HalfFlight, Status, half_flight
from tippedisk_verify.proofs.search.rotation import turn_flight

__all__ = ["FoldProof", "LibrationFoldProof", "RotationFoldProof", "prove_fold"]

_GUARD_BITS = 60
_SHORTER = 5  # digits by which the arc is shorter than half the digits: enclosures of derivatives over it are wide
_SLOPE = 8  # of v along the arc [1/s], at first
_EXCESS = 2**26  # of the enclosure of Omega over the arc, in units of its squared half-length, at first
_INFLATIONS = 3
_CHORDS = 12


@dataclass(frozen=True)
class FoldProof(ABC):
    """What is proved of a fold. A subclass says on which section."""

    flight: ClassVar[Flight]  #: encloses the map whose fixed points they are
    laps: ClassVar[int]  #: flights a period
    unknowns: ClassVar[tuple[str, str]]  #: names of the two coordinates on the section

    proved: bool
    where: str  #: how far the proof came
    parameters: Parameters
    bits: int  #: working precision
    omega: Measured | None = None  #: the extreme speed on the arc [rad/s]
    extremum: Literal["smallest", "largest"] | None = None  #: which
    period: Measured | None = None  #: T on the arc [s]
    #: boxes of (v, Omega) that hold one cycle each: for every point of the arc, at its lower and at its upper end
    searched: tuple[Sequence[Any], ...] = field(default=(), repr=False)

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        if not self.proved:
            return f"nothing is proved: {self.where}."
        signs = ("falls", "rises") if self.extremum == "smallest" else ("rises", "falls")
        arc, v = (getattr(self, name) for name in self.unknowns)
        return (
            f"for the tippedisk with {self.parameters.definition()} under the linear friction law, "
            f"{self._cycles(f'{arc} rad', f'v within {v} rad/s and Omega within {self.omega} rad/s')}, and these "
            f"periodic orbits form an analytic curve, on which Omega {signs[0]} at the lower end of the interval and "
            f"{signs[1]} at the upper one: at an inner point Omega has its {self.extremum} value on the curve, and the "
            "Floquet multipliers of the orbit there are 1, 1 and a number between 0 and 1; the periods lie within "
            f"{self.period} s."
        )

    @abstractmethod
    def _cycles(self, arc: str, pair: str) -> str:
        """That for each point of the arc there is one pair of v and Omega with a cycle."""

    def to_dict(self) -> dict[str, object]:
        """For the command line."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        numbers = {name: getattr(self, name) for name in ("omega", *self.unknowns, "period")}
        entries |= {name: value.to_dict() for name, value in numbers.items() if value is not None}
        if self.extremum is not None:
            entries["extremum"] = self.extremum
        return entries | {"parameters": self.parameters.name, "bits": self.bits}


@dataclass(frozen=True)
class RotationFoldProof(FoldProof):
    """What is proved of the fold of the cycles on which gamma grows by 2 pi a period."""

    flight = staticmethod(turn_flight)
    laps = 1
    unknowns = ("beta_bar_top", "v_top")

    beta_bar_top: Measured | None = None  #: beta - pi/2 at gamma = pi/2, on the arc [rad]
    v_top: Measured | None = None  #: v there [rad/s]

    def _cycles(self, arc: str, pair: str) -> str:
        return (
            f"for each beta_bar = beta - pi/2 of the closed interval {arc} there is exactly one pair of {pair} such "
            "that the orbit from (beta, pi/2, v) returns to beta and v when gamma has grown by 2 pi for the first "
            "time; on it 0 < beta - pi/2 < 1.5707 throughout"
        )


@dataclass(frozen=True)
class LibrationFoldProof(FoldProof):
    """What is proved of a fold of the cycles about inverted spinning that the symmetry S maps to themselves."""

    flight = staticmethod(half_flight)
    laps = 2
    unknowns = ("gamma_bar_0", "v_0")

    gamma_bar_0: Measured | None = None  #: gamma - pi/2 at beta = pi/2 with v < 0, on the arc [rad]
    v_0: Measured | None = None  #: v there [rad/s]

    def _cycles(self, arc: str, pair: str) -> str:
        return (
            f"for each gamma_bar = gamma - pi/2 of the closed interval {arc} there is exactly one pair of {pair} such "
            "that the orbit from (pi/2, gamma, v) meets beta = pi/2 next in (pi/2, pi - gamma, -v), whence S, "
            "(beta, gamma, v) -> (pi - beta, pi - gamma, -v), maps it to itself; on it |beta - pi/2| < 1.5707 "
            "throughout"
        )


def prove_fold(kind: type[FoldProof], parameters: Parameters, near: Sequence[object], *, digits: int = 12) -> Any:
    """Prove the fold of that kind near a point (both coordinates on the section, Omega).

    The point is given to some more than ``digits`` digits; the fold's speed is enclosed to ``digits`` significant
    digits. What prevents a proof is said in the answer, of the type ``kind``. Raises InputError under the smooth law.
    """
    parameters.refuse_smooth("the fold of limit cycles is proved")
    checked_digits(digits)
    p, v, omega = (Measured.of(part, 0).value for part in near)
    # On the arc the speed moves by its squared half-length.
    places = math.ceil(digits / 2) + _SHORTER
    # The arc is said as it is tested: its middle has the decimals that are printed beside its half-length.
    p = Fraction(round(p * 10 ** (places + 2)), 10 ** (places + 2))
    attempt = _Attempt(kind, parameters, (p, v, omega), Fraction(1, 10**places), digits)
    with working_precision(attempt.bits):
        return attempt.run()


class _Attempt:
    """A proof under way: about which point, on which arc, in how many bits."""

    def __init__(
        self,
        kind: type[FoldProof],
        parameters: Parameters,
        near: tuple[Fraction, Fraction, Fraction],
        half_length: Fraction,
        digits: int,
    ) -> None:
        self.kind, self.parameters, self.digits, self.half_length = kind, parameters, digits, half_length
        self.p, *self.middle = near
        self.bits = bits_for_digits(digits + 2 * _SHORTER + 4) + _GUARD_BITS  # the squared half-length, and some more

    def ended(self, where: str) -> FoldProof:
        return self.kind(False, where, self.parameters, self.bits)

    def run(self) -> FoldProof:
        """The proof, at the working precision ``bits``, which must be in force."""
        length = ball(self.half_length)
        whole = self.whole(length)
        if isinstance(whole, str):
            return self.ended(f"on the arc, {whole}")
        ends = []
        for end in (self.p - self.half_length, self.p + self.half_length):
            point = self.at_end(end, whole, (length / 2**20, length**2 * 2**10))
            if isinstance(point, str):
                return self.ended(f"at an end of the arc, {point}")
            ends.append(point)
        extremum = _extremum(*(point.slope for point in ends))
        if extremum is None:
            return self.ended("Omega is not proved to rise at one end of the arc and to fall at the other")
        if not negative(whole.divergence):
            return self.ended("the third multiplier is not proved to be below 1")
        v, omega = (measured(part) for part in whole.box)
        # What is printed reaches a little farther than Krawczyk's image; in the box searched there is still one cycle
        # only.
        if not all(inside(_printed(part), held) for part, held in zip((v, omega), whole.searched, strict=True)):
            return self.ended("the digits printed reach beyond the box that holds one cycle")
        if omega.uncertainty > omega.value / 10**self.digits:
            return self.ended(f"the speed is not enclosed to {self.digits} digits: ask for more")
        coordinates: dict[str, Any] = dict(
            zip(self.kind.unknowns, (Measured(self.p, self.half_length), v), strict=True)
        )
        return replace(
            self.kind(True, f"in {self.bits} bits", self.parameters, self.bits, omega, extremum),
            period=measured(self.kind.laps * whole.time),
            searched=(whole.searched, *(point.searched for point in ends)),
            **coordinates,
        )

    def whole(self, length: Any) -> _Enclosed | str:
        """The cycles of all points of the arc. The box is widened to what Krawczyk's image turns out to need."""
        family = _Family(self, ball(self.p) + arb(0, length))
        m, radii = [ball(part).mid() for part in self.middle], [_SLOPE * length, _EXCESS * length**2]
        for _ in range(1 + _INFLATIONS):
            found = family.enclosed(m, radii)
            if isinstance(found, str):
                return found
            if found.included:
                return found
            if not all(part.is_finite() for part in found.box):
                break
            m, radii = [part.mid() for part in found.box], [2 * part.rad() for part in found.box]
        return "Krawczyk's image does not lie inside the box"

    def at_end(self, end: Fraction, whole: _Enclosed, radii: Sequence[Any]) -> _Enclosed | str:
        """The cycle at an end of the arc; why it is not proved, if so."""
        family = _Family(self, ball(end))
        away = ball(end - self.p)
        m = [(part + slope * away).mid() for part, slope in zip(whole.box, whole.along, strict=True)]
        point = family.sharpened(m, radii, whole.inverse)
        if isinstance(point, str):
            return point
        if not point.included:
            return "Krawczyk's image does not lie inside the box"
        # The same cycle as the arc's: its box lies in the arc's, which holds one only.
        if not all(inside(part, held) for part, held in zip(point.box, whole.searched, strict=True)):
            return "the cycle is not proved to be the arc's"
        return point


def _extremum(lower: Any, upper: Any) -> Literal["smallest", "largest"] | None:
    """What Omega has at an inner point of the arc, given its slopes at the ends; None if their signs do not tell."""
    if negative(lower) and positive(upper):
        return "smallest"
    return "largest" if positive(lower) and negative(upper) else None


def _printed(number: Measured) -> Any:
    """A ball that holds what a number's decimals say."""
    value, width = (Fraction(part) for part in number.decimals())
    return ball(value) + arb(0, ball(width))


@dataclass(frozen=True)
class _Enclosed:
    included: bool  #: without this the rest proves nothing
    searched: list[Any]  #: the box of (v, Omega) in which there is exactly one cycle for each p
    box: list[Any]  #: Krawczyk's image, which holds it
    slope: Any  #: dOmega/dp over it
    along: list[Any]  #: d(v, Omega)/dp, roughly
    time: Any  #: of a flight
    divergence: Any  #: integral of div f over a flight
    inverse: list[list[Any]]  #: of dF/d(v, Omega), in points


class _Family:
    """The fixed-point equations over a ball of p."""

    def __init__(self, attempt: _Attempt, p: Any) -> None:
        self.constants, self.p = ball_constants(attempt.parameters), p
        self.flight = attempt.kind.flight

    def enclosed(self, m: Sequence[Any], radii: Sequence[Any], values: Sequence[Any] | None = None) -> _Enclosed | str:
        """Krawczyk's test for (v, Omega) about a point, where F is known already if given; why there is none, if so."""
        values = values or self._values(m)
        if isinstance(values, str):
            return values
        box = [point + arb(0, radius) for point, radius in zip(m, radii, strict=True)]
        wide = self.flight(Model(self.constants, box[1]), self.p, box[0], derivatives=True)
        if wide.status is not Status.RETURNED:
            return _not_followed(wide)
        (a, b), (c, d) = wide.matrix
        by_unknowns, by_p = ((b, wide.by_omega[0]), (d - 1, wide.by_omega[1])), (a - 1, c)
        away = self.p - self.p.mid()
        inverse = midpoint_inverse(by_unknowns)
        # p's part is one ball that both equations share: its factors come first, for their sum nearly vanishes.
        along = [-factor for factor in product(inverse, by_p)]
        moved = [-slope * away for slope in along]
        shift = [part + other for part, other in zip(product(inverse, values), moved, strict=True)]
        rest = [
            [int(i == j) - sum(inverse[i][k] * by_unknowns[k][j] for k in range(2)) for j in range(2)] for i in range(2)
        ]
        spread = product(rest, [part - point for part, point in zip(box, m, strict=True)])
        image = [point - part + width for point, part, width in zip(m, shift, spread, strict=True)]
        included = all(inside(part, held) for part, held in zip(image, box, strict=True))
        (a, b), (c, d) = by_unknowns
        slope = -(a * by_p[1] - c * by_p[0]) / (a * d - b * c)
        return _Enclosed(included, box, image, slope, along, wide.time, wide.divergence, inverse)

    def sharpened(self, m: Sequence[Any], radii: Sequence[Any], inverse: Sequence[Any]) -> _Enclosed | str:
        """Krawczyk's test about a point well within the radii of this p's cycle, by chord steps from near ``m``.

        Any point will do: the test decides.
        """
        for _ in range(_CHORDS):
            values = self._values(m)
            if isinstance(values, str):
                return values
            steps = product(inverse, values)
            if all(abs(step) < radius / 4 for step, radius in zip(steps, radii, strict=True)):
                return self.enclosed(m, radii, values)
            m = [(part - step).mid() for part, step in zip(m, steps, strict=True)]
        return "the iteration towards the cycle does not settle"

    def _values(self, m: Sequence[Any]) -> list[Any] | str:
        """F at p's midpoint and a point (v, Omega); why the map could not be followed, if so."""
        flight = self.flight(Model(self.constants, m[1]), self.p.mid(), m[0])
        if flight.status is not Status.RETURNED:
            return _not_followed(flight)
        return [after - before for after, before in zip(flight.image, (self.p.mid(), m[0]), strict=True)]


def _not_followed(flight: HalfFlight) -> str:
    return f"the orbit could not be followed beyond t = {float(flight.reached):.4g} s: {flight.status.value}"
