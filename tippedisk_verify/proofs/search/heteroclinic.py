"""Omega_h proved: in an enclosed interval of speeds, noninverted spinning is connected with its copy, at exactly one.

The unstable branch of the saddle (0, -pi, 0) (shifted angles) that leaves with growing gamma passes z_u = theta_0 at a
point p_0(Omega) and T seconds later is at p(Omega), near the saddle (0, pi, 0). Let I be an interval of speeds with the
midpoint Omega_m and the half-width h.

1. *Start.* Cones at the first saddle enclose p_0 on all of I, sharper at Omega_m, and the difference of two of its
   points: p_0(Omega') - p_0(Omega) = (P e_s [-k_s, k_s] + P e_f [-k_f, k_f]) (Omega' - Omega) (`local_manifolds`).
2. *Flight.* `flow` encloses p(Omega_m), p(I) and the derivatives of the flow over all that starts there; by the mean
   value theorem p(Omega') - p(Omega) = P G (Omega' - Omega) with an enclosed vector G.
3. *Arrival.* p(I) lies in an isolating block N of the second saddle. In the block's coordinates w_u changes from less
   than -delta to more than delta, or back, between the ends of I: w_u(p(Omega_m)) is known, and its derivative
   H = G_u - W_u' G_s bounds the rest. So at one end of I the orbit leaves N through one face, at the other end through
   the other. The speeds of either kind are open sets; I is connected: at some speed of I the orbit stays in N for ever.
4. *Connection.* By the cones at the second saddle an orbit that stays in N converges to it. That speed is Omega_h, and
   by the point symmetry the connection back exists at the same speed.
5. *Uniqueness.* Two speeds Omega < Omega' whose orbits stay in N, or in a larger box about the saddle on which the
   cones hold, would give orbits that differ at arrival by P G (Omega' - Omega). If G lies in the unstable cone, for all
   speeds of I, they would drift apart exponentially, and cannot both stay.

**The statement** needs no theta_0, T or N, which depend on choices. It is about a box around the second saddle,
|beta_bar| <= b, |gamma_bar - pi| <= c, |v| <= d with short decimals b, c, d. The box holds N, and with it p(I). From
the branch's first arrival at gamma_bar = pi - c until T, gamma is proved to grow and the branch to be in the box, for
all speeds of I (`_room`). So the branch of the speed found in 3 stays in the box from its first arrival on. By 5, with
the cones over this box, no other speed of I has such a branch.

What is proved excludes, in I, a second speed whose branch never leaves the box again; it says nothing of orbits that
leave it and come back to the saddle on another way. Only connections on which gamma grows all the way are looked for.

**The limit cycle next to it** (docs/certified.md, Theorem 7). With gamma in R, not modulo 2 pi, the symmetry S maps the
two connections to each other and acts freely on a neighbourhood of them. In its quotient they are one homoclinic loop
of one saddle, and Shilnikov's theorem is about such a loop. Each of its hypotheses is proved here, or
`ProvedConnection.limit_cycle` says nothing:

- the eigenvalues are real and simple, lambda_u > 0 > lambda_s > lambda_ss (`Frame`), and lambda_u + lambda_s < 0;
- the splitting has a simple zero, by step 5: the points (z, Omega) from which the orbit stays in N form a smooth graph
  over (z_s, z_f, Omega). No two of them differ by a vector of the unstable cone, so no tangent lies inside it. The
  derivative of the arrivals by Omega does: it lies in G;
- the connection comes in along the slow direction (`_arrives_slowly`), so not in the strong stable manifold.

The theorem is about smooth fields. Under the smooth Coulomb law the field is only once differentiable at the saddle,
and nothing is said of limit cycles. Steps 1 to 5 need no more: `local_manifolds` says where.

The cycle follows both connections, so it is on the side of Omega_h on which the branch leaves N with falling gamma.

Omega_m comes from elsewhere, good to some digits more than I is long. It is a guess like any other.

Where a ball becomes a point here: theta_0, T, Omega_m, h and the extents of N and of the box are exact numbers chosen
freely.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, NamedTuple

from flint import arb

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.decimals import decimal_magnitude, exact_text, rounded_up
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable
from tippedisk_verify.proofs.angles import NONINVERTED
from tippedisk_verify.proofs.closed_forms import characteristic_polynomial, real_root
from tippedisk_verify.proofs.kernel.balls import ball, ball_constants, negative, positive, working_precision
from tippedisk_verify.proofs.kernel.flight import carry
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.kernel.flow import Step
from tippedisk_verify.proofs.kernel.sliding import model_of
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.local_manifolds import (
    FAST,
    SLOW,
    UNSTABLE,
    Block,
    Curve,
    Frame,
    rates_of_cones,
    smallest_weights,
)
from tippedisk_verify.proofs.search.steps import Steps

__all__ = ["MOST_DIGITS", "ProvedConnection", "Status", "not_proved", "prove_connection"]

MOST_DIGITS = 300  # half an hour; the time grows like the power 2.5 of the digits
_GUARD_BITS = 56  # some 10 digits for the passage, and a few for what is divided away
_LONGEST = 30.0  # s
_ORDER_PER_BIT = 0.35  # of the local series: then their reach is used to about an eighth
_MOST_PASSES = 3
_PIECES = 8  # of a step, for what is to hold all along it
#: rad; extents in gamma of the statement's box, if N lies in it. The larger it is, the more is unique.
_ROOMS = tuple(map(Fraction, ("0.02", "0.01", "0.005", "0.002", "0.001")))
_LEAST_DIGITS = 4  # an interval for fewer is too wide to be followed past a saddle; a shorter one does for them


class Status(Enum):
    """How the proof ended. The value says where it stopped and what to try next."""

    PROVED = "proved"
    NO_SADDLE = "there is no connection of saddles to look for"
    UNSTABLE_BRANCH = "the unstable branch could not be enclosed at the first saddle: ask for more digits"
    FLOW = "the flight between the saddles could not be enclosed: ask for more digits"
    NOT_NEAR = "the branch does not come near the second saddle: try another speed"
    BLOCK = "no isolating block at the second saddle holds the arrivals: ask for more digits"
    SIDES = "the ends of the interval are not proved to pass on opposite sides: is there a connection in it?"
    ROOM = "no box at the second saddle is proved to keep what arrives, and to let it converge: ask for more digits"
    CONES = "the cone conditions at a saddle are not proved: ask for more digits"


class Room(NamedTuple):
    """The box |beta - pi/2| <= ``beta``, |gamma - 3 pi/2| <= ``gamma``, |v| <= ``v`` [rad, rad, rad/s]; see above."""

    beta: Fraction
    gamma: Fraction
    v: Fraction


@dataclass(frozen=True, repr=False)
class ProvedConnection(Printable):
    """The interval of Omega_h, and what was proved of it; without status PROVED nothing was."""

    told = (
        *("proved", "status", "statement", "limit_cycle", "omega_h", "unique"),
        *("saddle_eigenvalues", "saddle_value", "upright", "room", "bits"),
    )

    status: Status
    omega_h: Measured | None  #: [rad/s]; the interval I
    unique: bool  #: no second speed of I has a connection of this kind
    saddle_eigenvalues: tuple[Measured, ...]  #: unstable, slow stable, fast stable [1/s], for every speed of I
    room: Room | None  #: where the branch stays
    upright: bool  #: |beta - pi/2| < pi/2 all along: the disk never lies flat
    bits: int  #: working precision of the last pass
    detail: str = ""
    slowly: bool = False  #: the connection comes in along the slow stable direction
    turns_back: str = ""  #: "above" or "below" Omega_h, in I: where the branch leaves N with falling gamma
    parameters: Parameters | None = None  #: the disk of which this is proved

    @property
    def proved(self) -> bool:
        return self.status is Status.PROVED

    @property
    def saddle_value(self) -> Measured | None:
        """lambda_u + lambda_s [1/s]; where it is negative the cycle next to the connections attracts."""
        if not self.saddle_eigenvalues:
            return None
        unstable, slow, _ = self.saddle_eigenvalues
        return unstable + slow

    @property
    def statement(self) -> str:
        if not self.proved or self.omega_h is None or self.room is None or self.parameters is None:
            return f"nothing is proved: {self.status.value}{f' ({self.detail})' if self.detail else ''}."
        middle, half_width = self.omega_h.decimals()
        beta, gamma, v = map(exact_text, self.room)
        return (
            f"for the tippedisk with {self.parameters.definition()} under the {self.parameters.law} friction law "
            f"there is {'exactly one' if self.unique else 'at least one'} Omega with |Omega - {middle} rad/s| <= "
            f"{half_width} rad/s at which the branch of the unstable manifold of (beta, gamma, v) = (pi/2, -pi/2, 0) "
            f"that leaves with growing gamma, from the moment on at which it first has gamma = 3 pi/2 - {gamma}, "
            f"stays in the box |beta - pi/2| <= {beta}, |gamma - 3 pi/2| <= {gamma}, |v| <= {v} rad/s and converges "
            f"to (pi/2, 3 pi/2, 0){', with |beta - pi/2| < pi/2 all along' * self.upright}; by the symmetry (beta, "
            "gamma, v) -> (pi - beta, pi - gamma, -v) the connection back exists at the same speed, an Omega_h; at "
            "every speed of the interval the saddle's eigenvalues are "
            f"{', '.join(map(str, self.saddle_eigenvalues))} 1/s."
        )

    @property
    def limit_cycle(self) -> str | None:
        """What follows by Shilnikov's theorem; None if one of its hypotheses is not proved."""
        value = self.saddle_value
        if not (self.proved and self.unique and self.slowly and value and value.value + value.uncertainty < 0):
            return None
        if self.parameters is not None and self.parameters.friction == "smooth":
            return None  # the theorem asks for a smoother field
        other = "below" if self.turns_back == "above" else "above"
        return (
            "for the tippedisk, the friction law and the Omega_h of the statement, by Shilnikov's theorem: with gamma "
            "in R (not modulo 2 pi) the two connections and the saddles have a neighbourhood in which, for all speeds "
            f"close enough to Omega_h, there is exactly one periodic orbit {self.turns_back} Omega_h and none {other} "
            "it or at it; the orbit is asymptotically stable, the point symmetry maps it to itself, and its period "
            "tends to infinity as Omega tends to Omega_h."
        )

    def to_dict(self) -> dict[str, object]:
        room = None if self.room is None else {name: exact_text(x) for name, x in self.room._asdict().items()}
        return super().to_dict() | {"status": self.status.name.lower(), "room": room}


