"""Functions of one parameter s in [-1, 1], enclosed as polynomials whose coefficients are balls.

A `Jet` c_0, …, c_D stands for every function f on [-1, 1] with the following property. *For each s
separately* there are numbers x_i in the balls c_i with

    f(s) = x_0 + x_1 s + … + x_D s^D.

The numbers may differ from one s to the other, so there is no separate remainder: the remainder of
an operation goes into a ball. A product has terms up to s^(2 D). The sum t(s) of those beyond s^D
is s^D times a number of size at most the sum of their coefficients, because |s| <= 1. This number
is added to c_D on both sides. Sums are exact, and jets of unlike degrees may be added. The methods
for quotient and sine derive their remainders.

The coefficients are Arb's balls. For D = 0 this is plain ball arithmetic. A function that is smooth
in s on the scale of the whole interval has coefficients that fall geometrically. Then the balls'
radii are of the size of the first omitted term; plain balls would have radii of the size of c_1.

Where a ball becomes a point: `mid` takes the coefficients' midpoints. Its caller accounts for the
difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import zip_longest
from math import factorial
from operator import mul
from typing import Any

from flint import arb_poly

from tippedisk_verify.proofs.kernel.balls import arb, ball

__all__ = ["DERIVATIVE_DEGREE", "Jet", "JetSeries", "scaled_sine", "symmetric_hull"]

#: Of derivatives at most: 2 is too low at both ends of the family, and 4 tightens little
DERIVATIVE_DEGREE = 3

_PLUS_MINUS_ONE = arb(0, 1)
_SERIES_TERMS = 10  # at z = 1/4 the rest is below 2^-80


def symmetric_hull(x: Any) -> Any:
    """Return a ball about zero that holds the ball ``x`` and its mirror image."""
    return x * _PLUS_MINUS_ONE


class Jet:
    """A function of s in [-1, 1], enclosed by the coefficients (balls) of 1, s, …, s^D.

    Factors of a product have the same degree, or are balls or integers.
    """

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: Sequence[Any]) -> None:
        self.coefficients = tuple(coefficients)

    @classmethod
    def constant(cls, value: Any, degree: int) -> Jet:
        """Return the jet of a constant function: the same number (or ball) for each s."""
        return cls([value, *[0 * value] * degree])

    @property
    def degree(self) -> int:
        """The degree D of the polynomial in s."""
        return len(self.coefficients) - 1

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet(
                [a + b for a, b in zip_longest(self.coefficients, other.coefficients, fillvalue=0)]
            )
        return Jet([self.coefficients[0] + other, *self.coefficients[1:]])

    __radd__ = __add__

    def __sub__(self, other: Any) -> Jet:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Jet:
        return (-self).__add__(other)

    def __neg__(self) -> Jet:
        return Jet([-x for x in self.coefficients])

    def __mul__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            if len(self.coefficients) != len(other.coefficients):
                raise ValueError(
                    f"jets of degree {self.degree} and {other.degree} do not go together"
                )
            return _truncated_product(
                _arb_polynomial(self) * _arb_polynomial(other), len(self.coefficients) - 1
            )
        return Jet([x * other for x in self.coefficients])

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Jet:
        """Return the quotient by a jet or by a number, with an enclosed remainder.

        b_k = (a_k - c_1 b_(k-1) - … - c_k b_0) / c_0 for k <= D leaves a - b c = -t, where t holds
        the terms of b c beyond s^D. The quotient is b - t / c, and t / c is s^D times a number.
        """
        if not isinstance(other, Jet):
            return Jet([x / other for x in self.coefficients])
        c, top = other.coefficients, len(self.coefficients) - 1
        b: list[Any] = []
        for k, part in enumerate(self.coefficients):
            b.append((part - sum(c[i] * b[k - i] for i in range(1, k + 1))) / c[0])
        if top:
            over = [
                sum(c[i] * b[k - i] for i in range(k - top, top + 1))
                for k in range(top + 1, 2 * top + 1)
            ]
            b[top] = b[top] + symmetric_hull(sum(map(symmetric_hull, over)) / other.range())
        return Jet(b)

    def __rtruediv__(self, other: Any) -> Jet:
        return Jet.constant(other + 0 * self.coefficients[0], self.degree) / self

    def sin(self) -> Jet:
        """Return the sine of the function as a jet; see `_shifted_sine`."""
        return self._shifted_sine(0)

    def cos(self) -> Jet:
        """Return the cosine of the function as a jet; see `_shifted_sine`."""
        return self._shifted_sine(1)

    def _shifted_sine(self, quarters: int) -> Jet:
        """Return sin(f + quarters pi/2), f being this jet, by Taylor's formula about c_0.

        Let u = f - c_0, where c_i is coefficient i.

        The remainder is the derivative of order D + 1 between c_0 and f(s), times u^(D+1) / (D+1)!.
        Let w be the sum of the |c_i|, i >= 1. Since |u| <= |s| w, the remainder is s^D times a
        number of size at most w^(D+1) / (D+1)! times that derivative.
        """
        top, start = self.degree, self.coefficients[0]
        signed = [start.sin(), start.cos()]
        derivatives = [*signed, *(-x for x in signed)] * (top // 4 + 1)
        shift = Jet([0 * start, *self.coefficients[1:]])
        result, power, factorial = Jet.constant(derivatives[quarters], top), shift, 1
        for n in range(1, top + 1):
            factorial *= n
            result = result + power * (derivatives[(n + quarters) % 4] / factorial)
            power = power * shift if n < top else power
        if not top:
            return result
        whole = self.range()
        last = [whole.sin(), whole.cos()][(top + 1 + quarters) % 2]
        size = sum(map(symmetric_hull, self.coefficients[1:]))
        for _ in range(top + 1):
            last = last * size
        return result._with_remainder(symmetric_hull(last / (factorial * (top + 1))))

    def _with_remainder(self, extra: Any) -> Jet:
        """Return the jet with a ball added to its highest coefficient."""
        return Jet([*self.coefficients[:-1], self.coefficients[-1] + extra])

    def truncated(self, degree: int) -> Jet:
        """Return a jet of at most this degree that still encloses the function.

        The sizes of the coefficients beyond the ``degree`` are added to the highest one that is
        left.
        """
        if degree >= self.degree:
            return self
        return Jet(self.coefficients[: degree + 1])._with_remainder(
            sum(map(symmetric_hull, self.coefficients[degree + 1 :]))
        )

    def mid(self) -> Jet:
        """Return the jet whose coefficients are the midpoints of this jet's coefficients."""
        return Jet([x.mid() for x in self.coefficients])

    def range(self) -> Any:
        """Return a ball that holds all values of the function for s in [-1, 1].

        Even powers of s are in [0, 1], odd ones in [-1, 1].
        """
        return self.coefficients[0] + sum(
            x.union(0 * x) if k % 2 else symmetric_hull(x)
            for k, x in enumerate(self.coefficients[1:])
        )

    def converted_like(self, value: Any) -> Jet:
        """Return the constant function ``value`` as a jet of this jet's degree."""
        return Jet.constant(ball(value), self.degree)

    def truncated_for_derivatives(self) -> Jet:
        """Return the jet truncated to `DERIVATIVE_DEGREE`, the degree that suffices for
        derivatives.
        """
        return self.truncated(DERIVATIVE_DEGREE)

    def series(self, old: object = None) -> JetSeries:
        """Return an empty power series in time, whose coefficients will be jets.

        ``old`` is not used.
        """
        return JetSeries([], [])


