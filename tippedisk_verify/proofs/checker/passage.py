"""The passage by noninverted spinning: bounds that hold for all orbits of a box N, at all speeds of a ball.

y is the offset from the saddle (0, pi, 0) and y = P z with a matrix P that the certificate gives: z = (z_u, z_s, z_f),
about along the eigenvectors; z' = F(z). N is the box |z_u| <= u, |z_s| <= s, |z_f| <= t. F is odd, so that half of N
tells all of it. Over small cells are enclosed: A, which holds DF; M with F(z) = M z for z in N, as a mean over rays
from the saddle; C, the matrix of b' = C b for the products b_ij = F_i d_j - F_j d_i with a variation d (us, uf, sf);
the field's derivatives B by the speed; and the products F_i B_j - F_j B_i, near z_f = 0.

What follows from the inequalities: orbits leave N through z_u = u or -u only, at once, but for those on a graph z_u =
g(z_s, z_f), which converge to the saddle. |g| <= k max(|z_s|, |z_f|) with k = `flat`, and L = `lipschitz` bounds its
slopes; with the weights `steep` it is Lipschitz in the speed too. An orbit below the graph leaves through z_u = -u, not
before `time`. docs/certified.md and the module of the same name in the room of the proofs say why.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product
from typing import Any

from flint import arb, arb_mat

from tippedisk_verify.proofs.checker.steps import Flow, Unproved, column, exact_ball, need, positive

__all__ = ["F", "Passage", "S", "Saddle", "U", "ask", "cones", "hull", "most", "products"]

U, S, F = 0, 1, 2  # unstable, slow stable, fast stable
_MOST_CELLS = 2**18


def ask(what: str, *slacks: Any) -> None:
    """Raises Unproved unless all numbers of all balls are positive."""
    for slack in slacks:
        need(positive(slack), f"{what}: {slack.str(4)} is not shown to be positive")


def most(x: Any) -> Any:
    """A point no smaller than any |x| of the ball."""
    return x.abs_upper()


def hull(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return [a.union(b) for a, b in zip(x, y, strict=True)]


def others(matrix: Any, weights: Sequence[Any]) -> list[Any]:
    """For each row the sum of the other entries' sizes, weighted."""
    return [sum((abs(matrix[i, j]) * weights[j] for j in range(3) if j != i), arb(0)) for i in range(3)]


def cones(matrix: Any, weights: Sequence[Any], by_speed: Sequence[Any] = (0, 0, 0)) -> list[Any]:
    """If all are positive, |d_u| / k_u grows once it is the largest of the |d_i| / k_i and of the speeds' difference,
    and otherwise |d_s| / k_s and |d_f| / k_f fall."""
    rest = [(x + b) / k for x, b, k in zip(others(matrix, weights), by_speed, weights, strict=True)]
    return [matrix[U, U] - rest[U], -matrix[S, S] - rest[S], -matrix[F, F] - rest[F]]


