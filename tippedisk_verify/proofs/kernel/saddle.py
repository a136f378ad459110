"""Noninverted spinning: coordinates along its eigenvectors, the field in them, and invariant
curves.

Coordinates
-----------
The saddles are (0, -pi, 0) and (0, pi, 0) in shifted angles; the field is the same about both. Let
y be the offset from either, and y = P z with an exact regular matrix P whose columns lie near the
eigenvectors. Then z = (z_u, z_s, z_f) are coordinates along the unstable, the slow stable and the
fast stable direction, and at every speed

    z' = F(z) = P^-1 f(P z).

F is odd. F(0) = 0 is exact: sine and cosine of pi + y are computed from those of y.

Under the smooth friction law the saddles lie on gamma_y = 0, where the field is once
differentiable. A ``side`` names one of the two analytic laws. Over a box that gamma_y = 0 may cut,
the derivatives are the hull of both.

Invariant curves
----------------
A `ManifoldGraph` is a graph over one of the coordinates, called theta. The offsets of the other two
from its polynomials W are w = z - W(theta). Then

    w' = D(theta) + J w,
    D = F_w(theta, W) - W' F_theta(theta, W),     J = dF_w/dw - W' dF_theta/dw,

with D the *defect* and J taken somewhere between the curve and the point (mean value theorem). D
vanishes at 0, and |D| <= d |theta| with a d that is enclosed here. For this the Taylor coefficients
to the order N of W are enclosed at 0, and coefficient N + 1 (Lagrange's remainder) over the whole
interval. W is chosen freely: the defect measures its quality.

Unstable manifold (6.1)
-----------------------
Let theta = z_u. Suppose that on the cone |w_i| <= k_i theta, 0 < theta <= theta_0,

    k_i (g - J_ii) > |J_ij| k_j + d_i   and   g > 0,     with g theta a lower bound of theta'.

Then orbits cross the cone's sides inwards only, and theta grows. The linear flow maps the linear
cone into its interior, which by Krein and Rutman's theorem then holds the leading eigenvector. So
the branch of the unstable manifold with theta > 0 starts inside the cone and leaves it at theta_0.
Its point there has |w_i| <= k_i theta_0 (`verify_unstable_cone`).

Isolating block (6.3)
---------------------
Let theta = z_s and N = {|z_s| <= s, |w_u| <= u, |w_f| <= t}. Suppose that z_s and w_f point inwards
on their faces, and that w_u' has the sign of w_u for delta <= |w_u| <= u. Then an orbit in N with
w_u > delta leaves N through w_u = u, one with w_u < -delta through w_u = -u. No orbit leaves
anywhere else (`verify_isolating_block`).

The smooth friction law (6.5)
-----------------------------
The field of this law is odd, continuously differentiable, and analytic on either side of the
surface gamma_y = 0, which passes through the saddle. The halves of each curve leave the saddle on
opposite sides. W is the series of one side's law, for theta > 0, with even powers too. The mean
value theorem gives the sign of gamma_y on the curve, or all over the cone about it. For gamma_y is
zero at the saddle, and its derivative along z / theta is enclosed.

- In the cone of the unstable manifold the side's law is the smooth one, so the argument above is
  about an analytic field.
- The block holds both halves of the slow stable curve. The graph over theta < 0 is -W(-theta), as
  the field is odd, so D is odd and bounded as above. J and the faces, like the cones, need mean
  values only.

Source: P. Zgliczyński, Covering relations, cone conditions and the stable manifold theorem,
J. Differential Equations 246 (2009); Ważewski's principle for the block.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce
from operator import mul
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_series

from tippedisk_verify.proofs.kernel.ball_array import BallArray
from tippedisk_verify.proofs.kernel.balls import (
    BallOps,
    Unproved,
    ball,
    coefficient,
    positive,
    require,
    series_length,
)
from tippedisk_verify.proofs.kernel.certificate_format import FRICTION_LAWS
from tippedisk_verify.proofs.kernel.doubleton import Doubleton
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField, EnclosedFlight
from tippedisk_verify.proofs.kernel.sliding import field_for_friction
from tippedisk_verify.proofs.kernel.small_matrices import matrix_times_vector
from tippedisk_verify.proofs.kernel.step import evaluate_polynomial
from tippedisk_verify.proofs.kernel.vector_field import (
    field_constants,
    sliding_motion,
    vector_field,
)

__all__ = [
    "FAST",
    "SLOW",
    "UNSTABLE",
    "ManifoldGraph",
    "SaddleCoordinates",
    "columnwise_hull",
    "cone_conditions",
    "hull_of_ball_array",
    "magnitude_bound",
    "off_diagonal_sums",
    "require_positive",
    "verify_isolating_block",
    "verify_unstable_cone",
    "wedge_product",
]

UNSTABLE, SLOW, FAST = 0, 1, 2


def require_positive(statement: str, *slacks: Any) -> None:
    """Raise Unproved unless all numbers in the given balls are positive.

    ``slacks`` are the balls. The message is ``statement`` with the ball that fails. ``statement``
    begins with the number of the part of the proof in docs/certified_connection.md.
    """
    for slack in slacks:
        require(bool(positive(slack)), f"{statement}: {slack.str(4)} is not shown to be positive")


def magnitude_bound(x: Any) -> Any:
    """Return an upper bound of |x| over the ball x, as a ball without width."""
    return x.abs_upper()


def off_diagonal_sums(matrix: Any, weights: Sequence[Any]) -> list[Any]:
    """Return, for each row i of a 3 x 3 matrix, the sum of |matrix_ij| weights_j over j != i."""
    return [
        sum((abs(matrix[i, j]) * weights[j] for j in range(3) if j != i), arb(0)) for i in range(3)
    ]


def cone_conditions(
    matrix: Any, weights: Sequence[Any], by_speed: Sequence[Any] = (0, 0, 0)
) -> list[Any]:
    """Return three balls. If all of them are positive, differences of orbits obey the cone
    conditions.

    Let F be the field in the coordinates (u, s, f) along the unstable, slow and fast direction.
    On a convex box about the saddle, ``matrix`` encloses DF and ``by_speed`` the derivative of F
    with respect to the speed. The ``weights`` are k_u, k_s, k_f. Let two orbits at speeds w and
    w + D, D >= 0, differ by d. Let U = |d_u| / k_u and S = max(|d_s| / k_s, |d_f| / k_f). As long
    as both orbits are in the box:

    - Once U >= max(S, D), this stays so, and U grows exponentially.
    - Backwards in time, once S >= max(U, D), this stays so, and S grows exponentially.
    """
    rest = [
        (x + abs(b)) / k
        for x, b, k in zip(off_diagonal_sums(matrix, weights), by_speed, weights, strict=True)
    ]
    return [matrix[0, 0] - rest[0], -matrix[1, 1] - rest[1], -matrix[2, 2] - rest[2]]


def hull_of_ball_array(x: BallArray) -> Any:
    """Return one of Arb's balls that contains all balls of an array.

    The ends of the balls, rounded sums in doubles, are moved outwards by one ulp. Returns NaN if a
    ball is infinite.
    """
    if not x.is_finite().all():
        return arb.nan()
    low, high = (
        np.nextafter(x.midpoints - x.radii, -np.inf).min(),
        np.nextafter(x.midpoints + x.radii, np.inf).max(),
    )
    return arb(float(low)).union(arb(float(high)))


def columnwise_hull(rows: Sequence[Sequence[Any]]) -> list[Any]:
    """Return, for each column of Arb's balls, a ball that contains all balls of the column."""
    return [reduce(arb.union, column) for column in zip(*rows, strict=True)]


