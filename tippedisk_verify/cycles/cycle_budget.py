"""The numbers of a limit cycle, and the budget of their half-widths (derived in docs/error_budgets.md).

In double *twins* measure the error. Newton's iteration goes on for a few steps, each with the last bits of constants
and speed moved: every step is solved anew with rounding of its own, its derivatives are taken at a state as far off
as the solution itself, and with the parameters it moves what their rounding moves. So each number of each twin is
another draw of the same error, and

    half-width = TWIN_FACTOR * spread + ulp(q).

Nothing else is in it: truncation is far below rounding at the integrator's own tolerance, and Newton's iteration is at
rest to rounding. Where the equations amplify rounding the cycle is solved in the next wider arithmetic, whose error is
the same one, smaller by the ratio of the roundings: the twins in double measure that too.

With many more bits the same numbers are computed twice, in an arithmetic and in one with 64 bits more. The distance is
the error, and what the wider run itself may be off is what its chord iteration leaves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tippedisk_verify.cycles.half_map import HalfFlights, HalfMap, newton_step
from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.flow.rounding import nudged
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision

__all__ = [
    "TWINS_OF_WIDER",
    "Shot",
    "cycle_numbers",
    "half_widths_by_twins",
    "half_widths_by_wider_run",
    "logarithms_bounded",
    "numbers_at",
    "sharpened",
    "twins",
]

#: With these, and the cycle itself, an error beyond TWIN_FACTOR times the spread has a probability of 2e-6 for normal
#: errors as large as the twins', and the half-width is 14 times the error in the median
#: (tests/cycles/test_cycle_budget.py integrates both). What a unit more or less in constants and arrival does to a twin
#: is twice what rounding does there.
TWINS = 5
TWIN_FACTOR = 4
#: The error of the next wider arithmetic is not among the values whose spread measures it. With so many twins, and the
#: cycle in double itself, it exceeds TWIN_FACTOR times the spread brought to its arithmetic with the same risk.
TWINS_OF_WIDER = 8
#: What a chord iteration that stands still leaves undecided, in units of its step: the steps' ratio is at least 1/2.
_STANDING = 4


@dataclass(frozen=True)
class Shot:
    """How a Newton iteration went: where it ended and the size of its residual at each step."""

    state: tuple[Any, Any]  #: (gamma_bar, v) on the section
    residuals: tuple[float, ...]
    map: Any  #: the section's map there, with derivatives
    section: type[HalfFlights] = HalfFlights  #: whose map it is


def cycle_numbers(
    parameters: Parameters,
    omega: Fraction,
    shot: Shot,
    engine: Engine,
    precision: Precision,
) -> dict[str, Any]:
    """All numbers of the cycle in one arithmetic."""
    return sharpened(shot, HalfFlights(parameters, omega, engine, precision), precision)[0]


def numbers_at(
    flights: HalfFlights,
    state: tuple[Any, Any],
    here: HalfMap,
    precision: Precision,
    rounding: int | None = None,
) -> dict[str, Any]:
    """All numbers of the cycle through ``state``, a fixed point of the map, from the map's derivatives there."""
    flight = flights(state, divergence=True, events=flights.recorded, rounding=rounding)
    (a, b), (c, d) = here.matrix
    trace, determinant = a + d, a * d - b * c
    # The larger root of l^2 - trace l + determinant; mostly the determinant is some 1e-25 and only corrects it. Of a
    # complex pair the modulus is what tells.
    discriminant, sqrt = trace * trace / 4 - determinant, precision.ops.sqrt
    larger = abs(trace) / 2 + sqrt(discriminant) if discriminant >= 0 else sqrt(determinant)
    laps = flights.per_period
    slow = larger * larger if laps == 2 else larger if trace >= 0 else -larger
    log_slow = precision.ops.log(abs(slow))
    by_omega = newton_step(here.matrix, here.by_omega)
    trivial = flights.trivial_multiplier(state, here)
    time = here.time_by_state[0] * by_omega[0] + here.time_by_state[1] * by_omega[1] + here.time_by_omega
    first, second = flights.unknowns
    return {
        "period": laps * here.time,
        first: state[0],
        second: state[1],
        **flights.measures(flight),
        "multiplier_slow": slow,
        "log_multiplier_slow": log_slow,
        # det of the flow over a period = slow * fast * 1 (trivial); Liouville gives its logarithm.
        "log_multiplier_fast": laps * flight.divergence - log_slow,
        "log_multipliers": laps * flight.divergence,
        "trivial_multiplier_defect": abs((trivial * trivial if laps == 2 else trivial) - 1),
        "dperiod_domega": laps * time,
        f"d{first}_domega": by_omega[0],
        f"d{second}_domega": by_omega[1],
    }


