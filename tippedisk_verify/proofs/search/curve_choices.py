"""Arcs of the family of limit cycles: polynomials, boxes, steps and axes that the kernel is likely to accept.

Where a ball becomes a point or a float: everywhere. What is proposed here `kernel.curves`, `kernel.arc` and
`kernel.claims.arcs` test, and any choice that passes is right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from operator import sub
from typing import Any

from tippedisk_verify.model.decimals import exact_text, rounded_up
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs.kernel.arc import GAMMA_BAR, UNKNOWNS, Arc, inverse
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, need, working_precision
from tippedisk_verify.proofs.kernel.claims.arcs import Piece, Status, box_test, signs, upper_bound
from tippedisk_verify.proofs.kernel.curves import ORDERS, Curve, CurvePath, Matrix
from tippedisk_verify.proofs.kernel.field import Constants, constants
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.scaled import ScaledCurve
from tippedisk_verify.proofs.kernel.step import Step, polynomial
from tippedisk_verify.proofs.numbers import WIDER, measured
from tippedisk_verify.proofs.search.axes import axes_of_balls
from tippedisk_verify.proofs.search.certificate import parameter_texts

__all__ = ["BITS", "Guess", "StepSearch", "decimal_above", "duration", "family_polynomials", "piece_entry",
           "prove_piece", "rounded_jet", "two_digits"]  # fmt: skip

BITS, _DEGREE = 64, 4
_PLACES = 16  # decimals of the polynomials' coefficients
_SHARES = Fraction(1, 300), Fraction(1, 100)  # of the box's radii, at first, in how far the family moves
_LEAST = Fraction(1, 10**12)  # a box's radius [rad/s]
_MOST_ATTEMPTS = 3
#: Of a box of uniqueness in the family's slope times the distance to the connection (to 1 of a scaled piece's a^2).
_WIDE_SHARES = Fraction(1, 64), Fraction(1, 256)

Guess = tuple[Fraction, Fraction, Fraction]  #: v_0 (or v_0 / a) [rad/s], Omega [rad/s], half the period [s]
Box = tuple[Arc, dict[str, Any]]  #: a test, and the evidence for it
_TOLERANCE, _ROUGH_TOLERANCE = -56, -30  #: log2 of the last terms: of states, and of derivatives
_FIRST_SHARE, _LONGEST_SHARE = 0.01, 0.03  #: of the time of flight, for a step
_MOST_STEPS, _MOST_TRIALS = 2000, 15
_LONGEST = 60  # s
_NEWTON_STEPS = 8
_TINY = 2.0**-20  # of a number's step, for a derivative of points
_POLISHES = 3  # chord steps towards the cycle at s = 0


class StepSearch:
    """Proposes the steps of one flight, each after trials of its length, and keeps what was taken in ``log``.

    What is proposed is rounded to a few digits first, so that the log has just that.
    """

    def __init__(self) -> None:
        self.log: list[dict[str, Any]] = []
        self._done, self._share = 0.0, _FIRST_SHARE

    def step(self, path: CurvePath, longest: Any) -> Step:
        """One with small remainders; the return lies in it or well beyond it."""
        need(len(self.log) < _MOST_STEPS, "the flight takes too many steps")
        trial = path.trial(ORDERS)
        for _ in range(_MOST_TRIALS):
            text = self._next()
            share = float(text)
            step = path.step_of(trial, share)
            excess = max(_excess(step.derivatives, step, ORDERS[1] + 1, _ROUGH_TOLERANCE),
                         _excess(step.polynomials, step, ORDERS[0] + 1, _TOLERANCE))  # fmt: skip
            # The length that would do, times 0.9 because remainders grow with the box as well.
            self._share = share * min(1.3, max(0.3, 0.9 * 2.0**-excess))
            if excess <= 0 and step.included:
                break
            self._share = min(self._share, 0.8 * share)
        self._done += share
        self.log.append({"share": text})
        return step

    def _next(self) -> str:
        """The share to try; if the return lies in that step, it lies well off both ends."""
        left = 1 - self._done
        return f"{left + 0.3 * self._share if left <= 0.7 * self._share else min(self._share, 0.6 * left):.4g}"

    def took(self, step: Step, axes: Matrix | None) -> None:
        """Nothing is noted."""

    def axes(self, turned: Matrix, sizes: Sequence[float], stiffness: float) -> Matrix:
        """Those of `axes`, rounded."""
        axes = axes_of_balls(turned, sizes, stiffness)
        texts = [[f"{float(entry):.4g}".replace("e+", "e") for entry in row] for row in axes]
        self.log[-1]["axes"] = texts
        return [[arb(float(text)) for text in row] for row in texts]


def _excess(series: Sequence[Sequence[Jet]], step: Step, power: int, tolerance: int) -> float:
    """By how much log2 of a length is too large for remainders that grow like its ``power``."""
    size = max(float(part[-1].c[0].abs_upper()) for part in series)
    length = float(step.length.c[0].mid())
    if not (math.isfinite(size) and length > 0):
        return math.inf
    return (math.log2(size) - tolerance) / power + math.log2(length) if size else -math.inf


def glide(constants: Constants, curve: Curve) -> tuple[Sequence[Jet], Jet]:
    """Roughly the image (gamma_bar, v) of the curve itself and its time: midpoints."""
    orbit = curve.equations(constants, *curve.numbers).orbit_at(curve.omega)
    total = curve.total
    state, time, done = [0 * curve.v.mid(), *curve.start], 0 * total, 0.0
    for _ in range(_MOST_STEPS):
        series = orbit.coefficients(state, ORDERS[0])
        # In longer steps the balls left over would swamp the midpoints.
        reach = min(_LONGEST_SHARE, _reach(series) / float(total.c[0].mid()))
        if 1 - done < reach / 2:
            break
        length = (total * min(reach, 1 - done)).mid()
        state, time, done = [polynomial(part, length).mid() for part in series], time + length, done + reach
    tau = _moment(series, 0 * total)
    return [-polynomial(part, tau).mid() for part in series[1:]], (tau + time).mid()


def duration(constants: Constants, omega: Any, gamma_bar: Any, v: Any) -> Any:
    """About how long a half map takes from one point [s]; None if it does not return within a minute."""
    orbit = Model(constants, omega).orbit
    state, time = [Jet([arb(0)]), Jet([arb(gamma_bar).mid()]), Jet([arb(v).mid()])], arb(0)
    for _ in range(_MOST_STEPS):
        series = orbit.coefficients(state, ORDERS[0])
        length = arb(_reach(series))
        if not (length > 0 and time < _LONGEST):
            return None
        end = [polynomial(part, length).mid() for part in series]
        if not all(part.c[0].is_finite() for part in end):
            return None
        if end[0].c[0] > 0 and end[2].c[0] > 0:
            return (time + _moment(series, Jet([length / 2])).c[0]).mid()
        state, time = end, (time + length).mid()
    return None


def _reach(series: Sequence[Sequence[Jet]]) -> float:
    """For how long [s] the last two terms stay below 2^_TOLERANCE, roughly."""
    sizes = [(float(part[n].c[0].abs_upper()), n) for part in series for n in (ORDERS[0] - 1, ORDERS[0])]
    if not all(math.isfinite(size) for size, _ in sizes):
        return 0.0
    return min(1.0, *(math.exp2((_TOLERANCE - math.log2(size)) / n) for size, n in sizes if size))


def _moment(polynomials: Sequence[Sequence[Jet]], guess: Jet) -> Jet:
    """About when beta_bar is 0 in a step: points."""
    beta, _, v = ([jet.mid() for jet in part] for part in polynomials)
    tau = guess.mid()
    for _ in range(_NEWTON_STEPS):
        tau = (tau - polynomial(beta, tau) / polynomial(v, tau)).mid()
    return tau


def family_polynomials(
    constants: Constants, start: Sequence[Any], radius: Any, degree: int, total: Any, over: int, kind: type[Curve]
) -> tuple[list[Jet], Jet]:
    """Taylor polynomials in s of (gamma_bar, v, Omega) along the family, and of half the period: points.

    ``start`` is near the cycle at s = 0; number ``over`` of the three moves by ``radius`` as s grows by 1. With Y
    constant, a chord step finds the coefficient of s^k once those before it are known.
    """
    zero = 0 * start[0]
    point = [part.mid() for part in start]
    free = UNKNOWNS[over]
    columns = (_slope(constants, kind, point, total, k) for k in free)
    chord = inverse(list(zip(*columns, strict=True)))
    polynomials = [[part] for part in point]
    half = Jet([total])
    for k in (*[0] * _POLISHES, *range(1, degree + 1)):
        if len(polynomials[0]) == k:
            for part in polynomials:
                part.append(zero)
            half = Jet([*half.c, zero])
            if k == 1:
                polynomials[over][1] = radius
        first, v, speed = map(Jet, polynomials)
        curve = kind(first, v, speed, [zero] * 3, half)
        image, half = glide(constants, curve)
        value = [after.c[k] - before.c[k] for after, before in zip(image, curve.start, strict=True)]
        for row, index in zip(chord, free, strict=True):
            polynomials[index][k] = (polynomials[index][k] - row[0] * value[0] - row[1] * value[1]).mid()
    return [Jet(part) for part in polynomials], half


def _slope(constants: Constants, kind: type[Curve], point: Sequence[Any], half: Any, moving: int) -> list[Any]:
    """Roughly dF by one of the three numbers."""
    zero = 0 * point[0]
    first, v, speed = (Jet([part, zero + _TINY * int(moving == j)]) for j, part in enumerate(point))
    image, _ = glide(constants, kind(first, v, speed, [zero] * 3, Jet.constant(half, 1)))
    return [(part.c[1] / _TINY).mid() - own[moving] for part, own in zip(image, kind.unit, strict=True)]


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


def rounded_jet(jet: Jet) -> tuple[Fraction, ...]:
    """Decimals near the midpoints."""
    return tuple(round(measured(part.mid()).value, _PLACES) for part in jet.c)


def two_digits(value: Fraction) -> Fraction:
    """The least decimal of two digits that is not smaller."""
    return Fraction(rounded_up(value))


def decimal_above(x: Any) -> Fraction:
    """A decimal of two digits that the sizes in the finite ball stay below by some 2^-20 of it."""
    return two_digits(max(upper_bound(x) * WIDER, Fraction(1, 10**30)))