def not_proved(status: Status, bits: int = 0, detail: str = "") -> ProvedConnection:
    """The result without a proof."""
    return ProvedConnection(status, None, False, (), None, False, bits, detail)


def prove_connection(parameters: Parameters, near: object, digits: int = 12) -> ProvedConnection:
    """Prove Omega_h in an interval of length at most 10^-digits, absolutely and relative to it, about ``near`` [rad/s].

    ``near`` (an exact number) must be good to two digits more, and to six at least. Raises InputError
    for digits not offered or a speed that makes no sense, NoConnectionError where the equilibrium is no saddle with
    real eigenvalues.
    """
    if not 1 <= digits <= MOST_DIGITS:
        raise InputError(f"a proof of Omega_h is offered to 1 to {MOST_DIGITS} digits, not {digits}")
    given = exact(near)
    if given.pi_multiple or not Fraction(1, 10**6) < given.rational < 10**6:
        raise InputError(f"Omega_h must be a decimal between 1e-6 and 1e6 rad/s, not {str(near)[:40]}")
    # Decimal ends, so that what is printed is the interval of which the statement is proved, and no more.
    decimals = max(digits, _LEAST_DIGITS) + max(0, -decimal_magnitude(given.rational))
    middle, half_width = round(given.rational, decimals + 2), Fraction(4, 10 ** (decimals + 1))
    bits = math.ceil(-math.log2(half_width)) + max(0, math.ceil(math.log2(given.rational))) + _GUARD_BITS
    for attempt in range(_MOST_PASSES):
        with working_precision(bits):
            proof = _Pass(parameters, middle, half_width, bits).prove(Fraction(1, 64 ** (attempt + 1)))
        if proof.proved or proof.status is Status.NOT_NEAR:
            break
        bits += 48
    return proof


