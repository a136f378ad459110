"""Krawczyk's test for a fixed point of a section's map over a box; `cycle` says what it proves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.proofs.kernel.balls import arb, ball, inside
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.section import HalfFlight, half_flight
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus

__all__ = ["Flight", "Inclusion", "inclusion", "midpoint_inverse", "product"]

Flight = Callable[..., HalfFlight]  #: encloses a section's map over a box of its two coordinates


@dataclass(frozen=True)
class Inclusion:
    """One application of Krawczyk's operator. ``included`` is the proof."""

    included: bool
    middle: Any = None  #: m, exact points
    image: Any = None  #: K, (gamma_bar, v)
    residual: Any = None  #: Y F(m), for choosing the precision
    centre: HalfFlight | None = None  #: the half map at m
    box: HalfFlight | None = None  #: the half map over X, with derivatives
    failed: HalfFlight | None = None  #: the flight that did not return


def inclusion(
    model: Model,
    middle: Sequence[Any],
    radii: Sequence[Any],
    centre: HalfFlight | None = None,
    flight: Flight = half_flight,
    along: Sequence[Any] | None = None,
) -> Inclusion:
    """Krawczyk's test on the box ``middle`` ± ``radii`` of (gamma_bar, v), at the working precision.

    ``centre`` is the half map at ``middle``, if it is known already; ``flight`` may be that of another section's map.
    With ``along`` the box moves with the speed, which is a ball: it is about middle + along (Omega - its midpoint),
    ``image`` is what Krawczyk's operator gives when that is subtracted, and ``centre`` is at the midpoint. One fixed
    point is then proved for each speed of the ball.
    """
    m = [ball(part).mid() for part in middle]
    box = [point + arb(0, radius) for point, radius in zip(m, radii, strict=True)]
    if centre is None:
        centre = flight(model if along is None else model.at_middle(), *m)
    if centre.status is not HalfStatus.RETURNED:
        return Inclusion(False, m, failed=centre)
    moving = {} if along is None else {"along": along}
    wide = flight(model, *box, derivatives=True, **moving)
    if wide.status is not HalfStatus.RETURNED:
        return Inclusion(False, m, centre=centre, failed=wide)
    value = [after - before for after, before in zip(centre.image, m, strict=True)]
    (a, b), (c, d) = wide.matrix
    jacobian = ((a - 1, b), (c, d - 1))
    inverse = midpoint_inverse(jacobian)
    if along is not None:
        # By the mean value theorem in the speed; the line's own part is what the box has moved.
        away = model.omega - model.omega.mid()
        value = [
            part + (slope - ball(line).mid()) * away
            for part, slope, line in zip(value, wide.by_omega, along, strict=True)
        ]
    residual = product(inverse, value)
    rest = [[int(i == j) - sum(inverse[i][k] * jacobian[k][j] for k in range(2)) for j in range(2)] for i in range(2)]
    spread = product(rest, [whole - part for whole, part in zip(box, m, strict=True)])
    image = [part - shift + width for part, shift, width in zip(m, residual, spread, strict=True)]
    included = all(inside(part, whole) for part, whole in zip(image, box, strict=True))
    return Inclusion(included, m, image, residual, centre, wide)


def midpoint_inverse(matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """The inverse of the midpoints' matrix, as points: any regular matrix will do, and inclusion shows that it is."""
    (a, b), (c, d) = ((entry.mid() for entry in row) for row in matrix)
    determinant = a * d - b * c
    return [[(d / determinant).mid(), (-b / determinant).mid()], [(-c / determinant).mid(), (a / determinant).mid()]]


def product(matrix: Sequence[Sequence[Any]], vector: Sequence[Any]) -> list[Any]:
    return [row[0] * vector[0] + row[1] * vector[1] for row in matrix]
