"""Boundary value problems with unknown parameters on [0, 1], by collocation at Gauss points; NumPy and SciPy only.

`scipy.integrate.solve_bvp` is of fourth order: some 3400 nodes give a cycle's speed to thirteen digits. It chooses the
mesh, and its tolerance is for residuals, so that it says nothing of the error of a parameter. Here order and mesh are
the caller's: with six Gauss points a few dozen intervals give the same digits, and three meshes of different order
give the error. SciPy's sparse LU solves the linear systems.

Every number comes with an error: the larger difference between the finest of three meshes and the two others, doubled.
The others have other numbers of Gauss points, and inputs moved by some units of rounding: the difference sees the
discretisation, the iteration, their rounding and that of the inputs, which are plain floats. An error common to all
meshes, as one in the equations would be, it does not see.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

Array = numpy.ndarray[Any, Any]
#: The rates of the states, the columns of an array, given the unknown parameters.
Field = Callable[[Array, Array], Array]
#: What must vanish, given the states at both ends and the unknown parameters.
Conditions = Callable[[Array, Array, Array], Array]


class Mesh(NamedTuple):
    """Equal intervals with so many Gauss points in each."""

    intervals: int
    points: int = 6

    def times(self) -> Array:
        """Where an interval begins and its Gauss points, for each interval, and the end."""
        inside = numpy.append(0, gauss_tableau(self.points)[0])
        return numpy.append((numpy.arange(self.intervals)[:, None] + inside).ravel(), self.intervals) / self.intervals


class Solution(NamedTuple):
    """Values on [0, 1], at the ends of the intervals and at the Gauss points between, and the unknown parameters."""

    times: Array
    values: Array
    unknowns: Array

    def at(self, times: Array) -> Array:
        """A spline through the values: to start another iteration from."""
        return CubicSpline(self.times, self.values, axis=1)(times)


@lru_cache
def gauss_tableau(points: int) -> tuple[Array, Array]:
    """Nodes of the Runge-Kutta method that collocates at Gauss points of [0, 1]; its matrix, with the weights below.

    By Legendre's polynomials: powers of the nodes would lose the digits that their inverse matrix amplifies.
    """
    nodes, weights = numpy.polynomial.legendre.leggauss(points)
    degrees = numpy.arange(points)
    values = numpy.polynomial.legendre.legvander(nodes, points)
    # (2 k + 1) times the integral of P_k from -1 is P_(k+1) - P_(k-1), with -1 for P_(-1).
    lower = numpy.hstack([numpy.full((points, 1), -1.0), values[:, : points - 1]])
    integrals = (values[:, 1:] - lower) / (2 * degrees + 1)
    # The Gauss weights make the Legendre polynomials orthogonal on the nodes.
    shares = (weights[:, None] * values[:, :points] * (2 * degrees + 1)).T / 2
    return (nodes + 1) / 2, numpy.vstack([integrals @ shares, weights]) / 2


def differences(function: Callable[..., Array], arguments: Sequence[Array], which: int, steps: Array) -> list[Array]:
    """Derivatives by each row of one argument, to some nine digits: enough for Newton's matrix, as residuals decide."""
    found = []
    for row, step in enumerate(steps):
        ends = []
        for sign in (1, -1):
            moved = [part.copy() for part in arguments]
            moved[which][row] += sign * step
            ends.append(function(*moved))
        found.append((ends[0] - ends[1]) / (2 * step))
    return found


