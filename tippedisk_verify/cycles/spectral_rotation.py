"""Rotating limit cycles without an integrator: collocation in time, with even and odd harmonics.

The collocation's equations are solved by Newton's method in double; above double the same derivative serves, each pass
gaining some ten digits. The multiplier is the exponent of the variational equation's periodic solutions, found the same
way.

Each answer is computed with two numbers of samples, and the difference is its error, since that falls geometrically.
The finer collocation has more digits too: where rounding is what is left, more samples alone would add to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.period_collocation import (
    DIFFERENCE,
    FEWEST,
    FINER,
    GUARD,
    MORE,
    MOST_PASSES,
    SETTLED,
    Arithmetic,
    PeriodSamples,
    compared,
    odd,
    samples_for,
    scaled_step,
    settled,
)
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits

__all__ = ["SpectralRotation", "rotation_on_few_samples", "spectral_rotation"]

_LONGEST_STEP = 0.3  # rad
_REAL = 0.4  # in units of the frequency; the next copies of an exponent are one off


@dataclass(frozen=True)
class SpectralRotation:
    """A rotating limit cycle; each number's half-width is twice its distance from a finer collocation."""

    omega: Fraction  #: [rad/s]
    samples: int
    period: Measured  #: T [s]
    beta_bar_top: Measured  #: beta - pi/2 at gamma = pi/2 [rad]
    v_top: Measured  #: v there [rad/s]
    multiplier_slow: Measured  #: the larger non-trivial Floquet multiplier
    log_multipliers: Measured  #: the sum of both multipliers' logarithms, by Liouville's integral


def spectral_rotation(
    parameters: Parameters, omega: object, *, stable: bool = True, digits: int = 12
) -> SpectralRotation:
    """The rotating limit cycle of the linear law at ``omega`` [rad/s], to about ``digits`` digits of its period.

    Raises InputError for a speed that is not positive, NoSuchCycleError where collocation finds none.
    """
    parameters.refuse_smooth("spectral collocation is")
    speed = checked_speed(omega)
    checked_digits(digits)
    start = rotation_on_few_samples(parameters, float(speed), stable)
    count = samples_for(start, digits)
    rough = _rotation_numbers(parameters, speed, start, count, digits)
    sharp = _rotation_numbers(parameters, speed, start, odd(MORE * count), digits + FINER)
    return SpectralRotation(speed, count, **compared(rough, sharp))


# --------------------------------------------------------------------------------------------- the first guess
def _rolling(parameters: Parameters, omega: float, lean: float, count: int) -> PeriodSamples:
    """A rotation of the rolling disk, which conserves (r + e sin gamma) sin beta; beta_bar = lean at the bottom."""
    r, e = float(parameters.r), float(parameters.e)
    gamma = numpy.linspace(0.0, 2 * math.pi, 4001)  # gamma_bar, from the top
    beta = numpy.arccos((r - e) * math.cos(lean) / (r + e * numpy.cos(gamma)))
    pace = 1 / (omega * numpy.sin(beta))
    times = numpy.concatenate(([0.0], numpy.cumsum((pace[1:] + pace[:-1]) / 2 * numpy.diff(gamma))))
    at = numpy.arange(count) / count * times[-1]
    return PeriodSamples(numpy.interp(at, times, beta), 2 * math.pi / float(times[-1]))


_LEANS = (0.04, 0.08, 0.02, 0.12, 0.2, 0.35, 0.6)  # rad; the first ones lead to the stable cycle, the last to the other


def rotation_on_few_samples(parameters: Parameters, omega: float, stable: bool) -> PeriodSamples:
    """The cycle in double on few samples: the stable one, or the unstable one.

    Raises NoSuchCycleError where Newton's iteration leads from none of the rolling disk's rotations to it.
    """
    for lean in _LEANS if stable else _LEANS[::-1]:
        cycle = _solved_in_double(parameters, omega, _rolling(parameters, omega, lean, FEWEST))
        if cycle is not None:
            exponent, _, _ = _exponent_in_double(Arithmetic(parameters, FEWEST), cycle, omega)
            if (exponent < 0) == stable:
                return cycle
    raise NoSuchCycleError(f"collocation finds no {'stable' if stable else 'unstable'} rotating cycle here")


def _solved_in_double(parameters: Parameters, omega: float, start: PeriodSamples) -> PeriodSamples | None:
    """Newton's iteration at fixed Omega; None if it does not converge to a cycle that leans to one side."""
    a = Arithmetic(parameters, len(start.beta))
    guess = start
    for _ in range(MOST_PASSES):
        try:
            step = numpy.linalg.solve(guess.matrix(a, omega), guess.residual(a, omega))
        except numpy.linalg.LinAlgError:
            return None
        size = float(abs(step[:-1]).max())
        share = min(1.0, _LONGEST_STEP / size)
        guess = PeriodSamples(guess.beta - share * step[:-1], guess.frequency - share * step[-1])
        if not (numpy.isfinite(guess.beta).all() and guess.beta.min() > 0 and guess.beta.max() < math.pi / 2):
            return None
        if size < SETTLED:
            return guess
    return None


