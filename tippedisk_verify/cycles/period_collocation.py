"""Collocation in time on one period of a rotation: what the spectral roads to rotating cycles and their fold share.

beta_bar is sampled at n (odd) equal parts of the period. gamma grows by 2 pi a period: its rate Omega sin(beta_bar) has
the period's angular frequency as its mean and is integrated spectrally, from gamma = pi/2 at the first sample. What is
left to solve is the equation of motion at the samples, and that mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy

from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import field, jacobian
from tippedisk_verify.model.exact import quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits

__all__ = [
    "DIFFERENCE",
    "FEWEST",
    "FINER",
    "GUARD",
    "MORE",
    "MOST_PASSES",
    "SETTLED",
    "Arithmetic",
    "PeriodSamples",
    "compared",
    "odd",
    "samples_for",
    "scaled_step",
    "settled",
]

FEWEST, _MOST = 41, 1501  #: samples
MORE = 1.3  #: times as many for the error
DIFFERENCE = 1e-6  #: of a number of order one: a derivative by differences in double is then good to some 1e-10
MOST_PASSES = 60
SETTLED = 1e-9  #: a step in double that rounding follows
GUARD = 15  #: digits
_SPARE = 20  # bits below an arithmetic's last one, in which sums of a thousand products are taken
FINER = 6  #: digits that the finer collocation has more


class Arithmetic:
    """Constants, sines and differentiation in double, or in mpmath numbers of so many digits."""

    def __init__(self, parameters: Parameters, count: int, digits: int | None = None) -> None:
        self.ctx: Any = None if digits is None else bits(bits_for_digits(digits)).context
        ctx = self.ctx
        self.pi: Any = math.pi if ctx is None else ctx.pi
        self.constants: Constants = parameters.at(DOUBLE) if ctx is None else parameters.within(ctx)
        self.sin = numpy.sin if ctx is None else numpy.frompyfunc(ctx.sin, 1, 1)
        self.cos = numpy.cos if ctx is None else numpy.frompyfunc(ctx.cos, 1, 1)
        self.slope, self.integral = _operators(count, None if ctx is None else ctx.prec)
        self.angles = 2 * self.pi * numpy.arange(count) / count
        self.count = count

    def differentiated(self, samples: Any) -> Any:
        """The derivative of a periodic function by the angle, at the samples."""
        return self._applied(self.slope, samples)

    def integrated(self, samples: Any) -> Any:
        """The integral of a periodic function of mean zero over the angle, at the samples."""
        return self._applied(self.integral, samples)

    def _applied(self, rows: Any, samples: Any) -> Any:
        """A matrix times samples of order one; above double in whole numbers, which are far faster than mpmath's."""
        if self.ctx is None:
            return rows @ samples
        places = self.ctx.prec + _SPARE
        whole = numpy.array([int(self.ctx.ldexp(sample, places)) for sample in samples], dtype=object)
        sums = rows @ whole
        return numpy.array([self.ctx.ldexp(self.ctx.mpf(total), -2 * places) for total in sums], dtype=object)

    def number(self, value: Any) -> Any:
        """A rational, or the numbers of another arithmetic, in this one."""
        if isinstance(value, Fraction):
            return float(value) if self.ctx is None else quotient(self.ctx, value)
        if isinstance(value, numpy.ndarray):
            return value.astype(float) if self.ctx is None else numpy.array([self.ctx.mpf(x) for x in value])
        return float(value) if self.ctx is None else self.ctx.mpf(value)


class _Ops:
    """sin and cos of beta and gamma from the shifted angles."""

    def __init__(self, arithmetic: Arithmetic) -> None:
        self.sin = arithmetic.cos
        self.cos = lambda angle: -arithmetic.sin(angle)


