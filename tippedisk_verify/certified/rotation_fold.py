"""The fold of the rotating limit cycles, proved: a smallest speed on an arc of the family.

The family is taken as a curve over p = beta_bar at gamma = pi/2. For p in a ball, unknown are v and Omega, with the
turn map's two fixed-point equations F(p, v, Omega) = 0: Krawczyk's test on a box of (v, Omega) that holds for every p
of the ball proves that the box holds exactly one cycle for each p, and these form an analytic curve (implicit function
theorem: the matrices of dF/d(v, Omega) over the box are regular). Its slope dOmega/dp follows on balls. If it is
negative at the arc's lower end and positive at its upper one, Omega has a smallest value on the arc at an inner point,
where dOmega/dp = 0: there dF/d(p, v), which is P' - 1, is singular. The speed there lies in the box.

The arc is short, so that the slope is small on all of it: the speed comes to about twice the digits of its length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.certified.balls import (
    arb,
    ball,
    ball_constants,
    inside,
    measured,
    negative,
    positive,
    working_precision,
)
from tippedisk_verify.certified.flow import Model
from tippedisk_verify.certified.krawczyk import midpoint_inverse, product
from tippedisk_verify.certified.rotation import turn_flight
from tippedisk_verify.certified.section import Status
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits_for_digits, checked_digits

__all__ = ["FoldProof", "prove_rotation_fold"]

_GUARD_BITS = 60
_SHORTER = 5  # digits by which the arc is shorter than half the digits: enclosures of derivatives over it are wide
_EXCESS = 2**26  # of the enclosure of Omega over the arc, in units of its squared half-length
_CHORDS = 12


@dataclass(frozen=True)
class FoldProof:
    """What is proved of the fold."""

    proved: bool
    where: str  #: how far the proof came
    parameters: Parameters
    bits: int  #: working precision
    omega: Measured | None = None  #: the smallest speed on the arc [rad/s]
    beta_bar_top: Measured | None = None  #: beta - pi/2 at gamma = pi/2, on the arc [rad]
    v_top: Measured | None = None  #: v there [rad/s]
    period: Measured | None = None  #: T on the arc [s]

    @property
    def statement(self) -> str:
        """What is proved, in one sentence."""
        if not self.proved:
            return f"nothing is proved: {self.where}."
        return (
            f"for the tippedisk with {self.parameters.definition()} under the linear friction law, for each beta_bar = "
            f"beta - pi/2 of the closed interval {self.beta_bar_top} rad there is exactly one pair of v within "
            f"{self.v_top} rad/s and Omega within {self.omega} rad/s such that the orbit from (beta, pi/2, v) returns "
            "to beta and v when gamma has grown by 2 pi for the first time; these rotating limit cycles form an "
            "analytic curve, on which Omega falls at the lower end of the interval and rises at the upper one: at an "
            "inner point Omega is smallest, and there a second Floquet multiplier is 1; the periods lie within "
            f"{self.period} s."
        )

    def json(self) -> dict[str, object]:
        """For the command line."""
        entries: dict[str, object] = {"proved": self.proved, "statement": self.statement}
        numbers = {name: getattr(self, name) for name in ("omega", "beta_bar_top", "v_top", "period")}
        entries |= {name: value.json() for name, value in numbers.items() if value is not None}
        return entries | {"parameters": self.parameters.name, "bits": self.bits}


def prove_rotation_fold(
    parameters: Parameters, beta_bar_top: object, v_top: object, omega: object, *, digits: int = 12
) -> FoldProof:
    """Prove the fold near (beta_bar_top, v_top, omega), given to some more than ``digits`` digits.

    Its speed is enclosed to ``digits`` significant digits. Raises InputError under the smooth law.
    """
    parameters.refuse_smooth("the fold of rotating cycles is proved")
    checked_digits(digits)
    near = [Measured.of(part, 0).value for part in (beta_bar_top, v_top, omega)]
    # On the arc the speed moves by its squared half-length.
    places = math.ceil(digits / 2) + _SHORTER
    half_length = Fraction(1, 10**places)
    # The arc is said as it is tested: its middle has the decimals that are printed beside its half-length.
    near[0] = Fraction(round(near[0] * 10 ** (places + 2)), 10 ** (places + 2))
    bits = bits_for_digits(2 * digits + 4 * _SHORTER) + _GUARD_BITS
    with working_precision(bits):
        return _proof(parameters, near, half_length, bits)


def _proof(parameters: Parameters, near: Sequence[Fraction], half_length: Fraction, bits: int) -> FoldProof:
    p, *middle = near
    arc = ball(p) + arb(0, ball(half_length))
    length = ball(half_length)
    # v follows p at a slope of some units; Omega moves by the square of the arc, and so do the enclosures' excesses.
    whole = _Family(parameters, arc).enclosed([ball(part).mid() for part in middle], (8 * length, _EXCESS * length**2))
    if isinstance(whole, str):
        return FoldProof(False, f"on the arc, {whole}", parameters, bits)
    signs = []
    for end in (p - half_length, p + half_length):
        family = _Family(parameters, ball(end))
        radii = (length / 2**20, length**2 / 2**10)
        point = family.enclosed(family.sharpened(whole, radii), radii)
        if isinstance(point, str):
            return FoldProof(False, f"at its end, {point}", parameters, bits)
        # The same cycle as the arc's: its box lies in the arc's, which holds one only.
        if not all(inside(part, held) for part, held in zip(point.box, whole.searched, strict=True)):
            return FoldProof(False, "the cycle at an end of the arc is not proved to be the arc's", parameters, bits)
        signs.append(point.slope)
    if not (negative(signs[0]) and positive(signs[1])):
        return FoldProof(False, "Omega is not proved to fall and rise along the arc", parameters, bits)
    v_top, omega = (measured(part) for part in whole.box)
    # What is printed reaches a little farther than Krawczyk's image; in the box searched there is still one cycle only.
    if not all(inside(_printed(part), held) for part, held in zip((v_top, omega), whole.searched, strict=True)):
        return FoldProof(False, "the digits printed reach beyond the box that holds one cycle", parameters, bits)
    return FoldProof(
        True,
        f"in {bits} bits",
        parameters,
        bits,
        omega=omega,
        beta_bar_top=Measured(p, half_length),
        v_top=v_top,
        period=measured(whole.period),
    )


def _printed(number: Measured) -> Any:
    """The ball that a number's decimals say."""
    value, width = (Fraction(part) for part in number.decimals())
    return ball(value) + arb(0, ball(width))


