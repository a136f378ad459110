"""Orbits near noninverted spinning in floating point, with variations: for enclosures to be
held against.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.parameters import PRINTED, Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.proofs.kernel.balls import working_precision
from tippedisk_verify.proofs.search.certificate import parameter_texts
from tippedisk_verify.proofs.search.connection import eigenvectors

OMEGA_H = Fraction("30.0488682607225")  # of `printed`, to its last digit
# S: with |lambda_f| = 102 / s the method's error is (0.05)^5 / 120 = 3e-9 of z_f in a step, less
# elsewhere
STEP = 5e-4


DISK = parameter_texts(PRINTED)
with working_precision(64):
    DIRECTIONS: list[list[Any]] = eigenvectors(PRINTED, OMEGA_H)[1].tolist()


class Orbits:
    """The flow about the saddle (0, pi, 0), by the classical Runge-Kutta method, in z."""

    def __init__(
        self, parameters: Parameters, directions: Sequence[Sequence[Any]], omega: float
    ) -> None:
        constants = parameters.at(DOUBLE)
        self.rate, self.slope = (
            f(shifted(math), constants, omega, "linear") for f in (field, jacobian)
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
        until: Callable[[np.ndarray], bool],
        longest: float = 3.0,
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """(time, z, variation) at the first step's end at which ``until`` is true."""
        x = np.array([z, variation], float)
        time = 0.0
        while not until(x[0]) and time < longest:
            k1 = self._both(x)
            k2 = self._both(x + STEP / 2 * k1)
            k3 = self._both(x + STEP / 2 * k2)
            x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + self._both(x + STEP * k3))
            time += STEP
        return time, x[0], x[1]

    def _both(self, x: np.ndarray) -> np.ndarray:
        return np.array([self.F(x[0]), self.DF(x[0]) @ x[1]])
