"""Arrays of doubles, and the equations of motion on them for solvers of other packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy
from numpy.typing import NDArray

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import refuse_units_and_masks
from tippedisk_verify.model.numpy_errors import ignore_numpy_errors_in_methods
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE

__all__ = [
    "Array",
    "ArrayFunction",
    "half_widths_in_doubles",
    "numpy_safe",
    "round_to_doubles",
    "to_double_array",
]

Array = NDArray[numpy.float64]


def round_to_doubles(values: Any) -> Array:
    """Round an array's numbers to doubles.

    heyoka's MPFR numbers are converted one by one: `astype` would leak 128 bytes for each.

    Args:
        values: An array of numbers of any kind.

    Returns:
        An array of the same shape.
    """
    if values.dtype != object:
        return values.astype(float, copy=False)  # type: ignore[no-any-return]
    return numpy.array([float(value) for value in values.flat]).reshape(values.shape)


def to_double_array(values: Any) -> Any:
    """Convert a number, an array or nested lists of numbers of any kind to an array of doubles.

    Args:
        values: A number, an array, or nested lists or tuples.

    Returns:
        An array of the same shape; a single number has no dimensions.

    Raises:
        InputError: If an entry is not a number, or the lists do not form an array.
    """
    if type(values) is numpy.ndarray and values.dtype.kind == "f":
        return values.astype(float, copy=False)
    refuse_units_and_masks(values)
    if not isinstance(values, list | tuple) and not getattr(values, "ndim", 0):
        return numpy.asarray(DOUBLE.number(values))
    try:
        return numpy.array([to_double_array(entry) for entry in values])
    except ValueError as fault:
        raise InputError(f"an array of numbers is needed: {fault}") from None


def half_widths_in_doubles(values: Any) -> Array:
    """Round half-widths to doubles, none of them down to zero.

    A positive half-width that would round to zero becomes the smallest positive double.

    Args:
        values: An array of half-widths of any kind.

    Returns:
        An array of the same shape.
    """
    rounded = round_to_doubles(values)
    return numpy.where((rounded == 0) & (values > 0), numpy.nextafter(0.0, 1.0), rounded)


def numpy_safe(values: Any) -> Any:
    """Convert an array that NumPy's functions cannot handle to an array of objects.

    Arrays of doubles or extended numbers and None are returned unchanged. Most functions of NumPy
    do not accept heyoka's arrays of quadruple numbers, and `numpy.save` corrupts them.

    Args:
        values: An array, or None.
    """
    return (
        values
        if values is None or values.dtype in (float, numpy.longdouble)
        else values.astype(object)
    )


@ignore_numpy_errors_in_methods
class ArrayFunction:
    """The vector field of a disk, or its Jacobian, as a function ``f(t, y)`` in doubles that can be
    pickled.

    ``y`` is a state (3,) or states (3, k): beta, gamma [rad] and v [rad/s].

    Args:
        build: `vector_field` or `jacobian`.
        parameters: The disk and its friction law.
        omega: The spinning speed [rad/s].

    Raises:
        InputError: If ``omega`` is not a speed, or ``y`` has another shape.
    """

    def __init__(self, build: Callable[..., Any], parameters: Parameters, omega: object) -> None:
        self._arguments, speed = (build, parameters, omega), DOUBLE.number(checked_speed(omega))
        self._function = build(numpy, parameters.constants_in(DOUBLE), speed, parameters.friction)

    def __call__(self, t: object, y: Any) -> Array:
        """Return the field (3,) or its Jacobian (3, 3) at a state (3,).

        For states (3, k) the shapes are (3, k) and (3, 3, k).

        Args:
            t: The time, which is not used.
            y: The state or states.

        Raises:
            InputError: If ``y`` does not have three rows, or has a unit or masked elements.
        """
        refuse_units_and_masks(y)
        try:
            beta, gamma, v = y
        except (TypeError, ValueError):
            raise InputError(
                "a state has three entries, beta, gamma and v, or three rows of them"
            ) from None
        return numpy.array(self._function(beta, gamma, v))

    def __reduce__(self) -> tuple[Any, ...]:
        return ArrayFunction, self._arguments
