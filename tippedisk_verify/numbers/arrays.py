"""Arrays of doubles, made from arrays and lists of numbers of any kind."""

from __future__ import annotations

from typing import Any

import numpy
from numpy.typing import NDArray

from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.exact import refuse_units_and_masks
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = [
    "Array",
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