def wedge_product(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    """Return the list of x_i y_j - x_j y_i for the pairs (i, j) = us, uf, sf of coordinates.

    u, s and f are the components along the unstable, slow stable and fast stable direction.
    """
    return [
        x[i] * y[j] - x[j] * y[i] for i, j in ((UNSTABLE, SLOW), (UNSTABLE, FAST), (SLOW, FAST))
    ]


class _ShiftedAngleOps:
    """The sine and cosine for the equations of motion about the saddle, where gamma_bar = pi + y.

    The object ``angle`` stands for y: its sine and cosine change their sign. Other angles are
    unaffected.
    """

    def __init__(self, ops: Any, angle: Any) -> None:
        self._ops, self._angle = ops, angle

    def sin(self, angle: Any) -> Any:
        value = self._ops.sin(angle)
        return -value if angle is self._angle else value

    def cos(self, angle: Any) -> Any:
        value = self._ops.cos(angle)
        return -value if angle is self._angle else value


class SaddleCoordinates:
    """The coordinates z about a saddle, z = P^-1 (offset from the saddle), and the field in them.

    The disk's parameters are exact, and the speeds are those of a ball. Raises Unproved if the
    matrix P of directions has no inverse.
    """

    def __init__(
        self, disk: dict[str, str], friction: str, omega: Any, directions: Sequence[Sequence[Any]]
    ) -> None:
        self.disk, self.friction, self.omega, self.directions = (
            disk,
            friction,
            omega,
            arb_mat(directions),
        )
        try:
            self.inverse = self.directions.inv()
        except ZeroDivisionError:
            raise Unproved("the directions at the saddle have no inverse") from None
        self.constants = field_constants(disk)

    def offset(self, z: Sequence[Any]) -> list[Any]:
        """Convert coordinates z about the saddle to the offset y = P z in (beta_bar,
        gamma_bar, v).
        """
        return matrix_times_vector(self.directions.tolist(), z)

    def coordinates(self, offset: Sequence[Any]) -> list[Any]:
        """Convert an ``offset`` y from the saddle, in (beta_bar, gamma_bar, v), to coordinates z =
        P^-1 y.
        """
        return matrix_times_vector(self.inverse.tolist(), offset)

    def second_saddle_coordinates(self, state: Sequence[Any]) -> list[Any]:
        """Convert a state (beta_bar, gamma_bar, v) to the coordinates z about the second saddle."""
        return self.coordinates([state[0], state[1] - arb.pi(), state[2]])

    def vector_field_maker(self, side: int | None) -> Any:
        """Return the field F in the coordinates z, as the ``make_vector_field`` that
        `proved_flow.EnclosedField` expects.

        ``side`` is the sign of gamma_y (1 or -1) whose analytic law is meant; None is the law
        itself.
        """

        def in_z(ops: Any, numbers: Any, omega: Any) -> Any:
            def rates(*z: Any) -> Any:
                beta, gamma, v = self.offset(z)
                of_y = vector_field(
                    _ShiftedAngleOps(ops, gamma),
                    numbers,
                    omega,
                    self.friction if side is None else side,
                )
                return self.coordinates(of_y(beta, gamma, v))

            return rates

        return in_z

    def rates(self, z: Sequence[Any], side: int | None = None) -> list[Any]:
        """Return the rates z' = F(z) of the coordinates about the saddle, for balls or series of
        balls z.

        ``side`` is the sign of gamma_y whose analytic law is meant; None is the law itself.
        """
        return list(self.vector_field_maker(side)(BallOps, self.constants, self.omega)(*z))

    @property
    def two_sided(self) -> bool:
        """True if the friction law has two analytic sides."""
        return FRICTION_LAWS[self.friction].two_sided

    @cached_property
    def _fields(self) -> dict[int | None, EnclosedField]:
        sides = (1, -1) if self.two_sided else (None,)
        return {
            side: EnclosedField(self.constants, self.omega, self.vector_field_maker(side))
            for side in sides
        }

    def rates_and_derivatives(
        self, z: Sequence[Any], side: int | None = None
    ) -> tuple[list[Any], list[list[Any]], list[Any]]:
        """Enclose the field F, its derivative DF and its derivative B by the speed over a box of z.

        Returns a list of three balls, three rows of three, and three again. Under the smooth law
        they belong to the law of a ``side`` (1 or -1), or are the hull of both if it is None.
        """
        start = [
            *z,
            *(ball(int(row == column)) + 0 * z[0] for column in range(4) for row in range(3)),
        ]
        sets = [
            [series[1] for series in field.variational_system.coefficients(start, 1)]
            for own, field in self._fields.items()
            if own is None or side in (None, own)
        ]
        derivatives = columnwise_hull(sets)
        return (
            derivatives[:3],
            [derivatives[3 + row : 12 : 3] for row in range(3)],
            derivatives[12:],
        )

    def sliding_slope(self, z: Sequence[Any], direction: Sequence[Any]) -> Any:
        """Return the derivative of the sliding velocity gamma_y [m/s] along a direction, over a box
        of z.
        """
        with series_length(2):
            pairs = zip(self.offset(z), self.offset(direction), strict=True)
            beta, gamma, v = (arb_series([x, slope], prec=2) for x, slope in pairs)
            moved, _ = sliding_motion(
                _ShiftedAngleOps(BallOps, gamma), self.constants, self.omega, (beta, gamma, v)
            )
            return coefficient(moved, 1)

    def flight(self, z: Sequence[Any], proposer: Any) -> EnclosedFlight:
        """Return the proved flight, before its first step, of all orbits from a box of z
        about the first saddle.

        ``proposer`` chooses its steps. The flight also carries the derivatives with respect to the
        coordinates z at the start and the speed.
        """
        beta, gamma, v = self.offset([x.mid() for x in z])
        start = [beta, gamma - arb.pi(), v]
        flight = field_for_friction(self.friction, self.constants, self.omega).flight(
            start, proposer, derivatives=True
        )
        state_set = flight.state_set = Doubleton([x.mid() for x in start], self.omega)
        directions = self.directions.tolist()
        state_set.axes, state_set.remainder = (
            directions,
            self.coordinates([x - x.mid() for x in start]),
        )
        state_set.linear_part = [
            [*row, entries[3]]
            for row, entries in zip(directions, state_set.linear_part, strict=True)
        ]
        state_set.deviation = [*(x - x.mid() for x in z), state_set.deviation[3]]
        flight.box = state_set.box()
        return flight

    def enclosed_coordinates(
        self, state_set: Doubleton, deviation: Sequence[Any] | None = None
    ) -> list[Any]:
        """Return a box of coordinates z about the second saddle that encloses the states of a set
        ``state_set``.

        It is summed over the set's own axes, which keeps it narrow. With ``deviation``, a vector in
        the start and the speed, only the states of these deviations are enclosed.
        """
        lead, axes = map(self.columns_in_coordinates, (state_set.linear_part, state_set.axes))
        d = state_set.deviation if deviation is None else deviation
        return [
            middle + sum(map(mul, by_start, d)) + sum(map(mul, by_axes, state_set.remainder))
            for middle, by_start, by_axes in zip(
                self.second_saddle_coordinates(state_set.middle), lead, axes, strict=True
            )
        ]

    def columns_in_coordinates(self, matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
        """Convert the columns of a matrix, offsets from the saddle, to coordinates z. Return P^-1
        times the matrix.
        """
        return [
            list(row) for row in zip(*map(self.coordinates, zip(*matrix, strict=True)), strict=True)
        ]


class ManifoldGraph:
    """A polynomial curve near an invariant manifold: two coordinates as functions of the third.

    theta is the coordinate with the index ``along``, and W(theta) gives the other two. ``graph``
    contains the exact coefficients of theta^0 ... theta^N for each of them, the first one 0.
    ``side`` is the sign of gamma_y on the half with theta > 0, None for the linear law.
    """

    def __init__(
        self, saddle: SaddleCoordinates, along: int, graph: Sequence[list[Any]], side: int | None
    ) -> None:
        self.saddle, self.along, self.graph, self.side = saddle, along, graph, side
        self.others = tuple(k for k in range(3) if k != along)
        self.order = len(graph[0]) - 1
        #: The polynomials give W for theta > 0; for theta < 0 the graph is -W(-theta)
        self.mirrored = side is not None and along == SLOW
        require(
            len({len(row) for row in graph}) == 1 and self.order > 0,
            "a curve's polynomials have unlike degrees, or 0",
        )
        require(all(bool(row[0] == 0) for row in graph), "a curve does not pass the saddle")

    def values(self, theta: Any) -> list[Any]:
        """Return W(theta): the other two coordinates of the curve's point with the coordinate
        theta.

        theta is a number, a ball or a series.
        """
        if not self.mirrored or isinstance(theta, arb_series) or theta > 0:
            return [evaluate_polynomial(row, theta) for row in self.graph]
        values = [evaluate_polynomial(row, abs(theta)) for row in self.graph]
        return [-x if theta < 0 else x.union(-x) for x in values]

    def slopes(self, theta: Any) -> list[Any]:
        """Return the derivatives W'(theta) of the curve's two polynomials at a number, ball or
        series.
        """
        if self.mirrored and not isinstance(theta, arb_series):
            theta = abs(theta)
        return [
            evaluate_polynomial([n * value for n, value in enumerate(row)][1:], theta)
            for row in self.graph
        ]

    def point(self, theta: Any, w: Sequence[Any] = (0, 0)) -> list[Any]:
        """Return the point z = (theta, W(theta) + w) at an offset w from the curve.

        Its components are in the order u, s, f: unstable, slow stable and fast stable direction.
        """
        z = [theta] * 3
        for other, value, off in zip(self.others, self.values(theta), w, strict=True):
            z[other] = value + off
        return z

    def offset_from_curve(self, z: Sequence[Any]) -> list[Any]:
        """Return the offset w of a point z from the curve, in the two coordinates other
        than theta.
        """
        return [
            z[other] - value
            for other, value in zip(self.others, self.values(z[self.along]), strict=True)
        ]

    def transverse_jacobian(self, matrix: Any, theta: Any) -> list[list[Any]]:
        """Return the 2 x 2 matrix J by which the offset w of an orbit from the curve moves: w' = D
        + J w.

        D is the curve's defect of invariance. ``matrix`` encloses the derivative DF of the field,
        and ``theta`` is a ball.
        """
        return [
            [matrix[row, column] - slope * matrix[self.along, column] for column in self.others]
            for row, slope in zip(self.others, self.slopes(theta), strict=True)
        ]

    def secant_slopes(self, theta: Any) -> list[Any]:
        """Return the ratio W(theta) / theta for the curve's two polynomials W, over a ball of theta
        that may contain 0.
        """
        return [evaluate_polynomial(row[1:], theta) for row in self.graph]

    def require_side(self, theta_max: Any, cone: Sequence[Any]) -> None:
        """Raise Unproved unless gamma_y has the sign of the curve's side all over a cone.

        The cone consists of |w_i| <= cone_i theta, 0 < theta <= theta_max, where w is the offset
        from the curve. A curve without a side passes.
        """
        if self.side is None:
            return
        span = arb(0).union(theta_max)
        z, direction = (
            self.point(span, [arb(0, magnitude_bound(k * theta_max)) for k in cone]),
            [arb(1)] * 3,
        )
        for other, steep, k in zip(self.others, self.secant_slopes(span), cone, strict=True):
            direction[other] = steep + arb(0, magnitude_bound(k))
        slope = self.side * self.saddle.sliding_slope(z, direction)
        require_positive("6.5: the sign of the sliding velocity next to the saddle", slope)

    def defect(self, theta: Any, order: int) -> list[Any]:
        """Return the curve's defect of invariance D(theta + x), as two power series in x up to
        x^order.

        D is the amount by which the field at a point of the curve is not tangent to the curve.
        """
        with series_length(order + 1):
            variable = arb_series([theta, 1], prec=order + 1)
            rates = self.saddle.rates(self.point(variable), self.side)
            pairs = zip(self.others, self.slopes(variable), strict=True)
            return [rates[other] - slope * rates[self.along] for other, slope in pairs]

    def relative_defect(self, theta_max: Any) -> list[Any]:
        """Return two bounds of |D(theta)| / |theta| for 0 < |theta| <= theta_max and all speeds.

        D is the curve's defect of invariance. Returns NaN where there is no bound. Raises Unproved
        if D is not 0 at the saddle.
        """
        order, whole = self.order, arb(0).union(theta_max)
        if self.side is None:
            whole = whole.union(-theta_max)
        inside = self.defect(arb(0), order)
        try:
            over = self.defect(whole, order + 1)
        # The mass may vanish somewhere: Arb does not divide a series by a ball that holds zero
        except ValueError:
            return [arb.nan()] * 2
        bounds = []
        for inner, outer in zip(inside, over, strict=True):
            require(bool(coefficient(inner, 0) == 0), "6.1: the saddle is not at rest")
            total = magnitude_bound(coefficient(outer, order + 1)) * theta_max**order
            for power in range(1, order + 1):
                total += magnitude_bound(coefficient(inner, power)) * theta_max ** (power - 1)
            bounds.append(magnitude_bound(total))
        return bounds


def verify_unstable_cone(
    curve: ManifoldGraph, theta: Any, cone: Sequence[Any], defect: Sequence[Any]
) -> tuple[list[Any], list[Any], Any]:
    """Show that the unstable manifold stays in a cone about the curve up to z_u = theta > 0 (6.1).

    Args:
        curve: A polynomial curve near the unstable manifold.
        theta: The coordinate z_u at which the branch leaves the cone.
        cone: The slopes k: the cone is |w_i| <= k_i z_u, w the offset from the curve.
        defect: Bounds of the curve's defect, as `ManifoldGraph.relative_defect` returns them.

    Returns:
        The box of z at z_u = theta, a box of z that holds the branch up to there, and the field's
        derivative DF over the latter.

    Raises:
        Unproved: With the inequality that fails.
    """
    require_positive("6.1: the reach and the cone next to the saddle", theta, *cone)
    span = arb(0).union(theta)
    within = [arb(0, magnitude_bound(k * theta)) for k in cone]
    whole = curve.point(span, within)
    matrix = arb_mat(curve.saddle.rates_and_derivatives(whole, curve.side)[1])
    rows, steep = curve.transverse_jacobian(matrix, span), curve.secant_slopes(span)
    along = zip(curve.others, steep, cone, strict=True)
    growth = matrix[UNSTABLE, UNSTABLE] + sum(
        (
            matrix[UNSTABLE, other] * (slope + arb(0, magnitude_bound(k)))
            for other, slope, k in along
        ),
        arb(0),
    )
    require_positive("6.1: the cone of the unstable manifold", growth)
    for i, j in ((0, 1), (1, 0)):
        inwards = cone[i] * (growth - rows[i][i]) - abs(rows[i][j]) * cone[j] - defect[i]
        require_positive("6.1: the cone of the unstable manifold", inwards)
    curve.require_side(theta, cone)
    return curve.point(theta, within), whole, matrix


def verify_isolating_block(
    curve: ManifoldGraph, extents: Sequence[Any]
) -> tuple[Any, list[Any], Any]:
    """Show that a box about the saddle, N = {|z_s| <= s, |w_u| <= u, |w_f| <= t}, is an isolating
    block (6.3).

    w is the offset from ``curve``, near the slow stable manifold; ``extents`` are s, u, t. Raises
    Unproved with the inequality that fails.

    Returns:
        The bound delta, beyond which |w_u| grows until the orbit leaves N; a box of z that contains
        N; the field's derivative DF over that box.
    """
    s, u, t = extents
    require_positive("6.3: the isolating block", s, u, t)
    span = arb(0, magnitude_bound(s))
    box = curve.point(span, (arb(0, magnitude_bound(u)), arb(0, magnitude_bound(t))))
    matrix = arb_mat(curve.saddle.rates_and_derivatives(box)[1])
    (outwards, from_f), (from_u, inwards) = curve.transverse_jacobian(matrix, span)
    defect = [d * s for d in curve.relative_defect(s)]
    require_positive("6.3: the isolating block", outwards)
    curve.require_side(s, (arb(0), arb(0)))
    delta = magnitude_bound((defect[0] + abs(from_f) * t) / outwards.lower() * 9 / 8)
    require_positive(
        "6.3: the faces of the isolating block",
        u - delta,
        outwards * delta - abs(from_f) * t - defect[0],
        -inwards * t - abs(from_u) * u - defect[1],
        -matrix[SLOW, SLOW] * s
        - abs(matrix[SLOW, UNSTABLE] * box[UNSTABLE])
        - abs(matrix[SLOW, FAST] * box[FAST]),
    )
    return delta, box, matrix
