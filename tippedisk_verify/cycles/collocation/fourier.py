"""Fourier collocation in time: a limit cycle's equation of motion at samples of its period, and how
many it needs.

**The samples.** One discretisation serves both kinds of cycles. The point symmetry makes a
librating cycle odd under a shift by half a period: half of it is sampled, and the harmonics are
odd. A rotating cycle is sampled over the whole period and has all harmonics.

**The unknowns.** A *point* is an array of n + 2: beta_bar at the n samples [rad], the angular
frequency [rad/s] and Omega [rad/s]. gamma follows from gamma' = Omega sin(beta_bar) by spectral
integration, v by differentiation.

**The equations.** They are the equation of motion at the samples and one that closes the system,

    Omega w sin(beta_bar) = rotations * frequency,

with the weights w of a mean. A rotating cycle's gamma grows by 2 pi a period. A librating cycle's
gamma does not turn, and beta_bar = 0 at the first sample closes its system.

**The choice.** Harmonic balance has the same solutions, because these samples determine the
harmonics. Collocation is kept since its derivative has a closed form for every kind of cycle.

No integrator is used. Its agreement with shooting is evidence.
"""

from __future__ import annotations

import math
from enum import Enum
from fractions import Fraction
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy

from tippedisk_verify.model.equations import jacobian, shifted_ops, vector_field
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.exact import rational_in_context
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    FUNCTION_NAMES,
    bits_for_digits,
    precision_of_bits,
)

__all__ = [
    "MAX_SAMPLES",
    "Collocation",
    "CycleKind",
    "harmonic_amplitudes",
    "resample",
    "samples_for",
]

MAX_SAMPLES = 2048  #: the largest number of samples of a collocation

# Bits below an arithmetic's last one, in which sums of a thousand products are taken
_EXTRA_BITS = 20
_COMPLEX_STEP = 1e-40  # rad/s; a complex step this small differentiates without cancellation
_MIN_SAMPLES = 24  # samples; a cycle next to the Hopf point has hardly any harmonics


def _on_arrays(ctx: Any) -> SimpleNamespace:
    """Return the functions of an mpmath context in a form that takes arrays of the context's
    numbers.
    """
    return SimpleNamespace(
        **{name: numpy.frompyfunc(getattr(ctx, name), 1, 1) for name in FUNCTION_NAMES}
    )


class CycleKind(Enum):
    """The kinds of limit cycle for collocation; the value is the number of half periods that are
    sampled.
    """

    LIBRATING = 1
    ROTATING = 2

    @property
    def rotations(self) -> int:
        """The growth of gamma in a period of such a cycle, in units of 2 pi."""
        return self.value - 1

    def samples(self, count: float) -> int:
        """Return the smallest number of collocation samples that is at least ``count`` and allowed
        for this kind of cycle.

        It is even for half a period, odd for a whole one.
        """
        return 2 * math.ceil(count / 2) + self.rotations