class _Pass:
    """One pass over an interval of speeds, at the working precision."""

    def __init__(self, parameters: Parameters, middle: Fraction, half_width: Fraction, bits: int) -> None:
        self.bits, self.middle, self.half_width = bits, middle, half_width
        self.frame = Frame(parameters, middle)
        self.thin = ball(middle)  # with a rounding's radius
        self.interval = self.thin + arb(0, ball(half_width).upper())
        order = 2 * math.ceil(_ORDER_PER_BIT * bits / 2) + 1
        self.leaving = Curve(self.frame, self.thin, UNSTABLE, order)  # sharper than on the interval
        self.leaving_all = Curve(self.frame, self.interval, UNSTABLE, order)
        self.arriving = Curve(self.frame, self.interval, SLOW, order)
        self.parameters, self.constants = parameters, ball_constants(parameters)

    @property
    def theta_0(self) -> Any:
        """Where the branch is left: an eighth of the series' reach, a power of two."""
        return self.leaving.share_of_reach()

    def prove(self, share: Fraction) -> ProvedConnection:
        """``share`` of the half-width: the flight goes on until the fast coordinate is smaller."""
        flown = self._thin_flight(self.half_width * share)
        if isinstance(flown, Status):
            return self._failed(flown)
        time, w_u = flown
        arrived = self._wide_flight(time)
        if isinstance(arrived, Status):
            return self._failed(arrived)
        state, G, upright, pieces = arrived
        theta, (wide_u, wide_f) = self._at_arrival(state)
        s, u, t = (abs(part).upper() for part in (theta, wide_u, wide_f))
        # On the faces w_f = t the coupling from w_u, a hundredth of the contraction or less, must not win.
        block = Block.around(self.arriving, ((s * 9 / 8).upper(), 2 * u, 2 * (t + u).upper()))
        if block is None:
            return self._failed(Status.BLOCK)
        slope = G[UNSTABLE] - self.arriving.slopes(theta)[0] * G[SLOW]
        half = ball(self.half_width)
        low, high = w_u - slope * half, w_u + slope * half
        rising = negative(low + block.delta) and positive(high - block.delta)
        falling = positive(low - block.delta) and negative(high + block.delta)
        if not (rising or falling):
            return self._failed(Status.SIDES)
        offset = self.frame.offset(block.box)
        least = _decimal_above(abs(offset[1]))
        for gamma in (*(size for size in _ROOMS if size > least), least):
            room = _room(offset, pieces, gamma)
            unique = None if room is None else self._unique(room, G)
            if unique:
                break
        if room is None or unique is None:
            return self._failed(Status.ROOM)
        return ProvedConnection(
            status=Status.PROVED,
            omega_h=Measured(self.middle, self.half_width),
            unique=unique,
            saddle_eigenvalues=self._eigenvalues(),
            room=room,
            upright=upright and positive(arb.pi() - 2 * ball(room.beta)),
            bits=self.bits,
            slowly=_arrives_slowly(block.derivative, self._z(state)),
            # z_u and gamma grow together, and beyond delta the sign of w_u decides through which face it leaves.
            turns_back="above" if falling else "below",
            parameters=self.parameters,
        )

    def _unique(self, room: Room, G: Sequence[Any]) -> bool | None:
        """Whether orbits of two speeds cannot both stay in the box; None if not even one is proved to converge."""
        box = self.frame.coordinates([arb(0, ball(extent).upper()) for extent in room])
        matrix, by_speed = self.frame.derivative(self.interval, box), self.frame.derivative_by_speed(self.interval, box)
        if not all(map(positive, rates_of_cones(matrix, [arb(0)] * 3, [arb(1)] * 3))):
            return None
        return _drift_apart(matrix, by_speed, G)

    def _thin_flight(self, resolved: Fraction) -> tuple[Fraction, Any] | Status:
        """T and w_u(p(Omega_m)), when the fast coordinate has fallen below ``resolved``."""
        start = self.leaving.unstable_point(self.theta_0)
        if start is None:
            return Status.UNSTABLE_BRANCH
        path = model_of(self.parameters, self.thin).path(self._departing(start[0]), Steps())
        # Nearer than the series demand: the cones there need orbits that differ along the unstable direction, and hold
        # in a box that is wider than N by the ratio of the eigenvectors' components.
        reach, small = self.arriving.share_of_reach() / 16, ball(resolved)
        while path.time < _LONGEST:
            step = path.step()
            if step is None:
                return Status.FLOW
            path.take(step)
            beta, gamma, _ = path.box
            if beta < 0 or gamma > arb.pi():  # gamma falls, or has gone past the saddle
                break
            theta, w = self._at_arrival(path.box)
            if abs(theta) < reach and abs(w[1]) < small:
                if not path.time.is_exact():
                    return Status.FLOW
                return measured(path.time).value, w[0]
        return Status.NOT_NEAR

    def _wide_flight(self, time: Fraction) -> tuple[tuple[Any, Any, Any], list[Any], bool, list[Any]] | Status:
        """p(I); G with p(Omega') - p(Omega) in P G (Omega' - Omega) for all speeds of I; whether all stay upright;
        boxes of states, in order of time, that hold the flights of all speeds of I, from the first saddle on.
        """
        curve, theta_0 = self.leaving_all, self.theta_0
        start = curve.unstable_point(theta_0)
        if start is None:
            return Status.UNSTABLE_BRANCH
        box, cone = start
        whole = curve.point(arb(0).union(theta_0), [arb(0, (part * theta_0).upper()) for part in cone])
        matrix = self.frame.derivative(self.interval, whole, curve.side)
        by_speed = self.frame.derivative_by_speed(self.interval, whole, curve.side)
        weights = smallest_weights(matrix, by_speed)
        if not all(map(positive, rates_of_cones(matrix, by_speed, weights))):
            return Status.CONES
        pieces = [self._departing(whole)]

        def note(step: Step) -> None:
            share = ball(step.length) / (2 * _PIECES)
            pieces.extend(step.at((2 * k + 1) * share + arb(0, share.upper())) for k in range(_PIECES))

        model = model_of(self.parameters, self.interval)
        flight = carry(model.path(self._departing(box), Steps(), derivatives=True), time, watch=note)
        if flight.status is not FlowStatus.REACHED or flight.matrix is None:
            return Status.FLOW
        moved = self.frame.offset([arb(0), arb(0, weights[SLOW]), arb(0, weights[FAST])])
        change = [sum((row[k] * moved[k] for k in range(3)), row[3]) for row in flight.matrix]
        upright = flight.upright and _upright(self.frame.offset(whole))
        return flight.state, self.frame.coordinates(change), upright, pieces

    def _departing(self, z: Sequence[Any]) -> tuple[Any, Any, Any]:
        beta, gamma, v = self.frame.offset(z)
        return beta, gamma - arb.pi(), v

    def _at_arrival(self, state: Sequence[Any]) -> tuple[Any, tuple[Any, Any]]:
        """(theta, (w_u, w_f)) at the second saddle."""
        return self.arriving.straightened(self._z(state))

    def _z(self, state: Sequence[Any]) -> list[Any]:
        beta, gamma, v = state
        return self.frame.coordinates((beta, gamma - arb.pi(), v))

    def _eigenvalues(self) -> tuple[Measured, ...]:
        """Of the saddle for every speed of the interval, by descending value."""
        polynomial = characteristic_polynomial(self.constants, self.interval, NONINVERTED)
        return tuple(measured(real_root(polynomial, value)) for value in self.frame.eigenvalues)

    def _failed(self, status: Status) -> ProvedConnection:
        return not_proved(status, self.bits)


