"""sin(a x) / a, cos(a x) and the first one's derivative by a^2, for q = a^2 >= 0 that may be zero: jets or balls.

With z = q x^2 and sinc(y) = sin(y) / y these are x sinc(sqrt z), cos(sqrt z) and x^3 phi'(z), where phi(z) =
sinc(sqrt z): dz/dq = x^2. All three are entire functions of z, and here they are their Taylor polynomials of n terms
with a ball for the rest. For z >= 0 Taylor's formula for sine and cosine, whose derivatives are at most 1, gives

    |rest of sinc(sqrt z)| <= z^n / (2 n + 1)!,   |rest of cos(sqrt z)| <= z^n / (2 n)!.

As sinc(y) is the integral of cos(y t) over t in [0, 1], phi'(z) = -1/2 times that of t^2 sinc(sqrt(z) t). So

    phi'(z) = -1/2 sum of (-z)^k / ((2 k + 3) (2 k + 1)!),   |rest| <= z^n / (2 (2 n + 3) (2 n + 1)!).

A ball or jet of q stands for numbers that are not negative, even if some of the ball's are: the answer holds for those.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import factorial
from typing import Any

from tippedisk_verify.proofs.kernel.jets import Jet, symmetric

__all__ = ["scaled_sine"]

_TERMS = 10  # at z = 1/4 the rest is below 2^-80


def scaled_sine(x: Any, q: Any) -> tuple[Any, Any, Any]:
    """sin(a x) / a, cos(a x) and d(sin(a x) / a)/dq, for q = a^2 >= 0."""
    square = x * x
    z = q * square
    sinc = _summed(z, lambda k: Fraction(1, factorial(2 * k + 1)))
    cosine = _summed(z, lambda k: Fraction(1, factorial(2 * k)))
    slope = _summed(z, lambda k: Fraction(1, (2 * k + 3) * factorial(2 * k + 1)))
    return x * sinc, cosine, x * (square * slope) / -2


def _summed(z: Any, size: Callable[[int], Fraction]) -> Any:
    """The sum of (-z)^k size(k) for k < n, and size(n) z^n on both sides of it."""
    if not isinstance(z, Jet):
        return _summed(Jet([z]), size).c[0]
    one = 1 + 0 * z.c[0]
    whole, power = z.range(), one
    for _ in range(_TERMS):
        power = power * whole
    total = Jet.constant(_multiple(one, (-1) ** (_TERMS - 1) * size(_TERMS - 1)), z.degree)
    for k in range(_TERMS - 2, -1, -1):
        total = total * z + _multiple(one, (-1) ** k * size(k))
    return total + symmetric(_multiple(power, size(_TERMS)))


def _multiple(x: Any, factor: Fraction) -> Any:
    return x * factor.numerator / factor.denominator
