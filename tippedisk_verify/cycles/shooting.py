"""Limit cycles by Newton shooting on the half-period map, in any precision.

A fixed point of the map is a symmetric limit cycle, T is twice its flight time, and the multipliers are the squares of
the map's. gamma is extreme on the section, for gamma' vanishes there.

The flow's derivatives come from the variational equations in double; above double the same derivative serves in chord
steps, each gaining about as many digits as a double has, and the variational equations run once more at the end. What
the numbers may be off is the subject of `cycle_budget`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any

from tippedisk_verify.cycles.cycle_budget import (
    TWINS_OF_WIDER,
    Shot,
    cycle_numbers,
    half_widths_by_twins,
    half_widths_by_wider_run,
    logarithms_bounded,
    numbers_at,
    sharpened,
    twins,
)
from tippedisk_verify.cycles.half_map import HalfFlights, HalfMap, newton_step
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.cycles.spectral import approximate_cycle
from tippedisk_verify.errors import InputError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision, bits, bits_for_digits, checked_digits, companion
from tippedisk_verify.theory.harmonic_balance import section_start

__all__ = [
    "LimitCycle",
    "Shot",
    "cycle_in_double",
    "cycle_numbers",
    "limit_cycle",
    "measured_cycle",
    "shoot",
]

_MOST_STEPS = 25
_DOUBLE_DIGITS = 12  # what doubles honestly give; fewer, and the equations amplify rounding
_NEAR = 0.003  # of the amplitude, a residual from which secants converge as fast as Newton's iteration does
_LAW_SERVES = 2.5  # rad; beyond, harmonic balance takes fewer steps than shooting from the law
_NEAR_THE_LAW = 0.4  # relative; the law's own error at that amplitude is a fifth


def shoot(parameters: Parameters, omega: Any, guess: Sequence[float], engine: Engine) -> Shot:
    """Damped Newton iteration in double from a guess (gamma_bar, v).

    Raises NoSuchCycleError if it does not converge, or if it shrinks towards the equilibrium, which is the trivial
    solution: an amplitude below a fifth of the guess's is not followed.
    """
    if len(guess) != 2:
        raise InputError("a guess has two components: gamma_bar and v at beta = pi/2")
    return converged(HalfFlights(parameters, omega, engine, DOUBLE), guess)


def converged(flights: HalfFlights, guess: Sequence[float]) -> Shot:
    """`shoot` for any section: from a guess of the two coordinates on it."""
    state = (DOUBLE.number(guess[0]), DOUBLE.number(guess[1]))
    scale = abs(state[0]) + abs(state[1]) / 10
    failure = NoSuchCycleError(f"the shooting iteration has not converged after {_MOST_STEPS} steps")
    # Round-off of half a period: some hundred ulps of the state.
    iteration = NewtonIteration(_MOST_STEPS, failure, small=1e-15 * scale, near=1e-12 * scale)
    here = flights.map(state)
    while not iteration.converged(size := _size(here.residual)):
        step = newton_step(here.matrix, here.residual)
        if 1e-12 < size / scale < _NEAR and (ahead := _by_secants(flights, state, here, iteration.sizes)) is not None:
            state, here = ahead, flights.map(ahead)
            continue
        share = 1.0
        while True:
            ahead = (state[0] + share * step[0], state[1] + share * step[1])
            if not all(map(math.isfinite, ahead)):
                raise NoSuchCycleError("the shooting iteration left the finite numbers: start closer to the cycle")
            if abs(ahead[0]) + abs(ahead[1]) / 10 < scale / 5:
                raise NoSuchCycleError("the shooting iteration falls onto the equilibrium: start closer to the cycle")
            try:
                image = flights.map(ahead)
            except NoSuchCycleError:
                image = None
            if image is not None and (_size(image.residual) < size or size < 1e-10 * scale):
                break
            share /= 2
            if share < 1e-3:
                raise NoSuchCycleError("the shooting iteration stands still: start closer to the cycle")
        state, here = ahead, image
    return Shot(state, tuple(iteration.sizes), here, type(flights))


def _by_secants(
    flights: HalfFlights, state: tuple[Any, Any], here: HalfMap, residuals: list[float]
) -> tuple[Any, Any] | None:
    """On from a state close to the cycle without further derivatives, until rounding is left; None if that is slow.

    The stopping rule is not that of `newton`: secants are given up as soon as they gain less than a factor of 8.

    Broyden's update keeps the derivative current (C. G. Broyden, Math. Comp. 19, 1965): a flight without variational
    equations takes a third of the time of one with them.
    """
    (a, b), (c, d) = here.matrix
    step = newton_step(here.matrix, here.residual)
    resolved = _size(state) * 1e-16
    while True:
        state = state[0] + step[0], state[1] + step[1]
        try:
            end = flights(state, divergence=True, events=flights.recorded).state.tolist()
        except (NoSuchCycleError, InputError):  # some engines have no divergence
            return None
        residual = flights.residual(end, state)
        before, size = residuals[-1], _size(residual)
        residuals.append(size)
        if size > before / 8:
            return None
        # The residual's derivative is the map's less 1: what the step left over is the error of that.
        norm = step[0] * step[0] + step[1] * step[1]
        by = step[0] / norm, step[1] / norm
        a, b = a + residual[0] * by[0], b + residual[0] * by[1]
        c, d = c + residual[1] * by[0], d + residual[1] * by[1]
        step = newton_step(((a, b), (c, d)), residual)
        if size * size / before < resolved:  # as much again, and no more is left than rounding
            return state[0] + step[0], state[1] + step[1]


def _size(residual: Sequence[Any]) -> float:
    return abs(float(residual[0])) + abs(float(residual[1])) / 10


# ------------------------------------------------------------------------------------------------ with uncertainties
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

    Without a ``guess`` (gamma_bar, v) harmonic balance of the linear law provides one: the laws' cycles part slowly.
    Up to 12 digits everything runs in double if that holds them (close to the Hopf point it does not); a wider
    arithmetic measures the error only where the budget in double is too wide for the digits. ``precision`` fixes the
    arithmetic, and then the digits are what it gives. Raises InputError for a speed that is not positive,
    NoSuchCycleError where none is found, Shortfall if the digits are not reached.
    """
    value = checked_speed(omega)
    checked_digits(digits)
    shot = _first_shot(parameters, value, engine, guess)
    cycle: LimitCycle = cycle_from(parameters, value, shot, engine, digits, precision)
    return cycle


