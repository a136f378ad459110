"""The numbers of a limit cycle, and the budget of their half-widths (derived in
docs/error_budgets.md).

**Twins.** In double precision *twins* measure the error. Newton's iteration goes on for a few
steps, each with the last bits of constants and speed moved. Each step solves the equations anew,
with different rounding. Its derivatives are taken at a state whose error is as large as that of the
solution. Because the parameters are moved too, the numbers also show the effect of rounding the
parameters. So each number of each twin is another draw of the same error, and

    half-width = TWIN_FACTOR * spread + ulp(q).

There is no other part. Truncation is far below rounding at the integrator's own tolerance, and
Newton's iteration has converged to the level of rounding.

**The next arithmetic.** Where the equations amplify rounding the cycle is solved in the next wider
arithmetic. Its error has the same distribution, scaled down by the ratio of the roundings. So the
twins in double precision measure it too.

**Many bits.** With many more bits the same numbers are computed twice, in an arithmetic and in one
with 64 bits more. The distance measures the error. The wider run's own error comes from the last
step of its iteration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import count, islice
from typing import Any, TypeVar

from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.shooting.cycle_numbers import numbers_from_map
from tippedisk_verify.cycles.shooting.newton import FixedPoint, Iterate, StoppingRule, newton
from tippedisk_verify.cycles.shooting.return_map import LinearizedReturn, ReturnMap
from tippedisk_verify.cycles.shooting.section import Section
from tippedisk_verify.errors import AccuracyError, NoSuchCycleError
from tippedisk_verify.flow.system import perturb_last_bits
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    DOUBLE_DIGITS,
    Precision,
    bits_for_digits,
    precision_of_bits,
    wider_precision,
)
from tippedisk_verify.support.progress import report_share, subrange

__all__ = [
    "EXTRA_DIGITS",
    "bound_lost_logarithms",
    "cycle_beyond_double",
    "cycle_from_numbers",
    "cycle_in_precision",
    "cycle_to_digits",
    "iterate_until_rounding",
    "numbers_at",
    "numbers_in_precision",
]

C = TypeVar("C", bound=Cycle)

# The digits that rounding and the factor of the half-width usually take from the digits of an
# arithmetic.
_LOST_DIGITS = 3
#: The number of twins of a cycle in double, and the half-width in units of the spread. The spread
#: is that of the twins and the cycle itself. For normal errors as large as the twins' an error
#: beyond the half-width has a probability of 2e-6. The half-width is 14 times the error in the
#: median. tests/cycles/test_error_budget.py integrates both. Perturbing constants and arrival by
#: one unit in the last place has twice the effect of rounding.
TWINS = 5
TWIN_FACTOR = 4
#: The number of twins if the cycle is computed in the next wider arithmetic. The spread is then
#: that of the twins and the cycle in double, scaled to the wider arithmetic; the cycle itself is
#: not among them. With this number the risk is that of `TWINS`.
WIDER_TWINS = 8
# A factor by which half-widths must stay below the digits wanted. Half-widths of the same cycle
# differ by up to 1.6 from draw to draw. With this factor last bits do not decide which arithmetic
# answers.
_CHOICE_SAFETY_FACTOR = 2
# The error of an iteration that no longer shrinks, in units of its step: the ratio of two steps is
# at least 1/2.
_STALLED_STEPS = 4
#: The number of extra digits for a cycle that needs more digits than doubles have.
EXTRA_DIGITS = 20
# The number of attempts, each with twice as many extra digits. The last takes a minute.
_MAX_WIDENINGS = 4
# The largest chord step, relative to the cycle's size. With a longer one the derivative is too far
# off.
_MAX_CHORD_STEP = Fraction(1, 10)
_MAX_NEWTON_STEPS = 20  # each doubles the digits
# The share of a cycle's time that is spent on its first run, and the share of a run that is spent
# on its chord steps. The rest is for derivatives.
_FIRST_RUN_SHARE, _CHORD_SHARE = 0.4, 0.6
# An iterate that is smaller than the start by this factor is on its way to the equilibrium, the
# trivial solution.
_MAX_SHRINKAGE = 5


def cycle_to_digits(fixed_point: FixedPoint[C], digits: int, *, half_widths: bool = True) -> C:
    """Return a limit cycle to ``digits`` significant digits, from its fixed point in double.

    Args:
        fixed_point: The end of Newton's iteration in double.
        digits: The significant digits wanted.
        half_widths: If False, return the numbers of the first arithmetic that holds the digits,
            without half-widths.

    Raises:
        AccuracyError: If the digits are not reached.
    """
    if not half_widths:
        precision = (
            DOUBLE
            if digits <= DOUBLE_DIGITS
            else precision_of_bits(bits_for_digits(digits + EXTRA_DIGITS))
        )
        numbers = numbers_in_precision(fixed_point, precision)
        unmeasured = {
            name: Measured.without_half_width(number, digits) for name, number in numbers.items()
        }
        return _cycle_from_fixed_point(fixed_point, unmeasured, precision)
    twins_left, doubles = _twins(fixed_point), list[dict[str, Any]]()
    wanted, wider = max(digits, DOUBLE_DIGITS), wider_precision(DOUBLE)
    for precision, twins in (
        (DOUBLE, TWINS),
        (wider, WIDER_TWINS),
        (wider_precision(wider), WIDER_TWINS),
    ):
        if wanted + _LOST_DIGITS <= precision.digits:
            doubles += islice(twins_left, 1 + twins - len(doubles))
            cycle = _by_twins(fixed_point, precision, doubles)
            if (
                cycle is not None
                and _first_without_digits(cycle, wanted, _CHOICE_SAFETY_FACTOR) is None
            ):
                return cycle
    return cycle_beyond_double(fixed_point, digits)


def cycle_beyond_double(
    fixed_point: FixedPoint[C], digits: int, extra_digits: int = EXTRA_DIGITS
) -> C:
    """Compute a limit cycle in an arithmetic beyond doubles, to ``digits`` significant digits.

    Slow convergence next to the Hopf point and the passages of the saddles cost digits. The first
    arithmetic has ``extra_digits`` more digits. They are doubled until the digits are reached, in
    at most `_MAX_WIDENINGS` attempts.

    Args:
        fixed_point: The end of Newton's iteration in double.
        digits: The significant digits wanted.
        extra_digits: The extra digits of the first arithmetic.

    Raises:
        AccuracyError: If the widest arithmetic does not reach the digits.
    """
    name: str | None = None
    for extra in (extra_digits * 2**widening for widening in range(_MAX_WIDENINGS)):
        cycle = cycle_in_precision(fixed_point, precision_of_bits(bits_for_digits(digits + extra)))
        if (name := _first_without_digits(cycle, digits)) is None:
            return cycle
    raise AccuracyError(
        f"{name} has fewer than {digits} digits so close to a bifurcation: ask for {digits + extra}, "
        f"which uses a wider arithmetic"
    )


def cycle_in_precision(
    fixed_point: FixedPoint[C], precision: Precision, wider: Precision | None = None
) -> C:
    """Compute a limit cycle in one arithmetic, with half-widths.

    In double the half-widths come from twins, repeated computations with other last bits. Otherwise
    they come from a wider arithmetic.

    Args:
        fixed_point: The end of Newton's iteration in double.
        precision: The arithmetic.
        wider: The arithmetic that measures the error; None for the one wider than ``precision``.

    Raises:
        AccuracyError: If the iteration does not settle.
    """
    if precision == DOUBLE:
        doubles = list(islice(_twins(fixed_point), 1 + TWINS))
        return _cycle_from_fixed_point(
            fixed_point, half_widths_by_twins(doubles[0], doubles), precision
        )
    with subrange(0, _FIRST_RUN_SHARE):
        numbers, _, accurate_fixed_point = _solve_in_precision(fixed_point, precision)
    with subrange(_FIRST_RUN_SHARE, 1):
        accurate, remaining_error, _ = _solve_in_precision(
            accurate_fixed_point, wider or wider_precision(precision)
        )
    return _cycle_from_fixed_point(
        fixed_point,
        half_widths_by_wider_run(numbers, accurate, remaining_error, precision),
        precision,
    )


def _by_twins(
    fixed_point: FixedPoint[C], precision: Precision, doubles: Sequence[dict[str, Any]]
) -> C | None:
    """Return the limit cycle in double, or in an arithmetic a little wider, with half-widths from
    the scatter of repeated computations in double.

    Returns None if the wider iteration does not settle, or stalls above the level that rounding
    explains.

    Args:
        fixed_point: The end of Newton's iteration in double.
        precision: The arithmetic of the result.
        doubles: The cycle's numbers in double, then the same with other last bits.
    """
    if precision == DOUBLE:
        numbers, remaining_error = doubles[0], dict[str, Fraction]()
    else:
        try:
            numbers, remaining_error, _ = _solve_in_precision(fixed_point, precision)
        except AccuracyError:
            return None
    measured = half_widths_by_twins(numbers, doubles, precision)
    if any(measured[name].uncertainty < left for name, left in remaining_error.items()):
        return None
    return _cycle_from_fixed_point(fixed_point, measured, precision)


def _first_without_digits(cycle: Cycle, digits: int, safety_factor: int = 1) -> str | None:
    """Return the name of the first main number of a cycle that has fewer than ``digits`` digits, or
    None.

    A half-width times ``safety_factor`` must lie within the digits wanted.
    """
    for name in ("period", *cycle.coordinates, "beta_max"):
        measured: Measured = getattr(cycle, name)
        if safety_factor * measured.uncertainty > abs(measured.value) * Fraction(1, 10**digits):
            return name
    return None


def _cycle_from_fixed_point(
    fixed_point: FixedPoint[C], measured: dict[str, Measured], precision: Precision
) -> C:
    """Return a limit cycle object from its numbers, the fixed point and the arithmetic of the
    numbers.
    """
    return_map = fixed_point.return_map
    return cycle_from_numbers(
        return_map.section,
        return_map.omega,
        measured,
        residuals=fixed_point.residuals,
        parameters=return_map.parameters,
        engine=return_map.engine.name,
        precision=precision.name,
    )


def cycle_from_numbers(
    section: Section[C], omega: Fraction, measured: dict[str, Measured], **others: Any
) -> C:
    """Return a limit cycle object from its numbers by name, and decide its stability.

    Args:
        section: The section of the kind of cycle.
        omega: The speed [rad/s].
        measured: The numbers by name. The sum ``log_multipliers`` of the logarithms is among them.
        others: Other attributes of the result.
    """
    bound_lost_logarithms(measured)
    # The true multiplier along the flow is 1: its computed distance from 1 is all error.
    defect = measured["trivial_multiplier_defect"]
    measured["trivial_multiplier_defect"] = Measured(
        defect.value, max(defect.uncertainty, defect.value)
    )
    slow = measured["multiplier_slow"]
    certain = abs(abs(slow.value) - 1) > slow.uncertainty or not slow.is_measured
    stable = bool(abs(slow.value) < 1) if certain else None
    return section.cycle_class(
        omega=Measured(omega, Fraction(0)), stable=stable, **(others | measured)
    )


# -------------------------------------------------------------------------------------- the numbers
def numbers_in_precision(fixed_point: FixedPoint[C], precision: Precision) -> dict[str, Any]:
    """Return all numbers of a limit cycle by name, solved again in one arithmetic.

    Args:
        fixed_point: The end of Newton's iteration in double.
        precision: The arithmetic.

    Raises:
        AccuracyError: If the iteration does not settle.
    """
    return _solve_in_precision(fixed_point, precision)[0]


def numbers_at(
    return_map: ReturnMap[C],
    point: tuple[Any, Any],
    image: LinearizedReturn,
    perturbation_pattern: int | None = None,
) -> dict[str, Any]:
    """Return all numbers of the limit cycle through a fixed point of the return map, by name.

    Args:
        return_map: The map.
        point: The fixed point, both coordinates.
        image: The image of the point, with the map's derivatives.
        perturbation_pattern: The pattern by which last bits are moved; None for no move.
    """
    flight, (first, second, _, time) = (
        return_map.flight(point, perturbation_pattern),
        image.slopes("speed"),
    )
    return numbers_from_map(
        return_map.section,
        point,
        image.time,
        image.jacobian,
        (first, second, time),
        return_map.trivial_multiplier(point, image),
        return_map.event_quantities(flight) | {"divergence": flight.divergence},
        return_map.precision.ops,
    )


def _twins(fixed_point: FixedPoint[C]) -> Iterator[dict[str, Any]]:
    """Yield the numbers of a limit cycle in double, then again and again with other last bits.

    The scatter of the repeated numbers shows the effect of rounding.
    """
    return_map, point = fixed_point.return_map, fixed_point.point
    first, second = return_map.section.coordinate_names
    yield numbers_at(return_map, point, fixed_point.image)
    for pattern in count(1):
        image = return_map(point, pattern)
        numbers = numbers_at(return_map, point, image, pattern)
        # The arrival is a double. Where a cycle attracts weakly this hides the effect of rounding:
        # the residual is the same, often zero, over many starts. A change of the arrival by one
        # unit in the last place shows it.
        arrival = [now + before for now, before in zip(image.residual, point, strict=True)]
        moved = perturb_last_bits(arrival, pattern + 2, DOUBLE)
        residual = [
            now + (other - whole)
            for now, whole, other in zip(image.residual, arrival, moved, strict=True)
        ]
        step = image._replace(residual=tuple(residual)).newton_step()
        point = (point[0] + step[0], point[1] + step[1])
        later = image.time_by_state[0] * step[0] + image.time_by_state[1] * step[1]
        period = numbers["period"] + return_map.section.flights_per_period * later
        yield numbers | {first: point[0], second: point[1], "period": period}


# ---------------------------------------------------------------------------------- the half-widths
def half_widths_by_twins(
    numbers: dict[str, Any], doubles: Sequence[dict[str, Any]], precision: Precision = DOUBLE
) -> dict[str, Measured]:
    """Return a cycle's numbers with half-widths from the scatter of repeated computations in
    double.

    Args:
        numbers: The numbers in double, or in an arithmetic a little wider.
        doubles: The numbers from repeated computations in double, each with other last bits.
        precision: The arithmetic of the numbers.
    """
    share = TWIN_FACTOR * 2.0 ** (DOUBLE.bits - precision.bits)
    ulp, measured = float(precision.epsilon), {}
    for name, number in numbers.items():
        values = [float(draw[name]) for draw in doubles]
        # Doubles suffice: their rounding is far below the uncertainty of a width from a few draws.
        width = share * (max(values) - min(values)) + abs(values[0]) * ulp
        measured[name] = Measured(fraction(number), Fraction(width))
    return measured


def half_widths_by_wider_run(
    coarse: dict[str, Any],
    accurate: dict[str, Any],
    remaining_error: dict[str, Fraction],
    precision: Precision,
) -> dict[str, Measured]:
    """Return the numbers of a limit cycle with half-widths, by comparison with a run in wider
    arithmetic.

    A half-width comes from the distance of the coarse number to the accurate one, and from the
    accurate one's own error. The wider iteration leaves an error in the state; how far the other
    numbers move with the state follows from the two runs.

    Args:
        coarse: The numbers in ``precision``.
        accurate: The numbers of the wider run.
        remaining_error: The error of state and period that the wider iteration leaves.
        precision: The arithmetic of the coarse numbers.
    """
    measured = {
        name: Measured.compared(number, accurate[name], precision.epsilon)
        for name, number in coarse.items()
    }
    unknowns = [name for name in remaining_error if name != "period"]
    apart = sum(
        max(
            abs(measured[name].value - fraction(accurate[name])),
            abs(measured[name].value) * precision.epsilon,
        )
        for name in unknowns
    )
    share = sum((remaining_error[name] for name in unknowns), Fraction(0)) / apart
    for name, number in measured.items():
        more = abs(number.value - fraction(accurate[name])) * share + remaining_error.get(name, 0)
        measured[name] = Measured(number.value, number.uncertainty + more)
    return measured


def bound_lost_logarithms(measured: dict[str, Measured]) -> None:
    """Replace the logarithms of Floquet multipliers that are lost in rounding by bounds.

    The slow multiplier is at most the size that rounding leaves of it. The fast one is no larger.
    Their sum has its own half-width.

    Args:
        measured: The numbers by name; changed in place. ``log_multipliers`` is removed.
    """
    slow, both = measured["multiplier_slow"], measured.pop("log_multipliers")
    if 2 * slow.uncertainty < abs(slow.value) or not slow.is_measured:
        return
    highest = Fraction(math.log(abs(slow.value) + slow.uncertainty))
    lowest = min(both.value / 2, highest)
    middle, half = (
        (highest + lowest) / 2,
        (highest - lowest) / 2 + both.uncertainty + abs(highest) / 2**50,
    )
    measured["log_multiplier_slow"] = Measured(middle, half)
    measured["log_multiplier_fast"] = Measured(both.value - middle, half)


# ------------------------------------------------------------------------------------ the iteration
def _solve_in_precision(
    fixed_point: FixedPoint[C], precision: Precision
) -> tuple[dict[str, Any], dict[str, Fraction], FixedPoint[C]]:
    """Solve for a limit cycle again in an arithmetic, from its fixed point in another one.

    Returns its numbers by name, the errors of its point and period that the iteration leaves, and
    the fixed point in that arithmetic.

    Raises AccuracyError if the iteration does not settle.
    """
    return_map = fixed_point.return_map
    if precision == return_map.precision:
        return numbers_at(return_map, fixed_point.point, fixed_point.image), {}, fixed_point
    return_map = return_map.in_precision(precision)
    point, stalled_step = iterate_until_rounding(return_map, fixed_point)
    image = return_map(point)
    step_error_bounds = [_STALLED_STEPS * step for step in stalled_step]
    times = (
        fraction(abs(a)) * b for a, b in zip(image.time_by_state, step_error_bounds, strict=True)
    )
    remaining_error = dict(zip(return_map.section.coordinate_names, step_error_bounds, strict=True))
    remaining_error["period"] = return_map.section.flights_per_period * sum(times, Fraction(0))
    accurate_fixed_point = replace(fixed_point, return_map=return_map, point=point, image=image)
    return numbers_at(return_map, point, image), remaining_error, accurate_fixed_point


def iterate_until_rounding(
    return_map: ReturnMap[C], fixed_point: FixedPoint[C]
) -> tuple[tuple[Any, Any], tuple[Fraction, Fraction]]:
    """Iterate for a fixed point of the return map, in the map's arithmetic, until a step is below
    rounding or no longer shrinks.

    Chord steps with the fixed point's own derivative come first: each takes a flight without
    variational equations. That derivative is too far off if a step is not half of the one before,
    as next to a bifurcation. It is too far off as well if a step is long, or if there are many.
    Newton's steps then follow. If one of these is not half of the one before, only rounding is
    left.

    Returns the point, and the sizes of the step at which it stalled, 0 if it did not.

    Raises AccuracyError if neither happens, or if the iteration shrinks towards the equilibrium.
    """
    precision = return_map.precision
    point = tuple(precision.number(coordinate) for coordinate in fixed_point.point)
    scale = min(Fraction(1), _length(point))
    # Below a thousand ulps only rounding is left. A step that has stopped shrinking shows the same.
    small = 1000 * precision.epsilon * scale
    failure = AccuracyError(
        f"the iteration for the cycle has not converged in {precision.name} precision"
    )

    def size(iterate: Iterate[C]) -> Fraction:
        is_finite = all(map(math.isfinite, map(float, iterate.step)))
        if not is_finite or _length(iterate.next_point[:2]) < scale / _MAX_SHRINKAGE:
            raise failure
        return _length(iterate.step[:2])

    def size_of_chord(iterate: Iterate[C]) -> Fraction:
        length = size(iterate)
        if length > _MAX_CHORD_STEP * scale:
            raise failure
        if length > small:
            report_share(
                _CHORD_SHARE * decimal_magnitude(length / scale) / decimal_magnitude(small / scale)
            )
        return length

    with suppress(AccuracyError, NoSuchCycleError):
        rows: Any = tuple(
            tuple(precision.number(entry) for entry in row) for row in fixed_point.image.jacobian
        )
        chord = fixed_point.image._replace(jacobian=rows, by_omega=(0, 0))
        stop = StoppingRule(precision.bits // 8 + 8, failure, tolerance=small, min_sizes=2)
        found = newton(return_map, point, stop, size_of_chord, chord=chord)
        if size(found) < small:
            return found.next_point[:2], (Fraction(0), Fraction(0))
        point = found.point
    try:
        found = newton(
            return_map,
            point,
            StoppingRule(_MAX_NEWTON_STEPS, failure, tolerance=small, min_sizes=2),
            size,
        )
    except NoSuchCycleError:
        raise failure from None
    if size(found) < small:
        return found.next_point[:2], (Fraction(0), Fraction(0))
    return found.next_point[:2], (fraction(abs(found.step[0])), fraction(abs(found.step[1])))


def _length(vector: Sequence[Any]) -> Fraction:
    """Return the sum of the absolute values of a vector's components."""
    return sum((fraction(abs(coordinate)) for coordinate in vector), Fraction(0))
