"""Axes for sets of states: nearly orthogonal, the first along what is largest (Lohner's QR method).

Velocities are divided by the stiffness [1/s] of d(v')/dv before angles and lengths are measured. Any regular matrix of
points would do: floats are exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import arb

__all__ = ["axes_of_balls", "axes_of_lanes"]

Matrix = Sequence[Sequence[Any]]
Array = NDArray[np.float64]


def axes_of_balls(turned: Matrix, sizes: Sequence[float], stiffness: float) -> Matrix:
    """Axes (columns), orthogonal once velocities are divided by the stiffness. Points; any regular ones would do."""
    weights = (1.0, 1.0, 1 / stiffness)
    columns = [[float(row[k].mid()) * weight for row, weight in zip(turned, weights, strict=True)] for k in range(3)]
    order = sorted(range(3), key=lambda k: -math.hypot(*columns[k]) * sizes[k])
    basis: list[list[float]] = []
    for vector in (*(columns[k] for k in order), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
        length = math.hypot(*vector)
        for _ in range(2):  # once is not enough where columns are nearly parallel
            for axis in basis:
                share = sum(a * b for a, b in zip(axis, vector, strict=True))
                vector = [b - share * a for a, b in zip(axis, vector, strict=True)]
        left = math.hypot(*vector)
        if left > 1e-8 * length and len(basis) < 3:
            basis.append([part / left for part in vector])
    return [[arb(axis[row] / weights[row]) for axis in basis] for row in range(3)]


def axes_of_lanes(turned: Matrix, sizes: Sequence[Array], stiffness: Array) -> Matrix:
    """The same of every lane [1]."""
    weights = np.array([np.ones_like(stiffness), np.ones_like(stiffness), 1 / stiffness])
    with np.errstate(all="ignore"):
        columns = np.array([[entry.midpoints for entry in row] for row in turned]).swapaxes(0, 1) * weights
        lengths = np.sqrt((columns * columns).sum(1)) * np.array(sizes)
        ranked = np.take_along_axis(columns, np.argsort(-lengths, axis=0)[:, None], axis=0)
        first = _unit(ranked[0], np.array([1.0, 0.0, 0.0])[:, None])
        across = np.eye(3)[:, np.argmin(np.abs(first), axis=0)]  # far from parallel to the first
        second = _unit(_orthogonal(ranked[1], first), _unit(_orthogonal(across, first), across))
        axes = np.array([first, second, np.cross(first, second, axis=0)]).swapaxes(0, 1) / weights[:, None]
    return [[type(turned[0][0])(entry) for entry in row] for row in axes]


def _orthogonal(vector: Array, axis: Array) -> Array:
    """The unit vector's part across the unit axis; zero where they are nearly parallel."""
    left = _unit(vector, 0 * vector)
    for _ in range(2):
        left = left - (left * axis).sum(0) * axis
    return np.where(np.sqrt((left * left).sum(0)) > 1e-8, left, 0.0)


def _unit(vector: Array, otherwise: Array) -> Array:
    """The vector divided by its length; another where it has none."""
    length = np.sqrt((vector * vector).sum(0))
    return np.where(length > 0, vector / length, otherwise)
