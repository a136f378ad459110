"""Certificates: what `checker` needs to prove a claim again, written down from a proof.

A flight's steps and orders are the prover's. All else (enclosures, sets, moments of crossing) is made here with the
checker's own arithmetic, and padded: a box by 2^-10 of its size at every step, so that a checker that adds and
multiplies in another order passes too. Boxes about the fixed point are narrower than the proof's, and the precision is
higher, so that the claim is the one printed. What is written has been checked.

Where a ball becomes a point here: everything does, and any choice that passes the checker is right.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from flint import arb_mat

from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.kernel.balls import (
    arb,
    ball,
    ball_constants,
    series_length,
    working_bits,
    working_precision,
)
from tippedisk_verify.proofs.kernel.flow import Model, Step
from tippedisk_verify.proofs.kernel.krawczyk import Flight, midpoint_inverse
from tippedisk_verify.proofs.kernel.section import HalfFlight, half_flight
from tippedisk_verify.proofs.kernel.section import Status as HalfStatus
from tippedisk_verify.proofs.search.cycle import CycleProof, OrbitProof
from tippedisk_verify.proofs.search.fold import FoldProof
from tippedisk_verify.proofs.search.rotation import turn_flight

__all__ = ["certificate_text", "cycle_certificate", "dyadic", "fold_certificate", "parameter_texts"]

_PAD = 10  # -log2 of what a box is padded by, relative to its radius
_MORE_BITS = 24  # of the certificate than of the proof
_WIDE_BITS = 64  # of the flight that shows how far the next fixed point must be
_BOX_BITS = 60  # of precision beyond a box's radius relative to its middle
_ATTEMPTS = 4


class _RefusedError(Exception):
    """A step that cannot be written down in this precision."""


def certificate_text(
    claim: Mapping[str, Any], bits: int, evidence: Mapping[str, Any], mapped: checker.Mapped = map
) -> str:
    """The file's text, which the checker has read and accepted. Raises `checker.Unproved` if it does not accept it."""
    content: dict[str, Any] = {"format": checker.FORMAT, "claim": claim, "bits": bits, "evidence": evidence}
    text = json.dumps(content | {"sha256": checker.digest(content)}, indent=None, separators=(",", ":")) + "\n"
    checker.proved(json.loads(text), mapped)
    return text


def cycle_certificate(proof: OrbitProof) -> str:
    """A certificate of a limit cycle that is proved. Raises Shortfall if none can be written."""
    numbers = proof.to_dict()
    claim = {
        "kind": "limit cycle" if isinstance(proof, CycleProof) else "rotating limit cycle",
        "parameters": parameter_texts(proof.parameters),
        "omega": exact_text(proof.omega),
        "numbers": {name: numbers[name] for name in proof.names()},
        "stable": proof.stable,
        "unique_within": numbers["unique_within"],
    }
    found = [getattr(proof, name) for name in proof.unknowns]

    def evidence(bits: int) -> dict[str, Any]:
        speed = ball(proof.omega)
        middle = [part.mid() for part in found]
        writer = _Writer(proof.parameters, claim["kind"] != "limit cycle", [*middle, speed.mid()])
        drift = speed - speed.mid()
        radii = [abs(point) * arb(2) ** (_BOX_BITS - bits) for point in middle]
        wide = [_rounded_up(distance.upper() * (1 + arb(2) ** -6)) for distance in proof.unique_within]
        made: dict[str, Any] = {"middle": [dyadic(part) for part in middle], "centre": writer.flight([arb(0)] * 3)}
        for name, sizes, precision in (("box", radii, bits), ("wide box", wide, _WIDE_BITS)):
            made[name] = writer.box([*(arb(0, size) for size in map(_rounded_up, sizes)), drift], (0, 1), precision)
        return made

    return _checked(claim, proof.bits, evidence)


