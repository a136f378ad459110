"""The family of limit cycles from the Hopf point on: arcs that are one curve, and what is claimed of it.

The first arc begins at the Hopf point, gamma_bar_0 = 0; each next one begins where the last one ends. Theorem 5b of
docs/certified.md says why arcs are one curve if the enclosure of one's cycle, where they meet, lies in the other one's
box of uniqueness; the comparison is one of rational numbers (`joined`). So what falls or grows strictly on each arc
does so on all of it. It says as well why the last arc's cycle joins the curve to the cycles next to the connection.

At gamma_bar_0 = 0 the pair of imaginary eigenvalues has the half period t with exp(A t) x = -x. Its b is a sinusoid,
and the flight shows that it has no zero inside the half period: the period is that of the pair. The enclosures are
checked to hold the closed form's Omega_crit all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tippedisk_verify.proofs.kernel.balls import arb, ball, need
from tippedisk_verify.proofs.kernel.claims import connection_cycles
from tippedisk_verify.proofs.kernel.claims.arcs import ARC, Job, Piece, piece_shown
from tippedisk_verify.proofs.kernel.claims.words import DISK, disk_words, held, number_words
from tippedisk_verify.proofs.kernel.field import constants
from tippedisk_verify.proofs.kernel.reading import MEASURED, decimal, one_of

__all__ = ["KINDS", "curve_fault", "joined", "last_cycle", "omega_crit", "sentence", "shape", "show",
           "unique_within"]  # fmt: skip

KINDS = {"family of limit cycles": False, "whole family of limit cycles": True}  #: whether up to the connection
_ROOMS = ("v_0_per_gamma_bar_0", "v_0", "omega")

Mapped = Callable[[Callable[[Job], Piece], Sequence[Job]], Iterable[Piece]]  #: `map`, or that of a pool of processes


def joined(first: Piece, second: Piece, amplitude: Fraction) -> bool:
    """Whether both pieces hold this positive amplitude and are proved to have the same cycle there."""
    if not all(piece.low <= amplitude <= piece.high for piece in (first, second)) or amplitude <= 0:
        return False
    return _known_in(first, second, amplitude) or _known_in(second, first, amplitude)


def _known_in(first: Piece, second: Piece, amplitude: Fraction) -> bool:
    """Whether what encloses the first one's cycle lies in the second one's box of uniqueness."""
    parts = zip(
        first.at(amplitude),
        first.scaled_to(amplitude, first.within),
        second.at(amplitude),
        second.scaled_to(amplitude, second.unique_within),
        strict=True,
    )
    return all(abs(mine - theirs) + near <= room for mine, near, theirs, room in parts)


def omega_crit(disk: Mapping[str, str]) -> Any:
    """A ball that holds it [rad/s]."""
    c = constants(disk)
    return (c.r + c.e) * (c.g / (c.r * c.b)).sqrt()


def curve_fault(disk: Mapping[str, str], pieces: Sequence[Piece]) -> str:
    """Why the pieces are not shown to be one curve from the Hopf point on; nothing if they are."""
    if not pieces:
        return "there are no arcs"
    off = omega_crit(disk) - ball(pieces[0].at(Fraction(0))[1])
    if not (pieces[0].scaled and bool(abs(off) <= ball(pieces[0].within[1]))):
        return "arc 1: it is not shown to begin at the Hopf point"
    for number, (first, second) in enumerate(pairwise(pieces), 2):
        if first.high != second.low or not joined(first, second, second.low):
            return f"arcs {number - 1} and {number} are not shown to be one curve"
    return ""


def unique_within(pieces: Sequence[Piece]) -> tuple[Fraction, Fraction, Fraction]:
    """Distances from every cycle of the curve within which there is no other of the same gamma_bar_0.

    Of v_0 / gamma_bar_0 [1/s] on the first piece, of v_0 [rad/s] on the others, and of Omega [rad/s].
    """
    rooms = [[room - near for room, near in zip(piece.unique_within, piece.within, strict=True)] for piece in pieces]
    later = [room[0] for room in rooms[1:]] or [rooms[0][0]]
    return rooms[0][0], min(later), min(room[1] for room in rooms)


def last_cycle(pieces: Sequence[Piece]) -> tuple[Any, Any, Any]:
    """Balls of Omega, gamma_bar_0 and v_0 where the last piece ends."""
    last = pieces[-1]
    middle, off = last.at(last.high), last.scaled_to(last.high, last.within)
    v, omega = (ball(x) + arb(0, 1) * ball(near) for x, near in zip(middle, off, strict=True))
    return omega, ball(last.high), v


def shape(kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a claim and its evidence have."""
    numbers = dict.fromkeys(("omega_crit", "omega_h") if KINDS[kind] else ("omega_crit",), MEASURED)
    claim = {
        **DISK, "kind": str, "friction": one_of("linear"), "numbers": numbers,
        **dict.fromkeys(("amplitude_first", "amplitude_end", "omega_end"), decimal),
        "unique_within": dict.fromkeys(_ROOMS, decimal),
    }  # fmt: skip
    evidence: dict[str, Any] = {"arcs": [ARC, None]}
    if KINDS[kind]:
        return claim | connection_cycles.CLAIM, evidence | {"end": connection_cycles.EVIDENCE}
    return claim, evidence


