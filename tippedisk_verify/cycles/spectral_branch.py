"""The branch of balanced cycles in double: from the Hopf point along the branch, past folds, to a given speed.

The unknowns are beta_bar at the points of half a period and the angular frequency; the equations are those of motion at
the points. The stopping rules are not those of shooting: the two methods share nothing, so that their agreement tells.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.odd_fourier import Samples, double_operators, motion
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.equations import Ops, field, jacobian, shifted
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.theory.amplitude_law import amplitude_law
from tippedisk_verify.theory.hopf import omega_crit, period_crit

__all__ = ["MOST_HARMONICS", "branch_to", "derivatives", "fixed_omega", "newton", "residuals", "unconverged"]

MOST_HARMONICS = 1024
_FIRST_HARMONICS = 12
_LARGEST_AMPLITUDE = 1.5  # rad; the disk lies flat at pi/2
_COMPLEX_STEP = 1e-40
# Near the connection a step brings the speed closer to Omega_h by a factor, so one that goes for a speed on the branch
# covers a good part of what is left; where the periods are already _LONG times that at birth and a step covers less
# than this part of the way, the speed lies beyond the end.
_LONG, _STANDING = 4.0, 1e-4
_MOST_STEPS, _MOST_PARABOLAS = 120, 20
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
        try:
            step = numpy.linalg.solve(fixed_omega(matrix, by_frequency), residual)
        except numpy.linalg.LinAlgError:
            raise NoSuchCycleError("the balance's equations are singular here: move Omega a little") from None
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


@dataclass(frozen=True)
class _Point:
    """A cycle and its speed: a point of the branch in the space of (beta_bar at the points, frequency, Omega)."""

    guess: Samples
    omega: float
    turning: bool = False  #: whether Omega is extreme there

    def resampled(self, count: int) -> _Point:
        return self if self.guess.harmonics == count else replace(self, guess=self.guess.resampled(count))

    def towards(self, other: _Point, share: float) -> _Point:
        """The point that divides the way to ``other`` (of as many harmonics) by ``share``, beyond it above 1."""
        return _combined((1 - share, share), (self, other))


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
        try:
            step = numpy.linalg.solve(system, numpy.concatenate((residual, [direction @ away])))
        except numpy.linalg.LinAlgError:
            break  # even at a fold this system is regular: there are too few harmonics for a branch
        away = away - step
        guess = Samples(numpy.concatenate(([0.0], guess.beta[1:] - step[1:n])), guess.frequency - step[0])
        omega -= step[n]
        size = numpy.linalg.norm(step / units) / max(abs(guess.beta).max(), 1e-300)
        if not (math.isfinite(size) and guess.frequency > 0 and omega > 0):
            break
        if size < 1e-8:
            return _Point(guess, float(omega))
    raise NoSuchCycleError(unconverged(guess.harmonics))


def branch_to(parameters: Parameters, target: Fraction, harmonics: int | None, crossing: int = 1) -> Samples:
    """The cycle where the branch from the Hopf point crosses the speed, for the first time or as often as is said.

    Raises NoSuchCycleError if it does not.
    """
    crit = omega_crit(parameters, 40).value
    distance = float(crit - target)
    nowhere = _NOWHERE.format(float(target))
    quadratic, quartic = (float(part) for part in amplitude_law(parameters))
    share = float(parameters.e / (parameters.r + parameters.e))  # of the square of gamma's amplitude is that of beta's
    squares = numpy.roots([quartic, quadratic, distance / float(crit)])
    predicted = math.sqrt(share * min((x.real for x in squares if x.real > 0 == x.imag), default=math.inf))
    count = harmonics or _FIRST_HARMONICS
    angles = numpy.pi * numpy.arange(2 * count) / (2 * count)
    birth = _Point(Samples(0 * angles, 2 * math.pi / float(period_crit(parameters))), float(crit))

    def by_the_law(amplitude: float) -> _Point:
        guess = Samples(-amplitude * numpy.sin(angles), birth.guess.frequency)
        square = amplitude**2 / share
        return _Point(guess, float(crit) * (1 + (quadratic + quartic * square) * square))

    if abs(distance) < 1e-9 * float(crit):
        raise NoSuchCycleError(
            f"{nowhere}: within 1e-9 of Omega_crit double precision cannot start the balance; use the law of hopf"
        )
    if predicted <= 0.02 and crossing == 1:  # the law is a better guess than a branch could make
        return newton(parameters, float(target), by_the_law(predicted).guess)
    first = by_the_law(0.02)
    points = _walk(parameters, birth, _on_plane(parameters, first, _difference(first, birth)), harmonics)
    before, here = _around(points, birth, float(target), crossing)
    before = before.resampled(here.guess.harmonics)
    part = (float(target) - before.omega) / (here.omega - before.omega)
    if before.turning:  # from where the speed changes with the square of the way
        part = math.sqrt(part)
    elif here.turning:
        part = 1 - math.sqrt(1 - part)
    return newton(parameters, float(target), before.towards(here, part).guess)


def _around(points: Iterator[_Point], birth: _Point, target: float, crossing: int) -> tuple[_Point, _Point]:
    """Two neighbouring points of the branch with the speed between them, at that crossing."""
    nowhere, before = _NOWHERE.format(target), next(points)
    for here in points:
        if (here.omega - target) * (before.omega - target) <= 0:
            crossing -= 1
            if not crossing:
                return before, here
        if abs(here.guess.beta).max() > _LARGEST_AMPLITUDE:
            raise NoSuchCycleError(f"{nowhere} before its amplitude is that of a flat disk")
        left = abs(here.omega - target)
        if here.guess.frequency < birth.guess.frequency / _LONG and abs(here.omega - before.omega) < _STANDING * left:
            raise NoSuchCycleError(f"{nowhere}: the branch ends near {here.omega:.8g} rad/s, in ever longer periods")
        before = here
    raise NoSuchCycleError(f"{nowhere} within {_MOST_STEPS} steps along the branch")


def _walk(parameters: Parameters, birth: _Point, first: _Point, harmonics: int | None) -> Iterator[_Point]:
    """The branch from its first point on, by steps along it, with the points at which it turns round.

    Pseudo-arclength steps pass folds, and leave the trivial solution behind for good.
    """
    before, here = birth, first
    length = 2.0  # the next step, in units of the last one
    for _ in range(_MOST_STEPS):
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
        turn: list[_Point] = []
        after = False
        if (ahead.omega - here.omega) * (here.omega - before.omega) < 0:
            turning, after = _turn(parameters, before, here, ahead)
            turn = [turning]
        yield from [here, *turn] if after else [*turn, here]
        before, here = here, _grown(ahead, harmonics)
        length = min(1.3, 2 * length)


def _turn(parameters: Parameters, *points: _Point) -> tuple[_Point, bool]:
    """Where Omega is extreme between the first and the last of three points, and whether that is after the second.

    By parabolas through three points, the last two found and the closest on the other side.
    """
    side = 1 if points[1].omega > points[0].omega else -1
    normal = _difference(points[2], points[0])
    known = list(zip((0.0, 1.0, 1.0 + _distance(points[1], points[2]) / _distance(points[0], points[1])), points,
                     strict=True))  # fmt: skip
    while True:
        k = max(range(1, len(known) - 1), key=lambda k: side * known[k][1].omega)
        (a, before), (b, best), (c, after) = known[k - 1 : k + 2]
        rise, fall = (best.omega - before.omega) / (b - a), (best.omega - after.omega) / (c - b)
        place = (a + b) / 2 + (c - a) / 2 * rise / (rise + fall)
        gain = (rise + fall) / (c - a) * (place - b) ** 2
        if len(known) > _MOST_PARABOLAS or abs(gain) <= 4e-16 * best.omega:
            return replace(best, turning=True), b > 1.0
        weights = [
            (place - b) * (place - c) / ((a - b) * (a - c)),
            (place - a) * (place - c) / ((b - a) * (b - c)),
            (place - a) * (place - b) / ((c - a) * (c - b)),
        ]
        near = _combined(weights, (before, best, after))
        known.append((place, _on_plane(parameters, near, normal)))
        known.sort(key=lambda entry: entry[0])


def _combined(weights: Sequence[float], points: Sequence[_Point]) -> _Point:
    """The weighted sum of points of as many harmonics."""
    pairs = list(zip(weights, points, strict=True))
    guess = Samples(
        sum(weight * point.guess.beta for weight, point in pairs),
        sum(weight * point.guess.frequency for weight, point in pairs),
    )
    return _Point(guess, sum(weight * point.omega for weight, point in pairs))


def _distance(here: _Point, there: _Point) -> float:
    """The root mean square of beta_bar's difference."""
    return float(numpy.sqrt(numpy.mean((here.guess.beta - there.guess.beta) ** 2)))


def _difference(here: _Point, before: _Point) -> _Point:
    return _combined((1, -1), (here, before))


def _grown(point: _Point, fixed: int | None) -> _Point:
    """More harmonics once the last ones are no longer small; the answer itself is sharpened later."""
    sizes = numpy.hypot(*point.guess.coefficients())
    if fixed is None and sizes[-2:].max() > 1e-6 * sizes[0] and point.guess.harmonics < MOST_HARMONICS // 4:
        return point.resampled(point.guess.harmonics * 3 // 2)
    return point
