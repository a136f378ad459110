"""The boundary between starts that keep standing and starts that lie flat.

It consists of the stable manifolds of the unstable rotating cycles. An orbit near such a surface
follows the unstable rotating cycle for some turns and then leaves it to one side. Its coordinate
along the cycle's unstable direction shows which side, and how far. The coordinate is taken at gamma
= pi/2 after as many turns as the fast direction takes to decay. It grows with beta and is zero on
the surface. The point symmetry gives the sheet of the other lean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from tippedisk_verify.cycles.cycle_at_speed import rotating_cycle_at
from tippedisk_verify.cycles.shooting.return_map import ReturnMap
from tippedisk_verify.cycles.shooting.section import ROTATING
from tippedisk_verify.display import Printable
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import (
    GAMMA_TOP,
    SECTION,
    Engine,
    Event,
    Request,
    Result,
    Status,
)
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.motion.basins import MAX_ABS_V
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE

__all__ = ["BasinBoundary"]

_DECAY_EXPONENT = 37.0  # exp(-37), the rest of the fast direction, is below a double's rounding
_MIN_TURNS, _MAX_TURNS = 2, 60
_TRANSIENT = 0.5  # s after which a start with any v is on the slow manifold
# A half-width in units of the distance between roots after different numbers of turns, as for
# cycles (see `error_budget`).
_ROOT_FACTOR = 4
_SEARCH_RADIUS = 1e-6  # rad about a root, in which the root after another number of turns lies
_INFINITE_DISTANCE = math.pi  # rad; stands for an infinite distance from the sheet
_ROUNDINGS = Fraction(1, 10**14)  # rad; the effect of the last bits of the start and of pi


class BasinBoundary(Printable):
    """The boundary between starts that keep standing and starts that lie flat, at one speed, in
    double.

    It consists of two sheets, each a graph of beta over (gamma, v). Starts between the sheets keep
    standing, the others lie flat.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        engine: The integrator.

    Raises:
        InputError: If ``omega`` is not a speed.
        NoSuchCycleError: If there is no unstable rotating cycle. Below the fold of the rotating
            cycles every start lies flat.
    """

    _listed = ("omega", "cycle")

    def __init__(self, parameters: Parameters, omega: object, engine: Engine) -> None:
        self.parameters, self.engine, self.omega = parameters, engine, checked_speed(omega)
        #: The unstable rotating cycle. Its stable manifold is the sheet of larger beta.
        self.cycle = rotating_cycle_at(parameters, self.omega, engine, stable=False)
        self._top = float(self.cycle.beta_bar_top), float(self.cycle.v_top)
        (_, b), (_, d) = ReturnMap(ROTATING, parameters, self.omega, engine)(self._top).jacobian
        # (1, w), the left eigenvector of the turn map's derivative, extracts that coordinate from a
        # difference.
        self._weight = b / (float(self.cycle.multiplier_slow) - d)
        decay_turns = _DECAY_EXPONENT / -float(self.cycle.log_multiplier_fast)
        self._turns = min(_MAX_TURNS, max(_MIN_TURNS, math.ceil(decay_turns)))

    def margin(self, state: Sequence[float]) -> Measured:
        """Return the distance in beta [rad] of a state from the basin boundary.

        It is positive if the disk keeps standing.

        Args:
            state: (beta [rad], gamma [rad], v [rad/s]).

        Raises:
            InputError: If beta does not lie between 0 and pi, or v is too large.
        """
        beta, gamma, v = DOUBLE.array(state).tolist()
        if not 0 < beta < math.pi:
            raise InputError(f"beta lies between 0 and pi, not at {beta:g}")
        if not abs(v) <= MAX_ABS_V:
            raise InputError(
                f"v must lie between -{MAX_ABS_V:g} and {MAX_ABS_V:g} rad/s, not {v:g}"
            )
        lower, upper = self.sheets(gamma, v)
        lean = Measured(Fraction(beta), Fraction(0))
        return min(lean - lower, upper - lean, key=lambda margin: margin.value)

    def sheets(self, gamma: float, v: float) -> tuple[Measured, Measured]:
        """Return beta [rad] on the lower and the upper sheet of the basin boundary at (gamma, v).

        A sheet beyond the states in which the disk lies flat has beta = 0 or pi.

        Args:
            gamma: [rad].
            v: [rad/s].
        """
        gamma, v = DOUBLE.number(gamma), DOUBLE.number(v)
        pi = Measured(Fraction(math.pi), Fraction(1, 2**52))
        return pi - self._upper(math.pi - gamma, -v), self._upper(gamma, v)

    def _upper(self, gamma: float, v: float) -> Measured:
        """Return beta [rad] on the upper sheet of the basin boundary, at (gamma, v).

        The half-width comes from the distance to the root that one more turn gives.
        """
        root = self._root(gamma, v, self._turns, (0.0, math.pi))
        nearby = max(0.0, root - _SEARCH_RADIUS), min(math.pi, root + _SEARCH_RADIUS)
        again = self._root(gamma, v, self._turns + 1, nearby)
        width = _ROOT_FACTOR * abs(Fraction(root) - Fraction(again)) + _ROUNDINGS
        return Measured(Fraction(root), width)

    def _root(self, gamma: float, v: float, turns: int, between: tuple[float, float]) -> float:
        """Return beta [rad] on a sheet of the basin boundary, found in an interval by the sign of
        `_beyond`.

        The ends of the interval stand for states on either side of the sheet.
        """
        from scipy.optimize import brentq

        def beyond(beta: float) -> float:
            if beta in between:
                return -_INFINITE_DISTANCE if beta == between[0] else _INFINITE_DISTANCE
            return min(
                max(self._beyond((beta, gamma, v), turns), -_INFINITE_DISTANCE), _INFINITE_DISTANCE
            )

        return float(brentq(beyond, *between, xtol=1e-15, rtol=1e-15))

    def _beyond(self, state: tuple[float, float, float], turns: int) -> float:
        """Return the distance [rad] by which an orbit lies beyond the upper sheet of the basin
        boundary, that of larger beta, after some turns of gamma.

        Return infinity if the disk falls flat on the side of larger beta first, and minus infinity
        if it comes upright or falls flat on the other side.
        """
        first = self._integrate(state, _TRANSIENT, ())
        beta, gamma, v = first.state.tolist()
        if first.status is Status.FLAT:
            return math.inf if beta > math.pi / 2 else -math.inf
        if beta < math.pi / 2:
            return -math.inf
        # The turns of orbits farther inside take longer
        long = (turns + 2) * 4 * float(self.cycle.period)
        result = self._integrate((beta, gamma, v), long, (GAMMA_TOP, SECTION))
        tops = [record.state.tolist() for record in result.events if record.name == GAMMA_TOP.name]
        if len(tops) < turns:
            return math.inf if result.status is Status.FLAT else -math.inf
        beta, _, v = tops[turns - 1]
        return float(beta - math.pi / 2 - self._top[0] + self._weight * (v - self._top[1]))

    def _integrate(
        self, state: tuple[float, float, float], duration: float, events: tuple[Event, ...]
    ) -> Result:
        """Integrate from a state for a duration [s], or until the disk lies flat or an event ends
        the run.

        A run whose orbit comes to rest stops at the step limit. Its start counts as one that keeps
        standing.
        """
        return self.engine(
            Request(self.parameters, self.omega, state, duration, events=events, domain="event")
        )