class Collocation:
    """The collocation equations of a limit cycle at n samples, in double or in mpmath numbers.

    Their unknown is a point (n + 2,): beta_bar at the samples, the frequency and Omega.

    Args:
        parameters: The disk, under an analytic friction law.
        kind: The kind of cycle.
        count: The number of samples.
        digits: The digits of the mpmath numbers; None for double.
    """

    def __init__(
        self, parameters: Parameters, kind: CycleKind, count: int, digits: int | None = None
    ) -> None:
        self.ctx: Any = (
            None if digits is None else precision_of_bits(bits_for_digits(digits)).context
        )
        ctx = self.ctx
        self.parameters, self.kind, self.count = parameters, kind, count
        self.pi: Any = math.pi if ctx is None else ctx.pi
        self.constants: Constants = (
            parameters.constants_in(DOUBLE) if ctx is None else parameters.constants_in_context(ctx)
        )
        functions: Any = numpy if ctx is None else _on_arrays(ctx)
        self.sin, self.cos = functions.sin, functions.cos
        self._ops = shifted_ops(functions)
        self.differentiation_matrix, integral = _operators(
            kind, count, None if ctx is None else ctx.prec
        )
        # gamma_bar is 0 at a rotating cycle's first sample, and has mean 0 on a librating cycle.
        self.integration_matrix = integral - kind.rotations * integral[0]
        # gamma's steady growth
        self._growth = kind.rotations * 2 * self.pi * numpy.arange(count) / count
        self._weights = numpy.ones(count) if kind.rotations else numpy.eye(1, count)[0]

    @property
    def double(self) -> Collocation:
        """The same collocation equations in double."""
        return Collocation(self.parameters, self.kind, self.count)

    def number(self, value: Any) -> Any:
        """Convert a rational number, or an array of numbers of another arithmetic, to this
        arithmetic.
        """
        if isinstance(value, Fraction):
            return float(value) if self.ctx is None else rational_in_context(self.ctx, value)
        return (
            value.astype(float)
            if self.ctx is None
            else numpy.array([self.ctx.mpf(x) for x in value])
        )

    def derivative_at_samples(self, samples: Any) -> Any:
        """Return the derivative of a periodic function with respect to the angle, at the samples,
        from its values there.
        """
        return self._matrix_product(self.differentiation_matrix, samples)

    def _matrix_product(self, rows: Any, samples: Any) -> Any:
        """Return the product of a matrix and a vector of samples, whose entries are of order one.

        Above double the product is in whole numbers, which are far faster than mpmath's.
        """
        if self.ctx is None:
            return rows @ samples
        places = self.ctx.prec + _EXTRA_BITS
        whole = numpy.array(
            [int(self.ctx.ldexp(sample, places)) for sample in samples], dtype=object
        )
        sums = rows @ whole
        return numpy.array(
            [self.ctx.ldexp(self.ctx.mpf(total), -2 * places) for total in sums], dtype=object
        )

    def _mean(self, samples: Any) -> Any:
        return (self._weights * samples).sum() / self._weights.sum()

    def motion(self, point: Any) -> tuple[Any, Any]:
        """Return gamma_bar [rad] and v [rad/s] at the samples, from beta_bar there, the frequency
        and Omega (the ``point``).
        """
        beta, frequency, omega = point[:-2], point[-2], point[-1]
        swing = omega / frequency * self._matrix_product(self.integration_matrix, self.sin(beta))
        return self._growth + swing, frequency * self.derivative_at_samples(beta)

    def residual(self, point: Any) -> Any:
        """Return the residuals (n + 1,) of the collocation equations at a point; they are zero for
        a limit cycle.

        They are v' less the acceleration at the samples [rad/s^2], and the closing equation.
        """
        beta, frequency, omega = point[:-2], point[-2], point[-1]
        gamma, v = self.motion(point)
        rate = vector_field(self._ops, self.constants, omega, self.parameters.law)(beta, gamma, v)[
            2
        ]
        closing = omega * self._mean(self.sin(beta)) - self.kind.rotations * frequency
        return numpy.append(frequency * self.derivative_at_samples(v) - rate, closing)

    def acceleration_gradient(self, point: Any) -> tuple[Any, Any, Any]:
        """Return the acceleration's derivatives with respect to beta, gamma and v, each at the
        samples (n,).
        """
        derivatives = jacobian(self._ops, self.constants, point[-1], self.parameters.law)
        by_beta, by_gamma, by_v = derivatives(point[:-2], *self.motion(point))[2]
        return by_beta, by_gamma, by_v

    def motion_derivative(self, point: Any, change: Any) -> tuple[Any, Any]:
        """Return the derivatives of gamma and v (n,) at the samples when a point moves in a
        direction, at fixed Omega.

        Args:
            point: The point (n + 2,).
            change: The direction (n + 1,), in beta_bar and the frequency.
        """
        beta, frequency, omega = point[:-2], point[-2], point[-1]
        tilt = self.cos(beta) * change[:-1] - self.sin(beta) * (change[-1] / frequency)
        rate = frequency * self.derivative_at_samples(change[:-1]) + change[
            -1
        ] * self.derivative_at_samples(beta)
        return omega / frequency * self._matrix_product(self.integration_matrix, tilt), rate

    def directional_derivative(self, point: Any, change: Any) -> Any:
        """Return the derivative (n + 1,) of the collocation equations' residual when a point moves
        in a direction, at fixed Omega.

        Args:
            point: The point (n + 2,).
            change: The direction (n + 1,), in beta_bar and the frequency.
        """
        beta, frequency, omega = point[:-2], point[-2], point[-1]
        by_beta, by_gamma, by_v = self.acceleration_gradient(point)
        turned, rate = self.motion_derivative(point, change)
        acceleration = self.derivative_at_samples(
            frequency * rate + change[-1] * frequency * self.derivative_at_samples(beta)
        )
        closing = (
            omega * self._mean(self.cos(beta) * change[:-1]) - self.kind.rotations * change[-1]
        )
        return numpy.append(
            acceleration - by_beta * change[:-1] - by_gamma * turned - by_v * rate, closing
        )

    def jacobian(self, point: Any) -> Any:
        """Return the derivative of the collocation equations' residual with respect to the point,
        in double: (n + 1, n + 2).
        """
        beta, w, omega, n = point[:-2], point[-2], point[-1], self.count
        gamma, v = self.motion(point)
        by_beta, by_gamma, by_v = self.acceleration_gradient(point)
        swing = gamma - self._growth
        curve = self.differentiation_matrix @ beta
        stepped = vector_field(
            self._ops, self.constants, complex(omega, _COMPLEX_STEP), self.parameters.law
        )
        rows = numpy.zeros((n + 1, n + 2))
        rows[:n, :n] = (
            w * w * (self.differentiation_matrix @ self.differentiation_matrix)
            - by_v[:, None] * w * self.differentiation_matrix
        )
        rows[:n, :n] -= (by_gamma * omega / w)[:, None] * self.integration_matrix * numpy.cos(beta)
        rows[numpy.arange(n), numpy.arange(n)] -= by_beta
        rows[:n, n] = (
            2 * w * (self.differentiation_matrix @ curve) + by_gamma * swing / w - by_v * curve
        )
        rows[:n, n + 1] = (
            -stepped(beta, gamma, v)[2].imag / _COMPLEX_STEP - by_gamma * swing / omega
        )
        rows[n, :n] = omega * numpy.cos(beta) * self._weights / self._weights.sum()
        rows[n, n:] = -self.kind.rotations, self._mean(numpy.sin(beta))
        return rows


