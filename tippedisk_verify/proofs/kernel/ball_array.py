"""Arrays of balls in double precision: `BallArray`, a second arithmetic for proofs whose boxes are
independent, and `BallArraySeries`, power series with such coefficients.

Entry i of a `BallArray` is the ball of all real numbers x with |x - mid[i]| <= rad[i]. Each
operation returns balls that hold its result for every choice of points in its operands' balls, like
those of `arb`. In an array of a thousand balls each costs a twentieth as much. An infinite radius
means that nothing is known. It results from overflow, from NaN, and from division by a ball that
holds 0, and every predicate is False for it.

Assumptions
-----------
Numpy's sums, differences, products and quotients of float64 arrays are those of IEEE 754, rounded
to nearest. Another rounding mode is noticed and refused. With u = 2^-53 the computed result c of
one of them is, unless it overflows,

    c = exact (1 + d) + t,  |d| <= u,  |t| <= 2^-1022;
    also  |c - exact| <= u |c| + 2^-1022.                                                  (1)

t allows for underflow. It is so large that (1) also holds on a processor set to flush subnormal
results to zero. A processor that reads subnormal operands as zero is covered as well: radii are 0
or at least 2^-1022, and the radius of a subnormal midpoint holds both readings. For this
`BallArray` cleans its input, and an operation adds 2^-1000 to the radius of its result. Absolute
values, negation, comparisons, choices and scaling by 1 and -1 are exact. Fused multiply-adds leave
out a rounding, which (1) allows too.

Radii
-----
A radius is computed by sums, products and quotients of numbers that are not negative. Between any
input and the result lie at most 15 roundings. With the relative errors alone the computed value is
at least (1 - u)^15 times the exact one, and

    (1 - u)^15 (1 + 16 u) >= 1 + u - 240 u^2 > 1.

So `_RADIUS_FACTOR` = 1 + 16 u, times the rounded result, is an upper bound: the multiplication's
own rounding is one of the 15. The absolute errors t of (1) are only added, or multiplied by numbers
below 2. There are fewer than 2^20 of them in any expression, so `_UNDERFLOW_ALLOWANCE` = 2^-1000
exceeds their sum, those of the midpoint included. Where one would be multiplied by a large number,
`_UNDERFLOW_ALLOWANCE` is added before, with a comment.

Numpy's sine and cosine are not correctly rounded and differ between processors: `doubles` has its
own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tippedisk_verify.proofs.kernel.balls import DisturbedError
from tippedisk_verify.proofs.kernel.doubles import (
    SMALLEST_NORMAL,
    UNIT_ROUNDOFF,
    Array,
    outward_rounded,
    sine_and_cosine,
)

__all__ = ["BallArray", "BallArraySeries"]

_RADIUS_FACTOR = 1 + 16 * UNIT_ROUNDOFF
_UNDERFLOW_ALLOWANCE = 2.0**-1000
_EXACT_INTEGERS = 2**53
_MAX_TERMS = 2**16  # terms of a convolution: the count of roundings in its proof
_CAPACITY = 24  # the initial capacity of a series in coefficients

_F = TypeVar("_F", bound=Callable[..., Any])
_IGNORES_WARNINGS: ContextVar[bool] = ContextVar("_IGNORES_WARNINGS", default=False)
_PROBE_STEPS = np.array([UNIT_ROUNDOFF, 3 * UNIT_ROUNDOFF])
_PROBE_SUMS = np.array([1.0, 1 + 4 * UNIT_ROUNDOFF])  # 1 + step, rounded to nearest


def _require_rounding_to_nearest() -> None:
    """Raise DisturbedError unless floating-point arithmetic in this process rounds to nearest.

    In another rounding mode the error bound (1) of this module would need 2 u in place of u.
    """
    if (1 + _PROBE_STEPS != _PROBE_SUMS).any():
        raise DisturbedError(
            "this process does not round to nearest: proofs in doubles are not possible in it"
        )


@contextmanager
def ignoring_numpy_warnings() -> Iterator[None]:
    """Suppress numpy's floating-point warnings within a with block about operations on these
    arrays.

    Overflow and NaN become infinite radii, so the warnings are not needed. Every operation on these
    arrays enters this context; entering it once around many saves time. Raises DisturbedError if
    this process does not round to nearest.
    """
    _require_rounding_to_nearest()
    with np.errstate(all="ignore"):
        before = _IGNORES_WARNINGS.set(True)
        try:
            yield
        finally:
            _IGNORES_WARNINGS.reset(before)


def _without_warnings(function: _F) -> _F:
    """Decorate an operation on arrays of balls so that it runs within `ignoring_numpy_warnings`."""

    @wraps(function)
    def wrapped(*arguments: Any) -> Any:
        if _IGNORES_WARNINGS.get():
            return function(*arguments)
        with ignoring_numpy_warnings():
            return function(*arguments)

    return cast(_F, wrapped)


class BallArray:
    """An array of n balls, from exact midpoints and radii of shape (n,) or (1,).

    A single ball may be combined with n. A midpoint that is not finite makes an infinite ball, and
    so does a radius that is negative or NaN. Operands may be arrays of balls, integers, floats,
    Fractions and Arb's balls. Raises TypeError for midpoints or radii that are not doubles.
    """

    __slots__ = ("_mid", "_rad")
    ignoring_numpy_warnings = staticmethod(ignoring_numpy_warnings)
    __array_ufunc__ = None  # numpy's numbers on the left leave the operation to this class

    @_without_warnings
    def __init__(self, mid: ArrayLike, rad: ArrayLike = 0.0) -> None:
        midpoints, radii = np.broadcast_arrays(np.atleast_1d(_doubles(mid)), _doubles(rad))
        if midpoints.ndim != 1:
            raise ValueError("arrays of balls are one-dimensional")
        m, r = midpoints.copy(), radii.copy()
        # Read as bits, because a processor may be set to see zeros instead of subnormals.
        bits, r_bits = (part.view(np.uint64) & np.uint64(2**63 - 1) for part in (m, r))
        small = (bits > 0) & (bits < 2**52)
        m[small] = 0.0
        # |mid| + rad <= 2^-1022 + rad; a radius above it is increased by far more than its
        # rounding.
        r[(r_bits > 0) & (r_bits < 2**52)] = SMALLEST_NORMAL
        r[small] = (r[small] + 4 * SMALLEST_NORMAL) * _RADIUS_FACTOR
        r[~(np.isfinite(m) & (r >= 0))] = np.inf
        self._mid, self._rad = m, r

    @classmethod
    def of(cls, values: Iterable[Any]) -> BallArray:
        """Return an array with a ball around each number: Arb's balls, Fractions, integers or
        floats.
        """
        pairs = [outward_rounded(value) for value in values]
        return cls([mid for mid, _ in pairs], [rad for _, rad in pairs])

    @property
    def midpoints(self) -> Array:
        """The midpoints of the balls; those of infinite balls have no meaning."""
        return self._mid

    @property
    def radii(self) -> Array:
        """The radii of the balls: never negative, never NaN, infinite where nothing is known."""
        return self._rad

    def mid(self) -> BallArray:
        """Return the midpoints of the balls as balls of radius zero (infinite where the
        ball is).
        """
        return BallArray(np.where(self._rad < np.inf, self._mid, np.nan))

    def rad(self) -> BallArray:
        """Return the radii of the balls as balls of radius zero (infinite where the ball is)."""
        return BallArray(self._rad)

    def is_finite(self) -> NDArray[np.bool_]:
        """Return a mask that is True for finite balls."""
        return self._rad < np.inf

    def __len__(self) -> int:
        return len(self._mid)

    def __getitem__(self, places: Any) -> BallArray:
        """Return some of the array's balls: those of a slice, a mask or a list of indices."""
        return _unchecked_ball_array(self._mid[places], self._rad[places])

    def series(self, old: object = None) -> BallArraySeries:
        """Return an empty power series, whose coefficients will be arrays of as many balls as this
        one.

        The memory of ``old``, a series no longer needed, is reused if its width fits.
        """
        if isinstance(old, BallArraySeries) and old.width == len(self):
            old.clear()
            return old
        return BallArraySeries(len(self))

    # The triangle inequality and (1) for the midpoint: |x + y - c| <= ra + rb + u |c| + t.
    @_without_warnings
    def __add__(self, other: Any) -> BallArray:
        if isinstance(other, int) and other == 0:
            return self
        b = _operand(other)
        return _with_rounding(self._mid + b._mid, self._rad + b._rad)

    __radd__ = __add__

    def __sub__(self, other: Any) -> BallArray:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> BallArray:
        return (-self).__add__(other)

    def __neg__(self) -> BallArray:
        return _unchecked_ball_array(-self._mid, self._rad)

    # (a + s)(b + t) - a b = a t + s (b + t). With |s| <= ra and |t| <= rb this is at most
    # |a| rb + ra (|b| + rb).
    @_without_warnings
    def __mul__(self, other: Any) -> BallArray:
        factor = _exact_float(other)
        if factor in (1.0, -1.0):
            return self if factor > 0 else -self
        if factor is not None:
            return _with_rounding(self._mid * factor, self._rad * abs(factor))
        b = _operand(other)
        radius = np.abs(self._mid) * b._rad
        upper = np.abs(b._mid)
        upper += b._rad
        radius += self._rad * upper
        return _with_rounding(self._mid * b._mid, radius)

    __rmul__ = __mul__

    @_without_warnings
    def square(self) -> BallArray:
        """Return the squares of the balls.

        Let a be a midpoint and |s| at most its radius. Then (a + s)^2 - a^2 = s (2 a + s). So the
        result is no wider than the product, and takes fewer operations.
        """
        radius = np.abs(self._mid)
        radius += radius
        radius += self._rad
        radius *= self._rad
        return _with_rounding(self._mid * self._mid, radius)

    @_without_warnings
    def __truediv__(self, other: Any) -> BallArray:
        """Return balls that hold the quotients by ``other``; they are infinite where the divisor's
        ball holds 0.

        If |b| > rb, then (a + s) / (b + t) - a / b = (s - (a / b) t) / (b + t) is at most

            (ra + |a / b| rb) / (|b| - rb).

        d = |b| - rb is rounded once and not negative if |b| > rb; where it is not positive there is
        no bound. The absolute error of q = a / b is below 2^-1022 and is multiplied by rb / d. That
        of rb / d is multiplied by |q|. Hence `_UNDERFLOW_ALLOWANCE` in both.
        """
        if factor := _exact_float(other):
            return _with_rounding(self._mid / factor, self._rad / abs(factor))
        b = _operand(other)
        distance = np.abs(b._mid)
        distance -= b._rad
        distance[~(distance > 0)] = np.nan
        quotient = self._mid / b._mid
        radius = np.abs(quotient)
        radius += _UNDERFLOW_ALLOWANCE
        radius *= b._rad / distance + _UNDERFLOW_ALLOWANCE
        radius += self._rad / distance
        return _with_rounding(quotient, radius)

    def __rtruediv__(self, other: Any) -> BallArray:
        return _operand(other) / self

    def sin(self) -> BallArray:
        """Return balls that hold the sine of these balls; infinite for midpoints beyond 2^18."""
        return self._shifted_sine(0)

    def cos(self) -> BallArray:
        """Return balls that hold the cosine of these balls; infinite for midpoints beyond 2^18."""
        return self._shifted_sine(1)

    @_without_warnings
    def _shifted_sine(self, quarters: int) -> BallArray:
        """Return sin(x + quarters pi/2) for these balls x; with 1 quarter that is the cosine.

        Let x = y + n pi/2 and j = n + quarters. Then the result is sin(y + j pi/2).

        Let S and C be the sine and cosine of the midpoint plus the quarters. For |s| <= r, by
        Taylor's formula, |sin(x + s) - S| <= min(r, |C| r + r^2 / 2). So the ball hardly widens at
        an extremum of the sine. The error t of C is multiplied by r, so `_UNDERFLOW_ALLOWANCE` is
        added to its bound.
        """
        n, sine, sine_error, cosine, cosine_error = sine_and_cosine(self._mid)
        j = n + quarters
        j -= 4 * np.floor(j / 4)
        odd = j % 2 == 1
        value = np.where(odd, cosine, sine)
        slope = (
            np.where(odd, np.abs(sine) + sine_error, np.abs(cosine) + cosine_error)
            + _UNDERFLOW_ALLOWANCE
        )
        error = np.where(odd, cosine_error, sine_error)
        r = self._rad
        radius = np.minimum(r, slope * r + 0.5 * r * r) + error
        return _with_rounding(np.where(j >= 2, -value, value), radius)

    def __pow__(self, power: int) -> BallArray:
        """Return the balls raised to a positive integer power, by repeated squaring."""
        half = self ** (power // 2) if power > 1 else self
        if power < 2:
            return self
        return half.square() * self if power % 2 else half.square()

    @_without_warnings
    def abs_upper(self) -> BallArray:
        """Return upper bounds of the absolute values of the balls, as balls of radius zero
        (infinite where the ball is).
        """
        return BallArray((np.abs(self._mid) + self._rad) * _RADIUS_FACTOR + _UNDERFLOW_ALLOWANCE)

    def around_zero(self) -> BallArray:
        """Return balls about 0 whose radii are `abs_upper`, the upper bounds of the absolute
        values.
        """
        return BallArray(np.zeros(len(self)), self.abs_upper()._mid)

    def constant(self, value: Any) -> BallArray:
        """Return an array of this length whose balls all hold one number. An array of balls is
        returned unchanged.
        """
        return (
            value
            if isinstance(value, BallArray)
            else BallArray.of([value])[np.zeros(len(self), int)]
        )

    converted_like = constant

    @_without_warnings
    def union(self, other: Any) -> BallArray:
        """Return balls that hold both operands.

        The midpoint may be any number, because the radius is measured from it.
        """
        b = _operand(other)
        middle = 0.5 * self._mid + 0.5 * b._mid
        farthest = np.abs(self._mid - middle) + self._rad
        return _with_rounding(middle, np.maximum(farthest, np.abs(b._mid - middle) + b._rad))

    def positive(self) -> NDArray[np.bool_]:
        """Return a mask that is True for balls whose numbers are all positive.

        This is a comparison of two floats.
        """
        return (self._mid > self._rad) & self.is_finite()

    def negative(self) -> NDArray[np.bool_]:
        """Return a mask that is True for balls whose numbers are all negative."""
        return (-self._mid > self._rad) & self.is_finite()

    @_without_warnings
    def inside(self, other: Any) -> NDArray[np.bool_]:
        """Return a mask that is True for balls in the interior of the other array's ball.

        It is False where either ball is infinite.
        """
        b = _operand(other)
        farthest = np.abs(self._mid - b._mid)
        farthest += self._rad
        farthest *= _RADIUS_FACTOR
        farthest += _UNDERFLOW_ALLOWANCE
        return cast(NDArray[np.bool_], (farthest < b._rad) & b.is_finite())


def _doubles(values: Any) -> Array:
    """Convert floats to an array of doubles.

    Other kinds of numbers are refused with a TypeError: conversion might round them.
    """
    many = values if isinstance(values, Sequence) else [values]
    if not (
        values.dtype == np.float64
        if isinstance(values, np.ndarray)
        else all(isinstance(x, float) for x in many)
    ):
        raise TypeError("midpoints and radii are doubles: BallArray.of takes other numbers")
    return np.asarray(values, dtype=np.float64)


def _unchecked_ball_array(mid: Array, rad: Array) -> BallArray:
    """Return a `BallArray` that shares the given arrays, without checking or copying them.

    The arrays must already obey the module's rules for midpoints and radii.
    """
    ball = BallArray.__new__(BallArray)
    ball._mid, ball._rad = mid, rad
    return ball


def _with_rounding(middle: Array, radius: Array, up: float = _RADIUS_FACTOR) -> BallArray:
    """Return an array of balls for the rounded result of an operation.

    The rounding error of the midpoint ``middle`` is added to ``radius``, a new array computed from
    the operands' radii, which is overwritten. The factor ``up`` outweighs the radius's own
    roundings. If the midpoint is not finite, the radius becomes infinite: fmin turns NaN into
    infinity.
    """
    rounding = np.abs(middle)
    rounding *= UNIT_ROUNDOFF
    radius += rounding
    radius *= up
    radius += _UNDERFLOW_ALLOWANCE
    return _unchecked_ball_array(middle, np.fmin(radius, np.inf, out=radius))


def _exact_float(value: Any) -> float | None:
    """Convert an integer or float to a float if that is exact; otherwise return None.

    Subnormal floats and 0.0 also give None, because some processors do not tell them apart.
    """
    if isinstance(value, int) and abs(value) <= _EXACT_INTEGERS:
        return float(value)
    return (
        float(value)
        if isinstance(value, float) and SMALLEST_NORMAL <= abs(value) < np.inf
        else None
    )


def _operand(value: Any) -> BallArray:
    return value if isinstance(value, BallArray) else BallArray.of([value])


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

    @_without_warnings
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
        return _unchecked_ball_array(rows[0, index], rows[4, index])

    @_without_warnings
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
        one of 2 k terms, and the few behind. As in the module's docstring, 1 + (4 k + 32) u
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
        return _with_rounding(middle, radius, 1 + (4 * k + 32) * UNIT_ROUNDOFF)
