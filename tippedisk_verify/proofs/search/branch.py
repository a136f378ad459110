"""Theorem 5b: the family of limit cycles from the Hopf point on is one curve, along which the speed falls.

It is put together from the pieces of `pieces`. The first one begins at the Hopf point, gamma_bar_0 = 0; each next one
begins where the last one ends, and both are proved to have the same cycle there. So over (0, a_end] the family is one
analytic curve, and what falls or grows strictly on each piece does so on all of it: for each Omega of [Omega_end,
Omega_crit) exactly one cycle of the curve has this speed. At gamma_bar_0 = 0 the scaled flow is linear, exp(A t), and
takes a state x to -x in half a period t. So A has an eigenvalue i (2 k + 1) pi / t; no real one does that. A pair is
imaginary at Omega_crit only (`closed_forms`), so Omega is Omega_crit there, and x is in the pair's plane. Its b is a
sinusoid, and the flight shows that it has no zero inside the half period: k = 0, and the period is that of the pair.
The enclosures are checked to hold the closed form's Omega_crit all the same.

**The other end.** `connection_end` proves of every Omega in (Omega_h, Omega_1] that P has exactly one fixed point in a
set Q next to the saddle. Let the last piece's cycle at a_end lie in Q at a speed below Omega_1 (`ProvedEnd.meets`).
Then it is that fixed point. Over the speeds from Omega(a_end) to Omega_1 both curves are analytic in Omega; those at
which they have the same cycle form a closed set, and an open one because P' - 1 is regular. So they are one curve. On
the part next to the connection gamma_bar_0 falls with a derivative that is not zero as Omega grows, so a = gamma_bar_0
is a parameter there as well, up to pi.

Where a ball becomes a point or a float: nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from tippedisk_verify.model.decimals import exact_text, rounded_down
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.closed_forms import check_linearization, hopf_balls
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.numbers import measured
from tippedisk_verify.proofs.search.pieces import Piece, Status, joined
from tippedisk_verify.proofs.search.proved_connection import ProvedConnection
from tippedisk_verify.proofs.search.proved_end import ProvedEnd

__all__ = ["BranchProof", "hopf_closed"]

_BITS = 128
_PLACES = 9  # of the share and of the speed at the end, rounded to the safe side


@dataclass(frozen=True)
class BranchProof:
    """What is proved of the family. ``pieces`` are one curve from the Hopf point on; there may be none."""

    parameters: Parameters
    pieces: tuple[Piece, ...]
    stopped: Status | None = None  #: why the piece after the last one is not proved, if one was tried
    connection: ProvedConnection | None = None  #: Omega_h, if it is known
    end: ProvedEnd | None = None  #: the cycles next to the connection, if they are proved
    read: int = 0  #: how many of the pieces are taken as a file has them

    @property
    def hopf_closed(self) -> bool:
        """Whether the pieces are one curve that is proved to begin at the Hopf point."""
        glued = all(a.high == b.low and joined(a, b, b.low) for a, b in pairwise(self.pieces))
        return bool(self.pieces) and glued and hopf_closed(self.parameters, self.pieces[0])

    @cached_property
    def end_closed(self) -> bool:
        """Whether the last piece runs into what is proved next to the connection."""
        if self.end is None or not self.pieces or self.end.connection.parameters != self.parameters:
            return False
        last = self.pieces[-1]
        cycle, off = last.at(last.high), last.scaled_to(last.high, last.within)
        with working_precision(_BITS):
            found = [ball(middle) + arb(0, 1) * ball(part) for middle, part in zip(cycle, off, strict=True)]
            return self.end.meets(found[1], ball(last.high), found[0])

    @property
    def proved(self) -> bool:
        """Whether the theorem holds of the whole of (Omega_h, Omega_crit)."""
        return self.hopf_closed and self.end_closed

    @property
    def omega_end(self) -> Fraction | None:
        """All speeds from here to Omega_crit belong to the curve [rad/s]; rounded up."""
        if not self.hopf_closed:
            return None
        unit = 10**_PLACES
        return Fraction(-(-self.pieces[-1].speeds(self.pieces[-1].high)[1] * unit // 1), unit)

    @property
    def covered(self) -> Fraction | None:
        """The share of (Omega_h, Omega_crit) that belongs to the curve, or less; None if Omega_h is not proved."""
        if self.proved:
            return Fraction(1)
        known = self.connection.omega_h if self.connection is not None and self.connection.proved else None
        if self.omega_end is None or known is None:
            return None
        # It grows with Omega_crit and with Omega_h.
        top, bottom = _least(omega_crit(self.parameters)), _least(known)
        unit = 10**_PLACES
        return Fraction(max(Fraction(0), (top - self.omega_end) / (top - bottom)) * unit // 1, unit)

    def unique_within(self) -> tuple[Fraction, Fraction, Fraction]:
        """Distances from every cycle of the curve within which there is no other of the same gamma_bar_0.

        Of v_0 / gamma_bar_0 [1/s] on the first piece, of v_0 [rad/s] on the others, and of Omega [rad/s].
        """
        rooms = [
            [room - near for room, near in zip(piece.unique_within, piece.within, strict=True)] for piece in self.pieces
        ]
        later = [room[0] for room in rooms[1:]] or [rooms[0][0]]
        return rooms[0][0], min(later), min(room[1] for room in rooms)

    @property
    def statement(self) -> str:
        """What is proved, in one sentence or three."""
        if not self.hopf_closed:
            return f"nothing is proved: {self._reason}."
        last, first = exact_text(self.pieces[-1].high), exact_text(self.pieces[0].high)
        ratio, v, speed = (rounded_down(part) for part in self.unique_within())
        crit, end = omega_crit(self.parameters), exact_text(self.omega_end or Fraction(0))
        if self.proved:
            amplitudes = "(0, pi)"
            other = f"as a tends to pi {self._connected}; each Omega with Omega_h < Omega < Omega_crit"
        else:
            amplitudes = f"(0, {last}] rad"
            other = (
                f"at a = {last} rad Omega is at most {end} rad/s, so that each Omega from there up to, but without, "
                "Omega_crit"
            )
        return (
            f"{self.read} of {len(self.pieces)} arcs were read from the file of --arcs, not proved here; if they hold, "
            "so does what follows: "
        ) * bool(self.read) + (
            f"for the tippedisk with {self.parameters.definition()} under the linear friction law, gamma being a "
            f"real number, not an angle, there are analytic functions v_0(a) < 0 and Omega(a) of a in {amplitudes} "
            "such that at the speed Omega(a) the orbit from beta = pi/2, gamma = pi/2 + a with beta' = v_0(a) is an "
            "asymptotically stable limit cycle, which S, (beta, gamma, v) -> (pi - beta, pi - gamma, -v), maps to "
            "itself, which crosses beta = "
            "pi/2 exactly twice a period, and on which |beta - pi/2| is less than pi/2; as a grows Omega falls "
            "strictly, and the period and the largest |beta - pi/2| grow strictly; as a tends to 0 the cycle "
            f"shrinks to inverted spinning, Omega tends to Omega_crit = {crit} rad/s, where a pair of eigenvalues "
            f"crosses the imaginary axis, and the period tends to 2 pi over their imaginary part; {other} is the "
            "speed of exactly one of these cycles. Let P be the half-period map, along the flow at the speed Omega "
            "from beta = pi/2, v < 0 to the next crossing of beta = pi/2, with |beta - pi/2| < pi/2 between, and then "
            f"by S. For no a with 0 < a <= {last} rad there is another (v, Omega), v < 0, for which P has the fixed "
            "point gamma = pi/2 + a, v, with "
            f"|Omega - Omega(a)| <= {speed} rad/s and, where a <= {first} rad, |v - v_0(a)| <= {ratio} a/s, where "
            f"a is larger, |v - v_0(a)| <= {v} rad/s.{self._alone}"
        )

    @property
    def _connected(self) -> str:
        """How the curve ends at the connection."""
        assert self.end is not None
        assert self.end.connection.omega_h is not None
        middle, half_width = self.end.connection.omega_h.decimals()
        return (
            f"Omega tends to Omega_h, |Omega_h - {middle} rad/s| <= {half_width} rad/s, at which (pi/2, -pi/2, 0) "
            "and (pi/2, 3 pi/2, 0) are connected by a heteroclinic orbit, and by its image under S; the period tends "
            "to infinity, and v_0 to 0"
        )

    @property
    def _alone(self) -> str:
        """What is proved of other cycles next to the connection."""
        if not self.proved or self.end is None:
            return ""
        low, high, gamma, v = map(exact_text, (self.end.low, self.end.high, self.end.gamma, self.end.v))
        return (
            f" P has no fixed point with 3 pi/2 - {gamma} <= gamma < 3 pi/2 and -{v} rad/s <= v < 0 for any Omega from "
            f"{low} rad/s to Omega_h, and none but these cycles' for any Omega from there to {high} rad/s."
        )

    @property
    def _reason(self) -> str:
        """Why the curve ends where it does."""
        if self.stopped is None:
            return "no more was asked for" if self.pieces else "nothing was tried"
        where = f"from gamma_bar_0 = {exact_text(self.pieces[-1].high if self.pieces else Fraction(0))} rad on"
        return f"{where} {self.stopped.value}"

    def to_dict(self) -> dict[str, object]:
        """For the command line."""
        hopf, share = self.hopf_closed, self.covered
        ends: dict[str, dict[str, object]] = {"hopf": {"closed": hopf}, "heteroclinic": {"closed": self.end_closed}}
        if not hopf:
            ends["hopf"]["reason"] = self._reason
        if not self.end_closed:
            reason = "no proof of the cycles next to the connection reaches the curve's end"
            if self.end is not None and not self.end.proved:
                reason = self.end.statement
            ends["heteroclinic"]["reason"] = f"{reason}; {self._reason}"
        elif self.end is not None:
            told = self.end.to_dict()
            ends["heteroclinic"] |= {name: told[name] for name in ("from", "to", "gamma", "v", "numbers")}
        entries: dict[str, object] = {
            "proved": self.proved,
            "covered": None if share is None else _decimals(share),
            "statement": self.statement,
            "ends": ends,
        }
        entries["omega_crit"] = omega_crit(self.parameters).to_dict()
        if self.connection is not None and self.connection.omega_h is not None and self.connection.proved:
            entries["omega_h"] = self.connection.omega_h.to_dict()
        if hopf:
            names = ("v_0_per_gamma_bar_0", "v_0", "omega")
            entries["amplitude_end"] = exact_text(self.pieces[-1].high)
            entries["omega_end"] = exact_text(self.omega_end or Fraction(0))
            entries["unique_within"] = dict(zip(names, map(rounded_down, self.unique_within()), strict=True))
        arcs = [piece.to_dict() for piece in self.pieces]
        return entries | {"arcs_read": self.read, "arcs": arcs, "parameters": self.parameters.name}


def hopf_closed(parameters: Parameters, piece: Piece) -> bool:
    """Whether a piece begins at the Hopf point.

    Raises InputError for a disk without the closed forms' hypotheses.
    """
    check_linearization(parameters.rational())
    known, middle, off = omega_crit(parameters), piece.at(Fraction(0))[1], piece.within[1]
    return piece.scaled and piece.low == 0 and abs(known.value - middle) + known.uncertainty <= off


def omega_crit(parameters: Parameters) -> Measured:
    """Enclosed [rad/s]."""
    with working_precision(_BITS):
        return measured(hopf_balls(ball_constants(parameters))["omega_crit"])


def _least(number: Measured) -> Fraction:
    return number.value - number.uncertainty


def _decimals(share: Fraction) -> str:
    return Measured(share, Fraction(0)).decimals()[0]
