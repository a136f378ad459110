"""Arcs of the family of limit cycles over the amplitude: polynomials and boxes that `kernel.claims.arcs` accepts.

Where a ball becomes a point or a float: polynomials and boxes are chosen, and any choice that passes the test is right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from operator import sub
from typing import Any

from tippedisk_verify.model.decimals import exact_text, rounded_up
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.kernel.arc import GAMMA_BAR, Arc
from tippedisk_verify.proofs.kernel.balls import Unproved, ball, working_precision
from tippedisk_verify.proofs.kernel.claims.arcs import Pair, Piece, Rows, Status, box_test, signs, upper_bound
from tippedisk_verify.proofs.kernel.curves import Curve
from tippedisk_verify.proofs.kernel.field import constants
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.scaled import ScaledCurve
from tippedisk_verify.proofs.numbers import WIDER, measured
from tippedisk_verify.proofs.search.certificate import parameter_texts
from tippedisk_verify.proofs.search.curve_choices import StepSearch, family_polynomials

__all__ = ["BITS", "Guess", "decimal_above", "piece_entry", "prove_piece", "read_piece", "rounded_jet",
           "two_digits"]  # fmt: skip

BITS, _DEGREE = 64, 4
_PLACES = 16  # decimals of the polynomials' coefficients
_SHARES = Fraction(1, 300), Fraction(1, 100)  # of the box's radii, at first, in how far the family moves
_LEAST = Fraction(1, 10**12)  # a box's radius [rad/s]
_MOST_ATTEMPTS = 3
#: Of a box of uniqueness in the family's slope times the distance to the connection (to 1 of a scaled piece's a^2).
_WIDE_SHARES = Fraction(1, 64), Fraction(1, 256)

Guess = tuple[Fraction, Fraction, Fraction]  #: v_0 (or v_0 / a) [rad/s], Omega [rad/s], half the period [s]
Box = tuple[Arc, dict[str, Any]]  #: a test, and the evidence for it


def prove_piece(parameters: Parameters, low: Fraction, high: Fraction, guess: Guess) -> Piece | Status:
    """Prove the family from one amplitude to another [rad]; from 0 on by scaled states.

    ``guess`` belongs to the middle, of a or, from 0 on, of a^2.
    """
    kind = Curve if low else ScaledCurve
    ends = (low, high) if low else (low, high**2)
    middle, length = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
    disk = parameter_texts(parameters)
    with working_precision(BITS):
        start = [ball(number) for number in (middle, *guess[:2])]
        polynomials, half = family_polynomials(
            constants(disk), start, ball(length), _DEGREE, ball(guess[2]).mid(), GAMMA_BAR, kind
        )
        if not all(entry.is_finite() for jet in (*polynomials, half) for entry in jet.c):
            return Status.NOT_FOLLOWED
        rows = rounded_jet(polynomials[1]), rounded_jet(polynomials[2])
        evidence: dict[str, Any] = {
            "end": exact_text(high),
            "curve": [list(map(exact_text, row)) for row in rows],
            "half": list(map(exact_text, rounded_jet(half))),
            "bits": BITS,
        }

        def test(radii: Sequence[Fraction]) -> Box | None:
            choices = StepSearch()
            try:
                arc = box_test(disk, low, evidence, radii, choices)
            except Unproved:
                return None
            return (arc, {"radii": list(map(exact_text, radii)), "steps": choices.log})

        failed = Status.NOT_INCLUDED
        radii = [two_digits(max(abs(row[1]) * share, _LEAST)) for row, share in zip(rows, _SHARES, strict=True)]
        for _ in range(_MOST_ATTEMPTS):
            tested = test(radii)
            if tested is None or not all(off.is_finite() for off in tested[0].within):
                return Status.NOT_FOLLOWED
            arc, box = tested
            within = [decimal_above(off) for off in arc.within]
            if arc.included and all(a < b for a, b in zip(within, radii, strict=True)):
                refusal = signs(arc)
                if refusal is None:
                    # The box of uniqueness may be wider than that which shows the signs.
                    room = max(Fraction(22, 7) - high, _LEAST) if low else Fraction(1)
                    slopes = [max(abs(row[1]) / length, _LEAST) for row in rows]
                    unique, more = radii, {}
                    for share in _WIDE_SHARES:
                        wide = [two_digits(slope * room * share) for slope in slopes]
                        if min(map(sub, wide, radii)) > 0 and (wider := test(wide)) is not None and wider[0].included:
                            unique, more = wide, {"wide box": wider[1]}
                            break
                    evidence |= {"box": box} | more
                    return Piece(low, high, rows, (unique[0], unique[1]), (within[0], within[1]), evidence)
                # Derivatives over a smaller box may show what those over this one do not.
                failed, smaller = refusal, [two_digits(part * 5 / 4) for part in within]
                if 2 * smaller[0] > radii[0] or 2 * smaller[1] > radii[1]:
                    break
                radii = smaller
            else:
                failed, radii = Status.NOT_INCLUDED, [two_digits(2 * part) for part in within]
        return failed


def piece_entry(piece: Piece) -> dict[str, object]:
    """A piece without its evidence, in exact decimals."""
    return {
        "low": exact_text(piece.low),
        "high": exact_text(piece.high),
        "scaled": piece.scaled,
        "curve": [[exact_text(part) for part in row] for row in piece.curve],
        "unique_within": [exact_text(part) for part in piece.unique_within],
        "within": [exact_text(part) for part in piece.within],
    }


def read_piece(entry: Mapping[str, Any], evidence: Mapping[str, Any]) -> Piece:
    """What `json` gave. Raises KeyError, TypeError, ValueError or InputError for anything else."""
    rows: Rows
    unique: Pair
    near: Pair
    first, second = (tuple(_decimal(part) for part in row) for row in entry["curve"])
    rows = first, second
    unique, near = ((_decimal(x), _decimal(y)) for x, y in (entry["unique_within"], entry["within"]))
    return Piece(_decimal(entry["low"]), _decimal(entry["high"]), rows, unique, near, evidence)


def _decimal(text: object) -> Fraction:
    return exact(text).rational


def rounded_jet(jet: Jet) -> tuple[Fraction, ...]:
    """Decimals near the midpoints."""
    return tuple(round(measured(part.mid()).value, _PLACES) for part in jet.c)


def two_digits(value: Fraction) -> Fraction:
    """The least decimal of two digits that is not smaller."""
    return Fraction(rounded_up(value))


def decimal_above(x: Any) -> Fraction:
    """A decimal of two digits that the sizes in the finite ball stay below by some 2^-20 of it."""
    return two_digits(max(upper_bound(x) * WIDER, Fraction(1, 10**30)))
