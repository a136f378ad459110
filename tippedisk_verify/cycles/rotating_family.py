"""The family of rotating limit cycles: from the connection at Omega_h through its fold and on to higher speeds.

Below Omega_h the unstable branch of the saddle goes over the top and leads to the stable rotating cycle. The family is
followed from there by arclength in the space of (beta_bar, v, Omega) at gamma = pi/2, because it turns round in a fold:
beyond that its cycles are unstable and lie at rising speeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import Any

from tippedisk_verify.connection.bisection import bisect_omega_h
from tippedisk_verify.cycles.section import ROUND
from tippedisk_verify.cycles.turn_map import TurnFlights
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Request, Status
from tippedisk_verify.model.exact import Exact, fraction
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = ["RotatingFamily", "RotationPoint", "unstable_top"]

_FIRST = Fraction(9997, 10000)  # of Omega_h: where double has the cycle to all digits, and the unstable branch leads
_FIRST_STEP, _LONGEST_STEP, _SHORTEST_STEP = 0.02, 0.1, 1e-6  # of arclength
_EASY, _MOST_CORRECTIONS = 3, 8  # steps of Newton's iteration
_SETTLED = 1e-10  # of a step; the next one would be rounding
_STRAIGHT = 0.9  # cosine of the angle that the direction may turn in a step
_MOST_POINTS = 4000
_REAL = 1e-6  # what rounding may add to a root of a cubic
_LONGEST_FLIGHT = 200.0  # s


@dataclass(frozen=True)
class RotationPoint:
    """A cycle of the family in double, with the family's direction there."""

    at: tuple[float, float, float]  #: (beta_bar, v, Omega) at gamma = pi/2
    tangent: tuple[float, float, float]  #: unit vector, away from the connection
    period: float  #: [s]
    period_rate: float  #: its derivative along the tangent

    @property
    def omega(self) -> float:
        return self.at[2]


