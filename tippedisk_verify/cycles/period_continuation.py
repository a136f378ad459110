"""The family with the period as its parameter: the way to follow it to Omega_h.

Close to Omega_h the speed hardly changes while the period grows without bound, so Omega becomes an unknown and half the
period T / 2 is given. The state then leaves the saddle's neighbourhood and Omega its limit like exponentials of T / 2,
and predictions are made in their logarithms.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.cycles.return_map import NewtonIteration
from tippedisk_verify.cycles.section import VARIATIONS
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Request, Status
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision

__all__ = ["PeriodPoint", "cycle_at_half_period", "lengthened", "predicted_state"]

_MOST_STEPS = 15


@dataclass(frozen=True)
class PeriodPoint:
    """A limit cycle of given period, in the arithmetic it was solved in."""

    half_period: Any  #: T / 2 [s]
    gamma_bar_0: Any  #: [rad]
    v_0: Any  #: [rad/s]
    omega: Any  #: [rad/s]
    slopes: tuple[Any, Any, Any]  #: d(gamma_bar_0, v_0, Omega) / d(T / 2)
    residuals: tuple[float, ...]  #: size of the Newton steps


def cycle_at_half_period(
    parameters: Parameters,
    half_period: Any,
    guess: Sequence[Any],
    engine: Engine,
    precision: Precision = DOUBLE,
) -> PeriodPoint:
    """Newton's iteration for (gamma_bar_0, v_0, Omega) at the half period T / 2 [s].

    Raises NoSuchCycleError if it does not converge or leaves the well.
    """
    number = precision.number
    unknowns = [number(value) for value in guess]
    duration = number(half_period)
    rates = parameters.at(precision)
    # What follows a small step is, by quadratic convergence, rounding.
    iteration = NewtonIteration(
        _MOST_STEPS,
        NoSuchCycleError(f"the iteration at fixed period has not converged after {_MOST_STEPS} steps"),
        small=1e-7 if precision == DOUBLE else 2.0 ** (-0.4 * precision.bits),
        near=1e-3,
    )
    while True:
        gamma_bar, v, omega = unknowns
        result = engine(
            Request(
                parameters,
                omega,
                (0, gamma_bar, v),
                duration,
                shifted=True,
                precision=precision,
                variations=VARIATIONS,
                domain="none",
            )
        )
        if result.status is not Status.REACHED:
            raise NoSuchCycleError(f"the orbit could not be followed for half a period: {result.status.value}")
        beta, gamma, v_end = result.state
        errors = [beta, gamma + gamma_bar, v_end + v]
        rows = result.derivatives
        matrix = [[rows[i][k + 1] for k in range(3)] for i in range(3)]
        matrix[1][0] = matrix[1][0] + 1
        matrix[2][1] = matrix[2][1] + 1
        moving = field(shifted(precision.ops), rates, omega, parameters.friction)(beta, gamma, v_end)
        step = _solved(matrix, errors)
        unknowns = [value - part for value, part in zip(unknowns, step, strict=True)]
        # The state matters against its distance from the saddle, the speed against how fast it still changes.
        slopes = [-part for part in _solved(matrix, list(moving))]
        size = max(
            abs(float(step[0] / (precision.pi - unknowns[0]))),
            abs(float(step[1] / unknowns[1])),
            abs(float(step[2] / slopes[2])),
        )
        inside = 0 < float(precision.pi - unknowns[0]) < math.pi and float(unknowns[1]) < 0
        if not math.isfinite(size) or not inside:
            raise NoSuchCycleError("the iteration at fixed period left the well: take a smaller step in the period")
        if iteration.converged(size):
            gamma_bar, v, omega = unknowns
            return PeriodPoint(duration, gamma_bar, v, omega, (slopes[0], slopes[1], slopes[2]), tuple(iteration.sizes))


def _solved(matrix: list[list[Any]], right: list[Any]) -> list[Any]:
    """Three linear equations by elimination with pivoting, in the arithmetic of the entries."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for column in range(3):
        pivot = max(range(column, 3), key=lambda k: abs(rows[k][column]))
        rows[column], rows[pivot] = rows[pivot], rows[column]
        if rows[column][column] == 0:
            raise NoSuchCycleError("the iteration at fixed period met a singular matrix")
        for below in range(column + 1, 3):
            factor = rows[below][column] / rows[column][column]
            rows[below] = [entry - factor * above for entry, above in zip(rows[below], rows[column], strict=True)]
    solution: list[Any] = [None, None, None]
    for row in (2, 1, 0):
        rest = rows[row][3]
        for column in range(row + 1, 3):
            rest = rest - rows[row][column] * solution[column]
        solution[row] = rest / rows[row][row]
    return solution


def lengthened(
    parameters: Parameters,
    first: PeriodPoint,
    engine: Engine,
    *,
    longest: float,
    precision: Precision = DOUBLE,
    longest_step: float = math.inf,
) -> Iterator[PeriodPoint]:
    """Cycles of longer and longer period from ``first`` on, up to the period ``longest`` [s].

    The step in the half period adapts, up to ``longest_step`` [s]: it grows by half after a quick solution and is
    halved after a failed one. Raises NoSuchCycleError when it has become less than half a millisecond, which in double
    happens where Omega - Omega_h drowns in rounding.
    """
    point, before = first, first
    step = 0.02
    while 2 * float(point.half_period) < longest:
        if step < 5e-4:
            raise NoSuchCycleError(
                f"at the period {2 * float(point.half_period):.4g} s the family drowns in rounding:"
                " compute in more bits"
            )
        step = min(step, longest_step)
        half_period = precision.number(min(float(point.half_period) + step, longest / 2))
        state = predicted_state(point, half_period, precision)
        guess = (*state, _predicted_speed(point, before, half_period, precision))
        try:
            before, point = point, cycle_at_half_period(parameters, half_period, guess, engine, precision)
        except NoSuchCycleError:
            step /= 2
            continue
        yield point
        step *= 1.5 if len(point.residuals) <= 4 else 1.0 if len(point.residuals) <= 6 else 0.7


def predicted_state(point: PeriodPoint, half_period: Any, precision: Precision) -> tuple[Any, Any]:
    """(gamma_bar_0, v_0) at another half period [s]: along the tangent, in logarithms of distances from the saddle."""
    number, exp = precision.number, precision.ops.exp
    ahead = half_period - number(point.half_period)
    gamma_slope, v_slope = number(point.slopes[0]), number(point.slopes[1])
    left, v = precision.pi - number(point.gamma_bar_0), number(point.v_0)
    return precision.pi - left * exp(-gamma_slope / left * ahead), v * exp(v_slope / v * ahead)


def _predicted_speed(point: PeriodPoint, before: PeriodPoint, half_period: Any, precision: Precision) -> Any:
    """Along the tangent, in the logarithm of the distance from the limit that the last two slopes have in common."""
    ahead = half_period - point.half_period
    falls = point.slopes[2] / before.slopes[2]
    if not 0 < falls < 1:  # the first one, and where the speed is not on its way to a limit yet
        return point.omega + point.slopes[2] * ahead
    rate = precision.ops.log(falls) / (point.half_period - before.half_period)
    return point.omega + point.slopes[2] * (precision.ops.exp(rate * ahead) - 1) / rate
