"""Arcs of the family of limit cycles: polynomials, boxes, steps and axes that the kernel is likely
to accept.

Balls become points and floats everywhere. `kernel.half_map_of_curves` and
`kernel.certificates.family` test this evidence, and any that passes is right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from operator import sub
from typing import Any, NamedTuple, cast

from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import exact_text, round_up
from tippedisk_verify.proofs.ball_conversions import WIDENING_FACTOR, ball_to_measured
from tippedisk_verify.proofs.kernel.balls import Unproved, arb, ball, require, working_precision
from tippedisk_verify.proofs.kernel.certificates.family import (
    ArcStatus,
    ProvedArc,
    exact_magnitude_bound,
    first_unproved_sign,
    krawczyk_test_of_box,
)
from tippedisk_verify.proofs.kernel.half_map_of_curves import (
    SERIES_ORDERS,
    UNKNOWN_INDICES,
    ArcTest,
    Curve,
    CurveFlight,
)
from tippedisk_verify.proofs.kernel.jets import Jet
from tippedisk_verify.proofs.kernel.scaled_half_map import ScaledCurve
from tippedisk_verify.proofs.kernel.small_matrices import Matrix, inverse_of_order_2
from tippedisk_verify.proofs.kernel.step import Step, StepTrial, evaluate_polynomial
from tippedisk_verify.proofs.kernel.vector_field import FieldConstants, field_constants
from tippedisk_verify.proofs.search.proof_search import (
    SearchStopped,
    first_success,
    parameter_texts,
)
from tippedisk_verify.proofs.search.step_search import axes_of_balls

__all__ = [
    "BITS",
    "CurveStepSearch",
    "CycleGuess",
    "arc_entry",
    "family_coefficients",
    "family_polynomials",
    "krawczyk_test_with_adapted_boxes",
    "prove_arc",
    "rounded_up_to_two_digits",
]

BITS, _DEGREE = 64, 4
_DECIMALS = 16  # decimals of the polynomials' coefficients
# First radii of the box, relative to the family's motion over it
_BOX_SHARES = Fraction(1, 300), Fraction(1, 100)
_MIN_RADIUS = Fraction(1, 10**12)  # a box's radius [rad/s]
_MAX_ATTEMPTS = 3
# Sizes of a box of uniqueness, relative to the family's slope times the distance to the connection
# (for a scaled arc, times the distance of a^2 from 1).
_WIDE_SHARES = Fraction(1, 64), Fraction(1, 256)

#: v_0 (or v_0 / a) [rad/s], Omega [rad/s], half the period [s]
CycleGuess = tuple[Fraction, Fraction, Fraction]
Test = Callable[
    [Sequence[Fraction], Any], ArcTest
]  #: a test of a box with these radii and a proposer
_TOLERANCE, _ROUGH_TOLERANCE = -56, -30  # log2 of the last terms: of states, and of derivatives
_FIRST_SHARE, _MAX_SHARE = 0.01, 0.03  # of the time of flight, for a step
_MAX_STEPS, _MAX_TRIALS = 2000, 15
_NEWTON_STEPS = 8
_DIFFERENCE_SHARE = 2.0**-20  # of a number's step, for a derivative of points
_CHORD_STEPS = 3  # chord steps towards the cycle at s = 0


class CurveStepSearch:
    """A proposer that finds the steps of one flight from a curve of starts by trials of their
    length.

    ``log`` records the steps and axes. They are first rounded to a few digits, so the log holds
    them exactly.
    """

    def __init__(self) -> None:
        self.log: list[dict[str, Any]] = []
        self._done, self._share = 0.0, _FIRST_SHARE

    def next_step(self, flight: CurveFlight, max_length: Any) -> Step:
        """Return a step of the flight with small remainders.

        The orbits return to the section well inside this step, or well after it. ``max_length`` is
        not used.
        """
        require(len(self.log) < _MAX_STEPS, "the flight takes too many steps")
        trial = StepTrial(flight, SERIES_ORDERS)
        for _ in range(_MAX_TRIALS):
            text = self._next_share()
            share = float(text)
            step = trial.tested_step((flight.duration * share).mid())
            excess = max(
                _length_excess(
                    step.derivative_polynomials, step, SERIES_ORDERS[1] + 1, _ROUGH_TOLERANCE
                ),
                _length_excess(step.polynomials, step, SERIES_ORDERS[0] + 1, _TOLERANCE),
            )
            # The longest acceptable length, times 0.9 because remainders grow with the box as well.
            self._share = share * min(1.3, max(0.3, 0.9 * 2.0**-excess))
            if excess <= 0 and step.included:
                break
            self._share = min(self._share, 0.8 * share)
        self._done += share
        self.log.append({"share": text})
        return step

    def _next_share(self) -> str:
        """Return the length of the step to try next, as a share of the whole flight, in decimal
        text.

        If the return to the section lies in that step, it is well away from both of the step's
        ends.
        """
        left = 1 - self._done
        return f"{left + 0.3 * self._share if left <= 0.7 * self._share else min(self._share, 0.6 * left):.4g}"

    def record_step(self, step: Step, axes: Matrix | None) -> None:
        """Do nothing: `step` has recorded the step."""

    def new_axes(self, moved_axes: Matrix, sizes: Sequence[float], stiffness: float) -> Matrix:
        """Return new axes for the box of a set of states, by `axes_of_balls`, rounded to four
        digits.

        They are recorded in the log.
        """
        axes = axes_of_balls(moved_axes, sizes, stiffness)
        texts = [[f"{float(entry):.4g}".replace("e+", "e") for entry in row] for row in axes]
        self.log[-1]["axes"] = texts
        return [[arb(float(text)) for text in row] for row in texts]


def _length_excess(
    series: Sequence[Sequence[Jet]], step: Step, power: int, tolerance: int
) -> float:
    """Return log2 of the ratio of a step's length to the largest length that is acceptable.

    The remainders of the series grow like the ``power`` of the length and may reach 2^tolerance.
    Returns infinity if a remainder is not finite.
    """
    size = max(float(part[-1].coefficients[0].abs_upper()) for part in series)
    length = float(step.length.coefficients[0].mid())
    if not (math.isfinite(size) and length > 0):
        return math.inf
    return (math.log2(size) - tolerance) / power + math.log2(length) if size else -math.inf


def approximate_flight(constants: FieldConstants, curve: Curve) -> tuple[Sequence[Jet], Jet]:
    """Approximate the half map on a curve of starts: return the images (gamma_bar, v) and the time
    of flight, as jets.

    It computes with midpoints, without the deviations about the curve, and proves nothing.
    """
    orbit = curve.field_class(constants, *curve.equation_parameters).system_at_speed(curve.omega)
    total = curve.duration
    state, time, done = [0 * curve.v.mid(), *curve.start], 0 * total, 0.0
    for _ in range(_MAX_STEPS):
        series = orbit.coefficients(state, SERIES_ORDERS[0])
        # In longer steps the balls left over would swamp the midpoints.
        step_share = min(_MAX_SHARE, _estimated_length(series) / float(total.coefficients[0].mid()))
        if 1 - done < step_share / 2:
            break
        length = (total * min(step_share, 1 - done)).mid()
        state, time, done = (
            [evaluate_polynomial(part, length).mid() for part in series],
            time + length,
            done + step_share,
        )
    tau = _section_time(series, 0 * total)
    return [-evaluate_polynomial(part, tau).mid() for part in series[1:]], (tau + time).mid()


def _estimated_length(series: Sequence[Sequence[Jet]]) -> float:
    """Estimate the step length [s], at most 1 s, for which the last two terms of a Taylor series
    stay below 2^_TOLERANCE.
    """
    sizes = [
        (float(part[n].coefficients[0].abs_upper()), n)
        for part in series
        for n in (SERIES_ORDERS[0] - 1, SERIES_ORDERS[0])
    ]
    if not all(math.isfinite(size) for size, _ in sizes):
        return 0.0
    return min(1.0, *(math.exp2((_TOLERANCE - math.log2(size)) / n) for size, n in sizes if size))


def _section_time(polynomials: Sequence[Sequence[Jet]], guess: Jet) -> Jet:
    """Approximate the time within a step at which beta_bar is 0, by Newton's iteration from a
    guess.

    It computes with midpoints and proves nothing. ``polynomials`` are those of the step in time.
    """
    beta, _, v = ([jet.mid() for jet in part] for part in polynomials)
    tau = guess.mid()
    for _ in range(_NEWTON_STEPS):
        tau = (tau - evaluate_polynomial(beta, tau) / evaluate_polynomial(v, tau)).mid()
    return tau


def family_polynomials(
    constants: FieldConstants,
    start: Sequence[Any],
    radius: Any,
    degree: int,
    total: Any,
    curve_class: type[Curve],
) -> tuple[list[Jet], Jet]:
    """Return Taylor polynomials along the family of limit cycles: of (gamma_bar, v, Omega), and of
    half the period, in the parameter s.

    Their coefficients are points. ``start`` is near the cycle at s = 0; the first of the three
    numbers moves by ``radius`` as s grows by 1. With Y constant, a chord step finds the coefficient
    of s^k once those before it are known.
    """
    zero = 0 * start[0]
    point = [part.mid() for part in start]
    columns = (_jacobian_column(constants, curve_class, point, total, k) for k in UNKNOWN_INDICES)
    chord = inverse_of_order_2(list(zip(*columns, strict=True)))
    polynomials = [[part] for part in point]
    half_period = Jet([total])
    for k in (*[0] * _CHORD_STEPS, *range(1, degree + 1)):
        if len(polynomials[0]) == k:
            for part in polynomials:
                part.append(zero)
            half_period = Jet([*half_period.coefficients, zero])
            if k == 1:
                polynomials[0][1] = radius
        first, v, speed = map(Jet, polynomials)
        curve = curve_class(first, v, speed, [zero] * 3, half_period)
        image, half_period = approximate_flight(constants, curve)
        value = [
            after.coefficients[k] - before.coefficients[k]
            for after, before in zip(image, curve.start, strict=True)
        ]
        for row, index in zip(chord, UNKNOWN_INDICES, strict=True):
            polynomials[index][k] = (
                polynomials[index][k] - row[0] * value[0] - row[1] * value[1]
            ).mid()
    return [Jet(part) for part in polynomials], half_period


def family_coefficients(
    constants: FieldConstants,
    start: Sequence[Any],
    radius: Any,
    total: Any,
    curve_class: type[Curve],
) -> list[tuple[Fraction, ...]]:
    """Return the Taylor polynomials along the family (`family_polynomials`), rounded to decimals.

    They are those of the two unknown numbers and of half the period.

    Raises SearchStopped if they are not finite.
    """
    polynomials, half_period = family_polynomials(
        constants, start, radius, _DEGREE, total, curve_class
    )
    jets = [*(polynomials[k] for k in UNKNOWN_INDICES), half_period]
    if not all(entry.is_finite() for jet in jets for entry in jet.coefficients):
        raise SearchStopped(ArcStatus.NOT_FOLLOWED)
    return [
        tuple(round(ball_to_measured(part.mid()).value, _DECIMALS) for part in jet.coefficients)
        for jet in jets
    ]


def _jacobian_column(
    constants: FieldConstants,
    curve_class: type[Curve],
    point: Sequence[Any],
    half_period: Any,
    moving: int,
) -> list[Any]:
    """Approximate a column of the Jacobian of F, the half map minus its start.

    The column is the derivative with respect to the number with the index ``moving`` of a
    ``point``, three numbers.
    """
    zero = 0 * point[0]
    first, v, speed = (
        Jet([part, zero + _DIFFERENCE_SHARE * int(moving == j)]) for j, part in enumerate(point)
    )
    image, _ = approximate_flight(
        constants, curve_class(first, v, speed, [zero] * 3, Jet.constant(half_period, 1))
    )
    return [
        (part.coefficients[1] / _DIFFERENCE_SHARE).mid() - own[moving]
        for part, own in zip(image, curve_class.start_derivative, strict=True)
    ]


class PassedArcTest(NamedTuple):
    """A passed Krawczyk test of an arc of the family, with the box's radii and the
    recorded steps.
    """

    result: ArcTest
    radii: list[Fraction]
    within: list[Fraction]  #: distances of the true values from the polynomials, at most
    evidence: dict[str, Any]  #: the radii and the steps in the form of a certificate


def krawczyk_test_with_adapted_boxes(test: Test, radii: Sequence[Fraction]) -> PassedArcTest:
    """Repeat Krawczyk's test of an arc with adapted boxes until it passes, and return the passed
    test.

    Raises SearchStopped if it does not pass.

    Args:
        test: Called with the radii of a box and a proposer of steps; returns the test's result.
        radii: The radii of the first box.
    """

    def attempt(radii: Sequence[Fraction]) -> PassedArcTest:
        proposer = CurveStepSearch()
        sizes = [rounded_up_to_two_digits(max(radius, _MIN_RADIUS)) for radius in radii]
        try:
            result = test(sizes, proposer)
        except Unproved:
            raise SearchStopped(ArcStatus.NOT_FOLLOWED) from None
        if not all(off.is_finite() for off in result.shift):
            raise SearchStopped(ArcStatus.NOT_FOLLOWED)
        within = [
            rounded_up_to_two_digits(
                max(exact_magnitude_bound(off) * WIDENING_FACTOR, Fraction(1, 10**30))
            )
            for off in result.shift
        ]
        if result.included and all(a < b for a, b in zip(within, sizes, strict=True)):
            return PassedArcTest(result, sizes, within, _box_evidence(sizes, proposer))
        raise SearchStopped(ArcStatus.NOT_INCLUDED, next_choice=[2 * part for part in within])

    return first_success(attempt, radii, _MAX_ATTEMPTS)


def _box_evidence(radii: Sequence[Fraction], proposer: CurveStepSearch) -> dict[str, Any]:
    return {"radii": [*map(exact_text, radii)], "steps": proposer.log}


def prove_arc(
    parameters: Parameters, low: Fraction, high: Fraction, guess: CycleGuess
) -> ProvedArc | ArcStatus:
    """Prove an arc of the family of limit cycles, between two amplitudes [rad]. Return the arc,
    or the reason why it is not proved.

    States are scaled by the amplitude if ``low`` is 0. ``guess`` is a cycle at the middle of a or,
    with scaled states, of a^2.
    """
    ends = (low, high) if low else (low, high**2)
    middle, length = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
    disk = parameter_texts(parameters)
    with working_precision(BITS):
        start, half_period = [ball(number) for number in (middle, *guess[:2])], ball(guess[2]).mid()
        curve_class = Curve if low else ScaledCurve
        try:
            first, second, half_period = family_coefficients(
                field_constants(disk), start, ball(length), half_period, curve_class
            )
            arc: dict[str, Any] = {
                "end": exact_text(high),
                "curve": [[*map(exact_text, row)] for row in (first, second)],
                "half": [*map(exact_text, half_period)],
            }

            def test(radii: Sequence[Fraction], proposer: Any) -> ArcTest:
                return krawczyk_test_of_box(disk, low, arc, radii, proposer)

            def attempt(radii: Sequence[Fraction]) -> PassedArcTest:
                box = krawczyk_test_with_adapted_boxes(test, radii)
                if (refusal := first_unproved_sign(box.result)) is None:
                    return box
                # Derivatives over a smaller box may decide signs that are undecided over this one.
                tighter = [part * 5 / 4 for part in box.within]
                halved = all(
                    2 * rounded_up_to_two_digits(new) <= old
                    for new, old in zip(tighter, box.radii, strict=True)
                )
                raise SearchStopped(refusal, next_choice=tighter if halved else None)

            radii = [
                abs(row[1]) * share for row, share in zip((first, second), _BOX_SHARES, strict=True)
            ]
            box = first_success(attempt, radii, _MAX_ATTEMPTS)
        except SearchStopped as fault:
            return cast("ArcStatus", fault.status)
        unique, evidence = box.radii, arc | {"bits": BITS, "box": box.evidence}
        # The box of uniqueness may be wider than the box of the signs.
        distance_to_end = max(Fraction(22, 7) - high, _MIN_RADIUS) if low else Fraction(1)
        slopes = [max(abs(row[1]) / length, _MIN_RADIUS) for row in (first, second)]
        for share in _WIDE_SHARES:
            wide, proposer = (
                [rounded_up_to_two_digits(slope * distance_to_end * share) for slope in slopes],
                CurveStepSearch(),
            )
            with suppress(Unproved):
                if min(map(sub, wide, box.radii)) > 0 and test(wide, proposer).included:
                    unique, evidence["wide box"] = wide, _box_evidence(wide, proposer)
                    break
        return ProvedArc(
            low,
            high,
            (first, second),
            (unique[0], unique[1]),
            (box.within[0], box.within[1]),
            evidence,
        )


def arc_entry(arc: ProvedArc) -> dict[str, object]:
    """Return a proved arc of the family as a dictionary for output, with all numbers as exact
    texts.

    The evidence is left out.
    """
    return {
        "low": exact_text(arc.low),
        "high": exact_text(arc.high),
        "scaled": arc.scaled,
        "curve": [[exact_text(part) for part in row] for row in arc.curve],
        "unique_within": [exact_text(part) for part in arc.unique_within],
        "within": [exact_text(part) for part in arc.within],
    }


def rounded_up_to_two_digits(value: Fraction) -> Fraction:
    """Return the least decimal of two significant digits that is at least ``value`` > 0."""
    return Fraction(round_up(value))
