"""The cycle that a user asks for at a speed: `Disk.limit_cycle` and `Disk.rotating_cycle`.

Most are found by shooting from a law. The others need the disk's families, which `cached_locator`
keeps.
"""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.cycles.shooting.error_budget import cycle_to_digits
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING
from tippedisk_verify.cycles.shooting.shoot import (
    MAX_DISTANCE_FROM_LAW,
    NEAR_HOPF_DISTANCE,
    one_harmonic_guess,
    shoot,
)
from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.precision import checked_digits
from tippedisk_verify.theory.hopf import distance_below_crit

if TYPE_CHECKING:
    from tippedisk_verify.cycles.families.family import CycleGuess
    from tippedisk_verify.cycles.locator import CycleLocator, GuessesAtSpeed

__all__ = [
    "cycle_from_guess",
    "cycles_from_guesses",
    "librating_cycle_at",
    "librating_cycles_at",
    "rotating_cycle_at",
]

C = TypeVar("C", bound=Cycle)


def _locator(parameters: Parameters, engine: Engine) -> CycleLocator:
    """Return the disk's `CycleLocator`, which is cached.

    It is imported here, because most speeds need neither it nor the families that it loads.
    """
    from tippedisk_verify.cycles.locator import cached_locator

    return cached_locator(parameters, engine)


def librating_cycle_at(
    parameters: Parameters,
    omega: object,
    engine: Engine,
    *,
    digits: int = 12,
    stable: bool | None = None,
    half_widths: bool = True,
) -> LimitCycle:
    """Return the librating limit cycle at ``omega``, to ``digits`` significant digits, however
    close to Omega_h the speed is.

    Args:
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        engine: The engine of the flights.
        digits: The significant digits wanted.
        stable: True for a stable cycle, False for an unstable one. None prefers the stable one of
            several.
        half_widths: If False, the numbers have no half-widths.

    Raises:
        InputError: If the speed is not positive.
        NoSuchCycleError: If the search fails.
        AccuracyError: If the digits are not reached.
    """
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    cycle: LimitCycle | None = None
    newborn = (
        abs(distance_below_crit(parameters, speed)) < NEAR_HOPF_DISTANCE
        and not _locator(parameters, engine).family_failure
    )
    # Mostly the law leads to a stable cycle, and nothing else is needed
    if stable is not False and not newborn:
        return_map, fixed_point = ReturnMap(LIBRATING, parameters, speed, engine), None
        with suppress(NoSuchCycleError):
            fixed_point = shoot(
                return_map, one_harmonic_guess(return_map), within=MAX_DISTANCE_FROM_LAW
            )
        if fixed_point is not None:
            cycle = cycle_to_digits(fixed_point, digits, half_widths=half_widths)
            if cycle.stable:
                return cycle
    at_speed = _locator(parameters, engine).librating_guesses_at(speed)
    if cycle and stable is None and not at_speed.guesses:
        return cycle
    cycles = cycles_from_guesses(at_speed, digits, half_widths=half_widths)
    wanted = [cycle for cycle in cycles if cycle.stable is (stable is not False)]
    if not wanted and stable is not None:
        kind, other = ("stable", "unstable") if stable else ("unstable", "stable")
        raise NoSuchCycleError(
            f"no {kind} limit cycle found at {float(speed):.10g} rad/s: the one found is {other}"
        )
    return (wanted or cycles)[0]


def librating_cycles_at(
    parameters: Parameters, omega: Fraction, *, engine: Engine, half_widths: bool = True
) -> list[LimitCycle]:
    """Return all librating limit cycles at a speed to 12 digits, from the smallest amplitude on.

    If the family has no cycle at the speed, `librating_cycle_at` searches for one outside the
    family.

    Args:
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        engine: The engine of the flights.
        half_widths: If False, the numbers have no half-widths.

    Raises:
        InputError: If the speed is not positive.
        NoSuchCycleError: If the search fails.
        AccuracyError: If the digits are not reached.
    """
    at_speed = _locator(parameters, engine).librating_guesses_at(omega)
    if at_speed.guesses:
        return cycles_from_guesses(at_speed, half_widths=half_widths)
    return [librating_cycle_at(parameters, omega, engine, half_widths=half_widths)]


