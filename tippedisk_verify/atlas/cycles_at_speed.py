"""Single limit cycles: at a speed, or at a distance from Omega_h that doubles need not resolve."""

from __future__ import annotations

import math
from contextlib import suppress
from fractions import Fraction
from typing import Any, TypeVar

from tippedisk_verify.atlas.locator import Location, Locator, Start, locator
from tippedisk_verify.connection.near_connection import DOUBLE_SHOOTS, with_speed
from tippedisk_verify.connection.splitting import MOST_DIGITS, splitting_zero
from tippedisk_verify.cycles.error_budget import cycle_to_digits
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import LIBRATING, ROTATING, Section
from tippedisk_verify.cycles.shooting import shoot, shoot_from_law
from tippedisk_verify.errors import AccuracyError, InputError, NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.theory.hopf import criticality, omega_crit

__all__ = ["cycle_above", "cycle_at", "rotating_below", "rotating_cycle"]

C = TypeVar("C", bound=Cycle)

_SMALLEST = 800  # zeros after the point that a distance from Omega_h may have


def cycle_at(
    parameters: Parameters, omega: object, engine: Engine, *, digits: int = 12, stable: bool | None = None
) -> LimitCycle:
    """The limit cycle at ``omega`` [rad/s], to ``digits`` significant digits, however close to Omega_h that is.

    Where a speed has several it is the stable one, or the one that ``stable`` asks for. Raises InputError for a speed
    that is not positive, NoSuchCycleError where the search fails, AccuracyError if the digits are not reached.
    """
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    cycle: LimitCycle | None = None
    if stable is not False:  # mostly the law leads to a stable cycle, and nothing else is asked
        fixed_point = shoot_from_law(ReturnMap(LIBRATING, parameters, speed, engine))
        if fixed_point is not None:
            cycle = cycle_to_digits(fixed_point, digits)
            if cycle.stable:
                return cycle
    location = locator(parameters, engine).librating(speed)
    if cycle and stable is None and not location.starts:
        return cycle
    cycles = location.cycles(digits)
    wanted = [cycle for cycle in cycles if cycle.stable is (stable is not False)]
    if not wanted and stable is not None:
        kind, other = ("stable", "unstable") if stable else ("unstable", "stable")
        raise NoSuchCycleError(f"no {kind} limit cycle found at {float(speed):.10g} rad/s: the one found is {other}")
    return (wanted or cycles)[0]


def rotating_cycle(
    parameters: Parameters, omega: object, engine: Engine, *, stable: bool = True, digits: int = 12
) -> RotatingCycle:
    """The rotating limit cycle at ``omega`` [rad/s], to ``digits`` significant digits.

    Stable ones lie between the family's fold and Omega_h, unstable ones from the fold upward. Raises InputError for a
    speed that is not positive, NoSuchCycleError where the search fails, AccuracyError if the digits are not reached.
    """
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    if stable:
        with suppress(NoSuchCycleError, NoConnectionError, ZeroDivisionError):  # doubles see Omega_h itself
            # The saddle's unstable branch leads there where the cycle is not next to the fold.
            return_map = ReturnMap(ROTATING, parameters, speed, engine)
            cycle = cycle_to_digits(shoot(return_map, return_map.end_of_branch()), digits)
            if cycle.stable:
                return cycle
    (cycle,) = locator(parameters, engine).rotating(speed, stable=stable).cycles(digits)
    return cycle


@undisturbed
def cycle_above(parameters: Parameters, above: object, engine: Engine, *, digits: int = 12) -> LimitCycle:
    """The limit cycle at Omega_h + ``above`` [rad/s], to ``digits`` significant digits.

    Raises InputError unless ``above`` is a positive decimal, NoSuchCycleError where the family does not reach as far or
    the search fails, AccuracyError if the digits are not reached.
    """
    return _beside_omega_h(LIBRATING, parameters, above, engine, digits)


