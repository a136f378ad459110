"""The fold of the rotating limit cycles without an integrator, by collocation in time.

Unknown are the cycle's samples, its frequency, Omega and the null vector of the collocation's derivative, which the
fold has: there the variational equation has a second periodic solution. As with `spectral_rotation`, the equations are
solved in double, and above double with the same derivative; a finer collocation measures the error.
"""

from __future__ import annotations

from dataclasses import dataclass
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
from tippedisk_verify.cycles.spectral_rotation import rotation_on_few_samples
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["SpectralFold", "spectral_fold"]

_SETTLED_FOLD = 1e-7  # a step in double that rounding follows: the fold's equations amplify it
_SHORTER = 0.93  # of the mean lean, from one cycle to the next on the way to the fold


@dataclass(frozen=True)
class SpectralFold:
    """The fold of the rotating cycles; half-widths as those of `SpectralRotation`."""

    samples: int
    omega: Measured  #: [rad/s]
    period: Measured  #: T [s]
    beta_bar_top: Measured  #: [rad]
    v_top: Measured  #: [rad/s]
    null_vector: Measured  #: d(v_top) / d(beta_bar_top) along the family [1/s]


def spectral_fold(parameters: Parameters, *, digits: int = 12) -> SpectralFold:
    """The fold of the linear law's rotating limit cycles, to about ``digits`` digits.

    Raises NoSuchCycleError where collocation finds none.
    """
    parameters.refuse_smooth("spectral collocation is")
    checked_digits(digits)
    start, omega = _near_fold(parameters)
    count = samples_for(start, digits)
    rough = _fold_numbers(parameters, omega, start, count, digits)
    sharp = _fold_numbers(parameters, omega, start, odd(MORE * count), digits + FINER)
    return SpectralFold(count, **compared(rough, sharp))


def _near_fold(parameters: Parameters) -> tuple[PeriodSamples, float]:
    """A cycle and its speed next to the fold, by following the unstable ones towards smaller leans."""
    omega = float(omega_crit(parameters, 20).value)
    cycle = rotation_on_few_samples(parameters, omega, stable=False)
    a = Arithmetic(parameters, FEWEST)
    while True:
        mean = float(cycle.beta.mean())
        ahead = _at_mean(a, cycle, omega, mean * _SHORTER)
        if ahead is None:
            raise NoSuchCycleError("collocation finds no fold of the rotating cycles")
        if ahead[1] > omega:
            return cycle, omega
        cycle, omega = ahead


def _at_mean(a: Arithmetic, start: PeriodSamples, omega: float, mean: float) -> tuple[PeriodSamples, float] | None:
    """The cycle of a given mean lean, with Omega as an unknown; None if Newton's iteration does not converge."""
    n = a.count
    cycle = start
    for _ in range(MOST_PASSES):
        rows = numpy.zeros((n + 2, n + 2))
        rows[: n + 1, : n + 1] = cycle.matrix(a, omega)
        rows[: n + 1, n + 1] = _by_omega(a, cycle, omega)
        rows[n + 1, :n] = 1 / n
        step = numpy.linalg.solve(rows, numpy.append(cycle.residual(a, omega), cycle.beta.mean() - mean))
        cycle, omega = PeriodSamples(cycle.beta - step[:n], cycle.frequency - step[n]), omega - float(step[n + 1])
        if not numpy.isfinite(step).all() or not cycle.beta.min() > 0:
            return None
        if abs(step).max() < SETTLED:
            return cycle, omega
    return None


def _by_omega(a: Arithmetic, cycle: PeriodSamples, omega: float) -> Any:
    ahead, behind = (cycle.residual(a, omega + h) for h in (DIFFERENCE, -DIFFERENCE))
    return (ahead - behind) / (2 * DIFFERENCE)


def _fold_numbers(parameters: Parameters, omega: float, start: PeriodSamples, count: int, digits: int) -> Any:
    """The fold by Newton's iteration for cycle, speed and null vector, with the derivative in double."""
    from scipy.linalg import lu_factor, lu_solve

    plain, n = Arithmetic(parameters, count), count
    cycle, speed = start.resampled(n), omega
    rows = cycle.matrix(plain, speed)
    null = numpy.linalg.svd(rows)[2][-1]
    null /= abs(null).max() * numpy.sign(null[abs(null).argmax()])
    for _ in range(MOST_PASSES):
        system, residual = _fold_system(plain, cycle, speed, null)
        step = numpy.linalg.solve(system, residual)
        cycle = PeriodSamples(cycle.beta - step[:n], cycle.frequency - step[n])
        speed, null = speed - float(step[n + 1]), null - step[n + 2 :]
        if abs(step).max() < _SETTLED_FOLD:
            break
    else:
        raise NoSuchCycleError("the collocation of the fold does not converge")
    factored = lu_factor(_fold_system(plain, cycle, speed, null)[0])
    a = Arithmetic(parameters, count, digits + GUARD)
    sharp, wide, mode = PeriodSamples(a.number(cycle.beta), a.number(cycle.frequency)), a.number(speed), a.number(null)
    largest = int(abs(null).argmax())

    def step_above() -> Any:
        nonlocal sharp, wide, mode
        along = sharp.along(a, wide, PeriodSamples(mode[:n], mode[n]))
        right = numpy.concatenate((sharp.residual(a, wide), along, [mode[largest] - 1]))
        change = scaled_step(lambda part: lu_solve(factored, part), right, a)
        sharp = PeriodSamples(sharp.beta - change[:n], sharp.frequency - change[n])
        wide, mode = wide - change[n + 1], mode - change[n + 2 :]
        return change

    settled(step_above, a)
    _, v = sharp.motion(a, wide)
    change = PeriodSamples(mode[:n], mode[n])
    rate = sharp.frequency * a.differentiated(change.beta)[0] + change.frequency * a.differentiated(sharp.beta)[0]
    return {
        "omega": wide,
        "period": 2 * a.pi / sharp.frequency,
        "beta_bar_top": sharp.beta[0],
        "v_top": v[0],
        "null_vector": rate / change.beta[0],
    }


def _fold_system(a: Arithmetic, cycle: PeriodSamples, omega: float, null: Any) -> tuple[Any, Any]:
    """Derivative (2 n + 3 square) and residual of the fold's equations, in double."""
    n = a.count
    matrix = cycle.matrix(a, omega)

    def along(beta: Any, frequency: float, speed: float) -> Any:
        return PeriodSamples(beta, frequency).along(a, speed, PeriodSamples(null[:n], null[n]))

    system = numpy.zeros((2 * n + 3, 2 * n + 3))
    system[: n + 1, : n + 1] = matrix
    system[: n + 1, n + 1] = _by_omega(a, cycle, omega)
    base = numpy.append(cycle.beta, (cycle.frequency, omega))
    for column in range(n + 2):
        sides = []
        for sign in (1, -1):
            moved = base.copy()
            moved[column] += sign * DIFFERENCE
            sides.append(along(moved[:n], float(moved[n]), float(moved[n + 1])))
        system[n + 1 : 2 * n + 2, column] = (sides[0] - sides[1]) / (2 * DIFFERENCE)
    system[n + 1 : 2 * n + 2, n + 2 :] = matrix
    largest = int(abs(null).argmax())
    system[2 * n + 2, n + 2 + largest] = 1.0
    right = numpy.concatenate((cycle.residual(a, omega), matrix @ null, [null[largest] - 1]))
    return system, right
