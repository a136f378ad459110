"""Products, sums and inverses of small matrices, whose entries belong to any of the kernel's
arithmetics.

A matrix is a sequence of rows. Entries are balls, arrays of balls, jets, or nodes of a graph, so
that the results enclose those of all points in the operands. Only `midpoint_inverse` takes
midpoints, and it encloses nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul
from typing import Any

__all__ = [
    "Matrix",
    "inverse_of_order_2",
    "inverse_of_order_3",
    "matrix_product",
    "matrix_sum",
    "matrix_times_vector",
    "midpoint_inverse",
]

Matrix = Sequence[Sequence[Any]]


def matrix_product(a: Matrix, b: Matrix) -> list[list[Any]]:
    """Return the product of the first three columns of ``a`` with a matrix ``b`` of three rows."""
    return [[row[0] * x + row[1] * y + row[2] * z for x, y, z in zip(*b, strict=True)] for row in a]


def matrix_times_vector(matrix: Matrix, vector: Sequence[Any]) -> list[Any]:
    return [sum(map(mul, row[1:], vector[1:]), row[0] * vector[0]) for row in matrix]


def matrix_sum(a: Matrix, b: Matrix) -> Matrix:
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def inverse_of_order_2(matrix: Matrix) -> list[list[Any]]:
    """Return the inverse of a (2, 2) matrix, by Cramer's rule."""
    (a, b), (c, d) = matrix
    determinant = a * d - b * c
    return [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]


def inverse_of_order_3(matrix: Matrix) -> list[list[Any]]:
    """Return the inverse of a (3, 3) matrix, by Cramer's rule."""
    a, b, c = matrix
    minors = (_cross_product(b, c), _cross_product(c, a), _cross_product(a, b))
    determinant = sum(x * y for x, y in zip(a, minors[0], strict=True))
    return [[minors[k][row] / determinant for k in range(3)] for row in range(3)]


def midpoint_inverse(matrix: Matrix) -> list[list[Any]]:
    """Return the inverse of a (2, 2) matrix of jets or balls, computed from their midpoints, as
    points.

    It approximates the inverse and encloses nothing.
    """
    middle = inverse_of_order_2([[entry.mid() for entry in row] for row in matrix])
    return [[entry.mid() for entry in row] for row in middle]


def _cross_product(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
