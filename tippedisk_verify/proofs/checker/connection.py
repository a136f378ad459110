"""The limit cycles next to the connection of saddles: one for each speed above Omega_h, none at it or below.

z and N are those of `passage`, about the saddle (0, pi, 0); about (0, -pi, 0) N is the same box, moved. J is an
interval of speeds.

**The branch** of the unstable manifold of (0, -pi, 0) with growing gamma leaves N through z_u = u, flies, and arrives
on z_s = -s of the other N at p(Omega). At both ends of the interval claimed for Omega_h it is followed from a thin cone
at its saddle until it is in the cone |z_u| > flat max(|z_s|, |z_f|) at the other. So it leaves N through z_u = u at the
lower speed and through z_u = -u at the upper one. The height of the stable manifold's graph above p grows strictly with
the speed: so there is one Omega_h in J, between these two speeds. At any other speed of J the branch leaves N, with
gamma beyond the saddle's or falling.

**The map.** D is the part of z_s = -s with |z_f| <= t_0 and -eta <= z_u <= g. An orbit from D below the graph leaves N
through z_u = -u. By the point symmetry it goes on as one from z_u = u about the other saddle, and flies to z_s = -s:
the map R. All flights, from a box of exits, at all speeds of J, are enclosed cell by cell. Passage and flight together
contract, |DR| <= kappa < 1 in the norm max(|d_u|, |d_f| / w).

**Q** is the set beta_bar = 0, -c <= y_gamma < 0, -d <= v < 0. Fixed points of the half map in Q and of R in D below the
graph are the same orbits. The docstring of search/connection_end.py has the proof, inequality by inequality.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from typing import Any

from flint import arb, arb_mat

from tippedisk_verify.proofs.checker.passage import F, Passage, S, Saddle, U, ask, cones, hull, most, products
from tippedisk_verify.proofs.checker.steps import Flow, Piece, States, Unproved, column, exact_ball, need, positive
from tippedisk_verify.proofs.kernel.reading import MEASURED, count, decimal, dyadic, order

__all__ = ["CHOICES", "END", "FLIGHT", "End", "ReturnMap", "end_shown", "flown", "seen"]


def _number(value: Any) -> Any:
    return exact_ball(decimal(value))


FLIGHT = {"steps": count, "length": dyadic}
#: what an entry has besides the claim
CHOICES = {
    "directions": [[dyadic, 3], 3], "extents": [_number, 3], "cells": [order, 2], "steep": [_number, 3],
    "compound": [_number, 2], "flat": _number, "lipschitz": _number, "thin": _number, "return": _number,
    "drift": [_number, 3], "lid": _number, "fast": _number, "weight": _number, "moment": _number, "orders": [order, 2],
    "flights": [[FLIGHT, None], None],
    "branch": {"reach": dyadic, "cone": [dyadic, 2], "length": dyadic, "orders": [order, 2], "steps": [count, 2]},
}  # fmt: skip
#: the shape of an entry: J = [low, high], c, d and Omega_h, and the choices
END = {**dict.fromkeys(("low", "high", "gamma", "v"), decimal), "omega_h": MEASURED, **CHOICES}
_UPRIGHT = Fraction("1.5707")  # rad: beta_bar stays below, and so below pi/2


@dataclass(frozen=True)
class End:
    """What is shown: for each speed of (Omega_h, high] the half map has one fixed point in Q."""

    low: Fraction
    high: Fraction
    above: Fraction  #: Omega_h is lower [rad/s]
    gamma: Fraction  #: c [rad]
    v: Fraction  #: d [rad/s]

    def meets(self, omega: Any, gamma_bar: Any, v: Any) -> bool:
        """Whether a fixed point of the half map in these balls is the one in Q, at all speeds of the ball ``omega``."""
        above, high, c, d = map(exact_ball, (self.above, self.high, self.gamma, self.v))
        return positive(omega - above, high - omega, gamma_bar - arb.pi() + c, arb.pi() - gamma_bar, v + d, -v)


def end_shown(parameters: dict[str, str], entry: dict[str, Any]) -> End:
    """What an entry of the shape END shows of a disk, at the precision of the caller.

    Raises Unproved with the inequality that fails.
    """
    low, high, c, d = (Fraction(entry[name]) for name in ("low", "high", "gamma", "v"))
    omega_h, half = (Fraction(entry["omega_h"][name]) for name in ("value", "uncertainty"))
    need(0 < low < omega_h - half < omega_h + half < high and min(c, d, half) > 0, "claim: an interval is empty")
    n = Passage(Flow(parameters, exact_ball(low).union(exact_ball(high))), entry)
    for speed, sign, steps in zip((omega_h - half, omega_h + half), (1, -1), entry["branch"]["steps"], strict=True):
        try:
            _branch(n, Saddle(Flow(parameters, exact_ball(speed)), entry["directions"]), sign, steps, entry["branch"])
        except Unproved as fault:
            raise Unproved(f"the branch at the {'lower' if sign > 0 else 'upper'} speed: {fault}") from None
    ReturnMap(n, parameters, entry).shown()
    return End(low, high, omega_h + half, c, d)


def flown(
    saddle: Saddle, z: Sequence[Any], length: Any, orders: Sequence[int], count: int
) -> Iterator[tuple[Piece, list[Any], list[Any]]]:
    """The steps of a flight from z about (0, -pi, 0), with z and F about (0, pi, 0) over each of them."""
    directions = saddle.directions
    y = saddle.offset([part.mid() for part in z])
    start = [y[0], y[1] - arb.pi(), y[2]]
    middle = [part.mid() for part in start]
    states = States(
        column([*(part - part.mid() for part in z), saddle.flow.w - saddle.flow.w.mid()]),
        middle,
        [[*row, arb(0)] for row in directions.tolist()],
        [[int(i == j) for j in range(3)] for i in range(3)],
        [x - point for x, point in zip(start, middle, strict=True)],
        [[0] * 4] * 3,
    )
    for number in range(1, count + 1):
        try:
            piece = Piece(saddle.flow, states, length, orders, None)
            z = saddle.coordinates(piece.enclosure[:3])
            yield piece, z, saddle.field(z)[0]
            states = _next(piece)
        except Unproved as fault:
            raise Unproved(f"step {number}: {fault}") from None


def _next(piece: Piece) -> States:
    """The states at a step's end. The axes are the lead's for z_u and z_s, and that of v."""
    centre, lead, _ = piece.mapped(piece.length)
    middle, lead = centre.mid(), lead.mid()
    axes = arb_mat([[row[U], row[S], int(k == 2)] for k, row in enumerate(lead.tolist())])
    try:
        rest, spread = piece.carried(middle, lead, axes)
    except ZeroDivisionError:
        raise Unproved("its axes have no inverse") from None
    return States(piece.states.deviation, middle.entries(), lead, axes, rest.entries(), spread)


def seen(saddle: Saddle, piece: Piece, time: Any) -> list[Any]:
    """z about (0, pi, 0) of the states after ``time``, each in one sum over the set's own axes."""
    centre, lead, axes = piece.mapped(time)
    away = (saddle.inverse * lead) * piece.states.deviation + (saddle.inverse * axes) * piece.states.rest
    return [x + y for x, y in zip(saddle.coordinates(centre.entries()), away.entries(), strict=True)]


