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

from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.model.equations import Ops, checked_speed, field, jacobian, shifted
from tippedisk_verify.model.exact import quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits, checked_digits
from tippedisk_verify.theory.harmonic_balance import slopes
from tippedisk_verify.theory.hopf import criticality, omega_crit, period_crit
from tippedisk_verify.theory.odd_fourier import OddSeries, Samples, double_operators, motion, operators

__all__ = ["BalancedCycle", "approximate_cycle", "balanced_cycle"]

_MOST_HARMONICS = 1024
_FIRST_HARMONICS = 12
_LARGEST_AMPLITUDE = 1.5  # rad; the disk lies flat at pi/2
_COMPLEX_STEP = 1e-40
_JACOBIAN = 1e-10  # the relative error of a Jacobian taken at the double solution
# Near the connection a step brings the speed closer to Omega_h by a factor, so one that goes for a speed on the branch
# covers a good part of what is left; where the periods are already _LONG times that at birth and a step covers less
# than this part of the way, the speed lies beyond the end.
_LONG, _STANDING = 4.0, 1e-4
_WORTHLESS = 0.01  # a relative truncation estimate above this says that there may be no cycle at all


@dataclass(frozen=True)
class BalancedCycle:
    """A limit cycle from harmonic balance; every number with a half-width from the truncation estimate."""

    omega: Fraction  #: the spinning speed [rad/s]
    harmonics: int  #: number of odd harmonics
    period: Measured  #: T [s]
    gamma_bar_0: Measured  #: gamma - pi/2 at beta = pi/2, v < 0 [rad]
    v_0: Measured  #: v there [rad/s]
    beta_max: Measured  #: largest |beta - pi/2| [rad]
    decay: float  #: factor by which the harmonics' amplitudes fall from one odd harmonic to the next
    amplitudes: tuple[float, ...]  #: of the odd harmonics of beta_bar [rad]

    def json(self) -> dict[str, object]:
        measured = {name: getattr(self, name).json() for name in ("period", "gamma_bar_0", "v_0", "beta_max")}
        return {
            "omega": Measured(self.omega, Fraction(0)).json(),
            "harmonics": self.harmonics,
            **measured,
        }


def balanced_cycle(
    parameters: Parameters, omega: object, *, digits: int = 12, harmonics: int | None = None
) -> BalancedCycle:
    """The limit cycle of the linear law at the speed ``omega`` [rad/s], to ``digits`` significant digits of its period.

    ``harmonics`` fixes the number of odd harmonics; otherwise it grows until the truncation estimate allows the digits.
    Raises InputError for a speed that is not positive or harmonics outside 1 ... 1024; NoSuchCycleError if there is no
    cycle at this speed or the balance does not converge.
    """
    parameters.refuse_smooth("harmonic balance is")
    speed = checked_speed(omega)
    if harmonics is not None and not (isinstance(harmonics, int) and 1 <= harmonics <= _MOST_HARMONICS):
        raise InputError(f"the number of harmonics lies between 1 and {_MOST_HARMONICS}, not {shown(harmonics)}")
    checked_digits(digits)
    start = _followed(parameters, speed, harmonics)
    count = start.harmonics
    while True:
        cycle, missing = _sharpened(parameters, speed, start, digits)
        if harmonics is not None or missing <= 0:
            return cycle
        if count >= _MOST_HARMONICS:
            raise NoSuchCycleError(
                f"the balance did not converge with {count} harmonics: this close to Omega_h use shooting"
            )
        # So many harmonics more as the decay needs for the digits that are missing, and a tenth for the estimate.
        lost = -math.log10(cycle.decay)
        count = min(_MOST_HARMONICS, int((count + missing / lost + 2) * 1.1))
        start = start.resampled(count)
        start = _newton(parameters, float(speed), start)


def approximate_cycle(parameters: Parameters, omega: Fraction) -> tuple[float, float]:
    """(gamma_bar, v) at beta = pi/2, v < 0, of the limit cycle at ``omega``, good enough to start shooting from.

    Raises NoSuchCycleError as `balanced_cycle` does.
    """
    guess = _followed(parameters, omega, None)
    gamma, v = motion(guess.beta, guess.frequency, float(omega), double_operators(guess.harmonics), numpy.sin)
    return float(gamma[0]), float(v[0])


