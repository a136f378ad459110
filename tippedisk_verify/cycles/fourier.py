"""Fourier collocation in time: a limit cycle's equation of motion at samples of its period, and how many it needs.

One discretisation serves both kinds of cycles, which differ in what of the period is sampled. The point symmetry makes
a librating cycle odd under a shift by half a period: half of it is sampled, and the harmonics are odd. A rotating cycle
is sampled over the whole period and has all harmonics. beta_bar at the n samples and the angular frequency are the
unknowns; gamma follows from gamma' = Omega sin(beta_bar) by spectral integration, v by differentiation. The equations
are that of motion at the samples and one that closes the system: beta_bar = 0 at a librating cycle's first sample, and
at a rotating one a mean growth of gamma of 2 pi a period. Harmonic balance has the same solutions, for these samples
determine the harmonics; collocation is kept since its derivative is known in closed form at any kind of cycle.

Nothing here integrates: that shooting agrees is evidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from fractions import Fraction
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy

from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.exact import fraction, quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits

__all__ = [
    "MOST_SAMPLES",
    "Collocation",
    "Kind",
    "at_two_resolutions",
    "chord",
    "decay",
    "resampled",
    "samples_for",
    "sizes",
]

MOST_SAMPLES = 2048

_SPARE = 20  # bits below an arithmetic's last one, in which sums of a thousand products are taken
_COMPLEX_STEP = 1e-40
_MOST_PASSES = 60
_SETTLED = 1e-9  # a step that rounding in double follows
_FEWEST_SAMPLES = 24  # of a librating cycle
_GUARD = 15  # digits
_FINER = 6  # digits that the finer collocation has more: more samples alone would add to rounding


class Kind(Enum):
    """The kind of cycle; the value is the number of half periods that are sampled."""

    LIBRATING = 1
    ROTATING = 2

    def samples(self, count: float) -> int:
        """The least admissible number of samples from ``count`` on: even for half a period, odd for a whole one."""
        return 2 * math.ceil(count / 2) + (self is Kind.ROTATING)


class Collocation:
    """The equations at n samples, in double or in mpmath numbers of so many digits.

    ``unknowns`` are an array of n + 1: beta_bar at the samples [rad] and the angular frequency [rad/s].
    """

    def __init__(self, parameters: Parameters, kind: Kind, count: int, digits: int | None = None) -> None:
        self.ctx: Any = None if digits is None else bits(bits_for_digits(digits)).context
        ctx = self.ctx
        self.parameters, self.kind, self.count = parameters, kind, count
        self.pi: Any = math.pi if ctx is None else ctx.pi
        self.constants: Constants = parameters.at(DOUBLE) if ctx is None else parameters.within(ctx)
        self.sin: Any = numpy.sin if ctx is None else numpy.frompyfunc(ctx.sin, 1, 1)
        self.cos: Any = numpy.cos if ctx is None else numpy.frompyfunc(ctx.cos, 1, 1)
        self._ops = shifted(SimpleNamespace(sin=self.sin, cos=self.cos))
        self.slope, self._integral = _operators(kind, count, None if ctx is None else ctx.prec)
        self._rotating = kind is Kind.ROTATING
        #: gamma's steady growth
        self._growth = 2 * self.pi * numpy.arange(count) / count if self._rotating else 0
        # gamma_bar is 0 at a rotating cycle's first sample, and has mean 0 on a librating cycle.
        self.integral = self._integral - self._integral[0] if self._rotating else self._integral

    def number(self, value: Any) -> Any:
        """A rational, or the numbers of another arithmetic, in this one."""
        if isinstance(value, Fraction):
            return float(value) if self.ctx is None else quotient(self.ctx, value)
        if isinstance(value, numpy.ndarray):
            return value.astype(float) if self.ctx is None else numpy.array([self.ctx.mpf(x) for x in value])
        return float(value) if self.ctx is None else self.ctx.mpf(value)

    def differentiated(self, samples: Any) -> Any:
        """The derivative of a function by the angle, at the samples."""
        return self._applied(self.slope, samples)

    def _applied(self, rows: Any, samples: Any) -> Any:
        """A matrix times samples of order one; above double in whole numbers, which are far faster than mpmath's."""
        if self.ctx is None:
            return rows @ samples
        places = self.ctx.prec + _SPARE
        whole = numpy.array([int(self.ctx.ldexp(sample, places)) for sample in samples], dtype=object)
        sums = rows @ whole
        return numpy.array([self.ctx.ldexp(self.ctx.mpf(total), -2 * places) for total in sums], dtype=object)

    def motion(self, unknowns: Any, omega: Any) -> tuple[Any, Any]:
        """gamma_bar [rad] and v [rad/s] at the samples."""
        beta, frequency = unknowns[:-1], unknowns[-1]
        swing = omega / frequency * self._applied(self.integral, self.sin(beta))
        return self._growth + swing, frequency * self.differentiated(beta)

    def residual(self, unknowns: Any, omega: Any) -> Any:
        """v' less the acceleration at the samples [rad/s^2], and the closing equation: (n + 1,)."""
        beta, frequency = unknowns[:-1], unknowns[-1]
        gamma, v = self.motion(unknowns, omega)
        rate = field(self._ops, self.constants, omega, "linear")(beta, gamma, v)[2]
        closing = omega * self.sin(beta).sum() / self.count - frequency if self._rotating else beta[0]
        return numpy.append(frequency * self.differentiated(v) - rate, closing)

    def slopes(self, unknowns: Any, omega: Any) -> tuple[Any, Any, Any]:
        """The acceleration's derivatives by beta, gamma and v at the samples."""
        gamma, v = self.motion(unknowns, omega)
        by_beta, by_gamma, by_v = jacobian(self._ops, self.constants, omega, "linear")(unknowns[:-1], gamma, v)[2]
        return by_beta, by_gamma, by_v

    def along(self, unknowns: Any, omega: Any, change: Any) -> Any:
        """The residual's derivative in a direction of the unknowns at fixed Omega: (n + 1,)."""
        beta, w = unknowns[:-1], unknowns[-1]
        by_beta, by_gamma, by_v = self.slopes(unknowns, omega)
        turned = self.gamma_along(unknowns, omega, change)
        rate = self.rate_along(unknowns, change)
        acceleration = self.differentiated(w * rate + change[-1] * w * self.differentiated(beta))
        growth = omega * (self.cos(beta) * change[:-1]).sum() / self.count - change[-1]
        closing = growth if self._rotating else change[0]
        return numpy.append(acceleration - by_beta * change[:-1] - by_gamma * turned - by_v * rate, closing)

    def gamma_along(self, unknowns: Any, omega: Any, change: Any) -> Any:
        """The derivative of gamma at the samples in a direction of the unknowns."""
        beta, w = unknowns[:-1], unknowns[-1]
        tilt = self.cos(beta) * change[:-1] - self.sin(beta) * (change[-1] / w)
        return omega / w * self._applied(self.integral, tilt)

    def rate_along(self, unknowns: Any, change: Any) -> Any:
        """The derivative of v at the samples in a direction of the unknowns."""
        return unknowns[-1] * self.differentiated(change[:-1]) + change[-1] * self.differentiated(unknowns[:-1])

    def matrix(self, unknowns: Any, omega: float) -> Any:
        """The residual's derivative by the unknowns and by Omega, in double: (n + 1, n + 2)."""
        beta, w, n = unknowns[:-1], unknowns[-1], self.count
        gamma, v = self.motion(unknowns, omega)
        by_beta, by_gamma, by_v = self.slopes(unknowns, omega)
        swing = gamma - self._growth
        curve = self.slope @ beta
        stepped = field(self._ops, self.constants, complex(omega, _COMPLEX_STEP), "linear")
        rows = numpy.zeros((n + 1, n + 2))
        rows[:n, :n] = w * w * (self.slope @ self.slope) - by_v[:, None] * w * self.slope
        rows[:n, :n] -= (by_gamma * omega / w)[:, None] * self.integral * numpy.cos(beta)
        rows[numpy.arange(n), numpy.arange(n)] -= by_beta
        rows[:n, n] = 2 * w * (self.slope @ curve) + by_gamma * swing / w - by_v * curve
        rows[:n, n + 1] = -stepped(beta, gamma, v)[2].imag / _COMPLEX_STEP - by_gamma * swing / omega
        if self._rotating:
            rows[n, :n], rows[n, n], rows[n, n + 1] = omega * numpy.cos(beta) / n, -1.0, numpy.sin(beta).mean()
        else:
            rows[n, 0] = 1.0
        return rows


