"""One step of all orbits from a set of states: an interval Taylor method in mean-value form.

The test
--------
Let X be a box of states (a vector of balls) with the midpoint m, and Omega a ball of speeds.
Recurrences (`taylor_recurrences`) give the Taylor coefficients p_0 … p_N of the orbit from m. They
also give those of the orbits from X, with their derivatives with respect to state and Omega, to
order K. Over [0, h] the latter polynomials have a range; padded, it is a box E. With c the
coefficients of order K + 1 over E, the step is accepted if

    polynomial(t) + t^(K+1) c  lies in the interior of E  for all t in [0, h].

*Then every orbit from X exists on [0, h] and stays in E.* As long as an orbit has been in E,
Taylor's formula with Lagrange's remainder puts it in E's interior. (Component by component, the
remainder is a coefficient at an earlier point of the same orbit, so it lies within c.)

It cannot reach the boundary first, nor blow up in a compact box on which the field is analytic: c
is finite, so M has no zero there. The same argument holds for the derivatives, which are part of
the system (a high-order enclosure: Corliss and Rihm 1996; Nedialkov, Jackson and Pryce 2001). The
coefficient of order N + 1 over E gives the remainder of the orbit from m.

Mean-value form
---------------
By the mean value theorem the image of X at time t lies in

    orbit of m at t  +  [derivatives over X](t) (X - m)
                     +  [derivative by Omega](t) (Omega - its midpoint),

because balls are convex. Balls inserted into the polynomials would grow like exp(|d(v')/d(v)| t),
by some 40 digits a second. In this form the strong contraction along v contracts the ball too, and
half a period costs 2 digits.

Where a ball becomes a point or a float: m is a midpoint, and any point of X would do; paddings are
free. Step lengths are exact dyadic numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import and_
from typing import Any

from tippedisk_verify.proofs.kernel.balls import (
    arb,
    around_zero,
    converted_like,
    inside,
    intersection,
    is_ball_array,
    magnitude_estimate,
    negative,
    positive,
    range_of,
    truncated_for_derivatives,
    working_bits,
    working_precision,
)
from tippedisk_verify.proofs.kernel.doubleton import Doubleton
from tippedisk_verify.proofs.kernel.taylor_recurrences import System

__all__ = ["Step", "StepTrial", "enclosed_zero_time", "evaluate_polynomial", "log2_magnitude"]

_REMAINDER_BITS = 64  # a remainder is needed to its first digits only
_MEAN_VALUE_BITS = 53  # of derivatives that only multiply radii
_MAX_ITERATIONS = 100
_ALL_COMPONENTS = slice(3)


@dataclass(frozen=True)
class Step:
    """One step of a proved flight: enclosures of all orbits from the current set of states over the
    times [0, length].

    They are proved if ``included`` is True.
    """

    start_time: Any  #: time at its start [s]
    length: Any  #: [s], exact: a float, or an array of balls
    enclosure: tuple[Any, ...]  #: holds the state throughout, for every orbit from the box
    state_set: Doubleton  #: of the states at its start
    orders: tuple[int, int]  #: of the midpoint's series, and of that over the box
    polynomials: list[list[Any]]  #: of the midpoint's orbit, the remainder's coefficient last
    #: those of the derivatives, 3 to a column, and of the divergence's integral, likewise
    derivative_polynomials: list[list[Any]]
    included: Any = True  #: True if the step is proved; a mask for arrays of balls

    def step_derivatives_at(
        self, time: Any, components: slice = _ALL_COMPONENTS
    ) -> tuple[tuple[Any, ...], ...]:
        """Return the derivatives of the state at ``time`` with respect to the state at the step's
        start and Omega, for every orbit from the box.
        """
        columns, time = (
            range(0, len(self.derivative_polynomials) - 2, 3),
            truncated_for_derivatives(time),
        )
        return tuple(
            tuple(
                evaluate_polynomial(self.derivative_polynomials[column + row], time)
                for column in columns
            )
            for row in range(3)[components]
        )

    def flight_derivatives_at(self, time: Any) -> tuple[tuple[Any, ...], ...]:
        """Return the derivatives of the state at ``time`` with respect to the start of the whole
        flight and Omega, for every orbit.
        """
        return self.state_set.derivatives_after_map(self.step_derivatives_at(time))

    def divergence_at(self, time: Any) -> Any:
        """Return the integral of div f, the field's divergence, from the step's start
        to ``time``.
        """
        return evaluate_polynomial(self.derivative_polynomials[-1], truncated_for_derivatives(time))

    def states_at(self, time: Any, components: slice = _ALL_COMPONENTS) -> tuple[Any, ...]:
        """Return balls of the state, or of some components, after ``time``, a ball within [0,
        length]. They hold for every orbit.
        """
        return self.state_set.image(
            self.midpoint_orbit_at(time, components), self.step_derivatives_at(time, components)
        )

    def component(self, index: int, time: Any) -> Any:
        """Return a ball of one component of the state after ``time`` [s], for every orbit."""
        return self.states_at(time, slice(index, index + 1))[0]

    def states_at_end(self) -> tuple[Any, ...]:
        """Return the state at the step's end, for every orbit from the box."""
        return self.state_set.image(*self.midpoint_end)

    @cached_property
    def midpoint_end(self) -> tuple[Sequence[Any], tuple[tuple[Any, ...], ...]]:
        """The state of the midpoint's orbit at the step's end, and the derivatives that
        `step_derivatives_at` gives there.
        """
        time = converted_like(self.polynomials[0][0], self.length)
        return self.midpoint_orbit_at(time), self.step_derivatives_at(time)

    def midpoint_orbit_at(self, time: Any, components: slice = _ALL_COMPONENTS) -> Sequence[Any]:
        """Return the state of the midpoint's orbit after ``time``."""
        return [evaluate_polynomial(series, time) for series in self.polynomials[components]]

    def time_span(self) -> Any:
        """Return a ball that holds all times of the step, from 0 to its length."""
        return _hull_with_zero(converted_like(self.enclosure[0], self.length))