@lru_cache(maxsize=64)
def _operators(kind: CycleKind, count: int, precision: int | None) -> tuple[Any, Any]:
    """Return two matrices that act on samples of a periodic function: of differentiation with
    respect to the angle, and of integration of functions without mean.

    The samples lie at j h, h = pi s / n, where s is the kind's number of half periods. Then

        D_jl = (-1)^(j-l) / (s sin(pi (j - l) / n)),

    and the integral is

        (2 s / n) sum over k of sin(pi k (j - l) / n) / k,

    with k below n, odd for half a period and even for a whole one. Above double the matrices are
    whole numbers, in units of 2^-(precision + _EXTRA_BITS).
    """
    ctx = None if precision is None else precision_of_bits(precision).context
    pi, sin, zero = (math.pi, math.sin, 0.0) if ctx is None else (ctx.pi, ctx.sin, ctx.zero)
    halves = kind.value
    sines = [sin(pi * j / count) for j in range(count)]
    table = [*sines, *(-value for value in sines)]  # sin(pi j / n) for j modulo 2 n
    slope = [zero, *((-1) ** j / (halves * sines[j]) for j in range(1, count))]
    harmonics = range(halves, count, 2)
    integral = [
        sum((table[k * j % (2 * count)] / k for k in harmonics), zero) * 2 * halves / count
        for j in range(count)
    ]
    distance = numpy.arange(count)[:, None] - numpy.arange(count)[None, :] + count - 1

    def spread(entries: list[Any]) -> Any:
        if ctx is not None:
            entries = [int(ctx.ldexp(entry, ctx.prec + _EXTRA_BITS)) for entry in entries]
        odd = [-entry for entry in entries[:0:-1]] + entries
        return numpy.array(odd, dtype=float if ctx is None else object)[distance]

    return spread(slope), spread(integral)


def _spectrum(kind: CycleKind, beta: Any) -> Any:
    return numpy.fft.rfft(beta if kind is CycleKind.ROTATING else numpy.concatenate((beta, -beta)))


def resample(kind: CycleKind, point: Any, count: int) -> Any:
    """Interpolate a collocation point to another number of samples, by its trigonometric
    polynomial.

    Args:
        kind: The kind of cycle.
        point: The point (n + 2,) in double.
        count: The new number of samples.
    """
    old = len(point) - 2
    amplitudes = _spectrum(kind, point[:old])
    total = 2 * count // kind.value
    kept = numpy.zeros(total // 2 + 1, dtype=complex)
    common = min(len(kept), len(amplitudes))
    kept[:common] = amplitudes[:common]
    beta = numpy.fft.irfft(kept, total)[:count] * (count / old)
    return numpy.append(beta, point[old:])


def harmonic_amplitudes(kind: CycleKind, beta: Any) -> Any:
    """Return the amplitudes of beta_bar's harmonics [rad], in double: for librating cycles the odd
    ones, for rotating cycles all from the first on.

    Args:
        kind: The kind of cycle.
        beta: beta_bar at the samples [rad].
    """
    half_periods = len(beta) * (2 // kind.value)
    return 2 * numpy.abs(_spectrum(kind, beta))[1 :: 2 // kind.value] / half_periods


def samples_for(kind: CycleKind, point: Any, digits: int) -> int:
    """Return the number of collocation samples that a cycle needs for the wanted digits, from the
    decay of its harmonics.

    The decay is the mean factor between neighbours, over the later ones that stand above rounding.

    Args:
        kind: The kind of cycle.
        point: The point (n + 2,) in double.
        digits: The digits wanted.
    """
    amplitudes = harmonic_amplitudes(kind, point[:-2])
    logarithms = numpy.log10(amplitudes[amplitudes > 1e-13 * amplitudes[0]])
    half = len(logarithms) // 2
    falls = 6.0 if half < 2 else (logarithms[half - 1] - logarithms[-1]) / (len(logarithms) - half)
    # A librating cycle's state at the section converges after its period
    spare = 3 if kind is CycleKind.ROTATING else 9
    harmonics = (digits + spare) / max(falls, 1e-3)
    return min(MAX_SAMPLES, kind.samples(max(_MIN_SAMPLES, 2 * harmonics)))