def _upright(offset: Sequence[Any]) -> bool:
    return bool(2 * abs(offset[0]) < arb.pi())


def _room(block: Sequence[Any], pieces: Sequence[Any], reach: Fraction) -> Room | None:
    """The statement's box with ``reach`` in gamma, for a block's offsets from the saddle and a flight's ``pieces``.

    None if it is not proved that the branch, once it has arrived in the box, stays there until the flight's end.
    """
    away = [(beta, gamma - arb.pi(), v) for beta, gamma, v in pieces]
    first = next((place for place, (_, gamma, _) in enumerate(away) if not gamma < -ball(reach)), 0)
    late = away[first:]
    if not first or not all(positive(beta.sin()) and gamma < ball(reach) for beta, gamma, _ in late):
        return None
    beta, _, v = (max(_decimal_above(abs(state[k])) for state in (block, *late)) for k in range(3))
    return Room(beta, reach, v)


def _decimal_above(x: Any) -> Fraction:
    """A decimal of two digits that no number of the ball, whose upper end is positive, is above."""
    enclosure = measured(x)
    return Fraction(rounded_up(enclosure.value + enclosure.uncertainty))


def _arrives_slowly(matrix: Any, z: Sequence[Any]) -> bool:
    """Whether an orbit that is in the box z now, and in N for ever, converges along the slow stable direction.

    With weights 1 it has |z_u| <= max(|z_s|, |z_f|). Where |z_f| = |z_s|, |z_f| grows less than |z_s| if the Gershgorin
    discs of the two rows, enclosed over N in ``matrix``, lie apart; then |z_f| < |z_s| stays true. The eigenvector of
    the fast eigenvalue, which lies in the fast row's disc, has |z_f| > |z_s|.
    """
    slow, fast = (
        (matrix[row, row], sum((abs(matrix[row, k]) for k in range(3) if k != row), arb(0))) for row in (SLOW, FAST)
    )
    apart = positive(slow[0] - slow[1] - (fast[0] + fast[1]))
    return bool(apart and abs(z[FAST]) < abs(z[SLOW]))


def _drift_apart(matrix: Any, by_speed: Sequence[Any], G: Sequence[Any]) -> bool:
    """Whether orbits that differ by G (Omega' - Omega) are in a cone in which they drift apart for ever."""
    unstable, slow, fast = (abs(part) for part in G)
    weights = [unstable.lower() * 7 / 8, slow.upper() * 2, fast.upper() * 2]
    # A weight may be larger than the difference needs; much smaller ones than the others' coupling are not proved.
    least = smallest_weights(matrix, by_speed)
    for index in (SLOW, FAST):
        weights[index] = weights[index].max(2 * least[index])
    inside = positive(weights[0]) and unstable > weights[0] and slow < weights[1] and fast < weights[2]
    return bool(inside and all(map(positive, rates_of_cones(matrix, by_speed, weights))))
