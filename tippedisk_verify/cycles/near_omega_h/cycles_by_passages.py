"""Limit cycles next to Omega_h by passages, in milliseconds, with half-widths.

`saddle_passages` has the maps. This module chooses their sections, series and flights, and the
number of speeds that they are interpolated from (`_SETTINGS`). Half-widths follow from the
differences to coarser settings, which round some four times as much. If the digits are not reached,
or the maps do not exist, `cycles_by_broyden` follows the flow itself.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any, TypeVar

import numpy

from tippedisk_verify.connection.omega_h_digits import DISTANCE_DIGITS, omega_h_resolving
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.near_omega_h.saddle_passages import (
    GlobalMap,
    PassageSettings,
    SaddleToSaddleMap,
    half_period_matrix,
    integral_of_divergence,
    split_at_section,
)
from tippedisk_verify.cycles.shooting.cycle_numbers import numbers_from_map
from tippedisk_verify.cycles.shooting.error_budget import cycle_from_numbers
from tippedisk_verify.cycles.shooting.section import LIBRATING, Section
from tippedisk_verify.errors import AccuracyError, NoConnectionError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import DOUBLE, EXTENDED, precision_of_bits, wider_precision
from tippedisk_verify.theory.equilibria import saddle_value_sign

__all__ = [
    "cycle_by_passages",
    "global_maps",
    "monodromy_by_passages",
    "passages_exist",
    "with_half_widths",
]

C = TypeVar("C", bound=Cycle)

_SETTINGS = PassageSettings(
    chart_order=20,
    chart_bands=5,
    section_ratio=0.10,
    arrival_ratio=0.25,
    speed_count=9,
    max_start_ratio=0.016,
    max_distance=1e-5,
)
# Settings with a larger truncation error. Their flights lie closer together, so that rounding
# weighs some four times as much in the derivatives of u with respect to the speed and to sigma,
# which matter most.
_COARSER_SETTINGS = tuple(
    PassageSettings(
        chart_order=17,
        chart_bands=4,
        section_ratio=section_ratio,
        arrival_ratio=arrival_ratio,
        speed_count=7,
        max_start_ratio=0.004,
        max_distance=max_distance,
        perturbation_pattern=k,
    )
    for k, (section_ratio, arrival_ratio, max_distance) in enumerate(
        ((0.09, 0.06, 3e-5), (0.08, 0.07, 5e-5), (0.075, 0.065, 4e-5), (0.07, 0.075, 6e-5)), start=1
    )
)
# The half-width in units of the largest distance to the others. An error beyond it has a
# probability of some 1e-6 for normal errors, if those of the others are four times as large.
_DIFFERENCE_FACTOR = 8
_ULPS = 2.0**-60  # relative; the maps' constants and logarithms are rounded alike with all settings
_MAX_POWER = 20  # the largest power of the distance from Omega_h in any number of a cycle
# An imaginary part, relative to the distance; its square is far below rounding
_COMPLEX_STEP = 2.0**-100
# 1 / the grid [rad/s] of the maps' origin, so that it does not depend on further digits of Omega_h.
_ORIGIN_GRID = 2**72
_CACHED_DISKS = 64  # disks in the cache
_MAX_DIGITS = 15  # digits that 64 bits give with some certainty
_PI_BITS = 96  # bits of pi beyond those of the half-width


@ignore_numpy_errors()
def cycle_by_passages(
    section: Section[C],
    parameters: Parameters,
    speed_or_distance: Fraction,
    engine: Engine,
    digits: int,
    *,
    from_omega_h: bool = False,
) -> C | None:
    """Compute the limit cycle next to Omega_h from linear passages of the saddles, to ``digits``
    significant digits.

    Args:
        section: Librating cycles lie above Omega_h, stable rotating ones below.
        parameters: The disk and its friction law.
        speed_or_distance: The exact speed, or distance from Omega_h [rad/s].
        engine: The engine of the flights.
        digits: The digits of the period, the coordinates and beta_max.
        from_omega_h: If True, it is a distance from Omega_h, and the speed is as uncertain
            as Omega_h.

    Returns:
        The cycle, or None if only another method may succeed. That is so if the digits are not
        reached, the machine has no numbers of 64 bits, the saddle value is not negative, or a
        series or an iteration fails.
    """
    if digits > _MAX_DIGITS or not engine.measures_error:
        return None
    try:
        omega_h = omega_h_resolving(
            parameters, speed_or_distance, engine, from_omega_h=from_omega_h
        )
        distance = speed_or_distance if from_omega_h else speed_or_distance - omega_h.value
        if (distance > 0) != (section is LIBRATING) or not passages_exist(
            parameters, engine, omega_h.value
        ):
            return None
        first, *others = (
            _numbers(section, global_map, distance)
            for global_map in global_maps(parameters, omega_h.value, engine)
        )
    except (AccuracyError, NoConnectionError, ArithmeticError, StopIteration):
        return None
    numbers, sizes = first
    if not all(numpy.isfinite(number) for row, _ in (first, *others) for number in row.values()):
        return None
    measured = with_half_widths(
        numbers, [row for row, _ in others], omega_h.uncertainty / abs(distance)
    )
    if section is LIBRATING:
        gap = measured["gamma_bar_0"]
        pi = fraction(precision_of_bits(_PI_BITS + gap.uncertainty.denominator.bit_length()).pi)
        measured["gamma_bar_0"] = Measured(pi + gap.value, gap.uncertainty)
    cycle = cycle_from_numbers(
        section,
        omega_h.value + distance,
        measured,
        residuals=tuple(sizes),
        parameters=parameters,
        engine=engine.name,
        precision=EXTENDED.name,
        _start_matrix=partial(monodromy_by_passages, parameters, omega_h.value, distance)
        if section is LIBRATING
        else None,
    )
    main = [measured[name] for name in ("period", *section.coordinate_names, "beta_max")]
    if (
        any(number.uncertainty > abs(number.value) / 10**digits for number in main)
        or not cycle.stable
    ):
        return None
    return (
        replace(cycle, omega=Measured(cycle.omega.value, omega_h.uncertainty))
        if from_omega_h
        else cycle
    )


def with_half_widths(
    numbers: dict[str, Any], others: list[dict[str, Any]], relative_uncertainty: Fraction
) -> dict[str, Measured]:
    """Convert the numbers of a cycle to `Measured`, by name.

    Args:
        numbers: The numbers with the first settings of sections, series and flights.
        others: The same numbers with other settings. The largest distance to them gives the
            half-width.
        relative_uncertainty: The relative uncertainty of the distance from Omega_h.
    """
    measured = {}
    for name, number in numbers.items():
        largest_difference = max(abs(number - row[name]) for row in others)
        width = fraction(_DIFFERENCE_FACTOR * largest_difference + _ULPS * abs(number))
        # Where log(distance) is near 0, its change exceeds its size.
        size = max(abs(number), 1) if name.startswith(("period", "log")) else abs(number)
        measured[name] = Measured(
            fraction(number), width + _MAX_POWER * fraction(size) * relative_uncertainty
        )
    return measured


def passages_exist(parameters: Parameters, engine: Engine, omega_h: Fraction) -> bool:
    """Return True if cycles next to Omega_h can be computed from linear passages of the saddles.

    The machine and the engine must compute in 64 bits, and the saddle value must be negative.
    """
    extended = wider_precision(DOUBLE) == EXTENDED and engine.measures_error
    return extended and saddle_value_sign(parameters, omega_h) < 0


def global_maps(parameters: Parameters, omega_h: Fraction, engine: Engine) -> tuple[GlobalMap, ...]:
    """Return the maps between the saddles by `_SETTINGS`, then those by `_COARSER_SETTINGS`.

    They are cached. Values of Omega_h that agree to some twenty decimals share them.

    Args:
        parameters: The disk and its friction law.
        omega_h: Omega_h [rad/s].
        engine: The engine of the flights.
    """
    origin = Fraction(round(omega_h * _ORIGIN_GRID), _ORIGIN_GRID)
    return _maps_made_at(parameters, origin, engine)


@lru_cache(maxsize=_CACHED_DISKS)
def _maps_made_at(
    parameters: Parameters, origin: Fraction, engine: Engine
) -> tuple[GlobalMap, ...]:
    return tuple(
        GlobalMap(parameters, origin, engine, settings)
        for settings in (_SETTINGS, *_COARSER_SETTINGS)
    )


@ignore_numpy_errors()
def monodromy_by_passages(
    parameters: Parameters, omega_h: Fraction, distance: Fraction
) -> tuple[Any, Any]:
    """Return the monodromy matrix (3, 3) of a librating cycle at its section, and its half-widths.

    Args:
        parameters: The disk and its friction law.
        omega_h: Omega_h [rad/s].
        distance: The distance of the speed from Omega_h [rad/s].
    """
    first, *others = (
        _period_matrix(global_map, distance)
        for global_map in global_maps(parameters, omega_h, default_engine())
    )
    largest_difference = numpy.max([abs(first - other) for other in others], axis=0)
    relative_uncertainty = _ULPS + _MAX_POWER / 10**DISTANCE_DIGITS
    return first, (
        _DIFFERENCE_FACTOR * largest_difference + relative_uncertainty * abs(first)
    ).astype(float)


def _period_matrix(global_map: GlobalMap, distance: Fraction) -> Any:
    at = EXTENDED.number(distance)
    half = SaddleToSaddleMap(global_map, at, LIBRATING.symmetry_sign)
    sigma, multiplier, _ = half.fixed_point()
    imaginary = abs(at) * _COMPLEX_STEP
    time_by_sigma = half(sigma + 1j * imaginary).time.imag / imaginary
    _, rest = split_at_section(half(sigma).pieces, LIBRATING.zero_component)
    matrix = half_period_matrix(rest, multiplier, time_by_sigma)
    return matrix @ matrix


def _numbers(
    section: Section[Any], global_map: GlobalMap, distance: Fraction
) -> tuple[dict[str, Any], list[float]]:
    """Return the numbers of the limit cycle at a distance from Omega_h, by name, and the relative
    sizes of the iteration's steps.

    The derivatives of the cycle with respect to the speed are among the numbers. They are
    complex-step derivatives: the speed has an imaginary part far below rounding. pi is subtracted
    from ``gamma_bar_0``, so that it keeps its digits.
    """
    at = EXTENDED.number(distance)
    sigma, multiplier, sizes = SaddleToSaddleMap(
        global_map, at, section.symmetry_sign
    ).fixed_point()
    imaginary = abs(at) * _COMPLEX_STEP
    moved = SaddleToSaddleMap(global_map, at + 1j * imaginary, section.symmetry_sign)
    sigma = sigma + (moved(sigma).sigma - sigma) / (1 - multiplier)
    passage = moved(sigma)
    arrival, pieces = passage.arrival, passage.pieces
    part, _ = split_at_section(pieces, section.zero_component)
    near_saddle = part.symmetry_sign * part.chart.offset_at(part.end)
    point = (near_saddle[1], near_saddle[2]) if section is LIBRATING else (arrival[5], arrival[6])
    time = EXTENDED.number(global_map.duration) + passage.time
    along = numpy.prod([moved.trivial_multiplier(piece) for piece in pieces])
    event_quantities = {
        "beta_max": arrival[4].real,
        "beta_bar_0": near_saddle[0].real,
        "v_0": near_saddle[2].real,
        "divergence": (arrival[3] + integral_of_divergence(pieces)).real,
    }
    return numbers_from_map(
        section,
        [coordinate.real for coordinate in point],
        time.real,
        ((multiplier, 0), (0, 0)),
        [number.imag / imaginary for number in (*point, time)],
        along.real,
        event_quantities,
        numpy,
    ), sizes