class Layout:
    """Where the unknowns and equations of a mesh of equal intervals stand in the sparse system.

    An interval has its first state and the states at its Gauss points, then comes the last state, then the unknown
    parameters; the equations are those of each interval's Gauss points and end, then the conditions.
    """

    def __init__(self, size: int, count: int, mesh: Mesh) -> None:
        intervals, self.points = mesh
        self.times = mesh.times()
        self.tableau = gauss_tableau(mesh.points)[1] / intervals  # what multiplies the rates
        self.size, self.intervals = size, intervals
        rows = size * (self.points + 1)
        first = rows * numpy.arange(intervals)[:, None, None]
        inner, border = first + numpy.arange(rows)[:, None], rows * intervals + size + numpy.arange(count)
        outer = rows * intervals + numpy.arange(size + count)[:, None]
        self._places = [
            numpy.broadcast_arrays(inner, first + numpy.arange(rows + size)),
            numpy.broadcast_arrays(inner, border),
            *(
                numpy.broadcast_arrays(outer, columns)
                for columns in (numpy.arange(size), rows * intervals + numpy.arange(size), border)
            ),
        ]

    def system(self, *parts: Array) -> Any:
        """The sparse matrix of the derivatives, given in the order of `_places`."""
        rows, columns = (numpy.concatenate([place[k].ravel() for place in self._places]) for k in (0, 1))
        return coo_matrix((numpy.concatenate([part.ravel() for part in parts]), (rows, columns))).tocsc()

    def step(self, field: Field, conditions: Conditions, values: Array, unknowns: Array) -> tuple[Array, Array]:
        """Newton's step for the values and the unknown parameters."""
        size, intervals, points, tableau = self.size, self.intervals, self.points, self.tableau
        steps = 1e-6 * numpy.maximum(abs(values).max(axis=1), 1e-3)
        unknown_steps = 1e-5 * abs(unknowns) + 1e-12
        blocks = values[:, :-1].reshape(size, intervals, points + 1)
        starts, inside = blocks[:, :, :1], blocks[:, :, 1:]
        ends = values[:, points + 1 :: points + 1, None]
        slopes = numpy.einsum("ij,nkj->nki", tableau, field(inside, unknowns))
        residual = numpy.concatenate([inside, ends], axis=2) - starts - slopes
        edges = (values[:, 0], values[:, -1], unknowns)

        by_state = numpy.array(differences(field, (inside, unknowns), 0, steps))
        by_unknown = numpy.array(differences(field, (inside, unknowns), 1, unknown_steps))
        block = numpy.zeros((intervals, points + 1, size, points + 2, size))
        for k in range(points + 1):
            block[:, k, :, 0] -= numpy.eye(size)
            block[:, k, :, k + 1] += numpy.eye(size)
        block[:, :, :, 1:-1] -= numpy.einsum("ij,mnkj->kinjm", tableau, by_state)
        border = -numpy.einsum("ij,mnkj->kinm", tableau, by_unknown)
        outer = [
            numpy.array(differences(conditions, edges, which, each)).T
            for which, each in enumerate((steps, steps, unknown_steps))
        ]
        right = numpy.append(residual.transpose(1, 2, 0).ravel(), conditions(*edges))
        if not numpy.isfinite(right).all():
            raise ArithmeticError("the iteration left the states that exist: start closer")
        step = -splu(self.system(block, border, *outer)).solve(right)
        cut = values.size
        return step[:cut].reshape(values.shape[::-1]).T, step[cut:]


def solve(field: Field, conditions: Conditions, mesh: Mesh, guess: Solution) -> Solution:
    """Newton's method on the collocation equations, from a guess on any mesh.

    Raises ArithmeticError if it does not converge.
    """
    layout = Layout(len(guess.values), len(guess.unknowns), mesh)
    values, unknowns = guess.at(layout.times), guess.unknowns
    for _ in range(20):
        with numpy.errstate(all="ignore"):  # a wild step is told by its size
            step, unknown_step = layout.step(field, conditions, values, unknowns)
        values, unknowns = values + step, unknowns + unknown_step
        size = max(abs(step).max(), abs(unknown_step).max())
        if not size < 1e3:
            break
        # The next step would be smaller by the nine digits of the derivatives, if not by the square.
        if size < 1e-8:
            return Solution(layout.times, values, unknowns)
    raise ArithmeticError("the collocation equations were not solved: start closer")


class Number(NamedTuple):
    """A value and what it may be off by."""

    value: float
    error: float

    @classmethod
    def of(cls, value: Any, error: Any) -> Number:
        """Of NumPy's scalars."""
        return cls(float(value), float(error))


#: Inputs moved by four units of rounding, in two patterns; not at all on the finest mesh.
_MOVES = 2.0**-50 * numpy.array([[1, -1, 1, -1, 1, -1, 1, -1], [1, 1, -1, -1, -1, 1, 1, -1], 8 * [0]])


def estimated(
    solver: Callable[[Array, Mesh, Solution], Solution], inputs: Sequence[float], intervals: int, guess: Solution
) -> tuple[Solution, Array]:
    """The solution, and the errors of its unknown parameters followed by those of its state at 0.

    ``solver`` takes up to eight inputs, a mesh and a guess.
    """
    found = []
    meshes = (Mesh(intervals), Mesh(intervals * 5 // 4, 5), Mesh(intervals * 3 // 2, 7))
    for mesh, move in zip(meshes, _MOVES, strict=True):
        guess = solver(numpy.array(inputs) * (1 + move[: len(inputs)]), mesh, guess)
        found.append(numpy.append(guess.unknowns, guess.values[:, 0]))
    return guess, 2 * abs(numpy.array(found[:2]) - found[2]).max(axis=0)
