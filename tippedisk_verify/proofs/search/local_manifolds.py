"""Invariant curves of noninverted spinning, as polynomial graphs with a proved distance from the truth.

**Coordinates.** y is the offset (beta_bar, gamma - gamma*, v) from the saddle and y = P z, the columns of P near the
eigenvectors at one speed: z = (z_u, z_s, z_f), unstable, slow stable, fast stable. P is an exact matrix, so z' = F(z) =
P^-1 f(P z) is the same system, whatever speed it is looked at. A `Curve` is a graph over one of the coordinates, called
theta: the other two are w = z - W(theta) away from the polynomials W. Then

    w' = D(theta) + J w,     D = F_w(theta, W) - W' F_theta(theta, W),     J = dF_w/dw - W' dF_theta/dw,

with D the *defect* and J taken somewhere between the curve and the point (mean value theorem). D vanishes at 0, and
|D| <= d |theta| with a d that is enclosed here: Taylor coefficients to the order N of W at 0, and Lagrange's remainder,
coefficient N + 1 over the whole interval.

**Unstable manifold** (theta = z_u): if on the cone |w_i| <= k_i theta, 0 < theta <= theta_0,

    k_i (g - J_ii) > |J_ij| k_j + d_i   and   g > 0,     with g theta a lower bound of theta',

then orbits cross the cone's sides inwards only, and theta grows. The linear flow maps the linear cone into its
interior, which by Krein and Rutman's theorem then holds the leading eigenvector; so the branch of W^u with theta > 0
starts inside the cone and leaves it at theta_0: its point there has |w_i| <= k_i theta_0 (`unstable_point`). That there
is one unstable direction follows from a0 < 0 < a2 (`closed_forms`): the eigenvalues' product is positive, their sum
negative.

**Isolating block** (theta = z_s): N = {|z_s| <= s, |w_u| <= u, |w_f| <= t}. If z_s and w_f point inwards on their faces
and w_u' has the sign of w_u for delta <= |w_u| <= u, then an orbit in N with w_u > delta leaves N through w_u = u, one
with w_u < -delta through w_u = -u, and no orbit leaves anywhere else (`Block`).

**Cones** (`rates_of_cones`): on a convex box that holds the saddle let A enclose DF and B the derivative of F by Omega.
Two orbits at speeds Omega and Omega + Delta, Delta >= 0, differ by d with d' = A d + B Delta. With weights k_u, k_s,
k_f > 0, let U = |d_u| / k_u and S = max(|d_s| / k_s, |d_f| / k_f). If the three numbers

    mu = A_uu - (|A_us| k_s + |A_uf| k_f + |B_u|) / k_u,   nu_i = -A_ii - (sum over j != i of |A_ij| k_j + |B_i|) / k_i

are positive, then as long as both orbits are in the box: once U >= max(S, Delta), this stays so and U grows like
exp(mu t); backwards in time, once S >= max(U, Delta), this stays so and S grows like exp(nu |t|). Two consequences. An
orbit that stays in the box for ever converges to the saddle (take the saddle itself for the second orbit: U >= S would
drive it out, so S > U, and S falls exponentially). And two orbits that come out of the saddle at time -infinity, in the
box ever since, and have equal z_u now, differ by no more than |d_s| <= k_s Delta, |d_f| <= k_f Delta now.

**The smooth friction law.** Its field is odd, continuously differentiable, and analytic on either side of gamma_y = 0,
a surface through the saddle. The halves of each curve leave the saddle on opposite sides. W is the series of one side's
law, for theta > 0, with even powers too. That gamma_y has this sign on the curve, or all over the cone about it, is
proved by the mean value theorem: gamma_y is zero at the saddle, and its derivative along z / theta is enclosed
(`Curve.keeps_side`).

- In the cone of the unstable manifold the side's law is the smooth one, and all that is said above is about an analytic
  field.
- The block holds both halves of the slow stable curve. The graph over theta < 0 is -W(-theta), as the field is odd, so
  D is odd and bounded as above. J and the faces, like the cones, need mean values only: DF is enclosed for the smooth
  law itself, over boxes that gamma_y = 0 cuts, and dF/d(Omega) by the hull of both sides'.

Where a ball becomes a point here: P, the eigenvalues in the recursion for W, and the coefficients of W are midpoints;
any others would do, the defect would only be larger. The weights k and the extents of N are rational guesses that the
inequalities above confirm or refuse.

Sources: P. Zgliczyński, Covering relations, cone conditions and the stable manifold theorem, J. Differential Equations
246 (2009); Ważewski's principle for the block.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import arb, arb_mat, arb_series, fmpq, fmpq_poly

from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.model.equations import jacobian, terms
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.angles import NONINVERTED, OPS, Turned, rates
from tippedisk_verify.proofs.closed_forms import characteristic_polynomial
from tippedisk_verify.proofs.kernel.balls import ball, ball_constants, coefficient, positive, series_length

__all__ = ["FAST", "SLOW", "UNSTABLE", "Block", "Curve", "Frame", "rates_of_cones", "smallest_weights"]

UNSTABLE, SLOW, FAST = 0, 1, 2
_GUESSES = 12  # doublings of a guessed weight before it is given up


class Frame:
    """The linear coordinates at noninverted spinning, chosen at one exact speed; see the module.

    Raises NoConnectionError where the equilibrium is no saddle with one unstable and two real stable directions.
    """

    def __init__(self, parameters: Parameters, speed: Fraction) -> None:
        self.constants, self.friction = ball_constants(parameters), parameters.friction
        a2, a1, a0 = map(Fraction, characteristic_polynomial(parameters.rational(), speed, NONINVERTED))
        polynomial: Any = fmpq_poly([fmpq(part.numerator, part.denominator) for part in (a0, a1, a2, Fraction(1))])
        roots = [root for root, count in polynomial.complex_roots() if count == 1 and root.imag.is_zero()]
        if len(roots) != 3:
            raise NoConnectionError(
                "noninverted spinning is a saddle-focus here: a connection of saddles is not looked for"
            )
        fast, slow, unstable = sorted((root.real.mid() for root in roots), key=float)
        if not slow < 0 < unstable:
            raise NoConnectionError("noninverted spinning is no saddle with one unstable direction here")
        self.eigenvalues = (unstable, slow, fast)  #: points near them [1/s]
        columns = []
        for value in self.eigenvalues:
            vector = [value, ball(speed), value * value]
            largest = max(vector, key=lambda part: abs(float(part)))
            columns.append([(part / largest).mid() for part in vector])
        self.directions = arb_mat(columns).transpose()  #: P, exact; all entries in gamma's row are positive
        self.inverse = self.directions.inv()

    def coordinates(self, offset: Sequence[Any]) -> list[Any]:
        """z of an offset y from the saddle."""
        return _times(self.inverse, offset)

    def offset(self, z: Sequence[Any]) -> list[Any]:
        """y = P z."""
        return _times(self.directions, z)

    def rates(self, omega: Any, z: Sequence[Any], side: int | None = None) -> list[Any]:
        """F(z) at the speed omega, for balls or series of balls; ``side`` of the smooth law as in `field`."""
        return self.coordinates(rates(self.constants, omega, NONINVERTED, self.offset(z), self.friction, side))

    def derivative(self, omega: Any, z: Sequence[Any], side: int | None = None) -> Any:
        """DF over a box of z and a ball of speeds."""
        beta, gamma, v = self.offset(z)
        rows = jacobian(OPS, self.constants, omega, self.friction, side)(Turned(1, beta), Turned(NONINVERTED, gamma), v)
        return self.inverse * arb_mat([[arb(entry) for entry in row] for row in rows]) * self.directions

    def derivative_by_speed(self, omega: Any, z: Sequence[Any], side: int | None = None) -> list[Any]:
        """dF/d(Omega) over a box of z and a ball of speeds."""
        if self.friction == "smooth" and side is None:
            both = (self.derivative_by_speed(omega, z, one) for one in (1, -1))
            return [a.union(b) for a, b in zip(*both, strict=True)]
        with series_length(2):
            speed = arb_series([omega, 1], prec=2)
            return [coefficient(rate, 1) for rate in self.rates(speed, z, side)]

    def sliding_slope(self, omega: Any, z: Sequence[Any], direction: Sequence[Any]) -> Any:
        """The derivative of gamma_y [m/s] along a direction, over a box of z and a ball of speeds."""
        with series_length(2):
            pairs = zip(self.offset(z), self.offset(direction), strict=True)
            beta, gamma, v = (arb_series([part, slope], prec=2) for part, slope in pairs)
            moved = terms(OPS, self.constants, omega, Turned(1, beta), Turned(NONINVERTED, gamma), v)
            return coefficient(moved.sliding_velocity, 1)


class Curve:
    """A graph w = W(theta) over one coordinate, approximating the saddle's curve in that direction to odd order N.

    ``omega`` is the ball of speeds for which bounds hold; W itself belongs to its midpoint.
    """

    def __init__(self, frame: Frame, omega: Any, along: int, order: int) -> None:
        self.frame, self.omega, self.along, self.order = frame, omega, along, order
        self.others = tuple(k for k in range(3) if k != along)
        #: the sign of gamma_y on the half with theta > 0, a guess that `keeps_side` confirms; None: the linear law
        self.side = None if frame.friction == "linear" else self._guessed_side()
        #: the graph is the polynomials' where theta > 0, and -W(-theta) where theta < 0
        self.mirrored = self.side is not None and along == SLOW
        #: W: coefficients of theta^0 … theta^N for each of the other coordinates, all exact
        self.graph: tuple[list[Any], list[Any]] = ([arb(0)] * (order + 1), [arb(0)] * (order + 1))
        middle, values = omega.mid(), frame.eigenvalues
        step = 2 if self.side is None else 1  # the linear law's field is odd about the saddle, and analytic
        for power in range(1 + step, order + 1, step):
            with series_length(power + 1):
                defect = self._defect_series(middle, arb(0), power)
            for other, series, rest in zip(self.others, self.graph, defect, strict=True):
                series[power] = (coefficient(rest, power) / (power * values[along] - values[other])).mid()

    def _guessed_side(self) -> int:
        direction = [arb(int(k == self.along)) for k in range(3)]
        return 1 if self.frame.sliding_slope(self.omega, [arb(0)] * 3, direction).mid() > 0 else -1

    def at(self, theta: Any) -> tuple[Any, Any]:
        """W at a number, ball or series."""
        if not self.mirrored or isinstance(theta, arb_series) or theta > 0:
            return _horner(self.graph[0], theta), _horner(self.graph[1], theta)
        first, second = (_horner(series, abs(theta)) for series in self.graph)
        return (-first, -second) if theta < 0 else (first.union(-first), second.union(-second))

    def slopes(self, theta: Any) -> tuple[Any, Any]:
        """W' at a number, ball or series."""
        if self.mirrored and not isinstance(theta, arb_series):
            theta = abs(theta)
        slopes = [[n * value for n, value in enumerate(series)][1:] for series in self.graph]
        return _horner(slopes[0], theta), _horner(slopes[1], theta)

    def steepness(self, theta: Any) -> tuple[Any, Any]:
        """W(theta) / theta over a ball, which may hold 0."""
        return _horner(self.graph[0][1:], theta), _horner(self.graph[1][1:], theta)

    def share_of_reach(self) -> Any:
        """About an eighth of where the last coefficients say that the series converge, a power of two, at most 1/4."""
        sizes = [float(abs(series[-1])) for series in self.graph]
        rates = [size ** (-1 / self.order) for size in sizes if size > 0]
        return ball(Fraction(2) ** math.floor(math.log2(min([2.0, *rates]) / 8)))

    def point(self, theta: Any, w: Sequence[Any] = (0, 0)) -> list[Any]:
        """z = (theta, W(theta) + w), its components in their places."""
        z = [theta] * 3
        for other, value, off in zip(self.others, self.at(theta), w, strict=True):
            z[other] = value + off
        return z

    def straightened(self, z: Sequence[Any]) -> tuple[Any, tuple[Any, Any]]:
        """(theta, w) of a point z."""
        theta = z[self.along]
        first, second = (z[other] - value for other, value in zip(self.others, self.at(theta), strict=True))
        return theta, (first, second)

    def across(self, matrix: Any, theta: Any) -> list[list[Any]]:
        """J = dF_w/dw - W' dF_theta/dw where DF is ``matrix`` and theta in its ball."""
        return [
            [matrix[row, column] - slope * matrix[self.along, column] for column in self.others]
            for row, slope in zip(self.others, self.slopes(theta), strict=True)
        ]

    def keeps_side(self, reach: Any, cone: Sequence[Any] = (0, 0)) -> bool:
        """Whether gamma_y has the curve's sign on |w_i| <= cone_i theta, 0 < theta <= reach: the mean value from 0."""
        if self.side is None:
            return True
        span = arb(0).union(reach)
        edges = [arb(0, _upper(part * reach)) for part in map(arb, cone)]
        z, direction = self.point(span, edges), [arb(1)] * 3
        for other, steep, part in zip(self.others, self.steepness(span), map(arb, cone), strict=True):
            direction[other] = steep + arb(0, _upper(part))
        return bool(positive(self.side * self.frame.sliding_slope(self.omega, z, direction)))

    def relative_defect(self, reach: Any) -> tuple[Any, Any]:
        """Bounds d of |D(theta)| / |theta| for 0 < |theta| <= reach and all speeds of the ball; NaN if none."""
        order = self.order
        with series_length(order + 2):
            near = self._defect_series(self.omega, arb(0), order)
            try:
                whole = arb(0).union(reach)
                if self.side is None:
                    whole = whole.union(-reach)
                over = self._defect_series(self.omega, whole, order + 1)
            except ValueError:  # the mass may vanish somewhere: Arb divides no series by a ball that holds zero
                return arb.nan(), arb.nan()
        bounds = []
        for inner, outer in zip(near, over, strict=True):
            if not coefficient(inner, 0).is_zero():
                raise ArithmeticError("the saddle is not at rest: the equations of motion have changed")
            total = _upper(coefficient(outer, order + 1)) * reach**order
            for power in range(1, order + 1):
                total += _upper(coefficient(inner, power)) * reach ** (power - 1)
            bounds.append(_upper(total))
        return bounds[0], bounds[1]

    def _defect_series(self, omega: Any, theta: Any, order: int) -> list[Any]:
        """D(theta + x) as a series in x to x^order."""
        variable = arb_series([theta, 1], prec=order + 1)
        flow = self.frame.rates(omega, self.point(variable), self.side)
        pairs = zip(self.others, self.slopes(variable), strict=True)
        return [flow[other] - slope * flow[self.along] for other, slope in pairs]

    def unstable_point(self, theta: Any) -> tuple[list[Any], tuple[Any, Any]] | None:
        """(z, k): the unstable branch at z_u = theta > 0 lies in the box z, |w_i| <= k_i theta; None if not proved."""
        defect = self.relative_defect(theta)
        for doubling in range(_GUESSES):
            k = self._cone(theta, defect, 2**doubling)
            if k is not None:
                if not self.keeps_side(theta, k):
                    return None
                return self.point(theta, [arb(0, _upper(part * theta)) for part in k]), k
        return None

    def _cone(self, theta: Any, defect: Sequence[Any], scale: int) -> tuple[Any, Any] | None:
        span = arb(0).union(theta)
        steep = self.steepness(span)
        gap = [self.frame.eigenvalues[self.along] - self.frame.eigenvalues[other] for other in self.others]
        least = max(map(_upper, defect), key=float)
        k = [_upper(scale * 2 * (part + least / 16) / room) for part, room in zip(defect, gap, strict=True)]
        inner = self.point(span, [arb(0, _upper(part * theta)) for part in k])
        matrix = self.frame.derivative(self.omega, inner, self.side)
        i, j = self.others
        rows = self.across(matrix, span)
        growth = matrix[self.along, self.along] + sum(
            (matrix[self.along, o] * (s + arb(0, _upper(part))) for o, s, part in zip((i, j), steep, k, strict=True)),
            arb(0),
        )
        inwards = (
            k[0] * (growth - rows[0][0]) - abs(rows[0][1]) * k[1] - defect[0],
            k[1] * (growth - rows[1][1]) - abs(rows[1][0]) * k[0] - defect[1],
        )
        if positive(growth) and all(map(positive, inwards)):
            return k[0], k[1]
        return None


