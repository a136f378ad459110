"""Limit cycles by Newton shooting: fixed points of a section's return map.

The iteration starts from the one-harmonic law, or from harmonic balance where the law is too far.
The period is the flight time times the number of flights in a period. The multipliers are the map's
to that power. The flow's derivatives come from the variational equations. `error_budget` has the
half-widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from typing import TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle
from tippedisk_verify.cycles.shooting.error_budget import cycle_in_precision, cycle_to_digits
from tippedisk_verify.cycles.shooting.newton import FixedPoint, StoppingRule, newton, section_size
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.errors import InputError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import DOUBLE, Precision, checked_digits
from tippedisk_verify.theory.one_harmonic_law import section_crossing

__all__ = [
    "MAX_DISTANCE_FROM_LAW",
    "MIN_SHOOTING_DISTANCE",
    "NEAR_HOPF_DISTANCE",
    "one_harmonic_guess",
    "shoot",
    "shoot_limit_cycle",
]

C = TypeVar("C", bound=Cycle)

#: A distance [rad/s] from the Hopf point. There the slow multiplier is some 1e-12 short of 1. The
#: rounding of half a period, some 1e-14, moves the amplitude by a percent in double. Closer, the
#: law is nearer to the cycle than shooting.
NEAR_HOPF_DISTANCE = Fraction(1, 10**12)
#: A distance [rad/s] from Omega_h. Closer, shooting in double does not settle reliably.
MIN_SHOOTING_DISTANCE = Fraction(1, 10**5)
_MAX_STEPS = 25
# The largest amplitude [rad] at which shooting starts from the law. Beyond it harmonic balance
# takes fewer steps.
_MAX_LAW_AMPLITUDE = 2.5
#: The largest relative distance of a cycle's amplitude from the law's. The law's own error at
#: `_MAX_LAW_AMPLITUDE` is a fifth.
MAX_DISTANCE_FROM_LAW = 0.4


def shoot(
    return_map: ReturnMap[C], guess: Sequence[float], *, within: float = math.inf
) -> FixedPoint[C]:
    """Solve for a fixed point by damped Newton iteration in double.

    The iteration does not follow an amplitude below a fifth of the guess's: it then shrinks towards
    the equilibrium, which is the trivial solution.

    Args:
        return_map: The map at the speed wanted, in double.
        guess: The section's two coordinates.
        within: The largest relative distance of the first coordinate from the guess's. A cycle
            farther away is not trusted.

    Raises:
        InputError: If the guess does not have two components.
        NoSuchCycleError: If the iteration does not converge, shrinks towards the equilibrium, or
            ends far from its guess.
    """
    if len(guess) != 2:
        raise InputError(
            f"a guess has two components: {' and '.join(return_map.section.coordinate_names)}"
        )
    point = (DOUBLE.number(guess[0]), DOUBLE.number(guess[1]))
    scale = section_size(point)
    failure = NoSuchCycleError(f"the shooting iteration has not converged after {_MAX_STEPS} steps")
    # The round-off of half a period is some hundred ulps of the state.
    stop = StoppingRule(_MAX_STEPS, failure, tolerance=1e-15 * scale, stall_tolerance=1e-12 * scale)
    cycle = newton(
        return_map, point, stop, lambda iterate: section_size(iterate.image.residual), damped=True
    )
    if abs(cycle.point[0] - point[0]) >= within * abs(point[0]):
        raise NoSuchCycleError("the shooting iteration ended far from its guess")
    return cycle


@ignore_numpy_errors()
def shoot_limit_cycle(
    parameters: Parameters,
    omega: object,
    engine: Engine,
    *,
    digits: int = 12,
    guess: Sequence[float] | None = None,
    precision: Precision | None = None,
) -> LimitCycle:
    """Return the librating limit cycle at ``omega`` by shooting, each number to about ``digits``
    significant digits.

    Up to 12 digits everything runs in double if that holds them; close to the Hopf point it does
    not. A wider arithmetic measures the error only where the budget in double is too wide for the
    digits.

    Args:
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        engine: The engine of the flights.
        digits: The significant digits wanted.
        guess: (gamma_bar, v) [rad, rad/s] on the section. Without it harmonic balance provides one.
        precision: The arithmetic. If given, the digits are those of this arithmetic.

    Raises:
        InputError: If the speed is not positive.
        NoSuchCycleError: If the search fails.
        AccuracyError: If the digits are not reached.
    """
    return_map = ReturnMap(LIBRATING, parameters, checked_speed(omega), engine)
    digits = checked_digits(digits)
    fixed_point = None
    if guess is None:
        with suppress(NoSuchCycleError):
            fixed_point = shoot(
                return_map, one_harmonic_guess(return_map), within=MAX_DISTANCE_FROM_LAW
            )
    if fixed_point is None:
        if guess is None:
            from tippedisk_verify.cycles.collocation.collocation_cycles import (
                collocation_guess,  # loads collocation
            )

            guess = collocation_guess(parameters, return_map.omega)
        fixed_point = shoot(return_map, guess)
    return (
        cycle_to_digits(fixed_point, digits)
        if precision is None
        else cycle_in_precision(fixed_point, precision)
    )


def one_harmonic_guess(return_map: ReturnMap[LimitCycle]) -> tuple[float, float]:
    """Return the one-harmonic law's cycle as a guess for `shoot`.

    The law costs nothing and is good where cycles are small.

    Args:
        return_map: The map at the speed wanted, in double.

    Returns:
        (gamma_bar, v) [rad, rad/s] on the section.

    Raises:
        NoSuchCycleError: If the law has no cycle at the speed, or one that is too large.
    """
    law = section_crossing(return_map.parameters.constants_in(DOUBLE), float(return_map.omega))
    if law is None or law[0] >= _MAX_LAW_AMPLITUDE:
        raise NoSuchCycleError("the one-harmonic law has no cycle at this speed that is a guess")
    return law[0], law[1]
