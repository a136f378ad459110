"""Omega_h to the digits that a cycle next to it needs."""

from __future__ import annotations

import math
from fractions import Fraction

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import MAX_DIGITS, splitting_zero
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import decimal_magnitude
from tippedisk_verify.numbers.measured import Measured

__all__ = ["DISTANCE_DIGITS", "FIRST_DIGITS", "omega_h_resolving", "rounded_up_digits"]

#: The digits of Omega_h for the first attempt.
FIRST_DIGITS = 27
_MORE_DIGITS = 10  # the steps by which they grow
_GUARD_DIGITS = 4
#: The digits of the distance from Omega_h with which no number shows the distance's uncertainty.
DISTANCE_DIGITS = 18


def omega_h_resolving(
    parameters: Parameters,
    speed_or_distance: Fraction,
    engine: Engine,
    *,
    from_omega_h: bool = False,
) -> Measured:
    """Compute Omega_h [rad/s] to the digits that a cycle at a given speed or distance needs.

    Args:
        parameters: The disk and its friction law.
        speed_or_distance: The cycle's speed, or its distance from Omega_h [rad/s].
        engine: The engine of the flights.
        from_omega_h: True if it is a distance.

    Raises:
        AccuracyError: If that takes more than `MAX_DIGITS` digits.
        NoConnectionError: If there is no connection.
    """
    guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
    wanted = _digits_for(speed_or_distance) if from_omega_h else FIRST_DIGITS
    while True:
        omega_h = splitting_zero(parameters, guess, engine, wanted).omega_h
        distance = speed_or_distance if from_omega_h else speed_or_distance - omega_h.value
        if omega_h.uncertainty * 10**DISTANCE_DIGITS < abs(distance):
            return omega_h
        # A speed may be Omega_h itself to many digits.
        resolved = abs(distance) > omega_h.uncertainty
        wanted = max(wanted + _MORE_DIGITS, _digits_for(distance)) if resolved else 2 * wanted
        if wanted > MAX_DIGITS:
            raise AccuracyError(
                "the distance from Omega_h needs more digits than Omega_h is offered to"
            )


def _digits_for(distance: Fraction) -> int:
    """Return the number of digits to which Omega_h must be computed for a cycle at a distance from
    it [rad/s].

    It is rounded up to a grid, so that most distances share Omega_h. The request omits
    `_GUARD_DIGITS`, because guard digits mostly make Omega_h better by as many.
    """
    return rounded_up_digits(DISTANCE_DIGITS - _GUARD_DIGITS - decimal_magnitude(distance))


def rounded_up_digits(wanted: int) -> int:
    """Round a number of digits of Omega_h up to a coarse grid, so that many distances share one
    computation.
    """
    return FIRST_DIGITS + _MORE_DIGITS * max(0, math.ceil((wanted - FIRST_DIGITS) / _MORE_DIGITS))
