"""Noninverted spinning: coordinates along its eigenvectors, the field in them, and flights from one saddle to the next.

The saddles are (0, -pi, 0) and (0, pi, 0) in shifted angles; the field is the same about both. y is the offset from
either, and y = P z with an exact regular matrix P whose columns lie near the eigenvectors: z = (z_u, z_s, z_f), along
the unstable, the slow and the fast stable direction. z' = F(z) = P^-1 f(P z) is the same system at every speed. F is
odd, and F(0) = 0 comes out exactly: sine and cosine of pi + y are taken from those of y.

Under the smooth friction law the saddles lie on gamma_y = 0, where the field is once differentiable. ``side`` names one
of the two analytic laws; over a box that gamma_y = 0 may cut, the derivatives are the hull of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from operator import mul
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_series

from tippedisk_verify.proofs.kernel.balls import BallOps, Unproved, ball, coefficient, need, positive, series_length
from tippedisk_verify.proofs.kernel.field import constants, field, sliding_motion
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lanes import Lanes
from tippedisk_verify.proofs.kernel.sliding import law_model

__all__ = ["FAST", "SLOW", "UNSTABLE", "Saddle", "ask", "cones", "hull_of_lanes", "most", "others", "products"]

UNSTABLE, SLOW, FAST = 0, 1, 2


def ask(what: str, *slacks: Any) -> None:
    """Raises Unproved unless all numbers of all balls are positive."""
    for slack in slacks:
        need(bool(positive(slack)), f"{what}: {slack.str(4)} is not shown to be positive")


def most(x: Any) -> Any:
    """A point no smaller than any |x| of the ball."""
    return x.abs_upper()


def others(matrix: Any, weights: Sequence[Any]) -> list[Any]:
    """For each row the sum of the other entries' sizes, weighted."""
    return [sum((abs(matrix[i, j]) * weights[j] for j in range(3) if j != i), arb(0)) for i in range(3)]


def cones(matrix: Any, weights: Sequence[Any], by_speed: Sequence[Any] = (0, 0, 0)) -> list[Any]:
    """What has to be positive for the cones of the weights.

    On a convex box that holds the saddle let ``matrix`` hold DF and ``by_speed`` the derivative of F by the speed. Two
    orbits at speeds w and w + D, D >= 0, differ by d; let U = |d_u| / k_u and S = max(|d_s| / k_s, |d_f| / k_f). As
    long as both are in the box: once U >= max(S, D) this stays so, and U grows exponentially; backwards in time, once
    S >= max(U, D) this stays so, and S grows exponentially.
    """
    rest = [(x + abs(b)) / k for x, b, k in zip(others(matrix, weights), by_speed, weights, strict=True)]
    return [matrix[0, 0] - rest[0], -matrix[1, 1] - rest[1], -matrix[2, 2] - rest[2]]


def hull_of_lanes(x: Lanes) -> Any:
    """A ball of Arb's that holds all lanes. A difference rounded to the nearest is moved outwards by one step."""
    if not x.is_finite().all():
        return arb.nan()
    low, high = np.nextafter(x.midpoints - x.radii, -np.inf).min(), np.nextafter(x.midpoints + x.radii, np.inf).max()
    return arb(float(low)).union(arb(float(high)))


