"""Limit cycles so close to Omega_h that doubles see nothing of them: at Omega_h + D, with D down to 1e-100 and below.

Omega_h itself must be known to more digits than D has zeros; the manifolds' splitting provides it. The family followed
in its period predicts the cycle, and shooting in an arithmetic chosen from D corrects it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import Any, TypeVar

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.limit_of_cycles import PeriodContinuation, resolving
from tippedisk_verify.connection.splitting import MOST_DIGITS, splitting_zero
from tippedisk_verify.cycles.continuation import followed_cycle
from tippedisk_verify.cycles.half_map import half_map, newton_step
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.cycles.shooting import LimitCycle, Shot, limit_cycle, measured_cycle
from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError, OutsideFamilyError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import Precision, checked_digits
from tippedisk_verify.theory.equilibria import equilibrium, saddle_value_sign
from tippedisk_verify.theory.hopf import criticality, omega_crit

__all__ = [
    "DOUBLE_SHOOTS",
    "checked_distance",
    "cycle_above",
    "cycle_at",
    "cycle_near",
    "resolved_omega_h",
    "with_speed",
]

DOUBLE_SHOOTS = Fraction(1, 10**5)  # rad/s; closer, shooting in double does not settle reliably
_NEXT_TO_OMEGA_H = Fraction(1, 100)  # rad/s above it; further away, shooting and continuation fail for other reasons
_MOST_STEPS = 12
_SMALLEST = 800  # zeros after the point that D may have
_C = TypeVar("_C", bound=Cycle)


def cycle_above(parameters: Parameters, above: object, engine: Engine, *, digits: int = 12) -> LimitCycle:
    """The limit cycle at Omega_h + ``above`` [rad/s], to ``digits`` significant digits.

    Raises InputError unless ``above`` is positive and the family reaches as far, NoSuchCycleError where none is found,
    Shortfall if the digits are not reached.
    """
    value, wanted = checked_distance(above, "above", digits)
    near = bisect_omega_h(parameters, engine, confirm=False).omega_h
    room = _room_above(parameters, near.value, engine)
    if value >= room:
        raise InputError(f"limit cycles lie less than {float(room):.6g} rad/s above Omega_h, not {shown(above)}")
    omega_h = splitting_zero(parameters, near.value, engine, wanted).omega_h
    omega = omega_h.value + value
    if value > room / 2:
        cycle = followed_cycle(parameters, omega, engine, digits=digits)
    else:
        cycle = cycle_near(parameters, omega, omega_h.value, engine, digits=digits)
    widened = with_speed(cycle, omega_h, value, room)
    if widened.period.uncertainty > widened.period.value / 10**digits:
        raise Shortfall(f"T has fewer than {digits} digits this close to Omega_h: ask for {digits + 10}")
    return widened


def _room_above(parameters: Parameters, omega_h: Fraction, engine: Engine) -> Fraction:
    """How far above Omega_h [rad/s] the family's last piece reaches, the one that ends in the connection."""
    if criticality(parameters) == "supercritical" and saddle_value_sign(parameters, omega_h) < 0:
        return omega_crit(parameters, 20).value - omega_h  # mostly there is no fold, and those there are lie in between
    (_, start), (_, end) = LibratingFamily(parameters, engine).ends[-2:]
    if start < end:
        raise NoSuchCycleError(
            f"next to Omega_h = {end:.10g} rad/s the limit cycles of this disk lie below it, down to a fold at"
            f" {start:.10g} rad/s: its saddle value is positive"
        )
    return Fraction(start) - omega_h


def checked_distance(given: object, side: str, digits: int) -> tuple[Fraction, int]:
    """A distance from Omega_h [rad/s], and the digits of Omega_h that a cycle there needs for ``digits`` of its own.

    Raises InputError unless it is a positive decimal that is not too small.
    """
    distance = exact(given)
    if distance.pi_multiple or distance.rational <= 0:
        raise InputError(f"the distance {side} Omega_h must be a positive decimal, not {shown(given)}")
    checked_digits(digits)
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


def cycle_at(
    parameters: Parameters, omega: object, engine: Engine, *, digits: int = 12, stable: bool | None = None
) -> LimitCycle:
    """The limit cycle at ``omega`` [rad/s], to ``digits`` significant digits, however close to Omega_h that is.

    Where a speed has several it is the stable one, or the one that ``stable`` asks for. Raises InputError for a speed
    that is not positive, NoSuchCycleError where none is found, Shortfall if the digits are not reached.
    """
    speed = checked_speed(omega)
    try:
        return followed_cycle(parameters, speed, engine, digits=digits, stable=stable)
    except NoSuchCycleError as fault:
        omega_h = None
        with suppress(NoConnectionError, Shortfall):
            omega_h = resolved_omega_h(parameters, speed, engine)
        # The family itself is followed until doubles hold no more of it.
        near = 2 * DOUBLE_SHOOTS if isinstance(fault, OutsideFamilyError) else _NEXT_TO_OMEGA_H
        if omega_h is None or abs(speed - omega_h) > near:
            raise
        attracts = saddle_value_sign(parameters, omega_h) < 0
        if (speed < omega_h) is attracts:  # the reason in double may be off by more than the distance
            away, side = float(abs(omega_h - speed)), "below" if attracts else "above"
            raise NoSuchCycleError(
                f"no limit cycle found at {float(speed):.10g} rad/s, {away:.2g} rad/s {side} Omega_h"
            ) from None
        if stable is not None and stable is not attracts:
            raise
        return cycle_near(parameters, speed, omega_h, engine, digits=digits)


