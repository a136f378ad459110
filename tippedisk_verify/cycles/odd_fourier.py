"""Trigonometric polynomials of odd harmonics on half a period: what harmonic balance computes with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy

__all__ = ["OddSeries", "Samples", "double_operators", "motion", "operators"]


def operators(count: int, ctx: Any = None) -> tuple[Any, Any]:
    """Differentiation and integration of odd harmonics on 2 * count points of half a period, in double or mpmath.

    On n points D_jl = (-1)^(j-l) / sin(theta_j - theta_l), from the Fourier differentiation matrix of the whole period
    folded by f(theta + pi) = -f(theta); its inverse is (2/n) sum over odd k < n of sin(k (theta_j - theta_l)) / k.
    """
    n = 2 * count
    pi, sin = (ctx.pi, ctx.sin) if ctx is not None else (math.pi, math.sin)
    zero = ctx.mpf(0) if ctx is not None else 0.0
    sines = [sin(pi * j / n) for j in range(n)]
    table = [*sines, *(-value for value in sines)]  # sin(pi j / n) for j modulo 2 n
    slope = [zero, *((-1) ** j / sines[j] for j in range(1, n))]
    integral = [sum((table[k * j % (2 * n)] / k for k in range(1, n, 2)), zero) * 2 / n for j in range(n)]
    dtype = float if ctx is None else object
    row, column = numpy.arange(n)[:, None], numpy.arange(n)[None, :]
    away = abs(row - column)
    sign = numpy.sign(row - column)
    return numpy.array(slope, dtype=dtype)[away] * sign, numpy.array(integral, dtype=dtype)[away] * sign


@lru_cache(maxsize=64)
def double_operators(count: int) -> tuple[Any, Any]:
    """`operators` in double, built once per size."""
    return operators(count)


@dataclass(frozen=True)
class Samples:
    """beta_bar at the points of half a period, and the cycle's angular frequency."""

    beta: Any
    frequency: Any

    @property
    def harmonics(self) -> int:
        return len(self.beta) // 2

    def coefficients(self) -> tuple[Any, Any]:
        """Cosine and sine amplitudes of the odd harmonics."""
        return _amplitudes(self.beta)

    def resampled(self, count: int) -> Samples:
        """The same trigonometric polynomial on the points for another number of harmonics."""
        cosines, sines = self.coefficients()
        kept = min(count, len(cosines))
        angles = numpy.outer(numpy.pi * numpy.arange(2 * count) / (2 * count), 2 * numpy.arange(kept) + 1)
        beta = numpy.cos(angles) @ cosines[:kept] + numpy.sin(angles) @ sines[:kept]
        return Samples(beta, self.frequency)


def _amplitudes(values: Any) -> tuple[Any, Any]:
    n = len(values)
    angles = numpy.outer(2 * numpy.arange(n // 2) + 1, numpy.pi * numpy.arange(n) / n)
    return numpy.cos(angles) @ values * 2 / n, numpy.sin(angles) @ values * 2 / n


class OddSeries:
    """The trigonometric polynomial through values at the points of half a period, in mpmath."""

    def __init__(self, values: Any, ctx: Any) -> None:
        n = len(values)
        # Amplitudes in the working precision: the tail matters, and double would bury it.
        table = [ctx.sin(ctx.pi * j / n) for j in range(2 * n)]
        self._odd, self._ctx = range(1, n, 2), ctx
        self.sines, self.cosines = (
            [sum(table[(k * j + turn) % (2 * n)] * value for j, value in enumerate(values)) * 2 / n for k in self._odd]
            for turn in (0, n // 2)
        )

    def __call__(self, angle: Any, order: int = 0) -> Any:
        """The value at an angle, or its first or second derivative."""
        ctx, total = self._ctx, self._ctx.mpf(0)
        for k, a, b in zip(self._odd, self.cosines, self.sines, strict=True):
            c, s = ctx.cos(k * angle), ctx.sin(k * angle)
            total += (a * c + b * s, k * (b * c - a * s), -k * k * (a * c + b * s))[order]
        return total


def motion(beta: Any, frequency: Any, omega: Any, matrices: tuple[Any, Any], sin: Any) -> tuple[Any, Any]:
    """gamma_bar and v along the cycle."""
    slope, integral = matrices
    return omega / frequency * (integral @ sin(beta)), frequency * (slope @ beta)
