"""The family with the period as its parameter: the way to follow it to Omega_h, and Omega_h as its
limit.

Close to Omega_h the speed hardly changes while the period grows without bound. So Omega becomes an
unknown and half the period T / 2 is given. The state then leaves the saddle's neighbourhood, and
Omega its limit, like exponentials of T / 2. Predictions are made in their logarithms. With the
saddle's unstable and slow stable eigenvalues

    Omega(T) = Omega_h + C exp(-lambda_u T / 2) + B exp(lambda_s T / 2) + ...,

so two solved cycles give C, B and Omega_h. Each new cycle is as much longer as that prediction
allows, in an arithmetic that resolves it. The saddles' manifolds do not enter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.near_omega_h.required_precision import precision_near_omega_h
from tippedisk_verify.cycles.shooting.newton import Iterate, StoppingRule, newton
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import LIBRATING
from tippedisk_verify.errors import AccuracyError, NoSuchCycleError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR, Measured
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    Precision,
    precision_of_bits,
)
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.saddle_manifolds import refuse_focus

__all__ = [
    "PeriodContinuation",
    "PeriodPoint",
    "SpeedAsymptotics",
    "cycle_at_half_period",
    "cycles_of_rising_period",
    "limit_of_cycles",
    "predicted_state",
]

_MAX_STEPS = 15
_FIRST_STEP, _MIN_STEP = 0.02, 5e-4  # s
_FOLD_DISTANCE = 1e-3  # rad/s; the distance from Omega_h down to which folds are sought
_MIN_IN_DOUBLE = 1e-8  # rad/s; closer to Omega_h double has few digits of the slopes
_MAX_PERIOD = 30.0  # s, the longest period in double
_MAX_CYCLES = 60


@dataclass(frozen=True)
class PeriodPoint:
    """A limit cycle that was solved for at a fixed period, in one arithmetic."""

    half_period: Any  #: T / 2 [s]
    gamma_bar_0: Any  #: [rad]
    v_0: Any  #: [rad/s]
    omega: Any  #: [rad/s]
    slopes: tuple[Any, Any, Any]  #: d(gamma_bar_0, v_0, Omega) / d(T / 2)
    residuals: tuple[float, ...]  #: the sizes of the Newton steps


def cycle_at_half_period(
    parameters: Parameters,
    half_period: Any,
    guess: Sequence[Any],
    engine: Engine,
    precision: Precision = DOUBLE,
) -> PeriodPoint:
    """Solve for the librating limit cycle with a given half period, by Newton's iteration.

    The unknowns are (gamma_bar_0, v_0, Omega).

    Args:
        parameters: The disk and its friction law.
        half_period: T / 2 [s].
        guess: The first guess of (gamma_bar_0, v_0, Omega).
        engine: The engine of the flights.
        precision: The arithmetic.

    Raises:
        NoSuchCycleError: If the iteration does not converge, or leaves the well.
    """
    gamma_bar, v, omega = (precision.number(value) for value in guess)
    duration = precision.number(half_period)

    def size(iterate: Iterate[LimitCycle]) -> float:
        """Return the size of a Newton step: the largest of its parts, each relative to its scale.

        gamma_bar and v are scaled by their distances from the saddle, and the speed by its
        derivative with respect to T / 2. Raises NoSuchCycleError if the state leaves the well.
        """
        gamma_bar, v, _ = iterate.next_point
        left, by_time = precision.pi - gamma_bar, iterate.image.slopes("time")[2]
        parts = iterate.step[0] / left, iterate.step[1] / v, iterate.step[2] / by_time
        largest = max(abs(float(part)) for part in parts)
        if not (math.isfinite(largest) and 0 < float(left) < math.pi and float(v) < 0):
            raise NoSuchCycleError(
                "the iteration at fixed period left the well: take a smaller step in the period"
            )
        return largest

    # By quadratic convergence the cycle is then right to twice as many digits, and its slopes to as
    # many.
    stop = StoppingRule(
        _MAX_STEPS,
        NoSuchCycleError(
            f"the iteration at fixed period has not converged after {_MAX_STEPS} steps"
        ),
        tolerance=1e-7 if precision == DOUBLE else 1e-10,
        stall_tolerance=1e-3,
    )
    return_map = ReturnMap(LIBRATING, parameters, omega, engine, precision)
    found = newton(return_map, (gamma_bar, v), stop, size, fixed_quantity="time", time=duration)
    return PeriodPoint(duration, *found.next_point, found.image.slopes("time")[:3], found.residuals)


def cycles_of_rising_period(
    parameters: Parameters, first: PeriodPoint, engine: Engine, *, longest: float
) -> Iterator[PeriodPoint]:
    """Yield librating limit cycles of longer and longer period, in double.

    The step in the half period adapts: it grows by half after a quick solution and is halved after
    a failed one.

    Args:
        parameters: The disk and its friction law.
        first: The first cycle, which is not yielded.
        engine: The engine of the flights.
        longest: The longest period [s].

    Raises:
        NoSuchCycleError: If the step is below half a millisecond, where rounding swamps Omega -
            Omega_h.
    """
    point, before, step = first, first, _FIRST_STEP
    while 2 * point.half_period < longest:
        if step < _MIN_STEP:
            period = f"{2 * point.half_period:.4g} s"
            raise NoSuchCycleError(
                f"at the period {period} rounding swamps the family: compute in more bits"
            )
        half_period = min(point.half_period + step, longest / 2)
        guess = (
            *predicted_state(point, half_period, DOUBLE),
            _predicted_speed(point, before, half_period),
        )
        try:
            before, point = point, cycle_at_half_period(parameters, half_period, guess, engine)
        except NoSuchCycleError:
            step /= 2
            continue
        yield point
        step *= 1.5 if len(point.residuals) <= 4 else 1.0 if len(point.residuals) <= 6 else 0.7


def predicted_state(point: PeriodPoint, half_period: Any, precision: Precision) -> tuple[Any, Any]:
    """Predict (gamma_bar_0, v_0) of the limit cycle with another half period, along the tangent in
    logarithms of distances from the saddle.

    Args:
        point: The cycle to start from.
        half_period: T / 2 [s].
        precision: The arithmetic.
    """
    number, exp = precision.number, precision.ops.exp
    ahead = half_period - number(point.half_period)
    gamma_slope, v_slope = number(point.slopes[0]), number(point.slopes[1])
    left, v = precision.pi - number(point.gamma_bar_0), number(point.v_0)
    return precision.pi - left * exp(-gamma_slope / left * ahead), v * exp(v_slope / v * ahead)


def _predicted_speed(point: PeriodPoint, before: PeriodPoint, half_period: float) -> Any:
    """Predict the speed Omega [rad/s] of the limit cycle with another half period, from a cycle and
    the one before.

    The distance from the limit is extrapolated as an exponential, at the rate at which the slopes
    fall. If they do not fall, the tangent is followed.
    """
    ahead = half_period - point.half_period
    falls = point.slopes[2] / before.slopes[2]
    if not 0 < falls < 1:  # at the first cycle, and where the speed does not tend to a limit yet
        return point.omega + point.slopes[2] * ahead
    rate = math.log(falls) / (point.half_period - before.half_period)
    return point.omega + point.slopes[2] * (math.exp(rate * ahead) - 1) / rate


# ---------------------------------------------------------------------------------------- the limit
class SpeedAsymptotics:
    """The asymptotic law of the speed Omega(T) of librating cycles, with three terms that are
    fitted to two cycles.

    Args:
        parameters: The disk and its friction law.
        first: The cycle of the shorter period.
        second: The cycle of the longer period.
        precision: The arithmetic of the cycles.
    """

    def __init__(
        self, parameters: Parameters, first: PeriodPoint, second: PeriodPoint, precision: Precision
    ) -> None:
        ctx = self._ctx = precision_of_bits(precision.bits + 16).context

        def mpf(value: Any) -> Any:
            return rational_in_context(ctx, fraction(value))

        digits = max(15, precision.digits)
        eigenvalues = equilibrium(
            parameters, fraction(second.omega), "noninverted", digits
        ).eigenvalues
        self._unstable, self._stable = (mpf(value.re.value) for value in eigenvalues[:2])
        self._half_period = mpf(second.half_period)
        ahead = mpf(first.half_period) - self._half_period
        # Derivatives at both: -lambda_u C e + lambda_s B f, with e = f = 1 at the second.
        e, f = ctx.exp(-self._unstable * ahead), ctx.exp(self._stable * ahead)
        slopes = mpf(first.slopes[2]), mpf(second.slopes[2])
        determinant = -self._unstable * self._stable * (e - f)
        self._c = (slopes[0] - slopes[1] * f) * self._stable / determinant
        self._b = (slopes[0] - slopes[1] * e) * self._unstable / determinant
        self.omega_h = fraction(mpf(second.omega) - self._c - self._b)

    def half_period(self, above: Fraction) -> Fraction:
        """Return half the period T / 2 [s] of the cycle at a distance from Omega_h, by the
        asymptotic law.

        Args:
            above: Omega - Omega_h [rad/s]; negative below Omega_h.
        """
        ctx, target = self._ctx, rational_in_context(self._ctx, above)
        # The larger of the two terms gives the start.
        ahead = max(
            ctx.log(term / target) / rate
            for term, rate in ((self._c, self._unstable), (self._b, -self._stable))
            if term / target > 0
        )
        for _ in range(60):
            e, f = ctx.exp(-self._unstable * ahead), ctx.exp(self._stable * ahead)
            step = (self._c * e + self._b * f - target) / (
                -self._unstable * self._c * e + self._stable * self._b * f
            )
            ahead -= step
            if abs(step) < 1e-6:
                break
        return fraction(self._half_period + ahead)


class PeriodContinuation:
    """The librating family followed towards Omega_h, cycle by cycle, with an estimate of Omega_h.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
    """

    def __init__(self, parameters: Parameters, engine: Engine) -> None:
        self.parameters, self.engine = parameters, engine
        family = LibratingFamily(parameters, engine, closest=_FOLD_DISTANCE)
        refuse_focus(parameters, Fraction(family.limit))
        guess = family.guess(float(family.nodes[-1, 0]))
        growth = float(
            equilibrium(parameters, Fraction(family.limit), "noninverted").eigenvalues[0].re
        )
        points = [
            cycle_at_half_period(
                parameters, guess.flight_time, (*guess.coordinates, guess.omega), engine
            )
        ]
        for point in cycles_of_rising_period(parameters, points[0], engine, longest=_MAX_PERIOD):
            points.append(point)
            if len(points) > 3 and abs(point.slopes[2]) < growth * _MIN_IN_DOUBLE:
                break
        self.points = points
        before, self.asymptotics = (
            SpeedAsymptotics(parameters, *pair, DOUBLE) for pair in pairwise(points[-3:])
        )
        #: The last change of the estimated limit [rad/s], at least the rounding of a double. The
        #: error of the present estimate is smaller.
        self.change = max(
            abs(self.asymptotics.omega_h - before.omega_h), self.asymptotics.omega_h / 2**50
        )

    @property
    def latest(self) -> PeriodPoint:
        """The last cycle that the continuation has found."""
        return self.points[-1]

    def law_rows(self, unstable: float) -> list[tuple[float, float, float]]:
        """Return a row for each cycle, to compare the periods with their law: Omega - Omega_h
        [rad/s], the period [s], and a ratio of slopes.

        The ratio is the slope of T over that of the law

            T = c - (2 / lambda_u) log(Omega - Omega_h) + O((Omega - Omega_h)^p),

        where p = |lambda_s| / lambda_u - 1. The ratio tends to 1.

        Args:
            unstable: lambda_u [1/s].
        """
        rows = []
        for point in self.points:
            above = float(fraction(point.omega) - self.asymptotics.omega_h)
            # dT / d(log D) = 2 D / (d(Omega) / d(T / 2)).
            rows.append(
                (above, 2 * float(point.half_period), -unstable * above / float(point.slopes[2]))
            )
        return rows

    @property
    def distance(self) -> Fraction:
        """The distance Omega - Omega_h [rad/s] of the last cycle found, negative if cycles lie
        below Omega_h.
        """
        return fraction(self.latest.omega) - self.asymptotics.omega_h

    def extend_towards(self, least: Fraction) -> None:
        """Compute one more cycle of the family, as much closer to Omega_h as the law predicts
        reliably.

        Args:
            least: The least distance of the cycle from Omega_h [rad/s].

        Raises:
            AccuracyError: If the cycle is not found, or there are too many cycles.
        """
        # The prediction is off by about the last change of the limit. A cycle at a hundred times
        # that distance from Omega_h is within reach.
        ahead = max(100 * self.change, least)
        if not ahead < abs(self.distance):
            ahead = abs(self.distance) / 4
        above = ahead if self.distance > 0 else -ahead
        omega_h = self.asymptotics.omega_h
        precision = precision_near_omega_h(self.parameters, omega_h, ahead, 12)
        half_period = precision.number(self.asymptotics.half_period(above))
        guess = (*predicted_state(self.latest, half_period, precision), omega_h + above)
        try:
            point = cycle_at_half_period(
                self.parameters, half_period, guess, self.engine, precision
            )
        except NoSuchCycleError as fault:
            raise AccuracyError(
                f"the family of limit cycles could not be followed to Omega_h: {fault}"
            ) from None
        self.asymptotics = SpeedAsymptotics(self.parameters, self.latest, point, precision)
        self.change = abs(self.asymptotics.omega_h - omega_h)
        self.points.append(point)
        if len(self.points) > _MAX_CYCLES:
            raise AccuracyError(
                f"the limit of the limit cycles still moves by {float(self.change):.1e} rad/s"
            )


def limit_of_cycles(parameters: Parameters, engine: Engine, digits: int) -> Measured:
    """Return Omega_h to ``digits`` significant digits, as the limit of the librating cycles.

    The answer is the limit before the last one, and its distance from the last one is the error.
    The distance falls from cycle to cycle by a growing factor, a hundredfold and more. So twice the
    distance also holds the error of the last limit.

    Args:
        parameters: The disk and its friction law.
        engine: The engine of the flights.
        digits: The significant digits wanted.

    Returns:
        Omega_h [rad/s].

    Raises:
        AccuracyError: If the family ends before.
    """
    family = PeriodContinuation(parameters, engine)
    while True:
        omega_h = family.asymptotics.omega_h
        family.extend_towards(omega_h / 10**digits)
        half_width = family.change * HALF_WIDTH_FACTOR
        if half_width <= omega_h / 10**digits:
            return Measured(omega_h, half_width)
