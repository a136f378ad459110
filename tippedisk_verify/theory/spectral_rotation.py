"""Rotating limit cycles and their fold without an integrator: collocation in time, with even and odd harmonics.

beta_bar is sampled at n (odd) equal parts of the period. gamma grows by 2 pi a period: its rate Omega sin(beta_bar) has
the period's angular frequency as its mean and is integrated spectrally, from gamma = pi/2 at the first sample. The
equation of motion at the samples, and that mean, are solved by Newton's method in double; above double the same
derivative serves, each pass gaining some ten digits. The multiplier is the exponent of the variational equation's
periodic solutions, found the same way; the fold is where that equation has a second one of exponent zero.

Each answer is computed with two numbers of samples, and the difference is its error, since that falls geometrically.
The finer collocation has more digits too: where rounding is what is left, more samples alone would add to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy

from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import checked_speed, field, jacobian
from tippedisk_verify.model.exact import quotient
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits, checked_digits
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["SpectralFold", "SpectralRotation", "spectral_fold", "spectral_rotation"]

_FEWEST, _MOST = 41, 1501  # samples
_MORE = 1.3  # times as many for the error
_DIFFERENCE = 1e-6
_MOST_PASSES = 60
_SETTLED, _SETTLED_FOLD = 1e-9, 1e-7  # steps in double that rounding follows; the fold's equations amplify it more
_LONGEST_STEP = 0.3  # rad
_SHORTER = 0.93  # of the mean lean, from one cycle to the next on the way to the fold
_REAL = 0.4  # in units of the frequency; the next copies of an exponent are one off
_GUARD = 15  # digits
_SPARE = 20  # bits below an arithmetic's last one, in which sums of a thousand products are taken
_FINER = 6  # digits that the finer collocation has more


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


@dataclass(frozen=True)
class SpectralFold:
    """The fold of the rotating cycles; half-widths as those of `SpectralRotation`."""

    samples: int
    omega: Measured  #: [rad/s]
    period: Measured  #: T [s]
    beta_bar_top: Measured  #: [rad]
    v_top: Measured  #: [rad/s]
    null_vector: Measured  #: d(v_top) / d(beta_bar_top) along the family [1/s]


class _Arithmetic:
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

    def __init__(self, arithmetic: _Arithmetic) -> None:
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
class _Samples:
    """beta_bar at the samples, and the cycle's angular frequency; or a direction in the space of these."""

    beta: Any
    frequency: Any

    def motion(self, a: _Arithmetic, omega: Any) -> tuple[Any, Any]:
        """gamma_bar, which grows by 2 pi a period, and v."""
        swing = omega / self.frequency * a.integrated(a.sin(self.beta))
        return a.angles + swing - swing[0], self.frequency * a.differentiated(self.beta)

    def residual(self, a: _Arithmetic, omega: Any) -> Any:
        """v' less the acceleration at the samples, and the mean rate of gamma less the frequency: (n + 1,)."""
        gamma, v = self.motion(a, omega)
        rate = field(_Ops(a), a.constants, omega, "linear")(self.beta, gamma, v)[2]
        mean = omega * a.sin(self.beta).sum() / a.count - self.frequency
        return numpy.append(self.frequency * a.differentiated(v) - rate, mean)

    def slopes(self, a: _Arithmetic, omega: Any) -> tuple[Any, Any, Any]:
        """The acceleration's derivatives by beta, gamma and v at the samples."""
        gamma, v = self.motion(a, omega)
        by_beta, by_gamma, by_v = jacobian(_Ops(a), a.constants, omega, "linear")(self.beta, gamma, v)[2]
        return by_beta, by_gamma, by_v

    def along(self, a: _Arithmetic, omega: Any, change: _Samples) -> Any:
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

    def matrix(self, a: _Arithmetic, omega: float) -> Any:
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

    def resampled(self, count: int) -> _Samples:
        """The same trigonometric polynomial at another odd number of samples, in double."""
        old = len(self.beta)
        amplitudes = numpy.fft.rfft(self.beta.astype(float))
        kept = numpy.zeros(count // 2 + 1, dtype=complex)
        kept[: min(len(kept), len(amplitudes))] = amplitudes[: len(kept)]
        return _Samples(numpy.fft.irfft(kept, count) * (count / old), float(self.frequency))


def spectral_rotation(
    parameters: Parameters, omega: object, *, stable: bool = True, digits: int = 12
) -> SpectralRotation:
    """The rotating limit cycle of the linear law at ``omega`` [rad/s], to about ``digits`` digits of its period.

    Raises InputError for a speed that is not positive, NoSuchCycleError where collocation finds none.
    """
    parameters.refuse_smooth("spectral collocation is")
    speed = checked_speed(omega)
    checked_digits(digits)
    start = _first(parameters, float(speed), stable)
    count = _count_for(start, digits)
    rough = _rotation_numbers(parameters, speed, start, count, digits)
    sharp = _rotation_numbers(parameters, speed, start, _odd(_MORE * count), digits + _FINER)
    return SpectralRotation(speed, count, **_apart(rough, sharp))


def spectral_fold(parameters: Parameters, *, digits: int = 12) -> SpectralFold:
    """The fold of the linear law's rotating limit cycles, to about ``digits`` digits.

    Raises NoSuchCycleError where collocation finds none.
    """
    parameters.refuse_smooth("spectral collocation is")
    checked_digits(digits)
    start, omega = _near_fold(parameters)
    count = _count_for(start, digits)
    rough = _fold_numbers(parameters, omega, start, count, digits)
    sharp = _fold_numbers(parameters, omega, start, _odd(_MORE * count), digits + _FINER)
    return SpectralFold(count, **_apart(rough, sharp))


def _apart(rough: dict[str, Any], sharp: dict[str, Any]) -> dict[str, Measured]:
    return {name: Measured.compared(value, sharp[name], Fraction(0)) for name, value in rough.items()}


def _odd(count: float) -> int:
    return 2 * math.ceil(count / 2) + 1


def _count_for(start: _Samples, digits: int) -> int:
    """So many samples as the decay of the harmonics needs for the digits."""
    sizes = numpy.abs(numpy.fft.rfft(start.resampled(4 * _FEWEST + 1).beta))
    # Harmonics of the first guess stand above rounding up to some twenty.
    factor = (sizes[20] / sizes[5]) ** (1 / 15)
    return min(_MOST, _odd(2 * (digits + 3) * math.log(10) / -math.log(factor)))


# --------------------------------------------------------------------------------------------- the first guess
def _rolling(parameters: Parameters, omega: float, lean: float, count: int) -> _Samples:
    """A rotation of the rolling disk, which conserves (r + e sin gamma) sin beta; beta_bar = lean at the bottom."""
    r, e = float(parameters.r), float(parameters.e)
    gamma = numpy.linspace(0.0, 2 * math.pi, 4001)  # gamma_bar, from the top
    beta = numpy.arccos((r - e) * math.cos(lean) / (r + e * numpy.cos(gamma)))
    pace = 1 / (omega * numpy.sin(beta))
    times = numpy.concatenate(([0.0], numpy.cumsum((pace[1:] + pace[:-1]) / 2 * numpy.diff(gamma))))
    at = numpy.arange(count) / count * times[-1]
    return _Samples(numpy.interp(at, times, beta), 2 * math.pi / float(times[-1]))


_LEANS = (0.04, 0.08, 0.02, 0.12, 0.2, 0.35, 0.6)  # rad; the first ones lead to the stable cycle, the last to the other


def _first(parameters: Parameters, omega: float, stable: bool) -> _Samples:
    """The cycle in double on few samples: the stable one, or the unstable one.

    Raises NoSuchCycleError where Newton's iteration leads from none of the rolling disk's rotations to it.
    """
    for lean in _LEANS if stable else _LEANS[::-1]:
        cycle = _solved_in_double(parameters, omega, _rolling(parameters, omega, lean, _FEWEST))
        if cycle is not None:
            exponent, _, _ = _exponent_in_double(_Arithmetic(parameters, _FEWEST), cycle, omega)
            if (exponent < 0) == stable:
                return cycle
    raise NoSuchCycleError(f"collocation finds no {'stable' if stable else 'unstable'} rotating cycle here")


def _solved_in_double(parameters: Parameters, omega: float, start: _Samples) -> _Samples | None:
    """Newton's iteration at fixed Omega; None if it does not converge to a cycle that leans to one side."""
    a = _Arithmetic(parameters, len(start.beta))
    guess = start
    for _ in range(_MOST_PASSES):
        try:
            step = numpy.linalg.solve(guess.matrix(a, omega), guess.residual(a, omega))
        except numpy.linalg.LinAlgError:
            return None
        size = float(abs(step[:-1]).max())
        share = min(1.0, _LONGEST_STEP / size)
        guess = _Samples(guess.beta - share * step[:-1], guess.frequency - share * step[-1])
        if not (numpy.isfinite(guess.beta).all() and guess.beta.min() > 0 and guess.beta.max() < math.pi / 2):
            return None
        if size < _SETTLED:
            return guess
    return None


def _sharpened(a: _Arithmetic, speed: Any, start: _Samples, parameters: Parameters) -> _Samples:
    """The cycle in an arithmetic above double, by passes with the derivative in double."""
    from scipy.linalg import lu_factor, lu_solve

    double = _solved_in_double(parameters, float(speed), start.resampled(a.count))
    if double is None:
        raise NoSuchCycleError(f"collocation with {a.count} samples does not converge")
    factored = lu_factor(double.matrix(_Arithmetic(parameters, a.count), float(speed)))
    cycle = _Samples(a.number(double.beta), a.number(double.frequency))

    def step() -> Any:
        nonlocal cycle
        change = _scaled_step(lambda right: lu_solve(factored, right), cycle.residual(a, speed), a)
        cycle = _Samples(cycle.beta - change[:-1], cycle.frequency - change[-1])
        return change

    _settled(step, a)
    return cycle


def _scaled_step(solve: Any, residual: Any, a: _Arithmetic) -> Any:
    """A Newton step for a residual of any size: scaled to one, solved in double, scaled back."""
    scale = max(abs(part) for part in residual)
    if not scale:
        return numpy.array([a.ctx.mpf(0)] * len(residual))
    return numpy.array([scale * a.ctx.mpf(float(part)) for part in solve((residual / scale).astype(float))])


def _settled(step: Any, a: _Arithmetic) -> None:
    """Passes until they no longer shrink. Raises NoSuchCycleError if they never do so below what doubles see."""
    previous = math.inf
    for _ in range(_MOST_PASSES):
        size = max(abs(part) for part in step())
        if not size or (size >= previous / 2 and size < _SETTLED):
            return
        previous = min(previous, size)
    raise NoSuchCycleError(f"collocation with {a.count} samples does not settle")


def _rotation_numbers(parameters: Parameters, speed: Fraction, start: _Samples, count: int, digits: int) -> Any:
    a = _Arithmetic(parameters, count, digits + _GUARD)
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
def _variation(a: _Arithmetic, cycle: _Samples, omega: Any, mode: tuple[Any, Any], exponent: Any) -> tuple[Any, Any]:
    """What a mode (delta beta, delta gamma) exp(exponent * angle) leaves of the variational equation."""
    by_beta, by_gamma, by_v = cycle.slopes(a, omega)
    beta, gamma = mode
    w = cycle.frequency
    rate = w * (a.differentiated(beta) + exponent * beta)
    turning = a.differentiated(gamma) + exponent * gamma - omega / w * a.cos(cycle.beta) * beta
    return turning, w * (a.differentiated(rate) + exponent * rate) - by_beta * beta - by_gamma * gamma - by_v * rate


def _exponent_in_double(a: _Arithmetic, cycle: _Samples, omega: float) -> tuple[float, Any, Any]:
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


def _exponent(a: _Arithmetic, cycle: _Samples, omega: Any, parameters: Parameters) -> Any:
    """The slow Floquet exponent in the arithmetic of the cycle, in units of the frequency."""
    from scipy.linalg import lu_factor, lu_solve

    n = a.count
    double = _Samples(cycle.beta.astype(float), float(cycle.frequency))
    plain = _Arithmetic(parameters, n)
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
        for h in (_DIFFERENCE, -_DIFFERENCE)
    )
    rows[: 2 * n, 2 * n] = (ahead - behind) / (2 * _DIFFERENCE)
    rows[2 * n, largest] = 1.0
    factored = lu_factor(rows)
    beta, gamma, exponent = a.number(mode[0]), a.number(mode[1]), a.number(start)

    def step() -> Any:
        nonlocal beta, gamma, exponent
        residual = numpy.concatenate((*_variation(a, cycle, omega, (beta, gamma), exponent), [beta[largest] - 1]))
        change = _scaled_step(lambda right: lu_solve(factored, right), residual, a)
        beta, gamma, exponent = beta - change[:n], gamma - change[n : 2 * n], exponent - change[-1]
        return change

    _settled(step, a)
    return exponent


