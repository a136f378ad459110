"""A cycle's numbers from its return map: period, Floquet multipliers, and slopes along the family.

Each number has its formula in `numbers_from_map`. The numbers with half-widths are listed in
`number_names`. `error_budget` has the half-widths.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy

from tippedisk_verify.cycles.shooting.section import Section

__all__ = ["number_names", "numbers_from_map"]

_MIN_MULTIPLIER = 2.0**-1022  # the least normal double


def number_names(section: Section[Any]) -> tuple[str, ...]:
    """Return the names of all numbers of a cycle that have half-widths.

    Args:
        section: The section of its kind of cycle.
    """
    by_omega = (f"d{name}_domega" for name in ("period", *section.coordinate_names))
    multipliers = ("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast")
    return (
        "period",
        *section.coordinate_names,
        *(quantity.name for quantity in section.event_quantities),
        *multipliers,
        *by_omega,
    )


def numbers_from_map(
    section: Section[Any],
    point: Sequence[Any],
    time: Any,
    matrix: Any,
    slopes: Any,
    trivial: Any,
    flight: Mapping[str, Any],
    ops: Any,
) -> dict[str, Any]:
    """Return the numbers of a cycle by their names, or of many cycles as arrays (n,).

    Args:
        section: The section.
        point: Both coordinates on the section.
        time: The flight time [s].
        matrix: The derivative (2, 2) of the section's map.
        slopes: The derivatives of both coordinates and the flight time with respect to Omega,
            along the family.
        trivial: The multiplier of a flight along the flow, 1 but for rounding.
        flight: The section's event quantities and the integral of the ``divergence`` over the
            flight.
        ops: The functions of the arithmetic.
    """
    laps, choose = (
        section.flights_per_period,
        numpy.where if isinstance(time, numpy.ndarray) else _chosen,
    )
    (a, b), (c, d) = matrix
    trace, determinant = a + d, a * d - b * c
    # The larger root of l^2 - trace l + determinant. Mostly the determinant is some 1e-25 and
    # only corrects it. For a complex pair the value is the modulus, with the sign that the
    # larger root has where the two meet.
    discriminant = trace * trace / 4 - determinant
    real = abs(trace) / 2 + ops.sqrt(abs(discriminant))
    size = choose(discriminant >= 0, real, ops.sqrt(abs(determinant))) ** laps
    slow = size if laps == 2 else choose(trace >= 0, size, -size)
    # A multiplier that rounding has lost still gets a logarithm.
    log_slow = ops.log(choose(size == 0, _MIN_MULTIPLIER, size))
    log_multipliers = laps * flight["divergence"]
    first, second = section.coordinate_names
    return {
        "period": laps * time,
        first: point[0],
        second: point[1],
        **{quantity.name: flight[quantity.name] for quantity in section.event_quantities},
        "multiplier_slow": slow,
        "log_multiplier_slow": log_slow,
        # det of the flow over a period = slow * fast * 1 (trivial); Liouville gives its
        # logarithm.
        "log_multiplier_fast": log_multipliers - log_slow,
        "log_multipliers": log_multipliers,
        "trivial_multiplier_defect": abs((trivial * trivial if laps == 2 else trivial) - 1),
        "dperiod_domega": laps * slopes[2],
        f"d{first}_domega": slopes[0],
        f"d{second}_domega": slopes[1],
    }


def _chosen(condition: Any, value: Any, otherwise: Any) -> Any:
    return value if condition else otherwise
