"""Omega_h to any number of digits: where the saddles' manifolds meet.

The unstable branch of (pi/2, -pi/2, 0) starts on its power series, a fixed distance out, flows for a fixed time, and
ends near (pi/2, 3 pi/2, 0), where the power series of the stable manifold says how far off it is. That distance, the
splitting u(Omega), is an analytic function with a simple zero at Omega_h. Newton's iteration finds the zero in stages
of growing precision; at the end a wider arithmetic, with longer series and starts closer to the saddles, computes the
splitting once more, and how far it moves the zero is the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.newton import NewtonIteration
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.flow.contract import Engine, Request, Status
from tippedisk_verify.model.exact import Exact, fraction, quotient
from tippedisk_verify.model.measured import DISTANCES, Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import (
    DOUBLE,
    EXTENDED,
    QUADRUPLE,
    Precision,
    bits,
    bits_for_digits,
    companion,
)
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = [
    "MOST_DIGITS",
    "Splitting",
    "SplittingFunction",
    "SplittingZero",
    "splitting_zero",
    "splitting_zero_in_double",
]

_GUARD = 6  # digits lost on the way, to begin with: the passages amplify rounding, and the starts cancel
_FAR = 0.02  # where double still sees the approach to the second saddle clearly
_LONGEST = 30.0  # s
_SHORT_SERIES = 5  # where the flight is cheaper than the series: few powers, and starts close to the saddles


@dataclass(frozen=True)
class Splitting:
    """The splitting at one speed: coordinates of the end of the branch at the second saddle."""

    u: Any  #: along the unstable eigenvector; 0 on the stable manifold
    s: Any  #: along the slow stable curve
    t: Any  #: along the fast direction


@dataclass(frozen=True)
class SplittingZero:
    """Omega_h, how the splitting depends on Omega there, and what the error consists of."""

    omega_h: Measured  #: [rad/s]
    derivative: Measured  #: d(u)/d(Omega) [s/rad], carried back along the flow to s = 1
    budget: dict[str, float]  #: contributions to the half-width of omega_h [rad/s], by name
    evaluations: int


class SplittingFunction:
    """The splitting as a function of Omega in one arithmetic, with series and flight time chosen for its digits."""

    def __init__(
        self,
        parameters: Parameters,
        near: Fraction,
        engine: Engine,
        precision: Precision,
        closer: float = 1.0,
        coarser: tuple[Fraction, Splitting] | None = None,
        order: int | None = None,
    ) -> None:
        self.parameters, self.engine, self.precision = parameters, engine, precision
        digits = precision.bits * math.log10(2)
        # Longer series cost a cube of their order, closer starts a longer flight: a balance.
        self.order = order or 2 * round(6 + digits / 4) + 1
        self.bits = precision.bits + 32
        self._saddle = saddle = Saddle(parameters, near, self.bits, self.order)
        share = closer * 10 ** (-(digits + 2) / (self.order + 2))
        self.start = _short(float(saddle.reach(saddle.unstable_curve)) * share)
        self.end = _short(
            float(saddle.reach(saddle.stable_curve, saddle.fast_direction, saddle.unstable_direction)) * share
        )
        self.duration = self._flight_time(near, saddle)
        if coarser is not None:
            # The fast coordinate must fall until its square, which is neglected, is below what is resolved.
            time, value = coarser
            too_large = math.log(abs(float(value.t)) + 1e-300) + (digits + 2) / 2 * math.log(10)
            self.duration = max(
                self.duration, time + Fraction(max(0, math.ceil(-100 * too_large / float(saddle.eigenvalues[2]))), 100)
            )
        #: What the neglected terms are, relative to the reach: one power beyond the last, and the next few.
        self.truncation = 2 * share ** (self.order + 1 + (parameters.friction == "linear"))

    def __call__(self, omega: Fraction) -> Splitting:
        here = self._saddle.omega == omega
        saddle = self._saddle if here else Saddle(self.parameters, omega, self.bits, self.order)
        ctx = saddle.context
        result = self.engine(
            Request(
                self.parameters,
                omega,
                self.start_of(saddle),
                self.duration,
                shifted=True,
                precision=self.precision,
                domain="none",
            )
        )
        if result.status is not Status.REACHED:
            raise Shortfall(f"the unstable branch: {result.status.value}")
        beta, gamma, v = (quotient(ctx, value) for value in map(fraction, result.state))
        return Splitting(*saddle.stable_coordinates((beta, gamma - ctx.pi, v)))

    def start_of(self, saddle: Saddle) -> list[Fraction]:
        """(beta_bar, gamma_bar, v) on the unstable branch of the saddle at gamma_bar = -pi, at the chosen distance."""
        ctx = saddle.context
        beta, gamma, v = (curve.at(quotient(ctx, self.start)) for curve in saddle.unstable_curve)
        return [fraction(beta), fraction(gamma - ctx.pi), fraction(v)]

    def _flight_time(self, near: Fraction, saddle: Saddle) -> Fraction:
        """From the start until the slow stable coordinate is the end's, to a hundredth of a second."""
        start = [float(curve.at(saddle.context.mpf(float(self.start)))) for curve in saddle.unstable_curve]
        state = (start[0], Exact(fraction(start[1]), Fraction(-1)), start[2])
        times = numpy.arange(0, _LONGEST, 0.01)
        request = Request(
            self.parameters,
            near,
            state,
            float(times[-1]),
            shifted=True,
            times=times,
            precision=DOUBLE,
            domain="none",
        )
        samples = self.engine(request).samples
        away = numpy.abs(samples - numpy.array([0.0, math.pi, 0.0])).max(axis=1)
        reached = numpy.flatnonzero(away < max(_FAR, float(self.end)))
        if not len(reached):
            raise Shortfall("the unstable branch does not come near the second saddle: there is no connection here")
        begin = float(times[reached[0]])
        further = math.log(max(_FAR, float(self.end)) / float(self.end)) / -float(saddle.eigenvalues[1])
        return Fraction(round((begin + further) * 100), 100)


