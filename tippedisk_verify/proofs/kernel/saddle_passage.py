"""The passage by noninverted spinning and the flights to its copy, for all orbits at once (linear
law).

N is the box |z_u| <= u, |z_s| <= s, |z_f| <= t. Here z_u, z_s, z_f are the coordinates of `saddle`
along the unstable, the slow stable and the fast stable direction, and z' = F(z) is the motion in
them. All speeds lie in one ball. F is odd, so DF is the same at z and -z, and half of N suffices.
N is divided into small cells, over which the following are enclosed:

- A, which holds DF, and B, the derivative of F with respect to the speed.
- M, the mean of DF over each ray from the saddle, so that F(z) = M z for a matrix of M. It is the
  mean of n hulls. The k-th one is the hull of A over the cells that meet (k / n) N. It encloses DF
  where the ray's parameter is between (k - 1) / n and k / n.
- The products F_i B_j - F_j B_i, near z_f = 0.

A message of refusal begins with the number of the part of the proof of Theorem 7a that fails.

Faces (7a.1)
------------
By F = M z the rates point inwards on |z_s| = s and |z_f| = t, and outwards on |z_u| = u. So orbits
leave N through z_u = u or z_u = -u only, and at once.

The stable manifold (7a.1)
--------------------------
The points from which an orbit stays in N for ever are a graph z_u = g(z_s, z_f; speed). Indeed, on
each line along z_u the points that leave through either face form two open sets, which do not cover
the line. By the cones of `saddle.cone_conditions` on A, two remaining points with equal z_s, z_f
would drift apart. The remaining orbits converge to the saddle. There are three bounds:

- The weights (k_u, k_s, k_f) = `steep_weights` give
  |g - g'| <= k_u max(|z_s - z_s'| / k_s, |z_f - z_f'| / k_f, the speeds' difference).
- At one speed |g - g'| <= k max(|z_s - z_s'|, |z_f - z_f'|) with k = `lipschitz_slope`.
- With M in the place of A, and the saddle for the second orbit, |g| <= k max(|z_s|, |z_f|) with
  k = `flat_slope`.

An orbit *below* the graph (z_u < g) differs from the graph's with the same z_s, z_f by a vector of
the cone with d_u < 0. It grows, so the orbit leaves N through z_u = -u. It does not leave before
`min_passage_time`: |d_u| grows at most at the rate `growth_rates[1]`, and on leaving |d_u| is at
least u - k max(s, t), k = `flat_slope`.

The second compound (7a.2)
--------------------------
Let d be a variation of an orbit. The products b_ij = F_i d_j - F_j d_i obey b' = C b with

    C = (A_uu + A_ss, A_sf, -A_uf;  A_fs, A_uu + A_ff, A_us;  -A_fu, A_su, A_ss + A_ff)

(rows us, uf, sf), where A now is DF along the orbit. All three diagonal entries are negative. So

    |b| = max(|b_us|, |b_uf| / k_1, |b_sf| / k_2)

falls along the whole passage. b_uf falls faster, down to a bound by b_us and b_sf
(`compound_bounds`, `compound_ratio_bound`). If d is the derivative with respect to the speed, F_i
B_j - F_j B_i is added. Then |b_ij| <= X_ij stays true where C X + |F_i B_j - F_j B_i| < 0, for C
with its off-diagonal entries made positive (X = `drift_weights`).

b does not change if a multiple of F is added to d: it gives the variation on a section, at either
end. The cone |b_uf| <= k_1 b_us, |b_sf| <= k_2 b_us, b_us > 0 is kept, because b_us falls more
slowly than the other two.

beta_bar = 0 (7a.4)
-------------------
Let y = (beta_bar, y_g, v) be the offset from the saddle. Orbits in N keep the set K of all y with
beta_bar <= 0, y_g <= 0, v <= -p beta_bar:

- gamma falls where beta_bar < 0, and does not grow where beta_bar = 0.
- Where v = -p beta_bar > 0, the mean of the third row of Df gives (v + p beta_bar)' < 0.

In K beta_bar' <= -p beta_bar, so from K beta_bar does not come back to 0 in N.

A thin set (7a.4)
-----------------
Orbits in N keep |z_f| <= k_3 max(|z_u|, |z_s|), because |z_f| falls faster than the maximum can. If
beta_bar = 0 in this set, z_s is about |lambda_u / lambda_s| z_u, and y_g, v have the sign of z_u.
On the graph beta_bar > 0 where z_s < 0.

The flights (7a.1)
------------------
The flights go from z_u = u about the first saddle to z_s = -s about the second one, many in one
array. Each flight begins in a cell of starts (z_s, z_f) and of speeds. All flights take the same
number of steps, but each has its own length of step. A step is that of `kernel.step`, in doubles.

In each step but the last, z_s < -s is proved throughout: directly over the whole step, or at the
step's end together with F_s > 0 throughout. The last step begins before the section and ends after
it, with F_s > 0. So the arrival is the first moment at which z_s = -s. On the section time moves
with the start by dT = -d(z_s) / F_s.

For each step 0 < beta_bar < 1.5707 is shown, so that gamma grows, and v > 0, or v < 0, or v' < 0
throughout. So v has at most one zero, where beta_bar is largest. Its derivatives there are those at
a fixed time, because beta_bar' = 0.

Sources: J. S. Muldowney, Compound matrices and ordinary differential equations, Rocky Mountain J.
Math. 20 (1990); Yu. A. Kuznetsov, Elements of Applied Bifurcation Theory, Section 6.4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from flint import arb, arb_mat
from numpy.typing import NDArray

from tippedisk_verify.proofs.kernel.ball_array import BallArray
from tippedisk_verify.proofs.kernel.balls import Unproved, ball, require
from tippedisk_verify.proofs.kernel.poincare_map import BELOW_HALF_PI
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField, EnclosedFlight
from tippedisk_verify.proofs.kernel.saddle import (
    FAST,
    SLOW,
    UNSTABLE,
    SaddleCoordinates,
    columnwise_hull,
    cone_conditions,
    hull_of_ball_array,
    magnitude_bound,
    off_diagonal_sums,
    require_positive,
    wedge_product,
)
from tippedisk_verify.proofs.kernel.step import Step, StepTrial

__all__ = ["SaddlePassage", "enclose_arrivals"]

U, S, F = UNSTABLE, SLOW, FAST
_MAX_CELLS, _AT_ONCE = 2**18, 2**11  # cells; in one array
_ORDER = 8  # of the flights' series


class SaddlePassage:
    """The box N about the saddle, with enclosures of the field F over it and bounds of the passage.

    The constructor encloses the matrices A and M, the second compound's C and the derivative B by
    the speed. `verify_weights` must come next: it shows the inequalities on which all other methods
    rely.

    Args:
        saddle: The coordinates z, with the ball of speeds.
        extents: The half-lengths u, s, t of N along z_u, z_s, z_f.
        cells: The numbers n and m: n cells along half of z_u, 2 n along z_s and 2 m along z_f.
    """

    def __init__(
        self, saddle: SaddleCoordinates, extents: Sequence[Any], cells: Sequence[int]
    ) -> None:
        self.saddle, self.extents = saddle, list(extents)
        require_positive("7a.1: the extents", *self.extents)
        n, m = cells
        require(n * n * m <= _MAX_CELLS, "there are too many cells")
        #: the largest |z_f| for which `speed_wedge_bounds` is a bound
        self.speed_wedge_extent = self.extents[F] / m
        i, j, k = (
            places.ravel()
            for places in np.meshgrid(*map(np.arange, (n, 2 * n, 2 * m)), indexing="ij")
        )
        # The least multiple (shell + 1) / n of N that the cell's inside meets.
        shells = np.maximum(
            np.maximum(n - 1 - i, np.maximum(j - n, n - 1 - j)),
            np.maximum(k - m, m - 1 - k) * n // m,
        )
        whole: list[list[Any]] = [[] for _ in range(n)]
        speed_wedges: list[Any] = []
        for begin in range(0, len(i), _AT_ONCE):
            block = slice(begin, begin + _AT_ONCE)
            z = [
                x * BallArray((2 * place[block] + 1 - 2 * count) / 2, 0.5) * (1 / arb(count))
                for x, place, count in zip(self.extents, (i, j, k), (n, n, m), strict=True)
            ]
            held, mixed = self._enclose_over_cells(z, (k[block] == m) | (k[block] == m - 1))
            speed_wedges += mixed
            for shell in np.unique(shells[block]):
                whole[shell].append([hull_of_ball_array(x[shells[block] == shell]) for x in held])
        self.speed_wedge_bounds = [magnitude_bound(hull) for hull in columnwise_hull(speed_wedges)]
        self._set_matrices([columnwise_hull(parts) for parts in whole])

    def _enclose_over_cells(
        self, z: list[Any], central: NDArray[np.bool_]
    ) -> tuple[list[Any], list[list[Any]]]:
        """Enclose derivatives of the field F over an array of cells, boxes of coordinates z.

        Returns two lists. The first one contains the nine entries of DF, the sums of pairs of its
        diagonal entries, and B, the derivative of the field F by the speed. The second one
        contains the hull of the products F_i B_j - F_j B_i over the ``central`` cells. It is empty
        if there are no such cells.
        """
        _, slopes, by_speed = self.saddle.rates_and_derivatives(z)
        d = [entry for row in slopes for entry in row]
        mixed = []
        if central.any():
            z = [x[central] for x in z]
            middle = [x.mid() for x in z]
            changes = [
                [slope[central] * (x - y) for slope, x, y in zip(row, z, middle, strict=True)]
                for row in slopes
            ]
            rates = [
                sum(row, point)
                for point, row in zip(
                    self.saddle.rates_and_derivatives(middle)[0], changes, strict=True
                )
            ]
            mixed = [
                [
                    hull_of_ball_array(x)
                    for x in wedge_product(rates, [x[central] for x in by_speed])
                ]
            ]
        return [*d, d[0] + d[4], d[0] + d[8], d[4] + d[8], *by_speed], mixed

    def _set_matrices(self, shells: Sequence[Sequence[Any]]) -> None:
        whole, total = shells[0], [arb(0)] * 15
        for held in shells:
            whole = [x.union(y) for x, y in zip(whole, held, strict=True)]
            total = [x + y for x, y in zip(total, whole, strict=True)]
        self.A, self.M = (
            arb_mat(3, 3, entries) for entries in (whole[:9], [x / len(shells) for x in total[:9]])
        )
        a, (c_us, c_uf, c_sf) = self.A, whole[9:12]
        self.C = arb_mat(
            [[c_us, a[S, F], -a[U, F]], [a[F, S], c_uf, a[U, S]], [-a[F, U], a[S, U], c_sf]]
        )
        self.B = [magnitude_bound(x) for x in whole[12:]]

    def verify_weights(self, weights: dict[str, Any]) -> None:
        """Show the inequalities of the proof (parts 7a.1 to 7a.5) that concern the box N alone,
        with given weights.

        They concern the faces, the cones, the second compound, the thin set and the set K. Stores
        the weights, and the bounds that follow from them, for the other methods. Raises Unproved
        with the inequality that fails.
        """
        self.steep_weights, self.compound_weights, self.drift_weights = (
            weights["steep"],
            weights["compound"],
            weights["drift"],
        )
        self.flat_slope, self.lipschitz_slope, self.thin_slope = (
            weights["flat"],
            weights["lipschitz"],
            weights["thin"],
        )
        require_positive(
            "7a.1: the weights",
            *self.steep_weights,
            *self.compound_weights,
            *self.drift_weights,
            self.flat_slope,
            self.lipschitz_slope,
            self.thin_slope,
        )
        (u, s, t), a, m, c = self.extents, self.A, self.M, self.C
        rest = off_diagonal_sums(m, self.extents)
        #: least rates of decay of |z_s| and |z_f|, down to `forcing`
        self.decay_rates = [-m[S, S], -m[F, F]]
        require_positive("7a.1: the stable directions", *self.decay_rates)
        self.forcing = [
            magnitude_bound(rest[S] / self.decay_rates[0]),
            magnitude_bound(rest[F] / self.decay_rates[1]),
        ]
        require_positive("7a.1: the face of z_u", m[U, U] * u - rest[U])
        require_positive("7a.1: the faces of z_s and z_f", s - self.forcing[0], t - self.forcing[1])
        require_positive(
            "7a.1: the cones of the steep weights", *cone_conditions(a, self.steep_weights, self.B)
        )
        for matrix, weight in ((m, self.flat_slope), (a, self.lipschitz_slope)):
            require_positive(
                "7a.1: the cones of the flat weights",
                *cone_conditions(matrix, (weight, arb(1), arb(1))),
            )
        # Bounds of the growth rate of |d_u| in the steep cone.
        rest_u = off_diagonal_sums(a, self.steep_weights)[U] / self.steep_weights[U]
        self.growth_rates = (
            (a[U, U] - rest_u - self.B[U] / self.steep_weights[U]).lower(),
            (a[U, U] + rest_u).upper(),
        )
        # |b| = max(|b_us|, |b_uf| / k_1, |b_sf| / k_2) falls, and b_us more slowly than the others.
        sizes = (arb(1), *self.compound_weights)
        rest = [x / k for x, k in zip(off_diagonal_sums(c, sizes), sizes, strict=True)]
        rates = [(c[k, k] + rest[k]).upper() for k in range(3)]
        self.compound_decay_rate, self.max_us_decay_rate = (
            -rates[0].max(rates[1]).max(rates[2]),
            -(c[0, 0] - rest[0]).lower(),
        )
        self.min_uf_decay_rate, self.uf_forcing = (
            (-c[1, 1]).lower(),
            magnitude_bound(abs(c[1, 0]) + abs(c[1, 2]) * self.compound_weights[1]),
        )
        require_positive(
            "7a.2: the second compound falls",
            self.compound_decay_rate,
            self.min_uf_decay_rate - self.compound_decay_rate,
            self.min_uf_decay_rate - self.max_us_decay_rate,
        )
        require_positive(
            "7a.3: the cone of the second compound",
            *(-self.max_us_decay_rate - rate for rate in rates[1:]),
        )
        require_positive(
            "7a.5: the variation by the speed",
            *(
                -c[k, k] * self.drift_weights[k] - rest - bound
                for k, rest, bound in zip(
                    range(3),
                    off_diagonal_sums(c, self.drift_weights),
                    self.speed_wedge_bounds,
                    strict=True,
                )
            ),
        )
        self._verify_thin_set()
        self._verify_quadrant(weights["return"])

    def _verify_thin_set(self) -> None:
        """Show that orbits stay in the thin set |z_f| <= k_3 max(|z_u|, |z_s|) (part 7a.4).

        k_3 is the weight ``thin_slope``. Stores in ``crossing_ratios`` enclosures of z / z_u where
        beta_bar = 0 in this set. Raises Unproved.
        """
        m, k, p = self.M, self.thin_slope, self.saddle.directions
        falls = self.decay_rates[1] - (abs(m[F, U]) + abs(m[F, S])) / k
        for i, j in ((U, S), (S, U)):
            require_positive(
                "7a.4: the thin set", falls + m[i, i] - abs(m[i, j]) - abs(m[i, F]) * k
            )
        # With m = max(|z_u|, |z_s|) and z_s = r z_u + q z_f there, m <= max(1, r) |z_u| + |q| k m.
        r, q = -p[0, U] / p[0, S], -p[0, F] / p[0, S]
        require_positive("7a.4: the thin set at beta_bar = 0", 1 - abs(q) * k)
        fast = arb(0, magnitude_bound(k * abs(r).max(arb(1)) / (1 - abs(q) * k)))
        self.crossing_ratios = arb(1), r + q * fast, fast
        require_positive(
            "7a.4: the signs at beta_bar = 0",
            self.crossing_ratios[S],
            self.crossing_direction(1),
            self.crossing_direction(2),
        )
        require_positive("7a.4: the weights of the graph", 1 - k, 1 - self.flat_slope)
        require_positive(
            "7a.4: beta_bar on the graph",
            -p[0, S] - abs(p[0, U]) * self.flat_slope - abs(p[0, F]) * k,
        )

    def crossing_direction(self, row: int) -> Any:
        """Return an enclosure of y_row / z_u where an orbit in the thin set crosses beta_bar = 0.

        y = (beta_bar, y_g, v) is the offset from the saddle, so row 1 is gamma's and row 2 is v's.
        z_u is the coordinate along the unstable direction.
        """
        return sum(self.saddle.directions[row, k] * self.crossing_ratios[k] for k in range(3))

    def _verify_quadrant(self, rate: Any) -> None:
        """Show that orbits do not leave the set K within N (7a.4).

        K contains all offsets y from the saddle with beta_bar <= 0, y_g <= 0 and v <= -p beta_bar,
        where p is ``rate`` [1/s]. So beta_bar does not come back to 0 in N. Raises Unproved.
        """
        p = self.saddle.directions
        rows = p * self.M * self.saddle.inverse
        beta = sum(abs(p[0, k]) * self.extents[k] for k in range(3))
        require_positive(
            "7a.4: beta_bar and gamma after a crossing",
            rows[2, 1],
            rows[2, 0] - rate * (rows[2, 2] + rate),
            rate,
            1 - beta,
        )

    def rates(self, z: Sequence[Any]) -> list[Any]:
        """Return an enclosure of the field F, the rates z', over a box of coordinates z about the
        saddle.

        It is the mean value form about the box's midpoint.
        """
        middle = [x.mid() for x in z]
        change = arb_mat(self.saddle.rates_and_derivatives(z)[1]) * arb_mat(
            [[x - y] for x, y in zip(z, middle, strict=True)]
        )
        return [
            x + y
            for x, y in zip(
                self.saddle.rates_and_derivatives(middle)[0], change.entries(), strict=True
            )
        ]

    def min_passage_time(self, distance: Any) -> Any:
        """Return a lower bound [s] of the time that orbits starting close to the stable manifold
        stay in the box N about the saddle.

        They start at most ``distance`` below the manifold's graph, measured along z_u.
        """
        u, s, t = self.extents
        return (((u - self.flat_slope * s.max(t)) / distance).log() / self.growth_rates[1]).lower()

    def stable_bounds(self, slow: Any, fast: Any, time: Any) -> list[Any]:
        """Return upper bounds of |z_s| and |z_f| of orbits that have been in the box N for
        ``min_passage_time`` [s].

        z_s and z_f are the coordinates along the two stable directions of the saddle. ``slow`` and
        ``fast`` are bounds of |z_s| and |z_f| at the start.
        """
        parts = zip((slow, fast), self.decay_rates, self.forcing, strict=True)
        return [magnitude_bound(x * (-rate.lower() * time).exp() + rest) for x, rate, rest in parts]

    def crossing_bound(self, lid: Any, fast: Any, moment: Any) -> Any:
        """Return an upper bound of |z_u| for orbits in the box N where they reach beta_bar = 0,
        having started below the stable manifold's graph.

        The orbits start on z_s = -s with |z_u| <= lid and |z_f| <= fast. If they reach beta_bar = 0
        before the ``moment`` [s], |z_u| has grown at a bounded rate. If they reach it later, |z_s|
        has fallen, and |z_u| is in proportion to it. Raises Unproved unless the moment is positive.
        """
        _, s, _ = self.extents
        require_positive("7a.4: the moment of crossing", moment)
        early = (lid + self.flat_slope * s) * (
            self.growth_rates[1] * moment
        ).exp() + self.flat_slope * s
        return magnitude_bound(early).max(
            magnitude_bound(
                self.stable_bounds(s, fast, moment)[0] / self.crossing_ratios[S].lower()
            )
        )

    def compound_bounds(self, b: Sequence[Any], time: Any) -> list[Any]:
        """Return upper bounds of |b_us| and |b_uf|, entries of the second compound, after
        ``min_passage_time`` [s] in N.

        ``b`` holds the entries (b_us, b_uf, b_sf) at the start: the 2 x 2 minors of the field and a
        variation of the orbit. N is the box about the saddle.
        """
        k_1, k_2 = self.compound_weights
        size = (
            magnitude_bound(b[0]).max(magnitude_bound(b[1] / k_1)).max(magnitude_bound(b[2] / k_2))
        )
        first = magnitude_bound(size * (-self.compound_decay_rate * time).exp())
        return [
            first,
            magnitude_bound(
                size * k_1 * (-self.min_uf_decay_rate * time).exp()
                + first * self.uf_forcing / (self.min_uf_decay_rate - self.compound_decay_rate)
            ),
        ]

    def compound_ratio_bound(self, time: Any) -> Any:
        """Return an upper bound of |b_uf| / b_us, a ratio of entries of the second compound, after
        ``min_passage_time`` [s] in the box N.

        The second compound b starts in the cone |b_uf| <= k_1 b_us, |b_sf| <= k_2 b_us, and stays
        in it.
        """
        faded = (
            self.compound_weights[0]
            * ((self.max_us_decay_rate - self.min_uf_decay_rate) * time).exp()
        )
        return magnitude_bound(
            faded + self.uf_forcing / (self.min_uf_decay_rate - self.max_us_decay_rate)
        )


def enclose_arrivals(
    saddle: SaddleCoordinates,
    extents: Sequence[Any],
    slow: BallArray,
    fast: Any,
    lengths: NDArray[np.float64],
    count: int,
    on_progress: Callable[[float], None] = lambda share: None,
) -> list[list[Any]]:
    """Enclose many flights from one saddle to the next: their arrivals on the section z_s = -s,
    with derivatives.

    The flights start on z_u = u about the first saddle. The derivatives are those with respect to
    z_s, z_f and the speed at the start. All inequalities belong to part 1 of the proof of Theorem
    7a.

    Args:
        saddle: The coordinates; their speeds are an array of balls, one for each flight.
        extents: The extents of the box N.
        slow: z_s at the start of each flight.
        fast: The ball of z_f at all starts.
        lengths: The length of each flight's steps [s].
        count: The number of steps of a flight.
        on_progress: Called after each step with the share of the steps that is done.

    Returns:
        Four rows: for z_u, z_f and the time [s] on arrival, and for the largest beta_bar. Each row
        has four of Arb's balls, which hold the value and its derivatives for all flights.

    Raises:
        Unproved: With the number of the first flight that is not proved.
    """
    flight, s = (
        saddle.flight([slow.constant(extents[U]), slow, slow.constant(fast)], _ImageAxes()),
        extents[S],
    )
    maxima: list[list[Any]] = []
    has_maximum = np.zeros(len(lengths), bool)
    for number in range(1, count + 1):
        step = StepTrial(flight, (_ORDER, _ORDER)).tested_step(BallArray(lengths))
        _require_all(
            "the states and derivatives over a step are not shown to stay in its enclosure",
            step.included,
        )
        may_have_maximum = _may_have_maximum(flight.field, step)
        if may_have_maximum.any():
            half = step.length / 2
            by = step.flight_derivatives_at(half + half.around_zero())[0][1:]
            maxima.append(
                [hull_of_ball_array(x[may_have_maximum]) for x in (step.enclosure[0], *by)]
            )
        has_maximum |= may_have_maximum
        on_progress(number / count)
        if number == count:
            break
        flight.take_step(step)
        z = saddle.second_saddle_coordinates(step.enclosure)
        rate, level = saddle.rates(z)[S], saddle.enclosed_coordinates(flight.state_set)[S] + s
        _require_all(
            "it is not shown to be on its way",
            (-level).positive(),
            rate.positive() | (-s - z[S]).positive(),
        )
    _require_all("beta_bar is not shown to have a largest value on the way", has_maximum)
    beta = columnwise_hull(maxima)
    time, *landed = _enclosed_arrival(saddle, flight, step, s)
    begin = step.length * (count - 1)
    rows = [*landed, [begin + time[0], *time[1:]]]
    return [*([hull_of_ball_array(x) for x in row] for row in rows), beta]


class _ImageAxes:
    """A rule for the axes of sets of states in flights, in place of a search.

    The axes are the images of the first two, which started along z_u and z_s, and the axis of v.
    """

    def new_axes(
        self, moved_axes: Sequence[Sequence[Any]], sizes: Any, stiffness: Any
    ) -> list[list[Any]]:
        return [[*row[: S + 1], row[F].constant(int(k == 2))] for k, row in enumerate(moved_axes)]

    def record_step(self, *_: Any) -> None:
        """Do nothing: the steps of these flights are not recorded."""


def _require_all(statement: str, *verified: NDArray[np.bool_]) -> None:
    """Raise Unproved unless all masks are True for all flights.

    ``verified`` are masks with an entry for each flight. The message contains the number of the
    first flight that fails, and ``statement``.
    """
    flights = np.logical_and.reduce(verified)
    if not flights.all():
        raise Unproved(f"flight {int(np.argmin(flights)) + 1}: {statement}")


def _may_have_maximum(field: EnclosedField, step: Step) -> NDArray[np.bool_]:
    """Show that gamma grows and that v has at most one zero in the step of each flight.

    Returns a mask of the flights in which v may have a zero. Raises Unproved with the first flight
    for which this is not shown.
    """
    beta, _, v = step.enclosure
    _require_all(
        "0 < beta_bar < 1.5707 is not shown",
        beta.positive(),
        (ball(BELOW_HALF_PI) - beta).positive(),
    )
    may_have_maximum: NDArray[np.bool_] = ~(v.positive() | v.negative())
    if may_have_maximum.any():
        _require_all(
            "v is not shown to pass zero once",
            ~may_have_maximum | field.rates(step.enclosure)[2].negative(),
        )
    return may_have_maximum


def _enclosed_arrival(
    saddle: SaddleCoordinates, flight: EnclosedFlight, step: Step, s: Any
) -> list[list[Any]]:
    """Enclose where and when flights arrive on the section z_s = -s, in the last step of each.

    Returns three rows: for the time [s] since the step's start, for z_u and for z_f. Each row has
    the value and its derivatives with respect to z_s, z_f and the speed at the flight's start.
    Raises Unproved with the first flight that is not shown to arrive.
    """
    # By the mean value theorem about the middle of the step.
    middle = step.length / 2
    level = saddle.enclosed_coordinates(flight.states_after(step, middle))[S] + s
    rate = saddle.rates(saddle.second_saddle_coordinates(step.enclosure))[S]
    for _ in range(2):
        _require_all("it is not shown to pass z_s = -s once", rate.positive())
        time = middle - level / rate
        _require_all(
            "it is not shown to arrive in its last step",
            time.positive(),
            (step.length - time).positive(),
        )
        rate = saddle.rates(
            saddle.enclosed_coordinates(flight.states_after(step, time.union(middle)))
        )[S]
    state_set = flight.states_after(step, time)
    z = saddle.enclosed_coordinates(state_set)
    z[S] = z[S].constant(-s)
    rates, rows = saddle.rates(z), saddle.columns_in_coordinates(state_set.derivative_matrix())
    _require_all("it is not shown to arrive", rates[S].positive())
    by_time = [-rows[S][k] / rates[S] for k in (1, 2, 3)]
    by_u, by_f = ([rows[i][k] + rates[i] * by_time[k - 1] for k in (1, 2, 3)] for i in (U, F))
    return [[time, *by_time], [z[U], *by_u], [z[F], *by_f]]
