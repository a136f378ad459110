"""Chebyshev polynomials of s in [-1, 1] with balls for coefficients, and derivatives by rules.

A `Jet` c_0, ..., c_D stands for every f such that for each s by itself f(s) = x_0 + x_1 T_1(s) + ... + x_D T_D(s) with
numbers x_i in the balls c_i, which may differ from one s to the next. As 2 T_i T_j = T_(i+j) + T_|i-j|, what a product
has beyond T_D is no larger than its coefficients' sum, |T_k| <= 1, and goes into c_0 on both sides. The c_i may be
balls, power series in time or matrices of balls: what is said holds for each entry.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from flint import arb, arb_mat, arb_series

from tippedisk_verify.proofs.checker.steps import Unproved, coefficients

__all__ = ["Dual", "Jet", "at", "polynomial", "power_of", "sines", "small_sines", "symmetric", "values"]


_BOTH, _HALF = arb(0, 1), arb(0.5)
_TERMS = 8  # of a sine of what moves with s


def symmetric(x: Any) -> Any:
    """What holds the ball and its mirror image, of each entry."""
    return x * _BOTH


class Jet:
    """Coefficients of 1, s, ..., s^D; operands are of the same degree, or balls or integers."""

    __slots__ = ("c",)

    def __init__(self, coefficients: Sequence[Any]) -> None:
        self.c = tuple(coefficients)

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet([a + b for a, b in zip(self.c, other.c, strict=True)])
        return Jet([self.c[0] + other, *self.c[1:]])

    __radd__ = __add__

    def __neg__(self) -> Jet:
        return Jet([-x for x in self.c])

    def __sub__(self, other: Any) -> Jet:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Jet:
        return self.__neg__().__add__(other)

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([x * other for x in self.c])
        return _folded([[x * y for y in other.c] for x in self.c])

    def __rmul__(self, other: Any) -> Jet:
        return Jet([other * x for x in self.c])

    def reciprocal(self) -> Jet:
        """1 / c = z + z r + z r^2 / (1 - r) with r = 1 - c z for any z; Newton's method makes z."""
        try:
            if len(self.c) == 1:
                return Jet([_inverse(self.c[0])])
            centre = self.mid()
            z: Jet = Jet([1 / centre.c[0]])
            z = (z.c[0] * (2 - centre * z.c[0])).mid()
            z = (z * (2 - centre * z)).mid()
            r = 1 - self * z
            whole = r.range()
            rest = z.range() * whole * whole * _inverse(1 - whole)
            return z.__add__(z * r).__add__(rest)
        except (ValueError, ZeroDivisionError):  # Arb divides no series by a ball that holds zero
            raise Unproved("a divisor may vanish") from None

    def __truediv__(self, other: Jet) -> Jet:
        return self * other.reciprocal()

    def mid(self) -> Jet:
        return Jet([_mid(x) for x in self.c])

    def range(self) -> Any:
        """Balls that hold all values."""
        return sum(map(symmetric, self.c[1:]), self.c[0])

    def cut(self, degree: int) -> Jet:
        """The same values by no more than this degree: c_0 takes what is beyond it."""
        return Jet([Jet([self.c[0], *self.c[degree + 1 :]]).range(), *self.c[1 : degree + 1]])

    def map(self, function: Callable[[Any], Any]) -> Jet:
        """A linear function of each coefficient."""
        return Jet([function(x) for x in self.c])


def power_of(x: Any, exponent: int) -> Any:
    """A ball's power by products, as Arb's own takes the logarithm."""
    total = arb(1)
    for _ in range(exponent):
        total = total * x
    return total


def polynomial(series: Jet, length: int, last: Any = None) -> Jet:
    """The first coefficients of power series in time, as lists, with one more for all s behind them."""
    rows = [coefficients(row, length) for row in series.c]
    if last is not None:
        for row, end in zip(rows, (last, *[arb(0)] * (len(rows) - 1)), strict=True):
            row.append(end)
    return Jet(rows)


def at(terms: Jet, time: Any) -> Jet:
    """A polynomial in time at a point or a ball."""
    parts = [Jet(part) for part in zip(*terms.c, strict=True)]
    total = parts.pop()
    while parts:
        total = total * time + parts.pop()
    return total


def values(polynomials: Sequence[Jet], time: Jet) -> list[Jet]:
    """Polynomials in time, of one length, at a jet: sums over its powers of all products of two coefficients."""
    powers = [1 + 0 * time]
    while len(powers) < len(polynomials[0].c[0]):
        powers.append(powers[-1] * time)
    rows = arb_mat([power.c for power in powers])
    return [_folded((arb_mat(terms.c) * rows).tolist()) for terms in polynomials]


