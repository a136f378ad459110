"""Truncated power series in one or two variables, for any kind of number.

A series of degree n holds the coefficients of all monomials of total degree up to n. Their graded
order is 1, x, y, x^2, x y, y^2, ..., which is 1, s, s^2, ... in one variable. A series of lower
degree is the beginning of that list, and a sum or product has the smaller of two degrees. The cost
of arithmetic grows like a power of the degree, where symbolic expressions would grow exponentially.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from operator import itemgetter
from types import SimpleNamespace
from typing import Any

import numpy

__all__ = ["ANGLE_OPS", "PowerSeries", "sine_and_cosine"]

#: The functions of angles that are given as pairs of their sine and cosine; ``plain`` are those
#: for a friction law, whose argument is not an angle.
ANGLE_OPS: Any = SimpleNamespace(sin=itemgetter(0), cos=itemgetter(1), plain=numpy)


class PowerSeries:
    """A truncated power series in 1 or 2 ``variables``, given by its ``coefficients`` in the order
    of their total degree.
    """

    __slots__ = ("coefficients", "variables")

    def __init__(self, coefficients: Sequence[Any], variables: int = 1) -> None:
        self.coefficients = list(coefficients)
        self.variables = variables

    def _like(self, coefficients: Sequence[Any]) -> PowerSeries:
        return PowerSeries(coefficients, self.variables)

    @property
    def degree(self) -> int:
        """The highest total degree that the series keeps."""
        return _degrees(self.variables, len(self.coefficients))[-1]

    def value_at(self, variable: Any) -> Any:
        """Return the value of a series in one variable at a number.

        Args:
            variable: The number.
        """
        total = 0 * self.coefficients[0]
        for coefficient in reversed(self.coefficients):
            total = total * variable + coefficient
        return total

    def __add__(self, other: Any) -> PowerSeries:
        if not isinstance(other, PowerSeries):
            return self._like([self.coefficients[0] + other, *self.coefficients[1:]])
        return self._like(
            [a + b for a, b in zip(self.coefficients, other.coefficients, strict=False)]
        )

    __radd__ = __add__

    def __neg__(self) -> PowerSeries:
        return self._like([-a for a in self.coefficients])

    def __sub__(self, other: Any) -> PowerSeries:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> PowerSeries:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> PowerSeries:
        if not isinstance(other, PowerSeries):
            return self._like([a * other for a in self.coefficients])
        table, right = (
            _products(self.variables, min(len(self.coefficients), len(other.coefficients))),
            _nonzero(other.coefficients),
        )
        product = [0 * self.coefficients[0]] * len(table)
        for a, targets in zip(self.coefficients, table, strict=False):
            if a:
                for k, b in right:
                    if k >= len(targets):
                        break
                    product[targets[k]] += a * b
        return self._like(product)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> PowerSeries:
        """Return the quotient by a number or by a series whose constant term is not zero."""
        if not isinstance(other, PowerSeries):
            return self._like([a / other for a in self.coefficients])
        table, right = (
            _products(self.variables, min(len(self.coefficients), len(other.coefficients))),
            _nonzero(other.coefficients),
        )
        rest, quotient = self.coefficients[: len(table)], []
        for index, targets in enumerate(table):
            quotient.append(rest[index] / other.coefficients[0])
            for k, b in right[1:]:
                if k >= len(targets):
                    break
                rest[targets[k]] -= b * quotient[index]
        return self._like(quotient)

    def __rtruediv__(self, value: Any) -> PowerSeries:
        return (
            self._like([value] + [0 * self.coefficients[0]] * (len(self.coefficients) - 1)) / self
        )

    def partial_derivative(self, axis: int) -> PowerSeries:
        """Return the partial derivative of a series in two variables with respect to the first (0)
        or second (1).

        The result has one degree less.

        Args:
            axis: 0 or 1.
        """
        degree, slopes = _degrees(2, len(self.coefficients))[-1], []
        for total in range(1, degree + 1):
            # The coefficients of x^total, x^(total - 1) y, ..., y^total
            block = self.coefficients[total * (total + 1) // 2 :][: total + 1]
            powers = range(total + 1) if axis else range(total, -1, -1)
            slopes += [power * a for power, a in zip(powers, block, strict=True) if power]
        return self._like(slopes)


def sine_and_cosine(angle: PowerSeries, sine: Any, cosine: Any) -> tuple[PowerSeries, PowerSeries]:
    """Return the sine and cosine of an angle as power series, from s' = c a' and c' = -s a' along
    each ray.

    Along a ray a derivative multiplies a coefficient by its degree.

    Args:
        angle: The angle as a series. Its constant term is not used.
        sine, cosine: The sine and cosine of the constant term.
    """
    degrees = _degrees(angle.variables, len(angle.coefficients))
    slopes = _nonzero([degree * a for degree, a in zip(degrees, angle.coefficients, strict=True)])
    sines, cosines = ([start] + [0 * start] * (len(degrees) - 1) for start in (sine, cosine))
    for index, targets in enumerate(_products(angle.variables, len(degrees))):
        if index:
            sines[index] /= degrees[index]
            cosines[index] /= degrees[index]
        for k, slope in slopes:
            if k >= len(targets):
                break
            sines[targets[k]] += slope * cosines[index]
            cosines[targets[k]] -= slope * sines[index]
    return PowerSeries(sines, angle.variables), PowerSeries(cosines, angle.variables)


def _nonzero(coefficients: Sequence[Any]) -> list[tuple[int, Any]]:
    """Return the coefficients that are not zero, each as a pair of its index and its value.

    Half of the coefficients of even and odd series are zero.
    """
    return [(k, value) for k, value in enumerate(coefficients) if value]


@lru_cache(maxsize=64)
def _degrees(variables: int, count: int) -> tuple[int, ...]:
    """Return the total degrees of the first ``count`` monomials in 1 or 2 ``variables``."""
    if variables == 1:
        return tuple(range(count))
    return tuple(degree for degree in range(count) for _ in range(degree + 1))[:count]


@lru_cache(maxsize=64)
def _products(variables: int, count: int) -> tuple[Sequence[int], ...]:
    """Return a multiplication table of monomials: for each one, the indices of its products with
    all monomials, in order.

    Products beyond the kept degree are left out.
    """
    if variables == 1:
        return tuple(range(i, count) for i in range(count))
    degree = _degrees(2, count)[-1]
    # x^(m - k) y^k is at the place m (m + 1) / 2 + k
    places = [(m, k) for m in range(degree + 1) for k in range(m + 1)]
    return tuple(
        [(m + n) * (m + n + 1) // 2 + k + j for n, j in places if m + n <= degree]
        for m, k in places
    )