# ------------------------------------------------------------------------------------------ the discrete problem
_DOUBLE_OPS = shifted(numpy)


def _residual(constants: Any, omega: Any, guess: Samples, matrices: tuple[Any, Any], ops: Ops, sin: Any) -> Any:
    """v' minus the acceleration at the points [rad/s^2]."""
    gamma, v = motion(guess.beta, guess.frequency, omega, matrices, sin)
    rate = field(ops, constants, omega, "linear")(guess.beta, gamma, v)[2]
    return guess.frequency * (matrices[0] @ v) - rate


def _derivatives(constants: Constants, omega: float, guess: Samples) -> tuple[Any, Any, Any]:
    """d(residual)/d(beta), /d(frequency) and /d(Omega), in double."""
    slope, integral = double_operators(guess.harmonics)
    gamma, v = motion(guess.beta, guess.frequency, omega, (slope, integral), numpy.sin)
    by_beta, by_gamma, by_v = jacobian(_DOUBLE_OPS, constants, omega, "linear")(guess.beta, gamma, v)[2]
    matrix = guess.frequency**2 * (slope @ slope) - by_v[:, None] * guess.frequency * slope
    matrix -= (by_gamma * omega / guess.frequency)[:, None] * integral * numpy.cos(guess.beta)
    matrix[numpy.diag_indices_from(matrix)] -= by_beta
    change = slope @ guess.beta
    by_frequency = 2 * guess.frequency * (slope @ change) + by_gamma * gamma / guess.frequency - by_v * change
    stepped = field(_DOUBLE_OPS, constants, complex(omega, _COMPLEX_STEP), "linear")
    explicit = stepped(guess.beta, gamma, v)[2].imag / _COMPLEX_STEP
    return matrix, by_frequency, -explicit - by_gamma * gamma / omega


# ------------------------------------------------------------------------------------------------ double precision
def _newton(parameters: Parameters, omega: float, guess: Samples) -> Samples:
    """Newton's method at fixed Omega; the first point stays at beta_bar = 0.

    The stopping rules here are not those of shooting: the two methods share nothing, so that their agreement tells.
    """
    constants = parameters.at(DOUBLE)
    amplitude = abs(guess.beta).max()
    best = math.inf
    for _ in range(30):
        matrix, by_frequency, _ = _derivatives(constants, omega, guess)
        residual = _residual(constants, omega, guess, double_operators(guess.harmonics), _DOUBLE_OPS, numpy.sin)
        step = _solved(_fixed_omega(matrix, by_frequency), residual)
        guess = Samples(numpy.concatenate(([0.0], guess.beta[1:] - step[1:])), guess.frequency - step[0])
        size = abs(step[1:]).max() / amplitude + abs(step[0]) / abs(guess.frequency)
        if not math.isfinite(size) or abs(guess.beta).max() < amplitude / 4 or guess.frequency <= 0:
            raise NoSuchCycleError(_unconverged(guess.harmonics))
        if size < 1e-11 or (size >= best and best < 1e-6):  # quadratic, then stopped by rounding
            return guess
        best = min(best, size)
    raise NoSuchCycleError(_unconverged(guess.harmonics))


def _unconverged(count: int) -> str:
    return f"the balance did not converge with {count} harmonics: try more, or a speed further from Omega_h"


def _fixed_omega(matrix: Any, by_frequency: Any) -> Any:
    """The square system at fixed Omega: the first point's column is the frequency's, for its value is fixed."""
    system = matrix.copy()
    system[:, 0] = by_frequency
    return system


def _solved(matrix: Any, right: Any) -> Any:
    try:
        return numpy.linalg.solve(matrix, right)
    except numpy.linalg.LinAlgError:
        raise NoSuchCycleError("the balance's equations are singular here: move Omega a little") from None


