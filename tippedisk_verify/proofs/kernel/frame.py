"""Sets of states that flow: deviations from the start carried by points, and a small turned box.

A set is  middle + lead d + axes q  for all d and q of two boxes. The deviation d of start and speed
from their midpoints is the same at all times. A term linear in d is never wrapped into a box (R. J.
Lohner's doubleton; Mrozek and Zgliczynski, Ann. Polon. Math. 74, 2000). The box of q holds the
rest, which is quadratic in d but for rounding. Its axes are chosen to follow the flow (Lohner's QR
method; `search.steps`).

``middle``, ``lead`` and ``axes`` are points, so nothing is rounded in them. A map with enclosed
derivatives M over the set takes it to

    image of middle  +  (M lead + by Omega) d  +  M axes q.

New points are chosen. The differences between the balls and these points go into q, turned into the
new axes by an enclosure of their inverse. Likewise, the derivatives of the states with respect to
start and Omega are lead + axes spread.

Where a ball becomes a point: middle and lead are midpoints, axes any regular matrix of points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

from tippedisk_verify.proofs.kernel.balls import converted_like, magnitude_estimate, range_of
from tippedisk_verify.proofs.kernel.small_matrices import (
    Matrix,
    inverse_of_order_3,
    matrix_product,
    matrix_sum,
    matrix_times_vector,
)

__all__ = ["Frame"]


class Frame:
    """A set of states of a flight, enclosed as middle + lead d + axes q for all d and q in two
    boxes.

    It also holds their derivatives (3, 4) with respect to the start's three coordinates and Omega.

    In a set over a curve (`half_map_of_curves`), middle and lead are jets, and the deviations
    differ. Its ``own`` is the part of ``rest`` that belongs to the middle's own orbits.
    """

    __slots__ = ("axes", "columns", "deviation", "lead", "middle", "own", "rest", "spread")

    def __init__(self, start: Sequence[Any], omega: Any) -> None:
        self.middle: list[Any] = [part.mid() for part in start]
        #: d: four balls about zero
        self.deviation = [
            *(x - mid for x, mid in zip(start, self.middle, strict=True)),
            omega - omega.mid(),
        ]
        self.columns: Sequence[int] = (3,)  #: which of them the equations depend on
        zero, one = (converted_like(self.middle[0], k) for k in (0, 1))
        unit = [[one if k == row else zero for k in range(3)] for row in range(3)]
        self.lead: Matrix = [[*row, zero] for row in unit]
        self.axes: Matrix = unit
        self.rest: list[Any] = [zero] * 3
        self.own: list[Any] | None = None
        self.spread: Matrix = [[zero] * 4 for _ in range(3)]

    def box(self) -> tuple[Any, ...]:
        """Return a box, one ball for each coordinate, that contains all states of the set and its
        middle.
        """
        parts = zip(
            self.middle,
            matrix_times_vector(self.lead, self.deviation),
            matrix_times_vector(self.axes, self.rest),
            strict=True,
        )
        return tuple(middle + a + b.union(0 * b) for middle, a, b in parts)

    def matrix(self) -> tuple[tuple[Any, ...], ...]:
        """Return the derivatives of the set's states with respect to the deviations of start and
        Omega.
        """
        return tuple(
            tuple(row) for row in matrix_sum(self.lead, matrix_product(self.axes, self.spread))
        )

    def image(self, centre: Sequence[Any], rows: Matrix) -> tuple[Any, ...]:
        """Return a box that holds the images of all states of the set under a map.

        ``centre`` is the image of the set's middle, and ``rows`` the map's derivatives (3, 4) with
        respect to state and Omega.
        """
        lead, turned = self._mapped(rows)
        parts = zip(
            centre,
            matrix_times_vector(lead, self.deviation),
            matrix_times_vector(turned, self.rest),
            strict=True,
        )
        return tuple(a + b + c for a, b, c in parts)

    def image_of_middle(self, centre: Sequence[Any], rows: Matrix) -> list[Any]:
        """Return a box that holds the images, under a map, of the states on the middle's own
        orbits, without those of other orbits of the set.

        ``centre`` is the image of the middle, and ``rows`` the map's derivatives (3, 4).
        """
        assert self.own is not None
        return [
            a + b
            for a, b in zip(
                centre, matrix_times_vector(self._mapped(rows)[1], self.own), strict=True
            )
        ]

    def derivatives(self, rows: Matrix) -> tuple[tuple[Any, ...], ...]:
        """Return the derivatives (3, 4) of the set's states, after a map has been applied, with
        respect to the deviations of start and Omega.

        ``rows`` are the map's derivatives (3, 4) with respect to state and Omega.
        """
        lead, turned = self._mapped(rows)
        return tuple(tuple(row) for row in matrix_sum(lead, matrix_product(turned, self.spread)))

    def carried(self, centre: Sequence[Any], rows: Matrix, axes: Callable[..., Matrix]) -> Frame:
        """Return the set (a new `Frame`) of the images of all states of this set under a map.

        Args:
            centre: The image of the middle.
            rows: The derivatives (3, 4) of the map.
            axes: Called with the images of the old axes (balls) and the sizes along them. Returns
                the new axes (points).
        """
        lead, turned = self._mapped(rows)
        image = copy(self)
        image.middle = [part.mid() for part in centre]
        image.lead = [[entry.mid() for entry in row] for row in lead]
        sizes = [
            magnitude_estimate(part) + sum(map(magnitude_estimate, row))
            for part, row in zip(self.rest, self.spread, strict=True)
        ]
        image.axes = [
            [entry.mid() for entry in row] for row in axes([[*row] for row in turned], sizes)
        ]
        inverse = inverse_of_order_3(image.axes)
        left = matrix_product(
            inverse,
            [
                [range_of(a - b) for a, b in zip(*rows, strict=True)]
                for rows in zip(lead, image.lead, strict=True)
            ],
        )
        turned = matrix_product(inverse, turned)
        away = matrix_times_vector(
            inverse, [range_of(part - mid) for part, mid in zip(centre, image.middle, strict=True)]
        )
        parts = zip(
            away,
            matrix_times_vector(left, self.deviation),
            matrix_times_vector(turned, self.rest),
            strict=True,
        )
        image.rest = [a + b + c for a, b, c in parts]
        if self.own is not None:
            image.own = [
                a + b for a, b in zip(away, matrix_times_vector(turned, self.own), strict=True)
            ]
        image.spread = matrix_sum(left, matrix_product(turned, self.spread))
        return image

    def _mapped(self, rows: Matrix) -> tuple[Matrix, Matrix]:
        """Return the set's matrices ``lead`` and ``axes`` after a map with the derivatives ``rows``
        has been applied, as balls.

        The first one includes the map's own derivatives with respect to the equations' numbers.
        """
        lead = matrix_product(rows, self.lead)
        for entries, row in zip(lead, rows, strict=True):
            for column, own in zip(self.columns, row[3:], strict=True):
                entries[column] = entries[column] + own
        return lead, [[range_of(entry) for entry in row] for row in matrix_product(rows, self.axes)]
