"""The passage by noninverted spinning, however long it takes: bounds that hold for all orbits at once (linear law).

z = (z_u, z_s, z_f) are the coordinates of `local_manifolds.Frame` at noninverted spinning, z' = F(z), and N is the box
|z_u| <= u, |z_s| <= s, |z_f| <= t. All speeds are those of one ball. Three enclosures carry the proofs: A holds DF over
N; B holds dF/d(Omega) over N; and M holds the mean of DF over each ray from the saddle, so that F(z) = M z for a matrix
of M (mean value theorem). F is odd, so DF is the same at z and -z, and half of N is enough for all three. A and B are
unions over small cells. M is the mean of n unions: the k-th is over the cells that meet (k / n) N, and holds DF where
the ray's parameter is between (k - 1) / n and k / n.

Each of the following is an inequality that `Passage.slacks` names and encloses; "proved" asks that all are positive.

**Faces.** By F = M z the rates point inwards on |z_s| = s and |z_f| = t, and outwards on |z_u| = u. So orbits leave N
through z_u = u or z_u = -u only, and at once.

**The stable manifold.** The set of the points from which an orbit stays in N for ever is a graph z_u = g(z_s, z_f;
Omega): on each line along z_u the points that leave through either face form two open sets, and something is left
between them; by the cones of `rates_of_cones` on A, two such points with equal z_s, z_f would drift apart. The weights
(k_u, k_s, k_f) = `steep` give |g - g'| <= k_u max(|z_s - z_s'| / k_s, |z_f - z_f'| / k_f, |Omega - Omega'|). At one
speed (k, 1, 1) with k = `lipschitz` give |g - g'| <= k max(|z_s - z_s'|, |z_f - z_f'|). With M in the place of A, and
the saddle for the second orbit, k = `flat` gives |g| <= k max(|z_s|, |z_f|).

An orbit *below* the graph (z_u < g) differs from the graph's with the same z_s, z_f by a vector of the cone, d_u < 0.
It grows, so the orbit leaves N through z_u = -u, and not before `time` seconds: |d_u|' <= growth |d_u| in the cone, and
when it leaves |d_u| is at least u - k max(s, t), k = `flat`.

**The second compound.** Let d be a variation of an orbit. The products b_ij = F_i d_j - F_j d_i obey

    b_us' = (A_uu + A_ss) b_us + A_sf b_uf - A_uf b_sf,
    b_uf' = A_fs b_us + (A_uu + A_ff) b_uf + A_us b_sf,
    b_sf' = - A_fu b_us + A_su b_uf + (A_ss + A_ff) b_sf,

with A now DF along the orbit. All three diagonal entries are negative. So |b| = max(|b_us|, |b_uf| / k_1, |b_sf| / k_2)
falls at least like exp(-rate t) along the whole passage, and b_uf sooner than that to what b_us and b_sf feed it with
(`settled`, `ratio`). If d is the derivative by Omega, F_i B_j - F_j B_i is added; then |b_ij| <= X_ij stays true where
C X + |F_i B_j - F_j B_i| < 0 for the matrix C of these equations, with its off-diagonal entries made positive (X =
`drift`). b does not change if a multiple of F is added to d: it gives the variation on a section, at either end. The
cone |b_uf| <= k_1 b_us, |b_sf| <= k_2 b_us, b_us > 0 is kept, because b_us falls slower than the other two.

**beta_bar = 0.** Let y = (beta_bar, y_g, v) be the offset from the saddle. The set K of all y with beta_bar <= 0,
y_g <= 0, v <= -p beta_bar is kept by orbits in N: gamma falls where beta_bar < 0; where beta_bar = 0 it does not grow;
and where v = -p beta_bar > 0 the mean of the third row of Df gives (v + p beta_bar)' < 0. In K beta_bar' <= -p
beta_bar, so from K beta_bar does not come back to 0 in N.

**A thin set.** |z_f| <= k_3 max(|z_u|, |z_s|) is kept by orbits in N, because |z_f| falls faster than the maximum can.
In it beta_bar = 0 means that z_s is about |lambda_u / lambda_s| z_u, and y_g, v have the sign of z_u (`signs`).

Where a ball becomes a point or a float: the extents and all weights are rational guesses.

Sources: J. S. Muldowney, Compound matrices and ordinary differential equations, Rocky Mountain J. Math. 20 (1990);
Yu. A. Kuznetsov, Elements of Applied Bifurcation Theory, Section 6.4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from flint import arb, arb_mat

from tippedisk_verify.proofs.kernel.balls import ball, hull
from tippedisk_verify.proofs.search.local_manifolds import FAST, SLOW, UNSTABLE, Frame, rates_of_cones

__all__ = ["EXTENTS", "RETURN", "STEEP", "THIN", "Passage", "enclosed_passage"]

#: u, s, t: |z_f| has room for starts on the section beta = pi/2 that are off the slow manifold
EXTENTS = (Fraction(1, 5), Fraction(1, 5), Fraction(3, 10))
_CELLS, _FAST_CELLS = 32, 6  # along half of z_u and z_s, and of z_f
STEEP = (Fraction(1), Fraction(1, 8), Fraction(1))  # k_u, k_s, k_f
_COMPOUND = (Fraction(1, 2), Fraction(1))  # k_1, k_2
RETURN = 10  # p [1/s], between the two roots of p^2 - a_2 p + a_1
THIN = Fraction(1, 8)  # k_3


@dataclass(frozen=True)
class Passage:
    """N and what is enclosed over it; see the module."""

    frame: Frame
    omega: Any  #: the ball of speeds
    extents: tuple[Any, Any, Any]  #: u, s, t
    spread: Any  #: A
    mean: Any  #: M
    second: Any  #: the matrix of b' = C b, the second compound of DF, over N
    by_speed: tuple[Any, Any, Any]  #: B
    stirred: tuple[Any, Any, Any]  #: at most |F_i B_j - F_j B_i|, us, uf, sf, where |z_f| <= `stirred_within`
    steep: tuple[Any, Any, Any]  #: k_u, k_s, k_f
    compound: tuple[Any, Any]  #: k_1, k_2

    @property
    def thin(self) -> Any:
        """k_3."""
        return ball(THIN)

    @cached_property
    def flat(self) -> Any:
        """k: |g| <= k max(|z_s|, |z_f|)."""
        row = self.mean
        return most((abs(row[UNSTABLE, SLOW]) + abs(row[UNSTABLE, FAST])) / row[UNSTABLE, UNSTABLE] * 9 / 8)

    @cached_property
    def lipschitz(self) -> Any:
        """|g - g'| at one speed is at most this times max(|z_s - z_s'|, |z_f - z_f'|)."""
        row = self.spread
        return most((abs(row[UNSTABLE, SLOW]) + abs(row[UNSTABLE, FAST])) / row[UNSTABLE, UNSTABLE] * 9 / 8)

    @property
    def decay(self) -> tuple[Any, Any]:
        """How fast |z_s| and |z_f| fall at least, but for `forcing` [1/s]."""
        return least(-self.mean[SLOW, SLOW]), least(-self.mean[FAST, FAST])

    @cached_property
    def forcing(self) -> tuple[Any, Any]:
        """What |z_s| and |z_f| fall to at least: the others' part in their rates, over their own decay."""
        u, s, t = self.extents
        slow, fast = self.decay
        by_slow = abs(self.mean[SLOW, UNSTABLE]) * u + abs(self.mean[SLOW, FAST]) * t
        by_fast = abs(self.mean[FAST, UNSTABLE]) * u + abs(self.mean[FAST, SLOW]) * s
        return most(by_slow / slow), most(by_fast / fast)

    @property
    def growth(self) -> tuple[Any, Any]:
        """How fast |d_u| grows in the cone of `steep`, at least and at most [1/s]."""
        k_u, k_s, k_f = self.steep
        others = (abs(self.spread[UNSTABLE, SLOW]) * k_s + abs(self.spread[UNSTABLE, FAST]) * k_f) / k_u
        own = self.spread[UNSTABLE, UNSTABLE]
        return least(own - others - abs(self.by_speed[UNSTABLE]) / k_u), most(own + others)

    @cached_property
    def compound_rates(self) -> tuple[Any, Any, Any, Any]:
        """Upper bounds of the growth of |b_us|, |b_uf| / k_1 and |b_sf| / k_2 relative to |b|, and a lower one of
        b_us in its cone [1/s].
        """
        weights = (arb(1), *self.compound)
        rates = []
        for row in range(3):
            others = sum((abs(self.second[row, k]) * weights[k] for k in range(3) if k != row), arb(0))
            rates.append((self.second[row, row], others / weights[row]))
        (own, coupled), *_ = rates
        first, second, third = ((main + rest).upper() for main, rest in rates)
        return first, second, third, least(own - coupled)

    @property
    def rate(self) -> Any:
        """|b| falls at least like exp(-rate t) [1/s]."""
        return -max(self.compound_rates[:3])

    def settled(self, size: Any, time: Any) -> tuple[Any, Any]:
        """Bounds of |b_us| and |b_uf| after ``time`` or later, if |b| was at most ``size``: b_uf falls fast to what the
        others leave of it.
        """
        first = most(size * (-self.rate * time).exp())
        falls, fed = self._fast_pair()
        return first, most(size * self.compound[0] * (-falls * time).exp() + first * fed / (falls - self.rate))

    def ratio(self, time: Any) -> Any:
        """A bound of |b_uf| / b_us after ``time`` or later in the cone: b_us was at most exp(slowest t) times as large
        t seconds ago.
        """
        falls, fed = self._fast_pair()
        slowest = -self.compound_rates[3]
        return most(self.compound[0] * ((slowest - falls) * time).exp() + fed / (falls - slowest))

    def _fast_pair(self) -> tuple[Any, Any]:
        """|b_uf|' <= -falls |b_uf| + fed max(|b_us|, |b_sf| / k_2)."""
        c = self.second
        return least(-c[1, 1]), most(abs(c[1, 0]) + abs(c[1, 2]) * self.compound[1])

    @cached_property
    def drift(self) -> list[Any]:
        """X: points that |b_us|, |b_uf|, |b_sf| stay below if b = 0 at first and d is the derivative by Omega."""
        grows = [[self.second[i, j].upper() if i == j else most(self.second[i, j]) for j in range(3)] for i in range(3)]
        solved = arb_mat(grows).solve(arb_mat([[-part * 17 / 16] for part in self.stirred]))
        return [most(solved[row, 0]) for row in range(3)]

    def slacks(self) -> Iterator[tuple[str, Any]]:
        """Each inequality's name with a ball that must be positive."""
        u, s, t = self.extents
        a, m = self.spread, self.mean
        yield (
            "the face of z_u",
            m[UNSTABLE, UNSTABLE] * u - abs(m[UNSTABLE, SLOW]) * s - abs(m[UNSTABLE, FAST]) * t,
        )
        slow, fast = self.decay
        yield "the face of z_s", slow
        yield "the face of z_s", s - self.forcing[0]
        yield "the face of z_f", fast
        yield "the face of z_f", t - self.forcing[1]
        for rate in rates_of_cones(a, self.by_speed, self.steep):
            yield "the cones of the steep weights", rate
        for matrix, weight in ((m, self.flat), (a, self.lipschitz)):
            for rate in rates_of_cones(matrix, [arb(0)] * 3, (weight, arb(1), arb(1))):
                yield "the cones of the flat weights", rate
        first, second, third, kept = self.compound_rates
        yield "the second compound falls", -first
        for other in (second, third):
            yield "the cone of the second compound", kept - other
        yield "the second compound's fast part", self._fast_pair()[0] - self.rate
        yield "the second compound's fast part", self._fast_pair()[0] + kept
        for row in range(3):
            others = sum((most(self.second[row, k]) * self.drift[k] for k in range(3) if k != row), self.stirred[row])
            yield "the variation by the speed", -self.second[row, row] * self.drift[row] - others
        # |z_f| / k_3 against max(|z_u|, |z_s|), which falls no faster than these two rates.
        k_3, falls = self.thin, abs(m[FAST, UNSTABLE]) + abs(m[FAST, SLOW])
        unstable = m[UNSTABLE, UNSTABLE] - abs(m[UNSTABLE, SLOW]) - abs(m[UNSTABLE, FAST]) * k_3
        stable = m[SLOW, SLOW] - abs(m[SLOW, UNSTABLE]) - abs(m[SLOW, FAST]) * k_3
        yield "the thin set", fast - falls / k_3 + unstable
        yield "the thin set", fast - falls / k_3 + stable
        beta, gamma, v = self._row_of_v()
        yield "the set K", gamma
        yield "the set K", beta - RETURN * (v + RETURN)
        yield from self.signs()

    def signs(self) -> Iterator[tuple[str, Any]]:
        """y_g / z_u and v / z_u where beta_bar = 0 in the thin set."""
        p, (share, fast) = self.frame.directions, self.at_crossing()
        yield "the thin set at beta_bar = 0", 1 - abs(p[0, FAST] / p[0, SLOW]) * self.thin
        yield "the signs at beta_bar = 0", share
        for row in (1, 2):
            yield "the signs at beta_bar = 0", p[row, UNSTABLE] + p[row, SLOW] * share + p[row, FAST] * fast

    def at_crossing(self) -> tuple[Any, Any]:
        """z_s / z_u and z_f / z_u where beta_bar = 0 in the thin set: with m = max(|z_u|, |z_s|) and z_s = r z_u + q
        z_f there, m <= max(1, r) |z_u| + |q| k_3 m.
        """
        p = self.frame.directions
        r, q = -p[0, UNSTABLE] / p[0, SLOW], -p[0, FAST] / p[0, SLOW]
        k_3 = self.thin
        fast = arb(0, most(k_3 * abs(r).max(arb(1)) / (1 - abs(q) * k_3)))
        return r + q * fast, fast

    def _row_of_v(self) -> list[Any]:
        """The third row of the mean of Df, in the coordinates y."""
        rows = self.frame.directions * self.mean * self.frame.inverse
        return [rows[2, k] for k in range(3)]

    def time(self, distance: Any) -> Any:
        """No orbit that is below the graph by at most this at first leaves N before [s]."""
        u, s, t = self.extents
        return least(((u - self.flat * s.max(t)) / distance).log() / self.growth[1])

    def fallen(self, slow: Any, fast: Any, time: Any) -> tuple[Any, Any]:
        """Bounds of |z_s| and |z_f| after ``time`` or later in N, if they were at most ``slow`` and ``fast``."""
        return (
            most(slow * (-self.decay[0] * time).exp() + self.forcing[0]),
            most(fast * (-self.decay[1] * time).exp() + self.forcing[1]),
        )

    @property
    def stirred_within(self) -> Any:
        """The |z_f| up to which `stirred` is a bound."""
        return self.extents[2] / _FAST_CELLS

    def rates(self, z: Sequence[Any]) -> list[Any]:
        """F over a box of z."""
        return rates_over(self.frame, self.omega, z)

    def norm(self, b: Sequence[Any]) -> Any:
        """|b| of a vector (b_us, b_uf, b_sf), at most."""
        return most(b[0]).max(most(b[1] / self.compound[0])).max(most(b[2] / self.compound[1]))


