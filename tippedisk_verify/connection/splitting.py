"""Omega_h to any number of digits, with its half-width and derivatives, as the speed at which the
saddles' manifolds meet.

**The splitting.** The unstable manifold of (pi/2, -pi/2, 0) starts on its power series, at a fixed
distance. It flows for a fixed time and ends next to (pi/2, 3 pi/2, 0). There the power series of
the stable manifold gives its distance from that manifold. This distance, the splitting u(Omega), is
an analytic function with a simple zero at Omega_h.

**The invariant.** Along the flow u grows like exp(lambda_u t). The coordinate s on the stable curve
falls like exp(lambda_s t). So the splitting carried back to s = 1,

    u |s|^(-lambda_u / lambda_s),

depends neither on the flight time nor on the starts.

**The iteration.** Newton's iteration finds its zero in stages of growing precision. A wider
arithmetic, with longer series and starts closer to the saddles, then computes the splitting once
more. The shift of the zero is the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.flow.contract import Engine, Request, Result, Status
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.numbers.measured import HALF_WIDTH_FACTOR, Measured
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    EXTENDED,
    QUADRUPLE,
    Precision,
    bits_for_digits,
    precision_of_bits,
    wider_precision,
)
from tippedisk_verify.support.progress import report_share
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = [
    "MAX_DIGITS",
    "Splitting",
    "SplittingFunction",
    "SplittingZero",
    "first_arrival",
    "splitting_zero",
]

#: The largest number of digits of Omega_h. They take some hours: the time grows like the power 2.5
#: of the digits.
MAX_DIGITS = 1000

# Guard digits of the first attempt: the passages amplify rounding, and the starts cancel.
_GUARD_DIGITS = 6
# The distance from the second saddle at which double still sees the approach clearly
_END_DISTANCE = 0.02
_MAX_FLIGHT = 30.0  # s, the longest flight
_MAX_STEPS = 8  # Newton steps in one arithmetic
_MAX_CURVATURE = 10**8  # s/rad; a bound of the slope's relative change with Omega
_CACHED_ZEROS = 256  # zeros in the cache
# The shares of the time for Omega_h that are over after the last stage and after the wider run. The
# rest is for the derivative of the splitting.
_BY_STAGES, _BY_WIDER_RUN = 0.4, 0.6


@dataclass(frozen=True)
class Splitting:
    """The splitting of the saddles' manifolds at one speed.

    It consists of the coordinates in which the first saddle's unstable manifold arrives at the
    second saddle. The connection exists where u = 0.
    """

    omega: Fraction  #: [rad/s]
    u: Any  #: along the unstable eigenvector; 0 on the stable manifold
    s: Any  #: along the slow stable curve
    f: Any  #: along the fast direction
    invariant_factor: Any  #: |s|^(-lambda_u / lambda_s), which carries u back to s = 1

    @property
    def invariant(self) -> Fraction:
        """The splitting u |s|^(-lambda_u / lambda_s). The linear flow keeps it constant, so flights
        of any length can be compared.
        """
        return fraction(self.u * self.invariant_factor)


class SplittingFunction:
    """The splitting of the saddles' manifolds as a function of Omega, computed in one arithmetic.

    The zero of its coordinate u is Omega_h. The orders of its series and its flight time suit the
    digits of the arithmetic.

    Args:
        parameters: The disk and its friction law.
        speed: A speed near Omega_h [rad/s], at which series and flight time are chosen.
        engine: The engine of the flights.
        precision: The arithmetic of the flights.
        distance_factor: The factor by which start and end are closer to the saddles.
        coarser_function: The same function in a coarser arithmetic. It shows how long the fast
            coordinate takes to decay.
    """

    def __init__(
        self,
        parameters: Parameters,
        speed: Fraction,
        engine: Engine,
        precision: Precision,
        distance_factor: float = 1.0,
        coarser_function: SplittingFunction | None = None,
    ) -> None:
        self.parameters, self.engine, self.precision = parameters, engine, precision
        digits = precision.bits * math.log10(2)
        # Longer series cost the cube of their order, and closer starts a longer flight. This
        # balance was measured.
        self.order = 2 * round(digits / 9) + 1
        self.bits = precision.bits + 32
        self._saddle = saddle = Saddle(parameters, speed, self.bits, self.order)
        share = distance_factor * 10 ** (-(digits + 2) / (self.order + 2))
        self.start = _rounded_to_three_digits(
            float(saddle.convergence_radius(saddle.unstable_curve)) * share
        )
        self.end = _rounded_to_three_digits(
            float(
                saddle.convergence_radius(
                    saddle.stable_curve, saddle.fast_direction, saddle.unstable_direction
                )
            )
            * share
        )
        self.duration = self._flight_time(saddle)
        if coarser_function is not None:
            # The fast coordinate must fall until its square, which is neglected, is below the
            # resolution.
            too_large = math.log(abs(float(coarser_function.latest.f)) + 1e-300) + (
                digits + 2
            ) / 2 * math.log(10)
            longer = Fraction(
                max(0, math.ceil(-100 * too_large / float(saddle.eigenvalues[2]))), 100
            )
            self.duration = max(self.duration, coarser_function.duration + longer)
        self.latest: Splitting = Splitting(speed, 0, 0, 0, 0)  #: the last result, except by slopes

    def __call__(self, omega: Fraction) -> Splitting:
        """Return the splitting of the saddles' manifolds at a speed [rad/s].

        Raises:
            AccuracyError: If the flight fails.
        """
        saddle = self._saddle
        if saddle.omega != omega:
            saddle = Saddle(self.parameters, omega, self.bits, self.order)
        ctx = saddle.context
        end = self._flight(saddle, self.precision, self.duration)
        if end.status is not Status.REACHED:
            raise AccuracyError(f"the unstable manifold: {end.status.value}")
        beta, gamma, v = (rational_in_context(ctx, value) for value in map(fraction, end.state))
        u, s, f = saddle.stable_coordinates((beta, gamma - ctx.pi, v))
        unstable, slow, _ = saddle.eigenvalues
        self.latest = Splitting(omega, u, s, f, abs(s) ** (-unstable / slow))
        return self.latest

    def _flight(
        self, saddle: Saddle, precision: Precision, duration: object, times: Any = None
    ) -> Result:
        """Return the flight along the saddle's unstable manifold, from this object's starting
        distance on.

        Args:
            saddle: The saddle at the speed of the flight.
            precision: The arithmetic.
            duration: The flight's duration [s].
            times: Sample times [s], or None.
        """
        return self.engine(
            Request(
                self.parameters,
                saddle.omega,
                saddle.start_on_unstable_manifold(self.start),
                duration,
                times=times,
                precision=precision,
                shifted=True,
                domain="none",
            )
        )

    @property
    def speed_step(self) -> Fraction:
        """The step of the speed in a central difference of the splitting [rad/s]: ten to minus half
        of the digits.

        It lies between the resolution and the step at which curvature shows.
        """
        return Fraction(1, 10 ** (int(self.precision.bits * math.log10(2)) // 2))

    def slope(self, omega: Fraction) -> Fraction:
        """Return the derivative of `Splitting.invariant` with respect to Omega [s/rad], by a
        central difference.

        Args:
            omega: The speed [rad/s].
        """
        latest = self.latest
        change = self(omega + self.speed_step).invariant - self(omega - self.speed_step).invariant
        self.latest = latest
        return change / (2 * self.speed_step)

    def parameter_slope(self, symbol: str, omega: Fraction) -> Fraction:
        """Return the derivative of `Splitting.invariant` with respect to a parameter of the disk
        [SI].

        Start, end and flight time are kept, because u does not depend on them.

        Args:
            symbol: The parameter's name.
            omega: The speed [rad/s].

        Raises:
            AccuracyError: If a flight fails.
        """
        value: Fraction = getattr(self.parameters, symbol)
        step = value * self.speed_step / omega
        change = Fraction(0)
        for sign in (1, -1):
            varied = copy(self)
            varied.parameters = self.parameters.changed(**{symbol: value + sign * step})
            varied._saddle = Saddle(varied.parameters, omega, self.bits, self.order)
            change += sign * varied(omega).invariant
        return change / (2 * step)

    def _flight_time(self, saddle: Saddle) -> Fraction:
        """Return the flight time [s] from the first saddle until the slow coordinate at the second
        saddle is as small as wanted.

        It is rounded to a hundredth of a second. Raises AccuracyError if the branch does not come
        near the second saddle.
        """
        times, end = numpy.arange(0, _MAX_FLIGHT, 0.01), float(self.end)
        samples = self._flight(saddle, DOUBLE, float(times[-1]), times).samples
        begin = float(times[first_arrival(samples, max(_END_DISTANCE, end))])
        further = math.log(max(_END_DISTANCE, end) / end) / -float(saddle.eigenvalues[1])
        return Fraction(round((begin + further) * 100), 100)


def first_arrival(samples: Any, distance: float) -> int:
    """Return the index of the first state on the unstable manifold that is close to the second
    saddle.

    Args:
        samples: States (n, 3) of the branch: beta_bar, gamma_bar [rad] and v [rad/s].
        distance: The largest difference of any component from the saddle's.

    Raises:
        AccuracyError: If no state is that close.
    """
    near = numpy.flatnonzero(numpy.abs(samples - [0.0, math.pi, 0.0]).max(axis=1) < distance)
    if not len(near):
        raise AccuracyError(
            "the unstable manifold does not come near the second saddle: there is no connection here"
        )
    return int(near[0])


@dataclass(frozen=True)
class SplittingZero:
    """Omega_h as the zero of the splitting, with the splitting's derivative there and the parts of
    the error.
    """

    omega_h: Measured  #: [rad/s]
    budget: dict[str, float]  #: the parts of the half-width of omega_h, by name [rad/s]
    splitting_function: SplittingFunction  #: in the arithmetic of omega_h
    wider_function: SplittingFunction  #: in the wider arithmetic that measured its error

    @cached_property
    def derivative(self) -> Measured:
        """The derivative with respect to Omega [s/rad] of u |s|^(-lambda_u / lambda_s), a measure
        of the splitting that does not depend on the length of the flights.

        It is a central difference. Its half-width comes from the change under another step and
        another distance from the saddles.
        """
        accurate, slope = (
            function.slope(function.latest.omega)
            for function in (self.wider_function, self.splitting_function)
        )
        return Measured.compared(accurate, slope, self.splitting_function.precision.epsilon)

    def omega_h_derivatives(self) -> dict[str, Measured]:
        """Return the derivatives of Omega_h with respect to the disk's parameters [SI], by name.

        The splitting stays zero, so they are -(du/dp) / (du/dOmega). Their error is measured in the
        way of `derivative`.

        Raises:
            AccuracyError: If a flight fails.
        """
        accurate, coarse = (
            {symbol: -function.parameter_slope(symbol, omega) / slope for symbol in SYMBOLS}
            for function in (self.wider_function, self.splitting_function)
            for omega in (function.latest.omega,)
            for slope in (function.slope(omega),)
        )
        epsilon = self.splitting_function.precision.epsilon
        return {name: Measured.compared(accurate[name], coarse[name], epsilon) for name in SYMBOLS}


@lru_cache(maxsize=_CACHED_ZEROS)
def splitting_zero(
    parameters: Parameters, guess: Fraction, engine: Engine, digits: int
) -> SplittingZero:
    """Return Omega_h to ``digits`` significant digits, as the zero of the splitting. The result is
    cached.

    Args:
        parameters: The disk and its friction law.
        guess: An approximation of Omega_h [rad/s], good to some five digits.
        engine: The engine of the flights.
        digits: The significant digits of Omega_h.

    Raises:
        AccuracyError: If the iteration does not settle, the branch does not arrive, or the digits
            are not reached.
        NoConnectionError: If there are no saddles to connect.
    """
    guard = _GUARD_DIGITS
    while True:
        zero = _zero(parameters, guess, engine, _stages(digits + guard))
        if zero.omega_h.uncertainty <= zero.omega_h.value / 10**digits:
            return zero
        guard *= 2
        if guard > 8 * _GUARD_DIGITS:
            raise AccuracyError(
                f"only {float(zero.omega_h.uncertainty):.1e} rad/s could be had for Omega_h: ask "
                f"for fewer digits"
            )


def _stages(wanted: int) -> list[Precision]:
    """Return a list of arithmetics for Newton's iteration, in order of growing precision.

    The last one has the ``wanted`` digits. Each has about twice the digits of the one before.
    """
    if wanted <= EXTENDED.digits and wider_precision(DOUBLE) == EXTENDED:
        return [EXTENDED]
    stages: list[Precision] = []
    while wanted > QUADRUPLE.digits:
        stages.append(precision_of_bits(bits_for_digits(wanted)))
        wanted = wanted // 2 + _GUARD_DIGITS
    return [QUADRUPLE, *stages[::-1]]


def omega_h_without_half_width(
    parameters: Parameters, guess: Fraction, engine: Engine, digits: int
) -> Measured:
    """Return Omega_h as `splitting_zero` finds it, without a half-width.

    Args:
        parameters: The disk and its friction law.
        guess: An approximation of Omega_h [rad/s], good to some five digits.
        engine: The engine of the flights.
        digits: The significant digits of Omega_h.

    Raises:
        AccuracyError: If the iteration does not settle, or the branch does not arrive.
        NoConnectionError: If there are no saddles to connect.
    """
    _, omega, _ = _root(parameters, guess, engine, _stages(digits + _GUARD_DIGITS))
    return Measured.without_half_width(omega, digits)


def _root(
    parameters: Parameters, guess: Fraction, engine: Engine, stages: Sequence[Precision]
) -> tuple[SplittingFunction, Fraction, _Slope]:
    """Find the zero of the splitting by Newton's method, from ``guess`` through ``stages`` of
    growing precision.

    Returns:
        The splitting function of the last stage, its zero [rad/s], and its slope there.
    """
    omega = _rounded_speed(guess, stages[0])
    splitting_function: SplittingFunction | None = None
    slope: _Slope | None = None
    for precision in stages:
        splitting_function = SplittingFunction(
            parameters, omega, engine, precision, coarser_function=splitting_function
        )
        omega, slope = _newton(splitting_function, omega, slope)
        # The time of a flight grows with the square of the bits: coarser stages come before.
        report_share(_BY_STAGES * (precision.bits / stages[-1].bits) ** 2)
    assert splitting_function
    assert slope
    return splitting_function, omega, slope


def _zero(
    parameters: Parameters, guess: Fraction, engine: Engine, stages: Sequence[Precision]
) -> SplittingZero:
    splitting_function, omega, slope = _root(parameters, guess, engine, stages)
    steepness, precision = abs(slope.value), splitting_function.precision
    wider_function = SplittingFunction(
        parameters,
        omega,
        engine,
        wider_precision(precision),
        distance_factor=0.5,
        coarser_function=splitting_function,
    )
    check = wider_function(omega)
    report_share(_BY_WIDER_RUN)
    budget = {
        "series, flow and rounding, by a wider run": abs(check.invariant)
        / steepness
        * HALF_WIDTH_FACTOR,
        # L(s) leaves out the square of the fast coordinate, with a curvature of order 1.
        "fast direction beyond first order": 10
        * fraction(check.f) ** 2
        * fraction(check.invariant_factor)
        / steepness,
        "last rounding": omega * precision.epsilon,
    }
    return SplittingZero(
        omega_h=Measured(omega, sum(budget.values(), Fraction(0))),
        budget={name: float(width) for name, width in budget.items()},
        splitting_function=splitting_function,
        wider_function=wider_function,
    )


class _Slope(NamedTuple):
    """The derivative of the splitting u with respect to Omega, carried back to s = 1 [s/rad], and a
    bound of its relative error.
    """

    value: Fraction
    relative_error: Fraction


def _newton(
    splitting_function: SplittingFunction, omega: Fraction, slope: _Slope | None
) -> tuple[Fraction, _Slope]:
    """Find the zero [rad/s] of the splitting in one arithmetic, and return it with the slope next
    to it.

    The iteration starts from the slope of a coarser arithmetic, or else from a difference. From the
    second step on it uses the secant's slope if that is better. It ends when the next step would be
    below a thousand roundings. The wider run measures the remaining error.
    """
    resolution = omega * splitting_function.precision.epsilon
    previous: tuple[Fraction, Fraction] | None = None
    for _ in range(_MAX_STEPS):
        value = splitting_function(omega).invariant
        if slope is None:
            slope = _Slope(splitting_function.slope(omega), 1000 * splitting_function.speed_step)
        elif previous is not None and previous[0] != omega:
            step = omega - previous[0]
            error = _MAX_CURVATURE * abs(step) + 1000 * resolution / abs(step)
            secant = _Slope((value - previous[1]) / step, error)
            slope = min(slope, secant, key=lambda candidate: candidate.relative_error)
        if not slope.value:
            raise AccuracyError(
                "the splitting does not depend on Omega: there is no isolated connection"
            )
        change = -value / slope.value
        previous = omega, value
        omega = _rounded_speed(omega + change, splitting_function.precision)
        if (
            abs(change) * max(_MAX_CURVATURE * abs(change), slope.relative_error)
            < 1000 * resolution
        ):
            return omega, slope
    raise AccuracyError(
        "the iteration for Omega_h does not settle: check the approximation from which it starts"
    )


def _rounded_to_three_digits(value: float) -> Fraction:
    """Return a double rounded to three significant digits, as a fraction.

    Such a value is exact, and the same, in every arithmetic.
    """
    return Fraction(f"{value:.2e}")


def _rounded_speed(omega: Fraction, precision: Precision) -> Fraction:
    """Round a speed to a few bits more than the arithmetic has, so that the fraction does not grow
    from step to step.
    """
    scale = 1 << (precision.bits + 8)
    return Fraction(round(omega * scale), scale)