@dataclass(frozen=True)
class Block:
    """The isolating block N about a slow stable curve, and what is proved of it; see the module."""

    curve: Curve
    extents: tuple[Any, Any, Any]  #: s, u, t
    delta: Any  #: beyond it w_u decides through which face an orbit leaves
    box: list[Any]  #: a box of z that holds N
    derivative: Any  #: DF over that box

    @classmethod
    def around(cls, curve: Curve, extents: Sequence[Any]) -> Block | None:
        """The block with these extents; None if one of its faces is not proved."""
        s, u, t = extents
        span = arb(0, _upper(s))
        box = curve.point(span, (arb(0, _upper(u)), arb(0, _upper(t))))
        matrix = curve.frame.derivative(curve.omega, box)
        (outwards, from_f), (from_u, inwards) = curve.across(matrix, span)
        defect = [part * s for part in curve.relative_defect(s)]
        if not (positive(outwards) and curve.keeps_side(s)):
            return None
        delta = _upper((defect[0] + abs(from_f) * t) / outwards.lower() * 9 / 8)
        faces = (
            u - delta,
            outwards * delta - abs(from_f) * t - defect[0],
            -inwards * t - abs(from_u) * u - defect[1],
            -matrix[SLOW, SLOW] * s - abs(matrix[SLOW, UNSTABLE] * box[UNSTABLE]) - abs(matrix[SLOW, FAST] * box[FAST]),
        )
        return cls(curve, (s, u, t), delta, box, matrix) if all(map(positive, faces)) else None


