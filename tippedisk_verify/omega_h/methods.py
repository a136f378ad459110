"""Omega_h, the speed of the heteroclinic connection, by four methods.

- *manifolds* finds the zero of the splitting between the unstable and the stable manifold, to any
  number of digits.
- *limit-cycles* follows the limit cycles to infinite period. It shares only the integrator with
  *manifolds*.
- *bisection* looks at the side that the unstable manifold takes, in double.
- *scipy* does the same with another integrator.
"""

from __future__ import annotations

from typing import get_args

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.connection.splitting import (
    MAX_DIGITS,
    omega_h_without_half_width,
    splitting_zero,
)
from tippedisk_verify.cycles.near_omega_h.period_continuation import limit_of_cycles
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.flow.scipy_engine import ScipyEngine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import is_one_of, short_text
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import DOUBLE_DIGITS, checked_digits
from tippedisk_verify.omega_h.connecting_orbit import (
    ConnectionMethod,
    Heteroclinic,
    heteroclinic_at,
)

__all__ = ["OMEGA_H_METHODS", "heteroclinic"]

#: The names of the methods.
OMEGA_H_METHODS: tuple[ConnectionMethod, ...] = get_args(ConnectionMethod)


@ignore_numpy_errors()
def heteroclinic(
    parameters: Parameters,
    engine: Engine,
    *,
    digits: int = 12,
    method: str = "manifolds",
    half_widths: bool = True,
) -> Heteroclinic:
    """Return the heteroclinic connection, with its speed Omega_h to ``digits`` significant digits.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        digits: The significant digits of Omega_h.
        method: One of `OMEGA_H_METHODS`.
        half_widths: If False, the method manifolds does not measure its error by a wider run.

    Raises:
        InputError: If the method is unknown, or cannot give that many digits.
        NoConnectionError: If there is no connection.
        AccuracyError: If the digits are not reached.
    """
    if not is_one_of(method, OMEGA_H_METHODS):
        raise InputError(
            f"method '{short_text(method)}' is not known: use {', '.join(OMEGA_H_METHODS)}"
        )
    digits, zero = checked_digits(digits), None
    if method in ("bisection", "scipy") and digits > DOUBLE_DIGITS:
        raise InputError(
            f"{method} runs in double: at most {DOUBLE_DIGITS} digits, not {digits}; use manifolds"
        )
    if digits > MAX_DIGITS:
        raise InputError(
            f"Omega_h is offered to {MAX_DIGITS} digits, not {digits}: more would take days"
        )
    if method == "manifolds":
        guess = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
        if half_widths:
            zero = splitting_zero(parameters, guess, engine, digits)
        omega_h = (
            zero.omega_h if zero else omega_h_without_half_width(parameters, guess, engine, digits)
        )
    elif method == "limit-cycles":
        omega_h = limit_of_cycles(parameters, engine, digits)
    else:
        omega_h = bisect_omega_h(
            parameters, ScipyEngine("DOP853") if method == "scipy" else engine
        ).omega_h
    return heteroclinic_at(parameters, omega_h, digits, method=method, engine=engine, zero=zero)
