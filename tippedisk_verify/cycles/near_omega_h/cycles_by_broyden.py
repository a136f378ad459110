"""Limit cycles next to Omega_h by flights past the saddles: librating above it and rotating below,
at distances D down to 1e-800 rad/s.

They are the way to a cycle within `MIN_SHOOTING_DISTANCE` of Omega_h, where shooting in double does
not settle, and passages do not have the digits wanted.

Omega_h itself is needed to more digits than D has zeros; the manifolds' splitting provides it. A
cycle passes the saddles so closely that it leaves them along the unstable manifold.

If the saddle value is negative, the return map contracts like D^(-lambda_s / lambda_u - 1). The
unstable manifold itself then arrives next to the fixed point, and Broyden's iteration needs no
derivative to begin with. Otherwise the family followed in its period predicts the cycle.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.near_omega_h.period_continuation import (
    PeriodContinuation,
    predicted_state,
)
from tippedisk_verify.cycles.near_omega_h.required_precision import precision_near_omega_h
from tippedisk_verify.cycles.shooting.cycle_numbers import number_names
from tippedisk_verify.cycles.shooting.error_budget import cycle_in_precision, numbers_at
from tippedisk_verify.cycles.shooting.newton import FixedPoint, StoppingRule
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, Section
from tippedisk_verify.cycles.shooting.shoot import MIN_SHOOTING_DISTANCE
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_logarithm
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR, Measured
from tippedisk_verify.numbers.precision import DOUBLE, precision_of_bits
from tippedisk_verify.theory.equilibria import equilibrium

__all__ = [
    "cycle_by_broyden",
    "fixed_point_by_broyden",
    "with_uncertainty_of_omega_h",
]

C = TypeVar("C", bound=Cycle)

_STRONG_CONTRACTION = -1.0  # decimal logarithm of a contraction that needs no derivative
_MAX_STEPS = 25
_ROUNDING_STEP = 1e-6  # relative size of a step below which only rounding keeps it from shrinking
# Extra bits of the wider run. By chance it is more than half as wrong with a probability of 2^-23.
_EXTRA_BITS = 24
# Move of the speed, relative to its distance from the branch's nearer end
_SPEED_MOVE = Fraction(1, 1000)
_CACHED_CYCLES = 64  # cycles in the cache; each takes some seconds


def cycle_by_broyden(
    section: Section[C],
    parameters: Parameters,
    omega: Fraction,
    omega_h: Fraction,
    engine: Engine,
    *,
    digits: int = 12,
) -> C:
    """Return the limit cycle at exactly ``omega``, next to ``omega_h``, from whole flights in wide
    arithmetic; it is cached.

    Librating cycles lie above, or below if the saddle value is positive. Stable rotating ones lie
    below.

    Args:
        section: The section of the kind of cycle.
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        omega_h: Omega_h [rad/s], to more digits than its distance from the speed has zeros.
        engine: The engine of the flights.
        digits: The significant digits wanted.

    Raises:
        NoSuchCycleError: If there is no such cycle.
        AccuracyError: If the digits are not reached.
    """
    cycle: C = _cycle_in_arithmetic(section, parameters, omega, omega_h, engine, digits)
    return cycle


@lru_cache(maxsize=_CACHED_CYCLES)
def _cycle_in_arithmetic(
    section: Section[Any],
    parameters: Parameters,
    omega: Fraction,
    omega_h: Fraction,
    engine: Engine,
    digits: int,
) -> Any:
    fixed_point = fixed_point_by_broyden(section, parameters, omega, omega_h, engine, digits=digits)
    precision = fixed_point.return_map.precision
    return cycle_in_precision(
        fixed_point, precision, precision_of_bits(precision.bits + _EXTRA_BITS)
    )


def fixed_point_by_broyden(
    section: Section[C],
    parameters: Parameters,
    omega: Fraction,
    omega_h: Fraction,
    engine: Engine,
    *,
    digits: int,
) -> FixedPoint[C]:
    """Solve for the cycle of `cycle_by_broyden` in one arithmetic, without a measure of its
    error.

    Args:
        section, parameters, omega, omega_h, engine: As for `cycle_by_broyden`.
        digits: The significant digits that the arithmetic holds.

    Raises:
        NoSuchCycleError: If there is no such cycle.
    """
    distance = abs(omega - omega_h)
    precision = precision_near_omega_h(parameters, omega_h, distance, digits + 4)
    return_map = ReturnMap(section, parameters, omega, engine, precision)
    unstable, slow, _ = (
        float(value.re) for value in equilibrium(parameters, omega_h, "noninverted").eigenvalues
    )
    if decimal_logarithm(distance) * (-slow / unstable - 1) < _STRONG_CONTRACTION:
        point = return_map.unstable_manifold_crossing()
        zero = 0 * point[0]
        matrix: Any = ((zero, zero), (zero, zero))
    else:
        point = (
            _predicted(return_map, omega - omega_h)
            if section is LIBRATING
            else return_map.unstable_manifold_crossing()
        )
        matrix = return_map(point).jacobian
    return _fixed_point(return_map, point, matrix, distance)


def _predicted(return_map: ReturnMap[C], above: Fraction) -> tuple[Any, Any]:
    """Predict the start (gamma_bar_0, v_0) of the librating limit cycle at a distance above Omega_h
    [rad/s].

    The family is followed in its period to about the root of ``above``.
    """
    family = PeriodContinuation(return_map.parameters, return_map.engine)
    while 100 * family.change >= abs(above) and abs(above) < abs(family.distance):
        family.extend_towards(4 * abs(above))
    half_period = return_map.precision.number(family.asymptotics.half_period(above))
    return predicted_state(family.latest, half_period, return_map.precision)


def _fixed_point(
    return_map: ReturnMap[C], point: tuple[Any, Any], matrix: Any, distance: Fraction
) -> FixedPoint[C]:
    """Solve for a fixed point of the return map by Broyden's iteration in the map's arithmetic,
    until the next step would be rounding.

    Raises NoSuchCycleError if it does not converge, or leaves the neighbourhood of the connection.
    """
    section, precision = return_map.section, return_map.precision
    pi = precision.pi
    lost = NoSuchCycleError("the shooting iteration left the neighbourhood of the connection")
    (a, b), (c, d) = matrix
    # Rounding moves the splitting by epsilon, so it moves the start by epsilon / distance.
    resolved = precision.number(precision.epsilon / distance)
    stop = StoppingRule(_MAX_STEPS, lost, tolerance=resolved, stall_tolerance=_ROUNDING_STEP)
    step: tuple[Any, Any] | None = None
    while True:
        end = return_map.flight(point).state
        residual = return_map.residual(end, point)
        if step is not None:
            # The residual's derivative is the map's less 1. The residual after the step shows its
            # error.
            norm = step[0] * step[0] + step[1] * step[1]
            by = step[0] / norm, step[1] / norm
            a, b = a + residual[0] * by[0], b + residual[0] * by[1]
            c, d = c + residual[1] * by[0], d + residual[1] * by[1]
        determinant = (1 - a) * (1 - d) - b * c
        step = (
            ((1 - d) * residual[0] + b * residual[1]) / determinant,
            ((1 - a) * residual[1] + c * residual[0]) / determinant,
        )
        point = point[0] + step[0], point[1] + step[1]
        # Librating cycles are next to the saddle on their section: their distances from it are the
        # scale.
        scales = (
            (pi - point[0], -point[1])
            if section is LIBRATING
            else (precision.number(distance),) * 2
        )
        if not all(float(scale) > 0 for scale in scales):
            raise lost
        size = max(abs(change / scale) for change, scale in zip(step, scales, strict=True))
        before = stop.sizes[-1] if stop.sizes else size
        if stop.converged(size) or size * size / before < resolved:
            return FixedPoint(return_map, point, return_map(point), tuple(map(float, stop.sizes)))


def with_uncertainty_of_omega_h(
    cycle: C,
    section: Section[C],
    omega_h: Measured,
    distance: Fraction,
    piece_length: Fraction,
    engine: Engine,
) -> C:
    """Return a limit cycle with half-widths that include the effect of Omega_h's uncertainty on its
    speed.

    All numbers are computed once more at another speed, moved by a thousandth of the distance from
    the nearer end of the branch. Up to a thousandth they change in proportion to the speed
    (docs/error_budgets.md). Twice that part of the change is added.

    Args:
        cycle: The cycle at exactly Omega_h plus or minus the distance.
        section: Its section.
        omega_h: Omega_h [rad/s].
        distance: The distance of the speed from Omega_h [rad/s].
        piece_length: The length of the branch from Omega_h on [rad/s].
        engine: The engine of the flights.
    """
    moved = min(distance, piece_length - distance) * _SPEED_MOVE
    too_close = distance < MIN_SHOOTING_DISTANCE
    precision = (
        precision_near_omega_h(cycle.parameters, omega_h.value, distance, 0)
        if too_close
        else DOUBLE
    )
    # Away from Omega_h, towards which everything is steeper.
    ahead = moved if cycle.omega.value > omega_h.value else -moved
    return_map = ReturnMap(section, cycle.parameters, cycle.omega.value + ahead, engine, precision)
    first, second = (
        precision.number(
            getattr(cycle, name).value + ahead * getattr(cycle, f"d{name}_domega").value
        )
        for name in section.coordinate_names
    )
    numbers = numbers_at(return_map, (first, second), return_map((first, second)))
    relative_uncertainty = HALF_WIDTH_FACTOR * omega_h.uncertainty / moved
    widened = {"omega": Measured(cycle.omega.value, omega_h.uncertainty)}
    for name in number_names(section):
        number: Measured = getattr(cycle, name)
        change = abs(fraction(numbers[name]) - number.value)
        widened[name] = Measured(number.value, number.uncertainty + change * relative_uncertainty)
    return replace(cycle, **widened)  # type: ignore[arg-type]
