"""Power series whose coefficients are arrays of balls.

As in `ball_array`, u = 2^-53 bounds the relative error of a rounding and t its absolute error where
it underflows. Roundings are counted as there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tippedisk_verify.proofs.kernel.ball_array import (
    BallArray,
    unchecked_ball_array,
    with_rounding,
    without_warnings,
)
from tippedisk_verify.proofs.kernel.doubles import SMALLEST_NORMAL, UNIT_ROUNDOFF, Array

__all__ = ["BallArraySeries"]

_MAX_TERMS = 2**16  # terms of a convolution: the count of roundings in its proof
_CAPACITY = 24  # the initial capacity in coefficients


class BallArraySeries(Sequence[BallArray]):
    """The coefficients of a power series, arrays of n balls, stored for a fast `convolution`.

    Coefficient k has five rows: the midpoints m, |m|, s = r + (k + 1/2) u |m|, |m| + r and the
    radii r. The two sums are rounded.
    """

    __slots__ = ("_length", "_rows")

    def __init__(self, width: int) -> None:
        self._rows: Array = np.empty((5, _CAPACITY, width))
        self._length = 0

    @property
    def width(self) -> int:
        """The number of balls in each coefficient of the series."""
        return int(self._rows.shape[2])

    @without_warnings
    def append(self, ball: BallArray) -> None:
        """Append a copy of an array of balls as the next coefficient of the series."""
        if self._length == self._rows.shape[1]:
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)], axis=1)
        mid, size, spread, upper, rad = self._rows[:, self._length]
        mid[:], rad[:] = ball.midpoints, ball.radii
        np.abs(mid, out=size)
        np.multiply(size, (self._length + 0.5) * UNIT_ROUNDOFF, out=spread)
        # The product may underflow, and its loss is later multiplied by the other factor
        spread += SMALLEST_NORMAL * (size > 0)
        spread += rad
        np.add(size, rad, out=upper)
        self._length += 1

    def clear(self) -> None:
        """Remove all coefficients of the series, and keep their memory."""
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: Any) -> Any:
        """Return one coefficient of the series, or a part of the series.

        Both are views that are valid until the next `clear`. In a part of a series each s is large
        enough: its new place is no later than its old one, and s grows with the place.
        """
        rows = self._rows[:, : self._length]
        if isinstance(index, slice):
            if index.step is not None and index.step < 0:
                raise ValueError("a part of a series keeps its order")
            part = BallArraySeries.__new__(BallArraySeries)
            part._rows = rows[:, index]
            part._length = part._rows.shape[1]
            return part
        return unchecked_ball_array(rows[0, index], rows[4, index])

    @without_warnings
    def convolution(self, other: BallArraySeries) -> BallArray | int:
        """Return a_0 b_(k-1) + … + a_(k-1) b_0 for series a, b of the same length k (0 for k = 0).

        Each term and the result are arrays of balls. The rest of this text proves the radius.

        *Midpoint.* It is a sum of k products. Their order is left to numpy, with fused operations
        or without, and a factor common to all terms may be taken out. The last operation's rounding
        is within u |c| + t. Before it each product has met at most k - 1 roundings, as additions to
        an accumulator that is zero are exact. With W the sum of |a_i| |b_j| and k <= 2^16 they
        change the sum by at most

            ((1 + u)^(k-1) - 1) W <= k u W.

        *Radius.* It is the sum of |a_i| rb_j + ra_i (|b_j| + rb_j) as in the product, and k u W. As
        k = i + j + 1, the sum of |a_i| s_j + s_i (|b_j| + rb_j) is at least both. Any term of it
        meets at most 2 k + 15 roundings: two in s, one in |b| + rb, one as a product, 2 k - 1 as
        one of 2 k terms, and the few behind. As in the docstring of `ball_array`, 1 + (4 k + 32) u
        outweighs them, for

            (1 - m u) (1 + 2 (m + 1) u) > 1   with   m = 2 k + 15 and k <= 2^16.
        """
        k = self._length
        if other._length != k:
            raise ValueError(
                f"a convolution needs series of one length, not {k} and {other._length}"
            )
        if k == 0:
            return 0
        if k > _MAX_TERMS:
            raise ValueError(f"a convolution of more than {_MAX_TERMS} terms is not offered")
        a, b = self._rows[:, :k], other._rows[:, :k][:, ::-1]
        middle = np.einsum("kn,kn->n", a[0], b[0])
        radius = np.einsum("pkn,pkn->n", a[1:3], b[2:4])
        return with_rounding(middle, radius, 1 + (4 * k + 32) * UNIT_ROUNDOFF)
