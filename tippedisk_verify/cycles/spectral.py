"""Librating limit cycles, and the folds of librating and of rotating ones, by Fourier collocation in time.

No integrator is used. Each answer is computed at two resolutions. `fourier` has the equations, `spectral_branch` the
way to a cycle, and `spectral_rotation` the rotating cycles away from their fold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.fourier import (
    MOST_SAMPLES,
    Collocation,
    Kind,
    at_two_resolutions,
    chord,
    decay,
    resampled,
    samples_for,
)
from tippedisk_verify.cycles.spectral_branch import (
    branch_to,
    fold_near,
    fold_system,
    librating_branch,
    newton,
    unconverged,
    walk,
)
from tippedisk_verify.cycles.spectral_rotation import rotation_on_few_samples
from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.model.results import Printable
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["BalancedCycle", "SpectralFold", "approximate_cycle", "balanced_cycle", "spectral_fold"]

_MOST_HARMONICS = MOST_SAMPLES // 2
_WORTHLESS = 0.02  # a relative half-width of the period above this says that there may be no cycle at all
_LARGEST_AMPLITUDE = 1.5  # rad; the disk lies flat at pi/2
_LONG = 2.5  # times the shortest period: the branch is on its way to the heteroclinic cycle
_LOWER = 0.97  # of the mean lean, from the first cycle to the second on the way to the rotating cycles' fold


# ------------------------------------------------------------------------------------------------ librating cycles
@dataclass(frozen=True, repr=False)
class BalancedCycle(Printable):
    """A limit cycle from spectral harmonic balance; half-widths are from a balance of twice as many harmonics."""

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

    ``harmonics`` fixes the number of odd harmonics; otherwise it grows until the half-widths allow the digits.
    A branch that turns round in folds has several cycles at a speed: ``crossing`` says which, counted from the Hopf
    point. Raises InputError for a speed that is not positive or harmonics outside 1 ... 1024; NoSuchCycleError if there
    is no cycle at this speed or the balance does not converge.
    """
    parameters.refuse_smooth("harmonic balance is")
    speed = checked_speed(omega)
    if harmonics is not None and not (isinstance(harmonics, int) and 1 <= harmonics <= _MOST_HARMONICS):
        raise InputError(f"the number of harmonics lies between 1 and {_MOST_HARMONICS}, not {shown(harmonics)}")
    checked_digits(digits)
    start = branch_to(parameters, speed, harmonics, crossing)
    count = 2 * harmonics if harmonics else samples_for(Kind.LIBRATING, start, digits)
    while True:
        cycle = _balanced(parameters, speed, start, count, digits)
        numbers = (cycle.period, cycle.gamma_bar_0, cycle.v_0, cycle.beta_max)
        worst = max(number.uncertainty / abs(number.value) for number in numbers)
        missing = math.log10(worst) + digits if worst else -math.inf
        if harmonics is not None or missing <= 0:
            return cycle
        if count >= MOST_SAMPLES:
            raise NoSuchCycleError(
                f"the balance did not converge with {count // 2} harmonics: this close to Omega_h use shooting"
            )
        # So many harmonics more as the decay needs for the digits that are missing, and a tenth for the half-widths.
        more = missing / -math.log10(cycle.decay) + 2
        count = min(MOST_SAMPLES, Kind.LIBRATING.samples(1.1 * (count + 2 * more)))


