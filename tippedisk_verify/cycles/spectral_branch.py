"""Spectral cycles in double: Newton's iteration, the branch through folds, and where both kinds of cycles start.

A point of a branch is an array of n + 2: beta_bar at the samples, frequency and Omega. One Newton iteration solves for
it within a plane: that of a speed, that across the branch, or that of a mean lean. The stopping rules are not those of
shooting: the two methods share nothing, so that their agreement tells.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.fourier import MOST_SAMPLES, Collocation, Kind, resampled, sizes
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.hopf import amplitude_law, omega_crit, period_crit

__all__ = ["branch_to", "fold_near", "fold_system", "librating_branch", "newton", "unconverged", "walk"]

_FIRST_SAMPLES = 24
_MOST_PASSES, _FEW_PASSES = 60, 12  # from a rough guess, and along a branch, where a shorter step mends a failure
_LONGEST_STEP = 0.3  # rad
_LARGEST_AMPLITUDE = 1.5  # rad; the disk lies flat at pi/2
_DIFFERENCE = 1e-6  # of a number of order one: a derivative by differences in double is then good to some 1e-10
# Near the connection a step brings the speed closer to Omega_h by a factor, so one that goes for a speed on the branch
# covers a good part of what is left; where the periods are already _LONG times that at birth and a step covers less
# than this part of the way, the speed lies beyond the end.
_LONG, _STANDING = 4.0, 1e-4
_ROUNDING = 1e-9  # of Omega: smaller turns are those of rounding next to the connection
_MOST_STEPS = 120
_NOWHERE = "no limit cycle found at Omega = {:.12g} rad/s"


def unconverged(kind: Kind, samples: int) -> NoSuchCycleError:
    if kind is Kind.ROTATING:
        return NoSuchCycleError(f"collocation with {samples} samples does not converge")
    return NoSuchCycleError(
        f"the balance did not converge with {samples // 2} harmonics: try more, or a speed further from Omega_h"
    )


def newton(a: Collocation, start: Any, normal: Any = None, most: int = _MOST_PASSES) -> Any | None:
    """The cycle in the plane through ``start`` with the given normal, by default that of its speed.

    None if the iteration does not converge, or loses what makes a cycle of this kind.
    """
    n = a.count
    if normal is None:
        normal = numpy.eye(1, n + 2, n + 1)[0]
    amplitude = abs(start[:n]).max()
    point, best = start, math.inf
    for _ in range(most):
        rows = numpy.vstack((a.matrix(point[:-1], point[-1]), normal))
        right = numpy.append(a.residual(point[:-1], point[-1]), normal @ (point - start))
        try:
            step = numpy.linalg.solve(rows, right)
        except numpy.linalg.LinAlgError:  # even at a fold an oblique plane leaves it regular: there are too few samples
            return None
        longest = abs(step[:n]).max()
        point = point - min(1.0, _LONGEST_STEP / max(longest, 1e-300)) * step
        size = longest / amplitude + abs(step[n:] / point[n:]).max()
        if not math.isfinite(size) or not _is_cycle(a.kind, point, amplitude):
            return None
        settled = 1e-8 if most == _FEW_PASSES else 1e-10
        if size < settled or (size >= best and best < 1e-6):  # quadratic, then stopped by rounding
            return point
        best = min(best, size)
    return None


def _is_cycle(kind: Kind, point: Any, amplitude: float) -> bool:
    beta = point[:-2]
    if kind is Kind.ROTATING:  # leans to one side
        return bool(beta.min() > 0 and beta.max() < math.pi / 2)
    return bool(abs(beta).max() >= amplitude / 4 and (point[-2:] > 0).all())


# ------------------------------------------------------------------------------------------------ folds
def fold_system(a: Collocation, point: Any, null: Any) -> Any:
    """The derivative of a fold's equations by the point and the null vector, in double: (2 n + 3, 2 n + 3).

    The equations are the cycle's, those of a null vector of its derivative, and the size of that vector's largest
    entry. Second derivatives are symmetric: what the null vector's equations change with the point is what the matrix
    changes along the null vector.
    """
    n = a.count
    moved = (a.matrix(point[:-1] + sign * _DIFFERENCE * null, point[-1]) for sign in (1, -1))
    rows = numpy.zeros((2 * n + 3, 2 * n + 3))
    matrix = a.matrix(point[:-1], point[-1])
    rows[: n + 1, : n + 2] = matrix
    rows[n + 1 : -1, : n + 2] = (next(moved) - next(moved)) / (2 * _DIFFERENCE)
    rows[n + 1 : -1, n + 2 :] = matrix[:, :-1]
    rows[-1, n + 2 + abs(null).argmax()] = 1.0
    return rows


def fold_near(a: Collocation, start: Any) -> tuple[Any, Any] | None:
    """The fold's point and null vector in double; None if Newton's iteration leads to none."""
    n, point, best = a.count, start, math.inf
    # The branch's tangent, which is the null vector where Omega is extreme.
    null = numpy.linalg.svd(a.matrix(point[:-1], point[-1]))[2][-1][:-1]
    null = null / null[abs(null).argmax()]
    for _ in range(_FEW_PASSES):
        cycle, omega = point[:-1], point[-1]
        right = numpy.concatenate((a.residual(cycle, omega), a.along(cycle, omega, null), [abs(null).max() - 1]))
        step = numpy.linalg.solve(fold_system(a, point, null), right)
        point, null = point - step[: n + 2], null - step[n + 2 :]
        size = abs(step).max()
        if not math.isfinite(size) or size > 1e3 or not _is_cycle(a.kind, point, abs(start[:n]).max()):
            return None
        if size < 1e-7 or (size >= best and best < 1e-5):  # the fold's equations amplify rounding
            return point, null
        best = min(best, size)
    return None


# ------------------------------------------------------------------------------------------------ the branch
def walk(
    parameters: Parameters, kind: Kind, before: Any, here: Any, fixed: int | None = None
) -> Iterator[tuple[Any, bool]]:
    """The branch from its first two points on, by steps along it, with the folds; each with whether it is one.

    Pseudo-arclength steps pass folds, and leave the trivial solution behind for good. The number of samples grows,
    unless it is fixed, once the last harmonics are no longer small.
    """
    length, begin = 2.0, before[-2]  # the next step, in units of the last one, and the first frequency
    for _ in range(_MOST_STEPS):
        n = len(here) - 2
        a = Collocation(parameters, kind, n)
        before = resampled(kind, before, n)
        ahead = newton(a, here + length * (here - before), _across(here - before, here), _FEW_PASSES)
        if ahead is None:  # too long a step, or too few harmonics for what the cycle has become: mend both
            length /= 2
            if length < 1e-3:
                raise unconverged(kind, n)
            here = _grown(kind, here, fixed, 0.0)
            continue
        fold = None
        rises = (here[-1] - before[-1], ahead[-1] - here[-1])
        # Towards the connection the speed comes to rest, and then turns by rounding.
        telling = min if here[-2] < begin / _LONG else max
        if rises[0] * rises[1] < 0 and telling(map(abs, rises)) > _ROUNDING * here[-1]:
            fold = fold_near(a, here)
        behind = fold is not None and (fold[0] - here) @ (ahead - before) < 0
        if fold is not None and behind:
            yield fold[0], True
        yield here, False
        if fold is not None and not behind:
            yield fold[0], True
        before, here = here, _grown(kind, ahead, fixed, 1e-6)
        length = min(1.3, 2 * length)


def _across(direction: Any, here: Any) -> Any:
    """The direction as a normal, with frequency and speed in units of their own size, beta_bar by its mean square."""
    units = numpy.append(numpy.full(len(here) - 2, math.sqrt(len(here) - 2)), here[-2:])
    return direction / units**2


def _grown(kind: Kind, point: Any, fixed: int | None, small: float) -> Any:
    harmonics = sizes(kind, point[:-2])
    if fixed is None and harmonics[-2:].max() > small * harmonics[0] and len(point) < MOST_SAMPLES // 4:
        return resampled(kind, point, kind.samples((len(point) - 2) * 3 // 2 - 1))
    return point


# ------------------------------------------------------------------------------------------------ librating cycles
def _by_the_law(parameters: Parameters, amplitude: float, samples: int) -> Any:
    """The cycle of small amplitude [rad] by the laws at the Hopf point."""
    quadratic, quartic = (float(part) for part in amplitude_law(parameters))
    square = amplitude**2 * float((parameters.r + parameters.e) / parameters.e)  # of gamma's amplitude
    beta = -amplitude * numpy.sin(numpy.pi * numpy.arange(samples) / samples)
    speed = float(omega_crit(parameters, 40).value) * (1 + (quadratic + quartic * square) * square)
    return numpy.append(beta, (2 * math.pi / float(period_crit(parameters)), speed))


def librating_branch(parameters: Parameters, harmonics: int | None = None) -> Iterator[tuple[Any, bool]]:
    """The branch of librating cycles from the Hopf point on, as `walk` gives it."""
    samples = 2 * harmonics if harmonics else _FIRST_SAMPLES
    birth, first = (_by_the_law(parameters, amplitude, samples) for amplitude in (0.0, 0.02))
    solved = newton(Collocation(parameters, Kind.LIBRATING, samples), first, _across(first - birth, first))
    if solved is None:
        raise unconverged(Kind.LIBRATING, samples)
    return walk(parameters, Kind.LIBRATING, birth, solved, harmonics)


def branch_to(parameters: Parameters, target: Fraction, harmonics: int | None, crossing: int = 1) -> Any:
    """The librating cycle where the branch from the Hopf point crosses the speed, for the given time.

    Raises NoSuchCycleError if it does not.
    """
    crit = omega_crit(parameters, 40).value
    distance, nowhere = float(crit - target), _NOWHERE.format(float(target))
    if abs(distance) < 1e-9 * float(crit):
        raise NoSuchCycleError(
            f"{nowhere}: within 1e-9 of Omega_crit double precision cannot start the balance; use the law of hopf"
        )
    quadratic, quartic = (float(part) for part in amplitude_law(parameters))
    share = float(parameters.e / (parameters.r + parameters.e))  # of the square of gamma's amplitude is that of beta's
    squares = numpy.roots([quartic, quadratic, distance / float(crit)])
    predicted = math.sqrt(share * min((x.real for x in squares if x.real > 0 == x.imag), default=math.inf))
    if predicted <= 0.02 and crossing == 1:  # the law is a better guess than a branch could make
        guess = _by_the_law(parameters, predicted, 2 * harmonics if harmonics else _FIRST_SAMPLES)
    else:
        guess = _between(librating_branch(parameters, harmonics), float(target), crossing)
    guess[-1] = float(target)
    cycle = newton(Collocation(parameters, Kind.LIBRATING, len(guess) - 2), guess)
    if cycle is None:
        raise unconverged(Kind.LIBRATING, len(guess) - 2)
    return cycle


def _between(points: Iterator[tuple[Any, bool]], target: float, crossing: int) -> Any:
    """The point at the speed between two neighbours of the branch, at that crossing."""
    nowhere = _NOWHERE.format(target)
    before, turned = next(points)
    lowest = before[-2] / _LONG
    for here, turning in points:
        if (here[-1] - target) * (before[-1] - target) <= 0:
            crossing -= 1
            if not crossing:
                before = resampled(Kind.LIBRATING, before, len(here) - 2)
                share = (target - before[-1]) / (here[-1] - before[-1])
                # At a fold the speed changes with the square of the way.
                share = math.sqrt(share) if turned else 1 - math.sqrt(1 - share) if turning else share
                return before + share * (here - before)
        if abs(here[:-2]).max() > _LARGEST_AMPLITUDE:
            raise NoSuchCycleError(f"{nowhere} before its amplitude is that of a flat disk")
        step = abs(here[-1] - before[-1])
        if here[-2] < lowest and step < _STANDING * abs(here[-1] - target):
            raise NoSuchCycleError(f"{nowhere}: the branch ends near {here[-1]:.8g} rad/s, in ever longer periods")
        before, turned = here, turning
    raise NoSuchCycleError(f"{nowhere} within {_MOST_STEPS} steps along the branch")