@dataclass(frozen=True)
class _Enclosed:
    searched: list[Any]  #: the box of (v, Omega) in which there is exactly one cycle for each p
    box: list[Any]  #: Krawczyk's image, which holds it
    slope: Any  #: dOmega/dp over it
    period: Any
    inverse: list[list[Any]]  #: of dF/d(v, Omega), in points


class _Family:
    """The fixed-point equations over a ball of p = beta_bar at gamma = pi/2."""

    def __init__(self, parameters: Parameters, p: Any) -> None:
        self.constants, self.p = ball_constants(parameters), p

    def enclosed(self, m: Sequence[Any], radii: Sequence[Any]) -> _Enclosed | str:
        """Krawczyk's test for (v, Omega) about a point; what prevents it if it fails."""
        box = [point + arb(0, radius) for point, radius in zip(m, radii, strict=True)]
        values = self._values(m)
        wide = turn_flight(Model(self.constants, box[1]), self.p, box[0], derivatives=True)
        if isinstance(values, str) or wide.status is not Status.RETURNED:
            return f"a turn could not be followed: {values if isinstance(values, str) else wide.status.value}"
        (a, b), (c, d) = wide.matrix
        by_unknowns, by_p = ((b, wide.by_omega[0]), (d - 1, wide.by_omega[1])), (a - 1, c)
        away = self.p - self.p.mid()
        inverse = midpoint_inverse(by_unknowns)
        # p's part is one ball that both equations share: its factors come first, for their sum nearly vanishes.
        moved = [factor * away for factor in product(inverse, by_p)]
        shift = [part + along for part, along in zip(product(inverse, values), moved, strict=True)]
        rest = [
            [int(i == j) - sum(inverse[i][k] * by_unknowns[k][j] for k in range(2)) for j in range(2)] for i in range(2)
        ]
        spread = product(rest, [part - point for part, point in zip(box, m, strict=True)])
        image = [point - part + width for point, part, width in zip(m, shift, spread, strict=True)]
        if not all(inside(part, held) for part, held in zip(image, box, strict=True)):
            return "Krawczyk's image does not lie inside the box"
        (a, b), (c, d) = by_unknowns
        slope = -(a * by_p[1] - c * by_p[0]) / (a * d - b * c)
        return _Enclosed(box, image, slope, wide.time, inverse)

    def sharpened(self, whole: _Enclosed, radii: Sequence[Any]) -> list[Any]:
        """A point well within the radii of this p's cycle, by chord steps from the middle of the arc's box.

        Any point will do: Krawczyk's test decides.
        """
        m = [part.mid() for part in whole.box]
        for _ in range(_CHORDS):
            values = self._values(m)
            if isinstance(values, str):
                break
            steps = product(whole.inverse, values)
            m = [(part - step).mid() for part, step in zip(m, steps, strict=True)]
            if all(abs(step) < radius / 2**12 for step, radius in zip(steps, radii, strict=True)):
                break
        return m

    def _values(self, m: Sequence[Any]) -> Any:
        """F at p's midpoint and a point (v, Omega); why the turn could not be followed, if so."""
        flight = turn_flight(Model(self.constants, m[1]), self.p.mid(), m[0])
        if flight.status is not Status.RETURNED:
            return flight.status.value
        return [after - before for after, before in zip(flight.image, (self.p.mid(), m[0]), strict=True)]