class JetSeries(Sequence[Jet]):
    """A power series in time, given by its coefficients, which are jets."""

    __slots__ = ("_polynomials", "jets")

    def __init__(self, jets: list[Jet], polynomials: list[Any]) -> None:
        self.jets, self._polynomials = jets, polynomials

    def append(self, jet: Jet) -> None:
        """Append a jet as the next coefficient of the series."""
        self.jets.append(jet)
        self._polynomials.append(_arb_polynomial(jet))

    def __len__(self) -> int:
        return len(self.jets)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return JetSeries(self.jets[index], self._polynomials[index])
        return self.jets[index]

    def convolution(self, other: JetSeries) -> Jet | int:
        """Return a_0 b_(k-1) + … + a_(k-1) b_0 for two series of the same length k (0 for k =
        0).
        """
        if not len(self):
            return 0
        return _truncated_product(
            sum(map(mul, self._polynomials, reversed(other._polynomials))), self.jets[0].degree
        )


def _arb_polynomial(jet: Jet) -> Any:
    return arb_poly(list(jet.coefficients))


def _truncated_product(product: Any, degree: int) -> Jet:
    """Turn ``product``, a polynomial in s of up to twice the ``degree``, into a jet of that degree.

    The sizes of the coefficients beyond the degree are added to its last one, on both sides.
    """
    return Jet([product[k] for k in range(2 * degree + 1)]).truncated(degree)