def products(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    """x_i y_j - x_j y_i: us, uf, sf."""
    return [x[i] * y[j] - x[j] * y[i] for i, j in ((U, S), (U, F), (S, F))]


class Saddle:
    """The coordinates z, and the field in them."""

    def __init__(self, flow: Flow, directions: Sequence[Sequence[Any]]) -> None:
        self.flow, self.directions = flow, arb_mat(directions)
        try:
            self.inverse = self.directions.inv()
        except ZeroDivisionError:
            raise Unproved("the directions at the saddle have no inverse") from None

    def offset(self, z: Sequence[Any]) -> list[Any]:
        return list((self.directions * column(z)).entries())

    def coordinates(self, state: Sequence[Any]) -> list[Any]:
        """z of (beta_bar, gamma_bar, v)."""
        return list((self.inverse * column([state[0], state[1] - arb.pi(), state[2]])).entries())

    def field(self, z: Sequence[Any]) -> tuple[list[Any], Any, list[Any]]:
        """F, DF and B over a box of z."""
        beta, gamma, v = self.offset(z)
        rates, (gb, gw, ab, ag, av, aw) = self.flow.rates([beta, gamma + arb.pi(), v], True)
        slopes = self.inverse * arb_mat([[0, 0, 1], [gb, 0, 0], [ab, ag, av]]) * self.directions
        by_speed = self.inverse * column([0, gw, aw])
        return list((self.inverse * column(rates)).entries()), slopes, list(by_speed.entries())

    def rates(self, z: Sequence[Any]) -> list[Any]:
        """F over a box of z, by the mean value theorem about its middle."""
        middle = [x.mid() for x in z]
        away = self.field(z)[1] * column([x - point for x, point in zip(z, middle, strict=True)])
        return [x + y for x, y in zip(self.field(middle)[0], away.entries(), strict=True)]


class Passage(Saddle):
    """N, what is enclosed over it, and what follows; see the file's docstring."""

    def __init__(self, flow: Flow, given: dict[str, Any]) -> None:
        super().__init__(flow, given["directions"])
        self.extents, self.steep, self.compound = given["extents"], given["steep"], given["compound"]
        self.flat, self.lipschitz, self.thin = given["flat"], given["lipschitz"], given["thin"]
        self.drift = given["drift"]
        weights = (*self.extents, *self.steep, *self.compound, *self.drift, self.flat, self.lipschitz, self.thin)
        ask("the extents and the weights", *weights)
        self._enclose(*given["cells"])
        (u, s, t), a, m, c = self.extents, self.A, self.M, self.C
        rest = others(m, self.extents)
        #: how fast |z_s| and |z_f| fall at least, but for what the others' part feeds them to
        self.decay = [-m[S, S], -m[F, F]]
        ask("the stable directions", *self.decay)
        self.forcing = [most(rest[S] / self.decay[0]), most(rest[F] / self.decay[1])]
        ask("the face of z_u", m[U, U] * u - rest[U])
        ask("the faces of z_s and z_f", s - self.forcing[0], t - self.forcing[1])
        ask("the cones of the steep weights", *cones(a, self.steep, self.B))
        for matrix, weight in ((m, self.flat), (a, self.lipschitz)):
            ask("the cones of the flat weights", *cones(matrix, (weight, arb(1), arb(1))))
        # |d_u| in the steep cone grows at least and at most so fast.
        rest_u = others(a, self.steep)[U] / self.steep[U]
        self.grows = (a[U, U] - rest_u - self.B[U] / self.steep[U]).lower(), (a[U, U] + rest_u).upper()
        # |b| = max(|b_us|, |b_uf| / k_1, |b_sf| / k_2) falls, and b_us slower than the others.
        weights = (arb(1), *self.compound)
        rest = [x / k for x, k in zip(others(c, weights), weights, strict=True)]
        rates = [(c[k, k] + rest[k]).upper() for k in range(3)]
        self.rate, self.slowest = -rates[0].max(rates[1]).max(rates[2]), -(c[0, 0] - rest[0]).lower()
        self.falls, self.fed = (-c[1, 1]).lower(), most(abs(c[1, 0]) + abs(c[1, 2]) * self.compound[1])
        ask("the second compound falls", self.rate, self.falls - self.rate, self.falls - self.slowest)
        ask("the cone of the second compound", *(-self.slowest - rate for rate in rates[1:]))
        ask("the variation by the speed", *(
            -c[k, k] * self.drift[k] - rest - stirred
            for k, rest, stirred in zip(range(3), others(c, self.drift), self.stirred, strict=True)
        ))  # fmt: skip
        self._thin_set()
        self._quadrant(given["return"])

    def _enclose(self, n: int, m: int) -> None:
        """A, M, C, B and the stirred products, over cells of the half z_u <= 0."""
        need(n * n * m <= _MOST_CELLS, "there are too many cells")
        sides = [(extent, count) for extent, count in zip(self.extents, (n, n, m), strict=True)]
        cuts = [
            [x * exact_ball(Fraction(k, count)).union(exact_ball(Fraction(k + 1, count))) for k in range(-count, count)]
            for x, count in sides
        ]
        shells: list[Any] = [None] * n
        self.stirred = [arb(0)] * 3
        for places in product(range(n), range(2 * n), range(2 * m)):
            z = [cut[k] for cut, k in zip(cuts, places, strict=True)]
            _, slopes, by_speed = self.field(z)
            i, j, k = (max(k - count, count - k - 1) for k, (_, count) in zip(places, sides, strict=True))
            if k == 0:
                mixed = products(self.rates(z), by_speed)
                self.stirred = [most(x).max(y) for x, y in zip(mixed, self.stirred, strict=True)]
            d = slopes.entries()
            held = [*d, d[0] + d[4], d[0] + d[8], d[4] + d[8], *by_speed]
            # The least multiple (shell + 1) / n of N that the cell's inside meets.
            shell = max(i, j, k * n // m)
            shells[shell] = held if shells[shell] is None else hull(shells[shell], held)
        whole, total = shells[0], [arb(0)] * 15
        for held in shells:
            whole = hull(whole, held)
            total = [x + y for x, y in zip(total, whole, strict=True)]
        self.A, self.M = (arb_mat(3, 3, entries) for entries in (whole[:9], [x / n for x in total[:9]]))
        a, (c_us, c_uf, c_sf) = self.A, whole[9:12]
        self.C = arb_mat([[c_us, a[S, F], -a[U, F]], [a[F, S], c_uf, a[U, S]], [-a[F, U], a[S, U], c_sf]])
        self.B = [most(x) for x in whole[12:]]
        self.stirred_within = self.extents[F] / m

    def _thin_set(self) -> None:
        """|z_f| <= k_3 max(|z_u|, |z_s|) is kept. Where beta_bar = 0 in it, z_s / z_u and z_f / z_u lie in `ratios`."""
        m, k, p = self.M, self.thin, self.directions
        falls = self.decay[1] - (abs(m[F, U]) + abs(m[F, S])) / k
        for i, j in ((U, S), (S, U)):
            ask("the thin set", falls + m[i, i] - abs(m[i, j]) - abs(m[i, F]) * k)
        r, q = -p[0, U] / p[0, S], -p[0, F] / p[0, S]
        ask("the thin set at beta_bar = 0", 1 - abs(q) * k)
        fast = arb(0, most(k * abs(r).max(arb(1)) / (1 - abs(q) * k)))
        self.ratios = arb(1), r + q * fast, fast
        ask("the signs at beta_bar = 0", self.ratios[S], self.at_crossing(1), self.at_crossing(2))
        ask("the weights of the graph", 1 - k, 1 - self.flat)
        ask("beta_bar on the graph", -p[0, S] - abs(p[0, U]) * self.flat - abs(p[0, F]) * k)

    def at_crossing(self, row: int) -> Any:
        """y_row / z_u where beta_bar = 0 in the thin set."""
        return sum(self.directions[row, k] * self.ratios[k] for k in range(3))

    def _quadrant(self, rate: Any) -> None:
        """Once y_gamma <= 0, v <= -rate beta_bar, beta_bar has not come back to 0 before the orbit leaves N."""
        rows = self.directions * self.M * self.inverse
        beta = sum(abs(self.directions[0, k]) * self.extents[k] for k in range(3))
        ask("beta_bar and gamma after a crossing", rows[2, 1], rows[2, 0] - rate * (rows[2, 2] + rate), rate, 1 - beta)

    def time(self, distance: Any) -> Any:
        """No orbit that starts below the graph by at most this leaves N before [s]."""
        u, s, t = self.extents
        return (((u - self.flat * s.max(t)) / distance).log() / self.grows[1]).lower()

    def fallen(self, slow: Any, fast: Any, time: Any) -> list[Any]:
        """What |z_s| and |z_f| are at most after ``time`` or later in N, from ``slow`` and ``fast``."""
        parts = zip((slow, fast), self.decay, self.forcing, strict=True)
        return [most(x * (-rate.lower() * time).exp() + rest) for x, rate, rest in parts]

    def crossing(self, lid: Any, fast: Any, moment: Any) -> Any:
        """What |z_u| is at most where an orbit from |z_u| <= lid, |z_f| <= fast below the graph has beta_bar = 0.

        Before the moment |z_u| has not grown to more, and after it |z_s| has fallen.
        """
        _, s, _ = self.extents
        ask("the moment of crossing", moment)
        early = (lid + self.flat * s) * (self.grows[1] * moment).exp() + self.flat * s
        return most(early).max(most(self.fallen(s, fast, moment)[0] / self.ratios[S].lower()))

    def settled(self, b: Sequence[Any], time: Any) -> list[Any]:
        """What |b_us| and |b_uf| are at most after ``time`` or later, from b."""
        k_1, k_2 = self.compound
        size = most(b[0]).max(most(b[1] / k_1)).max(most(b[2] / k_2))
        first = most(size * (-self.rate * time).exp())
        return [first, most(size * k_1 * (-self.falls * time).exp() + first * self.fed / (self.falls - self.rate))]

    def ratio(self, time: Any) -> Any:
        """What |b_uf| / b_us is at most after ``time`` or later in the cone |b_uf| <= k_1 b_us, |b_sf| <= k_2 b_us."""
        faded = self.compound[0] * ((self.slowest - self.falls) * time).exp()
        return most(faded + self.fed / (self.falls - self.slowest))
