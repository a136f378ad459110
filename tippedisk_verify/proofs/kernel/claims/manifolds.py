"""Invariant curves of noninverted spinning, as polynomial graphs with a proved distance from the truth.

In the coordinates of `saddle` a `Curve` is a graph over one of the coordinates, called theta: the other two are
w = z - W(theta) away from the polynomials W. Then

    w' = D(theta) + J w,     D = F_w(theta, W) - W' F_theta(theta, W),     J = dF_w/dw - W' dF_theta/dw,

with D the *defect* and J taken somewhere between the curve and the point (mean value theorem). D vanishes at 0, and
|D| <= d |theta| with a d that is enclosed here: Taylor coefficients to the order N of W at 0, and Lagrange's remainder,
coefficient N + 1 over the whole interval. W itself is chosen, and any would do: the defect says how good it is.

**Unstable manifold** (theta = z_u): if on the cone |w_i| <= k_i theta, 0 < theta <= theta_0,

    k_i (g - J_ii) > |J_ij| k_j + d_i   and   g > 0,     with g theta a lower bound of theta',

then orbits cross the cone's sides inwards only, and theta grows. The linear flow maps the linear cone into its
interior, which by Krein and Rutman's theorem then holds the leading eigenvector; so the branch of the unstable manifold
with theta > 0 starts inside the cone and leaves it at theta_0: its point there has |w_i| <= k_i theta_0 (`leaving`).

**Isolating block** (theta = z_s): N = {|z_s| <= s, |w_u| <= u, |w_f| <= t}. If z_s and w_f point inwards on their faces
and w_u' has the sign of w_u for delta <= |w_u| <= u, then an orbit in N with w_u > delta leaves N through w_u = u, one
with w_u < -delta through w_u = -u, and no orbit leaves anywhere else (`block`).

**The smooth friction law.** Its field is odd, continuously differentiable, and analytic on either side of gamma_y = 0,
a surface through the saddle. The halves of each curve leave the saddle on opposite sides. W is the series of one side's
law, for theta > 0, with even powers too. That gamma_y has this sign on the curve, or all over the cone about it, is
shown by the mean value theorem: gamma_y is zero at the saddle, and its derivative along z / theta is enclosed.

- In the cone of the unstable manifold the side's law is the smooth one, and all that is said above is about an analytic
  field.
- The block holds both halves of the slow stable curve. The graph over theta < 0 is -W(-theta), as the field is odd, so
  D is odd and bounded as above. J and the faces, like the cones, need mean values only.

Source: P. Zgliczyński, Covering relations, cone conditions and the stable manifold theorem, J. Differential Equations
246 (2009); Ważewski's principle for the block.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flint import arb, arb_mat, arb_series

from tippedisk_verify.proofs.kernel.balls import coefficient, need, series_length
from tippedisk_verify.proofs.kernel.claims.saddle import FAST, SLOW, UNSTABLE, Saddle, ask, most

__all__ = ["Curve", "block", "leaving"]


class Curve:
    """A graph w = W(theta) over the coordinate ``along``.

    ``graph``: exact coefficients of theta^0 ... theta^N for each of the other coordinates, the first one 0. ``side``:
    the sign of gamma_y on the half with theta > 0, None for the linear law.
    """

    def __init__(self, saddle: Saddle, along: int, graph: Sequence[list[Any]], side: int | None) -> None:
        self.saddle, self.along, self.graph, self.side = saddle, along, graph, side
        self.others = tuple(k for k in range(3) if k != along)
        self.order = len(graph[0]) - 1
        #: the graph is the polynomials' where theta > 0, and -W(-theta) where theta < 0
        self.mirrored = side is not None and along == SLOW
        need(
            len({len(row) for row in graph}) == 1 and self.order > 0, "a curve's polynomials have unlike degrees, or 0"
        )
        need(all(bool(row[0] == 0) for row in graph), "a curve does not pass the saddle")

    def at(self, theta: Any) -> list[Any]:
        """W at a number, ball or series."""
        if not self.mirrored or isinstance(theta, arb_series) or theta > 0:
            return [_horner(row, theta) for row in self.graph]
        values = [_horner(row, abs(theta)) for row in self.graph]
        return [-x if theta < 0 else x.union(-x) for x in values]

    def slopes(self, theta: Any) -> list[Any]:
        """W' at a number, ball or series."""
        if self.mirrored and not isinstance(theta, arb_series):
            theta = abs(theta)
        return [_horner([n * value for n, value in enumerate(row)][1:], theta) for row in self.graph]

    def point(self, theta: Any, w: Sequence[Any] = (0, 0)) -> list[Any]:
        """z = (theta, W(theta) + w), its components in their places."""
        z = [theta] * 3
        for other, value, off in zip(self.others, self.at(theta), w, strict=True):
            z[other] = value + off
        return z

    def straightened(self, z: Sequence[Any]) -> list[Any]:
        """w of a point z."""
        return [z[other] - value for other, value in zip(self.others, self.at(z[self.along]), strict=True)]

    def across(self, matrix: Any, theta: Any) -> list[list[Any]]:
        """J where DF is ``matrix`` and theta in its ball."""
        return [
            [matrix[row, column] - slope * matrix[self.along, column] for column in self.others]
            for row, slope in zip(self.others, self.slopes(theta), strict=True)
        ]

    def steepness(self, theta: Any) -> list[Any]:
        """W(theta) / theta over a ball, which may hold 0."""
        return [_horner(row[1:], theta) for row in self.graph]

    def keeps_side(self, reach: Any, cone: Sequence[Any]) -> None:
        """Shown: gamma_y has the curve's sign on |w_i| <= cone_i theta, 0 < theta <= reach: the mean value from 0."""
        if self.side is None:
            return
        span = arb(0).union(reach)
        z, direction = self.point(span, [arb(0, most(k * reach)) for k in cone]), [arb(1)] * 3
        for other, steep, k in zip(self.others, self.steepness(span), cone, strict=True):
            direction[other] = steep + arb(0, most(k))
        slope = self.side * self.saddle.sliding_slope(z, direction)
        ask("the sign of the sliding velocity next to the saddle", slope)

    def defect(self, theta: Any, order: int) -> list[Any]:
        """D(theta + x) as a series in x to x^order."""
        with series_length(order + 1):
            variable = arb_series([theta, 1], prec=order + 1)
            flow = self.saddle.rates(self.point(variable), self.side)
            pairs = zip(self.others, self.slopes(variable), strict=True)
            return [flow[other] - slope * flow[self.along] for other, slope in pairs]

    def relative_defect(self, reach: Any) -> list[Any]:
        """Bounds d of |D(theta)| / |theta| for 0 < |theta| <= reach and all speeds; not finite if there are none."""
        order, whole = self.order, arb(0).union(reach)
        if self.side is None:
            whole = whole.union(-reach)
        inside = self.defect(arb(0), order)
        try:
            over = self.defect(whole, order + 1)
        except ValueError:  # the mass may vanish somewhere: Arb divides no series by a ball that holds zero
            return [arb.nan()] * 2
        bounds = []
        for inner, outer in zip(inside, over, strict=True):
            need(bool(coefficient(inner, 0) == 0), "the saddle is not at rest")
            total = most(coefficient(outer, order + 1)) * reach**order
            for power in range(1, order + 1):
                total += most(coefficient(inner, power)) * reach ** (power - 1)
            bounds.append(most(total))
        return bounds