def rotating_cycle_at(
    parameters: Parameters,
    omega: object,
    engine: Engine,
    *,
    stable: bool = True,
    digits: int = 12,
    half_widths: bool = True,
) -> RotatingCycle:
    """Return the rotating limit cycle at ``omega``, to ``digits`` significant digits.

    Stable ones lie between the family's fold and Omega_h, unstable ones from the fold upward.

    Args:
        parameters: The disk and its friction law.
        omega: The speed [rad/s].
        engine: The engine of the flights.
        stable: True for the stable cycle, False for the unstable one.
        digits: The significant digits wanted.
        half_widths: If False, the numbers have no half-widths.

    Raises:
        InputError: If the speed is not positive.
        NoSuchCycleError: If the search fails.
        AccuracyError: If the digits are not reached.
    """
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    if stable:
        # The saddle's unstable manifold is lost where the disk has no connection
        # (NoConnectionError), where the speed is Omega_h to rounding (ZeroDivisionError), and next
        # to the fold.
        with suppress(NoSuchCycleError, NoConnectionError, ZeroDivisionError):
            # The saddle's unstable manifold leads there where the cycle is not next to the fold.
            return_map = ReturnMap(ROTATING, parameters, speed, engine)
            fixed_point = shoot(return_map, return_map.unstable_manifold_crossing())
            cycle = cycle_to_digits(fixed_point, digits, half_widths=half_widths)
            if cycle.stable:
                return cycle
    at_speed = _locator(parameters, engine).rotating_guesses_at(speed, stable=stable)
    (cycle,) = cycles_from_guesses(at_speed, digits, half_widths=half_widths)
    return cycle


def cycles_from_guesses(
    at_speed: GuessesAtSpeed[C], digits: int = 12, *, half_widths: bool = True
) -> list[C]:
    """Compute all limit cycles at a speed, to ``digits`` digits.

    Args:
        at_speed: The guesses at the speed.
        digits: The significant digits wanted.
        half_widths: If False, the numbers have no half-widths.

    Raises:
        NoSuchCycleError: If there is no cycle, or a search fails.
        AccuracyError: If doubles cannot separate two cycles at a fold, or the digits are not
            reached.
    """
    if not at_speed.guesses:
        raise NoSuchCycleError(at_speed.no_cycle_reason)
    return [
        cycle_from_guess(at_speed, guess, digits, half_widths=half_widths)
        for guess in at_speed.guesses
    ]


def cycle_from_guess(
    at_speed: GuessesAtSpeed[C], guess: CycleGuess, digits: int = 12, *, half_widths: bool = True
) -> C:
    """Compute the limit cycle to which one of the guesses at a speed leads, to ``digits`` digits.

    Args:
        at_speed: The guesses at the speed.
        guess: One of them.
        digits: The significant digits wanted.
        half_widths: If False, the numbers have no half-widths.

    Raises:
        NoSuchCycleError: If the search fails.
        AccuracyError: If doubles cannot separate the cycle from its neighbour at a fold, or the
            digits are not reached.
    """
    if guess.has_coordinates:
        return at_speed.shoot(guess, digits, half_widths=half_widths)
    # Loaded only here: few speeds are as close to Omega_h.
    from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import cycle_by_broyden
    from tippedisk_verify.cycles.near_omega_h.cycles_by_passages import cycle_by_passages

    section, parameters, omega = at_speed.section, at_speed.parameters, at_speed.omega
    assert at_speed.omega_h is not None
    cycle = cycle_by_passages(section, parameters, omega, at_speed.engine, digits)
    if cycle is not None:
        return cycle
    return cycle_by_broyden(
        section, parameters, omega, at_speed.omega_h, at_speed.engine, digits=digits
    )