def _branch(n: Passage, saddle: Saddle, sign: int, count: int, given: dict[str, Any]) -> None:
    """Shown: the branch arrives above the graph of the stable manifold (sign 1), or below it (-1)."""
    (u, s, t), reach, (k_s, k_f) = n.extents, given["reach"], given["cone"]
    ask("the branch's cone", reach, k_s, k_f, u - reach, s - k_s * reach, t - k_f * reach)
    box = [reach, *(arb(0, most(k * reach)) for k in (k_s, k_f))]
    _, slopes, _ = saddle.field([arb(0, most(reach)), *box[1:]])
    ask("the branch's cone", *cones(slopes, (arb(1), k_s, k_f)))
    phase, length = 0, given["length"]
    for piece, z, rates in flown(saddle, box, length, given["orders"], count):
        beta, last = piece.enclosure[0], piece
        within = [extent - abs(x) for extent, x in zip(n.extents, z, strict=True)]
        # It flies, passes z_s = -s, and is in N.
        if positive(*within):
            phase = 2
            continue
        ask("beta_bar on the way", beta, exact_ball(_UPRIGHT) - beta)
        need(phase < 2, "it leaves N again")
        if phase or not positive(-z[S] - s):
            phase = 1
            ask("it passes z_s = -s into N", rates[S], within[U], within[F])
    need(phase == 2, "it does not come to N")
    z = seen(saddle, last, length)
    ask("it leaves N on the side claimed", sign * z[U] - n.flat * abs(z[S]).max(abs(z[F])))