def evaluate_polynomial(coefficients: Sequence[Any], time: Any) -> Any:
    result = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        result = result * time + coefficient
    return result


class StepTrial:
    """The Taylor series of all orbits from a flight's current set of states, on which step lengths
    are tried.

    The first of the ``orders`` is that of the midpoint's orbit, the second that of the orbits from
    the box.
    """

    def __init__(self, flight: Any, orders: tuple[int, int]) -> None:
        self.flight, self.orders, field = flight, orders, flight.field
        self.state_set = flight.state_set  #: the flight's place
        self.midpoint_series = field.midpoint_system.coefficients(
            flight.midpoint_start or flight.state_set.middle, orders[0]
        )
        box = [truncated_for_derivatives(part) for part in flight.box]
        zero, one = (converted_like(box[0], k) for k in (0, 1))
        columns = range(3 + len(flight.state_set.parameter_columns))
        start = [*box, *(one if row == column else zero for column in columns for row in range(3))]
        if flight.carries_derivatives:
            start.append(zero)
        with working_precision(working_bits() if flight.carries_derivatives else _MEAN_VALUE_BITS):
            self.box_series = self._system(field).coefficients(start, orders[1])

    def _system(self, field: Any) -> System:
        system: System = (
            field.variational_system_with_divergence
            if self.flight.carries_derivatives
            else field.variational_system
        )
        return system

    def tested_step(self, length: Any) -> Step:
        """Test a step of the given length: return it with its enclosures, proved or not.

        It becomes the flight's latest trial.
        """
        with working_precision(_REMAINDER_BITS):
            enclosure, midpoint_remainders, box_remainders, included = self._test(length)
        step = self.flight.latest_tested_step = Step(
            self.flight.time,
            length,
            enclosure,
            self.state_set,
            self.orders,
            [
                [*c, converted_like(c[0], r)]
                for c, r in zip(self.midpoint_series, midpoint_remainders, strict=True)
            ],
            [
                [*c, converted_like(c[0], r)]
                for c, r in zip(self.box_series[3:], box_remainders[3:], strict=True)
            ],
            included,
        )
        return step

    def _test(self, length: Any) -> tuple[tuple[Any, ...], list[Any], list[Any], Any]:
        """Test whether all orbits from the flight's set of states exist and stay in a padded box E
        over a step of this length.

        Returns four things. The first is E. The next two are the next Taylor coefficients over E,
        which give the remainders: of the states to the full order, and of the states with their
        derivatives to the rough order. The last tells whether the step is proved.
        """
        bound, (order, rough_order) = self.flight.field.remainder_field, self.orders
        time = converted_like(range_of(self.box_series[0][0]), range_of(length))
        span, power = _hull_with_zero(time), _hull_with_zero(time**rough_order)
        coefficients = [
            [range_of(coefficient) for coefficient in series] for series in self.box_series
        ]
        ranges = [evaluate_polynomial(series, span) for series in coefficients]
        # The last term's contribution is a fair guess of the remainder's.
        box = [
            part + around_zero(part.rad() / 256 + _padding(part)) + around_zero(series[-1] * power)
            for part, series in zip(ranges, coefficients, strict=True)
        ]
        box_remainders = [
            series[-1] for series in self._system(bound).coefficients(box, rough_order + 1)
        ]
        midpoint_remainders = box_remainders[:3]
        if rough_order != order:
            midpoint_remainders = [
                series[-1] for series in bound.midpoint_system.coefficients(box[:3], order + 1)
            ]
        # An infinite coefficient is in no interior.
        included = [
            inside(part + r * (power * span), part_box)
            for part, r, part_box in zip(ranges, box_remainders, box, strict=True)
        ]
        included += [positive(time), *(r.is_finite() for r in midpoint_remainders)]
        return tuple(box[:3]), midpoint_remainders, box_remainders, reduce(and_, included)