def twins(flights: HalfFlights, state: tuple[Any, Any], count: int = TWINS) -> list[dict[str, Any]]:
    """The numbers of the cycle near ``state`` in double, each time with other last bits."""
    first, second = flights.unknowns
    known = []
    for pattern in range(1, count + 1):
        here = flights.map(state, pattern)
        numbers = numbers_at(flights, state, here, DOUBLE, pattern)
        # The arrival is a double, and where a cycle attracts weakly that hides what rounding does: the residual is the
        # same, often zero, over many starts. One unit more or less in the arrival's last place brings it to light.
        arrival = [now + before for now, before in zip(here.residual, state, strict=True)]
        moved = nudged(arrival, pattern + 2, DOUBLE)
        residual = [now + (other - whole) for now, whole, other in zip(here.residual, arrival, moved, strict=True)]
        step = newton_step(here.matrix, residual)
        state = (state[0] + step[0], state[1] + step[1])
        later = here.time_by_state[0] * step[0] + here.time_by_state[1] * step[1]
        period = numbers["period"] + flights.per_period * later
        known.append(numbers | {first: state[0], second: state[1], "period": period})
    return known


def half_widths_by_twins(
    numbers: dict[str, Any], others: Sequence[dict[str, Any]], precision: Precision = DOUBLE
) -> dict[str, Measured]:
    """Numbers in double, or in an arithmetic a little wider, with half-widths from the others, which are in double."""
    share = TWIN_FACTOR * 2.0 ** (DOUBLE.bits - precision.bits)
    known = others if precision != DOUBLE else [numbers, *others]
    ulp, measured = float(precision.epsilon), {}
    for name, number in numbers.items():
        values = [float(other[name]) for other in known]
        # In doubles: what that rounds is far below what a width of five deviations knows.
        width = share * (max(values) - min(values)) + abs(values[0]) * ulp
        measured[name] = Measured(fraction(number), Fraction(width))
    return measured


def half_widths_by_wider_run(
    rough: dict[str, Any], sharp: dict[str, Any], doubt: dict[str, Fraction], precision: Precision
) -> dict[str, Measured]:
    """The rough numbers with half-widths from the sharp ones, and from what these may be off themselves.

    ``doubt`` is what the wider iteration leaves undecided of state and period. The two runs show how far the other
    numbers move with the state.
    """
    measured = {name: Measured.compared(number, sharp[name], precision.epsilon) for name, number in rough.items()}
    unknowns = [name for name in doubt if name != "period"]
    apart = sum(
        max(abs(measured[name].value - fraction(sharp[name])), abs(measured[name].value) * precision.epsilon)
        for name in unknowns
    )
    share = sum((doubt[name] for name in unknowns), Fraction(0)) / apart
    for name, number in measured.items():
        more = abs(number.value - fraction(sharp[name])) * share + doubt.get(name, 0)
        measured[name] = Measured(number.value, number.uncertainty + more)
    return measured


def logarithms_bounded(measured: dict[str, Measured]) -> None:
    """Bounds for the logarithms of multipliers that are lost in rounding.

    The slow one is at most what rounding leaves of it, and the fast one is no larger; their sum is known.
    """
    slow, both = measured["multiplier_slow"], measured.pop("log_multipliers")
    if 2 * slow.uncertainty < abs(slow.value):
        return
    highest = Fraction(math.log(abs(slow.value) + slow.uncertainty))
    lowest = min(both.value / 2, highest)
    middle, half = (highest + lowest) / 2, (highest - lowest) / 2 + both.uncertainty + abs(highest) / 2**50
    measured["log_multiplier_slow"] = Measured(middle, half)
    measured["log_multiplier_fast"] = Measured(both.value - middle, half)


def sharpened(shot: Shot, flights: HalfFlights, precision: Precision) -> tuple[dict[str, Any], dict[str, Fraction]]:
    """All numbers of the cycle, and what the chord iteration leaves undecided of its state and period.

    Raises Shortfall if the chord iteration does not settle.
    """
    state, standing = _chords(shot, flights, precision)
    here = shot.map if precision == DOUBLE else flights.map(state)
    undecided = [_STANDING * step for step in standing]
    times = (fraction(abs(a)) * b for a, b in zip(here.time_by_state, undecided, strict=True))
    doubt = dict(zip(flights.unknowns, undecided, strict=True))
    doubt["period"] = flights.per_period * sum(times, Fraction(0))
    return numbers_at(flights, state, here, precision), doubt


def _chords(
    shot: Shot, flights: HalfFlights, precision: Precision
) -> tuple[tuple[Any, Any], tuple[Fraction, Fraction]]:
    """Chord steps with the shot's derivative, until the step is below rounding; and the step where it stood still."""
    state = (precision.number(shot.state[0]), precision.number(shot.state[1]))
    settled = Fraction(0), Fraction(0)
    if precision == DOUBLE:
        return state, settled
    matrix = tuple(tuple(precision.number(entry) for entry in row) for row in shot.map.matrix)
    # Below a thousand ulps only rounding is left; a step that has stopped shrinking says the same.
    small = 1000 * precision.epsilon
    failure = Shortfall(f"the chord iteration has not converged in {precision.name} precision")
    iteration = NewtonIteration(precision.bits // 8 + 8, failure, small=small, fewest=2)
    while True:
        flight = flights(state)
        residual = flights.residual(flight.state, state)
        step = newton_step(matrix, residual)
        state = (state[0] + step[0], state[1] + step[1])
        size = fraction(abs(step[0]) + abs(step[1]))
        if iteration.converged(size):
            return state, settled if size < small else (fraction(abs(step[0])), fraction(abs(step[1])))
