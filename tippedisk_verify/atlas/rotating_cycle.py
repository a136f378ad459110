"""Rotating limit cycles by Newton shooting on the turn map, in any precision and however close to Omega_h."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction

import numpy

from tippedisk_verify.atlas.branch import MANY
from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.limit_of_cycles import resolving
from tippedisk_verify.connection.near_connection import (
    DOUBLE_SHOOTS,
    checked_distance,
    resolved_omega_h,
    with_speed,
)
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.cycle_budget import Shot
from tippedisk_verify.cycles.family import Solver, in_batches
from tippedisk_verify.cycles.folds import rotation_fold
from tippedisk_verify.cycles.half_map import newton_step
from tippedisk_verify.cycles.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.limit_cycle import RotatingCycle
from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.cycles.rotating_family import RotatingFamily, unstable_top
from tippedisk_verify.cycles.section import ROTATING
from tippedisk_verify.cycles.shooting import converged, cycle_from, measured_cycle
from tippedisk_verify.cycles.turn_map import TurnFlights
from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow import default_lanes
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed, checked_speeds
from tippedisk_verify.model.exact import shown
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision, checked_digits
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["DEFAULT_COUNT", "rotating_below", "rotating_branch", "rotating_cycle", "rotating_family"]

DEFAULT_COUNT = 40  #: cycles of the overview of the family
_DOUBLE_DIGITS = 12

_MOST_STEPS = 12


def rotating_cycle(
    parameters: Parameters, omega: object, engine: Engine, *, stable: bool = True, digits: int = 12
) -> RotatingCycle:
    """The rotating limit cycle at ``omega`` [rad/s], to ``digits`` significant digits.

    Stable ones lie between the family's fold and Omega_h, unstable ones from the fold upward. Raises InputError for a
    speed that is not positive, NoSuchCycleError where none is found, Shortfall if the digits are not reached.
    """
    speed = checked_speed(omega)
    checked_digits(digits)
    if stable:
        with suppress(NoSuchCycleError, NoConnectionError):
            # The saddle's unstable branch leads there where the cycle is not next to the fold.
            shot = converged(TurnFlights(parameters, speed, engine, DOUBLE), unstable_top(parameters, speed, engine))
            cycle: RotatingCycle = cycle_from(parameters, speed, shot, engine, digits)
            if cycle.stable:
                return cycle
        with suppress(Shortfall, NoConnectionError):
            omega_h = resolved_omega_h(parameters, speed, engine)
            if 0 < omega_h - speed < DOUBLE_SHOOTS:
                return _beside(parameters, speed, omega_h, engine, digits)
    return of_family(rotating_family(parameters, engine), speed, stable=stable, digits=digits)


def rotating_family(parameters: Parameters, engine: Engine, solve: Solver | None = None) -> RotatingFamily:
    """The family of rotating cycles from Omega_h on. Raises NoConnectionError, or as `RotatingFamily`."""
    return RotatingFamily(parameters, engine, bisect_omega_h(parameters, engine, confirm=False).omega_h.value, solve)


def of_family(family: RotatingFamily, speed: Fraction, *, stable: bool, digits: int) -> RotatingCycle:
    """The family's cycle at a speed, before the fold or beyond it. Raises as `rotating_cycle` does."""
    parameters, engine = family.parameters, family.engine
    guess = family.guess(float(speed), stable=stable)
    shot = converged(TurnFlights(parameters, speed, engine, DOUBLE), guess)
    cycle: RotatingCycle = cycle_from(parameters, speed, shot, engine, digits)
    if cycle.stable is not stable:
        raise Shortfall(
            f"{float(speed):.17g} rad/s is so close to the fold that doubles cannot tell its two cycles apart"
        )
    return cycle


def rotating_below(parameters: Parameters, below: object, engine: Engine, *, digits: int = 12) -> RotatingCycle:
    """The stable rotating limit cycle at Omega_h - ``below`` [rad/s], to ``digits`` significant digits.

    Raises InputError unless ``below`` is a positive decimal, NoSuchCycleError beyond the fold, Shortfall if the digits
    are not reached.
    """
    distance, wanted = checked_distance(below, "below", digits)
    near = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    room = near - Fraction(rotating_family(parameters, engine).near_fold().omega)
    if distance >= room:
        raise NoSuchCycleError(
            f"stable rotating cycles lie less than {float(room):.6g} rad/s below Omega_h, not {shown(below)}"
        )
    omega_h = splitting_zero(parameters, near, engine, wanted).omega_h
    speed = omega_h.value - distance
    if distance < DOUBLE_SHOOTS:
        cycle = _beside(parameters, speed, omega_h.value, engine, digits)
    else:
        cycle = rotating_cycle(parameters, speed, engine, digits=digits)
    widened: RotatingCycle = with_speed(cycle, omega_h, distance, room)
    if widened.period.uncertainty > widened.period.value / 10**digits:
        raise Shortfall(f"T has fewer than {digits} digits this close to Omega_h: ask for {digits + 10}")
    return widened


