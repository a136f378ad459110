"""Certificates of the family of limit cycles: what `checker` needs to prove it again, arc by arc.

A proved piece says how far its polynomials and boxes reach. The flights are made once more for what else is written
down: steps, and the axes of sets. Polynomials are turned into sums of Chebyshev polynomials, exactly. Each arc has been
shown by the checker before it is written.

Where a ball becomes a point or a float: everything does, and any choice that passes the checker is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from fractions import Fraction
from math import comb
from typing import Any

import numpy as np

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.decimals import exact_text, rounded_down
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.kernel.balls import arb, ball, ball_constants, working_precision
from tippedisk_verify.proofs.kernel.curve_flow import Curve, duration
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.reading import dyadic_text as dyadic
from tippedisk_verify.proofs.kernel.scaled import ScaledCurve
from tippedisk_verify.proofs.search.arc import GAMMA_BAR, family_polynomials, krawczyk_test
from tippedisk_verify.proofs.search.branch import BranchProof, omega_crit
from tippedisk_verify.proofs.search.certificate import checked_text, parameter_texts
from tippedisk_verify.proofs.search.cover import hopf_guess
from tippedisk_verify.proofs.search.cycle_interval import two_digits
from tippedisk_verify.proofs.search.pieces import SHARES, Piece

__all__ = ["family_certificate"]

_BITS, _CLAIM_BITS = 64, 160  # for the arcs, and for numbers with sixteen digits
_LEAST = Fraction(1, 10**12)  # a box's radius [rad/s]
_WIDER = Fraction(5, 4)
_OF_THE_END = ("low", "high", "gamma", "v")

Written = tuple[dict[str, Any], checker.Shown]


def family_certificate(
    proof: BranchProof, executor: Executor | None = None, watch: Callable[[int], None] = lambda done: None
) -> str:
    """The text of a certificate for the pieces from the Hopf point on.

    ``watch`` is told how many arcs are written. Raises Shortfall if none can be written.
    """
    if not proof.hopf_closed:
        raise Shortfall("no certificate: nothing is proved from the Hopf point on")
    jobs = [(proof.parameters, piece, number) for number, piece in enumerate(proof.pieces, 1)]
    written: list[Written] = []
    for found in (map if executor is None else executor.map)(_written, jobs):
        written.append(found)
        watch(len(written))
    names = ("v_0_per_gamma_bar_0", "v_0", "omega")
    claim: dict[str, Any] = {
        "kind": "family of limit cycles",
        "parameters": parameter_texts(proof.parameters),
        "amplitude_first": exact_text(proof.pieces[0].high),
        "amplitude_end": exact_text(proof.pieces[-1].high),
        "omega_end": exact_text(proof.omega_end or Fraction(0)),
        "numbers": {"omega_crit": omega_crit(proof.parameters).to_dict()},
        "unique_within": dict(zip(names, map(rounded_down, proof.unique_within()), strict=True)),
    }
    bits = _CLAIM_BITS
    evidence: dict[str, Any] = {"arcs": [entry for entry, _ in written]}
    try:
        if proof.end is not None and proof.end_closed:
            bits = max(bits, proof.end.connection.bits)
            told = proof.end.claim()
            claim |= {"kind": "whole family of limit cycles"} | {name: told[name] for name in _OF_THE_END}
            claim["numbers"] |= told["numbers"]
            evidence["end"] = proof.end.evidence()
        return checked_text(claim, bits, evidence, lambda function, arcs: [shown for _, shown in written])
    except (checker.Unproved, checker.Refused) as fault:
        raise Shortfall(f"no certificate that the checker accepts could be made: {fault}") from None


def _written(job: tuple[Parameters, Piece, int]) -> Written:
    """One arc, and what the checker has shown of it. Raises Shortfall."""
    parameters, piece, number = job
    fault: Exception = Shortfall("no attempt")
    with working_precision(_BITS):
        flights = _Flights(parameters, piece)
        narrow = [max(abs(row[1]) * share, _LEAST) for row, share in zip(piece.curve, SHARES, strict=True)]
        entry: dict[str, Any] = {
            "end": exact_text(piece.high),
            "curve": [list(map(exact_text, chebyshev(row))) for row in piece.curve],
            "half": [dyadic(ball(part).mid()) for part in chebyshev(flights.half.c)],
            "bits": _BITS,
        }
        disk = parameter_texts(parameters)
        for radii in (narrow, [part * _WIDER for part in piece.within]):
            box = [min(two_digits(part), room) for part, room in zip(radii, piece.unique_within, strict=True)]
            entry["box"] = flights.box(box)
            if box != list(piece.unique_within) and "wide box" not in entry:
                entry["wide box"] = flights.box(piece.unique_within)
            try:
                return entry, checker.arc_shown((disk, piece.low, number, entry))
            except (checker.Unproved, checker.Refused) as failed:
                fault = failed
    raise Shortfall(f"no certificate that the checker accepts could be made: {fault}")


class _Flights:
    """Flights over a piece's polynomials, at the working precision."""

    def __init__(self, parameters: Parameters, piece: Piece) -> None:
        self.kind: type[Curve] = ScaledCurve if piece.scaled else Curve
        self.constants = ball_constants(parameters)
        ends = (piece.low**2, piece.high**2) if piece.scaled else (piece.low, piece.high)
        middle, length = ball((ends[0] + ends[1]) / 2), ball((ends[1] - ends[0]) / 2)
        self.polynomials = [Jet([ball(part) for part in row]) for row in piece.curve]
        degree = self.polynomials[0].degree
        self.amplitudes = Jet([middle, length, *[arb(0)] * (degree - 1)])
        start = [middle, *(row.c[0] for row in self.polynomials)]
        guess: Any = duration(Model(self.constants, start[2]), start[0], start[1])
        if piece.scaled:
            guess = ball(hopf_guess(parameters)[2])
        self.half = family_polynomials(self.constants, start, length, degree, guess.mid(), GAMMA_BAR, self.kind)[1]

    def box(self, radii: Sequence[Fraction]) -> dict[str, Any]:
        """A box's part of the file: its radii, and the steps of the flight."""
        deviation = [arb(0), *(arb(0, ball(part)) for part in radii)]
        curve = self.kind(self.amplitudes, self.polynomials[0], self.polynomials[1], deviation)
        arc = krawczyk_test(self.constants, curve, self.half, GAMMA_BAR)
        steps = []
        for share, axes in arc.flight.steps:
            step: dict[str, Any] = {"share": dyadic(arb(share))}
            if axes is not None:
                step["axes"] = [[_short(part) for part in row] for row in axes]
            steps.append(step)
        return {"radii": [exact_text(part) for part in radii], "steps": steps}


def _short(point: Any) -> str:
    return dyadic(arb(float(np.float32(float(point)))))


def chebyshev(coefficients: Sequence[Any]) -> list[Any]:
    """A polynomial's coefficients in Chebyshev polynomials: s^n = 2^(1-n) sum of comb(n, k) T_(n-2k), with half of T_0.

    Source: DLMF 18.18.
    """
    found = [0 * coefficients[0] for _ in coefficients]
    for n, part in enumerate(coefficients):
        for k in range(n // 2 + 1):
            weight = Fraction(comb(n, k), 2**n) * (1 if n == 2 * k else 2)
            found[n - 2 * k] = found[n - 2 * k] + part * weight.numerator / weight.denominator
    return found
