"""Sets of states that flow: a box of deviations carried by points, and what is left over in a small turned box.

A set is  middle + lead d + axes q  for all d and q of two boxes. d is what the start and the speed deviate from their
midpoints, the same at all times: what is linear in it is never wrapped into a box (R. J. Lohner's doubleton; Mrozek and
Zgliczynski, Ann. Polon. Math. 74, 2000). q holds the rest, which is quadratic in d but for rounding. Its axes are
chosen to follow the flow (Lohner's QR method; `search.axes`).

``middle``, ``lead`` and ``axes`` are points, so nothing is rounded in them. A map with enclosed derivatives M over the
set takes it to

    image of middle  +  (M lead + by Omega) d  +  M axes q;

new points are chosen and what the balls differ from them goes into q, turned into the new axes by an enclosure of their
inverse. The derivatives of the states by start and Omega are  lead + axes spread  in the same way.

Where a ball becomes a point: middle and lead are midpoints, axes any regular matrix of points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from tippedisk_verify.proofs.kernel.balls import alike, upper

__all__ = ["Frame"]

Matrix = Sequence[Sequence[Any]]


class Frame:
    """The set, and the derivatives (3, 4) of its states by the start's three coordinates and Omega."""

    __slots__ = ("axes", "deviation", "lead", "middle", "rest", "spread")

    def __init__(self, start: Sequence[Any], omega: Any) -> None:
        self.middle: list[Any] = [part.mid() for part in start]
        #: d: four balls about zero
        away = (part - mid for part, mid in zip(start, self.middle, strict=True))
        self.deviation = [*away, omega - omega.mid()]
        zero, one = (alike(self.middle[0], k) for k in (0, 1))
        unit = [[one if k == row else zero for k in range(3)] for row in range(3)]
        self.lead: Matrix = [[*row, zero] for row in unit]
        self.axes: Matrix = unit
        self.rest: list[Any] = [zero] * 3
        self.spread: Matrix = [[zero] * 4 for _ in range(3)]

    def box(self) -> tuple[Any, ...]:
        """Balls that hold all states, and the middle."""
        lead, rest = _applied(self.lead, self.deviation), _applied(self.axes, self.rest)
        zero = alike(self.middle[0], 0)
        return tuple(middle + (a + b).union(zero) for middle, a, b in zip(self.middle, lead, rest, strict=True))

    def matrix(self) -> tuple[tuple[Any, ...], ...]:
        """(3, 4) balls: the derivatives of all states by the start and by Omega."""
        return tuple(tuple(row) for row in _sum(self.lead, _product(self.axes, self.spread)))

    def image(self, centre: Sequence[Any], rows: Matrix) -> tuple[Any, ...]:
        """Where a map takes the states: ``centre`` holds the middle's image, ``rows`` (3, 4) its derivatives."""
        lead, turned = self._mapped(rows)
        parts = zip(centre, _applied(lead, self.deviation), _applied(turned, self.rest), strict=True)
        return tuple(a + b + c for a, b, c in parts)

    def derivatives(self, rows: Matrix) -> tuple[tuple[Any, ...], ...]:
        """(3, 4) balls: those of the images by the start and by Omega."""
        lead, turned = self._mapped(rows)
        return tuple(tuple(row) for row in _sum(lead, _product(turned, self.spread)))

    def carried(self, centre: Sequence[Any], rows: Matrix, axes: Callable[..., Matrix]) -> Frame:
        """The images' frame.

        ``axes`` gives its axes, points, from the old ones' images (balls) and the sizes of what lies along them.
        """
        lead, turned = self._mapped(rows)
        image = object.__new__(Frame)
        image.deviation = self.deviation
        image.middle = [part.mid() for part in centre]
        image.lead = [[entry.mid() for entry in row] for row in lead]
        sizes = [upper(part) + sum(map(upper, row)) for part, row in zip(self.rest, self.spread, strict=True)]
        image.axes = [[entry.mid() for entry in row] for row in axes(turned, sizes)]
        inverse = _inverse(image.axes)
        left = _product(
            inverse, [[a - b for a, b in zip(*rows, strict=True)] for rows in zip(lead, image.lead, strict=True)]
        )
        turned = _product(inverse, turned)
        away = _applied(inverse, [part - mid for part, mid in zip(centre, image.middle, strict=True)])
        parts = zip(away, _applied(left, self.deviation), _applied(turned, self.rest), strict=True)
        image.rest = [a + b + c for a, b, c in parts]
        image.spread = _sum(left, _product(turned, self.spread))
        return image

    def _mapped(self, rows: Matrix) -> tuple[Matrix, Matrix]:
        """Balls: the images of the lead, with the speed's own part, and of the axes."""
        lead = [
            [*entries[:3], entries[3] + row[3]] for entries, row in zip(_product(rows, self.lead), rows, strict=True)
        ]
        return lead, _product(rows, self.axes)


def _product(a: Matrix, b: Matrix) -> Matrix:
    """Of the first three columns of ``a`` with three rows."""
    return [[row[0] * x + row[1] * y + row[2] * z for x, y, z in zip(*b, strict=True)] for row in a]


def _applied(matrix: Matrix, vector: Sequence[Any]) -> list[Any]:
    return [sum(entry * part for entry, part in zip(row, vector, strict=True)) for row in matrix]


def _sum(a: Matrix, b: Matrix) -> Matrix:
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def _inverse(axes: Matrix) -> Matrix:
    """Balls that hold the inverse matrix, by Cramer's rule."""
    (a, b, c), cross = axes, _cross
    minors = (cross(b, c), cross(c, a), cross(a, b))
    determinant = sum(x * y for x, y in zip(a, minors[0], strict=True))
    return [[minors[k][row] / determinant for k in range(3)] for row in range(3)]


def _cross(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