def show(claim: Mapping[str, Any], evidence: Mapping[str, Any], mapped: Mapped = map) -> None:
    """Raises Unproved if the evidence does not prove the claim. ``mapped`` shows the arcs, which are independent."""
    disk, arcs = claim["parameters"], evidence["arcs"]
    lows = [Fraction(0), *(Fraction(arc["end"]) for arc in arcs)]
    jobs = [(disk, low, k, arc) for k, (low, arc) in enumerate(zip(lows, arcs, strict=False), 1)]
    pieces = list(mapped(piece_shown, jobs))
    fault = curve_fault(disk, pieces)
    need(not fault, fault)
    for name, amplitude in (("amplitude_first", pieces[0].high), ("amplitude_end", pieces[-1].high)):
        need(Fraction(claim[name]) == amplitude, f"claim: {name} is not the amplitude at which an arc ends")
    highest = pieces[-1].speeds(pieces[-1].high)[1]
    need(highest <= Fraction(claim["omega_end"]), "claim: omega_end is not shown to lie above the last cycle's speed")
    held(claim["numbers"]["omega_crit"], omega_crit(disk), "omega_crit")
    for name, room in zip(_ROOMS, unique_within(pieces), strict=True):
        need(room >= Fraction(claim["unique_within"][name]) > 0, f"claim: no other {name} is so near, is not shown")
    if KINDS[claim["kind"]]:
        meets = connection_cycles.show(claim, evidence["end"]).meets(*last_cycle(pieces))
        need(meets, "the last arc is not shown to run into the cycles next to the connection")


def sentence(claim: Mapping[str, Any]) -> str:
    """What is claimed, in some sentences."""
    last, room, whole = f"{claim['amplitude_end']} rad", claim["unique_within"], KINDS[claim["kind"]]
    numbers = number_words(claim)
    if whole:
        amplitudes = "(0, pi)"
        speeds = (
            f"as a tends to pi Omega tends to Omega_h = {numbers['omega_h']} rad/s, at which (pi/2, -pi/2, 0) and "
            "(pi/2, 3 pi/2, 0) are connected by a heteroclinic orbit, and by its image under S; the period tends to "
            "infinity, and v_0 to 0; each Omega with Omega_h < Omega < Omega_crit"
        )
        low, high = claim["low"], claim["high"]
        beyond = (
            f" P has no fixed point with 3 pi/2 - {claim['gamma']} <= gamma < 3 pi/2 and -{claim['v']} rad/s <= v < 0 "
            f"for any Omega from {low} rad/s to Omega_h, and none but these cycles' for any Omega from there to {high} "
            f"rad/s. Of the speeds from {low} to {high} rad/s Omega_h is the only one at which the branch of the "
            "unstable manifold of (beta, gamma, v) = (pi/2, -pi/2, 0) that leaves with growing gamma converges to "
            "(pi/2, 3 pi/2, 0) with gamma growing all the way."
        )
    else:
        amplitudes, beyond = f"(0, {last.removesuffix(' rad')}] rad", ""
        speeds = (
            f"at a = {last} Omega is at most {claim['omega_end']} rad/s, so that each Omega from there up to, but "
            "without, Omega_crit"
        )
    return (
        f"{disk_words(claim)}, gamma being a real number, not an angle, there are analytic functions v_0(a) < 0 and "
        f"Omega(a) of a in {amplitudes} such that at the speed Omega(a) the orbit from beta = pi/2, gamma = pi/2 + a "
        "with beta' = v_0(a) is an asymptotically stable limit cycle, which S, (beta, gamma, v) -> (pi - beta, pi - "
        "gamma, -v), maps to itself, which crosses beta = pi/2 exactly twice a period, and on which |beta - pi/2| is "
        "less than pi/2; as a grows Omega falls strictly, and the period and the largest |beta - pi/2| grow strictly; "
        "as a tends to 0 the cycle shrinks to inverted spinning, Omega tends to Omega_crit = "
        f"{numbers['omega_crit']} rad/s, where a pair of eigenvalues crosses the imaginary axis, and the period tends "
        "to 2 pi over their imaginary part; "
        f"{speeds} is the speed of exactly one of these cycles. Let P be the half-period map, along the flow at the "
        "speed Omega from beta = pi/2, v < 0 to the next crossing of beta = pi/2, with |beta - pi/2| < pi/2 between, "
        f"and then by S. For no a with 0 < a <= {last} there is another (v, Omega), v < 0, for which P has the fixed "
        f"point gamma = pi/2 + a, v, with |Omega - Omega(a)| <= {room['omega']} rad/s and, where a <= "
        f"{claim['amplitude_first']} rad, |v - v_0(a)| <= {room['v_0_per_gamma_bar_0']} a/s, where a is larger, |v - "
        f"v_0(a)| <= {room['v_0']} rad/s.{beyond}"
    )
