"""Shooting over a whole period, as the paper does: the second road to the cycles of half-period shooting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy

from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Request, Status
from tippedisk_verify.model.equations import field, shifted
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE


def shoot_full_period(
    parameters: Parameters,
    omega: Any,
    state: Sequence[float],
    period: float,
    engine: Engine,
) -> tuple[tuple[float, float, float], float, tuple[float, ...]]:
    """The paper's own form, without the symmetry: periodicity residual r_p and anchor r_a = beta_bar_0, four unknowns.

    ``state`` is (beta_bar, gamma_bar, v); returns the state and period found and the residual of each step.
    Raises NoSuchCycleError as `shoot` does.
    """
    unknown = numpy.array([*map(float, state), float(period)])
    scale = abs(unknown[1]) + abs(unknown[2]) / 10
    iteration = NewtonIteration(
        25, NoSuchCycleError("full-period shooting has not converged"), small=1e-14 * scale, near=1e-11 * scale
    )
    rates = field(shifted(math), parameters.at(DOUBLE), DOUBLE.number(omega), parameters.friction)
    while True:
        start = unknown[:3]
        result = engine(
            Request(
                parameters,
                omega,
                start.tolist(),
                unknown[3],
                shifted=True,
                variations=("beta", "gamma", "v"),
                domain="none",
            )
        )
        if result.status is not Status.REACHED:
            raise NoSuchCycleError(f"the orbit could not be followed for a period: {result.status.value}")
        residual = numpy.array([*(result.state - start), unknown[0]])
        if iteration.converged(float(abs(residual[0]) + abs(residual[1]) + abs(residual[2]) / 10)):
            beta_bar, gamma_bar, v, period = unknown.tolist()
            return (beta_bar, gamma_bar, v), period, tuple(iteration.sizes)
        matrix = numpy.zeros((4, 4))
        matrix[:3, :3] = result.derivatives - numpy.eye(3)
        matrix[:3, 3] = rates(*result.state.tolist())
        matrix[3, 0] = 1.0
        unknown = unknown - numpy.linalg.solve(matrix, residual)
        if not numpy.isfinite(unknown).all() or unknown[3] <= 0:
            raise NoSuchCycleError("the shooting iteration left the finite numbers: start closer to the cycle")
        if abs(unknown[1]) + abs(unknown[2]) / 10 < scale / 5:
            raise NoSuchCycleError("the shooting iteration falls onto the equilibrium: start closer to the cycle")
