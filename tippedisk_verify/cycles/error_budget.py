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
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import count, islice
from typing import Any, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.newton import FixedPoint, Iterate, Stop, newton
from tippedisk_verify.cycles.return_map import Image, ReturnMap
from tippedisk_verify.cycles.section import Section
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow.system import nudged
from tippedisk_verify.model.exact import fraction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.precision import DOUBLE, Precision, bits, bits_for_digits, companion

__all__ = ["cycle_in", "cycle_numbers", "cycle_of", "cycle_to_digits", "logarithms_bounded", "numbers_at"]

C = TypeVar("C", bound=Cycle)

_LOST = 3  # digits of an arithmetic that rounding, and the factor of a half-width, mostly take
_DOUBLE_DIGITS = 12  # what doubles honestly give; fewer, and the equations amplify rounding
#: With these, and the cycle itself, an error beyond TWIN_FACTOR times the spread has a probability of 2e-6 for normal
#: errors as large as the twins', and the half-width is 14 times the error in the median
#: (tests/cycles/test_error_budget.py integrates both). What a unit more or less in constants and arrival does to a twin
#: is twice what rounding does there.
TWINS = 5
TWIN_FACTOR = 4
#: The error of the next wider arithmetic is not among the values whose spread measures it. With so many twins, and the
#: cycle in double itself, it exceeds TWIN_FACTOR times the spread brought to its arithmetic with the same risk.
TWINS_OF_WIDER = 8
#: Half-widths of the same cycle differ by up to 1.6 from draw to draw. With this factor to spare it is no matter of
#: last bits which arithmetic answers.
_TO_SPARE = 2
#: What a chord iteration that stands still leaves undecided, in units of its step: the steps' ratio is at least 1/2.
_STANDING = 4


def cycle_to_digits(fixed_point: FixedPoint[C], digits: int) -> C:
    """The cycle that Newton's iteration in double has led to, to so many significant digits.

    Raises AccuracyError if the digits are not reached.
    """
    draws, doubles = _draws(fixed_point), list[dict[str, Any]]()
    wanted, wider = max(digits, _DOUBLE_DIGITS), companion(DOUBLE)
    for precision, twins in (DOUBLE, TWINS), (wider, TWINS_OF_WIDER), (companion(wider), TWINS_OF_WIDER):
        if wanted + _LOST <= precision.digits:
            doubles += islice(draws, 1 + twins - len(doubles))
            cycle = _by_twins(fixed_point, precision, doubles)
            if cycle is not None and _lacking(cycle, wanted, _TO_SPARE) is None:
                return cycle
    # Twenty digits more than asked for: slow convergence next to the Hopf point and the passages cost some of them.
    cycle = cycle_in(fixed_point, bits(bits_for_digits(digits + 20)))
    if name := _lacking(cycle, digits):
        raise AccuracyError(f"{name} has fewer than {digits} digits so close to a bifurcation: ask for {digits + 20}")
    return cycle


def cycle_in(fixed_point: FixedPoint[C], precision: Precision, wider: Precision | None = None) -> C:
    """The cycle in one arithmetic, its half-widths from twins in double, or else from a wider arithmetic.

    Raises AccuracyError if the chord iteration does not settle.
    """
    if precision == DOUBLE:
        doubles = list(islice(_draws(fixed_point), 1 + TWINS))
        return _as_cycle(fixed_point, half_widths_by_twins(doubles[0], doubles), precision)
    numbers, _, sharper = _sharpened(fixed_point, precision)
    sharp, doubt, _ = _sharpened(sharper, wider or companion(precision))
    return _as_cycle(fixed_point, half_widths_by_wider_run(numbers, sharp, doubt, precision), precision)


def _by_twins(fixed_point: FixedPoint[C], precision: Precision, doubles: Sequence[dict[str, Any]]) -> C | None:
    """The cycle in double, or in an arithmetic a little wider, its half-widths from as many draws in double.

    None if the wider iteration stands still above what rounding explains.
    """
    if precision == DOUBLE:
        numbers, doubt = doubles[0], dict[str, Fraction]()
    else:
        numbers, doubt, _ = _sharpened(fixed_point, precision)
    measured = half_widths_by_twins(numbers, doubles, precision)
    if any(measured[name].uncertainty < left for name, left in doubt.items()):
        return None
    return _as_cycle(fixed_point, measured, precision)


def _lacking(cycle: Cycle, digits: int, to_spare: int = 1) -> str | None:
    """The first main result that has fewer digits than asked for, with this factor to spare."""
    for name in ("period", *cycle.coordinates, "beta_max"):
        measured: Measured = getattr(cycle, name)
        if to_spare * measured.uncertainty > abs(measured.value) * Fraction(1, 10**digits):
            return name
    return None


def _as_cycle(fixed_point: FixedPoint[C], measured: dict[str, Measured], precision: Precision) -> C:
    """The result, its numbers in this arithmetic."""
    return_map = fixed_point.return_map
    return cycle_of(
        return_map.section,
        return_map.omega,
        measured,
        residuals=fixed_point.residuals,
        parameters=return_map.parameters,
        engine=return_map.engine.name,
        precision=precision.name,
    )


def cycle_of(section: Section[C], omega: Fraction, measured: dict[str, Measured], **others: Any) -> C:
    """The cycle with these numbers, the sum ``log_multipliers`` of the logarithms among them, and other attributes."""
    logarithms_bounded(measured)
    # The true multiplier along the flow is 1: its computed distance from 1 is all error.
    defect = measured["trivial_multiplier_defect"]
    measured["trivial_multiplier_defect"] = Measured(defect.value, max(defect.uncertainty, defect.value))
    slow = measured["multiplier_slow"]
    certain = abs(abs(slow.value) - 1) > slow.uncertainty
    stable = bool(abs(slow.value) < 1) if certain else None
    return section.result(omega=Measured(omega, Fraction(0)), stable=stable, **(others | measured))


