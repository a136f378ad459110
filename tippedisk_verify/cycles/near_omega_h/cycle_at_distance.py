"""The cycle that a user asks for at a distance from Omega_h, which doubles need not resolve."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, TypeVar, cast

from tippedisk_verify.connection.omega_h_digits import rounded_up_digits
from tippedisk_verify.connection.splitting import MAX_DIGITS, splitting_zero
from tippedisk_verify.cycles.limit_cycle import Cycle, LimitCycle, RotatingCycle
from tippedisk_verify.cycles.locator import CycleLocator, GuessesAtSpeed, cached_locator
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import (
    cycle_by_broyden,
    with_uncertainty_of_omega_h,
)
from tippedisk_verify.cycles.near_omega_h.cycles_by_passages import cycle_by_passages
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, Section
from tippedisk_verify.cycles.shooting.shoot import MIN_SHOOTING_DISTANCE
from tippedisk_verify.errors import AccuracyError, InputError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.exact import exact, short_text
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import checked_digits
from tippedisk_verify.support.progress import subrange
from tippedisk_verify.theory.hopf import criticality, omega_crit

__all__ = ["cycle_above_omega_h", "rotating_cycle_below_omega_h"]

C = TypeVar("C", bound=Cycle)

# At smaller distances [rad/s] passages give twelve digits; at larger ones shooting in 64 bits does.
_MAX_PASSAGE_DISTANCE = 4 * MIN_SHOOTING_DISTANCE
_OMEGA_H_TIME_SHARE = 0.3  # the share of the time for a cycle that is over once Omega_h is known
_MAX_ZEROS = 800  # the largest number of zeros after the point of a distance from Omega_h


@ignore_numpy_errors()
def cycle_above_omega_h(
    parameters: Parameters, above: object, engine: Engine, *, digits: int = 12
) -> LimitCycle:
    """Return the librating limit cycle at Omega_h + ``above``, to ``digits`` significant digits.

    Args:
        parameters: The disk and its friction law.
        above: The distance from Omega_h [rad/s], a positive decimal.
        engine: The engine of the flights.
        digits: The significant digits wanted.

    Raises:
        InputError: If ``above`` is not a positive decimal.
        NoSuchCycleError: If the family does not reach as far, or the search fails.
        AccuracyError: If the digits are not reached.
    """
    return _cycle_near_omega_h(LIBRATING, parameters, above, engine, digits)


def rotating_cycle_below_omega_h(
    parameters: Parameters, below: object, engine: Engine, *, digits: int = 12
) -> RotatingCycle:
    """Return the stable rotating limit cycle at Omega_h - ``below``, to ``digits`` significant
    digits.

    Args:
        parameters: The disk and its friction law.
        below: The distance from Omega_h [rad/s], a positive decimal.
        engine: The engine of the flights.
        digits: The significant digits wanted.

    Raises:
        InputError: If ``below`` is not a positive decimal.
        NoSuchCycleError: If the speed lies beyond the fold.
        AccuracyError: If the digits are not reached.
    """
    return _cycle_near_omega_h(ROTATING, parameters, below, engine, digits)


def _cycle_near_omega_h(
    section: Section[C], parameters: Parameters, offset: object, engine: Engine, digits: int
) -> C:
    """Return the limit cycle at a distance from Omega_h, to ``digits`` significant digits.

    It is on the piece of the family that ends at Omega_h: librating cycles above, stable rotating
    ones below, as the section tells.
    """
    above = section is LIBRATING
    side, cycles = ("above", "limit cycles") if above else ("below", "stable rotating cycles")
    distance, omega_h_digits = _checked_distance(offset, side, digits)
    if distance < _MAX_PASSAGE_DISTANCE:
        place = distance if above else -distance
        passing = cycle_by_passages(section, parameters, place, engine, digits, from_omega_h=True)
        if passing is not None:
            return passing
    locator = cached_locator(parameters, engine)
    piece_length = _piece_length(section, locator)
    if distance >= piece_length:
        raise NoSuchCycleError(
            f"{cycles} lie less than {float(piece_length):.6g} rad/s {side} Omega_h, not "
            f"{short_text(offset)}"
        )
    with subrange(0, _OMEGA_H_TIME_SHARE):
        omega_h = splitting_zero(parameters, locator.omega_h, engine, omega_h_digits).omega_h
    omega = omega_h.value + (distance if above else -distance)
    with subrange(_OMEGA_H_TIME_SHARE, 1):
        cycle: Any = None
        if distance >= MIN_SHOOTING_DISTANCE:
            at_speed: GuessesAtSpeed[Any] = (
                locator.librating_guesses_at(omega, omega_h.value)
                if above
                else locator.rotating_guesses_at(omega, stable=True, omega_h=omega_h.value)
            )
            if not at_speed.guesses:
                raise NoSuchCycleError(at_speed.no_cycle_reason)
            if at_speed.guesses[-1].has_coordinates:
                cycle = at_speed.shoot(at_speed.guesses[-1], digits)
        if cycle is None:  # flights lead there: no family is needed
            cycle = cycle_by_broyden(
                section, parameters, omega, omega_h.value, engine, digits=digits
            )
    cycle = with_uncertainty_of_omega_h(cycle, section, omega_h, distance, piece_length, engine)
    if cycle.period.uncertainty > cycle.period.value / 10**digits:
        raise AccuracyError(
            f"T has fewer than {digits} digits this close to Omega_h: ask for {digits + 10}"
        )
    return cast("C", cycle)


def _piece_length(section: Section[Any], locator: CycleLocator) -> Fraction:
    """Return the length [rad/s] of the range of speeds over which limit cycles exist next to
    Omega_h.

    It is the length of the piece of the family that ends at Omega_h. Raises NoSuchCycleError if the
    piece lies on the other side of Omega_h.
    """
    omega_h = locator.omega_h
    if section is ROTATING:
        return omega_h - Fraction(locator.rotating_family.fold_guess().omega)
    if criticality(locator.parameters) == "supercritical" and locator.connection_attracts:
        # Cycles exist from Omega_h to Omega_crit: folds, if any, lie between these speeds.
        return omega_crit(locator.parameters, 20).value - omega_h
    (_, start), (_, end) = locator.librating_family.ends[-2:]
    if start < end:
        raise NoSuchCycleError(
            f"next to Omega_h = {end:.10g} rad/s the limit cycles of this disk lie below it, down "
            f"to a fold at"
            f" {start:.10g} rad/s: its saddle value is positive"
        )
    return Fraction(start) - omega_h


def _checked_distance(offset: object, side: str, digits: int) -> tuple[Fraction, int]:
    """Check a user's distance from Omega_h, and return it [rad/s] with the digits of Omega_h that a
    cycle there needs.

    ``digits`` is the number of digits wanted of the cycle. Raises InputError unless the distance is
    a positive decimal that is not too small for these digits.
    """
    distance = exact(offset)
    if distance.pi_multiple or distance.rational <= 0:
        raise InputError(
            f"the distance {side} Omega_h must be a positive decimal, not {short_text(offset)}"
        )
    digits = checked_digits(digits)
    value = distance.rational
    zeros = max(0, -decimal_magnitude(value))
    if zeros > _MAX_ZEROS:
        raise InputError(
            f"distances {side} Omega_h are offered down to 1e-{_MAX_ZEROS} rad/s, not 1e-{zeros}"
        )
    if zeros + digits > MAX_DIGITS:
        raise InputError(
            f"Omega_h is offered to {MAX_DIGITS} digits: {digits} at 1e-{zeros} rad/s {side} it "
            f"need more"
        )
    # The speed must be right to the digits asked for, and T depends on the logarithm of the
    # distance.
    return value, rounded_up_digits(zeros + digits + 6)