# ---------------------------------------------------------------------------------------------------- the fold
def _near_fold(parameters: Parameters) -> tuple[_Samples, float]:
    """A cycle and its speed next to the fold, by following the unstable ones towards smaller leans."""
    omega = float(omega_crit(parameters, 20).value)
    cycle = _first(parameters, omega, stable=False)
    a = _Arithmetic(parameters, _FEWEST)
    while True:
        mean = float(cycle.beta.mean())
        ahead = _at_mean(a, cycle, omega, mean * _SHORTER)
        if ahead is None:
            raise NoSuchCycleError("collocation finds no fold of the rotating cycles")
        if ahead[1] > omega:
            return cycle, omega
        cycle, omega = ahead


def _at_mean(a: _Arithmetic, start: _Samples, omega: float, mean: float) -> tuple[_Samples, float] | None:
    """The cycle of a given mean lean, with Omega as an unknown; None if Newton's iteration does not converge."""
    n = a.count
    cycle = start
    for _ in range(_MOST_PASSES):
        rows = numpy.zeros((n + 2, n + 2))
        rows[: n + 1, : n + 1] = cycle.matrix(a, omega)
        rows[: n + 1, n + 1] = _by_omega(a, cycle, omega)
        rows[n + 1, :n] = 1 / n
        step = numpy.linalg.solve(rows, numpy.append(cycle.residual(a, omega), cycle.beta.mean() - mean))
        cycle, omega = _Samples(cycle.beta - step[:n], cycle.frequency - step[n]), omega - float(step[n + 1])
        if not numpy.isfinite(step).all() or not cycle.beta.min() > 0:
            return None
        if abs(step).max() < _SETTLED:
            return cycle, omega
    return None