# ------------------------------------------------------------------------------------------------ the numbers
def cycle_numbers(fixed_point: FixedPoint[C], precision: Precision) -> dict[str, Any]:
    """All numbers of the cycle in one arithmetic."""
    return _sharpened(fixed_point, precision)[0]


def numbers_at(
    return_map: ReturnMap[C], point: tuple[Any, Any], image: Image, rounding: int | None = None
) -> dict[str, Any]:
    """All numbers of the cycle through a fixed point of the map, from the map's derivatives there."""
    flight, (first, second, _, time) = return_map.flight(point, rounding), image.slopes("speed")
    return return_map.section.table(
        point,
        image.time,
        image.matrix,
        (first, second, time),
        return_map.trivial_multiplier(point, image),
        return_map.measures(flight) | {"divergence": flight.divergence},
        return_map.precision.ops,
    )


def _draws(fixed_point: FixedPoint[C]) -> Iterator[dict[str, Any]]:
    """The numbers of the cycle in double, then those of its twins, each with other last bits."""
    return_map, point = fixed_point.return_map, fixed_point.point
    first, second = return_map.section.names
    yield numbers_at(return_map, point, fixed_point.image)
    for pattern in count(1):
        image = return_map(point, pattern)
        numbers = numbers_at(return_map, point, image, pattern)
        # The arrival is a double, and where a cycle attracts weakly that hides what rounding does: the residual is the
        # same, often zero, over many starts. One unit more or less in the arrival's last place brings it to light.
        arrival = [now + before for now, before in zip(image.residual, point, strict=True)]
        moved = nudged(arrival, pattern + 2, DOUBLE)
        residual = [now + (other - whole) for now, whole, other in zip(image.residual, arrival, moved, strict=True)]
        step = image._replace(residual=tuple(residual)).newton_step()
        point = (point[0] + step[0], point[1] + step[1])
        later = image.time_by_state[0] * step[0] + image.time_by_state[1] * step[1]
        period = numbers["period"] + return_map.section.per_period * later
        yield numbers | {first: point[0], second: point[1], "period": period}


# ------------------------------------------------------------------------------------------------ the half-widths
def half_widths_by_twins(
    numbers: dict[str, Any], doubles: Sequence[dict[str, Any]], precision: Precision = DOUBLE
) -> dict[str, Measured]:
    """Numbers in double, or in an arithmetic a little wider, with half-widths from as many draws in double."""
    share = TWIN_FACTOR * 2.0 ** (DOUBLE.bits - precision.bits)
    ulp, measured = float(precision.epsilon), {}
    for name, number in numbers.items():
        values = [float(draw[name]) for draw in doubles]
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

    The slow one is at most what rounding leaves of it, and the fast one is no larger; their sum has its own half-width.
    """
    slow, both = measured["multiplier_slow"], measured.pop("log_multipliers")
    if 2 * slow.uncertainty < abs(slow.value):
        return
    highest = Fraction(math.log(abs(slow.value) + slow.uncertainty))
    lowest = min(both.value / 2, highest)
    middle, half = (highest + lowest) / 2, (highest - lowest) / 2 + both.uncertainty + abs(highest) / 2**50
    measured["log_multiplier_slow"] = Measured(middle, half)
    measured["log_multiplier_fast"] = Measured(both.value - middle, half)


# ------------------------------------------------------------------------------------------------ the iteration
def _sharpened(
    fixed_point: FixedPoint[C], precision: Precision
) -> tuple[dict[str, Any], dict[str, Fraction], FixedPoint[C]]:
    """All numbers of the cycle, what the chord iteration leaves undecided of its point and period, and where it ended.

    Raises AccuracyError if the chord iteration does not settle.
    """
    return_map = fixed_point.return_map
    if precision == return_map.precision:
        return numbers_at(return_map, fixed_point.point, fixed_point.image), {}, fixed_point
    return_map = return_map.within(precision)
    point, standing = _chords(return_map, fixed_point)
    image = return_map(point)
    undecided = [_STANDING * step for step in standing]
    times = (fraction(abs(a)) * b for a, b in zip(image.time_by_state, undecided, strict=True))
    doubt = dict(zip(return_map.section.names, undecided, strict=True))
    doubt["period"] = return_map.section.per_period * sum(times, Fraction(0))
    sharper = replace(fixed_point, return_map=return_map, point=point, image=image)
    return numbers_at(return_map, point, image), doubt, sharper


def _chords(return_map: ReturnMap[C], fixed_point: FixedPoint[C]) -> tuple[tuple[Any, Any], tuple[Fraction, Fraction]]:
    """Chord steps with the fixed point's derivative, until they are below rounding; and the step where they stood."""
    precision = return_map.precision
    point = [precision.number(coordinate) for coordinate in fixed_point.point]
    (a, b), (c, d) = ([precision.number(entry) for entry in row] for row in fixed_point.image.matrix)
    # Below a thousand ulps only rounding is left; a step that has stopped shrinking says the same.
    small = 1000 * precision.epsilon
    failure = AccuracyError(f"the chord iteration has not converged in {precision.name} precision")
    stop = Stop(precision.bits // 8 + 8, failure, small=small, fewest=2)

    def size(iterate: Iterate[C]) -> Fraction:
        return sum((fraction(abs(step)) for step in iterate.step[:2]), Fraction(0))

    chord = fixed_point.image._replace(matrix=((a, b), (c, d)), by_omega=(0, 0))
    found = newton(return_map, point, stop, size, chord=chord)
    first, second = (Fraction(0) if size(found) < small else fraction(abs(step)) for step in found.step[:2])
    return found.ahead[:2], (first, second)
