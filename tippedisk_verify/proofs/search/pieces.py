"""Pieces of the family of limit cycles over the amplitude a = gamma_bar_0, proved, and that neighbours are one curve.

A piece is an arc of `arc` over an interval of a, or, at the Hopf point, one of `scaled` over an interval of a^2 that
begins at 0. Of each a in it (of each but 0) is proved

- that (v_0, Omega) has exactly one value within ``unique_within`` of the polynomials ``curve`` for which the orbit from
  (gamma_bar, v) = (a, v_0) on the section is a cycle that S maps to itself, and that it lies ``within`` of them;
- that these values are analytic in a, with Omega falling and the period and beta_max rising as a grows;
- that the cycle is asymptotically stable, crosses beta = pi/2 exactly twice a period, and stays upright.

**Gluing.** Let two pieces share a value of a, and let the enclosure of one of them there lie inside the other one's box
of uniqueness. Then both have the same cycle at that value. Each one's curve satisfies the same analytic equations
with a regular derivative by (v_0, Omega), so by the implicit function theorem they agree near that value: the pieces
are parts of one analytic curve. The comparison is one of rational numbers (`joined`).

The numbers of a piece are decimals, and are what was tested: it can be written down and read back without loss.

Where a ball becomes a point or a float: polynomials and boxes are chosen, and any choice that passes the test is right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from operator import sub
from typing import Any

from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.curve_flow import Curve
from tippedisk_verify.proofs.kernel.jets import Jet, negative, positive
from tippedisk_verify.proofs.kernel.scaled import ScaledCurve
from tippedisk_verify.proofs.search.arc import GAMMA_BAR, Arc, family_polynomials, krawczyk_test
from tippedisk_verify.proofs.search.cycle_interval import decimal_above, rounded_jet, two_digits

__all__ = ["SHARES", "Guess", "Piece", "Status", "joined", "on_curve", "prove_piece"]

_BITS, _DEGREE = 64, 4
SHARES = Fraction(1, 300), Fraction(1, 100)  # of the box's radii, at first, in how far the family moves
_LEAST = Fraction(1, 10**12)  # a box's radius [rad/s]
_MOST_ATTEMPTS = 3
#: Of a box of uniqueness in the family's slope times the distance to the connection (to 1 of a scaled piece's a^2).
_WIDE_SHARES = Fraction(1, 64), Fraction(1, 256)

Pair = tuple[Fraction, Fraction]
Rows = tuple[tuple[Fraction, ...], tuple[Fraction, ...]]  #: coefficients of two polynomials
Guess = tuple[Fraction, Fraction, Fraction]  #: v_0 (or v_0 / a) [rad/s], Omega [rad/s], half the period [s]


class Status(Enum):
    """Why a piece is not proved. The value says what failed."""

    NOT_FOLLOWED = "the orbits of all these amplitudes could not be followed from section to section"
    NOT_INCLUDED = "Krawczyk's image does not lie inside the box"
    RISING = "Omega grows with the amplitude"
    UNSTABLE = "the limit cycles are unstable"
    NOT_JOINED = "it is not proved that two pieces of the family are one curve"
    NOT_FALLING = "it is not proved that Omega falls as the amplitude grows"
    NOT_STABLE = "it is not proved that the limit cycles are asymptotically stable"
    NOT_SLOWING = "it is not proved that the period grows with the amplitude"
    NOT_WIDENING = "it is not proved that beta_max grows with the amplitude"


@dataclass(frozen=True)
class Piece:
    """What is proved of all amplitudes from ``low`` to ``high`` [rad].

    ``curve`` holds two polynomials of s, their coefficients beginning with that of s^0. Of an ordinary piece they are
    v_0 [rad/s] and Omega [rad/s], and s = (2 a - low - high) / (high - low). A ``scaled`` one begins at the Hopf point,
    low = 0; its first polynomial is v_0 / a [1/s], and s = 2 a^2 / high^2 - 1.
    """

    low: Fraction
    high: Fraction
    scaled: bool
    curve: Rows
    unique_within: Pair  #: of the polynomials
    within: Pair  #: of the polynomials lie the true values

    def at(self, amplitude: Fraction) -> Pair:
        """The polynomials' v_0 [rad/s] and Omega [rad/s]."""
        s = (2 * amplitude - self.low - self.high) / (self.high - self.low)
        if self.scaled:
            s = 2 * amplitude**2 / self.high**2 - 1
        first, second = (sum((part * s**k for k, part in enumerate(row)), Fraction(0)) for row in self.curve)
        return self.scaled_to(amplitude, (first, second))

    def scaled_to(self, amplitude: Fraction, values: Pair) -> Pair:
        """Values or distances of the polynomials as those of v_0 and Omega."""
        return values[0] * (amplitude if self.scaled else 1), values[1]

    def speeds(self, amplitude: Fraction) -> Pair:
        """Numbers between which Omega lies [rad/s]."""
        middle = self.at(amplitude)[1]
        return middle - self.within[1], middle + self.within[1]

    def to_dict(self) -> dict[str, object]:
        """Exact decimals."""
        return {
            "low": exact_text(self.low),
            "high": exact_text(self.high),
            "scaled": self.scaled,
            "curve": [[exact_text(part) for part in row] for row in self.curve],
            "unique_within": [exact_text(part) for part in self.unique_within],
            "within": [exact_text(part) for part in self.within],
        }

    @classmethod
    def read(cls, entry: Mapping[str, Any]) -> Piece:
        """What `json` gave. Raises KeyError, TypeError, ValueError or InputError for anything else."""
        unique, near = ((_decimal(x), _decimal(y)) for x, y in (entry["unique_within"], entry["within"]))
        low, high, scaled = _decimal(entry["low"]), _decimal(entry["high"]), entry["scaled"] is True
        return cls(low, high, scaled, _rows(entry["curve"]), unique, near)


