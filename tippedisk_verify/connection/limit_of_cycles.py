"""Omega_h from inside: the limit of the limit cycles as their period grows.

Along the family Omega(T) = Omega_h + C exp(-lambda_u T / 2) + B exp(lambda_s T / 2) + ..., with the saddle's unstable
and slow stable eigenvalues: two solved cycles give C, B and Omega_h. Each new cycle is as much longer as that
prediction allows, in an arithmetic that resolves it. Nothing of the saddles' manifolds enters.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.period_continuation import PeriodPoint, cycle_at_half_period, lengthened, predicted_state
from tippedisk_verify.errors import NoSuchCycleError, Shortfall
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.exact import fraction, quotient
from tippedisk_verify.model.measured import DISTANCES, Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, QUADRUPLE, Precision, bits, bits_for_digits
from tippedisk_verify.theory.equilibria import equilibrium
from tippedisk_verify.theory.saddle_manifolds import refuse_focus

__all__ = ["PeriodAsymptotics", "PeriodContinuation", "limit_of_cycles", "resolving"]

_SMALLEST_IN_DOUBLE = 1e-7  # Omega - Omega_h [rad/s] down to which double has the slopes to a few digits
_MOST_CYCLES = 60
_FIRST, _BEYOND_A_FOLD = 0.3, 0.3  # abscissas of the family by amplitude where its descent begins
_FOLLOWED = 1e-3  # rad/s; as near Omega_h as folds are looked for


class PeriodContinuation:
    """The family followed towards Omega_h, cycle by cycle, with what its limit looks like so far."""

    def __init__(self, parameters: Parameters, engine: Engine) -> None:
        self.parameters, self.engine = parameters, engine
        self._points = _in_double(parameters, engine)
        self.latest, self.solved = self._points[-1], len(self._points)
        self.asymptotics = PeriodAsymptotics(parameters, self._points[-2], self.latest, DOUBLE)
        #: The last change of the limit [rad/s]; the error of the present one is a small part of it.
        self.change = abs(fraction(self.latest.omega) - self.asymptotics.omega_h)

    @property
    def above(self) -> Fraction:
        """Omega - Omega_h of the last cycle [rad/s], negative where cycles lie below."""
        return fraction(self.latest.omega) - self.asymptotics.omega_h

    def further(self, least: Fraction) -> None:
        """One more cycle, as far ahead as the law allows, but not closer to Omega_h than ``least`` [rad/s].

        Raises Shortfall if it is not found.
        """
        # The prediction is off by about the last change of the limit: a cycle a hundred times further out is within it.
        ahead = max(100 * self.change, least)
        if not ahead < abs(self.above):
            ahead = abs(self.above) / 4
        above = ahead if self.above > 0 else -ahead
        precision = resolving(self.parameters, self.asymptotics.omega_h, ahead, 12)
        half_period = precision.number(self.asymptotics.half_period(above))
        guess = (*predicted_state(self.latest, half_period, precision), self.asymptotics.omega_h + above)
        try:
            point = cycle_at_half_period(self.parameters, half_period, guess, self.engine, precision)
        except NoSuchCycleError as fault:
            raise Shortfall(f"the family of limit cycles could not be followed to Omega_h: {fault}") from None
        asymptotics = PeriodAsymptotics(self.parameters, self.latest, point, precision)
        self.change, self.asymptotics = abs(asymptotics.omega_h - self.asymptotics.omega_h), asymptotics
        self.latest, self.solved = point, self.solved + 1
        if self.solved > _MOST_CYCLES:
            raise Shortfall(f"the limit of the limit cycles still moves by {float(self.change):.1e} rad/s")


def resolving(parameters: Parameters, near: Fraction, above: Fraction, digits: int) -> Precision:
    """The arithmetic for a cycle at ``near`` + ``above``, close to Omega_h = ``near``, with so many digits left.

    Rounding grows over a passage like 1 / above, and must be small against the state's distance from the saddle, which
    is of the order of ``above`` to the power lambda_u / (lambda_u - lambda_s).
    """
    unstable, slow, _ = (float(value.re) for value in equilibrium(parameters, near, "noninverted").eigenvalues)
    power = 1 + unstable / (unstable - slow)
    needed = bits_for_digits(digits + 4 + math.ceil(power * max(0.0, -log10(abs(above)))))
    return QUADRUPLE if needed <= QUADRUPLE.bits else bits(needed)


def log10(value: Fraction) -> float:
    return math.log10(value.numerator) - math.log10(value.denominator)


def limit_of_cycles(parameters: Parameters, engine: Engine, digits: int) -> tuple[Measured, int]:
    """Omega_h [rad/s] to ``digits`` significant digits, and the number of cycles solved for it.

    The answer is the limit before the last one, and its distance to the last one its error: that falls by a growing
    factor from cycle to cycle, a hundredfold and more, so twice the distance holds what the last one is off itself.
    Raises Shortfall if the family ends before.
    """
    family = PeriodContinuation(parameters, engine)
    while True:
        omega_h = family.asymptotics.omega_h
        family.further(omega_h / 10 ** (digits + 3))
        half_width = family.change * DISTANCES
        if half_width <= omega_h / 10**digits:
            return Measured(omega_h, half_width), family.solved


def _in_double(parameters: Parameters, engine: Engine) -> list[PeriodPoint]:
    """Cycles of the family in double, from where no fold is ahead as far as the slopes keep a few digits."""
    family = LibratingFamily(parameters, engine, closest=_FOLLOWED)
    refuse_focus(parameters, Fraction(family.limit))
    start = family.place(max([_FIRST, *(fold + _BEYOND_A_FOLD for fold in family.folds)]))
    points = [cycle_at_half_period(parameters, start.flight, (*start.start, start.omega), engine)]
    for point in lengthened(parameters, points[0], engine, longest=30.0):
        points.append(point)
        growth = max(
            float(value.re) for value in equilibrium(parameters, fraction(point.omega), "noninverted").eigenvalues
        )
        if len(points) > 3 and abs(float(point.slopes[2])) < growth * _SMALLEST_IN_DOUBLE:
            break
    return points


class PeriodAsymptotics:
    """The three-term law Omega(T) = Omega_h + C exp(-lambda_u T / 2) + B exp(lambda_s T / 2) through two cycles."""

    def __init__(self, parameters: Parameters, first: PeriodPoint, second: PeriodPoint, precision: Precision) -> None:
        ctx = self._ctx = bits(precision.bits + 16).context

        def mpf(value: Any) -> Any:
            return quotient(ctx, fraction(value))

        eigenvalues = equilibrium(
            parameters, fraction(second.omega), "noninverted", max(15, precision.digits)
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
        """T / 2 [s] of the cycle that far above Omega_h [rad/s], below it if negative."""
        ctx, target = self._ctx, quotient(self._ctx, above)
        # Of the two terms that which prevails tells where to begin.
        ahead = max(
            ctx.log(term / target) / rate
            for term, rate in ((self._c, self._unstable), (self._b, -self._stable))
            if term / target > 0
        )
        for _ in range(60):
            e, f = ctx.exp(-self._unstable * ahead), ctx.exp(self._stable * ahead)
            step = (self._c * e + self._b * f - target) / (-self._unstable * self._c * e + self._stable * self._b * f)
            ahead -= step
            if abs(step) < 1e-6:
                break
        return fraction(self._half_period + ahead)