def leaving(curve: Curve, theta: Any, cone: Sequence[Any], defect: Sequence[Any]) -> tuple[list[Any], list[Any], Any]:
    """Shown: the unstable branch at z_u = theta > 0 lies in the cone. The box of z there, a box of z that holds it from
    the saddle to there, and DF over that one.
    """
    ask("the reach and the cone next to the saddle", theta, *cone)
    span = arb(0).union(theta)
    within = [arb(0, most(k * theta)) for k in cone]
    whole = curve.point(span, within)
    matrix = arb_mat(curve.saddle.field(whole, curve.side)[1])
    rows, steep = curve.across(matrix, span), curve.steepness(span)
    along = zip(curve.others, steep, cone, strict=True)
    growth = matrix[UNSTABLE, UNSTABLE] + sum(
        (matrix[UNSTABLE, other] * (slope + arb(0, most(k))) for other, slope, k in along), arb(0)
    )
    ask("the cone of the unstable manifold", growth)
    for i, j in ((0, 1), (1, 0)):
        inwards = cone[i] * (growth - rows[i][i]) - abs(rows[i][j]) * cone[j] - defect[i]
        ask("the cone of the unstable manifold", inwards)
    curve.keeps_side(theta, cone)
    return curve.point(theta, within), whole, matrix


def block(curve: Curve, extents: Sequence[Any]) -> tuple[Any, list[Any], Any]:
    """Shown: N with the extents s, u, t isolates. Its delta, a box of z that holds N, and DF over that box."""
    s, u, t = extents
    ask("the isolating block", s, u, t)
    span = arb(0, most(s))
    box = curve.point(span, (arb(0, most(u)), arb(0, most(t))))
    matrix = arb_mat(curve.saddle.field(box)[1])
    (outwards, from_f), (from_u, inwards) = curve.across(matrix, span)
    defect = [d * s for d in curve.relative_defect(s)]
    ask("the isolating block", outwards)
    curve.keeps_side(s, (arb(0), arb(0)))
    delta = most((defect[0] + abs(from_f) * t) / outwards.lower() * 9 / 8)
    ask(
        "the faces of the isolating block",
        u - delta,
        outwards * delta - abs(from_f) * t - defect[0],
        -inwards * t - abs(from_u) * u - defect[1],
        -matrix[SLOW, SLOW] * s - abs(matrix[SLOW, UNSTABLE] * box[UNSTABLE]) - abs(matrix[SLOW, FAST] * box[FAST]),
    )
    return delta, box, matrix


def _horner(coefficients: Sequence[Any], variable: Any) -> Any:
    total = 0 * variable + coefficients[-1]
    for value in reversed(coefficients[:-1]):
        total = total * variable + value
    return total
