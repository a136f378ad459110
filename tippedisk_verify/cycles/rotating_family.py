"""The family of rotating limit cycles: from the connection at Omega_h through its fold and on to higher speeds.

Below Omega_h the unstable branch of the saddle goes over the top and leads to the stable rotating cycle. From there on
the disk leans more and more at the top of its turn: beta_bar_top rises from what it is at the connection towards pi/2,
through the fold in Omega, beyond which the cycles are unstable and lie at rising speeds. That range over tanh(s) is the
abscissa.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy

from tippedisk_verify.cycles.family import Family, Place, Solver, one_at_a_time
from tippedisk_verify.cycles.return_map import ReturnMap
from tippedisk_verify.cycles.section import ROTATING, ROUND
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Engine, Request, Status
from tippedisk_verify.model.exact import Exact, fraction
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE, Precision
from tippedisk_verify.theory.saddle_manifolds import Saddle

__all__ = ["RotatingFamily", "unstable_top"]

_NODES = 20  # of a panel; the polynomials then err by rounding
_GUESSING_NODES = 10  # where they only guess: by some 1e-8
_FIRST = 1 - Fraction(12, 10**5)  # of Omega_h; closer, and doubles do not hold T to twelve digits
_MOST_PANELS = 16  # beta_bar_top is then within 1e-5 of pi/2
_LONGEST_FLIGHT = 200.0  # s


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


class RotatingFamily(Family):
    """The family of one disk below ``omega_h`` [rad/s], its own, and beyond the fold as far as it has been asked for.

    ``solve`` finds cycles of given beta_bar_top, on nodes that leave rounding only; without it the engine does, one at
    a time, on fewer nodes, for guesses. Raises NoSuchCycleError where the family does not begin.
    """

    section = ROTATING

    def __init__(self, parameters: Parameters, engine: Engine, omega_h: Fraction, solve: Solver | None = None) -> None:
        super().__init__(parameters, engine, solve, _GUESSING_NODES if solve is None else _NODES)
        self.omega_h = omega_h
        self._lowest = float(unstable_top(parameters, omega_h, engine)[0])
        first = omega_h * _FIRST
        beta, v = map(float, unstable_top(parameters, first, engine))
        if not self._lowest < beta:
            raise NoSuchCycleError("no rotating cycle found below Omega_h: the unstable branch leans less there")
        s = float(self.abscissa(beta))
        flight = float(ReturnMap(ROTATING, parameters, first, engine).flight((beta, v)).time)
        guess = (numpy.array([part]) for part in (beta, v, flight, float(first)))
        row = numpy.array(one_at_a_time(ROTATING, parameters, engine)(*guess))[:, 0]
        if not numpy.isfinite(row).all():
            raise NoSuchCycleError(f"no rotating cycle found at {float(first):.10g} rad/s, next to Omega_h")
        self.begin((s, *row[:3], *(row[3:] * self.coordinate_rate(s))))
        self.extend()

    def coordinate(self, s: Any) -> Any:
        return self._lowest + (math.pi / 2 - self._lowest) / (1 + numpy.exp(-2 * s))

    def coordinate_rate(self, s: Any) -> Any:
        return (math.pi / 2 - self._lowest) / 2 / numpy.cosh(s) ** 2

    def abscissa(self, coordinate: Any) -> Any:
        return numpy.log((coordinate - self._lowest) / (math.pi / 2 - coordinate)) / 2

    def scale(self, s: Any) -> Any:
        return numpy.ones_like(s)

    def scale_rate(self, s: Any) -> Any:
        return numpy.zeros_like(s)

    def reach(self, omega: float) -> None:
        """Follow the family beyond its fold to a speed [rad/s]. Raises NoSuchCycleError if it ends before."""
        while self.nodes[-1, 6] < 0 or self.nodes[-1, 3] < omega:
            try:
                if len(self._panels) == _MOST_PANELS:
                    raise NoSuchCycleError("beta_bar_top has reached pi/2")
                self.extend()
            except NoSuchCycleError:
                end = f"the family of rotating cycles ends near {self.nodes[-1, 3]:.6g} rad/s"
                raise NoSuchCycleError(end) from None

    def near_fold(self) -> Place:
        """The fold, where Omega is smallest, to some digits. Raises NoSuchCycleError where there is none."""
        self.reach(0.0)
        if not self.folds:
            raise NoSuchCycleError("the speeds of the rotating cycles rise from Omega_h on: they have no fold")
        return self.place(self.folds[0])

    def guess(self, omega: float, *, stable: bool) -> tuple[float, float]:
        """(beta_bar, v) of the cycle at a speed [rad/s]: before the fold the stable one, beyond it the unstable one.

        Raises NoSuchCycleError where the family has none.
        """
        if stable and omega >= self.omega_h:
            raise NoSuchCycleError(
                f"no stable rotating cycle found at {omega:.10g} rad/s: they are looked for below Omega_h, "
                f"{float(self.omega_h):.10g} rad/s"
            )
        if stable and omega > self.nodes[0, 3]:
            beta, v = unstable_top(self.parameters, Fraction(omega), self.engine)
            return float(beta), float(v)
        self.reach(0.0 if stable else omega)
        (s,) = self.abscissas_where(numpy.array([omega]), stable)
        if math.isfinite(s):
            return self.place(float(s)).start
        raise NoSuchCycleError(
            f"the rotating cycles turn round in a fold near {self.near_fold().omega:.6g} rad/s, "
            f"above {omega:.10g} rad/s"
        )