@lru_cache(maxsize=64)
def _operators(kind: Kind, count: int, precision: int | None) -> tuple[Any, Any]:
    """Differentiation by the angle, and integration of functions without mean, at the samples.

    With the samples at j h, h = pi s / n and s the kind's half periods, D_jl = (-1)^(j-l) / (s sin(pi (j - l) / n)),
    and the integral is (2 s / n) sum over k of sin(pi k (j - l) / n) / k, k odd below n for half a period and even for
    a whole one. Above double they are whole numbers, in units of 2^-(precision + _SPARE).
    """
    ctx = None if precision is None else bits(precision).context
    pi, sin, zero = (math.pi, math.sin, 0.0) if ctx is None else (ctx.pi, ctx.sin, ctx.zero)
    halves = kind.value
    sines = [sin(pi * j / count) for j in range(count)]
    table = [*sines, *(-value for value in sines)]  # sin(pi j / n) for j modulo 2 n
    slope = [zero, *((-1) ** j / (halves * sines[j]) for j in range(1, count))]
    harmonics = range(halves, count, 2)
    integral = [
        sum((table[k * j % (2 * count)] / k for k in harmonics), zero) * 2 * halves / count for j in range(count)
    ]
    distance = numpy.arange(count)[:, None] - numpy.arange(count)[None, :] + count - 1

    def spread(entries: list[Any]) -> Any:
        if ctx is not None:
            entries = [int(ctx.ldexp(entry, ctx.prec + _SPARE)) for entry in entries]
        odd = [-entry for entry in entries[:0:-1]] + entries
        return numpy.array(odd, dtype=float if ctx is None else object)[distance]

    return spread(slope), spread(integral)