@dataclass(frozen=True)
class _Point:
    """A cycle and its speed: a point of the branch in the space of (beta_bar at the points, frequency, Omega)."""

    guess: Samples
    omega: float

    def resampled(self, count: int) -> _Point:
        return self if self.guess.harmonics == count else _Point(self.guess.resampled(count), self.omega)

    def towards(self, other: _Point, share: float) -> _Point:
        """The point that divides the way to ``other`` (of as many harmonics) by ``share``, beyond it above 1."""
        mine, theirs = self.guess, other.guess
        return _Point(
            Samples(
                mine.beta + share * (theirs.beta - mine.beta),
                mine.frequency + share * (theirs.frequency - mine.frequency),
            ),
            self.omega + share * (other.omega - self.omega),
        )


def _on_plane(parameters: Parameters, start: _Point, normal: _Point) -> _Point:
    """Newton's method from ``start``, within the plane through it that has the given normal, with Omega unknown.

    Frequency and speed are measured in units of their own size, beta_bar by its root mean square.
    """
    constants = parameters.at(DOUBLE)
    n = len(start.guess.beta)
    units = numpy.concatenate(([start.guess.frequency], numpy.full(n - 1, math.sqrt(n)), [start.omega]))
    direction = numpy.concatenate(([normal.guess.frequency], normal.guess.beta[1:], [normal.omega])) / units**2
    guess, omega = start.guess, start.omega
    away = numpy.zeros(n + 1)
    for _ in range(12):
        matrix, by_frequency, by_omega = _derivatives(constants, omega, guess)
        residual = _residual(constants, omega, guess, double_operators(guess.harmonics), _DOUBLE_OPS, numpy.sin)
        system = numpy.zeros((n + 1, n + 1))
        system[:n, :n] = _fixed_omega(matrix, by_frequency)
        system[:n, n] = by_omega
        system[n] = direction
        step = _solved(system, numpy.concatenate((residual, [direction @ away])))
        away = away - step
        guess = Samples(numpy.concatenate(([0.0], guess.beta[1:] - step[1:n])), guess.frequency - step[0])
        omega -= step[n]
        size = numpy.linalg.norm(step / units) / max(abs(guess.beta).max(), 1e-300)
        if not (math.isfinite(size) and guess.frequency > 0 and omega > 0):
            break
        if size < 1e-8:
            return _Point(guess, float(omega))
    raise NoSuchCycleError(_unconverged(guess.harmonics))