def _balanced(parameters: Parameters, speed: Fraction, start: Any, count: int, digits: int) -> BalancedCycle:
    amplitudes: list[tuple[float, ...]] = []

    def numbers(a: Collocation) -> dict[str, Any]:
        double = Collocation(parameters, a.kind, a.count)
        point = newton(double, resampled(a.kind, start, a.count))
        if point is None:
            raise unconverged(a.kind, a.count)
        exact, rows = a.number(speed), double.matrix(point[:-1], point[-1])[:, :-1]
        cycle = chord(a, rows, a.number(point[:-1]), lambda unknowns: a.residual(unknowns, exact))
        gamma, v = a.motion(cycle, exact)
        cosines, sines = _harmonics(a, cycle[:-1])
        amplitudes.append(tuple(float(a.ctx.hypot(x, y)) for x, y in zip(cosines, sines, strict=True)))
        at = int(abs(cycle[:-1]).argmax()) * a.pi / a.count
        return {
            "period": 2 * a.pi / cycle[-1],
            "gamma_bar_0": gamma[0],
            "v_0": v[0],
            "beta_max": abs(_extremum(a, cosines, sines, at, digits)),
        }

    result = at_two_resolutions(parameters, Kind.LIBRATING, count, digits, numbers)
    if result["period"].uncertainty > Fraction(_WORTHLESS) * result["period"].value:
        raise unconverged(Kind.LIBRATING, count)
    falls = decay(amplitudes[0], 10.0 ** (-digits - 8))
    return BalancedCycle(speed, count // 2, **result, decay=falls, amplitudes=amplitudes[0])


def _harmonics(a: Collocation, beta: Any) -> tuple[Any, Any]:
    """Cosine and sine amplitudes of a librating cycle's odd harmonics, in the working precision: the tail matters."""
    n = a.count
    table = numpy.array([a.ctx.sin(a.pi * j / n) for j in range(2 * n)], dtype=object)
    turns = numpy.outer(numpy.arange(1, n, 2), numpy.arange(n))
    return tuple(table[(turns + quarter) % (2 * n)] @ beta * 2 / n for quarter in (n // 2, 0))


def _extremum(a: Collocation, cosines: Any, sines: Any, at: Any, digits: int) -> Any:
    """beta_bar's extreme value next to an angle, by Newton's iteration on its derivative."""
    odd = numpy.arange(1, a.count, 2)
    for _ in range(6 + digits.bit_length()):
        c, s = a.cos(odd * at), a.sin(odd * at)
        at += (odd * (sines * c - cosines * s)).sum() / (odd * odd * (cosines * c + sines * s)).sum()
    return (cosines * a.cos(odd * at) + sines * a.sin(odd * at)).sum()


def approximate_cycle(parameters: Parameters, omega: Fraction) -> tuple[float, float]:
    """(gamma_bar, v) at beta = pi/2, v < 0, of the limit cycle at ``omega``, good enough to start shooting from.

    Raises NoSuchCycleError as `balanced_cycle` does.
    """
    point = branch_to(parameters, omega, None)
    gamma, v = Collocation(parameters, Kind.LIBRATING, len(point) - 2).motion(point[:-1], float(omega))
    return float(gamma[0]), float(v[0])


# ------------------------------------------------------------------------------------------------ folds
@dataclass(frozen=True)
class SpectralFold:
    """A fold of limit cycles; half-widths are twice the distance from a finer collocation.

    The state is (beta_bar, v) at gamma = pi/2 of a rotating cycle, (gamma_bar, v) at beta = pi/2 of a librating one.
    """

    samples: int
    omega: Measured  #: [rad/s]
    period: Measured  #: T [s]
    angle: Measured  #: the state's angle [rad]
    v: Measured  #: [rad/s]
    null_vector: Measured  #: d(v) / d(angle) along the family [1/s]


def spectral_fold(parameters: Parameters, kind: Kind = Kind.ROTATING, *, digits: int = 12) -> SpectralFold:
    """The fold of the linear law's rotating limit cycles, or the first one of the librating cycles.

    ``digits`` are about those of its numbers. At a fold the variational equation has a second periodic solution: the
    null vector of the collocation's derivative is unknown too. Raises NoSuchCycleError where collocation finds none.
    """
    parameters.refuse_smooth("spectral collocation is")
    checked_digits(digits)
    start = _first_fold(parameters, kind)

    def numbers(a: Collocation) -> dict[str, Any]:
        n = a.count
        double = Collocation(parameters, kind, n)
        fold = fold_near(double, resampled(kind, start, n))
        if fold is None:
            raise NoSuchCycleError("the collocation of the fold does not converge")
        largest = int(abs(fold[1]).argmax())

        def residual(unknowns: Any) -> Any:
            cycle, omega, null = unknowns[: n + 1], unknowns[n + 1], unknowns[n + 2 :]
            return numpy.concatenate((a.residual(cycle, omega), a.along(cycle, omega, null), [null[largest] - 1]))

        unknowns = chord(a, fold_system(double, *fold), a.number(numpy.concatenate(fold)), residual)
        cycle, omega, null = unknowns[: n + 1], unknowns[n + 1], unknowns[n + 2 :]
        gamma, v = a.motion(cycle, omega)
        rotating = kind is Kind.ROTATING
        turned = null[0] if rotating else a.gamma_along(cycle, omega, null)[0]
        return {
            "omega": omega,
            "period": 2 * a.pi / cycle[-1],
            "angle": cycle[0] if rotating else gamma[0],
            "v": v[0],
            "null_vector": a.rate_along(cycle, null)[0] / turned,
        }

    count = samples_for(kind, start, digits)
    return SpectralFold(count, **at_two_resolutions(parameters, kind, count, digits, numbers))


def _first_fold(parameters: Parameters, kind: Kind) -> Any:
    """The first fold of the librating cycles from the Hopf point on, or that of the rotating ones, in double."""
    nothing = NoSuchCycleError(f"collocation finds no fold of the {kind.name.lower()} cycles")
    if kind is Kind.LIBRATING:
        points = librating_branch(parameters)
    else:  # from an unstable one towards smaller leans
        first = rotation_on_few_samples(parameters, float(omega_crit(parameters, 20).value), stable=False)
        n = len(first) - 2
        lower = numpy.append(_LOWER * first[:n], first[n:])
        mean = numpy.append(numpy.full(n, 1 / n), (0.0, 0.0))
        second = newton(Collocation(parameters, kind, n), lower, mean)
        if second is None:
            raise nothing
        points = walk(parameters, kind, first, second)
    fastest = 0.0
    for point, turning in points:
        fastest = max(fastest, point[-2])
        if turning:
            return point
        # Where periods grow without bound Omega has a limit, about which rounding makes it turn.
        if abs(point[:-2]).max() > _LARGEST_AMPLITUDE or point[-2] < fastest / _LONG:
            break
    raise nothing