def scaled_sine(x: Any, q: Any) -> tuple[Any, Any, Any]:
    """Return sin(a x) / a, cos(a x) and the derivative of the first by q = a^2, as jets or balls.

    q >= 0 may be zero. With z = q x^2 and sinc(y) = sin(y) / y these are x sinc(sqrt z), cos(sqrt
    z) and x^3 phi'(z), where phi(z) = sinc(sqrt z). All three are entire functions of z. They are
    computed as Taylor polynomials of n terms with a ball for the remainder. For z >= 0 Taylor's
    formula for sine and cosine, whose derivatives are at most 1, gives

        |rest of sinc(sqrt z)| <= z^n / (2 n + 1)!,   |rest of cos(sqrt z)| <= z^n / (2 n)!.

    As sinc(y) is the integral of cos(y t) over t in [0, 1], phi'(z) = -1/2 times that of t^2
    sinc(sqrt(z) t). So

        phi'(z) = -1/2 sum of (-z)^k / ((2 k + 3) (2 k + 1)!),
        |rest| <= z^n / (2 (2 n + 3) (2 n + 1)!).

    A ball or jet of q stands for numbers that are not negative, even if some of the ball's are.
    """
    square = x * x
    z = q * square
    sinc = _alternating_series(z, lambda k: Fraction(1, factorial(2 * k + 1)))
    cosine = _alternating_series(z, lambda k: Fraction(1, factorial(2 * k)))
    slope = _alternating_series(z, lambda k: Fraction(1, (2 * k + 3) * factorial(2 * k + 1)))
    return x * sinc, cosine, x * (square * slope) / -2


def _alternating_series(z: Any, size: Callable[[int], Fraction]) -> Any:
    """Return a ball or jet that holds an alternating power series in z: the sum of (-z)^k size(k).

    The terms with k < n are summed. The remainder is bounded by size(n) z^n on both sides.
    """
    if not isinstance(z, Jet):
        return _alternating_series(Jet([z]), size).coefficients[0]
    one = 1 + 0 * z.coefficients[0]
    whole, power = z.range(), one
    for _ in range(_SERIES_TERMS):
        power = power * whole
    total = Jet.constant(
        _times_fraction(one, (-1) ** (_SERIES_TERMS - 1) * size(_SERIES_TERMS - 1)), z.degree
    )
    for k in range(_SERIES_TERMS - 2, -1, -1):
        total = total * z + _times_fraction(one, (-1) ** k * size(k))
    return total + symmetric_hull(_times_fraction(power, size(_SERIES_TERMS)))


def _times_fraction(x: Any, factor: Fraction) -> Any:
    return x * factor.numerator / factor.denominator
