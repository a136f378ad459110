"""The slow manifold's recursion in an arithmetic of power series that has one thing wrong.

A program that does not differentiate by hand carries series in the displacements of beta and gamma. Sums of them are
hardly got wrong, but the series of sine and cosine, products, quotients and derivatives are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from tippedisk_verify.conformance.diagnosis.slips import Names
from tippedisk_verify.theory.jets import Jet

__all__ = ["arithmetics"]

_ANY = 99  # degree or power up to which everything is there


@dataclass(frozen=True)
class _Arithmetic:
    """How series are computed with; the defaults are right. Factors are those of a coefficient of degree k + 1."""

    divisor: Callable[[int], float] = math.factorial  #: of the k-th derivative of a sine in its series
    turn: int = 1  #: quarters of a turn from a sine to its derivative
    quarter: float = math.pi / 2
    sines: int = _ANY  #: degree of the last term of a sine
    degree: int = _ANY  #: of the last terms that are kept of products
    powers: int = _ANY  #: last power of x in 1 / (1 - x) = 1 + x + x^2 + ...
    slopes: tuple[Callable[[int], float], Callable[[int], float]] = (lambda k: k + 1, lambda k: k + 1)


_SLOPES: tuple[tuple[str, Callable[[int], float]], ...] = (
    ("lack the factor k of the power x^k", lambda k: 1),
    ("have the factor k - 1 for k of the power x^k", lambda k: k),
    ("have the factor k - 1 for k of the power x^k, but for k = 1", lambda k: max(k, 1)),
    ("have the factor k + 1 for k of the power x^k", lambda k: k + 2),
    ("have the factor k! for k of the power x^k", lambda k: math.factorial(k + 1)),
    ("have the factor 1/k for k of the power x^k", lambda k: 1 / (k + 1)),
)  # fmt: skip
_DIVISORS: tuple[tuple[str, Callable[[int], float]], ...] = (
    ("lack the factor 1/k! of the power x^k", lambda k: 1),
    ("have (k + 1)! for k!", lambda k: math.factorial(k + 1)),
    ("have (k - 1)! for k!", lambda k: math.factorial(max(k - 1, 0))),
    ("have k for k!", lambda k: max(k, 1)),
    ("have k^2 for k!", lambda k: max(k, 1) ** 2),
    ("have 2^k for k!", lambda k: 2**k),
)  # fmt: skip


class _Series:
    """A polynomial in two displacements."""

    def __init__(self, c: Any, how: _Arithmetic) -> None:
        self.c, self.how = c, how

    @property
    def value(self) -> float:
        return float(self.c[0, 0])

    def cut(self, degree: int) -> Jet:
        """The right kind of series, of low degree, for what is made of the orders."""
        return Jet([[float(self.c[i, j]) for j in range(degree + 1 - i)] for i in range(degree + 1)])

    def _with(self, other: Any) -> Any:
        if isinstance(other, _Series):
            return other.c
        c = 0 * self.c
        c[0, 0] = other
        return c

    def __add__(self, other: Any) -> _Series:
        return _Series(self.c + self._with(other), self.how)

    __radd__ = __add__

    def __neg__(self) -> _Series:
        return _Series(-self.c, self.how)

    def __sub__(self, other: Any) -> _Series:
        return _Series(self.c - self._with(other), self.how)

    def __rsub__(self, other: Any) -> _Series:
        return _Series(self._with(other) - self.c, self.how)

    def __mul__(self, other: Any) -> _Series:
        if not isinstance(other, _Series):
            return _Series(self.c * other, self.how)
        n, c = len(self.c), 0 * self.c
        last = min(n - 1, self.how.degree)
        for i in range(last + 1):
            for j in range(last + 1 - i):
                if self.c[i, j]:
                    c[i:, j:] += self.c[i, j] * other.c[: n - i, : n - j]
        for i in range(n):
            c[i, max(last + 1 - i, 0) :] = 0
        return _Series(c, self.how)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> _Series:
        return math.prod([self] * (exponent - 1), start=self)

    def __truediv__(self, other: Any) -> _Series:
        if not isinstance(other, _Series):
            return _Series(self.c / other, self.how)
        rest = 1 - other * (1 / other.value)
        power, total = rest, 1 + rest
        for _ in range(min(len(self.c) - 1, self.how.powers) - 1):
            power = power * rest
            total = total + power
        return self * total * (1 / other.value)

    def by(self, axis: int) -> _Series:
        import numpy

        along = self.c if axis == 0 else self.c.T
        c = numpy.zeros_like(along)
        for k in range(len(c) - 1):
            c[k] = self.how.slopes[axis](k) * along[k + 1]
        return _Series(c if axis == 0 else c.T, self.how)


def _sine(how: _Arithmetic, degree: int, place: tuple[float, int], quarters: int = 0) -> _Series:
    import numpy

    angle, axis = place
    c = numpy.zeros((degree + 1, degree + 1))
    for k in range(min(degree, how.sines) + 1):
        c[(k, 0) if axis == 0 else (0, k)] = math.sin(angle + (quarters + k * how.turn) * how.quarter) / how.divisor(k)
    return _Series(c, how)


def arithmetics() -> Iterator[tuple[str, Callable[[Mapping[str, Any]], Names]]]:
    """(What is wrong, the names that a text of formulas has to be run with instead, from those that are right)."""
    yield (
        "the derivatives by beta and gamma are exchanged",
        lambda names: {**names, "by_beta": names["by_gamma"], "by_gamma": names["by_beta"]},
    )
    right = _Arithmetic()
    for text, divisor in _DIVISORS:
        yield f"the series of sine and cosine {text}", partial(_names, replace(right, divisor=divisor))
    text = "the series of sine and cosine have the derivatives' signs wrong, as if sin' = -cos and cos' = sin"
    yield text, partial(_names, replace(right, turn=-1))
    for pi in ("3.14", "3.142", "3.1416", "3.14159", "3.141593", "3.1415927", "3.14159265"):
        yield f"pi = {pi} in the series of sine and cosine", partial(_names, replace(right, quarter=float(pi) / 2))
    for text, quarters in (("sine and cosine are exchanged", (1, 0)), ("the sign of cosines", (0, 3))):
        yield text, partial(_names, right, quarters=quarters)
    for n in range(6):
        yield f"the series of sine and cosine end at degree {n}", partial(_names, replace(right, sines=n))
        if n:
            text = f"the series end at degree {n}: higher derivatives count as zero"
            yield text, partial(_names, replace(right, degree=n))
            text = f"quotients of series end with the power {n} of 1/(1 - x) = 1 + x + x^2 + ..."
            yield text, partial(_names, replace(right, powers=n))
    for where, axes in (("beta", (0,)), ("gamma", (1,)), ("beta and gamma", (0, 1))):
        ends = tuple(
            (f"of powers beyond x^{n} are missing", lambda k, n=n: (k + 1) * (k < n)) for n in range(1, 5)
        )  # fmt: skip
        for text, slope in (*_SLOPES, *ends):
            slopes = (slope if 0 in axes else right.slopes[0], slope if 1 in axes else right.slopes[1])
            yield f"derivatives of series by {where} {text}", partial(_names, replace(right, slopes=slopes))


def _names(how: _Arithmetic, names: Mapping[str, Any], quarters: tuple[int, int] = (0, 1)) -> Names:
    degree = names["degree"]
    return {
        **names, "coordinate": lambda angle, axis: (angle, axis),
        "sin": partial(_sine, how, degree, quarters=quarters[0]),
        "cos": partial(_sine, how, degree, quarters=quarters[1]), "by_beta": lambda series: series.by(0),
        "by_gamma": lambda series: series.by(1),
    }  # fmt: skip
