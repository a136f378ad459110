"""Truncated Taylor series in (beta, gamma): values and all partial derivatives at a point, for any kind of number.

A jet of degree n holds the coefficients c_ij of (beta - beta_0)^i (gamma - gamma_0)^j for i + j <= n. Sums and products
of jets are those of the series; the recursion for the slow manifold needs nothing else, and its cost grows like a
power of the order where symbolic expressions would grow exponentially.
"""

from __future__ import annotations

import math
from typing import Any

from tippedisk_verify.model.equations import Ops

__all__ = ["Jet", "coordinate_sine"]


class Jet:
    """Coefficients ``c[i][j]``, i + j <= degree. Arithmetic keeps the smaller of two degrees."""

    __slots__ = ("c", "degree")

    def __init__(self, coefficients: list[list[Any]]) -> None:
        self.c = coefficients
        self.degree = len(coefficients) - 1

    @classmethod
    def constant(cls, value: Any, degree: int) -> Jet:
        zero = 0 * value
        return cls([[value if i == j == 0 else zero for j in range(degree + 1 - i)] for i in range(degree + 1)])

    @property
    def value(self) -> Any:
        return self.c[0][0]

    def cut(self, degree: int) -> Jet:
        """The same series to a lower degree."""
        return (
            self
            if degree >= self.degree
            else Jet([row[: degree + 1 - i] for i, row in enumerate(self.c[: degree + 1])])
        )

    def _paired(self, other: Any) -> tuple[Jet, Jet]:
        right = other if isinstance(other, Jet) else Jet.constant(other, self.degree)
        degree = min(self.degree, right.degree)
        return self.cut(degree), right.cut(degree)

    def __add__(self, other: Any) -> Jet:
        left, right = self._paired(other)
        return Jet([[a + b for a, b in zip(x, y, strict=True)] for x, y in zip(left.c, right.c, strict=True)])

    def __neg__(self) -> Jet:
        return Jet([[-a for a in row] for row in self.c])

    def __sub__(self, other: Any) -> Jet:
        difference: Jet = self + (-other)
        return difference

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([[a * other for a in row] for row in self.c])
        left, right = self._paired(other)
        n = left.degree
        product = [[0 * left.value] * (n + 1 - i) for i in range(n + 1)]
        for i, row in enumerate(left.c):
            for j, a in enumerate(row):
                if a:
                    for k in range(n + 1 - i - j):
                        target, other_row = product[i + k], right.c[k]
                        for m in range(n + 1 - i - j - k):
                            target[j + m] += a * other_row[m]
        return Jet(product)

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Any) -> Jet:
        difference: Jet = -self + other
        return difference

    def __pow__(self, exponent: int) -> Jet:
        """A whole power from 0 on."""
        if not isinstance(exponent, int) or exponent < 0:
            return NotImplemented
        return math.prod([self] * exponent, start=Jet.constant(1, self.degree))

    def __truediv__(self, other: Any) -> Jet:
        """Division by a jet with a value other than zero, or by a number."""
        if not isinstance(other, Jet):
            return Jet([[a / other for a in row] for row in self.c])
        left, right = self._paired(other)
        n = left.degree
        quotient = [[0 * left.value] * (n + 1 - i) for i in range(n + 1)]
        for total in range(n + 1):
            for i in range(total + 1):
                j = total - i
                rest = left.c[i][j]
                for k in range(i + 1):
                    for m in range(j + 1):
                        if k or m:
                            rest -= right.c[k][m] * quotient[i - k][j - m]
                quotient[i][j] = rest / right.value
        return Jet(quotient)

    def by_beta(self) -> Jet:
        """Partial derivative; one degree is lost."""
        return Jet([[(i + 1) * value for value in self.c[i + 1]] for i in range(self.degree)])

    def by_gamma(self) -> Jet:
        """Partial derivative; one degree is lost."""
        return Jet([[(j + 1) * row[j + 1] for j in range(len(row) - 1)] for row in self.c[: self.degree]])


def coordinate_sine(ops: Ops, angle: Any, degree: int, axis: int) -> tuple[Jet, Jet]:
    """Jets of the sine and cosine of one coordinate (axis 0: beta, 1: gamma)."""
    sine, cosine = ops.sin(angle), ops.cos(angle)
    cycle = (sine, cosine, -sine, -cosine)
    jets = []
    for phase in (0, 1):
        series = Jet.constant(cycle[phase], degree)
        factor = 1
        for order in range(1, degree + 1):
            factor *= order
            place = (order, 0) if axis == 0 else (0, order)
            series.c[place[0]][place[1]] = cycle[(order + phase) % 4] / factor
        jets.append(series)
    return jets[0], jets[1]
