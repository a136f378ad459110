"""Numerical harmonic balance of the full, unexpanded equations: limit cycles without an integrator.

The point symmetry leaves odd harmonics only, so half a period holds the cycle. beta_bar is sampled at 2 N points of it,
for N odd harmonics; gamma_bar follows by integrating gamma_bar' = Omega sin(beta_bar) spectrally, v by differentiating
beta_bar. The equation of motion at the points, with the phase fixed by beta_bar = 0 and v < 0 at the first, is solved
by Newton's method in double; above double the same Jacobian serves, each pass gaining a fixed number of digits.

The truncation error is estimated by one Newton step with twice as many harmonics, which is its leading term.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy

from tippedisk_verify.cycles.odd_fourier import OddSeries, Samples, double_operators, motion, operators
from tippedisk_verify.cycles.spectral_branch import (
    MOST_HARMONICS,
    branch_to,
    derivatives,
    fixed_omega,
    newton,
    residuals,
    unconverged,
)
from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.model.equations import checked_speed, shifted
from tippedisk_verify.model.exact import quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits, checked_digits
from tippedisk_verify.model.results import Printable

__all__ = ["BalancedCycle", "approximate_cycle", "balanced_cycle"]

_JACOBIAN = 1e-10  # the relative error of a Jacobian taken at the double solution
_WORTHLESS = 0.01  # a relative truncation estimate above this says that there may be no cycle at all


@dataclass(frozen=True, repr=False)
class BalancedCycle(Printable):
    """A limit cycle from harmonic balance; every number with a half-width from the truncation estimate."""

    untold = ("decay", "amplitudes")

    omega: Fraction  #: the spinning speed [rad/s]
    harmonics: int  #: number of odd harmonics
    period: Measured  #: T [s]
    gamma_bar_0: Measured  #: gamma - pi/2 at beta = pi/2, v < 0 [rad]
    v_0: Measured  #: v there [rad/s]
    beta_max: Measured  #: largest |beta - pi/2| [rad]
    decay: float  #: factor by which the harmonics' amplitudes fall from one odd harmonic to the next
    amplitudes: tuple[float, ...]  #: of the odd harmonics of beta_bar [rad]


def balanced_cycle(
    parameters: Parameters, omega: object, *, digits: int = 12, harmonics: int | None = None, crossing: int = 1
) -> BalancedCycle:
    """The limit cycle of the linear law at the speed ``omega`` [rad/s], to ``digits`` significant digits of its period.

    ``harmonics`` fixes the number of odd harmonics; otherwise it grows until the truncation estimate allows the digits.
    A branch that turns round in folds has several cycles at a speed: ``crossing`` says which, counted from the Hopf
    point. Raises InputError for a speed that is not positive or harmonics outside 1 ... 1024; NoSuchCycleError if there
    is no cycle at this speed or the balance does not converge.
    """
    parameters.refuse_smooth("harmonic balance is")
    speed = checked_speed(omega)
    if harmonics is not None and not (isinstance(harmonics, int) and 1 <= harmonics <= MOST_HARMONICS):
        raise InputError(f"the number of harmonics lies between 1 and {MOST_HARMONICS}, not {shown(harmonics)}")
    checked_digits(digits)
    start = branch_to(parameters, speed, harmonics, crossing)
    count = start.harmonics
    while True:
        cycle, missing = _sharpened(parameters, speed, start, digits)
        if harmonics is not None or missing <= 0:
            return cycle
        if count >= MOST_HARMONICS:
            raise NoSuchCycleError(
                f"the balance did not converge with {count} harmonics: this close to Omega_h use shooting"
            )
        # So many harmonics more as the decay needs for the digits that are missing, and a tenth for the estimate.
        lost = -math.log10(cycle.decay)
        count = min(MOST_HARMONICS, int((count + missing / lost + 2) * 1.1))
        start = start.resampled(count)
        start = newton(parameters, float(speed), start)


def approximate_cycle(parameters: Parameters, omega: Fraction) -> tuple[float, float]:
    """(gamma_bar, v) at beta = pi/2, v < 0, of the limit cycle at ``omega``, good enough to start shooting from.

    Raises NoSuchCycleError as `balanced_cycle` does.
    """
    guess = branch_to(parameters, omega, None)
    gamma, v = motion(guess.beta, guess.frequency, float(omega), double_operators(guess.harmonics), numpy.sin)
    return float(gamma[0]), float(v[0])


def _sharpened(parameters: Parameters, omega: Fraction, guess: Samples, digits: int) -> tuple[BalancedCycle, float]:
    """The cycle in ``digits + 15`` digits, and how many digits the truncation still lacks (negative: none).

    Residuals are evaluated in mpmath, corrections solved for in double after scaling: the Jacobian at the double
    solution is within 1e-10 of the right one, so each pass gains about ten digits.
    """
    ctx, constants, speed, ops, sin = _tools(parameters, omega, digits + 15)
    system = _factored(parameters, float(omega), guess)
    matrices = operators(guess.harmonics, ctx)
    sharp = Samples(numpy.array([ctx.mpf(value) for value in guess.beta], dtype=object), ctx.mpf(guess.frequency))
    amplitude = max(abs(value) for value in sharp.beta)
    previous = ctx.inf
    for _ in range(12 + digits):
        step = _corrected(system, residuals(constants, speed, sharp, matrices, ops, sin), ctx)
        sharp = Samples(sharp.beta - numpy.concatenate(([ctx.mpf(0)], step[1:])), sharp.frequency - step[0])
        size = max(*(abs(part) / amplitude for part in step[1:]), abs(step[0]) / sharp.frequency)
        if size < ctx.mpf(10) ** (-digits - 10) or size >= previous / 2:
            break
        previous = size
    if size > ctx.mpf(10) ** (-digits - 4):
        raise NoSuchCycleError(unconverged(guess.harmonics))
    return _measured(parameters, omega, sharp, digits)


def _tools(parameters: Parameters, omega: Fraction, digits: int) -> tuple[Any, Constants, Any, Any, Any]:
    """An arithmetic of that many digits: its context, the constants and the speed in it, and its sines."""
    ctx = bits(bits_for_digits(digits)).context
    constants = parameters.within(ctx)
    sin, cos = (numpy.frompyfunc(function, 1, 1) for function in (ctx.sin, ctx.cos))
    return ctx, constants, quotient(ctx, omega), shifted(SimpleNamespace(sin=sin, cos=cos)), sin


def _factored(parameters: Parameters, omega: float, guess: Samples) -> Any:
    from scipy.linalg import lu_factor

    matrix, by_frequency, _ = derivatives(parameters.at(DOUBLE), omega, guess)
    return lu_factor(fixed_omega(matrix, by_frequency))


def _corrected(system: Any, residual: Any, ctx: Any) -> Any:
    """The Newton step for a residual of any size: scaled to one, solved in double, scaled back."""
    from scipy.linalg import lu_solve

    scale = max(abs(part) for part in residual)
    if not scale:
        return numpy.array([ctx.mpf(0)] * len(residual), dtype=object)
    step = lu_solve(system, numpy.array([float(part / scale) for part in residual]))
    return numpy.array([scale * ctx.mpf(part) for part in step], dtype=object)


def _measured(parameters: Parameters, omega: Fraction, balanced: Samples, digits: int) -> tuple[BalancedCycle, float]:
    """The cycle's numbers with their errors: a Newton step with twice the harmonics in an arithmetic with more digits.

    The rounded equations have a root of their own, on which the iteration settles: only more digits show how far off.
    """
    ctx, constants, speed, ops, sin = _tools(parameters, omega, digits + 30)
    sharp = Samples(numpy.array([ctx.mpf(value) for value in balanced.beta], dtype=object), ctx.mpf(balanced.frequency))
    count = sharp.harmonics
    n = 2 * count
    series = OddSeries(sharp.beta, ctx)
    fine = Samples(numpy.array([series(ctx.pi * j / (2 * n)) for j in range(2 * n)], dtype=object), sharp.frequency)
    double = Samples(numpy.array([float(value) for value in fine.beta]), float(fine.frequency))
    double.beta[0] = 0.0
    twice = operators(2 * count, ctx)
    step = _corrected(
        _factored(parameters, float(omega), double), residuals(constants, speed, fine, twice, ops, sin), ctx
    )
    better = Samples(fine.beta - numpy.concatenate(([ctx.mpf(0)], step[1:])), fine.frequency - step[0])
    better_gamma, better_v = motion(better.beta, better.frequency, speed, twice, sin)
    gamma, v = motion(sharp.beta, sharp.frequency, speed, operators(count, ctx), sin)
    at = max(range(n), key=lambda j: abs(sharp.beta[j])) * ctx.pi / n
    for _ in range(6 + digits.bit_length()):
        at -= series(at, 1) / series(at, 2)
    beta_error = max(abs(part) for part in step[1:])
    relative = abs(step[0]) / sharp.frequency
    if relative > _WORTHLESS:  # the estimate is the leading term of something small, or nothing
        raise NoSuchCycleError(unconverged(count))

    # What one step leaves: the square of the whole step, and what a Jacobian of the double solution misses of it. A
    # number whose share in the step is small by chance has this error all the same.
    size = beta_error / abs(sharp.beta).max() + relative
    left = size * (4 * size + _JACOBIAN)

    def held(value: Any, error: Any) -> Measured:
        # Twice the leading term of the error, and no less than the frequency's relative error, which all of them
        # follow. The formulas here add a few roundings.
        return Measured.of(value, 2 * error + abs(value) * (relative + left + 8 * ctx.eps))

    period = 2 * ctx.pi / sharp.frequency
    smallest = ctx.mpf(10) ** (-3 * digits - 300)
    sizes = [float(ctx.log10(ctx.hypot(a, b) + smallest)) for a, b in zip(series.cosines, series.sines, strict=True)]
    cycle = BalancedCycle(
        omega=omega,
        harmonics=count,
        period=held(period, period * relative),
        gamma_bar_0=held(gamma[0], abs(gamma[0] - better_gamma[0])),
        v_0=held(v[0], abs(v[0] - better_v[0])),
        beta_max=held(abs(series(at)), beta_error),
        decay=_decay(sizes, digits),
        amplitudes=tuple(10**size for size in sizes),
    )
    worst = max(m.uncertainty / abs(m.value) for m in (cycle.period, cycle.gamma_bar_0, cycle.v_0, cycle.beta_max))
    return cycle, math.log10(worst) + digits if worst else -math.inf


def _decay(sizes: list[float], digits: int) -> float:
    """The mean factor between neighbouring odd harmonics, over those that stand above rounding."""
    telling = [size for size in sizes if size > sizes[0] - digits - 8]
    if len(telling) < 3:
        return 1e-6
    half = len(telling) // 2
    return float(min(0.999, 10 ** ((telling[-1] - telling[half - 1]) / (len(telling) - half))))
