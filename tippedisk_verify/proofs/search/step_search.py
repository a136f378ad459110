"""The search for steps: lengths and orders that the kernel's test is likely to pass, and axes, with
a log.

A `FlightStepSearch` object proposes the steps of one flight. Its ``log`` lists the steps taken, in
the form in which `kernel.krawczyk` reads them from a certificate.

Axes for sets of states are nearly orthogonal, the first along the largest direction (Lohner's QR
method). Velocities are divided by the stiffness [1/s] of d(v')/dv before angles and lengths are
measured. Any regular matrix of points would do: floats are exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from tippedisk_verify.proofs.kernel.balls import arb, working_bits
from tippedisk_verify.proofs.kernel.certificate_format import dyadic_text
from tippedisk_verify.proofs.kernel.krawczyk import KrawczykResult, krawczyk_test
from tippedisk_verify.proofs.kernel.poincare_map import PoincareImage, PoincareSection
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedFlight
from tippedisk_verify.proofs.kernel.sliding import SlidingReversalStep
from tippedisk_verify.proofs.kernel.small_matrices import Matrix, midpoint_inverse
from tippedisk_verify.proofs.kernel.step import Step, StepTrial, log2_magnitude

__all__ = [
    "FlightStepSearch",
    "axes_of_balls",
    "rounded_down_to_20_bits",
    "searched_test",
]

_MIN_ORDER = 16  # of derivatives that only multiply radii
# Over a wide box, the order of the series and the decay along v in a step. Balls add up
# alternating terms, so enclosures of derivatives are exp(twice that decay) times too wide.
_WIDE_ORDER, _MAX_DECAY = 8, 0.5
_MEAN_VALUE_TOLERANCE = -24  # log2 of their remainders: a radius is known to 30 bits anyway
_MIN_STEP = 2.0**-40  # s
_MAX_TRIALS = 40
_AXIS_BITS = 30


class FlightStepSearch:
    """A proposer that finds the time steps of a flight by trial and error: each trial is put to the
    kernel's test.
    """

    def __init__(self) -> None:
        self.log: list[dict[str, Any]] = []
        # Share of the length that the midpoint's series allows; it adapts to accepted steps
        self._share = 0.75

    def after_reversal(self) -> FlightStepSearch:
        """Return a new search, for the part of a step after the sliding velocity has changed its
        sign.

        The new search's log is not used: `record_step` logs both parts of such a step in this
        object.
        """
        return FlightStepSearch()

    def next_step(self, flight: EnclosedFlight, max_length: float | None) -> Step | None:
        """Return a step of the flight that the kernel's test proves, at most ``max_length`` seconds
        long.

        Its remainders are at most as large as rounding, or as a small share of the box. Returns
        None if no step passes.
        """
        try:
            return self._trials(flight, max_length)
        except OverflowError:
            return None

    def _trials(self, flight: EnclosedFlight, max_length: float | None) -> Step | None:
        """Try steps of falling length, at most ``max_length`` seconds, and return the first one
        that the kernel's test proves with small remainders. Return None if all fail.
        """
        bits = working_bits()
        order = _taylor_order(bits)
        allowed, rough_allowed = _allowed_remainders(flight, bits)
        rough_order = (
            min(order, _taylor_order(-rough_allowed, _WIDE_ORDER))
            if flight.carries_derivatives
            else _MIN_ORDER
        )
        trial = StepTrial(flight, (order, rough_order))
        if rough_order < order:
            stiffness = float(abs(trial.box_series[11][1]).abs_upper())
            max_length = min(
                math.inf if max_length is None else max_length,
                rounded_down_to_20_bits(_MAX_DECAY / max(1.0, stiffness)),
            )
        sizes = [max(0, log2_magnitude(column[0])) for column in trial.box_series[3:]]
        estimated_length, share = _estimated_length(trial.midpoint_series, allowed), self._share
        for _ in range(_MAX_TRIALS):
            length = rounded_down_to_20_bits(
                min(estimated_length * share, max_length if max_length is not None else math.inf)
            )
            if length < _MIN_STEP:
                return None
            step = trial.tested_step(length)
            fine, rough = (
                [series[-1] for series in part]
                for part in (step.polynomials, step.derivative_polynomials)
            )
            if not all(part.is_finite() for part in (*fine, *rough)):
                share *= 0.5
                continue
            excess = max(
                _length_excess(fine, [0, 0, 0], allowed, length, order + 1),
                _length_excess(rough, sizes, [rough_allowed] * len(sizes), length, rough_order + 1),
            )
            better = length / estimated_length * 2.0 ** min(1.0, -excess)
            if step.included and excess <= 0:
                # A shortened step gives no information about the next length.
                if max_length is None or length < max_length:
                    self._share = 0.97 * better
                return step
            share = min(0.97 * better, 0.9 * length / estimated_length)
        return None

    def new_axes(self, moved_axes: Matrix, sizes: Sequence[Any], stiffness: Any) -> Matrix:
        """Return new axes for the box of a set of states, by `axes_of_balls`.

        They are rounded to a few bits, which keeps the log short.
        """
        return [
            [_rounded_centre(entry) for entry in row]
            for row in axes_of_balls(moved_axes, sizes, stiffness)
        ]

    def record_step(self, step: Step, axes: Matrix) -> None:
        parts = (
            [step.step_before_reversal, step.step_after_reversal]
            if isinstance(step, SlidingReversalStep)
            else [step]
        )
        self.log.append(
            {
                "steps": [[dyadic_text(part.length), *part.orders] for part in parts],
                "axes": [[dyadic_text(entry) for entry in row] for row in axes],
            }
        )


def _allowed_remainders(flight: EnclosedFlight, bits: int) -> tuple[list[int], int]:
    """Return log2 of the largest remainders that a step may have: a list for the state's
    components, and one number for the derivatives.
    """
    # As large as rounding, or a hundredth of the ball's radius: 70 steps at most double it.
    allowed = [
        max(
            max(0, log2_magnitude(part)) - bits,
            log2_magnitude(part.rad()) - 7 if not part.is_exact() else -bits - 99,
        )
        for part in flight.box
    ]
    if not flight.carries_derivatives:
        return allowed, _MEAN_VALUE_TOLERANCE
    # The derivatives differ over the box by about its radius.
    return allowed, max(-bits, max(log2_magnitude(part.rad()) for part in flight.box) - 7)


def _taylor_order(bits: int, least: int = _MIN_ORDER) -> int:
    """Return a good order for the Taylor series of a step: 0.3 times the precision in bits.

    The optimum is flat near this order. The cost grows like the square of the order, and the step's
    length like 2^(-bits/order).
    """
    return max(least, round(0.3 * bits))


def _length_excess(
    remainders: Sequence[Any],
    sizes: Sequence[int],
    allowed: Sequence[int],
    length: float,
    power: int,
) -> float:
    """Return log2 of the ratio of a step's length to the largest length that is acceptable.

    A negative result means that the step is short enough.

    Args:
        remainders: The remainder's coefficient for each component.
        sizes: log2 of the components' sizes.
        allowed: log2 of the largest allowed remainders, relative to the sizes.
        length: The step's length [s].
        power: The power of the length with which the remainders grow.
    """
    size = math.log2(length)
    return (
        max(
            log2_magnitude(r) + power * size - s - a
            for r, s, a in zip(remainders, sizes, allowed, strict=True)
        )
        / power
    )


def _estimated_length(series: Sequence[Sequence[Any]], allowed: Sequence[int]) -> float:
    """Estimate the longest step [s], at most 1 s, for which the last two terms of a Taylor series
    stay within bounds.

    It only guides the search: the kernel's test decides if a step is proved.

    Args:
        series: The Taylor coefficients of each component.
        allowed: log2 of the bounds of the components.
    """
    order = len(series[0]) - 1
    exponents = (
        (limit - log2_magnitude(column[n])) / n
        for column, limit in zip(series, allowed, strict=True)
        for n in (order - 1, order)
    )
    return math.exp2(min(0.0, *exponents))


def _rounded_centre(point: Any) -> Any:
    mantissa, exponent = math.frexp(float(point))
    return arb((round(math.ldexp(mantissa, _AXIS_BITS)), exponent - _AXIS_BITS))


def rounded_down_to_20_bits(length: float) -> float:
    """Round a step length down to 20 bits, so that sums of lengths are exact."""
    mantissa, exponent = math.frexp(length)
    return math.ldexp(math.floor(mantissa * 2**20), exponent - 20)


def searched_test(
    setting: Mapping[str, Any],
    section: PoincareSection,
    unknown_indices: tuple[int, int],
    middle: Sequence[Any],
    radii: Sequence[Any],
    third_deviation: Any,
    centre: tuple[FlightStepSearch, PoincareImage] | None = None,
) -> tuple[KrawczykResult, dict[str, Any]]:
    """Apply Krawczyk's test to a box, with steps found by a search. Return the result and the
    evidence.

    Raises FlightStopped as `krawczyk_test` does.

    Args:
        setting: The disk and the friction law.
        section: The section whose map is tested for a fixed point.
        unknown_indices: The indices of the two unknown numbers among the three (both coordinates,
            Omega).
        middle: The box's centre, three exact numbers.
        radii: The radii of the box for the two unknown numbers.
        third_deviation: A ball about zero, the deviation of the third number.
        centre: The search and the map at the centre, if they have already been computed.
    """
    centre_search, image = (FlightStepSearch(), None) if centre is None else centre
    box_search = FlightStepSearch()
    deviations = [arb(0, size) for size in radii]
    deviations.insert({0, 1, 2}.difference(unknown_indices).pop(), third_deviation)
    fixed = krawczyk_test(
        setting,
        section,
        middle,
        deviations,
        unknown_indices,
        (centre_search, box_search),
        midpoint_inverse,
        image,
    )
    box = {"radii": radii, "inverse": fixed.preconditioner, "flight": box_search}
    return fixed, {
        "middle": [middle[k] for k in unknown_indices],
        "centre": centre_search,
        "box": box,
    }


def axes_of_balls(moved_axes: Matrix, sizes: Sequence[float], stiffness: float) -> Matrix:
    """Return new axes for the box of a set of states: three columns of exact numbers.

    They are nearly orthogonal once velocities are divided by the stiffness. Gram-Schmidt's method
    makes them from the columns of a matrix, in falling order of length times size.

    Args:
        moved_axes: A (3, 3) matrix of balls, whose columns are the old axes as the flow has moved
            them.
        sizes: The sizes of the set along the old axes.
        stiffness: The factor [1/s] by which velocities are divided.
    """
    weights = (1.0, 1.0, 1 / stiffness)
    columns = [
        [float(row[k].mid()) * weight for row, weight in zip(moved_axes, weights, strict=True)]
        for k in range(3)
    ]
    order = sorted(range(3), key=lambda k: -math.hypot(*columns[k]) * sizes[k])
    basis: list[list[float]] = []
    for vector in (*(columns[k] for k in order), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
        length = math.hypot(*vector)
        for _ in range(2):  # once is not enough where columns are nearly parallel
            for axis in basis:
                share = sum(a * b for a, b in zip(axis, vector, strict=True))
                vector = [b - share * a for a, b in zip(axis, vector, strict=True)]
        left = math.hypot(*vector)
        if left > 1e-8 * length and len(basis) < 3:
            basis.append([part / left for part in vector])
    return [[arb(axis[row] / weights[row]) for axis in basis] for row in range(3)]
