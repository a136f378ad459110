"""Krawczyk's test for fixed points of a section's map, one for each value of a parameter.

Of the three numbers (first coordinate on the section, v, Omega) two are unknown, u, and the third, p, is in a ball.
With F = P - 1, m the middle of all three, a box of u about it and any regular matrix Y,

    K = m_u - Y F(m) - Y F_p (p - m_p) + (1 - Y F_u) (u - m_u)

holds every zero u of F(., p) in the box, for each p of the ball: F(u, p) = F(m) + F_p (p - m_p) + F_u (u - m_u) with
derivatives in the balls over the box (mean value theorem). If K lies in the box's interior there is exactly one for
each p, and all matrices F_u are regular (Krawczyk 1969; Moore 1977; Rump 1983).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from tippedisk_verify.proofs.kernel.balls import inside
from tippedisk_verify.proofs.kernel.field import constants
from tippedisk_verify.proofs.kernel.flow import Proposer, Status
from tippedisk_verify.proofs.kernel.section import Return, Section, returned
from tippedisk_verify.proofs.kernel.sliding import law_model

__all__ = ["Choices", "FixedPoints", "fixed_points", "krawczyk_test", "product"]

Pair = Sequence[Any]


class Choices(Protocol):
    """What a test asks for."""

    @property
    def centre(self) -> Proposer:
        """For the flight from the middle."""
        ...

    @property
    def box(self) -> Proposer:
        """For the flight over the box."""
        ...

    def inverse(self, matrix: Sequence[Pair]) -> Sequence[Pair]:
        """Y, four points, given F_u over the box."""
        ...


@dataclass(frozen=True)
class FixedPoints:
    """One application of Krawczyk's operator. ``included`` is the proof."""

    included: bool
    middle: Pair  #: m, three points
    shift: Pair  #: where the fixed points are from the middle, three balls
    residual: Pair  #: Y F(m), for choosing the precision
    slopes: Sequence[Pair]  #: (2, 3): the derivatives of F over the box
    centre: Return  #: the map at the middle
    box: Return  #: the map over the box, with derivatives

    @property
    def image(self) -> list[Any]:
        """Where the fixed points are: three balls."""
        return [middle + part for middle, part in zip(self.middle, self.shift, strict=True)]

    def along(self, value: Any, by: Pair) -> Any:
        """At the fixed points, what is ``value`` in the middle and has these three derivatives over the box."""
        return value + by[0] * self.shift[0] + by[1] * self.shift[1] + by[2] * self.shift[2]


def krawczyk_test(
    claim: Mapping[str, Any],
    section: Section,
    middle: Pair,
    deviations: Pair,
    unknown: tuple[int, int],
    choices: Choices,
    centre: Return | None = None,
) -> FixedPoints | Return:
    """Krawczyk's test about three points ``middle``, on the box of these plus ``deviations``, three balls about zero.

    It is for the disk and the law of the claim (``parameters``, ``friction``); ``unknown`` says which two of the three
    numbers are. Returns the flight that did not return, if one did not. Who has the map at the middle already passes it
    as ``centre``.
    """
    numbers, friction = constants(claim["parameters"]), claim["friction"]
    if centre is None:
        centre = returned(law_model(friction, numbers, middle[2]), section, middle[:2], choices.centre)
    if centre.status is not Status.RETURNED:
        return centre
    whole = [point + part for point, part in zip(middle, deviations, strict=True)]
    box = returned(law_model(friction, numbers, whole[2]), section, whole[:2], choices.box, derivatives=True)
    if box.status is not Status.RETURNED:
        return box
    slopes = _slopes(box)
    return fixed_points(
        middle, deviations, unknown, choices.inverse([[row[k] for k in unknown] for row in slopes]), centre, box
    )


def fixed_points(
    middle: Pair, deviations: Pair, unknown: tuple[int, int], inverse: Sequence[Pair], centre: Return, box: Return
) -> FixedPoints:
    """What the test says, given the map at the middle and over the box; ``inverse`` is Y."""
    value = [after - before for after, before in zip(centre.image, middle, strict=False)]
    slopes = _slopes(box)
    (other,) = {0, 1, 2}.difference(unknown)
    width = [deviations[k] for k in unknown]
    rest = [
        [int(i == j) - sum(inverse[i][k] * slopes[k][column] for k in range(2)) for j, column in enumerate(unknown)]
        for i in range(2)
    ]
    residual = product(inverse, value)
    # p's part is one ball that both equations share: its factors come first, for their sum may nearly vanish.
    moved = product(inverse, [row[other] for row in slopes])
    shift = list(deviations)
    for k, spread, part, factor in zip(unknown, product(rest, width), residual, moved, strict=True):
        shift[k] = spread - part - factor * deviations[other]
    included = all(inside(shift[k], deviations[k]) for k in unknown)
    return FixedPoints(included, middle, shift, residual, slopes, centre, box)


def _slopes(box: Return) -> tuple[Pair, Pair]:
    (a, b), (c, d) = box.matrix
    return (a - 1, b, box.by_omega[0]), (c, d - 1, box.by_omega[1])


def product(matrix: Sequence[Pair], vector: Pair) -> list[Any]:
    return [row[0] * vector[0] + row[1] * vector[1] for row in matrix]