def unstable_top(parameters: Parameters, omega: Fraction, engine: Engine, precision: Precision = DOUBLE) -> list[Any]:
    """(beta_bar, v) where the unstable branch of noninverted spinning first passes gamma = pi/2.

    Its start on the branch's power series is good to the precision. Raises NoSuchCycleError if it does not get there.
    """
    saddle = Saddle(parameters, omega, precision.bits + 16, 7)
    distance = Fraction(1, 1 << (precision.bits // 6))
    ctx = saddle.context
    beta, gamma, v = (fraction(curve.at(ctx.mpf(distance.numerator) / distance.denominator))
                      for curve in saddle.unstable_curve)  # fmt: skip
    start = (beta, Exact(gamma, Fraction(-1)), v)
    request = Request(
        parameters, omega, start, _LONGEST_FLIGHT, shifted=True, precision=precision, events=(ROUND,), domain="none"
    )
    result = engine(request)
    if result.status is not Status.EVENT:
        raise NoSuchCycleError("the saddle's unstable branch does not pass gamma = pi/2")
    return [result.state[0], result.state[2]]


class RotatingFamily:
    """The family of one disk, followed in double as far as it has been asked for."""

    def __init__(self, parameters: Parameters, engine: Engine) -> None:
        self.parameters, self.engine = parameters, engine
        #: Where the family begins [rad/s], as double sees it.
        self.omega_h = bisect_omega_h(parameters, engine, confirm=False).omega_h.value
        self.points = [self.nearer(float(self.omega_h * _FIRST))]
        self._step = _FIRST_STEP

    def guess(self, omega: float, *, stable: bool) -> tuple[float, float]:
        """(beta_bar, v) of the cycle at a speed [rad/s]: before the fold the stable one, beyond it the unstable one.

        Raises NoSuchCycleError where the family has none.
        """
        if stable and omega >= self.omega_h:
            raise NoSuchCycleError(
                f"no stable rotating cycle found at {omega:.10g} rad/s: they are looked for below Omega_h, "
                f"{float(self.omega_h):.10g} rad/s"
            )
        if stable and omega > self.points[0].omega:
            beta, v = unstable_top(self.parameters, Fraction(omega), self.engine)
            return float(beta), float(v)
        for before, here in self.stretches():
            if (state := _at_speed(before, here, omega, falling=stable)) is not None:
                return state
            if here.tangent[2] > 0 and (stable or here.omega > omega):
                raise NoSuchCycleError(
                    f"the rotating cycles turn round in a fold near {self.near_fold().omega:.6g} rad/s, "
                    f"above {omega:.10g} rad/s"
                )
        raise AssertionError("the family goes on until it raises")

    def near_fold(self) -> RotationPoint:
        """The point of the family closest to its fold, where Omega is smallest."""
        for before, here in self.stretches():
            if here.tangent[2] >= 0:
                return min(before, here, key=lambda point: abs(point.tangent[2]))
        raise AssertionError("the family goes on until it raises")

    def nearer(self, omega: float) -> RotationPoint:
        """The stable cycle at a speed a little below Omega_h. Raises NoSuchCycleError where it is not found."""
        beta, v = unstable_top(self.parameters, Fraction(omega), self.engine)
        # Omega itself is held; it falls along the family.
        return self._corrected((float(beta), float(v), omega), (0.0, 0.0, -1.0))[0]

    def stretches(self) -> Iterator[tuple[RotationPoint, RotationPoint]]:
        """Neighbouring points, away from the connection; further ones are found when they are asked for.

        Raises NoSuchCycleError where the family ends.
        """
        for index in count(1):
            if index == len(self.points):
                self._further()
            yield self.points[index - 1], self.points[index]

    def _further(self) -> None:
        """One more point, by a tangent step and Newton's iteration in the plane across its end."""
        here = self.points[-1]
        while True:
            ahead = tuple(x + self._step * part for x, part in zip(here.at, here.tangent, strict=True))
            with suppress(NoSuchCycleError):
                point, corrections = self._corrected(ahead, here.tangent)
                if _along(point.tangent, here.tangent) > _STRAIGHT:
                    break
            self._step /= 2
            if self._step < _SHORTEST_STEP or len(self.points) > _MOST_POINTS:
                raise NoSuchCycleError(f"the family of rotating cycles ends near {here.omega:.6g} rad/s")
        self.points.append(point)
        if corrections <= _EASY:
            self._step = min(1.5 * self._step, _LONGEST_STEP)

    def _corrected(self, at: Sequence[float], direction: Sequence[float]) -> tuple[RotationPoint, int]:
        """The family's point in the plane through ``at`` across the direction, and the steps that it took."""
        import numpy

        for corrections in range(_MOST_CORRECTIONS):
            beta, v, omega = map(float, at)
            mapped = TurnFlights(self.parameters, omega, self.engine, DOUBLE).map((beta, v))
            (a, b), (c, d) = mapped.matrix
            rows = numpy.array([[a - 1, b, mapped.by_omega[0]], [c, d - 1, mapped.by_omega[1]], direction])
            step = numpy.linalg.solve(rows, [*mapped.residual, 0.0])
            at = (beta - step[0], v - step[1], omega - step[2])
            if numpy.abs(step).max() < _SETTLED:
                tangent = numpy.linalg.solve(rows, [0.0, 0.0, 1.0])
                tangent /= numpy.linalg.norm(tangent)
                rate = float(numpy.dot((*mapped.time_by_state, mapped.time_by_omega), tangent))
                point = RotationPoint((beta, v, omega), tuple(tangent.tolist()), float(mapped.time), rate)
                return point, corrections
        raise NoSuchCycleError("the correction has not converged: take a smaller step")


def _along(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _at_speed(before: RotationPoint, here: RotationPoint, omega: float, *, falling: bool) -> tuple[float, float] | None:
    """(beta_bar, v) at a speed on the cubic through two neighbours, where Omega falls or rises along it; or None."""
    import numpy

    length = math.dist(before.at, here.at)
    start, end = numpy.array(before.at), numpy.array(here.at)
    slope, last = length * numpy.array(before.tangent), length * numpy.array(here.tangent)
    cubic = numpy.array([2 * (start - end) + slope + last, 3 * (end - start) - 2 * slope - last, slope, start])
    speed = cubic[:, 2] - [0.0, 0.0, 0.0, omega]
    for root in numpy.roots(speed):
        share = float(root.real)
        rate = numpy.polyval(numpy.polyder(speed), share)
        if abs(root.imag) < _REAL and -_REAL <= share <= 1 + _REAL and (rate < 0) == falling:
            beta, v = numpy.polyval(cubic[:, 0], share), numpy.polyval(cubic[:, 1], share)
            return float(beta), float(v)
    return None