def _sharpened(a: Arithmetic, speed: Any, start: PeriodSamples, parameters: Parameters) -> PeriodSamples:
    """The cycle in an arithmetic above double, by passes with the derivative in double."""
    from scipy.linalg import lu_factor, lu_solve

    double = _solved_in_double(parameters, float(speed), start.resampled(a.count))
    if double is None:
        raise NoSuchCycleError(f"collocation with {a.count} samples does not converge")
    factored = lu_factor(double.matrix(Arithmetic(parameters, a.count), float(speed)))
    cycle = PeriodSamples(a.number(double.beta), a.number(double.frequency))

    def step() -> Any:
        nonlocal cycle
        change = scaled_step(lambda right: lu_solve(factored, right), cycle.residual(a, speed), a)
        cycle = PeriodSamples(cycle.beta - change[:-1], cycle.frequency - change[-1])
        return change

    settled(step, a)
    return cycle


def _rotation_numbers(parameters: Parameters, speed: Fraction, start: PeriodSamples, count: int, digits: int) -> Any:
    a = Arithmetic(parameters, count, digits + GUARD)
    omega = a.number(speed)
    cycle = _sharpened(a, omega, start, parameters)
    _, v = cycle.motion(a, omega)
    period = 2 * a.pi / cycle.frequency
    return {
        "period": period,
        "beta_bar_top": cycle.beta[0],
        "v_top": v[0],
        "multiplier_slow": a.ctx.exp(2 * a.pi * _exponent(a, cycle, omega, parameters)),
        "log_multipliers": period * cycle.slopes(a, omega)[2].sum() / count,
    }


# ---------------------------------------------------------------------------------------------- the multiplier
def _variation(
    a: Arithmetic, cycle: PeriodSamples, omega: Any, mode: tuple[Any, Any], exponent: Any
) -> tuple[Any, Any]:
    """What a mode (delta beta, delta gamma) exp(exponent * angle) leaves of the variational equation."""
    by_beta, by_gamma, by_v = cycle.slopes(a, omega)
    beta, gamma = mode
    w = cycle.frequency
    rate = w * (a.differentiated(beta) + exponent * beta)
    turning = a.differentiated(gamma) + exponent * gamma - omega / w * a.cos(cycle.beta) * beta
    return turning, w * (a.differentiated(rate) + exponent * rate) - by_beta * beta - by_gamma * gamma - by_v * rate


def _exponent_in_double(a: Arithmetic, cycle: PeriodSamples, omega: float) -> tuple[float, Any, Any]:
    """The slow Floquet exponent, in units of the frequency, and its mode (delta beta, delta gamma)."""
    by_beta, by_gamma, by_v = cycle.slopes(a, omega)
    w, n = cycle.frequency, a.count
    rows = numpy.zeros((3 * n, 3 * n))  # (delta beta, delta gamma, delta v)
    for k in range(3):
        rows[k * n : (k + 1) * n, k * n : (k + 1) * n] = -a.slope
    at = numpy.arange(n)
    rows[at, at + 2 * n] += 1 / w
    rows[at + n, at] += omega * numpy.cos(cycle.beta) / w
    rows[at + 2 * n, at] += by_beta / w
    rows[at + 2 * n, at + n] += by_gamma / w
    rows[at + 2 * n, at + 2 * n] += by_v / w
    values, vectors = numpy.linalg.eig(rows)
    # One exponent of each is as good as real, the others differ from it by multiples of i; the one of the flow is 0.
    real = [k for k in range(3 * n) if abs(values[k].imag) < _REAL]
    real.sort(key=lambda k: abs(values[k].real))
    chosen = real[1]
    vector = vectors[:, chosen]
    vector = (vector / vector[abs(vector).argmax()]).real
    return float(values[chosen].real), vector[:n], vector[n : 2 * n]


def _exponent(a: Arithmetic, cycle: PeriodSamples, omega: Any, parameters: Parameters) -> Any:
    """The slow Floquet exponent in the arithmetic of the cycle, in units of the frequency."""
    from scipy.linalg import lu_factor, lu_solve

    n = a.count
    double = PeriodSamples(cycle.beta.astype(float), float(cycle.frequency))
    plain = Arithmetic(parameters, n)
    start, *mode = _exponent_in_double(plain, double, float(omega))
    largest = int(abs(mode[0]).argmax())
    mode = [part / mode[0][largest] for part in mode]
    rows = numpy.zeros((2 * n + 1, 2 * n + 1))
    for column in range(2 * n):
        unit = numpy.zeros(2 * n)
        unit[column] = 1.0
        rows[: 2 * n, column] = numpy.concatenate(_variation(plain, double, float(omega), (unit[:n], unit[n:]), start))
    ahead, behind = (
        numpy.concatenate(_variation(plain, double, float(omega), (mode[0], mode[1]), start + h))
        for h in (DIFFERENCE, -DIFFERENCE)
    )
    rows[: 2 * n, 2 * n] = (ahead - behind) / (2 * DIFFERENCE)
    rows[2 * n, largest] = 1.0
    factored = lu_factor(rows)
    beta, gamma, exponent = a.number(mode[0]), a.number(mode[1]), a.number(start)

    def step() -> Any:
        nonlocal beta, gamma, exponent
        residual = numpy.concatenate((*_variation(a, cycle, omega, (beta, gamma), exponent), [beta[largest] - 1]))
        change = scaled_step(lambda right: lu_solve(factored, right), residual, a)
        beta, gamma, exponent = beta - change[:n], gamma - change[n : 2 * n], exponent - change[-1]
        return change

    settled(step, a)
    return exponent