def rates_of_cones(matrix: Any, by_speed: Sequence[Any], weights: Sequence[Any]) -> tuple[Any, Any, Any]:
    """(mu, nu_s, nu_f) of the module's cones; what follows needs all three positive."""
    rates = []
    for row in range(3):
        others = sum((abs(matrix[row, k]) * weights[k] for k in range(3) if k != row), abs(by_speed[row]))
        rates.append((matrix[row, row] if row == UNSTABLE else -matrix[row, row]) - others / weights[row])
    return rates[0], rates[1], rates[2]


def smallest_weights(matrix: Any, by_speed: Sequence[Any]) -> list[Any]:
    """Weights near the smallest that leave half of each diagonal entry: a guess for `rates_of_cones` to confirm."""
    weights = [_upper(2 * abs(part)) / abs(matrix[k, k].mid()) for k, part in enumerate(by_speed)]
    for _ in range(_GUESSES):
        weights = [
            _upper(
                2
                * (sum((abs(matrix[row, k]) * weights[k] for k in range(3) if k != row), abs(by_speed[row])))
                / abs(matrix[row, row].mid())
            )
            for row in range(3)
        ]
    return weights


def _times(matrix: Any, vector: Sequence[Any]) -> list[Any]:
    return [sum((matrix[row, k] * vector[k] for k in range(1, 3)), matrix[row, 0] * vector[0]) for row in range(3)]


def _horner(coefficients: Sequence[Any], variable: Any) -> Any:
    total = 0 * variable + coefficients[-1]
    for value in reversed(coefficients[:-1]):
        total = total * variable + value
    return total


def _upper(value: Any) -> Any:
    """A point no smaller than any |x| of the ball."""
    return abs(value).upper()
