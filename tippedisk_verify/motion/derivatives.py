"""The derivatives of a motion by the parameters of the disk, from those by the field's constants.

The compiled field has the constants a = A / m, b = B / m - e^2, k = mu g / epsilon and mu g instead
of the parameters. The variational equations give the derivatives by these, and the chain rule the
rest, with exact rational factors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.flow.contract import STATE_VARIATIONS, Request, Result, Variation
from tippedisk_verify.flow.system import parameter_names
from tippedisk_verify.model.arrays import doubles, half_widths, workable
from tippedisk_verify.model.parameters import Parameters

__all__ = ["Derivative", "by_constants", "derivatives"]


_ROUNDED_UP = 1 + 2.0**-50  # more than the roundings of a half-width's products and sums


class Derivative(NamedTuple):
    """The derivative of a motion by one variable at fixed times, in SI units, with half-widths."""

    end: Any  #: (3,) of the end's beta, gamma [rad] and v [rad/s]
    end_uncertainty: Any  #: (3,)
    y: Any  #: (3, n) of the states, as in `Solution.y`
    uncertainty: Any  #: (3, n)


def by_constants(parameters: Parameters) -> dict[str, dict[Variation, Fraction]]:
    """Return the derivatives of the field's constants by each variable of a motion.

    The variables are the start's beta, gamma and v, omega, and the disk's parameters.

    Args:
        parameters: The disk and its friction law, which decides on the constants.
    """
    c, one = parameters.rational(), Fraction(1)
    start: dict[str, dict[Variation, Fraction]] = {name: {name: one} for name in STATE_VARIATIONS}
    table: dict[str, dict[Variation, Fraction]] = {
        **start,
        "omega": {"Omega": one},
        "r": {"r": one},
        "e": {"e": one, "b": -2 * c.e},
        "m": {"a": -c.a / c.m, "b": -c.B / c.m**2},
        "A": {"a": 1 / c.m},
        "B": {"b": 1 / c.m},
        "g": {"g": one, "k": c.mu / c.epsilon, "traction": c.mu},
        "mu": {"k": c.g / c.epsilon, "traction": c.g},
        "epsilon": {"epsilon": one, "k": -c.k / c.epsilon},
    }
    has = {*STATE_VARIATIONS, *parameter_names(parameters.friction)}
    return {
        variable: {name: slope for name, slope in row.items() if name in has}
        for variable, row in table.items()
    }


def derivatives(
    request: Request, result: Result, variables: Sequence[str]
) -> Mapping[str, Derivative]:
    """Return the derivatives of a motion by some variables, by name.

    Args:
        request: The run, whose variations are the constants needed.
        result: Its result.
        variables: The variables, as in `by_constants`.
    """
    if result.derivatives is None:
        return {}
    precision = result.precision or request.precision
    slopes, error = by_constants(request.parameters), result.error
    unit = float(precision.epsilon)

    def chained(row: Mapping[Variation, Fraction], values: Any, estimated: Any) -> tuple[Any, Any]:
        """Return the sum over the constants, and its half-widths, along the last axis."""
        widths = numpy.full(values.shape, numpy.inf) if estimated is None else estimated
        columns = [request.variations.index(name) for name in row]
        terms = [
            values[..., column] * precision.number(slope)
            for column, slope in zip(columns, row.values(), strict=True)
        ]
        width = sum(
            half_widths(widths[..., column]) * abs(float(slope)) * _ROUNDED_UP
            + (len(row) + 1) * unit * doubles(abs(term))
            for column, slope, term in zip(columns, row.values(), terms, strict=True)
        )
        return workable(sum(terms[1:], terms[0])), width

    found = {}
    for variable in variables:
        row = slopes[variable]
        end = chained(row, result.derivatives, error and error.variations)
        if result.sample_derivatives is None:
            y = tuple(numbers[:, None] for numbers in end)
        else:
            samples = chained(row, result.sample_derivatives, error and error.sample_variations)
            y = tuple(numbers.T for numbers in samples)
        found[variable] = Derivative(*end, *y)
    return found