def rotating_below(parameters: Parameters, below: object, engine: Engine, *, digits: int = 12) -> RotatingCycle:
    """The stable rotating limit cycle at Omega_h - ``below`` [rad/s], to ``digits`` significant digits.

    Raises InputError unless ``below`` is a positive decimal, NoSuchCycleError beyond the fold, AccuracyError if the
    digits are not reached.
    """
    return _beside_omega_h(ROTATING, parameters, below, engine, digits)


def _beside_omega_h(section: Section[C], parameters: Parameters, offset: object, engine: Engine, digits: int) -> C:
    """The cycle at a distance from Omega_h, on the piece of the section's family that ends there."""
    above = section is LIBRATING
    side, cycles = ("above", "limit cycles") if above else ("below", "stable rotating cycles")
    distance, omega_h_digits = _checked_distance(offset, side, digits)
    disk_locator = locator(parameters, engine)
    room = _room(section, disk_locator)
    if distance >= room:
        raise NoSuchCycleError(f"{cycles} lie less than {float(room):.6g} rad/s {side} Omega_h, not {shown(offset)}")
    omega_h = splitting_zero(parameters, disk_locator.omega_h, engine, omega_h_digits).omega_h
    omega = omega_h.value + (distance if above else -distance)
    location: Location[Any]
    if distance < DOUBLE_SHOOTS:  # the branch leads there: the family is not needed
        location = Location(section, parameters, engine, omega, (Start(None),), omega_h=omega_h.value)
    elif above:
        location = disk_locator.librating(omega, omega_h.value)
    else:
        location = disk_locator.rotating(omega, stable=True, omega_h=omega_h.value)
    if not location.starts:
        raise NoSuchCycleError(location.refusal)
    at_speed: Any = location.cycle(location.starts[-1], digits)
    cycle: C = with_speed(at_speed, section, omega_h, distance, room, engine)
    if cycle.period.uncertainty > cycle.period.value / 10**digits:
        raise AccuracyError(f"T has fewer than {digits} digits this close to Omega_h: ask for {digits + 10}")
    return cycle


def _room(section: Section[Any], disk_locator: Locator) -> Fraction:
    """How far from Omega_h [rad/s] the piece of the section's family reaches that ends there."""
    omega_h = disk_locator.omega_h
    if section is ROTATING:
        return omega_h - Fraction(disk_locator.rotations.near_fold().omega)
    if criticality(disk_locator.parameters) == "supercritical" and disk_locator.attracts:
        # Mostly there is no fold, and those there are lie in between.
        return omega_crit(disk_locator.parameters, 20).value - omega_h
    (_, start), (_, end) = disk_locator.family.ends[-2:]
    if start < end:
        raise NoSuchCycleError(
            f"next to Omega_h = {end:.10g} rad/s the limit cycles of this disk lie below it, down to a fold at"
            f" {start:.10g} rad/s: its saddle value is positive"
        )
    return Fraction(start) - omega_h


def _checked_distance(offset: object, side: str, digits: int) -> tuple[Fraction, int]:
    """A distance from Omega_h [rad/s], and the digits of Omega_h that a cycle there needs for ``digits`` of its own.

    Raises InputError unless it is a positive decimal that is not too small.
    """
    distance = exact(offset)
    if distance.pi_multiple or distance.rational <= 0:
        raise InputError(f"the distance {side} Omega_h must be a positive decimal, not {shown(offset)}")
    digits = checked_digits(digits)
    value = distance.rational
    zeros = max(0, math.ceil(math.log10(value.denominator) - math.log10(value.numerator)))  # of huge integers too
    if zeros > _SMALLEST:
        raise InputError(f"distances {side} Omega_h are offered down to 1e-{_SMALLEST} rad/s, not 1e-{zeros}")
    if zeros + digits > MOST_DIGITS:
        raise InputError(
            f"Omega_h is offered to {MOST_DIGITS} digits: {digits} at 1e-{zeros} rad/s {side} it need more"
        )
    # The speed must be right to the digits asked for, and T depends on the logarithm of the distance.
    return value, zeros + digits + 6