def rates_over(frame: Frame, omega: Any, z: Sequence[Any]) -> list[Any]:
    """F over a box of z, by the mean value theorem about its middle."""
    middle = [part.mid() for part in z]
    centre, matrix = frame.rates(omega, middle), frame.derivative(omega, z)
    away = [part - point for part, point in zip(z, middle, strict=True)]
    return [centre[row] + sum((matrix[row, k] * away[k] for k in range(3)), arb(0)) for row in range(3)]


def most(x: Any) -> Any:
    """A point no smaller than any |x| of the ball."""
    return abs(x).upper()


def least(x: Any) -> Any:
    """A point no larger than any x of the ball."""
    return x.lower()


def products(x: Sequence[Any], y: Sequence[Any]) -> tuple[Any, Any, Any]:
    """The three products x_i y_j - x_j y_i: us, uf, sf."""
    pairs = ((UNSTABLE, SLOW), (UNSTABLE, FAST), (SLOW, FAST))
    first, second, third = (x[i] * y[j] - x[j] * y[i] for i, j in pairs)
    return first, second, third


def enclosed_passage(frame: Frame, omega: Any, extents: Sequence[Fraction] = EXTENTS) -> Passage:
    """N with A, M and B over it, for a ball of speeds."""
    u, s, t = map(ball, extents)
    shells: list[Any] = [None] * _CELLS
    second, by_speed, stirred = None, [arb(0)] * 3, [arb(0)] * 3
    for shell, z in _cells(u, s, t):
        matrix, slopes = frame.derivative(omega, z), frame.derivative_by_speed(omega, z)
        shells[shell] = matrix if shells[shell] is None else _union(shells[shell], matrix)
        compound = _second_compound(matrix)
        second = compound if second is None else _union(second, compound)
        by_speed = [most(new).max(old) for old, new in zip(by_speed, slopes, strict=True)]
        if abs(z[FAST]) <= 2 * t / _FAST_CELLS:
            mixed = products(rates_over(frame, omega, z), slopes)
            stirred = [most(new).max(old) for old, new in zip(stirred, mixed, strict=True)]
    total, whole = arb_mat(3, 3), shells[0]
    for shell in shells:
        whole = _union(whole, shell)
        total += whole
    B = tuple(arb(0, part) for part in by_speed)
    return Passage(
        frame=frame,
        omega=omega,
        extents=(u, s, t),
        spread=whole,
        mean=total / _CELLS,
        second=second,
        by_speed=(B[0], B[1], B[2]),
        stirred=(stirred[0], stirred[1], stirred[2]),
        steep=(ball(STEEP[0]), ball(STEEP[1]), ball(STEEP[2])),
        compound=(ball(_COMPOUND[0]), ball(_COMPOUND[1])),
    )


