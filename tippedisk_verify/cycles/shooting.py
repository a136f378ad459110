"""Limit cycles by Newton shooting: fixed points of a section's return map.

T is the flight time times the flights of a period, and the multipliers are the map's to that power. The flow's
derivatives come from the variational equations. What the numbers may be off is the subject of `error_budget`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TypeVar

from tippedisk_verify.cycles.error_budget import cycle_in, cycle_to_digits
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle
from tippedisk_verify.cycles.newton import FixedPoint, Stop, newton, section_size
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.cycles.spectral import approximate_cycle
from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision, checked_digits
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.theory.harmonic_balance import section_start

__all__ = ["LimitCycle", "limit_cycle", "shoot", "shoot_from_law"]

C = TypeVar("C", bound=Cycle)

_MOST_STEPS = 25
_LAW_SERVES = 2.5  # rad; beyond, harmonic balance takes fewer steps than shooting from the law
_NEAR_THE_LAW = 0.4  # relative; the law's own error at that amplitude is a fifth


def shoot(return_map: ReturnMap[C], guess: Sequence[float]) -> FixedPoint[C]:
    """Damped Newton iteration in double from a guess of the section's two coordinates.

    Raises NoSuchCycleError if it does not converge, or if it shrinks towards the equilibrium, which is the trivial
    solution: an amplitude below a fifth of the guess's is not followed.
    """
    if len(guess) != 2:
        raise InputError(f"a guess has two components: {' and '.join(return_map.section.names)}")
    point = (DOUBLE.number(guess[0]), DOUBLE.number(guess[1]))
    scale = section_size(point)
    failure = NoSuchCycleError(f"the shooting iteration has not converged after {_MOST_STEPS} steps")
    # Round-off of half a period: some hundred ulps of the state.
    stop = Stop(_MOST_STEPS, failure, small=1e-15 * scale, near=1e-12 * scale)
    return newton(return_map, point, stop, lambda iterate: section_size(iterate.image.residual), damped=True)


@undisturbed
def limit_cycle(
    parameters: Parameters,
    omega: object,
    engine: Engine,
    *,
    digits: int = 12,
    guess: Sequence[float] | None = None,
    precision: Precision | None = None,
) -> LimitCycle:
    """The limit cycle at ``omega`` [rad/s], each number to about ``digits`` significant digits.

    Without a ``guess`` (gamma_bar, v) harmonic balance of the linear law provides one: the laws' cycles differ little.
    Up to 12 digits everything runs in double if that holds them (close to the Hopf point it does not); a wider
    arithmetic measures the error only where the budget in double is too wide for the digits. ``precision`` fixes the
    arithmetic, and then the digits are what it gives. Raises InputError for a speed that is not positive,
    NoSuchCycleError where the search fails, AccuracyError if the digits are not reached.
    """
    return_map = ReturnMap(LIBRATING, parameters, checked_speed(omega), engine)
    digits = checked_digits(digits)
    fixed_point = None if guess is not None else shoot_from_law(return_map)
    if fixed_point is None:
        start = approximate_cycle(parameters, return_map.omega) if guess is None else guess
        fixed_point = shoot(return_map, start)
    return cycle_to_digits(fixed_point, digits) if precision is None else cycle_in(fixed_point, precision)


def shoot_from_law(return_map: ReturnMap[LimitCycle]) -> FixedPoint[LimitCycle] | None:
    """Newton's iteration from the one-harmonic law, which costs nothing and is good where cycles are small.

    None where it leads nowhere; a cycle far from its guess is not trusted.
    """
    law = section_start(return_map.parameters.at(DOUBLE), float(return_map.omega))
    if law is not None and law[0] < _LAW_SERVES:
        with suppress(NoSuchCycleError):
            fixed_point = shoot(return_map, law[:2])
            if abs(fixed_point.point[0] / law[0] - 1) < _NEAR_THE_LAW:
                return fixed_point
    return None