class ReturnMap:
    """The inequalities of D, Q and R."""

    def __init__(self, n: Passage, parameters: dict[str, str], entry: dict[str, Any]) -> None:
        self.n, self.parameters, self.entry, self.lid, self.fast = n, parameters, entry, entry["lid"], entry["fast"]
        c, d = (exact_ball(entry[name]) for name in ("gamma", "v"))
        ask("the extents of D and Q and the weight w", self.lid, self.fast, c, d, entry["weight"])
        u, s, t = n.extents
        #: bounds of |g| on z_s = -s, and of |z_u| along the orbits of the graph from there
        edge = n.flat * s
        ask("D and the graph", n.thin * s - self.fast, s - self.fast, u - self.lid, self.lid - edge)
        ask("the fast part in N", n.stirred_within - n.forcing[1] - self.fast, s - n.forcing[1] - self.fast)
        self.time = n.time(self.lid + edge)
        ask("a passage takes time", self.time)
        crossing = n.crossing(self.lid, self.fast, entry["moment"])
        ask("crossings lie in Q", c - crossing * n.at_crossing(1), d - crossing * n.at_crossing(2))
        # Q = {-a by_gamma - b by_v: 0 < a <= c, 0 < b <= d}.
        by_gamma, by_v = ([n.inverse[k, j] for k in range(3)] for j in (1, 2))
        a, b = (arb(0).union(most(x)) for x in (c, d))
        corner = [most(a * x + b * y) for x, y in zip(by_gamma, by_v, strict=True)]
        ask("Q lies in N", *(extent - x for extent, x in zip(n.extents, corner, strict=True)))
        for x in (by_gamma, by_v):
            ask("Q lies below the graph", x[U] - n.flat * abs(x[S]).max(abs(x[F])))
        ask("the sign of z_s in Q", by_gamma[S])
        # Where orbits from D and Q leave N: z_s about the saddle that they fly from, and |z_f|.
        time = n.time(corner[U] + n.flat * corner[S].max(corner[F]))
        (slow, fast), (slow_q, fast_q) = n.fallen(s, self.fast, self.time), n.fallen(corner[S], corner[F], time)
        back, _ = n.fallen(d * abs(by_v[S]), self.fast, time)
        self.exits, self.exit_fast = (-back, slow.max(slow_q)), arb(0, fast.max(fast_q))
        self.leaving = [-u, (-self.exits[0]).union(-self.exits[1]), self.exit_fast]
        ask("beta_bar where N is left", -n.offset(self.leaving)[0])
        ask("gamma where N is left upwards", n.offset([u, arb(0, most(s)), arb(0, most(t))])[1])
        ask("the saddles' boxes are apart", 2 * arb.pi() * n.inverse[S, 1] - 2 * s)

    def shown(self) -> None:
        n, w = self.n, self.entry["weight"]
        (u, s, _), (k_u, k_s, k_f), (k_1, k_2) = n.extents, n.steep, n.compound
        (unstable, *by_u), (fast, *by_f), (_, *by_t), (beta, *by_b) = self._arrivals()
        ask("arrivals in D", unstable + self.lid, u - abs(unstable), self.fast - abs(fast))
        entered = [(-self.lid).union(n.flat * s), -s, arb(0, most(self.fast))]
        entering, speed = n.rates(entered), -n.rates(self.leaving)[U]
        ask("orbits enter N and leave it", entering[S], speed)

        def returned(d: Sequence[Any]) -> list[Any]:
            """Bounds of the variation after one round."""
            slow, fast = (x / speed for x in n.settled(products(entering, d), self.time))
            return [most(abs(row[0]) * slow + abs(row[1]) * fast) for row in (by_u, by_f)]

        both = returned([arb(0, 1), arb(0), arb(0, most(w))])
        kappa = both[0].max(most(both[1] / w))
        ask("R contracts", 1 - kappa * (1 + n.lipschitz * w))
        ask("the cone on entry", k_1 * entering[S] - abs(entering[F]))
        ratio = n.ratio(self.time)
        height = n.lipschitz * (abs(by_f[0]) + abs(by_f[1]) * ratio)
        ask("heights grow downwards", -by_u[0] - abs(by_u[1]) * ratio - height)
        moved = [row[0] * arb(0, most(k_s)) + row[1] * arb(0, most(k_f)) + row[2] for row in (by_u, by_f)]
        ask("the branch's arrivals fall", -moved[0] - k_u, -moved[0] - k_u / k_f * abs(moved[1]))
        # The derivatives of the fixed point of R by the speed.
        first, second = returned([arb(1), arb(0), arb(0)]), returned([arb(0), arb(0), arb(1)])
        drift = [arb(0, most(x / speed)) for x in n.drift[:2]]
        rest = [row[0] * drift[0] + row[1] * drift[1] + row[2] for row in (by_u, by_f)]
        own = 1 - second[1]
        ask("1 - DR is regular", own)
        slope, offset = first[1] / own, abs(rest[1]) / own
        room = 1 - first[0] - second[0] * slope
        falls, away = -rest[0], second[0] * offset
        ask("the cycle's entry falls", room, falls - away)
        slowest, fastest = ((falls - away) / (1 + second[0] * slope)).lower(), ((falls + away) / room).upper()
        share = arb(0, most(slope + offset / slowest))
        ask("the cone of the derivative", slowest - k_u, k_f - k_u * abs(share))
        twisted = abs(entering[U] * share - entering[F])
        ask("the compound's cone of the derivative", k_1 * entering[S] - twisted, k_2 - abs(share))
        row = [n.directions[1, k] for k in range(3)]
        ask("gamma_bar_0 falls", row[U] - (abs(row[S]) * k_s + abs(row[F]) * k_f) / k_u)
        b = n.settled([x * fastest for x in products(entering, (arb(1), arb(0), share))], self.time)
        exits = [arb(0).union(b[0] / speed) + drift[0], arb(0, most(b[1] / speed)) + drift[1], arb(1)]
        gained = (slowest * (n.grows[0] * self.time).exp() / speed).lower()
        ask("the period falls", gained - abs(sum(x * y for x, y in zip(by_t, exits, strict=True))))
        ask("beta_max falls", -sum(x * y for x, y in zip(by_b, exits, strict=True)))
        inside = n.offset([arb(0, most(u)), arb(0, most(s)), arb(0, most(n.forcing[1] + self.fast))])[0]
        ask("beta_max is in the flight", beta - abs(inside))

    def _arrivals(self) -> list[list[Any]]:
        """What holds for all flights from the exits, at all speeds."""
        rows, arrivals = self.entry["flights"], []
        need(bool(rows) and all(rows), "there are no flights")
        low, high = (Fraction(self.entry[name]) for name in ("low", "high"))
        for i, row in enumerate(rows):
            ends = [exact_ball(low + (high - low) * Fraction(i + k, len(rows))) for k in (0, 1)]
            saddle = Saddle(Flow(self.parameters, ends[0].union(ends[1])), self.entry["directions"])
            least, largest = self.exits
            for j, given in enumerate(row):
                ends = [least + (largest - least) * (j + k) / len(row) for k in (0, 1)]
                try:
                    arrivals.append(self.flight(saddle, ends[0].union(ends[1]), given))
                except Unproved as fault:
                    raise Unproved(f"flight {i + 1} {j + 1}: {fault}") from None
        return reduce(lambda a, b: [hull(x, y) for x, y in zip(a, b, strict=True)], arrivals)

    def flight(self, saddle: Saddle, slow: Any, given: dict[str, Any]) -> list[list[Any]]:
        """Of the flights from a cell of exits to z_s = -s: z_u, z_f and the time there, and the largest beta_bar.

        Each has its derivatives by z_s, z_f and the speed besides.
        """
        u, s, _ = self.n.extents
        tops: list[list[Any]] = []
        count, length = given["steps"], given["length"]
        steps = flown(saddle, [u, slow, self.exit_fast], length, self.entry["orders"], count)
        for number, (piece, z, rates) in enumerate(steps, 1):
            beta, _, v = piece.enclosure[:3]
            ask("beta_bar in the flight", beta, exact_ball(_UPRIGHT) - beta)
            if not (positive(v) or positive(-v)):
                # beta_bar is largest where v = 0: there its derivatives are those at a fixed time.
                ask("v passes zero once", -saddle.flow.rates(piece.enclosure[:3])[0][2])
                by = piece.derivatives(arb(0).union(length))
                tops.append([beta, *(by[0, k] for k in (1, 2, 3))])
            if number == count:
                break
            level = -seen(saddle, piece, length)[S] - s
            need(positive(level) and (positive(rates[S]) or positive(-z[S] - s)), "it is not shown to be on its way")
        need(bool(tops), "beta_bar has no largest value on the way")
        # The moment of arrival, by the mean value theorem about the middle of the last step.
        middle, rate = length / 2, rates[S]
        level = seen(saddle, piece, middle)[S] + s
        for _ in range(2):
            ask("it passes z_s = -s once", rate)
            time = middle - level / rate
            ask("it arrives in its last step", time, length - time)
            rate = saddle.field(seen(saddle, piece, time.union(middle)))[0][S]
        z = seen(saddle, piece, time)
        z[S] = -s
        rates, _, _ = saddle.field(z)
        ask("it arrives", rates[S])
        rows = saddle.inverse * piece.derivatives(time)
        by_time = [-rows[S, k] / rates[S] for k in (1, 2, 3)]
        by_u, by_f = ([rows[i, k] + rates[i] * by_time[k - 1] for k in (1, 2, 3)] for i in (U, F))
        return [[z[U], *by_u], [z[F], *by_f], [(count - 1) * length + time, *by_time], reduce(hull, tops)]