def sines(x: Jet) -> tuple[Jet, Jet]:
    """sin and cos by Taylor's formula about c_0: the rest is at most |x - c_0|^n / n!, of either."""
    start = x.c[0]
    sine, cosine = start.sin(), start.cos()
    derivatives = (sine, cosine, -sine, -cosine)
    shift = Jet([0 * start, *x.c[1:]])
    found = [shift * 0 + value for value in (sine, cosine)]
    if len(x.c) > 1:
        part, factor = shift, arb(1)
        for n in range(1, _TERMS):
            factor = factor * n
            found = [total + part * (derivatives[(n + k) % 4] / factor) for k, total in enumerate(found)]
            part = part * shift
        rest = symmetric(power_of(shift.range(), _TERMS)) / (factor * _TERMS)
        found = [total + rest for total in found]
    return found[0], found[1]


def small_sines(x: Jet, q: Jet) -> tuple[Jet, Jet, Jet]:
    """sin(a x) / a, cos(a x) and the derivative of the first by q = a^2, for q >= 0 that may be zero.

    With z = q x^2 they are x times the sum of (-z)^k / (2 k + 1)!, that of (-z)^k / (2 k)!, and -x^3 / 2 times that of
    (-z)^k / ((2 k + 3) (2 k + 1)!); the last one is -1/2 times the integral of t^2 sin(t y) / y over t in [0, 1], y^2 =
    z, by which the first one's derivative by z is given. As the series of sine and cosine in y, whose derivatives are
    at most 1, each differs from its first n terms by no more than the size of the next one.
    """
    square = x * x
    z, terms = q * square, 16
    largest = symmetric(z.range())
    sizes: list[list[Any]] = [[], [], []]
    factorial = arb(1)  # (2 k)!
    for k in range(terms + 1):
        odd = factorial * (2 * k + 1)
        for part, size in zip(sizes, (odd, factorial, (2 * k + 3) * odd), strict=True):
            part.append(1 / size)
        factorial = odd * (2 * k + 2)
    found = []
    for part in sizes:
        total = Jet([part[terms - 1], *[arb(0)] * (len(x.c) - 1)])
        for size in reversed(part[: terms - 1]):
            total = -(total * z) + size
        found.append(total + power_of(largest, terms) * part[terms])
    return x * found[0], found[1], x * square * found[2] * (arb(-1) / 2)


class Dual:
    """A value with derivatives by some numbers, None for 0: sums, products and quotients by their rules."""

    __slots__ = ("by", "x")

    def __init__(self, x: Any, by: Sequence[Any]) -> None:
        self.x, self.by = x, by

    def __add__(self, other: Any) -> Dual:
        if not isinstance(other, Dual):
            return Dual(self.x + other, self.by)
        return Dual(self.x + other.x, [_plus(a, b) for a, b in zip(self.by, other.by, strict=True)])

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.x, [None if a is None else -a for a in self.by])

    def __sub__(self, other: Any) -> Dual:
        return self.__add__(-other)

    def __mul__(self, other: Any) -> Dual:
        if not isinstance(other, Dual):
            return Dual(self.x * other, [None if a is None else a * other for a in self.by])
        by = [
            _plus(None if a is None else a * other.x, None if b is None else self.x * b)
            for a, b in zip(self.by, other.by, strict=True)
        ]
        return Dual(self.x * other.x, by)

    __rmul__ = __mul__

    def __truediv__(self, other: Dual) -> Dual:
        inverse = other.x.reciprocal()
        x = self.x * inverse
        by = [
            None if a is b is None else _plus(a, None if b is None else -(x * b)) * inverse
            for a, b in zip(self.by, other.by, strict=True)
        ]
        return Dual(x, by)


def _folded(products: Sequence[Sequence[Any]]) -> Jet:
    """The sum of products[i][j] T_i T_j, of the second factor's degree."""
    if len(products) == 1:
        return Jet(products[0])
    terms = [[products[i][j] for i, j in pairs] for pairs in _table(len(products), len(products[0]))]
    return Jet([sum(row[1:], row[0]) * _HALF for row in terms]).cut(len(products[0]) - 1)


@cache
def _table(rows: int, columns: int) -> list[list[tuple[int, int]]]:
    """For each k the pairs (i, j) that have T_k / 2 in T_i T_j, twice where they have it all."""
    pairs = [(i, j) for i in range(rows) for j in range(columns)]
    return [[(i, j) for i, j in pairs for n in (i + j, abs(i - j)) if n == k] for k in range(rows + columns - 1)]


def _inverse(x: Any) -> Any:
    """1 / x, of series term by term: Newton's method, which is Arb's, widens wide balls."""
    if not isinstance(x, arb_series):
        return 1 / x
    first = 1 / x[0]
    found: list[Any] = []
    for k in range(x.prec):
        found.append(first if not k else -first * sum(x[i] * found[k - i] for i in range(1, k + 1)))
    return arb_series(found, prec=x.prec)


def _mid(x: Any) -> Any:
    if isinstance(x, arb_series):
        return arb_series([x[k].mid() for k in range(x.prec)], prec=x.prec)
    return x.mid()


def _plus(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else a + b