def fold_certificate(proof: FoldProof) -> str:
    """A certificate of a fold that is proved, of half-widths that are a quarter wider but for the arc's.

    Raises Shortfall if none can be written.
    """
    first, second = proof.unknowns
    arc: Measured = getattr(proof, first)
    numbers = {name: getattr(proof, name) for name in ("omega", first, second, "period")}
    claim = {
        "kind": f"fold of {'rotating ' * (proof.laps == 1)}limit cycles",
        "parameters": parameter_texts(proof.parameters),
        "numbers": {
            name: (number if name == first else Measured(number.value, number.uncertainty * 5 / 4)).to_dict()
            for name, number in numbers.items()
        },
        "extremum": proof.extremum,
    }

    def evidence(bits: int) -> dict[str, Any]:
        half = arb(0, ball(arc.uncertainty).upper())
        places = (ball(arc.value) + half, ball(arc.value - arc.uncertainty), ball(arc.value + arc.uncertainty))
        points = []
        for place, searched in zip(places, proof.searched, strict=True):
            middle = [part.mid() for part in searched]
            writer = _Writer(proof.parameters, proof.laps == 1, [place.mid(), *middle])
            away = [place - place.mid(), *(arb(0, part.rad()) for part in searched)]
            made = {"middle": [dyadic(part) for part in middle], "centre": writer.flight([arb(0)] * 3)}
            points.append(made | {"box": writer.box(away, (1, 2), bits)})
        return {**points[0], "lower end": points[1], "upper end": points[2]}

    return _checked(claim, proof.bits, evidence)


def _checked(claim: Mapping[str, Any], bits: int, evidence: Callable[[int], dict[str, Any]]) -> str:
    fault: Exception = Shortfall("no attempt")
    for attempt in range(_ATTEMPTS):
        wider = bits + (_MORE_BITS << attempt)
        try:
            with working_precision(wider), series_length(10):
                return certificate_text(claim, wider, evidence(wider))
        except (checker.Unproved, checker.Refused, _RefusedError) as failed:
            fault = failed
    raise Shortfall(f"no certificate that the checker accepts could be made: {fault}")


def parameter_texts(parameters: Parameters) -> dict[str, str]:
    return {name: exact_text(getattr(parameters, name)) for name in SYMBOLS}


class _Writer:
    """Flights from boxes about one point (coordinate on the section, v, speed), at the working precision."""

    def __init__(self, parameters: Parameters, turning: bool, at: Sequence[Any]) -> None:
        self.parameters, self.turning, self.at = parameters, turning, at
        self.fly: Flight = turn_flight if turning else half_flight

    def box(self, away: Sequence[Any], unknown: tuple[int, int], bits: int) -> dict[str, Any]:
        """A box's part of a Krawczyk test, with the steps of a flight in so many bits."""
        with working_precision(bits):
            steps, flight = self._flown(away, True)
        rows = [[*row, by] for row, by in zip(flight.matrix, flight.by_omega, strict=True)]
        by = [[row[k] - int(i == k) for k in unknown] for i, row in enumerate(rows)]
        return {
            "radii": [dyadic(away[k].rad()) for k in unknown],
            "inverse": [[dyadic(entry) for entry in row] for row in midpoint_inverse(by)],
            "flight": self._written(steps, away),
        }

    def flight(self, away: Sequence[Any]) -> list[dict[str, Any]]:
        steps, _ = self._flown(away, False)
        return self._written(steps, away)

    def _flown(self, away: Sequence[Any], derivatives: bool) -> tuple[list[Step], HalfFlight]:
        first, v, speed = (point + width for point, width in zip(self.at, away, strict=True))
        steps: list[Step] = []
        model = Model(ball_constants(self.parameters), speed)
        flight = self.fly(model, first, v, derivatives=derivatives, watch=steps.append)
        if flight.status is not HalfStatus.RETURNED:
            raise _RefusedError(flight.status.value)
        return steps, flight

    def _written(self, steps: Sequence[Step], away: Sequence[Any]) -> list[dict[str, Any]]:
        constants = parameter_texts(self.parameters)
        flow = checker.Flow(constants, self.at[2] + away[2])
        axis, zero = 0 if self.turning else 1, arb(0)
        middle, width = ([part[0], zero] if self.turning else [zero, part[0]] for part in (self.at, away))
        states = checker.States.start([*middle, self.at[1]], [*width, away[1], away[2]])
        written, turned = [], self.turning
        for number, step in enumerate(steps, 1):
            piece, entry = written_step(flow, states, step)
            written.append(entry)
            if not turned and piece.image(piece.length)[2] > 0:
                entry["turn"], turned = _moments(piece, 2, zero), True
            if number == len(steps):
                entry["crossing"] = _moments(piece, 1 - axis, 2 * arb.pi() if self.turning else zero)
            else:
                states = written_states(piece, arb_mat(steps[number].frame.axes), entry)
        return written