#: Digits of Omega_h that are offered; these take some hours, and the time grows like the power 2.5 of the digits.
MOST_DIGITS = 1000


def _short(value: float) -> Fraction:
    """The same to three digits: exact in every arithmetic, and the same in each."""
    return Fraction(f"{value:.2e}")


def _stages(wanted: int) -> list[Precision]:
    """Arithmetics from cheap to the one that holds the digits wanted, each with about twice those of the one before."""
    if wanted <= EXTENDED.digits and companion(DOUBLE) == EXTENDED:
        return [EXTENDED]
    stages: list[Precision] = []
    while wanted > QUADRUPLE.digits:
        stages.append(bits(bits_for_digits(wanted)))
        wanted = wanted // 2 + _GUARD
    return [QUADRUPLE, *stages[::-1]]


def splitting_zero(parameters: Parameters, near: Fraction, engine: Engine, digits: int) -> SplittingZero:
    """Omega_h [rad/s] to ``digits`` significant digits from an approximation good to some twelve.

    Raises Shortfall if the iteration does not settle, or if the digits are not reached.
    """
    guard = _GUARD
    while True:
        zero = _zero(parameters, near, engine, digits + guard)
        if zero.omega_h.uncertainty <= zero.omega_h.value / 10**digits:
            return zero
        guard *= 2
        if guard > 8 * _GUARD:
            raise Shortfall(
                f"only {float(zero.omega_h.uncertainty):.1e} rad/s could be had for Omega_h: ask for fewer digits"
            )


