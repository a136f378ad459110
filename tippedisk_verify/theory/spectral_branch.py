"""The branch of balanced cycles in double: from the Hopf point along the branch, past folds, to a given speed.

The unknowns are beta_bar at the points of half a period and the angular frequency; the equations are those of motion at
the points. The stopping rules are not those of shooting: the two methods share nothing, so that their agreement tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import Ops, field, jacobian, shifted
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.theory.harmonic_balance import slopes
from tippedisk_verify.theory.hopf import criticality, omega_crit, period_crit
from tippedisk_verify.theory.odd_fourier import Samples, double_operators, motion

__all__ = ["MOST_HARMONICS", "branch_to", "derivatives", "fixed_omega", "newton", "residuals", "unconverged"]

MOST_HARMONICS = 1024
_FIRST_HARMONICS = 12
_LARGEST_AMPLITUDE = 1.5  # rad; the disk lies flat at pi/2
_COMPLEX_STEP = 1e-40
# Near the connection a step brings the speed closer to Omega_h by a factor, so one that goes for a speed on the branch
# covers a good part of what is left; where the periods are already _LONG times that at birth and a step covers less
# than this part of the way, the speed lies beyond the end.
_LONG, _STANDING = 4.0, 1e-4
_NOWHERE = "no limit cycle found at Omega = {:.12g} rad/s"

_DOUBLE_OPS = shifted(numpy)


def residuals(constants: Any, omega: Any, guess: Samples, matrices: tuple[Any, Any], ops: Ops, sin: Any) -> Any:
    """v' minus the acceleration at the points [rad/s^2]."""
    gamma, v = motion(guess.beta, guess.frequency, omega, matrices, sin)
    rate = field(ops, constants, omega, "linear")(guess.beta, gamma, v)[2]
    return guess.frequency * (matrices[0] @ v) - rate


def derivatives(constants: Constants, omega: float, guess: Samples) -> tuple[Any, Any, Any]:
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


def newton(parameters: Parameters, omega: float, guess: Samples) -> Samples:
    """Newton's method at fixed Omega; the first point stays at beta_bar = 0."""
    constants = parameters.at(DOUBLE)
    amplitude = abs(guess.beta).max()
    best = math.inf
    for _ in range(30):
        matrix, by_frequency, _ = derivatives(constants, omega, guess)
        residual = residuals(constants, omega, guess, double_operators(guess.harmonics), _DOUBLE_OPS, numpy.sin)
        step = _solved(fixed_omega(matrix, by_frequency), residual)
        guess = Samples(numpy.concatenate(([0.0], guess.beta[1:] - step[1:])), guess.frequency - step[0])
        size = abs(step[1:]).max() / amplitude + abs(step[0]) / abs(guess.frequency)
        if not math.isfinite(size) or abs(guess.beta).max() < amplitude / 4 or guess.frequency <= 0:
            raise NoSuchCycleError(unconverged(guess.harmonics))
        if size < 1e-11 or (size >= best and best < 1e-6):  # quadratic, then stopped by rounding
            return guess
        best = min(best, size)
    raise NoSuchCycleError(unconverged(guess.harmonics))


def unconverged(count: int) -> str:
    return f"the balance did not converge with {count} harmonics: try more, or a speed further from Omega_h"


def fixed_omega(matrix: Any, by_frequency: Any) -> Any:
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
        matrix, by_frequency, by_omega = derivatives(constants, omega, guess)
        residual = residuals(constants, omega, guess, double_operators(guess.harmonics), _DOUBLE_OPS, numpy.sin)
        system = numpy.zeros((n + 1, n + 1))
        system[:n, :n] = fixed_omega(matrix, by_frequency)
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
    raise NoSuchCycleError(unconverged(guess.harmonics))


def branch_to(parameters: Parameters, target: Fraction, harmonics: int | None) -> Samples:
    """The cycle at the speed, on the branch from the Hopf point. Raises NoSuchCycleError if it does not lead there."""
    crit = omega_crit(parameters, 40).value
    distance = float(crit - target)
    side = {"supercritical": 1, "subcritical": -1}.get(criticality(parameters), 0)
    nowhere = _NOWHERE.format(float(target))
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
        return newton(parameters, float(target), by_the_law(predicted).guess)
    first = by_the_law(0.02)
    here = _on_plane(parameters, first, _difference(first, birth))
    before, here = _around(parameters, birth, here, float(target), harmonics)
    before = before.resampled(here.guess.harmonics)
    share = (float(target) - before.omega) / (here.omega - before.omega)
    return newton(parameters, float(target), before.towards(here, share).guess)


def _around(
    parameters: Parameters, birth: _Point, here: _Point, target: float, harmonics: int | None
) -> tuple[_Point, _Point]:
    """Two neighbouring points of the branch with the speed between them.

    Pseudo-arclength steps pass folds, and leave the trivial solution behind for good.
    """
    nowhere, before = _NOWHERE.format(target), birth
    length = 2.0  # the next step, in units of the last one
    for _ in range(120):
        if (here.omega - target) * (before.omega - target) <= 0 and before is not birth:
            return before, here
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
            if harmonics is None and here.guess.harmonics < MOST_HARMONICS // 4:
                here = here.resampled(here.guess.harmonics * 3 // 2)
            continue
        before, here = here, _grown(ahead, harmonics)
        left = abs(here.omega - target)
        if here.guess.frequency < birth.guess.frequency / _LONG and abs(here.omega - before.omega) < _STANDING * left:
            raise NoSuchCycleError(f"{nowhere}: the branch ends near {here.omega:.8g} rad/s, in ever longer periods")
        length = min(1.3, 2 * length)
    raise NoSuchCycleError(f"{nowhere} within 120 steps along the branch")


def _difference(here: _Point, before: _Point) -> _Point:
    guess = Samples(here.guess.beta - before.guess.beta, here.guess.frequency - before.guess.frequency)
    return _Point(guess, here.omega - before.omega)


def _grown(point: _Point, fixed: int | None) -> _Point:
    """More harmonics once the last ones are no longer small; the answer itself is sharpened later."""
    sizes = numpy.hypot(*point.guess.coefficients())
    if fixed is None and sizes[-2:].max() > 1e-6 * sizes[0] and point.guess.harmonics < MOST_HARMONICS // 4:
        return point.resampled(point.guess.harmonics * 3 // 2)
    return point