def cycle_from(
    parameters: Parameters,
    value: Fraction,
    shot: Shot,
    engine: Engine,
    digits: int,
    precision: Precision | None = None,
) -> Any:
    """The cycle, librating or rotating, that Newton's iteration in double has found, to so many digits.

    Raises Shortfall if the digits are not reached.
    """
    if precision == DOUBLE or (precision is None and digits <= _DOUBLE_DIGITS):
        cycle = cycle_in_double(parameters, value, shot, engine)
        if precision == DOUBLE or _lacking(cycle, _DOUBLE_DIGITS) is None:
            return cycle
        finer = _cycle_in_companion(parameters, value, shot, engine)
        if finer is not None and _lacking(finer, digits) is None:
            return finer
    if precision is not None:
        return measured_cycle(parameters, value, shot, engine, precision)
    # Twenty digits more than asked for: slow convergence near the Hopf point and the passages cost some of them.
    cycle = measured_cycle(parameters, value, shot, engine, bits(bits_for_digits(digits + 20)))
    if name := _lacking(cycle, digits):
        raise Shortfall(f"{name} has fewer than {digits} digits so close to a bifurcation: ask for {digits + 20}")
    return cycle


def _first_shot(parameters: Parameters, value: Fraction, engine: Engine, guess: Sequence[float] | None) -> Shot:
    """Newton's iteration from the guess; without one from the one-harmonic law, or else from harmonic balance.

    The law costs nothing and is near where cycles are small; what is found far from its guess is not trusted.
    """
    if guess is not None:
        return shoot(parameters, value, guess, engine)
    near = section_start(parameters.at(DOUBLE), float(value))
    if near is not None and near[0] < _LAW_SERVES:
        with suppress(NoSuchCycleError):
            shot = shoot(parameters, value, near[:2], engine)
            if abs(shot.state[0] / near[0] - 1) < _NEAR_THE_LAW:
                return shot
    return shoot(parameters, value, approximate_cycle(parameters, value), engine)