def _rows(entry: Sequence[Any]) -> Rows:
    first, second = (tuple(_decimal(part) for part in row) for row in entry)
    return first, second


def _decimal(text: object) -> Fraction:
    return exact(text).rational


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


def on_curve(piece: Piece, gamma_bar: Measured, v: Measured, omega: Measured) -> bool:
    """Whether a cycle that S maps to itself, with numbers in these intervals, is proved to be one of the piece's.

    For each gamma_bar_0 of its interval those of v_0 and Omega must lie inside the box of uniqueness.
    """
    ends = [gamma_bar.value - gamma_bar.uncertainty, gamma_bar.value + gamma_bar.uncertainty]
    if not piece.low <= ends[0] <= ends[1] <= piece.high or ends[0] <= 0:
        return False
    with working_precision(_BITS):
        amplitude, *numbers = (ball(x.value) + arb(0, ball(x.uncertainty)) for x in (gamma_bar, v, omega))
        s = (2 * amplitude - ball(piece.low) - ball(piece.high)) / ball(piece.high - piece.low)
        if piece.scaled:
            s, numbers[0] = 2 * amplitude * amplitude / ball(piece.high**2) - 1, numbers[0] / amplitude
        off = [x - Jet([ball(part) for part in row]).at(s) for x, row in zip(numbers, piece.curve, strict=True)]
        return all(negative(abs(x) - ball(room)) for x, room in zip(off, piece.unique_within, strict=True))


def prove_piece(
    parameters: Parameters,
    low: Fraction,
    high: Fraction,
    guess: Guess,
    *,
    scaled: bool = False,
) -> Piece | Status:
    """Prove the family from one amplitude to another [rad].

    ``guess`` belongs to the middle, of a or (``scaled``) of a^2.
    """
    kind = ScaledCurve if scaled else Curve
    ends = (low**2, high**2) if scaled else (low, high)
    middle, length = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
    with working_precision(_BITS):
        constants = ball_constants(parameters)
        start = [ball(part) for part in (middle, *guess[:2])]
        polynomials, half = family_polynomials(
            constants, start, ball(length), _DEGREE, ball(guess[2]).mid(), GAMMA_BAR, kind
        )
        if not all(part.is_finite() for jet in (*polynomials, half) for part in jet.c):
            return Status.NOT_FOLLOWED
        rows = rounded_jet(polynomials[1]), rounded_jet(polynomials[2])
        amplitudes = Jet([ball(middle), ball(length), *[arb(0)] * (_DEGREE - 1)])
        v, speeds = (Jet([ball(part) for part in row]) for row in rows)
        radii = [two_digits(max(abs(row[1]) * share, _LEAST)) for row, share in zip(rows, SHARES, strict=True)]

        def test(radii: Sequence[Fraction]) -> Arc:
            deviation = [arb(0), *(arb(0, ball(part)) for part in radii)]
            return krawczyk_test(constants, kind(amplitudes, v, speeds, deviation), half, GAMMA_BAR)

        for _ in range(_MOST_ATTEMPTS):
            arc = test(radii)
            if not (arc.flight.proved and all(part.is_finite() for part in arc.within)):
                return Status.NOT_FOLLOWED
            held = [decimal_above(abs(part)) for part in arc.within]
            if arc.proved and all(a < b for a, b in zip(held, radii, strict=True)):
                if refusal := _refusal(arc):
                    # Derivatives over a smaller box may show what those over this one do not.
                    failed, smaller = refusal, [two_digits(part * 5 / 4) for part in held]
                    if 2 * smaller[0] > radii[0] or 2 * smaller[1] > radii[1]:
                        break
                    radii = smaller
                    continue
                # The box of uniqueness may be wider than that which shows the signs.
                room = Fraction(1) if scaled else max(Fraction(22, 7) - high, _LEAST)
                slopes = [max(abs(row[1]) / length, _LEAST) for row in rows]
                wider = ([two_digits(slope * room * share) for slope in slopes] for share in _WIDE_SHARES)
                around = next((wide for wide in wider if min(map(sub, wide, radii)) > 0 and test(wide).proved), radii)
                held_within, unique = (held[0], held[1]), (around[0], around[1])
                return Piece(low, high, scaled, rows, unique, held_within)
            failed, radii = Status.NOT_INCLUDED, [two_digits(2 * part) for part in held]
        return failed


def _refusal(arc: Arc) -> Status | None:
    """What is not proved of an arc that Krawczyk's test has passed."""
    if not arc.falling():
        return Status.RISING if positive(arc.slopes[1].range()) else Status.NOT_FALLING
    if not arc.stable():
        return Status.UNSTABLE if arc.unstable() else Status.NOT_STABLE
    if not arc.slowing():
        return Status.NOT_SLOWING
    return None if arc.widening() else Status.NOT_WIDENING