def products(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    """x_i y_j - x_j y_i: us, uf, sf."""
    return [x[i] * y[j] - x[j] * y[i] for i, j in ((UNSTABLE, SLOW), (UNSTABLE, FAST), (SLOW, FAST))]


class _Beyond:
    """``ops`` of the equations for which one of the angles, gamma_bar, is pi + y: the angle itself is y."""

    def __init__(self, ops: Any, angle: Any) -> None:
        self._ops, self._angle = ops, angle

    def sin(self, angle: Any) -> Any:
        value = self._ops.sin(angle)
        return -value if angle is self._angle else value

    def cos(self, angle: Any) -> Any:
        value = self._ops.cos(angle)
        return -value if angle is self._angle else value


class Saddle:
    """The coordinates z and the field in them, for exact parameters and a ball of speeds.

    Raises Unproved if the directions have no inverse.
    """

    def __init__(self, disk: dict[str, str], friction: str, omega: Any, directions: Sequence[Sequence[Any]]) -> None:
        self.disk, self.friction, self.omega, self.directions = disk, friction, omega, arb_mat(directions)
        try:
            self.inverse = self.directions.inv()
        except ZeroDivisionError:
            raise Unproved("the directions at the saddle have no inverse") from None
        self.constants = constants(disk)

    def offset(self, z: Sequence[Any]) -> list[Any]:
        """y = P z."""
        return _times(self.directions, z)

    def coordinates(self, offset: Sequence[Any]) -> list[Any]:
        """z of an offset y."""
        return _times(self.inverse, offset)

    def arrived(self, state: Sequence[Any]) -> list[Any]:
        """z about the second saddle of (beta_bar, gamma_bar, v)."""
        return self.coordinates([state[0], state[1] - arb.pi(), state[2]])

    def law(self, side: int | None) -> Any:
        """F as `flow.Model` takes a law; the linear law has no sides."""

        def in_z(ops: Any, numbers: Any, omega: Any) -> Any:
            def rates(*z: Any) -> Any:
                beta, gamma, v = self.offset(z)
                of_y = field(_Beyond(ops, gamma), numbers, omega, self.friction if side is None else side)
                return self.coordinates(of_y(beta, gamma, v))

            return rates

        return in_z

    def rates(self, z: Sequence[Any], side: int | None = None) -> list[Any]:
        """F at balls or series of balls."""
        return list(self.law(side)(BallOps, self.constants, self.omega)(*z))

    @cached_property
    def _models(self) -> list[Model]:
        sides = (None,) if self.friction == "linear" else (1, -1)
        return [Model(self.constants, self.omega, self.law(side)) for side in sides]

    def field(self, z: Sequence[Any], side: int | None = None) -> tuple[list[Any], list[list[Any]], list[Any]]:
        """F, DF and the derivative B by the speed over a box of z.

        Of the smooth law without a ``side`` they are the hull of both sides'.
        """
        start = [*z, *(ball(int(row == column)) + 0 * z[0] for column in range(4) for row in range(3))]
        models = self._models if side is None or self.friction == "linear" else [self._models[0 if side > 0 else 1]]
        sets = [[series[1] for series in model.variational.coefficients(start, 1)] for model in models]
        both = [a.union(b) for a, b in zip(*sets, strict=True)] if len(sets) > 1 else sets[0]
        return both[:3], [both[3 + row : 12 : 3] for row in range(3)], both[12:]

    def sliding_slope(self, z: Sequence[Any], direction: Sequence[Any]) -> Any:
        """The derivative of gamma_y [m/s] along a direction, over a box of z."""
        with series_length(2):
            pairs = zip(self.offset(z), self.offset(direction), strict=True)
            beta, gamma, v = (arb_series([x, slope], prec=2) for x, slope in pairs)
            moved, _ = sliding_motion(_Beyond(BallOps, gamma), self.constants, self.omega, (beta, gamma, v))
            return coefficient(moved, 1)

    def path(self, z: Sequence[Any], proposer: Any) -> Path:
        """All orbits from a box of z about the first saddle, with their derivatives by z and by the speed."""
        beta, gamma, v = self.offset([x.mid() for x in z])
        start = [beta, gamma - arb.pi(), v]
        path = law_model(self.friction, self.constants, self.omega).path(start, proposer, derivatives=True)
        frame = path.frame = Frame([x.mid() for x in start], self.omega)
        directions = self.directions.tolist()
        frame.axes, frame.rest = directions, self.coordinates([x - x.mid() for x in start])
        frame.lead = [[*row, entries[3]] for row, entries in zip(directions, frame.lead, strict=True)]
        frame.deviation = [*(x - x.mid() for x in z), frame.deviation[3]]
        path.box = frame.box()
        return path

    def seen(self, frame: Frame, deviation: Sequence[Any] | None = None) -> list[Any]:
        """z about the second saddle of a set of states, each coordinate in one sum over the set's own axes.

        ``deviation``: of the states with these deviations alone.
        """
        lead, axes = map(self.columns, (frame.lead, frame.axes))
        d = frame.deviation if deviation is None else deviation
        return [
            middle + sum(map(mul, by_start, d)) + sum(map(mul, by_axes, frame.rest))
            for middle, by_start, by_axes in zip(self.arrived(frame.middle), lead, axes, strict=True)
        ]

    def columns(self, matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
        """P^-1 times a matrix."""
        return [list(row) for row in zip(*map(self.coordinates, zip(*matrix, strict=True)), strict=True)]


def _times(matrix: Any, vector: Sequence[Any]) -> list[Any]:
    return [matrix[row, 0] * vector[0] + matrix[row, 1] * vector[1] + matrix[row, 2] * vector[2] for row in range(3)]