def _zero(parameters: Parameters, near: Fraction, engine: Engine, wanted: int) -> SplittingZero:
    omega, slope, evaluations = near, None, 0
    value = Splitting(0, 0, 0)
    coarser: tuple[Fraction, Splitting] | None = None
    for precision in _stages(wanted):
        splitting_at = SplittingFunction(parameters, near, engine, precision, coarser=coarser)
        step = _half_digits(precision)
        value = splitting_at(omega)
        slope = (fraction(splitting_at(omega + step).u) - fraction(value.u)) / step
        evaluations += 2
        # Down to a thousand roundings, or until the steps no longer shrink: what is left is measured at the end.
        failure = Shortfall("the iteration for Omega_h does not settle: is the approximation it starts from one?")
        iteration = NewtonIteration(8, failure, small=omega * precision.epsilon * 10**3, fewest=2)
        while True:
            change = fraction(value.u) / slope
            omega = _cut(omega - change, precision)
            if iteration.converged(abs(change)):
                break
            value = splitting_at(omega)
            evaluations += 1
        coarser = splitting_at.duration, value
    if slope is None or not slope:
        raise Shortfall("the splitting does not depend on Omega: there is no isolated connection")
    wider = companion(precision)
    finer = SplittingFunction(parameters, near, engine, wider, closer=0.5, coarser=coarser)
    check = finer(omega)
    shift = abs(fraction(check.u) / slope)
    # What L(s) leaves out: the square of the fast coordinate, with a curvature of order 1.
    fast = 10 * fraction(check.t) ** 2 / abs(slope)
    half_width = shift * DISTANCES + fast + omega * precision.epsilon
    # The slope once more, with another step and at another distance from the saddles: the difference is its error.
    finer_step = _half_digits(wider)
    finer_slope = (fraction(finer(omega + finer_step).u) - fraction(check.u)) / finer_step
    unstable, slow, _ = Saddle(parameters, omega, wider.bits, 3).eigenvalues
    rough, sharp = (
        fraction(change) * fraction(abs(ending.s) ** (-unstable / slow))
        for change, ending in ((slope, value), (finer_slope, check))
    )
    return SplittingZero(
        omega_h=Measured(omega, half_width),
        # u grows like exp(lambda_u t), s falls like exp(lambda_s t): this product does not depend on the flight time.
        derivative=Measured.compared(sharp, rough, precision.epsilon),
        budget={
            "series, flow and rounding, by a wider run": float(shift),
            "fast direction beyond first order": float(fast),
            "truncation of the series": splitting_at.truncation / abs(float(slope)),
            "last rounding": float(omega * precision.epsilon),
        },
        evaluations=evaluations + 2,
    )


def splitting_zero_in_double(parameters: Parameters, near: Fraction, engine: Engine) -> Measured:
    """Omega_h [rad/s] in double from an approximation good to some five digits, for curves of many of them.

    The half-width is measured by one evaluation of the splitting in the next wider arithmetic. Raises Shortfall if the
    iteration does not settle or the branch does not arrive, NoConnectionError where there are no saddles to connect.
    """
    omega = _cut(near, DOUBLE)
    splitting_at = SplittingFunction(parameters, omega, engine, DOUBLE, order=_SHORT_SERIES)
    value, step = splitting_at(omega), _half_digits(DOUBLE)
    slope = (fraction(splitting_at(omega + step).u) - fraction(value.u)) / step
    failure = Shortfall("the iteration for Omega_h does not settle: is the approximation it starts from one?")
    # The slope is that of the start, good to its distance: a step this small leaves less than rounding.
    iteration = NewtonIteration(8, failure, small=omega / 10**12, fewest=2)
    while True:
        change = fraction(value.u) / slope
        omega = _cut(omega - change, DOUBLE)
        if iteration.converged(abs(change)):
            break
        value = splitting_at(omega)
    wider = companion(DOUBLE)
    check = SplittingFunction(parameters, omega, engine, wider, closer=0.5, order=_SHORT_SERIES)(omega)
    unstable, slow, _ = Saddle(parameters, omega, wider.bits, 3).eigenvalues
    # The slope at the wider run's end, as in `_zero`: u grows like exp(lambda_u t), s falls like exp(lambda_s t).
    slope *= fraction(abs(value.s / check.s) ** (-unstable / slow))
    off = abs(fraction(check.u) / slope) + 10 * fraction(check.t) ** 2 / abs(slope)
    return Measured(omega, off * DISTANCES + omega * DOUBLE.epsilon)


def _half_digits(precision: Precision) -> Fraction:
    """A step between the resolution and the distance where curvature shows: half of the digits."""
    return Fraction(1, 10 ** (int(precision.bits * math.log10(2)) // 2))


def _cut(omega: Fraction, precision: Precision) -> Fraction:
    """Rounded to a few bits more than the arithmetic has, so that the rational does not grow."""
    scale = 1 << (precision.bits + 8)
    return Fraction(round(omega * scale), scale)