def _followed(parameters: Parameters, target: Fraction, harmonics: int | None) -> Samples:
    """Follow the branch from the Hopf point until it reaches the speed, then settle there.

    Pseudo-arclength steps pass folds, and leave the trivial solution behind for good.
    """
    crit = omega_crit(parameters, 40).value
    distance = float(crit - target)
    side = {"supercritical": 1, "subcritical": -1}.get(criticality(parameters), 0)
    nowhere = f"no limit cycle found at Omega = {float(target):.12g} rad/s"
    if distance * side <= 0:
        word = {1: "below", -1: "above"}.get(side, "far from")
        raise NoSuchCycleError(f"{nowhere}: cycles are born {word} Omega_crit = {float(crit):.12g} rad/s")
    square_slope = abs(float(slopes(parameters.with_friction("linear"), "consistent")[0]))
    predicted = math.sqrt(square_slope * abs(distance))
    count = harmonics or _FIRST_HARMONICS
    angles = numpy.pi * numpy.arange(2 * count) / (2 * count)
    birth = _Point(Samples(0 * angles, 2 * math.pi / float(period_crit(parameters))), float(crit))

    def by_the_law(amplitude: float) -> _Point:
        guess = Samples(-amplitude * numpy.sin(angles), birth.guess.frequency)
        return _Point(guess, float(crit) - side * amplitude**2 / square_slope)

    if abs(distance) < 1e-9 * float(crit):
        raise NoSuchCycleError(
            f"{nowhere}: within 1e-9 of Omega_crit double precision cannot start the balance; use the law of hopf"
        )
    if predicted <= 0.02:  # the law is a better guess than a branch could make
        return _newton(parameters, float(target), by_the_law(predicted).guess)
    first = by_the_law(0.02)
    before, here = birth, _on_plane(parameters, first, _difference(first, birth))
    length = 2.0  # the next step, in units of the last one
    for _ in range(120):
        if (here.omega - float(target)) * (before.omega - float(target)) <= 0 and before is not birth:
            break
        if abs(here.guess.beta).max() > _LARGEST_AMPLITUDE:
            raise NoSuchCycleError(f"{nowhere} before its amplitude is that of a flat disk")
        before = before.resampled(here.guess.harmonics)
        ahead = before.towards(here, 1 + length)
        try:
            ahead = _on_plane(parameters, ahead, _difference(here, before))
        except NoSuchCycleError:
            # Too long a step, or too few harmonics for what the cycle has become: mend both.
            length /= 2
            if length < 1e-3:
                raise
            if harmonics is None and here.guess.harmonics < _MOST_HARMONICS // 4:
                here = here.resampled(here.guess.harmonics * 3 // 2)
            continue
        before, here = here, _grown(ahead, harmonics)
        left = abs(here.omega - float(target))
        if here.guess.frequency < birth.guess.frequency / _LONG and abs(here.omega - before.omega) < _STANDING * left:
            raise NoSuchCycleError(f"{nowhere}: the branch ends near {here.omega:.8g} rad/s, in ever longer periods")
        length = min(1.3, 2 * length)
    else:
        raise NoSuchCycleError(f"{nowhere} within 120 steps along the branch")
    before = before.resampled(here.guess.harmonics)
    share = (float(target) - before.omega) / (here.omega - before.omega)
    return _newton(parameters, float(target), before.towards(here, share).guess)


def _difference(here: _Point, before: _Point) -> _Point:
    guess = Samples(here.guess.beta - before.guess.beta, here.guess.frequency - before.guess.frequency)
    return _Point(guess, here.omega - before.omega)


def _grown(point: _Point, fixed: int | None) -> _Point:
    """More harmonics once the last ones are no longer small; the answer itself is sharpened later."""
    sizes = numpy.hypot(*point.guess.coefficients())
    if fixed is None and sizes[-2:].max() > 1e-6 * sizes[0] and point.guess.harmonics < _MOST_HARMONICS // 4:
        return point.resampled(point.guess.harmonics * 3 // 2)
    return point


# ---------------------------------------------------------------------------------------------- any number of digits
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
        step = _corrected(system, _residual(constants, speed, sharp, matrices, ops, sin), ctx)
        sharp = Samples(sharp.beta - numpy.concatenate(([ctx.mpf(0)], step[1:])), sharp.frequency - step[0])
        size = max(*(abs(part) / amplitude for part in step[1:]), abs(step[0]) / sharp.frequency)
        if size < ctx.mpf(10) ** (-digits - 10) or size >= previous / 2:
            break
        previous = size
    if size > ctx.mpf(10) ** (-digits - 4):
        raise NoSuchCycleError(_unconverged(guess.harmonics))
    return _measured(parameters, omega, sharp, digits)


def _tools(parameters: Parameters, omega: Fraction, digits: int) -> tuple[Any, Constants, Any, Any, Any]:
    """An arithmetic of that many digits: its context, the constants and the speed in it, and its sines."""
    ctx = bits(bits_for_digits(digits)).context
    constants = parameters.within(ctx)
    sin, cos = (numpy.frompyfunc(function, 1, 1) for function in (ctx.sin, ctx.cos))
    return ctx, constants, quotient(ctx, omega), shifted(SimpleNamespace(sin=sin, cos=cos)), sin


def _factored(parameters: Parameters, omega: float, guess: Samples) -> Any:
    from scipy.linalg import lu_factor

    matrix, by_frequency, _ = _derivatives(parameters.at(DOUBLE), omega, guess)
    return lu_factor(_fixed_omega(matrix, by_frequency))


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
        _factored(parameters, float(omega), double), _residual(constants, speed, fine, twice, ops, sin), ctx
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
        raise NoSuchCycleError(_unconverged(count))

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
