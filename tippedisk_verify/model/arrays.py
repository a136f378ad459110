"""Arrays of doubles, and the equations of motion on them, for solvers of other packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy
from numpy.typing import NDArray

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import refuse_qualified
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.model.surroundings import undisturbed_methods

__all__ = ["Array", "OnArrays", "doubles", "half_widths", "numbers", "workable"]

Array = NDArray[numpy.float64]


def doubles(values: Any) -> Array:
    """An array's numbers rounded to doubles. (Of heyoka's MPFR numbers `astype` loses 128 bytes each.)"""
    if values.dtype != object:
        return values.astype(float, copy=False)  # type: ignore[no-any-return]
    return numpy.array([float(value) for value in values.flat]).reshape(values.shape)


def numbers(values: Any) -> Any:
    """Return numbers of any kind, one of them or an array or nested lists of them, in doubles.

    Raises InputError for what is no number, and for lists that are no array.
    """
    if type(values) is numpy.ndarray and values.dtype.kind == "f":
        return values.astype(float, copy=False)
    refuse_qualified(values)
    if not isinstance(values, list | tuple) and not getattr(values, "ndim", 0):
        return numpy.asarray(DOUBLE.number(values))
    try:
        return numpy.array([numbers(entry) for entry in values])
    except ValueError as fault:
        raise InputError(f"an array of numbers is needed: {fault}") from None


def half_widths(values: Any) -> Array:
    """Half-widths in doubles: the least double stands for what no double is small enough for."""
    rounded = doubles(values)
    return numpy.where((rounded == 0) & (values > 0), numpy.nextafter(0.0, 1.0), rounded)


def workable(values: Any) -> Any:
    """Doubles and extended numbers as they are, all others as objects.

    NumPy refuses most of its functions to heyoka's own arrays of quadruple numbers, and `numpy.save` spoils them.
    """
    return values if values is None or values.dtype in (float, numpy.longdouble) else values.astype(object)


@undisturbed_methods
class OnArrays:
    """`field` or `jacobian` as ``f(t, y)`` of a state (3,) or of states (3, k) in doubles. It can be pickled."""

    def __init__(self, made: Callable[..., Any], parameters: Parameters, omega: object) -> None:
        self._of, speed = (made, parameters, omega), DOUBLE.number(checked_speed(omega))
        self._function = made(numpy, parameters.at(DOUBLE), speed, parameters.friction)

    def __call__(self, t: object, y: Any) -> Array:
        refuse_qualified(y)
        try:
            beta, gamma, v = y
        except (TypeError, ValueError):
            raise InputError("a state has three entries, beta, gamma and v, or three rows of them") from None
        return numpy.array(self._function(beta, gamma, v))

    def __reduce__(self) -> tuple[Any, ...]:
        return OnArrays, self._of