def _by_omega(a: _Arithmetic, cycle: _Samples, omega: float) -> Any:
    ahead, behind = (cycle.residual(a, omega + h) for h in (_DIFFERENCE, -_DIFFERENCE))
    return (ahead - behind) / (2 * _DIFFERENCE)


def _fold_numbers(parameters: Parameters, omega: float, start: _Samples, count: int, digits: int) -> Any:
    """The fold by Newton's iteration for cycle, speed and null vector, with the derivative in double."""
    from scipy.linalg import lu_factor, lu_solve

    plain, n = _Arithmetic(parameters, count), count
    cycle, speed = start.resampled(n), omega
    rows = cycle.matrix(plain, speed)
    null = numpy.linalg.svd(rows)[2][-1]
    null /= abs(null).max() * numpy.sign(null[abs(null).argmax()])
    for _ in range(_MOST_PASSES):
        system, residual = _fold_system(plain, cycle, speed, null)
        step = numpy.linalg.solve(system, residual)
        cycle = _Samples(cycle.beta - step[:n], cycle.frequency - step[n])
        speed, null = speed - float(step[n + 1]), null - step[n + 2 :]
        if abs(step).max() < _SETTLED_FOLD:
            break
    else:
        raise NoSuchCycleError("the collocation of the fold does not converge")
    factored = lu_factor(_fold_system(plain, cycle, speed, null)[0])
    a = _Arithmetic(parameters, count, digits + _GUARD)
    sharp, wide, mode = _Samples(a.number(cycle.beta), a.number(cycle.frequency)), a.number(speed), a.number(null)
    largest = int(abs(null).argmax())

    def step_above() -> Any:
        nonlocal sharp, wide, mode
        along = sharp.along(a, wide, _Samples(mode[:n], mode[n]))
        right = numpy.concatenate((sharp.residual(a, wide), along, [mode[largest] - 1]))
        change = _scaled_step(lambda part: lu_solve(factored, part), right, a)
        sharp = _Samples(sharp.beta - change[:n], sharp.frequency - change[n])
        wide, mode = wide - change[n + 1], mode - change[n + 2 :]
        return change

    _settled(step_above, a)
    _, v = sharp.motion(a, wide)
    change = _Samples(mode[:n], mode[n])
    rate = sharp.frequency * a.differentiated(change.beta)[0] + change.frequency * a.differentiated(sharp.beta)[0]
    return {
        "omega": wide,
        "period": 2 * a.pi / sharp.frequency,
        "beta_bar_top": sharp.beta[0],
        "v_top": v[0],
        "null_vector": rate / change.beta[0],
    }