def written_step(flow: checker.Flow, states: checker.States, step: Step) -> tuple[checker.Piece, dict[str, Any]]:
    """A step from a set, with an enclosure, and what of it stands in the file."""
    orders = [len(step.polynomials[0]) - 2, len(step.derivatives[0]) - 2]
    length = ball(step.length)
    span = arb(0).union(length)
    unit = [arb(int(row == column)) for row in range(3) for column in range(4)]
    entries, enclosure = [], []
    for series in flow.taylor([*states.box(), *unit], orders[1])[:15]:
        reach = _horner(series, span)
        pad = arb(2) ** (-2 * _PAD) * (abs(reach).upper() + arb(2) ** -64)
        entry, held = _written_ball(reach + arb(0, (reach.rad() * arb(2) ** -7).upper() + pad.upper()))
        entries.append(entry)
        enclosure.append(held)
    piece = checker.Piece(flow, states, length, orders, enclosure)
    return piece, {"length": dyadic(length), "orders": orders, "enclosure": entries}


def written_states(piece: checker.Piece, axes: Any, entry: dict[str, Any]) -> checker.States:
    """The set at the step's end, with these axes, and its place in the file."""
    middle, lead = (
        arb_mat([[part.mid() for part in row] for row in matrix.tolist()]) for matrix in piece.mapped(piece.length)[:2]
    )
    rest, spread = piece.carried(middle, lead, axes)
    radii = [[_rounded_up(part.abs_upper()) for part in row] for row in (rest.entries(), *spread.tolist())]
    entry["states"] = {
        "middle": [dyadic(part) for part in middle.entries()],
        "lead": [[dyadic(part) for part in row] for row in lead.tolist()],
        "axes": [[dyadic(part) for part in row] for row in axes.tolist()],
        "rest": [dyadic(part) for part in radii[0]],
        "spread": [[dyadic(part) for part in row] for row in radii[1:]],
    }
    held = [[arb(0, part) for part in row] for row in radii]
    return checker.States(piece.states.deviation, middle.entries(), lead, axes, held[0], held[1:])


def _moments(piece: checker.Piece, index: int, level: Any) -> list[str]:
    """Two moments about the one at which a component passes a level upwards, by bisection."""
    ends = []
    for short in (lambda x: not x < 0, lambda x: x > 0):  # the last moment before, the first after
        low, high = ball(0), piece.length
        while (high - low) * arb(2) ** (working_bits() - 8) > piece.length:
            middle = ((low + high) / 2).mid()
            if short(piece.image(middle)[index] - level):
                high = middle
            else:
                low = middle
        ends.append((low, high))
    early, late = ends[0][0], ends[1][1]
    pad = (late - early) * arb(2) ** -_PAD
    return [dyadic((early - pad).lower().max(ball(0))), dyadic((late + pad).upper().min(piece.length))]


def _written_ball(x: Any) -> tuple[list[str], Any]:
    """A ball that holds another, with a short middle and radius, for the file and as a ball."""
    if not x.is_finite():
        raise _RefusedError("an enclosure is infinite")
    radius = x.rad()
    middle = _shortened(x.mid(), _exponent(radius) - 2 * _PAD)
    size = _rounded_up((radius + abs(x.mid() - middle)).upper())
    return [dyadic(middle), dyadic(size)], middle + arb(0, size)


def _rounded_up(x: Any) -> Any:
    """A point of few bits that is larger than a positive point by 2^-10 of it, or a little more; 0 for 0."""
    if x == 0:
        return arb(0)
    if not x.is_finite():
        raise _RefusedError("a set is infinite")
    unit = _exponent(x) - 2 * _PAD
    mantissa, exponent = (x * (1 + arb(2) ** -_PAD)).upper().man_exp()
    return arb((math.ceil(Fraction(int(mantissa)) * Fraction(2) ** (int(exponent) - unit)), unit))


def _shortened(point: Any, unit: int) -> Any:
    """The multiple of 2^unit nearest to a point, or about so."""
    mantissa, exponent = point.man_exp()
    return arb((round(Fraction(int(mantissa)) * Fraction(2) ** (int(exponent) - unit)), unit))


def _exponent(x: Any) -> int:
    """An integer k with |x| < 2^k for a point that is not zero, the least or nearly so."""
    mantissa, exponent = x.man_exp()
    return int(mantissa).bit_length() + int(exponent)


def dyadic(point: Any) -> str:
    mantissa, exponent = point.man_exp()
    return f"{int(mantissa):x}p{int(exponent)}"


def _horner(coefficients: Sequence[Any], variable: Any) -> Any:
    total = coefficients[-1]
    for value in reversed(coefficients[:-1]):
        total = total * variable + value
    return total
