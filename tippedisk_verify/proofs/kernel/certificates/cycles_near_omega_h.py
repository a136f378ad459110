"""The limit cycles next to the connection: one for each speed above Omega_h, none at it or below.

The friction law is linear. The notation is that of `saddle_passage`, about the saddle (0, pi, 0) in
shifted angles. S is x -> -x, and the field is odd about each saddle. All speeds lie in one closed
interval J, which holds the interval of Omega_h. A message of refusal begins with the number of the
part of the proof of Theorem 7a (docs/certified_connection.md) that fails.

The map R (7a.1)
----------------
D is the set of all z with

    z_s = -s,   |z_f| <= t_0,   -eta <= z_u <= g.

An orbit from D that starts below the graph g leaves N through z_u = -u after T seconds, T >=
`SaddlePassage.min_passage_time`. Bounds of its |z_s| and |z_f| there give the *exit set*. S takes
the exit to -z about the first saddle. The flight from there (`saddle_passage`) reaches z_s = -s
about the second saddle, at the point R(z).

If the start tends to the graph, T grows. The exit tends to that of the branch of the unstable
manifold, because an orbit that has always been in N lies on it. So R is continuous on D with R = p
on the graph, where p is the branch's arrival. Elsewhere it is analytic. All R(z) have z_u > -eta
and |z_f| < t_0.

Contraction (7a.2)
------------------
Let |d| = max(|d_u|, |d_f| / w) on the section. The second compound b of the flow and a variation d
is F x d there. It falls during the passage, and gives the variation at the exit, d_s = b_us / F_u,
d_f = b_uf / F_u. Then the derivatives of the flight act. So

    |DR d| <= kappa |d|,   kappa < 1.

In the metric "length of the shortest path in D" R shortens paths by kappa. On the graph R is only
continuous, but a path that touches it is the limit of paths a little below it.

Heights (7a.3)
--------------
If moreover d = (-1, 0), then b_us > 0 and |b_uf| <= k b_us to the end. So (d_u, d_f) on arrival has
d_u < 0 and |d_u| > L |d_f|, where L is the graph's Lipschitz constant. Let h = g - z_u be the
height below the graph. Then h(R(z)) grows strictly as z goes down on a line of constant z_f.

Omega_h (7a.3)
--------------
Two speeds' arrivals p differ by a vector of the cone of the steep weights, with p_u falling in the
speed. Indeed, their exits differ by at most (k_s, k_f) per rad/s, and the flight's derivatives act
on that. So h(p) grows strictly in J.

At the connection of `connection` the branch is followed from z_s = -s to its final box, where it
converges. |z_u| < u all along, so it stays in N, and h(p) = 0. That is the only such speed in J,
Omega_h, also where `connection` says "at least one". At any other speed of J the branch leaves N,
with gamma beyond the saddle's or falling. At Omega_h beta_bar > 0 all along.

- *Omega >= Omega_h*: h(R(z)) >= h(p) >= 0, so R maps D into D, and has exactly one fixed point in D
  (Banach). If Omega > Omega_h, it is not on the graph, because R(graph) = p is below it.
- *Omega <= Omega_h*: Let z be a fixed point below the graph and z' the graph's point with the same
  z_f. Then h(z) = h(R(z)) <= h(p) + (1 + L w) kappa |z - z'| < h(z), a contradiction.

A fixed point below the graph is a periodic orbit that S maps to itself. DR there has norm at most
kappa, so it is asymptotically stable.

The statement about P and Q (7a.4)
----------------------------------
It is about the half map P from the section beta_bar = 0, v < 0 to itself, on the box

    Q = {beta_bar = 0, -c <= y_g < 0, -d <= v < 0}.

Q lies in N, below the graph, and in the set K of `saddle_passage`. So an orbit from Q has beta_bar
< 0 until it leaves N through z_u = -u. This stays so in the flight up to its arrival R on z_s = -s.
The bounds of the exit set hold for it too.

*If P(x) = x* for an x in Q, the orbit's arrival lies below the graph. Otherwise the orbit would
leave N through z_u = u or not at all. At a first crossing of beta_bar = 0 in N it would be in Q,
below the graph. After z_u = u it has y_g > 0, and gamma grows as long as beta_bar > 0. So the
arrival is a fixed point of R in D.

*If R(z) = z below the graph*, beta_bar changes its sign in N. When it is first 0, v <= 0. The orbit
is in the thin set of `saddle_passage`, so v < 0 and y_g < 0: it is in K, and beta_bar < 0 from then
on. |z_u| and |z_s| there are bounded by growth and decay from either side of a moment t*. These
bounds put the crossing into Q.

So fixed points of P in Q and of R below the graph are the same orbits.

Monotony (7a.5)
---------------
Let z(Omega) be the fixed point. It is analytic, z' = (1 - DR)^-1 dR/d(Omega), with 0 <= R_uu <=
kappa_u and dR/d(Omega) at fixed z from the drift and the flight. So z_u' < 0, and d = (z_u', 0,
z_f') is in the cone of the steep weights with the speed's part 1. It stays there and |d_u| grows.

- gamma_bar_0 falls: gamma' = 0 where beta_bar = 0, so its derivative with respect to Omega
  is that at fixed time, with d_u's sign.
- T falls: the passage's time has the derivative -d_u / F_u at the exit, both negative. Its size
  exceeds the derivative of the flight's time.
- beta_max falls: |beta_bar| is largest in the flight, with derivatives with respect to (z_s,
  z_f, Omega) at its start.

As Omega falls to Omega_h (7a.5)
--------------------------------
For the fixed point z,

    h(z) <= h(p) + (1 + L w) kappa h(z),

and h(p) tends to 0, as p and g are continuous. So h(z) tends to 0 and T to infinity. Let c be a
limit of the crossings of beta_bar = 0, and suppose it is not the saddle. It is in the thin set, so
z_u, y_g and v are negative there.

- If the times from D to the crossings stayed bounded along a subsequence, c would be on the graph
  of the stable manifold. But all of the quadrant y_g < 0, v < 0 of beta_bar = 0 lies below it, as Q
  does.
- If they grow without bound, the orbit of c has been in N for ever, so c is on the unstable
  manifold's branch with z_u < 0. That leaves the saddle along -(l, Omega, l^2), l = lambda_u, into
  the inside of K, and beta_bar < 0 on it from then on in N.

So c is the saddle.

Sources: L. P. Shilnikov, Mat. Sb. 61 (1963); Yu. A. Kuznetsov, Elements of Applied Bifurcation
Theory, Section 6.4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb

from tippedisk_verify.proofs.kernel.ball_array import BallArray
from tippedisk_verify.proofs.kernel.balls import ball, positive, require
from tippedisk_verify.proofs.kernel.certificate_format import (
    FRICTION_LAWS,
    NUMBER_SHAPE,
    one_of,
    read_count,
    read_decimal,
    read_dyadic,
    read_order,
)
from tippedisk_verify.proofs.kernel.certificates import connection as connections
from tippedisk_verify.proofs.kernel.certificates.connection import (
    EnclosedConnection,
    recorded_evidence,
    verify_connection,
)
from tippedisk_verify.proofs.kernel.saddle import (
    FAST,
    SLOW,
    UNSTABLE,
    SaddleCoordinates,
    magnitude_bound,
    require_positive,
    wedge_product,
)
from tippedisk_verify.proofs.kernel.saddle_passage import SaddlePassage, enclose_arrivals

__all__ = [
    "CLAIM_SHAPE",
    "EVIDENCE_SHAPE",
    "LID_REFUSAL",
    "SHAPES",
    "EnclosedCyclesNearOmegaH",
    "LoopMap",
    "sentence",
    "verify",
    "verify_cycles",
]

#: The refusal for which a higher lid may help.
LID_REFUSAL = "7a.3: arrivals above the lid of D"
U, S, F = UNSTABLE, SLOW, FAST


#: The evidence: the box N, the weights of its cones, the set D, and the steps of each flight.
CYCLES_EVIDENCE_SHAPE = {
    "box": {
        "directions": [[read_dyadic, 3], 3],
        "extents": [read_dyadic, 3],
        "cells": [read_order, 2],
    },
    "weights": {
        "steep": [read_dyadic, 3],
        "compound": [read_dyadic, 2],
        "drift": [read_dyadic, 3],
        "flat": read_dyadic,
        "lipschitz": read_dyadic,
        "thin": read_dyadic,
        "return": read_dyadic,
    },
    "entry": {
        "lid": read_dyadic,
        "fast": read_dyadic,
        "weight": read_dyadic,
        "moment": read_dyadic,
    },
    "flights": {"steps": read_count, "lengths": [[read_dyadic, None], None]},
}


CLAIM_SHAPE = dict.fromkeys(("low", "high", "gamma", "v"), read_decimal)  #: the claim's own members
_CONNECTION_CLAIM_SHAPE = {"eigenvalues": [[read_decimal, 2], 3], "room": [read_decimal, 3]}
EVIDENCE_SHAPE = CYCLES_EVIDENCE_SHAPE | {
    "connection": connections.EVIDENCE_SHAPE | _CONNECTION_CLAIM_SHAPE
}


@dataclass(frozen=True)
class EnclosedCyclesNearOmegaH:
    """A verified result about the limit cycles at speeds just above Omega_h, in (Omega_h, high].

    At each of these speeds the half map P has exactly one fixed point in the set Q of the module's
    docstring.
    """

    low: Fraction
    high: Fraction
    omega_h_upper_bound: Fraction  #: an upper bound of Omega_h [rad/s]
    gamma: Fraction  #: c [rad]
    v: Fraction  #: d [rad/s]
    kappa: Any = None  #: R contracts D by this factor
    min_passage_time: Any = None  #: a lower bound of the duration of a passage from D [s]

    def contains_cycle(self, omega: Any, gamma_bar: Any, v: Any) -> bool:
        """Return True if the ball omega lies in (Omega_h, high], and the balls gamma_bar, v lie in
        the set Q in which the limit cycles are unique.

        A fixed point of the half map in these balls is then the only one in Q.
        """
        omega_h_upper_bound, high, c, d = map(
            ball, (self.omega_h_upper_bound, self.high, self.gamma, self.v)
        )
        inside = (
            omega - omega_h_upper_bound,
            high - omega,
            gamma_bar - arb.pi() + c,
            arb.pi() - gamma_bar,
            v + d,
            -v,
        )
        return all(positive(x) for x in inside)


def verify_cycles(
    connection: EnclosedConnection,
    low: Fraction,
    high: Fraction,
    evidence_source: Callable[..., Any],
    on_progress: Callable[[float], None] = lambda share: None,
) -> EnclosedCyclesNearOmegaH:
    """Prove the limit cycles next to the connection: the half map has one fixed point in Q at each
    speed above Omega_h, and none at Omega_h or below.

    The proof is that of the module's docstring, at all speeds from ``low`` to ``high`` [rad/s].

    Args:
        connection: The verified interval of Omega_h.
        low: Below Omega_h.
        high: Above Omega_h.
        evidence_source: Called with the names of `CYCLES_EVIDENCE_SHAPE` and the values on which
            each may depend. Its ``entry`` also has the claimed c and d (``gamma``, ``v``).
        on_progress: Called with the share of the flights' steps that is done.

    Returns:
        The speeds, the set Q, the factor kappa of contraction and the least time of a passage.

    Raises:
        Unproved: With the inequality that fails.
    """
    require(
        not FRICTION_LAWS[connection.friction].two_sided,
        "the cycles are proved under the linear friction law only",
    )
    require(0 < low < connection.low < connection.high < high, "claim: an interval is empty")
    box = evidence_source("box")
    speeds = ball(low).union(ball(high))
    passage = SaddlePassage(
        SaddleCoordinates(connection.disk, "linear", speeds, box["directions"]),
        box["extents"],
        box["cells"],
    )
    passage.verify_weights(evidence_source("weights", passage))
    entry = evidence_source("entry", passage)
    loop_map = LoopMap(passage, entry)
    _require_branch_in_box(passage, connection)
    kappa = loop_map.verify(
        _flights(loop_map, low, high, evidence_source("flights", loop_map), on_progress)
    )
    c, d = (Fraction(entry[name]) for name in ("gamma", "v"))
    return EnclosedCyclesNearOmegaH(
        low, high, connection.high, c, d, kappa, loop_map.min_passage_time
    )


class LoopMap:
    """The map R along the loop from the set D back to its section, and the proof that it contracts.

    The constructor shows the inequalities for D and Q and bounds the exits from N. It raises
    Unproved if one fails. `verify` needs the flights from these exits.

    Args:
        passage: The passage through the box N, with its weights.
        entry: The evidence named "entry": the sizes of D and Q, the weight w and the moment.
    """

    def __init__(self, passage: SaddlePassage, entry: dict[str, Any]) -> None:
        self.passage, self.lid, self.fast, self.weight = (
            passage,
            entry["lid"],
            entry["fast"],
            entry["weight"],
        )
        c, d = (ball(entry[name]) for name in ("gamma", "v"))
        require_positive(
            "7a.1: the extents of D and Q and the weight w", self.lid, self.fast, c, d, self.weight
        )
        (u, s, t), saddle = passage.extents, passage.saddle
        #: bounds of |g| on z_s = -s, and of |z_u| along the orbits of the graph from there
        edge = passage.flat_slope * s
        require_positive(
            "7a.1: D and the graph",
            passage.thin_slope * s - self.fast,
            s - self.fast,
            u - self.lid,
            self.lid - edge,
        )
        require_positive(
            "7a.1: the fast part in N",
            passage.speed_wedge_extent - passage.forcing[1] - self.fast,
            s - passage.forcing[1] - self.fast,
        )
        self.min_passage_time = passage.min_passage_time(self.lid + edge)
        require_positive("7a.2: a passage takes time", self.min_passage_time)
        crossing = passage.crossing_bound(self.lid, self.fast, entry["moment"])
        require_positive(
            "7a.4: crossings lie in Q",
            c - crossing * passage.crossing_direction(1),
            d - crossing * passage.crossing_direction(2),
        )
        # Q = {-a by_gamma - b by_v: 0 < a <= c, 0 < b <= d}.
        by_gamma, by_v = ([saddle.inverse[k, j] for k in range(3)] for j in (1, 2))
        a, b = (arb(0).union(magnitude_bound(x)) for x in (c, d))
        corner = [magnitude_bound(a * x + b * y) for x, y in zip(by_gamma, by_v, strict=True)]
        require_positive(
            "7a.4: Q lies in N",
            *(extent - x for extent, x in zip(passage.extents, corner, strict=True)),
        )
        for x in (by_gamma, by_v):
            require_positive(
                "7a.4: Q lies below the graph", x[U] - passage.flat_slope * abs(x[S]).max(abs(x[F]))
            )
        require_positive("7a.4: the sign of z_s in Q", by_gamma[S])
        # Where orbits from D and Q leave N: z_s about the saddle that they fly from, and |z_f|.
        time = passage.min_passage_time(corner[U] + passage.flat_slope * corner[S].max(corner[F]))
        (slow, fast), (slow_q, fast_q) = (
            passage.stable_bounds(s, self.fast, self.min_passage_time),
            passage.stable_bounds(corner[S], corner[F], time),
        )
        back, _ = passage.stable_bounds(d * abs(by_v[S]), self.fast, time)
        self.exit_z_s, self.exit_z_f = (-back, slow.max(slow_q)), arb(0, fast.max(fast_q))
        self.exit_box = [-u, (-self.exit_z_s[0]).union(-self.exit_z_s[1]), self.exit_z_f]
        require_positive("7a.1: beta_bar where N is left", -saddle.offset(self.exit_box)[0])
        require_positive(
            "7a.4: gamma where N is left upwards",
            saddle.offset([u, arb(0, magnitude_bound(s)), arb(0, magnitude_bound(t))])[1],
        )
        require_positive(
            "7a.1: the saddles' boxes are apart", 2 * arb.pi() * saddle.inverse[S, 1] - 2 * s
        )

    def verify(self, arrivals: Sequence[Sequence[Any]]) -> Any:
        """Show that the loop's map R contracts and that its fixed point moves monotonically with
        the speed.

        Args:
            arrivals: The enclosed arrivals of all flights with their derivatives, as
                `enclose_arrivals` returns them: rows for z_u, z_f, the time and the largest
                beta_bar.

        Returns:
            A ball with an upper bound of kappa, the factor by which R shortens paths.

        Raises:
            Unproved: With the inequality that fails.
        """
        passage, w = self.passage, self.weight
        (u, s, _), (k_u, k_s, k_f), (k_1, k_2) = (
            passage.extents,
            passage.steep_weights,
            passage.compound_weights,
        )
        (unstable, *by_u), (fast, *by_f), (_, *by_t), (beta, *by_b) = arrivals
        require_positive(LID_REFUSAL, unstable + self.lid)
        require_positive("7a.3: arrivals in D", u - abs(unstable), self.fast - abs(fast))
        entering, leaving = (
            passage.rates(
                [(-self.lid).union(passage.flat_slope * s), -s, arb(0, magnitude_bound(self.fast))]
            ),
            passage.rates(self.exit_box),
        )
        speed = -leaving[U]
        require_positive("7a.1: orbits enter N and leave it", entering[S], speed)

        def after_round(d: Sequence[Any]) -> list[Any]:
            """Return upper bounds of |d_u| and |d_f| when an orbit returns to D after one round of
            the loop.

            ``d`` is the variation (d_u, d_s, d_f) of its start in D.
            """
            slow, fast = (
                x / speed
                for x in passage.compound_bounds(wedge_product(entering, d), self.min_passage_time)
            )
            return [
                magnitude_bound(abs(row[0]) * slow + abs(row[1]) * fast) for row in (by_u, by_f)
            ]

        image = after_round([arb(0, 1), arb(0), arb(0, magnitude_bound(w))])
        kappa = image[0].max(magnitude_bound(image[1] / w))
        require_positive("7a.2: R contracts", 1 - kappa * (1 + passage.lipschitz_slope * w))
        require_positive("7a.3: the cone on entry", k_1 * entering[S] - abs(entering[F]))
        ratio = passage.compound_ratio_bound(self.min_passage_time)
        height = passage.lipschitz_slope * (abs(by_f[0]) + abs(by_f[1]) * ratio)
        require_positive("7a.3: heights grow downwards", -by_u[0] - abs(by_u[1]) * ratio - height)
        moved = [
            row[0] * arb(0, magnitude_bound(k_s)) + row[1] * arb(0, magnitude_bound(k_f)) + row[2]
            for row in (by_u, by_f)
        ]
        require_positive(
            "7a.3: the branch's arrivals fall",
            -moved[0] - k_u,
            -moved[0] - k_u / k_f * abs(moved[1]),
        )
        # The derivatives of R's fixed point with respect to the speed. The second row of 1 - DR
        # shows |z_f'| <= slope |z_u'| + offset; the first one then bounds |z_u'|.
        first, second = after_round([arb(1), arb(0), arb(0)]), after_round([arb(0), arb(0), arb(1)])
        drift = [arb(0, magnitude_bound(x / speed)) for x in passage.drift_weights[:2]]
        rest = [row[0] * drift[0] + row[1] * drift[1] + row[2] for row in (by_u, by_f)]
        own = 1 - second[1]
        require_positive("7a.5: 1 - DR is regular", own)
        slope, offset = first[1] / own, second[0] * (abs(rest[1]) / own)
        room = 1 - first[0] - second[0] * slope
        falls = -rest[0]
        require_positive("7a.5: the cycle's entry falls", room, falls - offset)
        slowest, fastest = (
            ((falls - offset) / (1 + second[0] * slope)).lower(),
            ((falls + offset) / room).upper(),
        )
        share = arb(0, magnitude_bound(slope + abs(rest[1]) / own / slowest))  # z_f' / z_u'
        require_positive("7a.5: the cone of the derivative", slowest - k_u, k_f - k_u * abs(share))
        twisted = abs(entering[U] * share - entering[F])
        require_positive(
            "7a.5: the compound's cone of the derivative",
            k_1 * entering[S] - twisted,
            k_2 - abs(share),
        )
        row = [passage.saddle.directions[1, k] for k in range(3)]
        require_positive(
            "7a.5: gamma_bar_0 falls", row[U] - (abs(row[S]) * k_s + abs(row[F]) * k_f) / k_u
        )
        b = passage.compound_bounds(
            [x * fastest for x in wedge_product(entering, (arb(1), arb(0), share))],
            self.min_passage_time,
        )
        exits = [
            arb(0).union(b[0] / speed) + drift[0],
            arb(0, magnitude_bound(b[1] / speed)) + drift[1],
            arb(1),
        ]
        gained = (slowest * (passage.growth_rates[0] * self.min_passage_time).exp() / speed).lower()
        require_positive(
            "7a.5: the period falls",
            gained - abs(sum(x * y for x, y in zip(by_t, exits, strict=True))),
        )
        require_positive(
            "7a.5: beta_max falls", -sum(x * y for x, y in zip(by_b, exits, strict=True))
        )
        inside = passage.saddle.offset(
            [
                arb(0, magnitude_bound(u)),
                arb(0, magnitude_bound(s)),
                arb(0, magnitude_bound(passage.forcing[1] + self.fast)),
            ]
        )[0]
        require_positive("7a.5: beta_max is in the flight", beta - abs(inside))
        return kappa


def _flights(
    loop_map: LoopMap,
    low: Fraction,
    high: Fraction,
    entry: dict[str, Any],
    on_progress: Callable[[float], None],
) -> list[list[Any]]:
    """Enclose the arrivals of the flights from all exits of the saddle's box at all speeds of [low,
    high].

    Speeds and exits are divided into cells, with one flight for each pair of them. ``entry``
    contains the number of steps and the lengths of steps: a row for each cell of speeds, in it a
    number for each cell of z_s. Returns the rows of `enclose_arrivals`, and raises Unproved as it
    does.
    """
    rows, (least, largest) = entry["lengths"], loop_map.exit_z_s
    require(bool(rows) and all(rows), "7a.1: there are no flights")
    speeds, slow = [], []
    for i, row in enumerate(rows):
        ends = [ball(low + (high - low) * Fraction(i + k, len(rows))) for k in (0, 1)]
        for j in range(len(row)):
            cell = [least + (largest - least) * (j + k) / len(row) for k in (0, 1)]
            speeds.append(ends[0].union(ends[1]))
            slow.append(cell[0].union(cell[1]))
    saddle = loop_map.passage.saddle
    over = SaddleCoordinates(
        saddle.disk, "linear", BallArray.of(speeds), saddle.directions.tolist()
    )
    lengths = np.array([float(length) for row in rows for length in row])
    return enclose_arrivals(
        over,
        loop_map.passage.extents,
        BallArray.of(slow),
        loop_map.exit_z_f,
        lengths,
        entry["steps"],
        on_progress,
    )


def _require_branch_in_box(passage: SaddlePassage, connection: EnclosedConnection) -> None:
    """Raise Unproved unless the heteroclinic connection is shown to stay in the box N about the
    saddle from z_s = -s on, with gamma growing all along it.

    The boxes ``connection.branch_boxes`` enclose the connection.
    """
    saddle, (u, s, t) = passage.saddle, passage.extents
    box = saddle.coordinates([arb(0, ball(extent).upper()) for extent in connection.arrival_box])
    require_positive("7a.3: the connection's box lies in N", u - abs(box[U]))
    states = [
        (beta, saddle.second_saddle_coordinates((beta, gamma, v)))
        for beta, gamma, v in connection.branch_boxes
    ]
    first = next((place for place, (_, z) in enumerate(states) if not positive(-s - z[S])), 0)
    require(first > 0, "7a.3: the connection is not shown to come from outside of N")
    for _, z in states[first:]:
        require_positive("7a.3: the connection stays in N", u - abs(z[U]), t - abs(z[F]))
    for beta, _ in states[1:]:  # `connection` shows it in the first box, at the saddle
        require_positive("7a.3: gamma grows along the connection", beta.sin())


SHAPES = {
    "cycles next to the connection": (
        {"friction": one_of("linear"), "numbers": {"omega_h": NUMBER_SHAPE}, **CLAIM_SHAPE},
        EVIDENCE_SHAPE,
    )
}


def verify(claim: Mapping[str, Any], evidence: Mapping[str, Any]) -> EnclosedCyclesNearOmegaH:
    """Check a certificate about the limit cycles next to the connection: repeat the proof with the
    evidence that it records.

    Returns the proved result.

    Args:
        claim: The claim, as read from the file.
        evidence: The evidence, as read from the file.

    Raises:
        Unproved: If the evidence does not prove the claim.
    """
    entries = evidence["connection"]
    claimed = {
        "arrival_box": tuple(map(Fraction, entries["room"])),
        "eigenvalues": [tuple(map(Fraction, pair)) for pair in entries["eigenvalues"]],
    }
    omega_h = claim["numbers"]["omega_h"]
    interval = Fraction(omega_h["value"]), Fraction(omega_h["uncertainty"])
    connection = verify_connection(
        claim["parameters"], "linear", interval, recorded_evidence({**entries, **claimed})
    )
    recorded = {
        **evidence,
        "entry": {**evidence["entry"], "gamma": claim["gamma"], "v": claim["v"]},
    }
    return verify_cycles(
        connection,
        Fraction(claim["low"]),
        Fraction(claim["high"]),
        lambda name, *context: recorded[name],
    )


def sentence(claim: Mapping[str, Any], numbers: Mapping[str, str]) -> str:
    """Return the theorem that a certificate claims about the limit cycles next to the heteroclinic
    connection, in words.

    The text continues a sentence that has already named the disk and its friction law.

    Args:
        claim: The claim of the certificate.
        numbers: The claimed numbers by name, each as text with its uncertainty.
    """
    low, high, gamma, v = (claim[name] for name in CLAIM_SHAPE)
    return (
        f" let gamma be a real number, not an angle; let P be the half map from the section beta = "
        "pi/2, v < 0 along the flow to the next crossing of beta = pi/2, there v > 0, with |beta - "
        "pi/2| < pi/2 "
        "between, and by S: (beta, gamma, v) -> (pi - beta, pi - gamma, -v) back; and let Q be the "
        "set of the "
        f"section's states with 3 pi/2 - {gamma} <= gamma < 3 pi/2 and -{v} rad/s <= v < 0. Of the "
        f"speeds from {low} "
        f"to {high} rad/s exactly one, Omega_h, is one at which the branch of the unstable "
        f"manifold of (beta, gamma, "
        "v) = (pi/2, -pi/2, 0) that leaves with growing gamma converges to (pi/2, 3 pi/2, 0) with "
        "gamma growing all "
        f"the way, and Omega_h = {numbers['omega_h']} rad/s. For every Omega with Omega_h < Omega "
        f"<= "
        f"{high} rad/s P has exactly one fixed point in Q; the limit cycle through it is "
        f"asymptotically stable, S maps "
        "it to itself, and it crosses beta = pi/2 exactly twice a period; as Omega grows, its "
        "period, its largest "
        "|beta - pi/2| and its gamma in Q fall strictly; as Omega falls to Omega_h, its period "
        "tends to infinity and "
        f"the fixed point to (pi/2, 3 pi/2, 0). For every Omega with {low} rad/s <= Omega <= "
        f"Omega_h P has no fixed "
        "point in Q."
    )