@lru_cache(maxsize=16)
def _operators(count: int, precision: int | None) -> tuple[Any, Any]:
    """Differentiation on an odd number of samples of a period, and the integral of what has mean zero.

    Above double they are whole numbers, in units of 2^-(precision + _SPARE).
    """
    ctx = None if precision is None else bits(precision).context
    pi, sin, zero = (math.pi, math.sin, 0.0) if ctx is None else (ctx.pi, ctx.sin, ctx.zero)
    slope = [zero, *((-1) ** j / (2 * sin(pi * j / count)) for j in range(1, count))]
    sines = [sin(2 * pi * j / count) for j in range(count)]
    integral = [
        sum((sines[k * j % count] / k for k in range(1, (count + 1) // 2)), zero) * 2 / count for j in range(count)
    ]
    rows = (numpy.arange(count)[:, None] - numpy.arange(count)[None, :]) % count
    if ctx is None:
        return numpy.array(slope)[rows], numpy.array(integral)[rows]
    whole = ([int(ctx.ldexp(entry, ctx.prec + _SPARE)) for entry in entries] for entries in (slope, integral))
    return tuple(numpy.array(entries, dtype=object)[rows] for entries in whole)


@dataclass(frozen=True)
class PeriodSamples:
    """beta_bar at the samples, and the cycle's angular frequency; or a direction in the space of these."""

    beta: Any
    frequency: Any

    def motion(self, a: Arithmetic, omega: Any) -> tuple[Any, Any]:
        """gamma_bar, which grows by 2 pi a period, and v."""
        swing = omega / self.frequency * a.integrated(a.sin(self.beta))
        return a.angles + swing - swing[0], self.frequency * a.differentiated(self.beta)

    def residual(self, a: Arithmetic, omega: Any) -> Any:
        """v' less the acceleration at the samples, and the mean rate of gamma less the frequency: (n + 1,)."""
        gamma, v = self.motion(a, omega)
        rate = field(_Ops(a), a.constants, omega, "linear")(self.beta, gamma, v)[2]
        mean = omega * a.sin(self.beta).sum() / a.count - self.frequency
        return numpy.append(self.frequency * a.differentiated(v) - rate, mean)

    def slopes(self, a: Arithmetic, omega: Any) -> tuple[Any, Any, Any]:
        """The acceleration's derivatives by beta, gamma and v at the samples."""
        gamma, v = self.motion(a, omega)
        by_beta, by_gamma, by_v = jacobian(_Ops(a), a.constants, omega, "linear")(self.beta, gamma, v)[2]
        return by_beta, by_gamma, by_v

    def along(self, a: Arithmetic, omega: Any, change: PeriodSamples) -> Any:
        """The residual's derivative in a direction at fixed Omega: (n + 1,)."""
        by_beta, by_gamma, by_v = self.slopes(a, omega)
        w = self.frequency
        tilt = a.cos(self.beta) * change.beta
        swing = a.integrated(tilt) - a.integrated(a.sin(self.beta)) * (change.frequency / w)
        turned = omega / w * (swing - swing[0])
        curve = a.differentiated(self.beta)
        rate = w * a.differentiated(change.beta) + change.frequency * curve
        slope_of_v = a.differentiated(w * rate + change.frequency * w * curve)
        mean = omega * tilt.sum() / a.count - change.frequency
        return numpy.append(slope_of_v - by_beta * change.beta - by_gamma * turned - by_v * rate, mean)

    def matrix(self, a: Arithmetic, omega: float) -> Any:
        """The residual's derivative by the samples and the frequency, in double: (n + 1, n + 1)."""
        by_beta, by_gamma, by_v = self.slopes(a, omega)
        w, n = self.frequency, a.count
        integral = a.integral - a.integral[0]
        curve = a.slope @ self.beta
        rows = numpy.zeros((n + 1, n + 1))
        rows[:n, :n] = w * w * (a.slope @ a.slope) - by_v[:, None] * w * a.slope
        rows[:n, :n] -= (by_gamma * omega / w)[:, None] * integral * numpy.cos(self.beta)
        rows[numpy.arange(n), numpy.arange(n)] -= by_beta
        rows[:n, n] = 2 * w * (a.slope @ curve) - by_v * curve
        rows[:n, n] += by_gamma * omega / w**2 * (integral @ numpy.sin(self.beta))
        rows[n, :n], rows[n, n] = omega * numpy.cos(self.beta) / n, -1.0
        return rows

    def resampled(self, count: int) -> PeriodSamples:
        """The same trigonometric polynomial at another odd number of samples, in double."""
        old = len(self.beta)
        amplitudes = numpy.fft.rfft(self.beta.astype(float))
        kept = numpy.zeros(count // 2 + 1, dtype=complex)
        kept[: min(len(kept), len(amplitudes))] = amplitudes[: len(kept)]
        return PeriodSamples(numpy.fft.irfft(kept, count) * (count / old), float(self.frequency))


def compared(rough: dict[str, Any], sharp: dict[str, Any]) -> dict[str, Measured]:
    return {name: Measured.compared(value, sharp[name], Fraction(0)) for name, value in rough.items()}


def odd(count: float) -> int:
    return 2 * math.ceil(count / 2) + 1


def samples_for(start: PeriodSamples, digits: int) -> int:
    """So many samples as the decay of the harmonics needs for the digits."""
    sizes = numpy.abs(numpy.fft.rfft(start.resampled(4 * FEWEST + 1).beta))
    # Harmonics of the first guess stand above rounding up to some twenty.
    factor = (sizes[20] / sizes[5]) ** (1 / 15)
    return min(_MOST, odd(2 * (digits + 3) * math.log(10) / -math.log(factor)))


def scaled_step(solve: Any, residual: Any, a: Arithmetic) -> Any:
    """A Newton step for a residual of any size: scaled to one, solved in double, scaled back."""
    scale = max(abs(part) for part in residual)
    if not scale:
        return numpy.array([a.ctx.mpf(0)] * len(residual))
    return numpy.array([scale * a.ctx.mpf(float(part)) for part in solve((residual / scale).astype(float))])


def settled(step: Any, a: Arithmetic) -> None:
    """Passes until they no longer shrink. Raises NoSuchCycleError if they never do so below what doubles see."""
    previous = math.inf
    for _ in range(MOST_PASSES):
        size = max(abs(part) for part in step())
        if not size or (size >= previous / 2 and size < SETTLED):
            return
        previous = min(previous, size)
    raise NoSuchCycleError(f"collocation with {a.count} samples does not settle")
