"""Collocated cycles in double: Newton's iteration, the branch through folds, and the first cycles
of both kinds.

One Newton iteration solves for a point of a branch within a plane: that of a speed, or one across
the branch. The stopping rules are not those of shooting. The two methods share nothing, so that
their agreement is evidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.collocation.fourier import (
    MAX_SAMPLES,
    Collocation,
    CycleKind,
    harmonic_amplitudes,
    resample,
)
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.theory.hopf import amplitude_law, omega_crit, period_crit

__all__ = [
    "collocation_fold_near",
    "first_fold",
    "floquet_mode",
    "fold_residual",
    "fold_system",
    "librating_point_at",
    "not_converged_error",
    "rotating_point_at",
    "solve_on_plane",
]

_FIRST_SAMPLES = 24
_FIRST_AMPLITUDE = 0.005  # rad; with it rounding moves the speed by some 1e-11
_MAX_NEWTON_STEPS = 25
_MAX_STEP = 0.3  # rad
_SETTLED = 1e-8  # a relative step after which quadratic convergence leaves rounding only
_STALLED = 1e-5  # a relative step below which only rounding keeps it from shrinking
# The step of a difference, for a number of order one. The derivative is then good to some 1e-10.
_DIFFERENCE_STEP = 1e-6
_MAX_CONTINUATION_STEPS = 120
# The largest last harmonics, relative to the first. They move the speed by 1e-9 of itself at most.
_MAX_TAIL = 1e-6
_FLAT_LEAN = 1.5  # rad; the disk lies flat at pi/2
# Once periods are _LONG times the shortest, each step brings the speed at least ten times as close
# to Omega_h as before. A target more than _FAR times the last change of the speed away is beyond
# the end. From _LONGEST times the shortest on, the last harmonics change the speed as much as the
# branch does, and it would turn by chance.
_LONG, _FAR, _LONGEST = 4.0, 300, 8.0
_ROTATION_SAMPLES = 41
# In units of the frequency; the next copies of a Floquet exponent differ by one
_MAX_IMAGINARY = 0.4
# Leans [rad] of the starts. The first ones lead to the stable cycle, the last ones to the unstable
# one.
_START_LEANS = (0.04, 0.08, 0.02, 0.12, 0.2, 0.35, 0.6)
# The ratio of the speeds of the second and the first cycle on the way to the rotating cycles' fold.
_SPEED_RATIO = 0.999


def not_converged_error(samples: int) -> NoSuchCycleError:
    return NoSuchCycleError(
        f"the balance did not converge with {samples // 2} harmonics: try more, or a speed further "
        f"from Omega_h"
    )


def solve_on_plane(collocation: Collocation, start: Any, normal: Any = None) -> Any | None:
    """Solve the collocation equations for the limit cycle in the plane through ``start`` with the
    given normal.

    Args:
        collocation: The collocation, in double.
        start: The first guess (n + 2,).
        normal: The normal (n + 2,) of the plane; None for the plane of the start's speed.

    Returns:
        The point (n + 2,), or None if the iteration does not converge, or leaves the cycles of this
        kind.
    """
    if normal is None:
        normal = numpy.eye(1, collocation.count + 2, collocation.count + 1)[0]
    return _solve(
        collocation,
        start,
        lambda point: numpy.vstack((collocation.jacobian(point), normal)),
        lambda point: numpy.append(collocation.residual(point), normal @ (point - start)),
    )


def _solve(
    collocation: Collocation,
    start: Any,
    matrix: Callable[[Any], Any],
    residual: Callable[[Any], Any],
) -> Any | None:
    """Solve the collocation equations ``residual`` = 0 for a limit cycle by Newton's iteration,
    with their derivative ``matrix``.

    The unknowns are a point (n + 2,), and any further ones after it. Returns them, or None if the
    iteration does not converge, or leaves the cycles of this kind.
    """
    n = collocation.count
    amplitude = abs(start[:n]).max()
    unknowns, smallest = start, math.inf
    for _ in range(_MAX_NEWTON_STEPS):
        try:
            step = numpy.linalg.solve(matrix(unknowns), residual(unknowns))
        except numpy.linalg.LinAlgError:
            # There are too few samples: even at a fold an oblique plane leaves the matrix regular.
            return None
        longest = abs(step[:n]).max()
        unknowns = unknowns - min(1.0, _MAX_STEP / max(longest, 1e-300)) * step
        beta, others = unknowns[:n], unknowns[n : n + 2]
        size = longest / amplitude + abs(step[n : n + 2] / others).max()
        if collocation.kind is CycleKind.ROTATING:  # the disk leans to one side
            is_cycle = beta.min() > 0 and beta.max() < math.pi / 2
        else:
            is_cycle = abs(beta).max() >= amplitude / 4 and (others > 0).all()
        if not (math.isfinite(size) and is_cycle):
            return None
        if size < _SETTLED or (size >= smallest and smallest < _STALLED):
            return unknowns
        smallest = min(smallest, size)
    return None


# -------------------------------------------------------------------------------------------- folds
def collocation_fold_near(collocation: Collocation, start: Any) -> Any | None:
    """Solve the collocation equations for a fold of limit cycles near a point.

    Args:
        collocation: The collocation, in double.
        start: The first guess (n + 2,).

    Returns:
        The fold's point and null vector (2 n + 3,), or None if Newton's iteration does not lead to
        a fold.
    """
    # The branch's tangent is the null vector where Omega is extreme.
    null = numpy.linalg.svd(collocation.jacobian(start))[2][-1][:-1]
    pivot = abs(null).argmax()
    unknowns = numpy.append(start, null / null[pivot])
    return _solve(
        collocation,
        unknowns,
        lambda fold: fold_system(collocation, fold, pivot),
        lambda fold: fold_residual(collocation, fold, pivot),
    )


def fold_residual(collocation: Collocation, fold: Any, pivot: int) -> Any:
    """Return the residuals (2 n + 3,) of the collocation equations of a fold.

    They are the equations of the cycle, those of a null vector of their derivative, and the null
    vector's scale.

    Args:
        collocation: The collocation.
        fold: The fold's point and null vector (2 n + 3,).
        pivot: The place of the null vector's entry that is 1.
    """
    point, null = fold[: collocation.count + 2], fold[collocation.count + 2 :]
    return numpy.concatenate(
        (
            collocation.residual(point),
            collocation.directional_derivative(point, null),
            [null[pivot] - 1],
        )
    )


def fold_system(collocation: Collocation, fold: Any, pivot: int) -> Any:
    """Return the derivative of `fold_residual`, in double: (2 n + 3, 2 n + 3).

    Second derivatives are symmetric. So the derivative of the null vector's equations with respect
    to the point is the change of the matrix along the null vector.

    Args:
        collocation: The collocation, in double.
        fold: The fold's point and null vector (2 n + 3,).
        pivot: The place of the null vector's entry that is 1.
    """
    n = collocation.count
    point, moved = fold[: n + 2], numpy.append(_DIFFERENCE_STEP * fold[n + 2 :], 0.0)
    rows = numpy.zeros((2 * n + 3, 2 * n + 3))
    matrix = collocation.jacobian(point)
    rows[: n + 1, : n + 2] = matrix
    rows[n + 1 : -1, : n + 2] = (
        collocation.jacobian(point + moved) - collocation.jacobian(point - moved)
    ) / (2 * _DIFFERENCE_STEP)
    rows[n + 1 : -1, n + 2 :] = matrix[:, :-1]
    rows[-1, n + 2 + pivot] = 1.0
    return rows


def first_fold(parameters: Parameters, kind: CycleKind) -> Any:
    """Find the first fold of the librating cycles from the Hopf point on, or the fold of the
    rotating ones, by collocation.

    Args:
        parameters: The disk, under the linear law.
        kind: The kind of cycle.

    Returns:
        The point (n + 2,).

    Raises:
        NoSuchCycleError: If there is no fold before periods are long.
    """
    if kind is CycleKind.LIBRATING:
        points = _librating_branch(parameters, math.inf)
    else:  # along the unstable ones, from Omega_crit on downward
        crit = float(omega_crit(parameters, 20).value)
        first = rotating_point_at(parameters, crit, stable=False)
        second = solve_on_plane(
            Collocation(parameters, kind, len(first) - 2),
            numpy.append(first[:-1], _SPEED_RATIO * crit),
        )
        if second is None:
            raise not_converged_error(len(first) - 2)
        points = _follow_branch(parameters, kind, first, second, math.inf)
    next(points)
    for point, turns in points:
        if turns:
            return point
    raise NoSuchCycleError(f"collocation finds no fold of the {kind.name.lower()} cycles")


# --------------------------------------------------------------------------------------- the branch
def _follow_branch(
    parameters: Parameters, kind: CycleKind, before: Any, point: Any, target: float
) -> Iterator[tuple[Any, bool]]:
    """Yield the points of a branch of limit cycles one after the other, folds included, from its
    first two on.

    Each point comes with True if the speed turns there.

    Pseudo-arclength steps pass folds, and leave the trivial solution behind for good. The number of
    samples grows once the last harmonics are no longer small. The branch ends where its cycles
    would lie flat. It also ends where the speed comes to rest next to the connection, too far from
    ``target`` [rad/s] to get there.
    """
    length, fastest = 2.0, 0.0  # the next step, in units of the last one
    yield before, True
    for _ in range(_MAX_CONTINUATION_STEPS):
        n = len(point) - 2
        collocation = Collocation(parameters, kind, n)
        before = resample(kind, before, n)
        along = point - before
        # The plane across the branch, with frequency and speed in units of their own size, and
        # beta_bar by its mean square.
        units = numpy.append(numpy.full(n, math.sqrt(n)), point[-2:])
        ahead = solve_on_plane(collocation, point + length * along, along / units**2)
        if ahead is None:  # the step is too long, or the cycle needs more harmonics: change both
            length /= 2
            if length < 1e-3:
                raise not_converged_error(n)
            point = _resampled_if_needed(kind, point, 0.0)
            continue
        passed = [(point, False)]
        if along[-1] * (ahead[-1] - point[-1]) < 0:
            for start in (point, before):
                fold = collocation_fold_near(collocation, start)
                if fold is not None:
                    behind = (fold[: n + 2] - point) @ (ahead - before) < 0
                    passed.insert(0 if behind else 1, (fold[: n + 2], True))
                    break
        yield from passed
        fastest = max(fastest, point[-2])
        rests = point[-2] < fastest / _LONG and _FAR * abs(along[-1]) < abs(target - point[-1])
        if rests or point[-2] < fastest / _LONGEST or abs(point[:-2]).max() > _FLAT_LEAN:
            return
        before, point = point, _resampled_if_needed(kind, ahead, _MAX_TAIL)
        length = min(1.3, 2 * length)


def _resampled_if_needed(kind: CycleKind, point: Any, small: float) -> Any:
    harmonics = harmonic_amplitudes(kind, point[:-2])
    if harmonics[-2:].max() > small * harmonics[0] and len(point) < MAX_SAMPLES // 4:
        return resample(kind, point, kind.samples((len(point) - 2) * 3 // 2 - 1))
    return point


# --------------------------------------------------------------------------------- librating cycles
def _librating_branch(parameters: Parameters, target: float) -> Iterator[tuple[Any, bool]]:
    """Return a generator that follows the librating limit cycles from the Hopf point on, and yields
    what `_follow_branch` yields.
    """
    # The square of beta's amplitude over that of gamma's.
    ratio = float(parameters.e / (parameters.r + parameters.e))
    quadratic, frequency = (
        float(amplitude_law(parameters)[0]),
        2 * math.pi / float(period_crit(parameters)),
    )
    speed, at = (
        float(omega_crit(parameters, 40).value),
        numpy.pi * numpy.arange(_FIRST_SAMPLES) / _FIRST_SAMPLES,
    )
    birth, first = (
        numpy.append(
            -amplitude * numpy.sin(at), (frequency, speed * (1 + quadratic * amplitude**2 / ratio))
        )
        for amplitude in (0.0, _FIRST_AMPLITUDE)
    )
    cycle = solve_on_plane(
        Collocation(parameters, CycleKind.LIBRATING, _FIRST_SAMPLES), first, first - birth
    )
    if cycle is None:
        raise not_converged_error(_FIRST_SAMPLES)
    return _follow_branch(parameters, CycleKind.LIBRATING, birth, cycle, target)


def librating_point_at(parameters: Parameters, target: Fraction) -> Any:
    """Return the librating cycle where the branch from the Hopf point first crosses a speed.

    Args:
        parameters: The disk, under the linear law.
        target: The speed [rad/s].

    Returns:
        The point (n + 2,).

    Raises:
        NoSuchCycleError: If the branch does not cross the speed.
    """
    crit, speed = omega_crit(parameters, 40).value, float(target)
    nowhere = f"no limit cycle found at Omega = {speed:.12g} rad/s"
    if abs(crit - target) < 1e-9 * crit:
        raise NoSuchCycleError(
            f"{nowhere}: within 1e-9 of Omega_crit double precision cannot start the balance; use "
            f"the law of hopf"
        )
    points = _librating_branch(parameters, speed)
    before, turned = next(points)
    for point, turns in points:
        if (point[-1] - speed) * (before[-1] - speed) <= 0:
            break
        before, turned = point, turns
    else:
        lies_flat = abs(before[:-2]).max() > _FLAT_LEAN
        reason = "where the disk would lie flat" if lies_flat else "in ever longer periods"
        raise NoSuchCycleError(f"{nowhere}: the branch ends near {before[-1]:.5g} rad/s, {reason}")
    before = resample(CycleKind.LIBRATING, before, len(point) - 2)
    ratio = (speed - before[-1]) / (point[-1] - before[-1])
    # At a fold, and at the Hopf point, the speed changes with the square of the way.
    ratio = math.sqrt(ratio) if turned else 1 - math.sqrt(1 - ratio) if turns else ratio
    guess = before + ratio * (point - before)
    guess[-1] = speed
    cycle = solve_on_plane(Collocation(parameters, CycleKind.LIBRATING, len(guess) - 2), guess)
    if cycle is None:
        raise not_converged_error(len(guess) - 2)
    return cycle


# ---------------------------------------------------------------------------------- rotating cycles
def rotating_point_at(parameters: Parameters, omega: float, stable: bool) -> Any:
    """Return the stable or the unstable rotating limit cycle at a speed, as a point of the
    collocation.

    Args:
        parameters: The disk, under the linear law.
        omega: The speed [rad/s].
        stable: True for the stable cycle, False for the unstable one.

    Returns:
        The point (n + 2,).

    Raises:
        NoSuchCycleError: If Newton's iteration does not get there from any of the rolling disk's
            rotations.
    """
    collocation = Collocation(parameters, CycleKind.ROTATING, _ROTATION_SAMPLES)
    for lean in _START_LEANS if stable else _START_LEANS[::-1]:
        point = solve_on_plane(collocation, _rolling_disk_cycle(parameters, omega, lean))
        if point is not None and (floquet_mode(collocation, point)[0] < 0) == stable:
            return point
    raise NoSuchCycleError(
        f"collocation finds no {'stable' if stable else 'unstable'} rotating cycle here"
    )


def _rolling_disk_cycle(parameters: Parameters, omega: float, lean: float) -> Any:
    """Return a guess of a rotating cycle, as a collocation point (n + 2,): a rotation of the
    rolling disk with beta_bar = lean at the bottom.

    The rolling disk conserves (r + e sin gamma) sin beta.
    """
    r, e = float(parameters.r), float(parameters.e)
    gamma = numpy.linspace(0.0, 2 * math.pi, 4001)  # gamma_bar, from the top
    beta = numpy.arccos((r - e) * math.cos(lean) / (r + e * numpy.cos(gamma)))
    pace = 1 / (omega * numpy.sin(beta))
    times = numpy.concatenate(([0.0], numpy.cumsum((pace[1:] + pace[:-1]) / 2 * numpy.diff(gamma))))
    samples = numpy.interp(
        numpy.arange(_ROTATION_SAMPLES) / _ROTATION_SAMPLES * times[-1], times, beta
    )
    return numpy.append(samples, (2 * math.pi / times[-1], omega))


def floquet_mode(collocation: Collocation, point: Any) -> tuple[float, Any, Any]:
    """Return the slow Floquet exponent of a rotating cycle and its mode, in double by collocation.

    Args:
        collocation: The collocation, in double.
        point: The cycle's point (n + 2,).

    Returns:
        The exponent in units of the frequency, the mode (3 n,) of (beta, gamma, v), and a matrix (3
        n, 3 n). The matrix is that of the variational equation with the angle in place of time. The
        exponent and the mode are an eigenvalue and eigenvector of it.
    """
    by_beta, by_gamma, by_v = (
        numpy.diag(slope / point[-2]) for slope in collocation.acceleration_gradient(point)
    )
    turning, zero = (
        numpy.diag(point[-1] * numpy.cos(point[:-2]) / point[-2]),
        numpy.zeros((collocation.count, collocation.count)),
    )
    rows = numpy.block(
        [
            [-collocation.differentiation_matrix, zero, numpy.eye(collocation.count) / point[-2]],
            [turning, -collocation.differentiation_matrix, zero],
            [by_beta, by_gamma, by_v - collocation.differentiation_matrix],
        ]
    )
    values, vectors = numpy.linalg.eig(rows)
    # One copy of each exponent is as good as real; the others differ from it by multiples of i. The
    # flow's exponent is 0.
    real = numpy.flatnonzero(abs(values.imag) < _MAX_IMAGINARY)
    chosen = real[abs(values[real].real).argsort()][1]
    mode = vectors[:, chosen]
    return float(values[chosen].real), (mode / mode[abs(mode).argmax()]).real, rows