def resolved_omega_h(parameters: Parameters, speed: Fraction, engine: Engine) -> Fraction:
    """Omega_h [rad/s] to six digits of its distance from the speed, if they are so close. Raises as its methods do."""
    near = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    if abs(speed - near) > _NEXT_TO_OMEGA_H:
        return near
    digits = 20
    while True:
        omega_h = splitting_zero(parameters, near, engine, digits).omega_h
        if abs(speed - omega_h.value) > omega_h.uncertainty * 10**6:
            return omega_h.value
        digits *= 2


def cycle_near(
    parameters: Parameters,
    omega: Fraction,
    omega_h: Fraction,
    engine: Engine,
    *,
    digits: int = 12,
) -> LimitCycle:
    """The limit cycle at exactly ``omega`` [rad/s], next to ``omega_h``: their distance needs some digits.

    It lies above, or below where the saddle value is positive.

    Raises NoSuchCycleError where none is found, Shortfall if the digits are not reached.
    """
    above = omega - omega_h
    if abs(above) > DOUBLE_SHOOTS:
        guess = PeriodContinuation(parameters, engine).nearest(above)
        return limit_cycle(parameters, omega, engine, digits=digits, guess=guess)
    precision = resolving(parameters, omega_h, above, digits + 4)
    shot = _shot(parameters, omega, _predicted(parameters, above, engine), engine, precision)
    cycle: LimitCycle = measured_cycle(parameters, omega, shot, engine, precision)
    return cycle


def _predicted(parameters: Parameters, above: Fraction, engine: Engine) -> Sequence[Any]:
    """(gamma_bar_0, v_0) near the cycle, by the family followed down to about the square root of ``above``."""
    descent = PeriodContinuation(parameters, engine)
    if abs(above) >= abs(descent.above):
        return descent.nearest(above)
    while 100 * descent.change >= abs(above):
        descent.further(4 * abs(above))
    precision = resolving(parameters, descent.law.omega_h, above, 20)
    _, guess = descent.law.at(above, descent.here, precision)
    return guess[:2]


def _shot(
    parameters: Parameters,
    omega: Fraction,
    guess: Sequence[Any],
    engine: Engine,
    precision: Precision,
) -> Shot:
    """Newton's iteration in the arithmetic given, until the state's distance from the saddle has six digits or more."""
    state = (precision.number(guess[0]), precision.number(guess[1]))
    lost = NoSuchCycleError("the shooting iteration left the neighbourhood of the connection")
    iteration = NewtonIteration(_MOST_STEPS, lost, small=1e-6, near=0.0)
    while True:
        here = half_map(parameters, omega, state, engine, precision)
        step = newton_step(here.matrix, here.residual)
        size = max(abs(float(step[0] / (precision.pi - state[0]))), abs(float(step[1] / state[1])))
        if iteration.converged(size):
            return Shot(state, tuple(iteration.sizes), here)
        state = (state[0] + step[0], state[1] + step[1])
        if not float(precision.pi - state[0]) > 0 or not float(state[1]) < 0 or not size < 2:
            raise lost


def with_speed(cycle: _C, omega_h: Measured, above: Fraction, room: Fraction) -> _C:
    """The cycle ``above`` Omega_h (a rotating one: below it), its half-widths with what the speed's own does to them.

    ``room`` is Omega_crit - Omega_h [rad/s], for rotating cycles their fold's distance from Omega_h. With d the
    distance to the nearer end of the branch, close to which the numbers follow powers and logarithms of d, the
    logarithms of the multipliers change by at most about 2 / d of themselves per unit of speed, and so do the
    sensitivities, but for the middle of the branch, where those may vanish and change by what the number itself is to
    the square of the room. beta_max is the connection's own, plus what changes in proportion to Omega - Omega_h, or to
    its power -lambda_s / lambda_u if that is less than 1; towards Omega_crit it falls like a square root.
    """
    uncertainty = omega_h.uncertainty
    changes: dict[str, Measured] = {"omega": Measured(cycle.omega.value, uncertainty)}

    def widened(name: str, change: Fraction) -> None:
        number = getattr(cycle, name)
        changes[name] = Measured(number.value, number.uncertainty + change)

    share = 2 * uncertainty / min(above, room - above)
    for name in ("period", *cycle.unknowns):
        slope = f"d{name}_domega"
        size, steep = abs(getattr(cycle, name).value), abs(getattr(cycle, slope).value)
        widened(name, 2 * steep * uncertainty)
        widened(slope, (steep + 2 * size / room) * share)
    for name in ("log_multiplier_slow", "log_multiplier_fast"):
        widened(name, abs(getattr(cycle, name).value) * share)
    widened("multiplier_slow", abs(cycle.multiplier_slow.value * cycle.log_multiplier_slow.value) * share)
    for name in cycle.beside_the_saddle:
        widened(name, abs(getattr(cycle, name).value) * share)
    unstable, slow, _ = (
        float(value.re) for value in equilibrium(cycle.parameters, omega_h.value, "noninverted").eigenvalues
    )
    distances = (
        math.log10(room.numerator / room.denominator) - math.log10(above.numerator) + math.log10(above.denominator)
    )
    steeper = Fraction(10) ** math.ceil(max(0.0, 1 + slow / unstable) * distances)
    widened("beta_max", 4 * cycle.beta_max.value * uncertainty / (room - above) * steeper)
    return replace(cycle, **changes)  # type: ignore[arg-type]