def _cells(u: Any, s: Any, t: Any) -> Iterator[tuple[int, list[Any]]]:
    """Cells that cover the half z_u <= 0 of N; k - 1 for the least k such that (k / n) N meets the cell's inside."""
    n, m = _CELLS, _FAST_CELLS
    for i in range(n):
        for j in range(-n, n):
            for k in range(-m, m):
                shell = max(i, j if j >= 0 else -j - 1, (k if k >= 0 else -k - 1) * n // m)
                yield (
                    shell,
                    [
                        -u * hull(Fraction(i, n), Fraction(i + 1, n)),
                        s * hull(Fraction(j, n), Fraction(j + 1, n)),
                        t * hull(Fraction(k, m), Fraction(k + 1, m)),
                    ],
                )


def _second_compound(a: Any) -> Any:
    """The matrix C of b' = C b where DF is ``a``; b in the order us, uf, sf."""
    return arb_mat(
        [
            [a[UNSTABLE, UNSTABLE] + a[SLOW, SLOW], a[SLOW, FAST], -a[UNSTABLE, FAST]],
            [a[FAST, SLOW], a[UNSTABLE, UNSTABLE] + a[FAST, FAST], a[UNSTABLE, SLOW]],
            [-a[FAST, UNSTABLE], a[SLOW, UNSTABLE], a[SLOW, SLOW] + a[FAST, FAST]],
        ]
    )


def _union(x: Any, y: Any) -> Any:
    return arb_mat([[x[row, k].union(y[row, k]) for k in range(3)] for row in range(3)])
