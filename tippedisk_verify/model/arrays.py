"""Arrays of doubles, and the equations of motion on them, for solvers of other packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy
from numpy.typing import NDArray

from tippedisk_verify.model.equations import checked_speed, field, jacobian
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE

__all__ = ["Array", "Jacobian", "RightHandSide"]

Array = NDArray[numpy.float64]


class RightHandSide:
    """The equations of motion as ``f(t, y)``; the time does not matter. It can be pickled."""

    made: Callable[..., Any] = staticmethod(field)

    def __init__(self, parameters: Parameters, omega: object) -> None:
        self._of = parameters, omega
        self._function = self.made(
            numpy, parameters.at(DOUBLE), DOUBLE.number(checked_speed(omega)), parameters.friction
        )

    def __call__(self, t: object, y: Any) -> Array:
        return numpy.array(self._function(*y))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._of


class Jacobian(RightHandSide):
    """Their derivative by the state."""

    made = staticmethod(jacobian)