def rotating_branch(
    parameters: Parameters, engine: Engine, omegas: Sequence[object] | None = None
) -> Iterator[RotatingCycle]:
    """The family in double: at each of these speeds [rad/s] the stable cycle, then the unstable one; or an overview.

    The overview goes from just below Omega_h through the fold to half a rad/s above Omega_crit. A hundred speeds and
    more, of the linear law, count as doubles and are solved together. Raises InputError for speeds that are no positive
    decimals, NoSuchCycleError where the family has no cycle at a speed.
    """
    speeds = None if omegas is None else checked_speeds(omegas)
    family = rotating_family(parameters, engine)
    if speeds is not None:
        if len(speeds) >= MANY and parameters.friction == "linear":
            yield from _together(family, [Fraction(float(speed)) for speed in speeds])
            return
        for speed in speeds:
            yield from _stable_at(family, speed)
            yield of_family(family, speed, stable=False, digits=_DOUBLE_DIGITS)
        return
    fold = Fraction(float(rotation_fold(family).omega))
    half = DEFAULT_COUNT // 2
    # Cycles lie closest together, for their speeds, where the family turns round, and Omega_h is never reached.
    below, beyond = family.omega_h - fold, omega_crit(parameters, 20).value + Fraction(1, 2) - fold
    for n in range(half, 0, -1):
        yield of_family(family, fold + below * Fraction(n * n, half * half + 1), stable=True, digits=_DOUBLE_DIGITS)
    for n in range(1, half + 1):
        yield of_family(family, fold + beyond * Fraction(n * n, half * half), stable=False, digits=_DOUBLE_DIGITS)


def _together(family: RotatingFamily, speeds: Sequence[Fraction]) -> Iterator[RotatingCycle]:
    """All of them in lanes, whatever the engine is; those that doubles do not hold one at a time."""
    asked = [(speed, side) for speed in speeds for side in (True, False) if speed < family.omega_h or not side]
    omegas = numpy.array([float(speed) for speed, _ in asked])
    stable = numpy.array([side for _, side in asked])
    lanes, cycles = default_lanes(), list[RotatingCycle | None]([None] * len(asked))
    solve = in_batches(ROTATING, family.parameters, lanes)
    with suppress(NoSuchCycleError):
        nodes = RotatingFamily(family.parameters, family.engine, family.omega_h, solve)
        nodes.reach(omegas.max())
        cycles = FamilyInterpolant(nodes, lanes).results_where(omegas, stable, digits=_DOUBLE_DIGITS)
    for (speed, side), cycle in zip(asked, cycles, strict=True):
        if cycle is not None:
            yield cycle
        elif side:
            yield from _stable_at(family, speed)
        else:
            yield of_family(family, speed, stable=False, digits=_DOUBLE_DIGITS)


def _stable_at(family: RotatingFamily, speed: Fraction) -> Iterator[RotatingCycle]:
    """The stable cycle at a speed, if that lies below Omega_h. Raises as `of_family` does."""
    if abs(family.omega_h - speed) < DOUBLE_SHOOTS:  # in double neither the side is certain nor the cycle found
        with suppress(NoSuchCycleError):
            yield rotating_cycle(family.parameters, speed, family.engine)
    elif speed < family.omega_h:
        yield of_family(family, speed, stable=True, digits=_DOUBLE_DIGITS)


def _beside(parameters: Parameters, omega: Fraction, omega_h: Fraction, engine: Engine, digits: int) -> RotatingCycle:
    """The stable cycle a little below ``omega_h``, which needs some digits of their distance.

    It passes the saddle so closely that it leaves along the unstable branch: that is where it is looked for.
    """
    below = omega_h - omega
    precision = resolving(parameters, omega_h, below, digits + 4)
    cycle: RotatingCycle = measured_cycle(
        parameters, omega, _shot(parameters, omega, below, engine, precision), engine, precision
    )
    return cycle


def _shot(parameters: Parameters, omega: Fraction, below: Fraction, engine: Engine, precision: Precision) -> Shot:
    """Newton's iteration from the unstable branch, until steps are small against the distance from the stable one."""
    flights = TurnFlights(parameters, omega, engine, precision)
    beta, v = unstable_top(parameters, omega, engine, precision)
    lost = NoSuchCycleError("the shooting iteration left the neighbourhood of the connection")
    iteration = NewtonIteration(_MOST_STEPS, lost, small=1e-6, near=0.0)
    while True:
        here = flights.map((beta, v))
        step = newton_step(here.matrix, here.residual)
        if iteration.converged(float((abs(step[0]) + abs(step[1])) / precision.number(below))):
            return Shot((beta, v), tuple(iteration.sizes), here, TurnFlights)
        beta, v = beta + step[0], v + step[1]
