"""Matrices of balls and jets, and the axes along which `curve_flow` keeps what is left over.

Where a ball becomes a point or a float: axes are chosen, by midpoints, and any regular matrix is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.balls import arb
from tippedisk_verify.proofs.kernel.lanes import Lanes

__all__ = ["Matrix", "added", "applied", "floats", "fresh_axes", "largest", "left_over", "product"]

Matrix = Sequence[Sequence[Any]]


def product(a: Matrix, b: Matrix) -> Matrix:
    """Of the first three columns of ``a`` with three rows."""
    return [[row[0] * x + row[1] * y + row[2] * z for x, y, z in zip(*b, strict=True)] for row in a]


def applied(matrix: Matrix, vector: Sequence[Any]) -> list[Any]:
    return [sum(map(mul, row[1:], vector[1:]), row[0] * vector[0]) for row in matrix]


def added(a: Matrix, b: Matrix) -> Matrix:
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def left_over(balls_: Matrix, points: Matrix) -> Matrix:
    """Balls that hold, for all s, what jets differ from their midpoints by."""
    return [[(a - b).range() for a, b in zip(*rows, strict=True)] for rows in zip(balls_, points, strict=True)]


def fresh_axes(
    turned: Matrix, rest: Sequence[Any], spread: Matrix, stiffness: NDArray[np.float64]
) -> tuple[Matrix, Matrix]:
    """Axes (columns), orthogonal once velocities are divided by the stiffness, and balls that hold their inverse.

    The first is along what is largest of the ``turned`` columns, each times its coordinate's size (Lohner's method).
    """
    columns = np.moveaxis(np.array([[floats(entry) for entry in row] for row in turned]), -1, 0)
    columns[:, 2] /= stiffness[:, None]
    sizes = np.array([largest([part, *row]) for part, row in zip(rest, spread, strict=True)]).T
    order = np.argsort(-np.linalg.norm(columns, axis=1) * sizes, axis=1, kind="stable")
    usable = np.isfinite(columns).all(axis=(1, 2)) & (np.abs(columns) < 1e30).all(axis=(1, 2))
    columns = np.where(usable[:, None, None], np.take_along_axis(columns, order[:, None, :], axis=2), np.eye(3))
    basis = np.linalg.qr(columns)[0]
    basis[:, 2] *= stiffness[:, None]
    axes = [[_points(basis[:, i, k], turned[0][0]) for k in range(3)] for i in range(3)]
    # Cramer's rule.
    a, b, c = ([row[k] for row in axes] for k in range(3))
    minors = (_cross(b, c), _cross(c, a), _cross(a, b))
    determinant = a[0] * minors[0][0] + a[1] * minors[0][1] + a[2] * minors[0][2]
    return axes, [[part / determinant for part in minor] for minor in minors]


def _cross(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]


def floats(x: Any) -> NDArray[np.float64]:
    """The midpoints, one for each lane."""
    return x.midpoints.copy() if isinstance(x, Lanes) else np.array([float(x.mid())])


def largest(parts: Sequence[Any]) -> NDArray[np.float64]:
    """The largest absolute values, added up."""
    if isinstance(parts[0], Lanes):
        return np.asarray(np.sum([np.abs(part.midpoints) + part.radii for part in parts], axis=0))
    return np.array([sum(float(part.abs_upper()) for part in parts)])


def _points(values: NDArray[np.float64], like: Any) -> Any:
    return Lanes(values) if isinstance(like, Lanes) else arb(float(values[0]))
