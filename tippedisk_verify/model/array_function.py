"""The equations of motion on arrays of doubles, for solvers of other packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.arrays import Array
from tippedisk_verify.numbers.exact import refuse_units_and_masks
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors_in_methods
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = ["ArrayFunction"]


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
