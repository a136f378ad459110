"""Sets of states that flow: deviations from the start carried by points, and a small turned box.

A set is  middle + linear_part d + axes q  for all d and q of two boxes. The deviation d of start
and speed from their midpoints is the same at all times. A term linear in d is never wrapped into a
box (R. J. Lohner's doubleton; Mrozek and Zgliczynski, Ann. Polon. Math. 74, 2000). The box of q
holds the rest, which is quadratic in d but for rounding. Its axes are chosen to follow the flow
(Lohner's QR method; `search.step_search`).

``middle``, ``linear_part`` and ``axes`` are points, so nothing is rounded in them. A map with
enclosed derivatives M over the set takes it to

    image of middle  +  (M linear_part + by Omega) d  +  M axes q.

New points are chosen. The differences between the balls and these points go into q, turned into the
new axes by an enclosure of their inverse. Likewise, the derivatives of the states with respect to
start and Omega are linear_part + axes remainder_derivatives.

Where a ball becomes a point: middle and linear_part are midpoints, axes any regular matrix of
points.
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

__all__ = ["Doubleton"]


class Doubleton:
    """A set of states of a flight, enclosed as middle + linear_part d + axes q for all d and q in
    two boxes.

    It also holds their derivatives (3, 4) with respect to the start's three coordinates and Omega.

    In a set over a curve (`half_map_of_curves`), middle and linear_part are jets, and the
    deviations differ. Its ``middle_remainder`` is the part of ``remainder`` that belongs to the
    middle's own orbits.
    """

    __slots__ = (
        "axes",
        "deviation",
        "linear_part",
        "middle",
        "middle_remainder",
        "parameter_columns",
        "remainder",
        "remainder_derivatives",
    )

    def __init__(self, start: Sequence[Any], omega: Any) -> None:
        self.middle: list[Any] = [part.mid() for part in start]
        #: d: four balls about zero
        self.deviation = [
            *(x - mid for x, mid in zip(start, self.middle, strict=True)),
            omega - omega.mid(),
        ]
        self.parameter_columns: Sequence[int] = (3,)  #: which of them the equations depend on
        zero, one = (converted_like(self.middle[0], k) for k in (0, 1))
        unit = [[one if k == row else zero for k in range(3)] for row in range(3)]
        self.linear_part: Matrix = [[*row, zero] for row in unit]
        self.axes: Matrix = unit
        self.remainder: list[Any] = [zero] * 3
        self.middle_remainder: list[Any] | None = None
        self.remainder_derivatives: Matrix = [[zero] * 4 for _ in range(3)]

    def box(self) -> tuple[Any, ...]:
        """Return a box, one ball for each coordinate, that contains all states of the set and its
        middle.
        """
        parts = zip(
            self.middle,
            matrix_times_vector(self.linear_part, self.deviation),
            matrix_times_vector(self.axes, self.remainder),
            strict=True,
        )
        return tuple(middle + a + b.union(0 * b) for middle, a, b in parts)

    def derivative_matrix(self) -> tuple[tuple[Any, ...], ...]:
        """Return the derivatives of the set's states with respect to the deviations of start and
        Omega.
        """
        return tuple(
            tuple(row)
            for row in matrix_sum(
                self.linear_part, matrix_product(self.axes, self.remainder_derivatives)
            )
        )

    def image(self, centre: Sequence[Any], jacobian: Matrix) -> tuple[Any, ...]:
        """Return a box that holds the images of all states of the set under a map.

        ``centre`` is the image of the set's middle, and ``jacobian`` the map's derivatives (3, 4)
        with respect to state and Omega.
        """
        linear_part, mapped_axes = self._mapped_columns(jacobian)
        parts = zip(
            centre,
            matrix_times_vector(linear_part, self.deviation),
            matrix_times_vector(mapped_axes, self.remainder),
            strict=True,
        )
        return tuple(a + b + c for a, b, c in parts)

    def image_of_middle(self, centre: Sequence[Any], jacobian: Matrix) -> list[Any]:
        """Return a box that holds the images, under a map, of the states on the middle's own
        orbits, without those of other orbits of the set.

        ``centre`` is the image of the middle, and ``jacobian`` the map's derivatives (3, 4).
        """
        assert self.middle_remainder is not None
        return [
            a + b
            for a, b in zip(
                centre,
                matrix_times_vector(self._mapped_columns(jacobian)[1], self.middle_remainder),
                strict=True,
            )
        ]

    def derivatives_after_map(self, jacobian: Matrix) -> tuple[tuple[Any, ...], ...]:
        """Return the derivatives (3, 4) of the set's states, after a map has been applied, with
        respect to the deviations of start and Omega.

        ``jacobian`` are the map's derivatives (3, 4) with respect to state and Omega.
        """
        linear_part, mapped_axes = self._mapped_columns(jacobian)
        return tuple(
            tuple(row)
            for row in matrix_sum(
                linear_part, matrix_product(mapped_axes, self.remainder_derivatives)
            )
        )

    def image_set(
        self, centre: Sequence[Any], jacobian: Matrix, axes: Callable[..., Matrix]
    ) -> Doubleton:
        """Return the set (a new `Doubleton`) of the images of all states of this set under a map.

        Args:
            centre: The image of the middle.
            jacobian: The derivatives (3, 4) of the map.
            axes: Called with the images of the old axes (balls) and the sizes along them. Returns
                the new axes (points).
        """
        linear_part, mapped_axes = self._mapped_columns(jacobian)
        image = copy(self)
        image.middle = [part.mid() for part in centre]
        image.linear_part = [[entry.mid() for entry in row] for row in linear_part]
        sizes = [
            magnitude_estimate(part) + sum(map(magnitude_estimate, row))
            for part, row in zip(self.remainder, self.remainder_derivatives, strict=True)
        ]
        image.axes = [
            [entry.mid() for entry in row] for row in axes([[*row] for row in mapped_axes], sizes)
        ]
        inverse = inverse_of_order_3(image.axes)
        left = matrix_product(
            inverse,
            [
                [range_of(a - b) for a, b in zip(*jacobian, strict=True)]
                for jacobian in zip(linear_part, image.linear_part, strict=True)
            ],
        )
        mapped_axes = matrix_product(inverse, mapped_axes)
        offset = matrix_times_vector(
            inverse, [range_of(part - mid) for part, mid in zip(centre, image.middle, strict=True)]
        )
        parts = zip(
            offset,
            matrix_times_vector(left, self.deviation),
            matrix_times_vector(mapped_axes, self.remainder),
            strict=True,
        )
        image.remainder = [a + b + c for a, b, c in parts]
        if self.middle_remainder is not None:
            image.middle_remainder = [
                a + b
                for a, b in zip(
                    offset, matrix_times_vector(mapped_axes, self.middle_remainder), strict=True
                )
            ]
        image.remainder_derivatives = matrix_sum(
            left, matrix_product(mapped_axes, self.remainder_derivatives)
        )
        return image

    def _mapped_columns(self, jacobian: Matrix) -> tuple[Matrix, Matrix]:
        """Return the set's matrices ``linear_part`` and ``axes`` after a map with the derivatives
        ``jacobian`` has been applied, as balls.

        The first one includes the map's own derivatives with respect to the equations' numbers.
        """
        linear_part = matrix_product(jacobian, self.linear_part)
        for entries, row in zip(linear_part, jacobian, strict=True):
            for column, own in zip(self.parameter_columns, row[3:], strict=True):
                entries[column] = entries[column] + own
        return linear_part, [
            [range_of(entry) for entry in row] for row in matrix_product(jacobian, self.axes)
        ]