def _lacking(cycle: Any, digits: int) -> str | None:
    """The first main result that has fewer digits than asked for."""
    for name in ("period", *cycle.unknowns, "beta_max"):
        measured: Measured = getattr(cycle, name)
        if measured.uncertainty > abs(measured.value) * Fraction(1, 10**digits):
            return str(name)
    return None


def cycle_in_double(parameters: Parameters, value: Fraction, shot: Shot, engine: Engine) -> Any:
    """The cycle that Newton's iteration in double found, with half-widths from twins in double."""
    flights = shot.section(parameters, value, engine, DOUBLE)
    numbers = numbers_at(flights, shot.state, shot.map, DOUBLE)
    return _as_cycle(flights, half_widths_by_twins(numbers, twins(flights, shot.state)), shot)


def _cycle_in_companion(parameters: Parameters, value: Fraction, shot: Shot, engine: Engine) -> Any:
    """The same in the next wider arithmetic; None if its iteration stands still above what rounding explains."""
    wider = companion(DOUBLE)
    numbers, doubt = sharpened(shot, shot.section(parameters, value, engine, wider), wider)
    flights = shot.section(parameters, value, engine, DOUBLE)
    others = [numbers_at(flights, shot.state, shot.map, DOUBLE), *twins(flights, shot.state, TWINS_OF_WIDER)]
    measured = half_widths_by_twins(numbers, others, wider)
    if any(measured[name].uncertainty < left for name, left in doubt.items()):
        return None
    return _as_cycle(flights, measured, shot, wider)


def measured_cycle(
    parameters: Parameters,
    value: Fraction,
    shot: Shot,
    engine: Engine,
    precision: Precision,
) -> Any:
    """The cycle in one arithmetic, with half-widths from a wider one, starting from what Newton's iteration found.

    Raises Shortfall if the chord iteration does not settle.
    """
    if precision == DOUBLE:
        return cycle_in_double(parameters, value, shot, engine)
    flights = shot.section(parameters, value, engine, precision)
    rough, _ = sharpened(shot, flights, precision)
    wider = companion(precision)
    sharp, doubt = sharpened(shot, shot.section(parameters, value, engine, wider), wider)
    return _as_cycle(flights, half_widths_by_wider_run(rough, sharp, doubt, precision), shot)


def _as_cycle(
    flights: HalfFlights, measured: dict[str, Measured], shot: Shot, precision: Precision | None = None
) -> Any:
    """The result; ``precision`` is the arithmetic of the numbers, by default that of the flights."""
    logarithms_bounded(measured)
    # The true multiplier along the flow is 1: its computed distance from 1 is all error.
    defect = measured["trivial_multiplier_defect"]
    measured["trivial_multiplier_defect"] = Measured(defect.value, max(defect.uncertainty, defect.value))
    slow = measured["multiplier_slow"]
    certain = abs(abs(slow.value) - 1) > slow.uncertainty
    return flights.result(
        omega=Measured(flights.omega, Fraction(0)),
        **measured,
        stable=bool(abs(slow.value) < 1) if certain else None,
        residuals=shot.residuals,
        parameters=flights.parameters,
        engine=flights.engine.name,
        precision=(precision or flights.precision).name,
    )
