"""The end of the family of limit cycles at the heteroclinic cycle: one cycle for each speed above Omega_h (linear law).

Notation as in `passage`, about the saddle (0, pi, 0) in shifted angles; S is x -> -x, and the field is odd about each
saddle. All speeds lie in one closed interval J = [Omega_0, Omega_1], which holds the interval I of Theorem 6
(`heteroclinic`).

**The map R.** D(Omega) is the set of all z with z_s = -s, |z_f| <= t_0 and -eta <= z_u <= g. An orbit from D that
starts below the graph g leaves N through z_u = -u, after T seconds, T >= `passage.time`. Bounds of its |z_s| and |z_f|
there give the *exit set*. S takes the exit to -z about the first saddle, and the flight from there reaches z_s = -s
about the second one (`connection_flight`): R(z) is where it does. Where an orbit starts nearer and nearer to the graph,
T grows, and its exit tends to that of the branch of the unstable manifold: an orbit that has always been in N lies on
it. So R is continuous on D with R = p(Omega) on the graph, p the branch's arrival. Elsewhere it is analytic. All R(z)
have z_u > -eta and |z_f| < t_0.

**Contraction.** Let |d| = max(|d_u|, |d_f| / w) on the section. The second compound b of the flow and a variation d is
F x d there, falls during the passage, and gives the variation at the exit, d_s = b_us / F_u, d_f = b_uf / F_u; then
the derivatives of the flight act. So |DR d| <= kappa |d|, kappa < 1. In the metric "length of the shortest path in D"
R shortens paths by kappa: a path that touches the graph, where R is only continuous, is the limit of paths a little
below it. If moreover d = (-1, 0) then b_us > 0 and |b_uf| <= k b_us to the end, so that (d_u, d_f) on
arrival has d_u < 0 and |d_u| > L |d_f|, L the graph's constant. With h = g - z_u, the height below the graph: h(R(z))
grows strictly as z goes down on a line of constant z_f.

**Omega_h.** Two speeds' arrivals p differ by a vector of the cone of `Passage.steep` with p_u falling in Omega: their
exits differ by no more than (k_s, k_f) per rad/s, and the flight's derivatives do the rest. So h(p(Omega)) grows
strictly in J, and its sign changes between the ends of J: there the bound |g| <= k s of `Passage.flat` tells on which
side of the graph the branch arrives. At the Omega_h of Theorem 6 the branch is followed from z_s = -s to the box in
which that theorem lets it stay and converge; |z_u| < u all along, so it stays in N, and h(p(Omega_h)) = 0. It is the
only such speed in J, also where that theorem says "at least one".

- *Omega >= Omega_h*: h(R(z)) >= h(p) >= 0, so R maps D into D, and has exactly one fixed point in D (Banach). If Omega
  > Omega_h, it is not on the graph, because R(graph) = p is below it.
- *Omega <= Omega_h*: if z is a fixed point below the graph and z' the graph's point with the same z_f, then h(z) =
  h(R(z)) <= h(p) + (1 + L w) kappa |z - z'| < h(z). There is none.

A fixed point below the graph is a periodic orbit that S maps to itself; DR there has norm at most kappa, so it is
asymptotically stable.

**The statement** is about the half map P of `section` on the box Q = {beta_bar = 0, -c <= y_g < 0, -d <= v < 0}. Q lies
in N, below the graph, and in the set K of `passage`. So an orbit from Q has beta_bar < 0 until it leaves N through z_u
= -u, and then in the flight up to its arrival R on z_s = -s: the bounds of the exit set hold for it too. *If P(x) = x*
for an x in Q, the orbit's arrival lies below the graph. (If it were above or on it, the orbit would leave N through z_u
= u or not at all. At a first crossing of beta_bar = 0 in N it would be in Q, below the graph; and after z_u = u it has
y_g > 0, and gamma grows as long as beta_bar > 0.) So the arrival is a fixed point of R in D. *If R(z) = z below the
graph*, beta_bar changes its sign in N. When it is first 0, v <= 0; the orbit is in the thin set of `passage`, so v < 0
and y_g < 0: it is in K, and beta_bar < 0 from then on. |z_u| and |z_s| there, bounded by growth and decay from either
side of a moment t*, put the crossing into Q. So fixed points of P in Q and of R below the graph are the same orbits.

**Monotony.** Let z(Omega) be the fixed point; it is analytic, z' = (1 - DR)^-1 dR/d(Omega), with 0 <= R_uu <= kappa_u
and dR/d(Omega) at fixed z from `Passage.drift` and the flight. So z_u' < 0, and d = (z_u', 0, z_f') is in the cone of
`Passage.steep` with the speed's part 1: it stays there and d_u grows.

- gamma_bar_0 falls: where beta_bar = 0, gamma' = 0, and its derivative by Omega is that at fixed time, with d_u's sign.
- T falls: the passage's time has the derivative -d_u / F_u at the exit, both negative; this is larger than the
  derivative of the flight's time.
- beta_max falls: |beta_bar| is largest in the flight, with derivatives by (z_s, z_f, Omega) at its start.

**As Omega falls to Omega_h.** h(z) <= h(p(Omega)) + (1 + L w) kappa h(z) for the fixed point z, and h(p(Omega)) tends
to 0, as p and g are continuous. So h(z) tends to 0 and T to infinity, by `Passage.time`. Let c be a limit of the
crossings of beta_bar = 0, and suppose it is not the saddle. It is in the thin set, so z_u, y_g and v are negative
there. If the times from D to the crossings stayed bounded along a subsequence, c would be on the graph of the stable
manifold; but all of the quadrant y_g < 0, v < 0 of beta_bar = 0 lies below it, as Q does. If they grow without bound,
the orbit of c has been in N for ever, so c is on the unstable manifold's branch with z_u < 0. That leaves the saddle
along -(l, Omega, l^2), l = lambda_u, into the inside of K, and beta_bar < 0 on it from then on in N. So c is the
saddle.

Where a ball becomes a point or a float: eta, t_0, w, t*, c, d and the cells of the exit set are chosen.

Sources: L. P. Shilnikov, Mat. Sb. 61 (1963); Yu. A. Kuznetsov, Elements of Applied Bifurcation Theory, Section 6.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from flint import arb

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import exact, shown
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.closed_forms import refuse_past_birth
from tippedisk_verify.proofs.kernel.balls import ball, ball_constants, hull, positive, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.connection_flight import Landing, fly_over, joined
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection
from tippedisk_verify.proofs.search.local_manifolds import FAST, SLOW, UNSTABLE, Frame
from tippedisk_verify.proofs.search.passage import Passage, enclosed_passage, least, most, products
from tippedisk_verify.proofs.search.proved_end import ProvedEnd, Status

__all__ = ["checked_distance", "prove_end"]

_BITS = 64
_FAST = Fraction(1, 512)  # t_0
_WEIGHT = Fraction(1, 4)  # w
_SLOW_CELL, _SPEED_CELL = 4e-3, 2e-3  # lengths of the exit set's cells in z_s and in Omega [rad/s]
_ROOM = 1.01  # eta over what the bounds of the largest speed's orbit leave it
_WIDENED = 0.15  # by how much of a cell's image its enclosure is wider; measured
_ROUNDS = 60
_LONGEST = 3.0  # s, from the first saddle to Theorem 6's box


def prove_end(
    connection: ProvedConnection,
    reach: object = "0.008",
    below: object = "0.0015",
    watch: Callable[[float], None] = lambda share: None,
) -> ProvedEnd:
    """Prove the cycles from the ``connection`` that is proved up to ``reach`` above it, and that ``below`` it is none.

    Both [rad/s] count from Omega_h rounded to four decimals. ``watch`` is called with the share of the flights that is
    done. Raises InputError for the smooth law and for numbers that make no sense, NoConnectionError as `Frame`.
    """
    parameters, omega_h = connection.parameters, connection.omega_h
    above, under = checked_distance(reach), checked_distance(below)
    if not connection.proved or parameters is None or omega_h is None:
        return ProvedEnd(Status.NO_CONNECTION, connection, Fraction(0), Fraction(0))
    parameters.refuse_smooth("the cycles next to the connection are proved")
    near = round(omega_h.value, 4)
    low, high = near - under, near + above
    if not low < omega_h.value - omega_h.uncertainty < omega_h.value + omega_h.uncertainty < high:
        raise InputError("Omega_h is not between the ends: give larger numbers")
    refuse_past_birth(parameters, high)
    with working_precision(_BITS):
        return _End(parameters, connection, low, high, watch).prove()


def checked_distance(number: object) -> Fraction:
    """A distance from Omega_h [rad/s]; raises InputError unless it is between 0 and 1."""
    given = exact(number)
    if given.pi_multiple or not 0 < given.rational < 1:
        raise InputError(f"how far cycles are to be proved is a decimal between 0 and 1 rad/s, not {shown(number)}")
    return given.rational


@dataclass(frozen=True)
class _Bounds:
    """What bounds the passages: made before the flights."""

    eta: Any
    time: Any  #: no passage from D is shorter [s]
    gamma: Fraction  #: c
    v: Fraction  #: d
    slow: tuple[Any, Any]  #: least and largest z_s of the exit set, about the saddle that is left
    fast: Any  #: largest |z_f| there


class _End:
    """One proof, at the working precision."""

    def __init__(
        self, parameters: Parameters, connection: ProvedConnection, low: Fraction, high: Fraction, watch: Any
    ) -> None:
        self.parameters, self.connection, self.low, self.high, self.watch = parameters, connection, low, high, watch
        self.constants = ball_constants(parameters)
        assert connection.omega_h is not None
        self.frame = Frame(parameters, connection.omega_h.value)
        self.passage: Passage = enclosed_passage(self.frame, hull(low, high))
        self.u, self.s, _ = self.passage.extents
        self.t_0, self.weight = ball(_FAST), ball(_WEIGHT)

    def prove(self) -> ProvedEnd:
        failing = _failing(self.passage.slacks())
        if failing:
            return self._failed(Status.INEQUALITY, failing)
        guess = self._fly(ball(self.high), arb(0), arb(0))
        if guess is None:
            return self._failed(Status.FLIGHT)
        eta = self._lid(guess)
        if eta is None:
            return self._failed(Status.NO_LID)
        bounds = self._bounds(eta)
        failing = _failing(self._starts(bounds))
        if failing:
            return self._failed(Status.INEQUALITY, failing)
        landing = self._flights(bounds)
        if landing is None:
            return self._failed(Status.FLIGHT)
        numbers: dict[str, str] = {}
        failing = _failing(self._ends(bounds, landing, numbers)) or _failing(self._sides())
        if failing:
            return self._failed(Status.INEQUALITY, failing)
        if not self._connected():
            return self._failed(Status.APART)
        return ProvedEnd(Status.PROVED, self.connection, self.low, self.high, bounds.gamma, bounds.v, numbers)

    def _failed(self, status: Status, detail: str = "") -> ProvedEnd:
        return ProvedEnd(status, self.connection, self.low, self.high, detail=detail)

    def _fly(self, omega: Any, slow: Any, fast: Any) -> Landing | None:
        flown = fly_over(self.frame, Model(self.constants, omega), (self.u, self.s), slow, fast)
        return flown[0] if flown else None

    def _lid(self, guess: Landing) -> Any:
        """eta: a little more than the bounds leave of |z_u| after one round at the largest speed; None if none does."""
        arrival, slope = float(most(guess.unstable)), float(most(guess.unstable_by[0]))
        wide = (slope * _SLOW_CELL + float(most(guess.unstable_by[2])) * _SPEED_CELL) * _WIDENED
        eta = arrival
        for _ in range(_ROUNDS):
            if eta > float(self.u) / 2:
                return None
            eta = _ROOM * (arrival + slope * float(self._bounds(ball(eta)).slow[1]) + wide)
        return ball(eta)

    def _bounds(self, eta: Any) -> _Bounds:
        p = self.passage
        edge = p.flat * self.s  # of |g| on the section, and of |z_u| along the orbits of its graph: there |z_f| < s
        time = p.time(eta + edge)
        crossing = self._crossing(eta + edge, edge)
        share, fast = p.at_crossing()
        rows = [[self.frame.directions[row, k] for k in range(3)] for row in (1, 2)]
        c, d = (_decimal_above(crossing * (row[0] + row[1] * share + row[2] * fast)) for row in rows)
        _, by_v = self._columns()
        corner = [most(part) for part in self._box_of_starts(c, d)]
        distance = corner[UNSTABLE] + p.flat * corner[SLOW].max(corner[FAST])
        slow_d, fast_d = p.fallen(self.s, self.t_0, time)
        slow_q, fast_q = p.fallen(corner[SLOW], corner[FAST], p.time(distance))
        back, _ = p.fallen(ball(d) * abs(by_v[SLOW]), self.t_0, p.time(distance))
        return _Bounds(eta, time, c, d, (-back, slow_d.max(slow_q)), fast_d.max(fast_q))

    def _columns(self) -> tuple[list[Any], list[Any]]:
        """z = -a (first) - b (second) where beta_bar = 0, y_g = -a, v = -b."""
        return [self.frame.inverse[row, 1] for row in range(3)], [self.frame.inverse[row, 2] for row in range(3)]

    def _box_of_starts(self, c: Fraction, d: Fraction) -> list[Any]:
        """A box of z that holds Q."""
        return [-hull(0, c) * x - hull(0, d) * y for x, y in zip(*self._columns(), strict=True)]

    def _crossing(self, distance: Any, edge: Any) -> Any:
        """A bound of |z_u| where an orbit from D has beta_bar = 0; ``distance`` and ``edge`` bound |d_u| and |z_u| of
        the graph's orbit at the start.
        """
        p = self.passage
        share, _ = p.at_crossing()

        def both(moment: Any) -> tuple[Any, Any]:
            early = distance * (p.growth[1] * moment).exp() + edge
            late = p.fallen(self.s, self.t_0, moment)[0] / share.lower()
            return most(early), most(late)

        low, high = 0.0, 1.0
        for _ in range(_ROUNDS):
            middle = (low + high) / 2
            early, late = both(ball(middle))
            low, high = (middle, high) if early < late else (low, middle)
        early, late = both(ball(low))
        return early.max(late)

    def _starts(self, bounds: _Bounds) -> Iterator[tuple[str, Any]]:
        """What is asked of D and Q before the flights."""
        p = self.passage
        for extent, part in zip(p.extents, self._box_of_starts(bounds.gamma, bounds.v), strict=True):
            yield "Q lies in N", extent - abs(part)
        by_gamma, by_v = self._columns()
        for column in (by_gamma, by_v):
            yield "Q lies below the graph", column[UNSTABLE] - p.flat * abs(column[SLOW]).max(abs(column[FAST]))
        yield "the sign of z_s in Q", by_gamma[SLOW]
        yield "a passage takes time", bounds.time
        yield "D lies in the thin set", p.thin * self.s - self.t_0
        yield "D lies in N", self.u - bounds.eta
        yield "the graph lies above the lid", bounds.eta - p.flat * self.s
        yield "the fast part in N", p.stirred_within - p.forcing[1] - self.t_0
        yield "the fast part in N", self.s - p.stirred_within
        beta, _, _ = self.frame.offset([-self.u, -hull(*bounds.slow), arb(0, bounds.fast)])
        yield "beta_bar where N is left", -beta
        _, gamma, _ = self.frame.offset([self.u, arb(0, self.s), arb(0, p.extents[FAST])])
        yield "gamma where N is left upwards", gamma

    def _flights(self, bounds: _Bounds) -> Landing | None:
        """All flights from the exit set at all speeds, cell by cell."""
        least_slow, most_slow = measured(bounds.slow[0].lower()).value, measured(bounds.slow[1].upper()).value
        cells = [
            (omega, slow)
            for omega in _pieces(self.low, self.high, _SPEED_CELL)
            for slow in _pieces(least_slow, most_slow, _SLOW_CELL)
        ]
        landings = []
        for done, (omega, slow) in enumerate(cells):
            landing = self._fly(omega, slow, arb(0, bounds.fast))
            if landing is None:
                return None
            landings.append(landing)
            self.watch((done + 1) / len(cells))
        return joined(landings)

    def _ends(self, bounds: _Bounds, landing: Landing, numbers: dict[str, str]) -> Iterator[tuple[str, Any]]:
        """What is asked of R; sizes go into ``numbers``."""
        p, w = self.passage, self.weight
        yield "arrivals above the lid", landing.unstable + bounds.eta
        yield "arrivals in N", self.u - abs(landing.unstable)
        yield "the fast part of arrivals", self.t_0 - abs(landing.fast)
        entry = p.rates([hull(-bounds.eta, p.flat * self.s), -self.s, arb(0, self.t_0)])
        leave = p.rates([-self.u, -hull(*bounds.slow), arb(0, bounds.fast)])
        speed, quickest = least(-leave[UNSTABLE]), most(leave[UNSTABLE])
        yield "orbits enter N", entry[SLOW]
        yield "orbits leave N", speed
        (m_us, m_uf, m_uo), (m_fs, m_ff, m_fo) = landing.unstable_by, landing.fast_by

        def returned(d: Sequence[Any]) -> tuple[Any, Any]:
            """Bounds of |d_u| and |d_f| after one round."""
            b = p.settled(p.norm(products(entry, d)), bounds.time)
            slow, fast = (part / speed for part in b)
            return most(abs(m_us) * slow + abs(m_uf) * fast), most(abs(m_fs) * slow + abs(m_ff) * fast)

        both = returned([arb(0, 1), arb(0), arb(0, w)])
        kappa = both[0].max(most(both[1] / w))
        numbers |= {name: f"{float(x):.4g}" for name, x in (("kappa", kappa), ("eta", bounds.eta), ("T", bounds.time))}
        yield "R contracts", 1 - kappa
        yield "R contracts heights", 1 - kappa * (1 + p.lipschitz * w)
        k_1, _ = p.compound
        yield "the cone on entry", k_1 * entry[SLOW] - abs(entry[FAST])
        ratio = p.ratio(bounds.time)
        height = p.lipschitz * (abs(m_fs) + abs(m_ff) * ratio)
        yield "heights grow downwards", -m_us - abs(m_uf) * ratio - height
        # The arrivals of the branch.
        k_u, k_s, k_f = p.steep
        moved_u = m_us * arb(0, k_s) + m_uf * arb(0, k_f) + m_uo
        moved_f = m_fs * arb(0, k_s) + m_ff * arb(0, k_f) + m_fo
        yield "the branch's arrivals fall", -moved_u - k_u
        yield "the branch's arrivals fall", -moved_u - k_u / k_f * abs(moved_f)
        yield from self._monotony(bounds, landing, entry, (speed, quickest), returned)

    def _sides(self) -> Iterator[tuple[str, Any]]:
        """The branch arrives above the graph at the least speed, and below it at the largest one."""
        slow, fast = self.passage.forcing  # what has been in N for ever has fallen so far
        reach = measured(slow).value
        for speed, side in ((self.low, 1), (self.high, -1)):
            for exit_ in _pieces(-reach, reach, _SLOW_CELL):
                landing = self._fly(ball(speed), exit_, arb(0, fast))
                arrival = arb.nan() if landing is None else landing.unstable
                yield "the branch arrives on either side of the graph", side * arrival - self.passage.flat * self.s

    def _monotony(
        self, bounds: _Bounds, landing: Landing, entry: Sequence[Any], speeds: Any, returned: Callable[..., Any]
    ) -> Iterator[tuple[str, Any]]:
        """The signs of the derivatives by Omega along the cycles."""
        p = self.passage
        (k_u, k_s, k_f), (k_1, k_2), (speed, quickest) = p.steep, p.compound, speeds
        # The columns of DR, and dR/d(Omega) at a fixed start.
        first, second = returned([arb(1), arb(0), arb(0)]), returned([arb(0), arb(0), arb(1)])
        drift = [arb(0, most(part / speed)) for part in p.drift[:2]]
        rest_u, rest_f = (
            row[0] * drift[0] + row[1] * drift[1] + row[2] for row in (landing.unstable_by, landing.fast_by)
        )
        # |z_f'| <= slope |z_u'| + offset by the second row, and the first one then bounds |z_u'|.
        own = 1 - second[1]
        yield "1 - DR is regular", own
        slope, offset = first[1] / own, abs(rest_f) / own
        room = 1 - first[0] - second[0] * slope
        yield "1 - DR is regular", room
        falls, away = -rest_u, second[0] * offset
        yield "the cycle's entry falls", falls - away
        slowest, fastest = least((falls - away) / (1 + second[0] * slope)), ((falls + away) / room).upper()
        share = arb(0, most(slope + offset / slowest))  # z_f' / z_u'
        yield "the cone of the derivative", slowest - k_u
        yield "the cone of the derivative", k_f - k_u * abs(share)
        yield "the compound's cone of the derivative", k_1 * entry[SLOW] - abs(entry[UNSTABLE] * share - entry[FAST])
        yield "the compound's cone of the derivative", k_2 - abs(share)
        row = [self.frame.directions[1, k] for k in range(3)]
        yield "gamma_bar_0 falls", row[UNSTABLE] - (abs(row[SLOW]) * k_s + abs(row[FAST]) * k_f) / k_u
        # The exit's derivatives, about the saddle that is left.
        b = p.settled(p.norm(products(entry, (arb(1), arb(0), share))) * fastest, bounds.time)
        slow = hull(0, b[0] / speed) + drift[0]
        fast = arb(0, most(b[1] / speed)) + drift[1]
        gained = slowest * (p.growth[0] * bounds.time).exp() / quickest
        by = landing.time_by
        yield "the period falls", gained - abs(by[0] * slow + by[1] * fast + by[2])
        by = landing.beta_most_by
        yield "beta_max falls", -(by[0] * slow + by[1] * fast + by[2])
        inside, _, _ = self.frame.offset([arb(0, self.u), arb(0, self.s), arb(0, p.forcing[1] + self.t_0)])
        yield "beta_max is in the flight", landing.beta_most - abs(inside)

    def _connected(self) -> bool:
        """Whether the connection of Theorem 6 stays in N from z_s = -s on."""
        p, room, omega_h = self.passage, self.connection.room, self.connection.omega_h
        if room is None or omega_h is None:
            return False
        speeds = hull(omega_h.value - omega_h.uncertainty, omega_h.value + omega_h.uncertainty)
        slow, fast = (arb(0, part) for part in p.forcing)  # what has been in N for ever has fallen so far
        flown = fly_over(self.frame, Model(self.constants, speeds), (self.u, self.s), slow, fast)
        box = self.frame.coordinates([arb(0, ball(extent).upper()) for extent in room])
        if flown is None or not positive(self.u - abs(box[UNSTABLE])):
            return False
        path = flown[1]
        while path.time < _LONGEST:
            step = path.step()
            if step is None:
                return False
            beta, gamma, v = step.enclosure
            z = self.frame.coordinates((beta, gamma - arb.pi(), v))
            if not (positive(self.u - abs(z[UNSTABLE])) and positive(beta)):
                return False
            path.take(step)
            if positive(path.box[1] - arb.pi() + ball(room.gamma)):
                return True
        return False


def _failing(slacks: Iterator[tuple[str, Any]]) -> str:
    """The first inequality that is not proved, with its ball; empty if all are."""
    for name, slack in slacks:
        if not positive(slack):
            return f"{name}: {slack.str(4)} is not proved to be positive"
    return ""


def _pieces(low: Fraction, high: Fraction, length: float) -> list[Any]:
    """Balls that cover the interval."""
    count = math.ceil(float(high - low) / length)
    ends = [low + (high - low) * k / count for k in range(count + 1)]
    return [hull(a, b) for a, b in pairwise(ends)]


def _decimal_above(x: Any) -> Fraction:
    """A multiple of 1/1000 that no number of the ball is above."""
    enclosure = measured(x)
    return Fraction(math.ceil((enclosure.value + enclosure.uncertainty) * 1000), 1000)