def _fold_system(a: _Arithmetic, cycle: _Samples, omega: float, null: Any) -> tuple[Any, Any]:
    """Derivative (2 n + 3 square) and residual of the fold's equations, in double."""
    n = a.count
    matrix = cycle.matrix(a, omega)

    def along(beta: Any, frequency: float, speed: float) -> Any:
        return _Samples(beta, frequency).along(a, speed, _Samples(null[:n], null[n]))

    system = numpy.zeros((2 * n + 3, 2 * n + 3))
    system[: n + 1, : n + 1] = matrix
    system[: n + 1, n + 1] = _by_omega(a, cycle, omega)
    base = numpy.append(cycle.beta, (cycle.frequency, omega))
    for column in range(n + 2):
        sides = []
        for sign in (1, -1):
            moved = base.copy()
            moved[column] += sign * _DIFFERENCE
            sides.append(along(moved[:n], float(moved[n]), float(moved[n + 1])))
        system[n + 1 : 2 * n + 2, column] = (sides[0] - sides[1]) / (2 * _DIFFERENCE)
    system[n + 1 : 2 * n + 2, n + 2 :] = matrix
    largest = int(abs(null).argmax())
    system[2 * n + 2, n + 2 + largest] = 1.0
    right = numpy.concatenate((cycle.residual(a, omega), matrix @ null, [null[largest] - 1]))
    return system, right
