"""How fast states fall together onto the slow manifold: measured on short flights, against the closed form.

Two states that differ in v alone are drawn together like exp(-rate t); the closed form of the rate is the friction
term's derivative by v. For the linear law it does not depend on the sliding; the smooth law's is smaller the faster the
disk slides. Near lying flat the rate vanishes, and there is no slow manifold to fall onto.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.model.arrays import Array
from tippedisk_verify.model.equations import jacobian
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.theory.slow_manifold import critical_manifold

__all__ = ["Relaxation", "relaxation"]

_SHARE = 0.2  # of the time in which the distance falls by e


@dataclass(frozen=True)
class Relaxation:
    """Rates [1/s] on a grid of states at which neighbours in v fall together, positive where they do."""

    beta: Array  #: (rows, columns) [rad]
    gamma: Array  #: (rows, columns) [rad]
    measured: Array  #: (rows, columns), NaN where the flight did not end
    closed_form: Array  #: (rows, columns) -d(v')/d(v), the mean over the flight's two ends


def relaxation(
    parameters: Parameters,
    omega: Fraction,
    lanes: BatchTaylor,
    *,
    distance: float = 0.01,
    rows: int = 24,
    columns: int = 32,
    margin: float = 0.35,
) -> Relaxation:
    """From the critical manifold and ``distance`` [rad/s] above it, beta at least ``margin`` [rad] from lying flat."""
    constants, speed = parameters.at(DOUBLE), float(omega)
    beta, gamma = numpy.meshgrid(
        numpy.linspace(margin, math.pi - margin, rows),
        numpy.linspace(-math.pi / 2, 3 * math.pi / 2, columns),
        indexing="ij",
    )
    v = critical_manifold(numpy, constants, speed, beta, gamma)

    def rate(b: Any, g: Any, w: Any) -> Any:
        return -jacobian(numpy, constants, speed, parameters.friction)(b, g, w)[2][2]

    before = rate(beta, gamma, v + distance / 2)
    durations = numpy.tile((_SHARE / numpy.abs(before)).ravel(), 2)
    starts = [numpy.stack((beta.ravel(), gamma.ravel(), (v + up).ravel()), axis=1) for up in (0.0, distance)]
    flights = lanes(
        field_constants(parameters),
        numpy.full(2 * beta.size, speed),
        numpy.concatenate(starts),
        durations,
        friction=parameters.friction,
    )
    low, high = flights.states.T.reshape(3, 2, *beta.shape).transpose(1, 0, 2, 3)
    measured = -numpy.log(numpy.abs(high[2] - low[2]) / distance) / durations[: beta.size].reshape(beta.shape)
    after = rate(*((low + high) / 2))
    return Relaxation(beta, gamma, measured, (before + after) / 2)
