"""Orbits near noninverted spinning in floating point, with variations: for enclosures to be
held against.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tippedisk_verify import DOUBLE, PRINTED, Parameters
from tippedisk_verify.model.equations import jacobian, shifted_ops, vector_field
from tippedisk_verify.proofs.kernel.balls import working_precision
from tippedisk_verify.proofs.search.connection_proof import eigenvectors
from tippedisk_verify.proofs.search.proof_search import parameter_texts

OMEGA_H = Fraction("30.0488682607225")  # of `printed`, to its last digit
# Of a step, relative and absolute: a hundred roundings
TOLERANCE = 100 * np.finfo(float).eps


DISK = parameter_texts(PRINTED)
with working_precision(64):
    DIRECTIONS: list[list[Any]] = eigenvectors(PRINTED, OMEGA_H)[1].tolist()


class Orbits:
    """The flow about the saddle (0, pi, 0) in z, by SciPy's Runge-Kutta method of order 8."""

    def __init__(
        self, parameters: Parameters, directions: Sequence[Sequence[Any]], omega: float
    ) -> None:
        constants = parameters.constants_in(DOUBLE)
        self.rate, self.slope = (
            f(shifted_ops(math), constants, omega, "linear") for f in (vector_field, jacobian)
        )
        self.to_y = np.array([[float(entry) for entry in row] for row in directions])
        self.to_z = np.linalg.inv(self.to_y)

    def F(self, z: np.ndarray) -> np.ndarray:
        return self.to_z @ np.array(self.rate(*self._state(z)))

    def DF(self, z: np.ndarray) -> np.ndarray:
        return self.to_z @ np.array(self.slope(*self._state(z))) @ self.to_y

    def _state(self, z: np.ndarray) -> np.ndarray:
        return self.to_y @ z + np.array([0, math.pi, 0])

    def fly(
        self,
        z: Sequence[float],
        variation: Sequence[float],
        until: Callable[[np.ndarray], float],
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Return (time, z, variation) where ``until`` of z first rises through zero."""

        def rates(time: float, x: np.ndarray) -> np.ndarray:
            return np.concatenate([self.F(x[:3]), self.DF(x[:3]) @ x[3:]])

        def event(time: float, x: np.ndarray) -> float:
            return until(x[:3])

        event.terminal, event.direction = True, 1
        start = np.array([*z, *variation], float)
        run = solve_ivp(
            rates, (0, 3), start, "DOP853", events=event, rtol=TOLERANCE, atol=TOLERANCE
        )
        (end,) = run.y_events[0]
        return run.t[-1], end[:3], end[3:]
