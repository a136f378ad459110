"""Limit cycles by Newton shooting on the half-period map, in any precision.

A fixed point of the map is a symmetric limit cycle, T is twice its flight time, and the multipliers are the squares of
the map's. gamma is extreme on the section, for gamma' vanishes there.

The flow's derivatives come from the variational equations in double; above double the same derivative serves in chord
steps, each gaining about as many digits as a double has, and the variational equations run once more at the end. Every
number is then computed again in a wider arithmetic: the difference is its error, rounding of the inputs included.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.errors import InputError, NoSuchCycleError, Shortfall
from tippedisk_verify.flow.contract import TURN, Engine, Event, Request, Status
from tippedisk_verify.model.equations import Friction, checked_speed, field, shifted
from tippedisk_verify.model.exact import PI, fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision, bits, bits_for_digits, checked_digits, companion
from tippedisk_verify.orbits.half_map import HalfFlights, HalfMap, newton_step
from tippedisk_verify.theory.spectral_balance import approximate_cycle

__all__ = [
    "EXTREME",
    "LimitCycle",
    "Shot",
    "cycle_numbers",
    "limit_cycle",
    "measured_cycle",
    "shoot",
    "shoot_full_period",
]

#: Where beta is extreme.
EXTREME = Event("extreme", TURN.function, terminal=False)
_QUARTER = PI * Fraction(1, 2)
_MOST_STEPS = 25


@dataclass(frozen=True)
class Shot:
    """How a Newton iteration went: where it ended and the size of its residual at each step."""

    state: tuple[Any, Any]  #: (gamma_bar, v) on the section
    residuals: tuple[float, ...]
    map: HalfMap


@dataclass(frozen=True)
class LimitCycle:
    """A limit cycle with its multipliers and sensitivities; every number with a half-width that holds the truth."""

    omega: Measured  #: [rad/s]
    period: Measured  #: T [s]
    gamma_bar_0: Measured  #: gamma - pi/2 at beta = pi/2 with v < 0, its largest value [rad]
    v_0: Measured  #: v there [rad/s]
    beta_max: Measured  #: largest |beta - pi/2| [rad]
    multiplier_slow: Measured  #: the larger non-trivial Floquet multiplier [1]
    log_multiplier_slow: Measured  #: natural logarithm of its absolute value
    log_multiplier_fast: Measured  #: the same of the smaller one, through Liouville's integral
    trivial_multiplier_defect: Measured  #: distance of the computed multiplier along the flow from 1
    dperiod_domega: Measured  #: [s^2/rad]
    dgamma_bar_0_domega: Measured  #: [s]
    dv_0_domega: Measured  #: [1]
    stable: bool | None  #: None if the multiplier's half-width holds 1
    residuals: tuple[float, ...]  #: of the Newton iteration in double

    def json(self) -> dict[str, object]:
        return {
            name: value.json() if isinstance(value, Measured) else list(value) if isinstance(value, tuple) else value
            for name, value in ((name, getattr(self, name)) for name in self.__dataclass_fields__)
        }


def shoot(
    parameters: Parameters, omega: Any, guess: Sequence[float], engine: Engine, friction: Friction = "linear"
) -> Shot:
    """Damped Newton iteration in double from a guess (gamma_bar, v).

    Raises NoSuchCycleError if it does not converge, or if it shrinks towards the equilibrium, which is the trivial
    solution: an amplitude below a fifth of the guess's is not followed.
    """
    if len(guess) != 2:
        raise InputError("a guess has two components: gamma_bar and v at beta = pi/2")
    state = (DOUBLE.number(guess[0]), DOUBLE.number(guess[1]))
    flights = HalfFlights(parameters, omega, engine, DOUBLE, friction)
    scale = abs(state[0]) + abs(state[1]) / 10
    residuals: list[float] = []
    here = flights.map(state)
    for _ in range(_MOST_STEPS):
        size = _size(here.residual)
        residuals.append(size)
        # Round-off of half a period: some hundred ulps of the state.
        if size < 1e-15 * scale or (len(residuals) > 2 and size < 1e-12 * scale and size >= residuals[-2] / 2):
            return Shot(state, tuple(residuals), here)
        step = newton_step(here.matrix, here.residual)
        share = 1.0
        while True:
            ahead = (state[0] + share * step[0], state[1] + share * step[1])
            if not all(map(math.isfinite, ahead)):
                raise NoSuchCycleError("the shooting iteration left the finite numbers: start closer to the cycle")
            if abs(ahead[0]) + abs(ahead[1]) / 10 < scale / 5:
                raise NoSuchCycleError("the shooting iteration falls onto the equilibrium: start closer to the cycle")
            try:
                found = flights.map(ahead)
            except NoSuchCycleError:
                found = None
            if found is not None and (_size(found.residual) < size or size < 1e-10 * scale):
                break
            share /= 2
            if share < 1e-3:
                raise NoSuchCycleError("the shooting iteration stands still: start closer to the cycle")
        state, here = ahead, found
    raise NoSuchCycleError(f"the shooting iteration has not converged after {_MOST_STEPS} steps")


def _size(residual: Sequence[Any]) -> float:
    return abs(float(residual[0])) + abs(float(residual[1])) / 10


def shoot_full_period(
    parameters: Parameters,
    omega: Any,
    state: Sequence[float],
    period: float,
    engine: Engine,
    friction: Friction = "linear",
) -> tuple[tuple[float, float, float], float, tuple[float, ...]]:
    """The paper's own form, without the symmetry: periodicity residual r_p and anchor r_a = beta_bar_0, four unknowns.

    ``state`` is (beta_bar, gamma_bar, v); returns the state and period found and the residual of each step.
    Raises NoSuchCycleError as `shoot` does.
    """
    import numpy

    unknown = numpy.array([*map(float, state), float(period)])
    scale = abs(unknown[1]) + abs(unknown[2]) / 10
    residuals: list[float] = []
    rates = field(shifted(math), parameters.at(DOUBLE), DOUBLE.number(omega), friction)
    for _ in range(_MOST_STEPS):
        start = unknown[:3]
        result = engine(
            Request(
                parameters,
                omega,
                start.tolist(),
                unknown[3],
                friction=friction,
                shifted=True,
                variations=("beta", "gamma", "v"),
                domain="none",
            )
        )
        if result.status is not Status.REACHED:
            raise NoSuchCycleError(f"the orbit could not be followed for a period: {result.status.value}")
        residual = numpy.array([*(result.state - start), unknown[0]])
        residuals.append(float(abs(residual[0]) + abs(residual[1]) + abs(residual[2]) / 10))
        if residuals[-1] < 1e-14 * scale or (len(residuals) > 2 and residuals[-2] / 2 <= residuals[-1] < 1e-11 * scale):
            return (float(unknown[0]), float(unknown[1]), float(unknown[2])), float(unknown[3]), tuple(residuals)
        matrix = numpy.zeros((4, 4))
        matrix[:3, :3] = result.derivatives - numpy.eye(3)
        matrix[:3, 3] = rates(*result.state.tolist())
        matrix[3, 0] = 1.0
        unknown = unknown - numpy.linalg.solve(matrix, residual)
        if not numpy.isfinite(unknown).all() or unknown[3] <= 0:
            raise NoSuchCycleError("the shooting iteration left the finite numbers: start closer to the cycle")
        if abs(unknown[1]) + abs(unknown[2]) / 10 < scale / 5:
            raise NoSuchCycleError("the shooting iteration falls onto the equilibrium: start closer to the cycle")
    raise NoSuchCycleError(f"the shooting iteration has not converged after {_MOST_STEPS} steps")


# ------------------------------------------------------------------------------------------------ with uncertainties
def limit_cycle(
    parameters: Parameters,
    omega: object,
    engine: Engine,
    *,
    digits: int = 12,
    guess: Sequence[float] | None = None,
    precision: Precision | None = None,
    friction: Friction = "linear",
) -> LimitCycle:
    """The limit cycle at ``omega`` [rad/s], each number to about ``digits`` significant digits.

    Without a ``guess`` (gamma_bar, v) harmonic balance of the linear law provides one: the laws' cycles part slowly.
    Up to 12 digits everything runs in double if that holds them (close to the Hopf point it does not), with the error
    measured in a wider arithmetic; ``precision`` fixes the arithmetic, and then the digits are what it gives. Raises
    InputError for a speed that is not positive, NoSuchCycleError where none is found, Shortfall if the digits are not
    reached.
    """
    value = checked_speed(omega)
    checked_digits(digits)
    if guess is None:
        guess = approximate_cycle(parameters, value)
    shot = shoot(parameters, value, guess, engine, friction)
    if precision is not None:
        return measured_cycle(parameters, value, shot, engine, precision, friction)
    if digits <= 12:
        cycle = measured_cycle(parameters, value, shot, engine, DOUBLE, friction)
        if _lacking(cycle, digits) is None:
            return cycle
    # Twenty digits more than asked for: slow convergence near the Hopf point and the passages cost some of them.
    cycle = measured_cycle(parameters, value, shot, engine, bits(bits_for_digits(digits + 20)), friction)
    if name := _lacking(cycle, digits):
        raise Shortfall(f"{name} has fewer than {digits} digits so close to a bifurcation: ask for {digits + 20}")
    return cycle


def _lacking(cycle: LimitCycle, digits: int) -> str | None:
    """The first main result that has fewer digits than asked for."""
    for name in ("period", "gamma_bar_0", "v_0", "beta_max"):
        measured = getattr(cycle, name)
        if measured.uncertainty > abs(measured.value) * Fraction(1, 10**digits):
            return name
    return None


def measured_cycle(
    parameters: Parameters,
    value: Fraction,
    shot: Shot,
    engine: Engine,
    precision: Precision,
    friction: Friction = "linear",
) -> LimitCycle:
    """The cycle in one arithmetic, with half-widths from a wider one, starting from what Newton's iteration found.

    Raises Shortfall if the chord iteration does not settle.
    """
    rough = cycle_numbers(parameters, value, shot, engine, precision, friction)
    sharp, doubt = _numbers_and_doubt(parameters, value, shot, engine, companion(precision), friction)
    measured = {name: Measured.compared(number, sharp[name], precision.epsilon) for name, number in rough.items()}
    # The wider run's own error, where the cycle attracts so weakly that it is no small part of the distance. All
    # numbers move with the state: by how much, the two runs show.
    apart = sum(
        max(abs(measured[name].value - fraction(sharp[name])), abs(measured[name].value) * precision.epsilon)
        for name in ("gamma_bar_0", "v_0")
    )
    share = (doubt["gamma_bar_0"] + doubt["v_0"]) / apart
    for name, number in measured.items():
        more = abs(number.value - fraction(sharp[name])) * share + doubt.get(name, 0)
        measured[name] = Measured(number.value, number.uncertainty + more)
    # The true multiplier along the flow is 1: its computed distance from 1 is all error.
    defect = measured["trivial_multiplier_defect"]
    measured["trivial_multiplier_defect"] = Measured(defect.value, max(defect.uncertainty, defect.value))
    slow = measured["multiplier_slow"]
    certain = abs(abs(slow.value) - 1) > slow.uncertainty
    return LimitCycle(
        omega=Measured(value, Fraction(0)),
        **measured,
        stable=bool(abs(slow.value) < 1) if certain else None,
        residuals=shot.residuals,
    )


def cycle_numbers(
    parameters: Parameters,
    omega: Fraction,
    shot: Shot,
    engine: Engine,
    precision: Precision,
    friction: Friction = "linear",
) -> dict[str, Any]:
    """All numbers of the cycle in one arithmetic."""
    return _numbers_and_doubt(parameters, omega, shot, engine, precision, friction)[0]


def _numbers_and_doubt(
    parameters: Parameters, omega: Fraction, shot: Shot, engine: Engine, precision: Precision, friction: Friction
) -> tuple[dict[str, Any], dict[str, Fraction]]:
    """All numbers of the cycle, and what rounding of the map leaves undecided of its state and period."""
    flights = HalfFlights(parameters, omega, engine, precision, friction)
    state, noise = _sharpened(shot, flights, precision)
    here = flights.map(state)
    flight = flights(state, divergence=True, events=(EXTREME,))
    turns = [record.state[0] for record in flight.events if record.name == EXTREME.name]
    (a, b), (c, d) = here.matrix
    trace, determinant = a + d, a * d - b * c
    # The larger root of l^2 - trace l + determinant; the determinant is some 1e-25 and only corrects it.
    root = precision.ops.sqrt(trace * trace / 4 - determinant)
    half = trace / 2 + (root if trace > 0 else -root)
    slow = half * half
    log_slow = precision.ops.log(slow)
    by_omega = newton_step(here.matrix, here.by_omega)
    trivial = flights.trivial_multiplier(state, here)
    time = here.time_by_state[0] * by_omega[0] + here.time_by_state[1] * by_omega[1] + here.time_by_omega
    # Some tens of roundings of each residual, brought back by (1 - P')^-1.
    zero, unit = 0 * time, 64 * float(precision.epsilon)
    back = (newton_step(here.matrix, (unit * state[0], zero)), newton_step(here.matrix, (zero, unit * state[1])))
    undecided = [max(sum((fraction(abs(part[k])) for part in back), Fraction(0)), 4 * noise[k]) for k in range(2)]
    flight_times = (fraction(abs(a)) * b for a, b in zip(here.time_by_state, undecided, strict=True))
    doubt = {"gamma_bar_0": undecided[0], "v_0": undecided[1], "period": 2 * sum(flight_times, Fraction(0))}
    numbers = {
        "period": 2 * here.time,
        "gamma_bar_0": state[0],
        "v_0": state[1],
        "beta_max": max((abs(turn) for turn in turns), default=abs(0 * here.time)),
        "multiplier_slow": slow,
        "log_multiplier_slow": log_slow,
        # det of the flow over a period = slow * fast * 1 (trivial); Liouville gives its logarithm.
        "log_multiplier_fast": 2 * flight.divergence - log_slow,
        "trivial_multiplier_defect": abs(trivial * trivial - 1),
        "dperiod_domega": 2 * time,
        "dgamma_bar_0_domega": by_omega[0],
        "dv_0_domega": by_omega[1],
    }
    return numbers, doubt


def _sharpened(
    shot: Shot, flights: HalfFlights, precision: Precision
) -> tuple[tuple[Any, Any], tuple[Fraction, Fraction]]:
    """Chord steps with the shot's derivative, until the step is below rounding; and the step where it stood still."""
    state = (precision.number(shot.state[0]), precision.number(shot.state[1]))
    settled = Fraction(0), Fraction(0)
    if precision == DOUBLE:
        return state, settled
    matrix = tuple(tuple(precision.number(entry) for entry in row) for row in shot.map.matrix)
    previous: Fraction | None = None
    for _ in range(precision.bits // 8 + 8):
        flight = flights(state)
        residual = (-flight.state[1] - state[0], -flight.state[2] - state[1])
        step = newton_step(matrix, residual)
        state = (state[0] + step[0], state[1] + step[1])
        size = fraction(abs(step[0]) + abs(step[1]))
        # Below a thousand ulps only rounding is left; a step that has stopped shrinking says the same.
        if size < 1000 * precision.epsilon:
            return state, settled
        if previous is not None and 2 * size > previous:
            return state, (fraction(abs(step[0])), fraction(abs(step[1])))
        previous = size
    raise Shortfall(f"the chord iteration has not converged in {precision.name} precision")