def _spectrum(kind: Kind, beta: Any) -> Any:
    beta = beta.astype(float)
    return numpy.fft.rfft(beta if kind is Kind.ROTATING else numpy.concatenate((beta, -beta)))


def resampled(kind: Kind, point: Any, count: int) -> Any:
    """A point (beta_bar, frequency, Omega) with the same trigonometric polynomial at another number of samples."""
    old = len(point) - 2
    amplitudes = _spectrum(kind, point[:old])
    total = 2 * count // kind.value
    kept = numpy.zeros(total // 2 + 1, dtype=complex)
    both = min(len(kept), len(amplitudes))
    kept[:both] = amplitudes[:both]
    beta = numpy.fft.irfft(kept, total)[:count] * (count / old)
    return numpy.append(beta, point[old:].astype(float))


def sizes(kind: Kind, beta: Any) -> Any:
    """The amplitudes of beta_bar's harmonics [rad], in double: odd ones, or all from the first on."""
    half_periods = len(beta) * (2 // kind.value)
    return 2 * numpy.abs(_spectrum(kind, beta))[1 :: 2 // kind.value] / half_periods


def decay(amplitudes: Any, smallest: float = 1e-13) -> float:
    """The mean factor between neighbouring harmonics, over the later ones that stand above rounding."""
    telling = [math.log10(size) for size in amplitudes if size > smallest * amplitudes[0]]
    if len(telling) < 3:
        return 1e-6
    half = len(telling) // 2
    return min(0.999, 10 ** ((telling[-1] - telling[half - 1]) / (len(telling) - half)))


def samples_for(kind: Kind, point: Any, digits: int) -> int:
    """So many samples as the decay of the harmonics needs for the digits."""
    # A librating cycle's state at the section converges later than its period.
    spare, fewest = (3, 0) if kind is Kind.ROTATING else (7, _FEWEST_SAMPLES)
    harmonics = (digits + spare) * math.log(10) / -math.log(decay(sizes(kind, point[:-2])))
    return min(MOST_SAMPLES, kind.samples(max(fewest, 2 * harmonics)))


def at_two_resolutions(
    parameters: Parameters, kind: Kind, count: int, digits: int, numbers: Callable[[Collocation], dict[str, Any]]
) -> dict[str, Measured]:
    """``numbers`` of the collocation at ``count`` samples, with twice the distance from a finer one as half-widths.

    The error falls geometrically with the samples. A librating cycle may have few harmonics, and is compared with
    twice as many. No relative half-width is less than the frequency's: a number whose error is small by chance has
    that error all the same.
    """
    finer = kind.samples(count * (1.3 if kind is Kind.ROTATING else 2))
    rough = numbers(Collocation(parameters, kind, count, digits + _GUARD))
    sharp = numbers(Collocation(parameters, kind, finer, digits + _GUARD + _FINER))
    least = abs(fraction(sharp["period"]) / fraction(rough["period"]) - 1) if kind is Kind.LIBRATING else Fraction(0)
    return {name: Measured.compared(value, sharp[name], least) for name, value in rough.items()}


def chord(a: Collocation, system: Any, unknowns: Any, residual: Callable[[Any], Any]) -> Any:
    """Newton's iteration above double with the derivative ``system`` in double: each pass gains some ten digits.

    Raises NoSuchCycleError if the passes do not settle below what doubles see.
    """
    from scipy.linalg import lu_factor, lu_solve

    factored = lu_factor(system)
    previous = math.inf
    for _ in range(_MOST_PASSES):
        right = residual(unknowns)
        scale = max(abs(part) for part in right)
        if not scale:
            return unknowns
        # A residual of any size is scaled to one, solved for in double, and scaled back.
        step = scale * a.number(lu_solve(factored, (right / scale).astype(float)))
        unknowns = unknowns - step
        size = max(abs(step))
        if not size or (size >= previous / 2 and size < _SETTLED):
            return unknowns
        previous = min(previous, size)
    raise NoSuchCycleError(f"collocation with {a.count} samples does not settle")