def enclosed_zero_time(
    step: Step,
    span: Any,
    value: Callable[[Any], Any],
    slope: Any,
    slope_over: Callable[[Any], Any],
) -> Any:
    """Return a ball of times that holds all zeros of growing functions of time; None if not shown.

    Each function has one zero in the step, and all zeros lie in the ball ``span``. ``value`` and
    ``slope_over`` enclose the functions and their derivatives at a ball of times; ``slope`` holds
    the derivatives over the span. Interval Newton steps are T -> t - x(t) / x'(T), where t is the
    midpoint of T; any point of T in the step would do. The sign of x(t) decides on which side of t
    the zero is.
    """
    moment = span
    for _ in range(_MAX_ITERATIONS):
        guess, radius = moment.mid(), moment.rad()
        if not (positive(guess) and positive(step.length - guess)):
            return None
        value_at_guess = value(guess)
        if positive(value_at_guess):
            moment = guess.union(guess - radius)
        elif negative(value_at_guess):
            moment = guess.union(guess + radius)
        moment = intersection(guess - value_at_guess / slope, moment)
        # At worst a step halves it, up to rounding
        if not 1.5 * magnitude_estimate(moment.rad()) < magnitude_estimate(radius):
            break
        slope = slope_over(moment)
    return moment if moment.is_finite() else None


def _hull_with_zero(length: Any) -> Any:
    """Return a ball that holds the interval from 0 to ``length``."""
    half = length / 2
    return half + around_zero(half)


def _padding(part: Any) -> Any:
    """Return the amount by which to widen a ball ``part`` on both sides, which is never zero."""
    if is_ball_array(part):
        return part.abs_upper() * 2.0 ** -(_REMAINDER_BITS // 2) + 2.0**-_REMAINDER_BITS
    return arb(2) ** (
        max(-_REMAINDER_BITS, log2_magnitude(part) - _REMAINDER_BITS // 2)
        if part.is_finite()
        else 0
    )


def log2_magnitude(x: Any) -> int:
    """Return the least integer k, but for rounding, with |x| < 2^k for all x of the ball; -10^6 for
    zero.

    Raises OverflowError for a ball that is not finite.
    """
    if not x.is_finite():
        raise OverflowError("an infinite ball has no size")
    mantissa, exponent = x.abs_upper().man_exp()
    return int(mantissa).bit_length() + int(exponent) if mantissa else -1_000_000
